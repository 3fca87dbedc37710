"""The independent judge of paths.

It shares nothing with the planner. It looks at exact polygons in plan view and at the robot's body against
the meshes of the elements in space, and it fails closed: what cannot be judged is refused.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cache
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav import _checks
from bimnav._service_check import unserved
from bimnav.errors import GeometryError
from bimnav.verify._bodies import check_bodies, make_body
from bimnav.verify._climbs import check_climb, find_climbs
from bimnav.verify._plan_view import Leg, check_floor, check_footprints, track_of
from bimnav.verify._poses import check_poses
from bimnav.verify._verdict import Check, Kind, Violation, refusal
from bimnav.verify._world import FARTHEST, SAME, World, blocked_cells, surroundings

if TYPE_CHECKING:
    from bimnav.environment import IndoorEnvironment
    from bimnav.plan import Tour

__all__ = ["Check", "Violation", "check_path", "check_plan", "check_poses"]

_CONTACT = ("footprint", "body", "inside", "restricted", "off-floor")


def check_path(
    points: ArrayLike, environment: IndoorEnvironment, *, body: bool = True, ignore: Collection[str] = ()
) -> Check:
    """Judge a path: everything the robot's body sweeps along it.

    In plan view the body must keep clear of every footprint: a round robot may touch, a point may not.
    Where elements have meshes, the body in space is judged against them as well, from the robot's step
    height to its height; it is thinner by a tenth of a millimetre there. From storey to storey a path must
    follow a connector of the building that the robot can use; on a stair or ramp the body is judged against
    everything but the connector itself, above what the robot climbs over, and in a lift where it gets on
    and off.

    Parameters
    ----------
    points : (n, 3) float64, world metres
        A polyline. Its heights are levels of the environment, and those of the ways over its connectors.
    environment
        Regions, obstacles, zones and the robot.
    body
        Whether to check the body in space.
    ignore
        GlobalIds of obstacles that may be touched.

    Raises
    ------
    GeometryError
        If `points` has another shape. Points that are not finite are a violation.
    """
    _checks.need("environment", environment, "IndoorEnvironment")
    return _judge([(None, _polyline(points))], surroundings(environment, _checks.many("ignore", ignore, str)), body, [])


def check_plan(tour: Tour) -> Check:
    """Judge a tour: every leg of its route, and that the legs join the stops without a gap.

    A tour over a graph made from a mask is judged against the boxes of its blocked cells. A tour that has
    stops but no route is refused; of a tour that goes nowhere the start is judged. A stop that is reached
    although its cell is blocked gets no mercy. From a standing stop the target must be in reach, and no wall
    may hide it.
    """
    _checks.tour("tour", tour)
    route = [_polyline(line) for line in tour.route]
    torn = [*_tears(tour, route), *_unserved(tour)]
    legs: list[Leg] = list(enumerate(route)) or [(None, _polyline([tour.start_point]))]
    environment = tour.graph.environment
    world = blocked_cells(tour.graph) if environment is None else surroundings(environment, ())
    return _judge(legs, world, True, torn)


def _polyline(points: ArrayLike) -> NDArray[np.float64]:
    line = _checks.numbers("points", points)
    if line.size == 0:
        return np.empty((0, 3))
    if line.ndim != 2 or line.shape[1] != 3:
        raise GeometryError(f"a path has shape {line.shape}.", "Give an array of shape (n, 3) in metres.")
    return line


def _tears(tour: Tour, route: Sequence[NDArray[np.float64]]) -> Iterator[Violation]:
    """Find where a route does not begin, go on or end where the tour says."""
    ends = [stop.end for stop in tour.stops]
    last = getattr(tour, "end", None)
    if last is not None:
        at = getattr(tour, "end_at", None)
        ends.append(tour.graph.frame.center_of(last) if at is None else at)
    elif tour.return_to_start and (ends or route):
        ends.append(tour.start_point)
    if len(route) != len(ends):
        yield refusal("missing-leg", f"the route has {len(route)} legs where its stops need {len(ends)}")
    before: ArrayLike = tour.start_point
    for leg, (line, end) in enumerate(zip_longest(route, ends)):
        if line is None or not len(line):
            continue
        joints: list[tuple[Kind, str, int, ArrayLike | None]] = [
            ("teleport" if leg else "wrong-start", "begin", 0, before),
            ("wrong-end", "end", -1, end),
        ]
        for kind, verb, k, due in joints:
            tear = math.inf if due is None else float(np.linalg.norm(line[k] - np.asarray(due, dtype=np.float64)))
            if not tear <= SAME:
                depth = tear if math.isfinite(tear) else 0.0
                yield refusal(kind, f"the route does not {verb} where it should but", line[k], depth, leg=leg)
        before = line[-1]


def _unserved(tour: Tour) -> Iterator[Violation]:
    """Find standing stops from which their target is out of reach or hidden."""
    environment = tour.graph.environment
    for kind, text, leg, stop, depth in unserved(tour.stops, environment) if environment else ():
        yield refusal(kind, text, stop.end, depth, (stop.global_id, stop.name), stop.cell.storey, leg)


def _judge(legs: Sequence[Leg], world: World, body: bool, torn: Iterable[Violation]) -> Check:
    found = [*torn, *world.unknown]
    parts: dict[int, list[Leg]] = {}
    length, clearance, clearance_3d = 0.0, math.inf, math.inf
    body = body and bool(world.elements)
    body_of = cache(make_body)
    for leg, points in legs:
        flat, climbs = find_climbs(points, world)
        for way, climb in climbs:
            length += float(np.linalg.norm(np.diff(climb, axis=0), axis=1).sum())
            clearance_3d = min(clearance_3d, check_climb(way, climb, leg, world, body_of if body else None, found))
        for storey, part in (found_on for piece in flat for found_on in _parts(leg, piece, world.levels, found)):
            parts.setdefault(storey, []).append((leg, part))
            length += float(np.hypot(*np.diff(part, axis=0).T).sum())
    for storey in sorted(parts):
        track = track_of(storey, float(world.levels[storey]), parts[storey])
        clearance = min(clearance, check_footprints(track, world, found))
        check_floor(track, world, found)
        if body:
            clearance_3d = min(clearance_3d, check_bodies(track, world, body_of, found))
    found.sort(key=lambda v: (v.kind in _CONTACT, -v.depth))
    return Check(tuple(found), clearance, clearance_3d if body else None, length)


def _parts(
    leg: int | None, points: NDArray[np.float64], levels: NDArray[np.float64], found: list[Violation]
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Cut a leg into what can be judged: finite, and on one storey. The rest is refused."""
    if not len(points):
        found.append(refusal("empty", "a path without points proves nothing", leg=leg))
    finite = (np.abs(points) <= FARTHEST).all(axis=1)
    near = np.abs(points[:, 2:] - levels) <= SAME
    storey = np.where(finite & near.any(axis=1), near.argmax(axis=1), -1)
    cuts = np.flatnonzero(np.diff(storey)) + 1
    jumps = cuts[(storey[cuts] >= 0) & (storey[cuts - 1] >= 0)]
    faults: list[tuple[Kind, str, NDArray[np.intp]]] = [
        ("not-finite", "the path has a point that is not finite or out of range,", np.flatnonzero(~finite)),
        ("no-storey", "the path has a point on no level of the building,", np.flatnonzero(finite & (storey < 0))),
        ("storey-jump", "the path changes the storey", jumps),
    ]
    for kind, text, bad in faults:
        found += [refusal(kind, text, points[k], leg=leg) for k in bad[:1]]
    for part in np.split(np.arange(len(points)), cuts):
        if len(part) and storey[part[0]] >= 0:
            yield int(storey[part[0]]), points[part, :2]
