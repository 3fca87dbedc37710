"""Robots that are not round: where the body may be in each heading, and motions between poses.

The body is the convex hull of its outline. Obstacles and the edge of the floor are grown by the exact body in
each heading before they are cut into cells, so a body may be anywhere in a cell that is free. Straight moves
join cells along the heading; turns sweep a hull that holds all of the turn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks, search
from bimnav._kept import Kept
from bimnav.errors import (
    GoalBlockedError,
    InputError,
    NoPathError,
    NothingWalkableError,
    StartBlockedError,
    ValueRangeError,
)
from bimnav.grid import Cell, GridFrame, cells_within, rasterize

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import Place
    from bimnav.graph import NavGraph

__all__ = ["PosePath", "find_poses"]

_MARGIN = 2e-6  # metres around the body; cells are eroded by half of it
_EIGHTH = math.tau / search.HEADINGS
_PARTS = 4  # of an eighth of a turn; the swept hull stands out by less than half a percent of the radius


@dataclass(frozen=True, slots=True, eq=False)
class PosePath(Kept):
    """A motion of a body that drives straight and turns on the spot.

    Parameters
    ----------
    poses : (n, 4) float64
        x, y and z in world metres, and the heading in radians counter-clockwise from x. Between two poses
        the body either moves straight without turning, or turns on the spot.
    storey
        Index of the storey.
    length
        Metres driven.
    turned
        Radians turned in all.
    """

    poses: NDArray[np.float64]
    storey: int
    length: float
    turned: float

    def __repr__(self) -> str:
        return f"PosePath({len(self.poses)} poses, {self.length:.3f} m, {math.degrees(self.turned):.0f} degrees)"


def find_poses(
    graph: NavGraph,
    start: Place,
    goal: Place,
    *,
    heading: float | None = None,
    goal_heading: float | None = None,
    turn_cost: float = 0.1,
    reverse: float = 2.0,
) -> PosePath:
    """Find a cheapest motion for a robot with an outline, heading for heading, on one storey.

    It passes where a circle around the robot would not: lengthwise through a corridor or a door. Headings are
    eighths of a turn. Cells that were free in the graph and have been closed are closed to the robot's middle.

    Parameters
    ----------
    graph
        Its environment, cell size and closed cells count; what is free is worked out for the outline.
    start, goal
        `(x, y)` or `(x, y, storey)`, metres. The motion joins the middles of their cells.
    heading, goal_heading
        Radians counter-clockwise from x, taken to the nearest eighth of a turn; None for any.
    turn_cost
        What an eighth of a turn costs, metres; more than 0.
    reverse
        Multiplier of the length of driving backwards, at least 1; inf to drive ahead only.

    Raises
    ------
    InputError
        If the graph comes from a mask, or start and goal lie on two storeys.
    OutsideMapError, StartBlockedError, GoalBlockedError
        If a pose lies outside the map, or the body does not fit there.
    NoPathError
        If no motion joins the two.
    """
    _checks.need("graph", graph, "NavGraph")
    environment = graph.environment
    if environment is None:
        raise InputError("a graph from a mask knows no robot.", "Make it from an environment.")
    if not (_checks.number("turn_cost", turn_cost) > 0 and _checks.number("reverse", reverse) >= 1):
        raise ValueRangeError(f"turn_cost is {turn_cost}, reverse is {reverse}.", "Give more than 0, and at least 1.")
    storeys = [environment.storeys_at(place)[0] for place in (start, goal)]
    if storeys[0] != storeys[1]:
        raise InputError("start and goal lie on two storeys.", "Plan to the connector and from it.")
    space = _Space.of(graph, storeys[0])
    begin = space.pose_at(start, heading, "start")
    end = space.pose_at(goal, goal_heading, "goal")
    d = space.frame.cell_size
    found = search.find_motion(space.free, space.turns, begin, end, turn_cost / d, reverse)
    if found is None:
        cells = tuple(Cell(0, row, col) for _, row, col in (begin, end))
        raise NoPathError(
            f"no motion from ({start[0]:g}, {start[1]:g}) to ({goal[0]:g}, {goal[1]:g}) for the outline of robot "
            f"{environment.robot.name!r}.",
            "",
            {"start": tuple(cells[0]), "goal": tuple(cells[1])},
        )
    return _path(space, found[0])


def _path(space: _Space, states: NDArray[np.int64]) -> PosePath:
    moves = np.diff(states, axis=0)
    moves[:, 0] = (moves[:, 0] + 1) % search.HEADINGS - 1  # an eighth to the left or right
    kept = np.concatenate([[True], (moves[1:] != moves[:-1]).any(axis=1), [True]]) if len(states) > 1 else [True]
    centers = space.frame.centers_of(np.column_stack([np.zeros(len(states), dtype=np.int64), states[:, 1:]]))
    headings = (states[0, 0] + np.concatenate([[0], np.cumsum(moves[:, 0])])) * _EIGHTH
    poses = np.column_stack([centers, headings])[np.asarray(kept)]
    length = math.fsum(math.dist(a[:2], b[:2]) for a, b in pairwise(poses))
    poses.flags.writeable = False
    return PosePath(poses, space.storey, length, math.fsum(np.abs(np.diff(poses[:, 3]))))


_spaces: WeakKeyDictionary[NavGraph, dict[int, _Space]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class _Space:
    """Where the body may be on one storey: (8, rows, cols), and where it may turn to the next heading."""

    frame: GridFrame
    storey: int
    free: NDArray[np.bool_]
    turns: NDArray[np.bool_]

    @staticmethod
    def of(graph: NavGraph, storey: int) -> _Space:
        """Return the space of a storey, the same for every question."""
        spaces = _spaces.setdefault(graph, {})
        if storey not in spaces:
            spaces[storey] = _space(graph, storey)
        return spaces[storey]

    def pose_at(self, place: Place, heading: float | None, role: str) -> tuple[int, int, int]:
        """Return heading, row and column of a place; heading -1 for any."""
        if heading is not None and not math.isfinite(_checks.number(f"heading of the {role}", heading)):
            raise ValueRangeError(f"heading of the {role} is {heading}.", "Give radians, or None for any.")
        _, row, col = self.frame.cell_at(float(place[0]), float(place[1]), storey=0)
        way = -1 if heading is None else round(heading / _EIGHTH) % search.HEADINGS
        if not (self.free[:, row, col].any() if way < 0 else self.free[way, row, col]):
            error = StartBlockedError if role == "start" else GoalBlockedError
            raise error(
                f"the body does not fit at the {role} ({place[0]:g}, {place[1]:g}).",
                "Give another place or heading; the body must fit anywhere in the cell.",
                {role: (float(place[0]), float(place[1]))},
            )
        return way, row, col


def _space(graph: NavGraph, storey: int) -> _Space:
    environment = graph.environment
    assert environment is not None  # noqa: S101  # for mypy
    robot = environment.robot
    bare = replace(environment, robot=replace(robot, outline=None, radius=0.0))
    floor = bare.floor(storey)
    if floor.is_empty:
        raise NothingWalkableError(f"storey {storey} has no floor.", "Give a place on another storey.")
    frame = GridFrame.covering(floor.bounds, graph.frame.cell_size, elevations=(environment.levels[storey],))
    shapes = [obstacle.footprint for obstacle in environment.obstacles_on(storey)]
    closed = [zone.polygon for zone in environment.zones if zone.storey == storey and zone.factor == math.inf]
    closed += _closed_cells(graph, storey)
    on_floor = cells_within(frame, floor) & ~rasterize(frame, [*shapes, *closed])
    edges = _edges([floor, *shapes])
    body = _body(robot.outline or _disc(robot.radius))
    free = np.empty((search.HEADINGS, *on_floor.shape), dtype=np.bool_)
    turns = np.empty_like(free)
    for k in range(search.HEADINGS):
        free[k] = on_floor & ~rasterize(frame, _grown(edges, _turned(body, k * _EIGHTH)))
        # a turn is held by the hulls of its parts; with all of them the hull of the whole needs no test
        hulls = [_swept(body, (k + part / _PARTS) * _EIGHTH, _EIGHTH / _PARTS) for part in range(_PARTS)]
        blocked = np.zeros_like(on_floor)
        for hull in hulls:
            blocked |= rasterize(frame, _grown(edges, hull))
        turns[k] = on_floor & ~blocked
    return _Space(frame, storey, free, turns)


def _closed_cells(graph: NavGraph, storey: int) -> list[BaseGeometry]:
    """Return the cells that were closed after the graph was built, as boxes."""
    from bimnav.smooth import closed_cells

    boxes = (
        graph.frame.box_of(Cell(storey, row, col)) for row, col in np.argwhere(closed_cells(graph, storey)).tolist()
    )
    return [shapely.box(*box) for box in boxes]


def _disc(radius: float) -> tuple[tuple[float, float], ...]:
    ring = np.arange(16) * math.tau / 16
    reach = max(radius, _MARGIN) / math.cos(math.pi / 16)
    return tuple(zip((reach * np.cos(ring)).tolist(), (reach * np.sin(ring)).tolist(), strict=True))


def _body(outline: tuple[tuple[float, float], ...]) -> NDArray[np.float64]:
    """Return the corners of the convex hull of an outline, a hair larger."""
    hull = shapely.convex_hull(shapely.MultiPoint(outline))
    corners: NDArray[np.float64] = shapely.get_coordinates(shapely.buffer(hull, _MARGIN, join_style="mitre"))[:-1]
    return corners


def _turned(corners: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    found: NDArray[np.float64] = corners @ turn
    return found


def _swept(body: NDArray[np.float64], angle: float, by: float) -> NDArray[np.float64]:
    """Return corners whose hull holds a body through a turn: every arc lies within its chord and its tangents."""
    middle = _turned(body, angle + by / 2) / math.cos(by / 2)
    return np.vstack([_turned(body, angle), middle, _turned(body, angle + by)])


def _edges(shapes: list[BaseGeometry]) -> NDArray[np.float64]:
    """Return all edges of polygons and lines, (n, 2, 2); a point is an edge to itself."""
    parts = shapely.get_parts(shapely.get_parts(np.asarray(shapes, dtype=object)))
    areal = shapely.get_type_id(parts) == 3
    lines = np.concatenate([shapely.get_rings(parts[areal]), parts[~areal]])
    points, line = shapely.get_coordinates(lines, return_index=True)
    same = line[1:] == line[:-1]
    lone = shapely.get_coordinates(lines[shapely.get_type_id(lines) == 0])
    edges: NDArray[np.float64] = np.concatenate(
        [np.stack([points[:-1][same], points[1:][same]], axis=1), np.stack([lone, lone], axis=1)]
    )
    return edges


def _grown(edges: NDArray[np.float64], body: NDArray[np.float64]) -> NDArray[np.object_]:
    """Return where the middle must not be lest the body meets an edge: the edge with the mirrored body around it."""
    if not len(edges):
        return np.empty(0, dtype=object)
    corners = (edges[:, :, None] - body).reshape(len(edges), -1, 2)
    hulls: NDArray[np.object_] = shapely.convex_hull(shapely.multipoints(corners))
    return hulls
