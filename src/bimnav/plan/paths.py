"""Paths and distances on a navigation graph."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks, search
from bimnav._kept import Kept
from bimnav._progress import Display, Progress
from bimnav._why import why_unreachable
from bimnav.errors import (
    GoalBlockedError,
    InputError,
    NoPathError,
    OutsideMapError,
    StartBlockedError,
    ValueRangeError,
)
from bimnav.graph import NavGraph, Objective
from bimnav.grid import Cell
from bimnav.smooth import straighten, turns_of

if TYPE_CHECKING:
    import rustworkx

    from bimnav.links import Link

__all__ = [
    "Algorithm",
    "Engine",
    "Path",
    "Smooth",
    "check_smooth",
    "distance_field",
    "distance_matrix",
    "find_path",
    "free_index",
    "layout_of",
    "smooth_path",
    "source_indexes",
]

Algorithm = Literal["auto", "astar", "dijkstra"]
Engine = Literal["compiled", "rustworkx"]
Smooth = Literal["any_angle"]

_PROVED = 1e-9  # relative; a smaller gap is rounding

_layouts: WeakKeyDictionary[NavGraph, search.Layout] = WeakKeyDictionary()
_variants: WeakKeyDictionary[NavGraph, dict[Objective, NavGraph]] = WeakKeyDictionary()
_written: WeakKeyDictionary[NavGraph, rustworkx.PyGraph[int, float]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Path(Kept):
    """A walk over neighboring cells, and over connectors from storey to storey.

    Parameters
    ----------
    indices : (n, 3) int32
        Storey, row and column of every cell, from start to goal.
    length
        Metres, over connectors in space.
    cost
        What was made least: every step's length times the mean of its cells' multipliers, and what the
        connectors cost; metres, or seconds or joules if that is the graph's objective.
    legs : (n, 3) float64 or None
        Points between which the path was drawn straight, metres; then `length` and `cost` are theirs, and
        the cells are those of the path they were drawn from.
    """

    graph: NavGraph
    indices: NDArray[np.int32]
    length: float
    cost: float
    legs: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        self.indices.setflags(write=False)
        if self.legs is not None:
            self.legs.flags.writeable = False

    def __repr__(self) -> str:
        start, goal = (Cell(*self.indices[k].tolist()) for k in (0, -1))
        return f"Path({start} to {goal}, {len(self.indices)} cells, {self.length:.3f} m)"

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """The cells, from start to goal."""
        return tuple(Cell(*index) for index in self.indices.tolist())

    @cached_property
    def rides(self) -> tuple[tuple[int, Link], ...]:
        """The connectors it takes: each with the number of the cell in `cells` from which it leaves."""
        return tuple(_rides(self.graph, self.indices)) if self.graph.connectors else ()

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(m, 3) float64, the middles of the cells and the ways over connectors, world metres."""
        frame = self.graph.frame
        points: NDArray[np.float64] = search.centers(
            self.indices, frame.first_row, frame.first_col, frame.cell_size, np.array(frame.elevations)
        )
        if self.graph.connectors and self.rides:
            parts = np.split(points, [k + 1 for k, _ in self.rides])
            points = _along(self, parts)
        points.setflags(write=False)
        return points

    @cached_property
    def waypoints(self) -> NDArray[np.float64]:
        """(n, 3) float64, where the path begins, turns and ends in world coordinates, metres."""
        if self.legs is not None:
            return self.legs
        points = _along(self, [self.graph.frame.centers_of(turns_of(part)) for part in _stretches(self)])
        points.flags.writeable = False
        return points


def find_path(
    graph: NavGraph,
    start: Cell,
    goal: Cell,
    *,
    algorithm: Algorithm = "auto",
    engine: Engine = "compiled",
    smooth: Smooth | None = None,
    objective: Objective | None = None,
) -> Path:
    """Find a cheapest path.

    Among equally cheap paths the choice is fixed, so equal inputs give equal outputs.

    Parameters
    ----------
    graph
        Graph to search.
    start, goal
        Cells to join. A cell joined to itself is a path of one cell and length 0.
    algorithm
        Search to run; all return a cheapest path. A* looks at fewer cells than Dijkstra's; `auto` takes
        jump points, which look at fewer still, where all cells cost the same and have eight neighbors.
    engine
        `compiled` searches the arrays; `rustworkx` searches the graph written out, hundreds of times
        slower: a second opinion. Which of several cheapest paths they return may differ.
    smooth
        `any_angle` draws the path straight, see `smooth_path`.
    objective
        `distance`, `time` or `energy`: what to make least instead of what the graph says, as on
        `graph.with_objective(objective)`.

    Returns
    -------
    path
        Adjacent cells from start to goal; no step cuts a blocked corner.

    Raises
    ------
    OutsideMapError
        If a cell is not one of the graph's.
    StartBlockedError, GoalBlockedError
        If a cell is blocked.
    NoPathError
        If no walk over free cells joins the two.
    """
    if algorithm not in ("auto", "astar", "dijkstra"):
        raise ValueRangeError(f"algorithm is {algorithm!r}.", "Give 'auto', 'astar' or 'dijkstra'.")
    if engine not in ("compiled", "rustworkx"):
        raise ValueRangeError(f"engine is {engine!r}.", "Give 'compiled' or 'rustworkx'.")
    _checks.need("graph", graph, NavGraph)
    check_smooth(smooth)
    graph = graph if objective is None else _with_objective(graph, objective)
    begin = free_index(graph, start, "start")
    end = free_index(graph, goal, "goal")
    if engine == "rustworkx":
        path = _find_explicit(graph, begin, end, algorithm)
    else:
        found = search.find(layout_of(graph), begin, end, algorithm)
        if found is None:
            raise _no_path(graph, begin, end)
        d = graph.frame.cell_size
        length = _length(graph, found.indices) if graph.connectors else found.length * d
        path = Path(graph, found.indices, length, found.cost * d * graph.unit_cost)
    return smooth_path(path) if smooth else path


def _with_objective(graph: NavGraph, objective: Objective) -> NavGraph:
    """Return the graph with another objective, the same one every time, so that what is known of it is kept."""
    if objective == graph.objective:
        return graph
    known = _variants.setdefault(graph, {})
    if objective not in known:
        known[objective] = graph.with_objective(objective)
    return known[objective]


def check_smooth(smooth: Smooth | None) -> None:
    """Refuse a way of smoothing that there is not."""
    if smooth not in (None, "any_angle"):
        raise ValueRangeError(f"smooth is {smooth!r}.", "Give 'any_angle' or None.")


def smooth_path(
    path: Path, begin: tuple[float, float, float] | None = None, end: tuple[float, float, float] | None = None
) -> Path:
    """Draw a path straight: legs at any angle that never leave free space.

    Between links, where all floor costs the same, the legs are a shortest path for the robot's middle: past
    the exact shapes of an environment, grown by the robot's radius, or past the blocked cells of a mask, whose
    sides and corners may be touched. Where cells have multipliers, turns are left out and moved while that saves cost.
    Every leg is checked against the exact shapes; where one fails the path over cells stays.

    Parameters
    ----------
    path
        As found over cells.
    begin, end
        Exact points in the first and the last cell, metres; the middles of the cells if not given.
    """
    graph, stretches = path.graph, _stretches(path)
    straight = [
        straighten(graph, part, begin if k == 0 else None, end if k == len(stretches) - 1 else None)
        for k, part in enumerate(stretches)
    ]
    length, cost = (math.fsum(part[k] for part in straight) for k in (1, 2))
    length += math.fsum(link.length for _, link in path.rides)
    cost = cost * graph.unit_cost + math.fsum(graph.cost_of(link) for _, link in path.rides)
    return replace(path, length=length, cost=cost, legs=_along(path, [part.points for part in straight]))


def _stretches(path: Path) -> list[NDArray[np.int32]]:
    """Return the parts of a path that lie on one storey each."""
    return np.split(path.indices, [k + 1 for k, _ in path.rides])


def _along(path: Path, parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Join the points on each storey by the ways over the connectors between them."""
    for n, (k, link) in enumerate(path.rides):
        parts[n] = np.vstack([parts[n], link.points_from(Cell(*path.indices[k].tolist()))[1:-1]])
    return np.vstack(parts)


def distance_field(graph: NavGraph, sources: Cell | Iterable[Cell]) -> NDArray[np.float64]:
    """Find the distance from the nearest source to every cell.

    Parameters
    ----------
    graph
        Graph to search.
    sources
        One free cell, also as three plain numbers, or several.

    Returns
    -------
    distance : (storeys, rows, cols) float64
        Metres; where cells have multipliers, the cost of a cheapest path; in seconds or joules if that is
        the graph's objective. inf where no path leads.

    Raises
    ------
    OutsideMapError, StartBlockedError
        If a source lies outside the map or is blocked.
    """
    index = source_indexes(graph, sources)
    return search.distances(layout_of(graph), index, graph.frame.cell_size * graph.unit_cost)


def source_indexes(graph: NavGraph, sources: Cell | Iterable[Cell]) -> NDArray[np.int64]:
    """Return the flat indexes of free cells, at least one."""
    _checks.need("graph", graph, NavGraph)
    cells: tuple[Any, ...] = _checks.many("sources", sources)
    if len(cells) == 3 and all(np.ndim(value) == 0 for value in cells):  # a cell, as plain numbers
        cells = (cells,)
    if not cells:
        raise InputError("a distance field needs a source.", "Give at least one free cell.")
    return np.array([free_index(graph, cell, "start") for cell in cells])


def distance_matrix(
    graph: NavGraph, cells: Sequence[Cell], *, progress: bool | Progress | None = None
) -> NDArray[np.float64]:
    """Find the distances between all pairs of cells.

    Parameters
    ----------
    graph
        Graph to search.
    cells
        May repeat, and may be blocked.
    progress
        As in `read_ifc`: whether to show how far it is, or a function to call with rows done, their total,
        and a word.

    Returns
    -------
    distance : (n, n) float64
        From row to column as in `distance_field`; inf where no path leads, which holds for blocked cells; 0 from
        a row to itself, also of a blocked cell.

    Raises
    ------
    OutsideMapError
        If a cell is not one of the graph's.
    """
    _checks.need("graph", graph, NavGraph)
    index = np.array([_index(graph, cell, "cell") for cell in _checks.many("cells", cells)], dtype=np.int64)
    matrix = np.full((len(index), len(index)), np.inf)
    np.fill_diagonal(matrix, 0.0)
    free = np.flatnonzero(np.isfinite(graph.cost.ravel()[index]))
    scale = graph.frame.cell_size * graph.unit_cost
    with Display("distances", progress) as report:
        matrix[np.ix_(free, free)] = search.distances_between(layout_of(graph), index[free], scale, report)
        report(len(free), len(free), "rows")
    return matrix


def layout_of(graph: NavGraph) -> search.Layout:
    """Return the arrays that the kernels want of a graph, the same ones every time."""
    layout = _layouts.get(graph)
    if layout is None:
        links, costs = graph.links
        unit = graph.frame.cell_size * graph.unit_cost
        layout = _layouts[graph] = search.Layout(graph.cost, graph.connectivity, links, costs / unit)
    return layout


def _rides(graph: NavGraph, indices: NDArray[np.int32]) -> Iterator[tuple[int, Link]]:
    for k in np.flatnonzero(np.diff(indices[:, 0])).tolist():
        link = graph.link_between(*(Cell(*indices[i].tolist()) for i in (k, k + 1)))
        assert link is not None  # noqa: S101 - no search changes the storey on its own
        yield k, link


def _length(graph: NavGraph, indices: NDArray[np.int32]) -> float:
    """Return the length of a walk, metres."""
    storey, row, col = np.abs(np.diff(indices, axis=0)).T
    steps = (row + col)[storey == 0]
    flat = float((steps == 1).sum()) + float((steps == 2).sum()) * math.sqrt(2)
    return graph.frame.cell_size * flat + math.fsum(link.length for _, link in _rides(graph, indices))


def _index(graph: NavGraph, cell: Cell, role: str) -> int:
    try:
        storey, row, col = cell
        storey, row, col = operator.index(storey), operator.index(row), operator.index(col)
    except (TypeError, ValueError) as error:
        hint = "Give a Cell; `graph.frame.cell_at(x, y)` finds the one at a point."
        raise InputError(f"{role} is {cell!r}, which is no cell.", hint, {role: cell}) from error
    storeys, rows, cols = graph.cost.shape
    if not (0 <= storey < storeys and 0 <= row < rows and 0 <= col < cols):
        raise OutsideMapError(
            f"{role} {cell} lies outside the map.",
            f"The map has {storeys}, {rows} and {cols} storeys, rows and columns; `graph.frame.cell_at` finds cells.",
            {role: tuple(cell)},
        )
    index: int = (storey * rows + row) * cols + col
    return index


def free_index(graph: NavGraph, cell: Cell, role: Literal["start", "goal"]) -> int:
    """Return the flat index of a free cell."""
    index = _index(graph, cell, role)
    if graph.cost.item(index) == math.inf:
        error = StartBlockedError if role == "start" else GoalBlockedError
        cell = Cell(*_checks.cell(role, cell))
        raise error(f"{role} {cell} is blocked.", _nearest_free(graph, cell), {role: tuple(cell)})
    return index


def _nearest_free(graph: NavGraph, cell: Cell) -> str:
    free = np.argwhere(graph.free[cell.storey])
    if not len(free):
        return "No cell of its storey is free."
    row, col = free[((free - (cell.row, cell.col)) ** 2).sum(axis=1).argmin()].tolist()
    return f"The nearest free cell is {Cell(cell.storey, row, col)}."


def _cell(graph: NavGraph, index: int) -> Cell:
    storey, row, col = (int(k) for k in np.unravel_index(index, graph.cost.shape))
    return Cell(storey, row, col)


def _no_path(graph: NavGraph, begin: int, end: int) -> NoPathError:
    start, goal = _cell(graph, begin), _cell(graph, end)
    context: dict[str, Any] = {"start": tuple(start), "goal": tuple(goal)}
    reason = "both cells must be free and connected"
    if graph.environment is not None and (why := why_unreachable(graph, start, goal)) is not None:
        reason = why.message
        context |= {"reason": why.reason, "global_ids": list(why.global_ids), "shortage": why.shortage}
    return NoPathError(f"no path from {start} to {goal}; {reason}", "", context)


def _find_explicit(graph: NavGraph, begin: int, end: int, algorithm: Algorithm) -> Path:
    """Search the graph written out, with callables that run no Python code."""
    import rustworkx

    layout = layout_of(graph)
    if algorithm == "dijkstra":
        to_go = (0.0).__mul__
    else:
        _, row, col = np.abs(np.indices(graph.cost.shape) - np.array(_cell(graph, end)).reshape(3, 1, 1, 1))
        plan = row + col - (2 - math.sqrt(2)) * np.minimum(row, col) * (graph.connectivity == 8)
        least = graph.frame.cell_size * graph.unit_cost * layout.least * layout.shrink
        to_go = (plan * (least * (1 - _PROVED))).ravel().tolist().__getitem__
    explicit = _written.get(graph)
    if explicit is None:
        explicit = _written[graph] = graph.to_rustworkx()
    try:
        nodes = rustworkx.astar_shortest_path(explicit, begin, end.__eq__, float, to_go)
    except rustworkx.NoPathFound as error:
        raise _no_path(graph, begin, end) from error
    flat = np.array(list(nodes), dtype=np.int64)
    indices = np.stack(np.unravel_index(flat, graph.cost.shape), axis=1).astype(np.int32)
    cost = math.fsum(explicit.get_edge_data(a, b) for a, b in pairwise(nodes))
    return Path(graph, indices, _length(graph, indices), cost)
