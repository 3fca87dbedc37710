"""From a path over cells to true straight legs.

On floor with obstacles of exact shape, or on a mask of cells, the legs are a shortest path for the robot's
middle, bends at corners of obstacles included. Where cells have multipliers the turns of the path are left
out and moved as long as that saves cost. No leg is taken that the exact shapes refuse: then the path over cells
stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import search
from bimnav.grid import Cell, GridFrame, cells_within, rasterize

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment
    from bimnav.graph import NavGraph

__all__ = ["Straight", "closed_cells", "shorten_points", "straighten", "turns_of"]

Point = tuple[float, float, float]

_MARGIN = 2e-6  # metres kept from exact shapes: cells are eroded by half of it, and rounding takes far less
_TWIN = 1e-7  # metres; what is nearer than this is one: far less than the margin
_QUARTER = 8  # segments of a quarter circle around corners: a body of 0.25 m loses a millimetre
_SAME = 1e-9  # metres
_APART = 3.0  # cells; between turns that may move


class Straight(NamedTuple):
    """Straight legs.

    Attributes
    ----------
    points : (n, 3) float64
        Where they begin and end, metres.
    length, cost
        What they measure and cost, metres.
    """

    points: NDArray[np.float64]
    length: float
    cost: float


def turns_of(indices: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the cells of a path at which it begins, turns and ends."""
    if len(indices) < 3:
        return indices
    steps = np.diff(indices, axis=0)
    turns = (steps[1:] != steps[:-1]).any(axis=1)
    kept: NDArray[np.int32] = indices[np.concatenate([[True], turns, [True]])]
    return kept


def straighten(
    graph: NavGraph, indices: NDArray[np.int32], begin: Point | None = None, end: Point | None = None
) -> Straight:
    """Replace a path over cells by straight legs that cost no more; where all floor costs the same, no longer either.

    Parameters
    ----------
    indices : (n, 3) int
        Storey, row and column of adjacent cells of one storey.
    begin, end
        Exact points in the first and the last cell; the middles of the cells if not given.
    """
    # with the cells next to the ends: an end may lie in an obstacle and must be entered as planned
    cells = np.vstack([indices[:2], turns_of(indices)[1:-1], indices[2:][-2:]])
    points = graph.frame.centers_of(cells)
    plan = [points[:, :2]]
    if begin is not None:
        plan.insert(0, np.array([begin[:2]]))
    if end is not None:
        plan.append(np.array([end[:2]]))
    part = _Plane.of(graph, int(indices[0, 0])).straighten(_without_repeats(np.vstack(plan)))
    return part._replace(points=np.column_stack([part.points, np.full(len(part.points), points[0, 2])]))


def _without_repeats(points: NDArray[np.float64]) -> NDArray[np.float64]:
    moved = np.hypot(*np.diff(points, axis=0).T) > _SAME
    kept: NDArray[np.float64] = points[np.concatenate([[True], moved])]
    return kept


def _divided(points: NDArray[np.float64], most: float) -> NDArray[np.float64]:
    """Return the points of a polyline, (n, 2), with others between them, so that no leg is longer than that."""
    parts = [points[:1]]
    for a, b in pairwise(points):
        count = math.ceil(math.hypot(*(b - a)) / most)
        parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.vstack(parts)


def _length(points: NDArray[np.float64]) -> float:
    return math.fsum(np.hypot(*np.diff(points, axis=0).T))


def shorten_points(graph: NavGraph, storey: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leave out points of a path on one storey while the straight legs between the others cost less.

    Parameters
    ----------
    points : (n, 3) float64
        Metres; consecutive ones see each other over free cells.
    """
    plan = _without_repeats(points[:, :2])
    if len(plan) > 1:
        plan = _Plane.of(graph, storey).shortened(plan).points
    return np.column_stack([plan, np.full(len(plan), points[0, 2])])


def closed_cells(graph: NavGraph, storey: int) -> NDArray[np.bool_]:
    """Return the cells of a storey that were closed after the graph was built, and blocked ones beside them."""
    return _Plane.of(graph, storey).closed_cells()


_planes: WeakKeyDictionary[NavGraph, dict[int, _Plane]] = WeakKeyDictionary()
_open_cells: WeakKeyDictionary[IndoorEnvironment, dict[tuple[GridFrame, int], NDArray[np.bool_]]] = WeakKeyDictionary()


@dataclass(eq=False)
class _Plane:
    """One storey of a graph, and what makes its floor a mesh."""

    frame: GridFrame
    cost: NDArray[np.float32]
    environment: IndoorEnvironment | None
    storey: int

    @staticmethod
    def of(graph: NavGraph, storey: int) -> _Plane:
        """Return the plane of a storey, the same for every question."""
        planes = _planes.setdefault(graph, {})
        if storey not in planes:
            planes[storey] = _Plane(graph.frame, graph.cost[storey], graph.environment, storey)
        return planes[storey]

    def straighten(self, points: NDArray[np.float64]) -> Straight:
        """Return legs for the points of a path over cells, (n, 2) metres."""
        if len(points) < 2:
            return Straight(points, 0.0, 0.0)
        found = self._shortest(points)
        if found is not None:
            dearest = max(search.dearest(self.cost, *a, *b) for a, b in pairwise(found[1]))
            if dearest <= self.least:  # no way costs less
                length = _length(found[0])
                return Straight(found[0], length, length * self.least)
        return self._eased(self.shortened(points))

    @cached_property
    def least(self) -> float:
        """The least multiplier of the storey."""
        return float(self.cost.min())

    @property
    def _origin(self) -> NDArray[np.float64]:
        return np.array([self.frame.first_col, self.frame.first_row], dtype=np.float64)

    def _in_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return points / self.frame.cell_size - self._origin

    def _in_metres(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return (points + self._origin) * self.frame.cell_size

    def _shortest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return the shortest path, multipliers aside, in metres and in cells; None if none was found.

        Points at the ends that lie in an obstacle, such as a target that is reached all the same, stay.
        """
        places = points if self.environment else self._in_cells(points)
        faces = [self._face_at(point) for point in places]
        on = [k for k, face in enumerate(faces) if face >= 0]
        if not on:
            return None
        first, last = on[0], on[-1]
        taut = search.find_taut(self._mesh, tuple(places[first]), faces[first], tuple(places[last]), faces[last])
        if taut is None or (self.environment and not self._is_clear(taut.points)):
            return None
        found = taut.points if self.environment else self._in_metres(taut.points)
        found = _without_repeats(np.vstack([points[:first], found, points[last + 1 :]]))
        return found, self._in_cells(found)

    def shortened(self, points: NDArray[np.float64]) -> Straight:
        """Leave out turns where that costs less."""
        cells = self._in_cells(points)
        kept, _ = search.shorten(self.cost, cells)
        if self.environment:
            legs = [
                list(range(a, b)) if b > a + 1 and not self._is_clear(points[[a, b]]) else [a]
                for a, b in pairwise(kept.tolist())
            ]
            kept = np.array([k for leg in legs for k in leg] + [len(points) - 1])
        cost = math.fsum(search.along(self.cost, *cells[a], *cells[b]) for a, b in pairwise(kept))
        found = points[kept]
        return Straight(found, _length(found), cost * self.frame.cell_size)

    def _eased(self, path: Straight) -> Straight:
        """Move the turns of a path to where it costs less, with more turns where floor gets dearer gradually."""
        cells = self._in_cells(_divided(path.points, _APART * self.frame.cell_size))
        search.relax(self.cost, cells)
        kept, cost = search.shorten(self.cost, cells)
        points = self._in_metres(cells[kept])
        points[[0, -1]] = path.points[[0, -1]]
        if cost * self.frame.cell_size >= path.cost or (self.environment and not self._is_clear(points)):
            return path
        return Straight(points, _length(points), cost * self.frame.cell_size)

    @cached_property
    def _triangles(self) -> NDArray[np.object_]:
        try:
            floor = shapely.simplify(self._free_floor(), _TWIN)  # else corners that all but coincide make slivers
            triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(floor))
        except shapely.errors.GEOSException:
            return np.empty(0, dtype=object)
        found: NDArray[np.object_] = triangles[shapely.area(triangles) > 0]
        return found

    @cached_property
    def _triangle_tree(self) -> shapely.STRtree:
        return shapely.STRtree(self._triangles)

    @cached_property
    def _cell_mesh(self) -> tuple[search.Mesh, NDArray[np.int32]]:
        return search.mesh_of_mask(np.isfinite(self.cost))

    @cached_property
    def _mesh(self) -> search.Mesh:
        if self.environment is None:
            return self._cell_mesh[0]
        return search.mesh_of_triangles(shapely.get_coordinates(self._triangles).reshape(-1, 4, 2)[:, :3])

    def _face_at(self, point: NDArray[np.float64]) -> int:
        if self.environment is None:
            col, row = (int(value) for value in np.floor(point))
            return int(self._cell_mesh[1][row, col])
        found = self._triangle_tree.query(shapely.Point(point), predicate="intersects")
        return int(found.min()) if len(found) else -1

    def _free_floor(self) -> BaseGeometry:
        """Return where the robot's middle may be, a hair less than all of it."""
        environment = self.environment
        assert environment is not None  # noqa: S101  # for mypy
        radius = environment.robot.radius
        # around the bodies that the environment draws with finer arcs
        grown = (radius * 1.0013 + _MARGIN) / math.cos(math.pi / (4 * _QUARTER))
        footprints = [obstacle.footprint for obstacle in environment.obstacles_on(self.storey)]
        bodies = list(shapely.buffer(footprints, grown, quad_segs=_QUARTER)) if footprints else []
        bodies += list(shapely.buffer(self._restricted, _MARGIN)) if self._restricted else []
        closed = np.argwhere(self.closed_cells()).tolist()
        cells = [shapely.box(*self.frame.box_of(Cell(self.storey, row, col))) for row, col in closed]
        bodies += list(shapely.buffer(cells, _MARGIN, join_style="mitre")) if cells else []
        floor = shapely.buffer(environment.floor(self.storey), -_MARGIN, join_style="mitre")
        return shapely.difference(floor, shapely.union_all(bodies)) if bodies else floor

    @cached_property
    def _restricted(self) -> list[BaseGeometry]:
        zones = self.environment.zones if self.environment else ()
        return [zone.polygon for zone in zones if zone.storey == self.storey and zone.factor == math.inf]

    def closed_cells(self) -> NDArray[np.bool_]:
        """Return the cells that were closed after the graph was built, and the blocked ones beside them.

        A cell may be blocked by what covers a part of it. Where its neighbor was closed, what is left of it
        would be a way around.
        """
        closed = self._open_at_first() & np.isinf(self.cost)
        if not closed.any():
            return closed
        beside = search.dilate(closed, np.ones((3, 3), dtype=np.bool_))
        return closed | (beside & np.isinf(self.cost))

    def _open_at_first(self) -> NDArray[np.bool_]:
        environment = self.environment
        assert environment is not None  # noqa: S101  # for mypy
        known = _open_cells.setdefault(environment, {})
        key = self.frame, self.storey
        if key not in known:
            bodies = [body for _, body in environment.bodies_on(self.storey)]
            blocked = rasterize(self.frame, [*bodies, *self._restricted])
            known[key] = cells_within(self.frame, environment.floor(self.storey)) & ~blocked
        return known[key]

    @cached_property
    def _judge(self) -> tuple[BaseGeometry, shapely.STRtree]:
        environment = self.environment
        assert environment is not None  # noqa: S101  # for mypy
        floor = shapely.buffer(environment.floor(self.storey), _SAME)
        shapely.prepare(floor)
        return floor, shapely.STRtree([*(body for _, body in environment.bodies_on(self.storey)), *self._restricted])

    def _is_clear(self, points: NDArray[np.float64]) -> bool:
        """Tell whether the robot can drive from point to point, by the exact shapes."""
        floor, bodies = self._judge
        lines = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))
        met = bodies.query(lines, predicate="dwithin", distance=_TWIN)  # a point that only just passes has touched
        return bool(shapely.covers(floor, lines).all()) and not met.size
