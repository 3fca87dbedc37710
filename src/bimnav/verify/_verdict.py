"""The verdict of the judge: what is wrong with a path, and where."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bimnav.errors import UnsafePlanError

__all__ = ["Check", "Kind", "Owner", "Violation", "refusal", "who"]

Kind = Literal[
    "empty",
    "missing-leg",
    "not-finite",
    "wrong-start",
    "teleport",
    "wrong-end",
    "no-storey",
    "storey-jump",
    "climb",
    "unknown-shape",
    "footprint",
    "body",
    "inside",
    "restricted",
    "off-floor",
    "out-of-reach",
    "hidden",
]
Owner: TypeAlias = tuple[str, str]  # GlobalId and name  # GlobalId and name


@dataclass(frozen=True, slots=True)
class Violation:
    """Why a path is refused.

    Parameters
    ----------
    kind
        `footprint`: the robot reaches into an obstacle in plan view. `body`: its body meets a mesh.
        `inside`: its body lies wholly in a solid. `restricted`: its middle enters a zone where it must
        never be. `off-floor`: it leaves the floor. `out-of-reach`: it stands farther from a target, or lower,
        than it reaches. `hidden`: a wall stands between it and its target. `climb`: it takes a stair, ramp or
        lift that the robot cannot use. All others: the path cannot be judged, or is torn.
    message
        What was found, where, and how deep.
    point : (x, y, z), metres
        Where; None if there is no such place.
    depth
        How far the obstacle reaches in, seen from the rim of the robot; how far off the floor; how wide
        the tear. Metres; 0 where it has no meaning.
    global_id, name
        Of the element; empty without one.
    storey
        Index of the storey, or None.
    leg
        Number of the leg; None for a path that is checked alone.
    """

    kind: Kind
    message: str
    point: tuple[float, float, float] | None = None
    depth: float = 0.0
    global_id: str = ""
    name: str = ""
    storey: int | None = None
    leg: int | None = None


@dataclass(frozen=True, slots=True)
class Check:
    """The verdict on a path.

    Parameters
    ----------
    violations
        Worst first: what cannot be judged, then by depth; at most one of a kind for each element and leg.
    clearance
        Smallest distance in plan view from the body's surface to an obstacle's footprint, metres; negative
        where they overlap, inf without obstacles.
    clearance_3d
        Smallest distance in space from the body's surface to an obstacle's mesh, metres, good to a few
        millimetres around bends; 0 where they meet, inf if nothing is within a metre. None if the body
        was not checked.
    checked_length
        Metres of path that were judged.
    """

    violations: tuple[Violation, ...] = ()
    clearance: float = math.inf
    clearance_3d: float | None = None
    checked_length: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether the path may be driven."""
        return not self.violations

    def raise_if_unsafe(self) -> None:
        """Refuse the path.

        Raises
        ------
        UnsafePlanError
            If there is a violation; the message names the worst.
        """
        if self.ok:
            return
        worst, others = self.violations[0], len(self.violations) - 1
        raise UnsafePlanError(
            f"the check refused the path: {worst.message}{f', and {others} more' if others else ''}.",
            "Do not drive it. If bimnav planned it, please report it with the model.",
            {
                "kind": worst.kind,
                "global_id": worst.global_id,
                "name": worst.name,
                "point": worst.point,
                "depth": worst.depth,
                "storey": worst.storey,
                "leg": worst.leg,
                "violations": len(self.violations),
            },
        )


def refusal(
    kind: Kind,
    text: str,
    place: ArrayLike | None = None,
    depth: float = 0.0,
    owner: Owner = ("", ""),
    storey: int | None = None,
    leg: int | None = None,
) -> Violation:
    """Return a violation; its message ends with the place, and with the leg if there is one."""
    point = None
    if place is not None:
        x, y, z = np.asarray(place, dtype=np.float64).tolist()
        point = (x, y, z) if math.isfinite(x + y + z) else None
        text += f" at ({x:.3f}, {y:.3f}, {z:.3f})" + ("" if leg is None else f" on leg {leg}")
    return Violation(kind, text, point, depth, *owner, storey, leg)


def who(owner: Owner) -> str:
    """Name an element in a sentence."""
    global_id, name = owner
    return f"{name or 'an unnamed element'} ({global_id})" if global_id else name
