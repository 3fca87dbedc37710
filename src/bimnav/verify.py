"""The independent judge of paths.

It shares nothing with the planner. It looks at exact polygons in plan view and at the robot's body against
the meshes of the elements in space, and it fails closed: what cannot be judged is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations, pairwise, zip_longest
from typing import TYPE_CHECKING, Literal, TypeAlias

import fcl
import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.affinity import affine_transform

from bimnav._service_check import unserved
from bimnav.errors import GeometryError, UnsafePlanError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.building import Element
    from bimnav.environment import IndoorEnvironment
    from bimnav.graph import NavGraph
    from bimnav.links import Link
    from bimnav.plan import Tour

__all__ = ["Check", "Violation", "check_path", "check_plan", "check_poses"]

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
_CONTACT = ("footprint", "body", "inside", "restricted", "off-floor")

_SLACK = 1e-9  # metres; what rounding may take from a distance
_SAME = 1e-6  # metres; points and heights closer than this are the same
_FLOOR_GRID = 1e-6  # metres to which corners of the floor are rounded; floats hold it to 1e9 m
_GAP = 0.12  # metres; gaps in the floor are driven over, and a body may overhang: more than any planner closes
_SKIN = 1e-4  # metres; the body in space is thinner by this: the meshes of round things have chords for arcs
_CLOSE = 0.03  # metres of height; a floor finish that a connector does not know of
_NEAR = 1.0  # metres; how far around the body the clearance in space is measured
_HALF_TURN = 16  # chords of half a round body; they lie inside the circle, so a touch is a true touch
_TURN_STEP = math.radians(0.25)
_FARTHEST = 1e8  # metres from the origin; beyond it float64 no longer resolves a slack
_SLICE = 0.05  # metres of height in which the body on a stair is judged
_CONTACTS = 100  # of one element; more would only name the same trouble again


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
    return _judge([(None, _polyline(points))], _surroundings(environment, ignore), body, [])


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
    motion = np.asarray(poses, dtype=np.float64)
    if motion.ndim != 2 or motion.shape[1] != 4:
        raise GeometryError(f"a motion has shape {motion.shape}.", "Give an array of shape (n, 4): x, y, z, heading.")
    world = _surroundings(environment, ignore)
    found = list(world.unknown)
    if not len(motion):
        return Check((*found, _refusal("empty", "the motion has no pose")))
    if not np.isfinite(motion).all():
        return Check((*found, _refusal("not-finite", "the motion has poses that are not finite")))
    on = np.flatnonzero(np.abs(world.levels - motion[0, 2]) <= _SAME)
    if not len(on) or np.ptp(motion[:, 2]) > _SAME:
        return Check((*found, _refusal("no-storey", "the motion is not on one storey", motion[0, :3])))
    storey = int(on[0])
    length, clearance = 0.0, math.inf
    outline = shapely.Polygon(environment.robot.outline or _ring(world.radius))
    mine = world.storeys == storey
    owners = [owner for owner, is_mine in zip(world.owners, mine, strict=True) if is_mine]
    floors = shapely.union_all([floor for where, floor in world.floors if where == storey])
    floor = shapely.buffer(floors, _GAP, join_style="mitre")
    zones = [(zone, owner) for where, zone, owner in world.restricted if where == storey]
    worst: dict[tuple[str, str], Violation] = {}
    for before, after in zip(motion, motion[[*range(1, len(motion)), -1]], strict=True):
        swept = _swept_by_outline(outline, before, after)
        if swept is None:
            found.append(_refusal("teleport", "the robot moves and turns at once", before[:3], storey=storey))
            continue
        line = shapely.LineString([before[:2], after[:2]]) if (before[:2] != after[:2]).any() else None
        middle = shapely.Point(before[:2]) if line is None else line
        length += middle.length
        for shape, owner in zip(world.footprints[mine], owners, strict=True):
            gap = float(shapely.distance(swept, shape))
            clearance = min(clearance, gap)
            if gap > 0:
                continue
            depth = _overlap(swept, shape)
            clearance = min(clearance, -depth)
            if depth > _SLACK:
                said = _refusal("footprint", f"the robot reaches into {_who(owner)}", before[:3], depth, owner, storey)
                key = "footprint", owner[0]
                if key not in worst or worst[key].depth < depth:
                    worst[key] = said
        for zone, owner in zones:
            if shapely.relate_pattern(middle, zone, "T********"):
                worst.setdefault(
                    ("restricted", owner[0]),
                    _refusal("restricted", f"the robot enters {_who(owner)}", before[:3], 0.0, owner, storey),
                )
        off = shapely.difference(swept, floor)
        if off.area > _SAME:
            left = _refusal("off-floor", "the robot leaves the floor", before[:3], 0.0, storey=storey)
            worst.setdefault(("off-floor", ""), left)
    found += sorted(worst.values(), key=lambda v: -v.depth)
    return Check(tuple(found), clearance, None, length)


def _ring(radius: float) -> list[tuple[float, float]]:
    angle = np.linspace(0, 2 * math.pi, 4 * _HALF_TURN, endpoint=False)
    reach = max(radius, _SAME)
    return list(zip((reach * np.cos(angle)).tolist(), (reach * np.sin(angle)).tolist(), strict=True))


def _at_pose(outline: BaseGeometry, x: float, y: float, angle: float) -> BaseGeometry:
    c, s = math.cos(angle), math.sin(angle)
    return affine_transform(outline, [c, -s, s, c, x, y])


def _swept_by_outline(
    outline: BaseGeometry, before: NDArray[np.float64], after: NDArray[np.float64]
) -> BaseGeometry | None:
    """Return what an outline sweeps from pose to pose; None if it moves and turns at once."""
    turn = math.remainder(float(after[3] - before[3]), 2 * math.pi)
    moves = math.hypot(*(after[:2] - before[:2])) > _SLACK
    if moves and abs(turn) > _SAME:
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
        return _SAME  # a footprint without area
    return float(max(widths, default=0.0))


def check_plan(tour: Tour) -> Check:
    """Judge a tour: every leg of its route, and that the legs join the stops without a gap.

    A tour over a graph made from a mask is judged against the boxes of its blocked cells. A tour that has
    stops but no route is refused; of a tour that goes nowhere the start is judged. A stop that is reached
    although its cell is blocked gets no mercy. From a standing stop the target must be in reach, and no wall
    may hide it.
    """
    route = [_polyline(line) for line in tour.route]
    torn = [*_tears(tour, route), *_unserved(tour)]
    legs: list[_Leg] = list(enumerate(route)) or [(None, _polyline([tour.start_point]))]
    environment = tour.graph.environment
    world = _blocked_cells(tour.graph) if environment is None else _surroundings(environment, ())
    return _judge(legs, world, True, torn)


_Leg: TypeAlias = tuple[int | None, NDArray[np.float64]]
_Owner: TypeAlias = tuple[str, str]  # GlobalId and name


def _polyline(points: ArrayLike) -> NDArray[np.float64]:
    line = np.asarray(points, dtype=np.float64)
    if line.size == 0:
        return np.empty((0, 3))
    if line.ndim != 2 or line.shape[1] != 3:
        raise GeometryError(f"a path has shape {line.shape}.", "Give an array of shape (n, 3) in metres.")
    return line


def _refusal(
    kind: Kind,
    text: str,
    place: ArrayLike | None = None,
    depth: float = 0.0,
    owner: _Owner = ("", ""),
    storey: int | None = None,
    leg: int | None = None,
) -> Violation:
    point = None
    if place is not None:
        x, y, z = np.asarray(place, dtype=np.float64).tolist()
        point = (x, y, z) if math.isfinite(x + y + z) else None
        text += f" at ({x:.3f}, {y:.3f}, {z:.3f})" + ("" if leg is None else f" on leg {leg}")
    return Violation(kind, text, point, depth, *owner, storey, leg)


def _tears(tour: Tour, route: Sequence[NDArray[np.float64]]) -> Iterator[Violation]:
    """Find where a route does not begin, go on or end where the tour says."""
    ends = [stop.end for stop in tour.stops]
    last = getattr(tour, "end", None)
    if last is not None:
        ends.append(tour.graph.frame.center_of(last))
    elif tour.return_to_start and (ends or route):
        ends.append(tour.start_point)
    if len(route) != len(ends):
        yield _refusal("missing-leg", f"the route has {len(route)} legs where its stops need {len(ends)}")
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
            if not tear <= _SAME:
                depth = tear if math.isfinite(tear) else 0.0
                yield _refusal(kind, f"the route does not {verb} where it should but", line[k], depth, leg=leg)
        before = line[-1]


def _unserved(tour: Tour) -> Iterator[Violation]:
    """Find standing stops from which their target is out of reach or hidden."""
    environment = tour.graph.environment
    for kind, text, leg, stop, depth in unserved(tour.stops, environment) if environment else ():
        yield _refusal(kind, text, stop.end, depth, (stop.global_id, stop.name), stop.cell.storey, leg)


@dataclass(frozen=True, slots=True, eq=False)
class _World:
    """What a path is judged against. Storeys at one height are one, known by the first of them."""

    levels: NDArray[np.float64]
    owners: Sequence[_Owner]  # of every footprint
    footprints: NDArray[np.object_]
    storeys: NDArray[np.intp]  # of every footprint
    floors: Sequence[tuple[int, BaseGeometry]]
    restricted: Sequence[tuple[int, BaseGeometry, _Owner]] = ()
    radius: float = 0.0
    band: tuple[float, float] = (0.0, 0.0)  # the body, above its level
    elements: Sequence[Element] = ()
    bounds: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2, 3)))  # of every element
    unknown: Sequence[Violation] = ()
    ways: Sequence[_Way] = ()
    solids: Sequence[Element] = ()  # everything that is no door and no terrain, on whatever storey


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """A way from storey to storey."""

    owner: _Owner
    points: NDArray[np.float64]
    is_lift: bool = False
    own: Collection[str] = ()  # GlobalIds of what it is made of
    step: float = 0.0  # metres between its ends and the floors there that the robot takes
    foot: float = 0.0  # metres above it from which on the body is judged
    radius: float = 0.0  # how far the body reaches to the sides
    unfit: str = ""


def _ways(environment: IndoorEnvironment) -> Iterator[_Way]:
    """Yield the ways over the connectors of a building, and whether the robot can use them."""
    building, robot = environment.building, environment.robot
    parts = {connector.global_id: connector.parts for connector in building.connectors}
    for ascent in building.ascents:
        if not ascent.way:
            continue
        is_lift, is_stair = ascent.kind == "lift", ascent.kind == "stair"
        half = robot.half_width if ascent.is_straight else robot.radius  # a long body cannot turn on a narrow way
        faults = {
            "it does not ride in lifts": is_lift and not robot.uses_lifts,
            "its risers are too high": is_stair and not (ascent.riser or math.inf) <= robot.max_riser,
            "it is too steep": ascent.kind == "ramp" and not (ascent.slope or math.inf) <= robot.max_slope,
            "it is too narrow": half > 0 and not (ascent.width or 0) >= 2 * half,
        }
        unfit = next((fault for fault, is_true in faults.items() if is_true), "")
        step = (max(robot.step_height, robot.max_riser) if is_stair else robot.step_height) + _CLOSE
        foot = robot.low + (0 if is_lift else (ascent.riser or 0.0) + (ascent.slope or 0.0) * robot.radius)
        own = {ascent.global_id, *parts[ascent.global_id], *ascent.doors}
        stops = range(len(ascent.levels))
        for first, last in combinations(stops, 2) if is_lift else [(0, -1)]:
            owner = ascent.global_id, ascent.name
            line = ascent.line(first, last, radius=robot.radius)
            yield _Way(owner, line, is_lift, own, step, min(foot, robot.height / 2), half, unfit)


def _surroundings(environment: IndoorEnvironment, ignore: Collection[str]) -> _World:
    building, robot = environment.building, environment.robot
    levels = np.asarray(environment.levels, dtype=np.float64)
    first = _first_at(levels)
    obstacles = [o for o in environment.obstacles if o.global_id not in ignore]
    known = [o for o in obstacles if _is_sound(o.footprint)]
    footprints = np.array([o.footprint for o in known], dtype=object)
    closed = [z for z in environment.zones if z.factor == math.inf]
    shapes = [((o.global_id, o.name), o.footprint) for o in obstacles]
    shapes += [((z.global_id, z.name), z.polygon) for z in closed]
    lost = [owner for owner, shape in shapes if not _is_sound(shape)]
    named = dict.fromkeys(o.global_id for o in obstacles)
    elements = [building[global_id] for global_id in named if global_id in building]
    boxes = [(element, box) for element in elements if (box := element.bounds) is not None]
    return _World(
        levels,
        [(o.global_id, o.name) for o in known],
        shapely.make_valid(footprints, method="structure", keep_collapsed=True),
        first[np.array([o.storey for o in known], dtype=np.intp)],
        [(first[r.storey], r.polygon) for r in environment.regions if _is_sound(r.polygon)],
        [(first[z.storey], z.polygon, (z.global_id, z.name)) for z in closed if _is_sound(z.polygon)],
        robot.radius,
        (robot.low, robot.height),
        [element for element, _ in boxes],
        np.array([box for _, box in boxes]).reshape(-1, 2, 3),
        [_refusal("unknown-shape", f"the shape of {_who(x)} is empty or not finite", None, 0.0, x) for x in lost],
        tuple(_ways(environment)),
        _solids(environment, ignore),
    )


def _solids(environment: IndoorEnvironment, ignore: Collection[str]) -> list[Element]:
    ignored = {*ignore, *(global_id for global_id, _ in environment.left_out)}
    return [e for e in environment.building.elements if e.global_id not in ignored and e.bounds is not None]


def _first_at(levels: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return, for every storey, the first one at its height."""
    first: NDArray[np.intp] = (np.abs(levels[:, None] - levels) <= _SAME).argmax(axis=1)
    return first


def _blocked_cells(graph: NavGraph) -> _World:
    """Make one box of every run of blocked cells in a row; the floor is the frame."""
    frame, size = graph.frame, graph.frame.cell_size
    blocked = np.pad(~np.asarray(graph.free, dtype=np.bool_), ((0, 0), (0, 0), (1, 1))).astype(np.int8)
    turns = np.diff(blocked, axis=2)
    storey, row, first = np.nonzero(turns == 1)
    last = np.nonzero(turns == -1)[2]
    left, right, bottom = frame.first_col + first, frame.first_col + last, frame.first_row + row
    boxes = shapely.box(left * size, bottom * size, right * size, (bottom + 1) * size)
    x, y = frame.first_col * size, frame.first_row * size
    whole = shapely.box(x, y, (frame.first_col + frame.cols) * size, (frame.first_row + frame.rows) * size)
    levels = np.asarray(frame.elevations, dtype=np.float64)
    floors = [(index, whole) for index in range(len(levels))]
    ways = [_Way((link.global_id, link.name), _points_of(link, graph)) for link in graph.connectors]
    names = [("", "a blocked cell")] * len(boxes)
    return _World(levels, names, boxes, _first_at(levels)[storey], floors, ways=ways)


def _points_of(link: Link, graph: NavGraph) -> NDArray[np.float64]:
    if len(link.points):
        return link.points
    return np.array([graph.frame.center_of(link.begin), graph.frame.center_of(link.end)])


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """All of a route on one storey: unbroken stretches, and the straight pieces they are made of."""

    storey: int
    level: float
    legs: Sequence[int | None]  # of every stretch
    stretches: Sequence[BaseGeometry]
    stretch: NDArray[np.intp]  # of every piece
    pieces: NDArray[np.float64]  # (n, 2, 2) where each begins and ends
    lines: NDArray[np.object_]  # of every piece
    tree: shapely.STRtree  # of lines

    def leg_of(self, piece: int) -> int | None:
        return self.legs[int(self.stretch[piece])]

    def refusal(
        self, kind: Kind, text: str, xy: NDArray[np.float64], depth: float, leg: int | None, owner: _Owner = ("", "")
    ) -> Violation:
        return _refusal(kind, text, [*xy, self.level], depth, owner, self.storey, leg)


def _track(storey: int, level: float, parts: Sequence[_Leg]) -> _Track:
    """Lay out the parts of the legs that lie on one storey, (n, 2) each."""
    stretches = [_drawn(points) for _, points in parts]
    runs = [xy if len(xy) > 1 else xy[[0, 0]] for xy in map(shapely.get_coordinates, stretches)]
    stretch = np.repeat(np.arange(len(runs)), [len(run) - 1 for run in runs])
    pieces = np.concatenate([np.stack([run[:-1], run[1:]], axis=1) for run in runs])
    stands = (pieces[:, 0] == pieces[:, 1]).all(axis=1)  # GEOS misses lines without length
    lines = np.where(stands, shapely.points(pieces[:, 0]), shapely.linestrings(pieces))
    return _Track(storey, level, [leg for leg, _ in parts], stretches, stretch, pieces, lines, shapely.STRtree(lines))


def _drawn(points: NDArray[np.float64]) -> BaseGeometry:
    """Draw a line, or a point where the robot only stands; the line strays by less than the slack."""
    if not np.ptp(points, axis=0).any():
        return shapely.Point(points[0])
    return shapely.simplify(shapely.LineString(points), _SLACK / 2, preserve_topology=False)


def _judge(legs: Sequence[_Leg], world: _World, body: bool, torn: Iterable[Violation]) -> Check:
    found = [*torn, *world.unknown]
    parts: dict[int, list[_Leg]] = {}
    length, clearance, clearance_3d = 0.0, math.inf, math.inf
    body = body and bool(world.elements)
    body_of = cache(_body)
    for leg, points in legs:
        flat, climbs = _climbs(points, world)
        for way, climb in climbs:
            length += float(np.linalg.norm(np.diff(climb, axis=0), axis=1).sum())
            clearance_3d = min(clearance_3d, _check_climb(way, climb, leg, world, body_of if body else None, found))
        for storey, part in (found_on for piece in flat for found_on in _parts(leg, piece, world.levels, found)):
            parts.setdefault(storey, []).append((leg, part))
            length += float(np.hypot(*np.diff(part, axis=0).T).sum())
    for storey in sorted(parts):
        track = _track(storey, float(world.levels[storey]), parts[storey])
        clearance = min(clearance, _check_footprints(track, world, found))
        _check_floor(track, world, found)
        if body:
            clearance_3d = min(clearance_3d, _check_bodies(track, world, body_of, found))
    found.sort(key=lambda v: (v.kind in _CONTACT, -v.depth))
    return Check(tuple(found), clearance, clearance_3d if body else None, length)


def _climbs(
    points: NDArray[np.float64], world: _World
) -> tuple[list[NDArray[np.float64]], list[tuple[_Way, NDArray[np.float64]]]]:
    """Part a leg into stretches between connectors and climbs over them; what follows none stays in a stretch."""
    flat, climbs, done = [], [], 0
    for k in np.flatnonzero(np.abs(np.diff(points[:, 2])) > _SAME).tolist():
        if k < done:
            continue
        for way in world.ways:
            found = next(
                filter(None, (_along(points, k, way, line, world) for line in (way.points, way.points[::-1]))), None
            )
            if found is not None:
                first, last = found
                flat.append(points[done : first + 1])
                climbs.append((way, points[first : last + 1]))
                done = last
                break
    return [*flat, points[done:]], climbs


def _along(
    points: NDArray[np.float64], k: int, way: _Way, line: NDArray[np.float64], world: _World
) -> tuple[int, int] | None:
    """Return the points, first and last, that follow a line of a connector around piece k of a leg.

    They pass all of its points from one floor to another. Only its ends may lie a step beside these floors.
    """
    with np.errstate(invalid="ignore"):
        same = np.all(np.abs(points[k : k + 2, None, :2] - line[:, :2]) <= _SAME, axis=2)
        level = np.any(np.abs(points[:, 2:] - world.levels) <= _SAME, axis=1)
    for j in np.flatnonzero(same[0, :-1] & same[1, 1:]).tolist():
        first, last, shift = k, k + 1, j - k
        while first > 0 and first + shift > 0 and _is_at(points[first - 1], line[first + shift - 1]):
            first -= 1
        while (
            last + 1 < len(points) and last + shift + 1 < len(line) and _is_at(points[last + 1], line[last + shift + 1])
        ):
            last += 1
        on = np.flatnonzero(level[first : last + 1]) + first
        if not (len(on) and on[0] <= k < on[-1]):
            continue
        first, last = int(on[0]), int(on[-1])
        climb, due = points[first : last + 1, 2], line[first + shift : last + shift + 1, 2].copy()
        for end in (0, -1):
            if abs(climb[end] - due[end]) <= way.step:
                due[np.abs(due - due[end]) <= _SAME] = climb[end]
        if (np.abs(climb - due) <= _SAME).all():
            return first, last
    return None


def _is_at(point: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return bool((np.abs(point[:2] - other[:2]) <= _SAME).all())


def _check_climb(
    way: _Way,
    climb: NDArray[np.float64],
    leg: int | None,
    world: _World,
    body_of: Callable[[Element], _Body | None] | None,
    found: list[Violation],
) -> float:
    """Refuse a climb that the robot cannot make, or on which its body meets something; return the clearance.

    The body is judged in slices of height, in each as high as in all of it.
    """
    if way.unfit:
        text = f"the robot cannot use {_who(way.owner)}: {way.unfit},"
        found.append(_refusal("climb", text, climb[0], 0.0, way.owner, None, leg))
    clearance, hits = math.inf, list[Violation]()
    solids = [element for element in world.solids if element.global_id not in way.own]
    if body_of is None or not solids:
        return clearance
    bounds = np.array([element.bounds for element in solids])
    for a, b in pairwise(climb):
        rise = abs(float(b[2] - a[2]))
        if way.is_lift and rise > 0:
            continue  # inside the car
        count = max(math.ceil(rise / _SLICE), 1)
        ends = np.linspace(a, b, count + 1)
        for begin, end in pairwise(ends):
            low, high = sorted((float(begin[2]), float(end[2])))
            track = _track(-1, high, [(leg, np.array([begin[:2], end[:2]]))])
            band = way.foot, world.band[1] - (high - low)
            slice_ = replace(world, elements=solids, bounds=bounds, band=band, radius=way.radius)
            clearance = min(clearance, _check_bodies(track, slice_, body_of, hits))
    worst = {(hit.kind, hit.global_id): hit for hit in sorted(hits, key=lambda hit: hit.depth)}
    found += [replace(hit, storey=None) for hit in worst.values()]
    return clearance


def _parts(
    leg: int | None, points: NDArray[np.float64], levels: NDArray[np.float64], found: list[Violation]
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Cut a leg into what can be judged: finite, and on one storey. The rest is refused."""
    if not len(points):
        found.append(_refusal("empty", "a path without points proves nothing", leg=leg))
    finite = (np.abs(points) <= _FARTHEST).all(axis=1)
    near = np.abs(points[:, 2:] - levels) <= _SAME
    storey = np.where(finite & near.any(axis=1), near.argmax(axis=1), -1)
    cuts = np.flatnonzero(np.diff(storey)) + 1
    jumps = cuts[(storey[cuts] >= 0) & (storey[cuts - 1] >= 0)]
    faults: list[tuple[Kind, str, NDArray[np.intp]]] = [
        ("not-finite", "the path has a point that is not finite or out of range,", np.flatnonzero(~finite)),
        ("no-storey", "the path has a point on no level of the building,", np.flatnonzero(finite & (storey < 0))),
        ("storey-jump", "the path changes the storey", jumps),
    ]
    for kind, text, bad in faults:
        found += [_refusal(kind, text, points[k], leg=leg) for k in bad[:1]]
    for part in np.split(np.arange(len(points)), cuts):
        if len(part) and storey[part[0]] >= 0:
            yield int(storey[part[0]]), points[part, :2]


def _check_footprints(track: _Track, world: _World, found: list[Violation]) -> float:
    """Refuse pieces closer to a footprint than the radius; return the clearance."""
    here = np.flatnonzero(world.storeys == track.storey)
    tree = shapely.STRtree(world.footprints[here])
    _, distances = tree.query_nearest(track.lines, return_distance=True, all_matches=False)
    clearance = float(distances.min(initial=np.inf)) - world.radius
    slack = _SLACK + 4 * float(np.spacing(np.abs(track.pieces).max()))
    limit = max(world.radius - slack, slack)  # a round robot may touch, a point may not
    worst: dict[tuple[int | None, int], tuple[float, NDArray[np.float64]]] = {}
    for piece, index in tree.query(track.lines, predicate="dwithin", distance=limit).T:
        depth, place = _depth(track.lines[piece], world.footprints[here[index]], world.radius)
        key = track.leg_of(piece), int(here[index])
        if key not in worst or depth > worst[key][0]:
            worst[key] = depth, place
    for (leg, index), (depth, place) in worst.items():
        owner = world.owners[index]
        verb = f"reaches {depth:.4f} m into" if depth > slack else "touches"
        found.append(track.refusal("footprint", f"the robot {verb} {_who(owner)}", place, depth, leg, owner))
        clearance = min(clearance, -depth)
    return clearance


def _depth(line: BaseGeometry, footprint: BaseGeometry, radius: float) -> tuple[float, NDArray[np.float64]]:
    """Return how deep a footprint reaches into the robot that drives along a line, and where."""
    distance = line.distance(footprint)
    within = shapely.segmentize(shapely.intersection(line, footprint), max(line.length / 1000, 0.01))
    rims = shapely.multilinestrings(shapely.get_rings(shapely.get_parts(footprint)))
    places = shapely.get_coordinates(within)
    if distance > 0 or rims.is_empty or not len(places):
        return radius - distance, shapely.get_coordinates(shapely.shortest_line(line, footprint))[0]
    sunk = shapely.distance(shapely.points(places), rims)
    return radius + float(sunk.max()), places[sunk.argmax()]


def _check_floor(track: _Track, world: _World, found: list[Violation]) -> None:
    """Refuse stretches that leave the floor or enter a restricted zone.

    Small gaps count as floor, and so does a small overhang. Of a zone the robot's middle must stay out.
    """
    regions = [shapely.make_valid(region) for storey, region in world.floors if storey == track.storey]
    # on a grid: without one GEOS can lose polygons that differ from others by rounding alone
    floor = shapely.union_all(regions, grid_size=_FLOOR_GRID)
    grown = shapely.buffer(floor, _GAP / 2, join_style="mitre")
    floor = shapely.buffer(grown, -_GAP / 2, join_style="mitre")
    floor = shapely.buffer(floor, _SAME - max(world.radius - _GAP, 0.0))
    shapely.prepare(floor)
    for leg, line in zip(track.legs, track.stretches, strict=True):
        if not shapely.covers(floor, line):
            places = shapely.get_coordinates(shapely.difference(line, floor))
            off = np.nan_to_num(shapely.distance(shapely.points(places), floor))  # NaN without any floor
            k = off.argmax()
            found.append(track.refusal("off-floor", "the robot leaves the floor", places[k], float(off[k]), leg))
        for storey, zone, owner in world.restricted:
            inner = shapely.buffer(zone, -2 * _SAME)
            if storey == track.storey and shapely.intersects(line, inner):
                place = shapely.get_coordinates(shapely.intersection(line, inner))[0]
                text = f"the robot enters the restricted zone {_who(owner)}"
                found.append(track.refusal("restricted", text, place, 0.0, leg, owner))


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """An element in space."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    solids: Sequence[NDArray[np.float64]]  # (n, 3, 3) triangles of every shape that has an inside
    collider: fcl.CollisionObject


def _body(element: Element) -> _Body | None:
    shapes = [(shape.world_vertices(), shape.mesh) for shape in element.shapes if len(shape.mesh.faces)]
    if not shapes:
        return None  # an empty mesh would end the process
    shifts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    vertices = np.concatenate([vertices for vertices, _ in shapes])
    faces = np.concatenate([mesh.faces + shift for (_, mesh), shift in zip(shapes, shifts[:-1], strict=True)])
    solids = [corners[mesh.faces] for corners, mesh in shapes if mesh.quality != "surface"]
    return _Body(vertices, faces, solids, _collider(vertices, faces))


def _collider(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> fcl.CollisionObject:
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def _swept(pieces: NDArray[np.float64], radius: float, low: float, high: float) -> tuple[fcl.CollisionObject, int]:
    """Return what an upright cylinder sweeps on straight pieces, and the number of triangles of each.

    A cylinder that moves sideways sweeps a prism over two half circles and the sides between them: exact
    but for the chords of the circles. A body without width sweeps an upright sheet.
    """
    outline = pieces
    if radius > 0:
        along = pieces[:, 1] - pieces[:, 0]
        length = np.hypot(*along.T)[:, None]
        along = np.divide(along, length, out=np.tile([1.0, 0.0], (len(along), 1)), where=length > 0)
        across = along[:, ::-1] * (-1.0, 1.0)
        turn = np.linspace(-math.pi / 2, math.pi / 2, _HALF_TURN + 1)[:, None]
        arc = radius * (np.cos(turn) * along[:, None] + np.sin(turn) * across[:, None])
        outline = np.concatenate([pieces[:, 1:] + arc, pieces[:, :1] - arc], axis=1)
    count = outline.shape[1]
    vertices = np.empty((len(pieces), 2, count, 3))
    vertices[..., :2] = outline[:, None]
    vertices[..., 2] = np.array([[low], [high]])
    i, j, k = np.arange(count), np.roll(np.arange(count), -1), np.arange(1, count - 1)
    sides = np.concatenate([np.stack([i, j, i + count], axis=1), np.stack([j, j + count, i + count], axis=1)])
    bottom = np.stack([np.zeros_like(k), k + 1, k], axis=1)
    facets = np.concatenate([sides, bottom, bottom[:, ::-1] + count])
    faces = facets + 2 * count * np.arange(len(pieces))[:, None, None]
    return _collider(vertices.reshape(-1, 3), faces.reshape(-1, 3)), len(facets)


def _check_bodies(
    track: _Track, world: _World, body_of: Callable[[Element], _Body | None], found: list[Violation]
) -> float:
    """Refuse pieces where the body meets a mesh; return the clearance in space."""
    low, high = (track.level + height for height in world.band)
    skin = min(_SKIN, (high - low) / 4)
    band = low + skin, high - skin
    radius = max(world.radius - _SKIN, 0.0)
    swept, facets = _swept(track.pieces, radius, *band)
    boxes = shapely.box(*world.bounds[:, 0, :2].T, *world.bounds[:, 1, :2].T)
    (near, _), aside = track.tree.query_nearest(
        boxes, max_distance=radius + _NEAR, return_distance=True, all_matches=False
    )
    above = np.maximum(world.bounds[near, 0, 2] - band[1], band[0] - world.bounds[near, 1, 2])
    least = np.hypot(np.maximum(aside - radius, 0), np.maximum(above, 0))  # no element is nearer than its box
    caught = {(v.global_id, v.leg) for v in found if v.kind == "footprint"}
    clearance = _NEAR
    for k in np.argsort(least, kind="stable"):
        if least[k] > 0 and least[k] >= clearance:
            break
        element = world.elements[near[k]]
        body = body_of(element)
        if body is None:
            continue
        met = _meets(track, body, swept, facets, radius, band) if least[k] == 0 else {}
        clearance = 0.0 if met else min(clearance, _distance(swept, body.collider))
        for leg, (kind, piece, place) in met.items():
            if (element.global_id, leg) in caught:
                continue
            gap = _distance(_swept(track.pieces[[piece]], 0.0, *band)[0], body.collider)
            depth = world.radius + gap if kind == "inside" else max(world.radius - gap, 0.0)
            owner = element.global_id, element.name
            verb = "is wholly inside" if kind == "inside" else "meets"
            found.append(track.refusal(kind, f"the robot's body {verb} {_who(owner)}", place, depth, leg, owner))
    return clearance if clearance < _NEAR else math.inf


def _meets(
    track: _Track, body: _Body, swept: fcl.CollisionObject, facets: int, radius: float, band: tuple[float, float]
) -> dict[int | None, tuple[Kind, int, NDArray[np.float64]]]:
    """Return, for every leg that meets an element: how, on which piece, and where.

    Surfaces that do not cross leave two ways to meet: a part of the element lies wholly in the swept
    body, or a stretch of the swept body wholly in the element. The collision library sees neither.
    """
    met: dict[int | None, tuple[Kind, int, NDArray[np.float64]]] = {}
    result = fcl.CollisionResult()
    fcl.collide(swept, body.collider, fcl.CollisionRequest(num_max_contacts=_CONTACTS, enable_contact=True), result)
    for contact in result.contacts:
        piece = contact.b1 // facets
        if track.leg_of(piece) not in met:
            facet = shapely.convex_hull(shapely.multipoints(body.vertices[body.faces[contact.b2], :2]))
            place = shapely.get_coordinates(shapely.shortest_line(track.lines[piece], facet))[0]
            met[track.leg_of(piece)] = "body", piece, place
    heights = body.vertices[:, 2]
    corners = body.vertices[(band[0] <= heights) & (heights <= band[1]), :2]
    for corner, piece in track.tree.query(shapely.points(corners), predicate="dwithin", distance=radius).T:
        met.setdefault(track.leg_of(piece), ("body", int(piece), corners[corner]))
    for number, leg in enumerate(track.legs):
        piece = int(np.searchsorted(track.stretch, number))
        start = track.pieces[piece, 0]
        if leg not in met and any(_is_inside(np.array([*start, sum(band) / 2]), solid) for solid in body.solids):
            met[leg] = "inside", piece, start
    return met


def _is_inside(point: NDArray[np.float64], triangles: NDArray[np.float64]) -> bool:
    """Tell whether a surface winds around a point: by the solid angles of van Oosterom and Strackee (1983)."""
    if not ((triangles.min(axis=(0, 1)) <= point) & (point <= triangles.max(axis=(0, 1)))).all():
        return False
    a, b, c = (triangles - point).transpose(1, 0, 2)
    to_a, to_b, to_c = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    ab, bc, ca = (a * b).sum(axis=1), (b * c).sum(axis=1), (c * a).sum(axis=1)
    volume = (a * np.cross(b, c)).sum(axis=1)
    half_angles = np.arctan2(volume, to_a * to_b * to_c + ab * to_c + bc * to_a + ca * to_b)
    return abs(float(half_angles.sum())) > math.pi  # once around is 2 pi


def _distance(one: fcl.CollisionObject, other: fcl.CollisionObject) -> float:
    return max(float(fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult())), 0.0)


def _is_sound(polygon: BaseGeometry) -> bool:
    return not polygon.is_empty and bool((np.abs(shapely.get_coordinates(polygon)) <= _FARTHEST).all())


def _who(owner: _Owner) -> str:
    global_id, name = owner
    return f"{name or 'an unnamed element'} ({global_id})" if global_id else name
