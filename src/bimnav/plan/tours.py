"""The order of stops, and the tour over them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav import search
from bimnav.errors import InputError, NoPathError, ValueRangeError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan.paths import Algorithm, Path, distance_matrix, find_path, free_index
from bimnav.stops import Stop, Unreached

__all__ = ["StopOrder", "Tour", "order_stops", "plan_tour"]

_SAME_POINT = 1e-9  # metres
_PROVED = 1e-9  # relative; a smaller gap is rounding


@dataclass(frozen=True, slots=True, eq=False)
class StopOrder:
    """In which order to visit the rows of a matrix.

    Parameters
    ----------
    order
        Row numbers, the start first; a return to it is not listed.
    length
        Sum of the matrix along the order, with the way back if there is one.
    bound
        No order is shorter than this.
    is_optimal
        Whether no order is shorter: proved, not hoped.
    is_cut_short
        Whether the time limit ended the search before its work was done.
    """

    order: tuple[int, ...]
    length: float
    bound: float
    is_optimal: bool
    is_cut_short: bool = False

    @property
    def gap(self) -> float:
        """How much longer than the bound, as a fraction of it."""
        return _gap(self.length, self.bound)


@dataclass(frozen=True, eq=False)
class Tour:
    """Stops in the order of visiting, and the way from each to the next.

    Parameters
    ----------
    start
        Cell in which the tour begins.
    start_point
        World point at which it begins, metres.
    stops
        In the order of visiting.
    legs
        Leg k ends in the cell of stop k; one more leads back if the tour returns.
    unreached
        What cannot be served, and why.
    is_optimal
        Whether no order of these stops costs less: proved, not hoped.
    lower_bound
        No order of these stops costs less than this, metres.
    return_to_start
        Whether the tour ends where it begins.
    """

    graph: NavGraph
    start: Cell
    start_point: tuple[float, float, float]
    stops: tuple[Stop, ...]
    legs: tuple[Path, ...]
    unreached: tuple[Unreached, ...]
    is_optimal: bool
    lower_bound: float
    return_to_start: bool = False

    def __repr__(self) -> str:
        return f"Tour({len(self.stops)} stops, {len(self.unreached)} unreached, {self.length:.3f} m)"

    @cached_property
    def length(self) -> float:
        """Of all legs, along cells, metres."""
        return math.fsum(leg.length for leg in self.legs)

    @cached_property
    def cost(self) -> float:
        """Of all legs, metres; the length where no cell has a multiplier."""
        return math.fsum(leg.cost for leg in self.legs)

    @property
    def gap(self) -> float:
        """How much the tour costs beyond the lower bound, as a fraction of it."""
        return _gap(self.cost, self.lower_bound)

    @cached_property
    def route(self) -> tuple[NDArray[np.float64], ...]:
        """What the robot drives: for each leg an (n, 3) polyline in metres, from exact point to exact point.

        It passes the middles of the cells where it turns. A cell that is reached although it is blocked
        is entered straight to its stop, and left likewise.
        """
        ends = [stop.end for stop in self.stops]
        blocked = [stop.approach == "reach" for stop in self.stops]
        if len(self.legs) > len(self.stops):
            ends.append(self.start_point)
            blocked.append(False)
        begins = [self.start_point, *ends]
        return tuple(
            _polyline(leg, begins[k], ends[k], skip_first=k > 0 and blocked[k - 1], skip_last=blocked[k])
            for k, leg in enumerate(self.legs)
        )


def order_stops(
    matrix: ArrayLike,
    start: int = 0,
    *,
    end: int | None = None,
    return_to_start: bool = False,
    time_limit: float | None = None,
) -> StopOrder:
    """Find a short order in which to visit all rows of a matrix.

    Up to 15 rows besides start and end the order is a shortest one, proved. For more it is a good one:
    local search with a fixed amount of work, and a lower bound that says how good. Equal inputs give
    equal orders unless a time limit cuts the search short.

    Parameters
    ----------
    matrix : (n, n) float
        Cost from row to column, at least 0; inf where there is no way. Need not be symmetric.
    start
        The first row.
    end
        The last row; None for any.
    return_to_start
        Whether the way back from the last row to the first counts.
    time_limit
        Seconds after which to stop improving; a result that was cut short says so.

    Raises
    ------
    ValueRangeError
        If a number is negative or not a number, or start or end is no row.
    NoPathError
        If no order with a finite length was found.

    Examples
    --------
    >>> order_stops([[0, 9, 1], [9, 0, 2], [1, 2, 0]]).order
    (0, 2, 1)
    """
    cost = np.array(matrix, dtype=np.float64)
    if cost.ndim != 2 or cost.shape[0] != cost.shape[1] or not cost.size:
        raise InputError(f"a matrix of shape {cost.shape} orders nothing.", "Give (n, n) costs, at least one row.")
    if np.isnan(cost).any() or (cost < 0).any():
        raise ValueRangeError("the matrix has costs below 0 or not a number.", "Give costs of at least 0, or inf.")
    for name, row in (("start", start), ("end", end)):
        if row is not None and not 0 <= row < len(cost):
            raise ValueRangeError(f"{name} is {row}, the matrix has rows 0 to {len(cost) - 1}.")
    if end is not None and return_to_start and end != start:
        raise InputError("a tour cannot both end elsewhere and return.", "Give end or return_to_start, not both.")
    np.fill_diagonal(cost, 0.0)
    if end == start:
        end, return_to_start = None, True
    found = search.order_rows(cost, start, end, return_to_start, time_limit)
    along = [*found.order, start] if return_to_start else found.order
    length = math.fsum(cost[along[:-1], along[1:]])
    if not math.isfinite(length):
        raise NoPathError(
            f"no order of the {len(cost)} rows has a finite length.",
            "Leave out the rows that cannot be reached, or cannot be left.",
        )
    is_optimal = found.bound >= length * (1 - _PROVED)
    bound = length if is_optimal else max(found.bound, 0.0)
    return StopOrder(tuple(found.order.tolist()), length, bound, is_optimal, found.is_cut_short)


def plan_tour(
    graph: NavGraph,
    start: Cell,
    stops: Iterable[Stop] | None = None,
    *,
    algorithm: Algorithm = "auto",
    return_to_start: bool = False,
    start_point: tuple[float, float, float] | None = None,
) -> Tour:
    """Plan a cheap tour over stops.

    Parameters
    ----------
    graph
        Graph to search.
    start
        Cell in which the robot is.
    stops
        What to visit; None for every target of the graph. Several may share a cell.
    algorithm
        As in `find_path`, for the legs.
    return_to_start
        Whether to come back in the end.
    start_point
        World point at which the robot is, in metres; the middle of its cell if not given.

    Returns
    -------
    tour
        All stops that can be reached; the others are in `tour.unreached`, with the reason.

    Raises
    ------
    OutsideMapError, StartBlockedError
        If the start lies outside the map or is blocked.
    """
    free_index(graph, start, "start")
    unreached: list[Unreached] = []
    if stops is None:
        stops, lost = graph.stops_from(start)
        unreached += lost
    found: dict[Cell, list[Stop]] = {start: []}  # stops that share a cell are visited together
    for stop in stops:
        reason = _why_unreached(graph, start, stop.cell)
        if reason:
            unreached.append(Unreached(stop.global_id, stop.name, stop.destination, reason, stop.cell))
        else:
            found.setdefault(stop.cell, []).append(stop)
    cells = list(found)
    order = order_stops(distance_matrix(graph, cells), return_to_start=return_to_start)
    visits = tuple(stop for k in order.order for stop in found[cells[k]])
    places = [start, *(stop.cell for stop in visits)]
    if return_to_start and visits:
        places.append(start)
    legs = tuple(find_path(graph, begin, end, algorithm=algorithm) for begin, end in pairwise(places))
    point = graph.frame.center_of(start) if start_point is None else start_point
    return Tour(graph, start, point, visits, legs, tuple(unreached), order.is_optimal, order.bound, return_to_start)


def _gap(length: float, bound: float) -> float:
    if length <= bound:
        return 0.0
    return length / bound - 1 if bound > 0 else math.inf


def _why_unreached(graph: NavGraph, start: Cell, cell: Cell) -> str:
    if cell not in graph.frame:
        return "its cell lies outside the map"
    if not graph.free[cell]:
        return "its cell is blocked"
    if graph.components[cell] != graph.components[start]:
        where = "on another storey" if cell.storey != start.storey else "in another part of the building"
        return f"no path from the start: it lies {where}"
    return ""


def _polyline(
    leg: Path,
    begin: tuple[float, float, float],
    end: tuple[float, float, float],
    *,
    skip_first: bool,
    skip_last: bool,
) -> NDArray[np.float64]:
    indices = leg.indices[skip_first : len(leg.indices) - skip_last] if len(leg.indices) > 1 else leg.indices[:0]
    if len(indices) > 2:
        steps = np.diff(indices, axis=0)
        turns = (steps[1:] != steps[:-1]).any(axis=1)
        indices = indices[np.concatenate([[True], turns, [True]])]
    points: NDArray[np.float64] = np.vstack([begin, leg.graph.frame.centers_of(indices), end])
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > _SAME_POINT
    points = points[np.concatenate([[True], moved])]
    points[-1] = end
    points.flags.writeable = False
    return points
