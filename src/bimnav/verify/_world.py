"""What a path is judged against: footprints, floors, bodies, and the ways from storey to storey."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.verify._verdict import Owner, Violation, refusal, who

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.building import Element
    from bimnav.environment import IndoorEnvironment
    from bimnav.graph import NavGraph
    from bimnav.links import Link

__all__ = ["FARTHEST", "GAP", "SAME", "SLACK", "Way", "World", "blocked_cells", "surroundings"]

SLACK = 1e-9  # metres; what rounding may take from a distance
SAME = 1e-6  # metres; points and heights closer than this are the same
GAP = 0.12  # metres; gaps in the floor are driven over, and a body may overhang: more than any planner closes
FARTHEST = 1e8  # metres from the origin; beyond it float64 no longer resolves a slack
_CLOSE = 0.03  # metres of height; a floor finish that a connector does not know of


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What a path is judged against. Storeys at one height are one, known by the first of them."""

    levels: NDArray[np.float64]
    owners: Sequence[Owner]  # of every footprint
    footprints: NDArray[np.object_]
    storeys: NDArray[np.intp]  # of every footprint
    floors: Sequence[tuple[int, BaseGeometry]]
    restricted: Sequence[tuple[int, BaseGeometry, Owner]] = ()
    radius: float = 0.0
    band: tuple[float, float] = (0.0, 0.0)  # the body, above its level
    elements: Sequence[Element] = ()
    bounds: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2, 3)))  # of every element
    unknown: Sequence[Violation] = ()
    ways: Sequence[Way] = ()
    solids: Sequence[Element] = ()  # everything that is no door and no terrain, on whatever storey


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """A way from storey to storey."""

    owner: Owner
    points: NDArray[np.float64]
    is_lift: bool = False
    own: Collection[str] = ()  # GlobalIds of what it is made of
    step: float = 0.0  # metres between its ends and the floors there that the robot takes
    foot: float = 0.0  # metres above it from which on the body is judged
    radius: float = 0.0  # how far the body reaches to the sides
    unfit: str = ""


def surroundings(environment: IndoorEnvironment, ignore: Collection[str]) -> World:
    """Return what an environment holds against a path; obstacles of the GlobalIds in `ignore` do not count."""
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
    return World(
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
        [refusal("unknown-shape", f"the shape of {who(x)} is empty or not finite", None, 0.0, x) for x in lost],
        tuple(_ways(environment)),
        _solids(environment, ignore),
    )


def _solids(environment: IndoorEnvironment, ignore: Collection[str]) -> list[Element]:
    ignored = {*ignore, *(global_id for global_id, _ in environment.left_out)}
    return [e for e in environment.building.elements if e.global_id not in ignored and e.bounds is not None]


def _is_sound(polygon: BaseGeometry) -> bool:
    return not polygon.is_empty and bool((np.abs(shapely.get_coordinates(polygon)) <= FARTHEST).all())


def _ways(environment: IndoorEnvironment) -> Iterator[Way]:
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
            yield Way(owner, line, is_lift, own, step, min(foot, robot.height / 2), half, unfit)


def blocked_cells(graph: NavGraph) -> World:
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
    ways = [Way((link.global_id, link.name), _points_of(link, graph)) for link in graph.connectors]
    names = [("", "a blocked cell")] * len(boxes)
    return World(levels, names, boxes, _first_at(levels)[storey], floors, ways=ways)


def _points_of(link: Link, graph: NavGraph) -> NDArray[np.float64]:
    if len(link.points):
        return link.points
    return np.array([graph.frame.center_of(link.begin), graph.frame.center_of(link.end)])


def _first_at(levels: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return, for every storey, the first one at its height."""
    first: NDArray[np.intp] = (np.abs(levels[:, None] - levels) <= SAME).argmax(axis=1)
    return first
