"""Adaptive grids: coarse in open space, fine near obstacles and targets, as an explicit graph."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._kept import Kept
from bimnav.errors import GoalBlockedError, NoPathError, OutsideMapError, StartBlockedError
from bimnav.grid import Cell
from bimnav.smooth import shorten_points

if TYPE_CHECKING:
    import rustworkx

    from bimnav.graph import NavGraph

__all__ = ["AdaptiveGraph", "AdaptivePath", "adaptive_graph"]

_BLOCKED = -1


@dataclass(frozen=True, slots=True, eq=False)
class AdaptivePath(Kept):
    """A path over squares of different sizes, drawn straight.

    Parameters
    ----------
    waypoints : (n, 3) float64
        World metres, from the middle of the start's cell to that of the goal's.
    length
        Metres.
    nodes
        The squares it was drawn from.
    """

    waypoints: NDArray[np.float64]
    length: float
    nodes: tuple[int, ...]

    def __repr__(self) -> str:
        return f"AdaptivePath({len(self.waypoints)} waypoints, {self.length:.3f} m, {len(self.nodes)} squares)"


@dataclass(frozen=True, eq=False)
class AdaptiveGraph(Kept):
    """Squares of free cells: each as large as it can be, and one cell large at targets and obstacles.

    Parameters
    ----------
    graph
        The fine graph it stands for.
    square : (storeys, rows, cols) int32
        Number of the square that holds a cell; -1 where blocked.
    centers : (n, 3) float64
        Middles of the squares, world metres.
    sizes : (n,) int32
        Their edges, in cells.
    edges
        (m, 2) int32 pairs of squares that share a side or are joined by a connector, and (m,) float64 costs.
    """

    graph: NavGraph
    square: NDArray[np.int32]
    centers: NDArray[np.float64]
    sizes: NDArray[np.int32]
    edges: tuple[NDArray[np.int32], NDArray[np.float64]] = field(repr=False)

    def __repr__(self) -> str:
        cells, widest = int((self.square >= 0).sum()), self.sizes.max(initial=0)
        return f"AdaptiveGraph({self.node_count} squares for {cells} free cells, up to {widest} wide)"

    @property
    def node_count(self) -> int:
        """Number of squares."""
        return len(self.sizes)

    @cached_property
    def explicit(self) -> rustworkx.PyGraph[int, float]:
        """The graph for rustworkx: node k is square k, the weight of an edge its cost."""
        import rustworkx

        pairs, cost = self.edges
        explicit: rustworkx.PyGraph[int, float] = rustworkx.PyGraph(multigraph=False)
        explicit.add_nodes_from(range(self.node_count))
        explicit.add_edges_from(list(zip(*pairs.T.tolist(), cost.tolist(), strict=True)))
        return explicit

    def find_path(self, start: Cell, goal: Cell) -> AdaptivePath:
        """Find a short path between two free cells of the fine graph.

        A cheapest path from middle to middle of squares, with turns left out while the straight legs stay
        free and cost less: near the shortest, and not always it.

        Raises
        ------
        OutsideMapError, StartBlockedError, GoalBlockedError
            If a cell lies outside the map or is blocked.
        NoPathError
            If no way joins the two.
        """
        import rustworkx

        start, goal = Cell(*_checks.cell("start", start)), Cell(*_checks.cell("goal", goal))
        begin, end = self._square_at(start, StartBlockedError), self._square_at(goal, GoalBlockedError)
        plan = np.hypot(*(self.centers[:, :2] - self.centers[end, :2]).T)
        if self.graph.connectors:  # a ride may be shorter than its plan
            plan[:] = 0
        to_go = (plan * (float(self.graph.cost.min()) * self.graph.unit_cost)).tolist().__getitem__
        try:
            nodes = rustworkx.astar_shortest_path(self.explicit, begin, end.__eq__, float, to_go)
        except rustworkx.NoPathFound as error:
            message = f"no path from {start} to {goal}; both cells must be free and connected"
            raise NoPathError(message, "", {"start": tuple(start), "goal": tuple(goal)}) from error
        frame = self.graph.frame
        points = np.vstack([frame.center_of(start), self.centers[list(nodes)], frame.center_of(goal)])
        storeys = np.array([start.storey, *(self._storey[list(nodes)]), goal.storey])
        parts = np.split(np.arange(len(points)), np.flatnonzero(np.diff(storeys)) + 1)
        drawn = [shorten_points(self.graph, int(storeys[part[0]]), points[part]) for part in parts]
        waypoints = np.vstack(drawn)
        waypoints.flags.writeable = False
        length = math.fsum(np.linalg.norm(np.diff(waypoints, axis=0), axis=1))
        return AdaptivePath(waypoints, length, tuple(nodes))

    @cached_property
    def _storey(self) -> NDArray[np.int64]:
        flat, first = np.unique(self.square, return_index=True)
        storey: NDArray[np.int64] = first[flat >= 0] // (self.square.shape[1] * self.square.shape[2])
        return storey

    def _square_at(self, cell: Cell, error: type[StartBlockedError | GoalBlockedError]) -> int:
        if cell not in self.graph.frame:
            raise OutsideMapError(f"{cell} lies outside the map.", "", {"cell": tuple(cell)})
        found = int(self.square[cell])
        if found < 0:
            raise error(f"{cell} is blocked.", "Give a free cell.", {"cell": tuple(cell)})
        return found


def adaptive_graph(graph: NavGraph, *, largest: int = 32) -> AdaptiveGraph:
    """Join the free cells of a graph to squares, as in a quadtree.

    Parameters
    ----------
    graph
        Cells of unequal cost are not joined, and cells that hold targets stay alone. Connectors are kept.
    largest
        The largest edge of a square, in cells; rounded down to a power of two.
    """
    _checks.need("graph", graph, "NavGraph")
    _checks.whole("largest", largest, 1)
    squares, sizes, corners = _joined(graph, int(math.log2(largest)))
    frame, cost = graph.frame, graph.cost
    pairs = _neighbors(squares)
    half = (sizes - 1)[:, None] / 2
    middles = np.column_stack([corners[:, :1], corners[:, 1:] + half])
    centers = frame.centers_of(corners).astype(np.float64)
    centers[:, :2] += half * frame.cell_size
    level = cost[tuple(corners.T)].astype(np.float64)
    a, b = pairs.T
    apart = np.hypot(*(middles[a, 1:] - middles[b, 1:]).T) * frame.cell_size * graph.unit_cost
    # the part of the way that lies in each square is half as long as its edge
    weight = apart * (level[a] * sizes[a] + level[b] * sizes[b]) / (sizes[a] + sizes[b])
    links, costs = graph.links
    ends = squares.ravel()[links].reshape(-1, 2)
    pairs = np.concatenate([pairs, ends.astype(np.int32)])
    weight = np.concatenate([weight, costs])
    order = np.lexsort((weight, pairs[:, 1], pairs[:, 0]))[::-1]  # of several, the cheapest is added last
    for array in (squares, centers, sizes):
        array.flags.writeable = False
    return AdaptiveGraph(graph, squares, centers, sizes, (pairs[order], weight[order]))


def _joined(graph: NavGraph, levels: int) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64]]:
    """Return the square of each cell, the edges of squares, and the cells at their lower left corners."""
    storeys, rows, cols = graph.cost.shape
    edge = 1 << levels
    cost = np.full((storeys, -(-rows // edge) * edge, -(-cols // edge) * edge), np.inf, dtype=np.float32)
    cost[:, :rows, :cols] = graph.cost
    whole = [np.isfinite(cost)]
    alone = np.zeros_like(whole[0])
    for _, cell in graph.targets:
        if cell is not None:
            alone[cell] = True
    may_join, value = whole[0] & ~alone, cost
    for _ in range(levels):
        quarters = [(slice(None), slice(i, None, 2), slice(j, None, 2)) for i in (0, 1) for j in (0, 1)]
        same = np.logical_and.reduce([value[quarter] == value[quarters[0]] for quarter in quarters])
        may_join = np.logical_and.reduce([may_join[quarter] for quarter in quarters]) & same
        value = value[quarters[0]]
        whole.append(may_join)
    squares = np.full(cost.shape, _BLOCKED, dtype=np.int32)
    sizes, corners, known = [], [], 0
    for level in range(levels, -1, -1):
        size = 1 << level
        corner = np.argwhere(whole[level] & (squares[:, ::size, ::size] < 0)) * (1, size, size)
        numbers = known + np.arange(len(corner), dtype=np.int32)
        storey, row, col = corner.T
        reach = np.arange(size)
        squares[storey[:, None, None], row[:, None, None] + reach[:, None], col[:, None, None] + reach] = numbers[
            :, None, None
        ]
        sizes.append(np.full(len(corner), size, dtype=np.int32))
        corners.append(corner)
        known += len(corner)
    found = np.ascontiguousarray(squares[:, :rows, :cols])
    return found, np.concatenate(sizes), np.concatenate(corners)


def _neighbors(squares: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the pairs of squares that share a side, each once."""
    keys = []
    for low, high in ((squares[:, :-1], squares[:, 1:]), (squares[:, :, :-1], squares[:, :, 1:])):
        meet = (low >= 0) & (high >= 0) & (low != high)
        a, b = low[meet].astype(np.int64), high[meet].astype(np.int64)
        keys.append(np.minimum(a, b) << 32 | np.maximum(a, b))
    key = np.unique(np.concatenate(keys))
    return np.column_stack([key >> 32, key & 0xFFFFFFFF]).astype(np.int32)
