"""The independent judge of standing stops: the target must be in reach, with no wall in between.

It shares nothing with the planner that chose the stops. It looks at walls, slabs, roofs and windows alone, and gives
the benefit of the doubt: what it refuses is wrong beyond question.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bimnav.building import Element
    from bimnav.environment import IndoorEnvironment
    from bimnav.stops import Stop

__all__ = ["Unserved", "unserved"]

_WALLS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcWindow", "IfcSlab", "IfcRoof")
_THIN = 0.1  # metres; panels of a raised floor, and finishes, are lifted
_SLACK = 1e-6  # metres
_SHORT = 0.02  # metres by which a line ends before its point, which may lie on a wall
_ARM = 0.1  # metres above the floor, where a robot reaches lowest
_MOST = 300  # points of a target that are looked at


class Unserved(NamedTuple):
    """A stop from which its target is not served, and why."""

    kind: Literal["out-of-reach", "hidden"]
    text: str
    leg: int
    stop: Stop
    depth: float


def unserved(stops: Sequence[Stop], environment: IndoorEnvironment) -> Iterator[Unserved]:
    """Find the standing stops that are too far from their target, or behind a wall from it."""
    boxes = [
        (wall, box)
        for wall in environment.building.elements
        if wall.ifc_class.startswith(_WALLS) and (box := wall.bounds) is not None
    ]
    left_out = {g for g, why in environment.left_out if why.startswith(("ignored", "target", "entourage"))}
    known = [(wall, box) for wall, box in boxes if wall.global_id not in left_out]
    for leg, stop in enumerate(stops):
        # a tour made by hand may have stops that say no more than where they end
        if getattr(stop, "approach", "") != "standing" or getattr(stop, "kind", "target") != "target":
            continue
        robot, name = environment.robot, stop.name or stop.global_id
        is_known = stop.global_id in environment.building
        element = environment.building[stop.global_id] if is_known else None
        points = _points(element, stop)
        away = _away(element, stop)
        if away > robot.reach + _SLACK:
            text = f"the robot stands {away:.3f} m from {name} and reaches {robot.reach:g} m"
            yield Unserved("out-of-reach", text, leg, stop, away - robot.reach)
            continue
        low, top = float(points[:, 2].min()), stop.end[2] + robot.reach_height
        if element is not None and low > top + _SLACK:
            text = f"{name} is {low - top:.3f} m higher than the robot reaches"
            yield Unserved("out-of-reach", text, leg, stop, low - top)
            continue
        walls = list(_between(known, robot.height, element, stop, points))
        if element is not None and walls and not _is_seen(stop, points, walls, robot.height, robot.reach_height):
            names = ", ".join(f"{wall.name or wall.ifc_class} ({wall.global_id})" for wall in walls[:3])
            yield Unserved("hidden", f"{name} is behind {names} for the robot", leg, stop, 0.0)


def _points(element: Element | None, stop: Stop) -> NDArray[np.float64]:
    """Return corners of a target and the middles of its faces, (n, 3) metres; the destination of a bare point."""
    found = []
    for shape in element.shapes if element else ():
        corners = shape.world_vertices()
        found += [corners, corners[shape.mesh.faces].mean(axis=1)]
    points = np.concatenate(found) if found else np.empty((0, 3))
    return points[:: max(1, math.ceil(len(points) / _MOST))] if len(points) else np.array([stop.destination])


def _away(element: Element | None, stop: Stop) -> float:
    """Return the distance in plan view to what a target is made of, at least; metres."""
    place = shapely.Point(stop.end[:2])
    hulls = [
        shapely.convex_hull(shapely.multipoints(shape.world_vertices()[:, :2]))
        for shape in (element.shapes if element else ())
        if len(shape.mesh.vertices)
    ]
    hulls = hulls or [shapely.Point(stop.destination[:2])]
    return float(min(place.distance(hull) for hull in hulls))


def _between(
    walls: Sequence[tuple[Element, NDArray[np.float64]]],
    height: float,
    element: Element | None,
    stop: Stop,
    points: NDArray[np.float64],
) -> Iterator[Element]:
    """Yield the walls between a stop and its target, but for those that hold all of it and those it belongs to."""
    family = {stop.global_id} | ({element.parent} if element is not None and element.parent else set())
    lowest, highest = points.min(axis=0), points.max(axis=0)
    low, high = np.minimum(lowest, stop.end), np.maximum(highest, stop.end)
    high[2] = max(high[2], stop.end[2] + height)
    for wall, box in walls:
        if wall.global_id in family or (wall.parent is not None and wall.parent in family):
            continue
        holds = (box[0] <= lowest + _SHORT).all() and (highest - _SHORT <= box[1]).all()
        if not holds and (box[0] <= high).all() and (low <= box[1]).all() and box[1, 2] - box[0, 2] > _THIN:
            yield wall


def _is_seen(
    stop: Stop, points: NDArray[np.float64], walls: Sequence[Element], height: float, reach_height: float
) -> bool:
    """Tell whether a line from the top of the robot, or from its arm, meets no wall before one of some points."""
    triangles = np.concatenate([s.world_vertices()[s.mesh.faces] for wall in walls for s in wall.shapes])
    level = stop.end[2]
    eyes = np.tile([*stop.end[:2], level + height], (len(points), 1))
    arms = eyes.copy()
    arms[:, 2] = np.clip(points[:, 2], level + min(_ARM, height), level + max(height, min(reach_height, 1e3)))
    for begins in (eyes, arms):
        for k in range(len(points)):
            if not _is_crossed(begins[k], points[k], triangles):
                return True
    return False


def _is_crossed(begin: NDArray[np.float64], end: NDArray[np.float64], triangles: NDArray[np.float64]) -> bool:
    """Tell whether a line, short of its end, crosses a triangle: both its ends on other sides, and it within."""
    along = end - begin
    length = float(np.linalg.norm(along))
    if length <= _SHORT:
        return False
    end = end - along * (_SHORT / length)
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    before, behind = ((begin - a) * normal).sum(axis=1), ((end - a) * normal).sum(axis=1)
    cut = before * behind < 0
    if not cut.any():
        return False
    a, b, c, normal, before, behind = (each[cut] for each in (a, b, c, normal, before, behind))
    places = begin + (end - begin) * (before / (before - behind))[:, None]
    sides = [(np.cross(q - p, places - p) * normal).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))]
    return bool((np.min(sides, axis=0) >= 0).any())
