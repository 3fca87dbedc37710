"""Motions of robots that are not round, in plan view."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.affinity import affine_transform

from bimnav import _checks
from bimnav.errors import GeometryError
from bimnav.verify._verdict import Check, Owner, Violation, refusal, who
from bimnav.verify._world import GAP, SAME, SLACK, World, surroundings

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment

__all__ = ["check_poses"]

_TURN_STEP = math.radians(0.25)
_CHORDS = 64  # of a round outline


def check_poses(poses: ArrayLike, environment: IndoorEnvironment, *, ignore: Collection[str] = ()) -> Check:
    """Judge a motion of a robot that is not round, in plan view: all that its outline sweeps.

    From pose to pose the outline either moves straight without turning or turns on the spot the short way.
    Straight moves are judged exactly; turns at every quarter of a degree, which misses less than a hundred
    thousandth of the outline's reach. The body in space is not judged.

    Parameters
    ----------
    poses : (n, 4) float64
        x, y and z in world metres, z a level of the environment, and the heading in radians
        counter-clockwise from x.
    environment
        Regions, obstacles, zones, and the robot, whose outline is taken; without one, a disc.
    ignore
        GlobalIds of obstacles that may be touched.

    Raises
    ------
    GeometryError
        If `poses` has another shape.
    """
    _checks.need("environment", environment, "IndoorEnvironment")
    motion = _checks.numbers("poses", poses)
    if motion.ndim != 2 or motion.shape[1] != 4:
        raise GeometryError(f"a motion has shape {motion.shape}.", "Give an array of shape (n, 4): x, y, z, heading.")
    world = surroundings(environment, ignore)
    fault = _fault(motion, world)
    if fault is not None:
        return Check((*world.unknown, fault))
    ground = _ground(world, int(np.argmax(np.abs(world.levels - motion[0, 2]) <= SAME)))
    outline = shapely.Polygon(environment.robot.outline or _ring(world.radius))
    torn: list[Violation] = []
    worst: dict[tuple[str, str], Violation] = {}
    length, clearance = 0.0, math.inf
    for before, after in zip(motion, motion[[*range(1, len(motion)), -1]], strict=True):
        swept = _swept_by_outline(outline, before, after)
        if swept is None:
            text = "the robot moves and turns at once"
            torn.append(refusal("teleport", text, before[:3], storey=ground.storey))
            continue
        stands = (before[:2] == after[:2]).all()
        middle = shapely.Point(before[:2]) if stands else shapely.LineString([before[:2], after[:2]])
        length += middle.length
        gap, contacts = _contacts(swept, ground, before[:3])
        clearance = min(clearance, gap)
        for said in (*contacts, *_strays(swept, middle, ground, before[:3])):
            key = said.kind, said.global_id
            if key not in worst or worst[key].depth < said.depth:
                worst[key] = said
    found = (*world.unknown, *torn, *sorted(worst.values(), key=lambda v: -v.depth))
    return Check(found, clearance, None, length)


def _fault(motion: NDArray[np.float64], world: World) -> Violation | None:
    """Say why a motion cannot be judged at all; None if it can."""
    if not len(motion):
        return refusal("empty", "the motion has no pose")
    if not np.isfinite(motion).all():
        return refusal("not-finite", "the motion has poses that are not finite")
    if not (np.abs(world.levels - motion[0, 2]) <= SAME).any() or np.ptp(motion[:, 2]) > SAME:
        return refusal("no-storey", "the motion is not on one storey", motion[0, :3])
    return None


class _Ground(NamedTuple):
    """One storey of the world."""

    storey: int
    obstacles: Sequence[tuple[BaseGeometry, Owner]]
    zones: Sequence[tuple[BaseGeometry, Owner]]
    floor: BaseGeometry


def _ground(world: World, storey: int) -> _Ground:
    floors = shapely.union_all([floor for where, floor in world.floors if where == storey])
    footprints = zip(world.storeys, world.footprints, world.owners, strict=True)
    return _Ground(
        storey,
        [(shape, owner) for where, shape, owner in footprints if where == storey],
        [(zone, owner) for where, zone, owner in world.restricted if where == storey],
        shapely.buffer(floors, GAP, join_style="mitre"),
    )


def _contacts(swept: BaseGeometry, ground: _Ground, place: NDArray[np.float64]) -> tuple[float, list[Violation]]:
    """Return the clearance of what is swept, and the footprints it reaches into."""
    clearance, found = math.inf, []
    for shape, owner in ground.obstacles:
        gap = float(shapely.distance(swept, shape))
        clearance = min(clearance, gap)
        if gap > 0:
            continue
        depth = _overlap(swept, shape)
        clearance = min(clearance, -depth)
        if depth > SLACK:
            text = f"the robot reaches into {who(owner)}"
            found.append(refusal("footprint", text, place, depth, owner, ground.storey))
    return clearance, found


def _strays(
    swept: BaseGeometry, middle: BaseGeometry, ground: _Ground, place: NDArray[np.float64]
) -> Iterator[Violation]:
    """Yield the zones that the middle of the robot enters, and whether what is swept leaves the floor."""
    for zone, owner in ground.zones:
        if shapely.relate_pattern(middle, zone, "T********"):
            yield refusal("restricted", f"the robot enters {who(owner)}", place, 0.0, owner, ground.storey)
    if shapely.difference(swept, ground.floor).area > SAME:
        yield refusal("off-floor", "the robot leaves the floor", place, storey=ground.storey)


def _ring(radius: float) -> list[tuple[float, float]]:
    angle = np.linspace(0, 2 * math.pi, _CHORDS, endpoint=False)
    reach = max(radius, SAME)
    return list(zip((reach * np.cos(angle)).tolist(), (reach * np.sin(angle)).tolist(), strict=True))


def _at_pose(outline: BaseGeometry, x: float, y: float, angle: float) -> BaseGeometry:
    c, s = math.cos(angle), math.sin(angle)
    return affine_transform(outline, [c, -s, s, c, x, y])


def _swept_by_outline(
    outline: BaseGeometry, before: NDArray[np.float64], after: NDArray[np.float64]
) -> BaseGeometry | None:
    """Return what an outline sweeps from pose to pose; None if it moves and turns at once."""
    turn = math.remainder(float(after[3] - before[3]), 2 * math.pi)
    moves = math.hypot(*(after[:2] - before[:2])) > SLACK
    if moves and abs(turn) > SAME:
        return None
    begin = _at_pose(outline, before[0], before[1], before[3])
    if not moves:
        count = max(1, math.ceil(abs(turn) / _TURN_STEP))
        angles = before[3] + turn * np.arange(count + 1) / count
        return shapely.union_all([_at_pose(outline, before[0], before[1], float(angle)) for angle in angles])
    # what an edge sweeps is a parallelogram
    ring = shapely.get_coordinates(begin)
    by = after[:2] - before[:2]
    corners = np.stack([ring[:-1], ring[1:], ring[1:] + by, ring[:-1] + by], axis=1)
    sheets = shapely.convex_hull(shapely.multipoints(corners))
    return shapely.union_all([begin, *sheets, _at_pose(outline, after[0], after[1], before[3])])


def _overlap(swept: BaseGeometry, shape: BaseGeometry) -> float:
    """Return how wide the common part of a shape and of what is swept is, metres; 0 if they only touch."""
    common = [part for part in shapely.get_parts(shapely.intersection(swept, shape)) if part.area > 0]
    widths = [2 * shapely.maximum_inscribed_circle(part).length for part in common]
    if not widths and shapely.relate_pattern(swept, shape, "T********"):
        return SAME  # a footprint without area
    return float(max(widths, default=0.0))
