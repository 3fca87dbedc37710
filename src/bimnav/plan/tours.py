"""The order of stops, and the tour over them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan.orders import gap_of, order_stops
from bimnav.plan.paths import Algorithm, Path, distance_matrix, find_path, free_index
from bimnav.stops import Stop, Unreached

__all__ = ["Tour", "plan_tour"]

_SAME_POINT = 1e-9  # metres


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
        return gap_of(self.cost, self.lower_bound)

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
