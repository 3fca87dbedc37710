"""Where a robot goes for a target: onto its point, or to the nearest cell beside it that will do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from bimnav import _checks
from bimnav.grid import Cell

__all__ = ["Approach", "Stand", "Stop", "Unreached", "given_up"]

Approach = Literal["center", "standing", "reach", "space"]


class Stand(NamedTuple):
    """One place from which a target is served.

    Parameters
    ----------
    cell
        Where the search ends.
    end
        Where the robot comes to stand, metres.
    distance
        From `end` to the target's destination, metres.
    heading
        Which way the robot faces there, radians counter-clockwise from x; None where it does not matter.
    """

    cell: Cell
    end: tuple[float, float, float]
    distance: float = 0.0
    heading: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """One goal of a tour.

    Parameters
    ----------
    cell
        Where the search ends.
    destination
        The target's own exact point, metres.
    end
        Where the robot comes to stand: the destination, or the middle of the cell for `standing`.
    approach
        `center`: on the destination. `standing`: next to it, because its cell is blocked.
        `reach`: on it although its cell is blocked, as in the paper. `space`: anywhere in its room.
    distance
        From `end` to `destination`, metres.
    heading
        Which way the robot faces, radians counter-clockwise from x; None where it does not matter.
    candidates
        Every place from which the target may be served, best first; the stop's own among them. A planner
        may choose any, by `at`.
    service_time
        Seconds the robot works there; None for the task's.
    priority
        Stops of a higher priority are served before those of a lower one.
    due
        Seconds from the start of the tour by which the work is to be done; None for any time.
    abilities
        What a robot must be able to do there.
    kind
        `target`, or `charger`, where the robot fills its battery.
    """

    global_id: str
    name: str
    cell: Cell
    destination: tuple[float, float, float]
    end: tuple[float, float, float]
    approach: Approach = "center"
    distance: float = 0.0
    source: Literal["model", "user"] = "model"
    heading: float | None = None
    candidates: tuple[Stand, ...] = ()
    service_time: float | None = None
    priority: float = 1.0
    due: float | None = None
    abilities: tuple[str, ...] = ()
    kind: Literal["target", "charger"] = "target"

    def __post_init__(self) -> None:
        _checks.fields(self, numbers="service_time priority due")
        own = Stand(self.cell, self.end, self.distance, self.heading)
        object.__setattr__(self, "candidates", tuple(self.candidates) or (own,))

    def at(self, stand: Stand) -> Stop:
        """Return the stop served from another of its candidates."""
        return replace(self, cell=stand.cell, end=stand.end, distance=stand.distance, heading=stand.heading)


@dataclass(frozen=True, slots=True, eq=False)
class Unreached:
    """A target that is not served, and why.

    Parameters
    ----------
    reason
        In words, with what is in the way.
    cell
        The cell of its destination, if there is one.
    miss
        How far the nearest place is off, metres: beyond the robot's reach, or above it; 0 where only
        sight is missing, None where it is not known.
    blocking
        GlobalIds of what is in the way.
    """

    global_id: str
    name: str
    destination: tuple[float, float, float]
    reason: str
    cell: Cell | None = None
    miss: float | None = None
    blocking: tuple[str, ...] = ()


def given_up(stop: Stop, reason: str) -> Unreached:
    """Return a stop as one that is not served."""
    return Unreached(stop.global_id, stop.name, stop.destination, reason, stop.cell)
