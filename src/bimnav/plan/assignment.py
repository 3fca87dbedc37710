"""Which robot serves which stops, and in which order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav import _checks, search
from bimnav.errors import InputError, NoPathError, ValueRangeError
from bimnav.plan._routing import Robots, route
from bimnav.plan.orders import Groups, checked_costs, checked_groups, gap_of, order_stops

__all__ = ["Assignment", "Objective", "assign_stops"]

Objective = Literal["total", "makespan"]

_FEW = 12  # stops; more have too many shares to try them all
_PROVED = 1e-9  # relative; a smaller gap is rounding
_HALVINGS = 8  # of the range of the longest route
_ITERATIONS = 500  # of the search for one length of the longest route


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """Which robot visits which rows of a matrix, in which order.

    Parameters
    ----------
    routes
        For each robot the rows it visits, its start first; a return to it is not listed.
    costs
        What each route costs.
    bound
        No assignment costs less than this: all robots together, or the one that costs most.
    is_optimal
        Whether no assignment costs less: proved, not hoped.
    is_cut_short
        Whether the time limit ended the search before its work was done.
    """

    routes: tuple[tuple[int, ...], ...]
    costs: tuple[float, ...]
    objective: Objective
    bound: float
    is_optimal: bool
    is_cut_short: bool = False

    @property
    def total(self) -> float:
        """What all routes cost together."""
        return math.fsum(self.costs)

    @property
    def makespan(self) -> float:
        """What the route costs that costs most."""
        return max(self.costs)

    @property
    def gap(self) -> float:
        """How much more than the bound the objective is, as a fraction of the bound."""
        return gap_of(getattr(self, self.objective), self.bound)


def assign_stops(
    matrix: ArrayLike | Sequence[ArrayLike],
    starts: Sequence[int],
    *,
    ends: Sequence[int | None] | None = None,
    return_to_start: bool = False,
    groups: ArrayLike | None = None,
    demands: ArrayLike | None = None,
    capacities: ArrayLike | None = None,
    allowed: ArrayLike | None = None,
    objective: Objective = "total",
    time_limit: float | None = None,
) -> Assignment:
    """Share the rows of a matrix out among robots, and order each one's share.

    Up to 12 stops the assignment is proved: dynamic programming over all shares. For more it comes from a
    metaheuristic with a fixed amount of work; equal inputs give equal results unless a time limit is set.

    Parameters
    ----------
    matrix : (n, n) or (robots, n, n) float
        Cost from row to column, at least 0; inf where there is no way. One matrix for all robots, or one each,
        such as seconds at their speeds.
    starts
        The first row of each robot; several may begin in one.
    ends
        The last row of each; None for any.
    return_to_start
        Whether every robot goes back to its start.
    groups : (n,) int
        Rows with the same number are alternatives: one of them is visited. None for every row.
    demands : (n,) float
        What each row takes of a robot's capacity, at least 0; the rows of a group all the same.
    capacities : (robots,) float
        How much each robot can take.
    allowed : (robots, n) bool
        Which rows each robot can serve; None for all.
    objective
        What to make least: `total`, what all robots spend, or `makespan`, what the last one to finish does.
    time_limit
        Seconds after which to stop improving.

    Raises
    ------
    InputError, ValueRangeError
        If shapes do not fit, or a number is out of range.
    NoPathError
        If no assignment was found that serves every row.

    Examples
    --------
    >>> matrix = [[0, 9, 1, 9], [9, 0, 9, 1], [1, 9, 0, 9], [9, 1, 9, 0]]
    >>> assign_stops(matrix, starts=[0, 1]).routes
    ((0, 2), (1, 3))
    """
    if objective not in ("total", "makespan"):
        raise ValueRangeError(f"objective is {objective!r}.", "Give 'total' or 'makespan'.")
    if time_limit is not None:
        _checks.number("time_limit", time_limit, 0)
    robots = _robots(matrix, _checks.many("starts", starts), ends, return_to_start, capacities, allowed)
    n = len(robots.costs[0])
    ways = checked_groups(groups, n, {*robots.starts, *robots.ends})
    needs = None if demands is None else _numbers("demands", demands, (n,))
    if (needs is None) != (robots.capacities is None):
        raise InputError("demands and capacities go together.", "Give both or neither.")
    if needs is not None and any(np.ptp(needs[way]) > 0 for way in ways):
        raise InputError("rows of one group take different amounts.", "Give alternatives the same demand.")
    group = np.repeat(np.arange(len(ways)), [len(way) for way in ways]).astype(np.int64)
    if len(ways) <= _FEW and search.is_small(group):
        routes, is_cut_short = _shared_out(robots, ways, group, needs, objective), False
    else:
        routes, is_cut_short = _searched(robots, ways, needs, objective, time_limit)
    if routes is None:
        raise NoPathError(
            f"no assignment of {len(ways)} stops to {len(robots.starts)} robots was found that serves them all.",
            "Leave out stops that no robot can reach or is allowed to serve, or give the robots more capacity.",
        )
    whole = tuple((start, *rows) for start, rows in zip(robots.starts, routes, strict=True))
    costs = tuple(_cost(robots, k, rows) for k, rows in enumerate(routes))
    reached = sum(costs) if objective == "total" else max(costs)
    bound = reached if len(ways) <= _FEW and search.is_small(group) else _bound(robots, ways, objective)
    is_optimal = bound >= reached * (1 - _PROVED)
    return Assignment(whole, costs, objective, reached if is_optimal else bound, is_optimal, is_cut_short)


def _robots(
    matrix: ArrayLike | Sequence[ArrayLike],
    starts: Sequence[int],
    ends: Sequence[int | None] | None,
    return_to_start: bool,
    capacities: ArrayLike | None,
    allowed: ArrayLike | None,
) -> Robots:
    if not starts:
        raise InputError("there is no robot to assign stops to.", "Give the start of one at least.")
    given = _checks.numbers("matrix", matrix)
    costs = [checked_costs(given)] * len(starts) if given.ndim != 3 else [checked_costs(part) for part in given]
    if len(costs) != len(starts):
        raise InputError(f"there are {len(costs)} matrices for {len(starts)} robots.", "Give one for all, or one each.")
    if ends is not None and return_to_start:
        raise InputError("robots cannot both end elsewhere and return.", "Give ends or return_to_start, not both.")
    given_ends = [None] * len(starts) if ends is None else _checks.many("ends", ends)
    last: list[int | None] = [*starts] if return_to_start else [*given_ends]
    if len(last) != len(starts):
        raise InputError(f"there are {len(last)} ends for {len(starts)} robots.", "Give one each.")
    n = len(costs[0])
    for row in starts:
        _checks.whole("a start", row, 0, n - 1)
    for end in last:
        if end is not None:
            _checks.whole("an end", end, 0, n - 1)
    most = None if capacities is None else _numbers("capacities", capacities, (len(starts),))
    served = None if allowed is None else np.array(allowed, dtype=np.bool_)
    if served is not None and served.shape != (len(starts), n):
        raise InputError(f"allowed has shape {served.shape}.", f"Give {len(starts)} x {n} truths.")
    return Robots(costs, list(starts), last, most, served)


def _numbers(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    numbers = _checks.numbers(name, values)
    if numbers.shape != shape:
        raise InputError(f"{name} has shape {numbers.shape}.", f"Give {shape}.")
    if not (np.isfinite(numbers).all() and (numbers >= 0).all()):
        raise ValueRangeError(f"{name} has a value below 0 or not finite.", "Give finite numbers of at least 0.")
    return numbers


def _trip(robots: Robots, k: int, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the costs over a robot's start and some rows; the start's column leads to the robot's end."""
    along = np.array([robots.starts[k], *rows])
    trip: NDArray[np.float64] = robots.costs[k][np.ix_(along, along)].copy()
    end = robots.ends[k]
    trip[:, 0] = 0.0 if end is None else robots.costs[k][along, end]
    return trip


def _cost(robots: Robots, k: int, rows: Sequence[int]) -> float:
    """Return what a route costs; a robot without stops stays where it is, unless it must end elsewhere."""
    along = [robots.starts[k], *rows]
    end = robots.ends[k]
    return math.fsum(
        robots.costs[k][a, b] for a, b in zip(along, [*along[1:], along[-1] if end is None else end], strict=True)
    )


def _shared_out(
    robots: Robots,
    ways: Groups,
    group: NDArray[np.int64],
    demands: NDArray[np.float64] | None,
    objective: Objective,
) -> list[list[int]] | None:
    """Return the best assignment of a few stops; None if there is none."""
    rows = np.concatenate([*ways, np.zeros(0, dtype=np.intp)]).astype(np.intp)
    stops = len(ways)
    free, never = np.zeros(stops, dtype=np.int64), np.full(stops, np.inf)
    bits = (np.arange(2**stops)[:, None] >> np.arange(stops) & 1).astype(np.float64)
    costs, tables, trips = [], [], []
    for k in range(len(robots.starts)):
        trip = _trip(robots, k, rows)
        if robots.allowed is not None:
            trip[:, 1:][:, ~robots.allowed[k][rows]] = np.inf
        table = search.visit_table(trip, group, free, never)
        least = (table + trip[1:, 0]).min(axis=1, initial=np.inf)
        least[0] = trip[0, 0]
        if demands is not None and robots.capacities is not None:
            load = bits @ np.array([demands[way].max() for way in ways])
            least[load > robots.capacities[k] * (1 + _PROVED)] = np.inf
        costs.append(least)
        tables.append(table)
        trips.append(trip)
    total, share = search.share_out(np.array(costs), objective == "makespan")
    if not np.isfinite(total).all():
        return None
    routes = []
    for trip, table, visited in zip(trips, tables, share.tolist(), strict=True):
        if visited:
            last = int((table[visited] + trip[1:, 0]).argmin()) + 1
            order = search.trace_visits(trip, group, table, visited, last)[1:]
            routes.append(rows[order - 1].tolist())
        else:
            routes.append([])
    return routes


def _searched(
    robots: Robots,
    ways: Groups,
    demands: NDArray[np.float64] | None,
    objective: Objective,
    time_limit: float | None,
) -> tuple[list[list[int]] | None, bool]:
    """Return a good assignment of many stops, and whether time cut the search short."""
    share = time_limit if time_limit is None or objective == "total" else time_limit / (_HALVINGS + 1)
    found = route(robots, ways, demands=demands, time_limit=share)
    if not found.is_feasible:
        return None, found.is_cut_short
    best, is_cut_short = [rows.tolist() for rows in found.routes], found.is_cut_short

    def longest(routes: list[list[int]]) -> float:
        return max(_cost(robots, k, rows) for k, rows in enumerate(routes))

    if objective == "makespan":
        low, high = _bound(robots, ways, objective), longest(best)
        for _ in range(_HALVINGS):
            if high <= low * (1 + _PROVED):
                break
            limit = (low + high) / 2
            found = route(robots, ways, demands=demands, longest=limit, iterations=_ITERATIONS, time_limit=share)
            is_cut_short |= found.is_cut_short
            routes = [rows.tolist() for rows in found.routes]
            if found.is_feasible and longest(routes) < high:
                best, high = routes, longest(routes)
            else:
                low = limit
    return [_reordered(robots, k, rows) for k, rows in enumerate(best)], is_cut_short


def _reordered(robots: Robots, k: int, rows: list[int]) -> list[int]:
    """Return one robot's stops in a better order, if there is one."""
    if len(rows) < 2:
        return rows
    found = order_stops(_trip_with_end(robots, k, rows), end=len(rows) + 1 if robots.ends[k] is not None else None)
    order = [rows[row - 1] for row in found.order[1 : len(rows) + 1]]
    return order if _cost(robots, k, order) < _cost(robots, k, rows) else rows


def _trip_with_end(robots: Robots, k: int, rows: list[int]) -> NDArray[np.float64]:
    end = robots.ends[k]
    along = [robots.starts[k], *rows, *([] if end is None else [end])]
    part: NDArray[np.float64] = robots.costs[k][np.ix_(along, along)]
    return part


def _bound(robots: Robots, ways: Groups, objective: Objective) -> float:
    """Return what no assignment costs less than: every stop is come to from somewhere, and none for less than it costs.

    For the makespan also: the farthest stop, by the robot that reaches it soonest.
    """
    least, farthest = 0.0, 0.0
    for way in ways:
        others = np.setdiff1d(np.arange(len(robots.costs[0])), way)
        least += min(float(cost[np.ix_(others, way)].min()) for cost in robots.costs)
        there = [cost[start, way] for cost, start in zip(robots.costs, robots.starts, strict=True)]
        back = [
            np.zeros(len(way)) if end is None else cost[way, end]
            for cost, end in zip(robots.costs, robots.ends, strict=True)
        ]
        farthest = max(farthest, min(float((a + b).min()) for a, b in zip(there, back, strict=True)))
    return least if objective == "total" else max(farthest, least / len(robots.starts))
