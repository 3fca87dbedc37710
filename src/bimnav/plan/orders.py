"""In which order to visit the rows of a matrix."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav import _checks, search
from bimnav.errors import InputError, NoPathError, ValueRangeError

__all__ = ["StopOrder", "checked_costs", "checked_groups", "gap_of", "order_stops"]

_PROVED = 1e-9  # relative; a smaller gap is rounding
_PASSES = 5  # over the priorities of many stops

Groups: TypeAlias = list[NDArray[np.intp]]


@dataclass(frozen=True, slots=True, eq=False)
class StopOrder:
    """In which order to visit the rows of a matrix.

    Parameters
    ----------
    order
        Row numbers, the start first; a return to it is not listed.
    length
        Sum of the matrix along the order, with the way back if there is one, and of the service.
    bound
        No order is shorter than this.
    is_optimal
        Whether no order is shorter: proved, not hoped.
    is_cut_short
        Whether the time limit ended the search before its work was done.
    left_out
        For each stop that could not be done by when it is due, one of its rows.
    """

    order: tuple[int, ...]
    length: float
    bound: float
    is_optimal: bool
    is_cut_short: bool = False
    left_out: tuple[int, ...] = ()

    @property
    def gap(self) -> float:
        """How much longer than the bound, as a fraction of it."""
        return gap_of(self.length, self.bound)


def order_stops(
    matrix: ArrayLike,
    start: int = 0,
    *,
    end: int | None = None,
    return_to_start: bool = False,
    groups: ArrayLike | None = None,
    priority: ArrayLike | None = None,
    due: ArrayLike | None = None,
    service: ArrayLike | None = None,
    time_limit: float | None = None,
) -> StopOrder:
    """Find a short order in which to visit all rows of a matrix, or one row of every group.

    Up to 15 stops besides start and end the order is a shortest one, proved. For more it is a good one:
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
    groups : (n,) int
        Rows with the same number are alternatives: one of them is visited. None for every row.
    priority : (n,) float
        Rows with a higher one are all visited before those with a lower one. Where stops are due, it says
        which to keep if not all can be.
    due : (n,) float
        The most that may have been spent, on the way and in service, when a row has been served; inf for any,
        as for the end.
    service : (n,) float
        What is spent at a row, at least 0.
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
    >>> order_stops([[0, 9, 1], [9, 0, 2], [1, 2, 0]], groups=[0, 1, 1]).order
    (0, 2)
    """
    cost = checked_costs(matrix)
    n = len(cost)
    start = _checks.whole("start", start, 0, n - 1)
    end = None if end is None else _checks.whole("end", end, 0, n - 1)
    if time_limit is not None:
        _checks.number("time_limit", time_limit, 0)
    if end is not None and return_to_start and end != start:
        raise InputError("a tour cannot both end elsewhere and return.", "Give end or return_to_start, not both.")
    if end == start:
        end, return_to_start = None, True
    ways = checked_groups(groups, n, {start, end})
    spent = _row_values("service", service, n, 0.0)
    latest = _row_values("due", due, n, math.inf)
    ranks = np.array([_row_values("priority", priority, n, 0.0)[way].max() for way in ways])
    spent[start] = 0.0
    cost = cost + spent  # paid on the way in
    np.fill_diagonal(cost, 0.0)
    latest[start] = math.inf
    if end is not None and math.isfinite(latest[end]):
        raise InputError(f"the end, row {end}, is due.", "Give dues to stops; a tour ends when it ends.")
    if np.isfinite(latest).any():
        found = _order_by_due(cost, ways, start, end, return_to_start, latest, ranks, time_limit)
    elif len(set(ranks.tolist())) > 1:
        found = _order_by_priority(cost, ways, start, end, return_to_start, ranks, time_limit)
    elif all(len(way) == 1 for way in ways):
        found = search.order_rows(cost, start, end, return_to_start, time_limit)
    else:
        found = search.order_groups(cost, ways, start, end, return_to_start, time_limit)
    length = _length(cost, found.order, return_to_start)
    if not math.isfinite(length):
        raise NoPathError(
            f"no order of the {n} rows has a finite length.",
            "Leave out the rows that cannot be reached, or cannot be left.",
        )
    is_optimal = found.bound >= length * (1 - _PROVED)
    bound = length if is_optimal else max(found.bound, 0.0)
    done = set(found.order.tolist())
    left_out = tuple(int(way[0]) for way in ways if done.isdisjoint(way.tolist()))
    return StopOrder(tuple(found.order.tolist()), length, bound, is_optimal, found.is_cut_short, left_out)


def gap_of(length: float, bound: float) -> float:
    """Return how much longer than a bound, as a fraction of it."""
    if length <= bound:
        return 0.0
    return length / bound - 1 if bound > 0 else math.inf


def checked_costs(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return a private copy of costs between rows, with nothing to pay for staying."""
    cost = _checks.numbers("matrix", matrix)
    if cost.ndim != 2 or cost.shape[0] != cost.shape[1] or not cost.size:
        raise InputError(f"a matrix of shape {cost.shape} orders nothing.", "Give (n, n) costs, at least one row.")
    if np.isnan(cost).any() or (cost < 0).any():
        raise ValueRangeError("the matrix has costs below 0 or not a number.", "Give costs of at least 0, or inf.")
    np.fill_diagonal(cost, 0.0)
    return cost


def checked_groups(groups: ArrayLike | None, n: int, ends: set[int | None]) -> Groups:
    """Return the rows of every group in order of their first row, without starts and ends."""
    number = np.arange(n) if groups is None else np.asarray(groups)
    if number.shape != (n,):
        raise InputError(f"groups has shape {number.shape}, the matrix {n} rows.", "Give one number for each row.")
    found: dict[int, list[int]] = {}
    for row, group in enumerate(number.tolist()):
        if row not in ends:
            found.setdefault(group, []).append(row)
    return [np.array(rows, dtype=np.intp) for rows in found.values()]


def _row_values(name: str, values: ArrayLike | None, n: int, default: float) -> NDArray[np.float64]:
    if values is None:
        return np.full(n, default)
    given = _checks.numbers(name, values)
    if given.shape != (n,):
        raise InputError(f"{name} has shape {given.shape}, the matrix {n} rows.", "Give one number for each row.")
    if np.isnan(given).any() or (name != "priority" and (given < 0).any()):
        raise ValueRangeError(f"{name} has a value below 0 or not a number.", "Give numbers of at least 0.")
    return given


def _length(cost: NDArray[np.float64], order: NDArray[np.intp], closed: bool) -> float:
    along = [*order, order[0]] if closed else order
    return math.fsum(cost[along[:-1], along[1:]])


def _few(
    cost: NDArray[np.float64],
    ways: Groups,
    start: int,
    end: int | None,
    closed: bool,
    *,
    before: NDArray[np.int64] | None = None,
    due: NDArray[np.float64] | None = None,
    weight: NDArray[np.float64] | None = None,
) -> search.Ordering:
    """Return a proved order under conditions; see `search.order_few`."""
    rows = np.array([start, *(row for way in ways for row in way)])
    group = _group_of_rows(ways)
    trip = cost[np.ix_(rows, rows)].copy()
    trip[:, 0] = cost[rows, start] if closed else 0.0 if end is None else cost[rows, end]
    order = rows[search.order_few(trip, group, before=before, due=due, weight=weight)]
    order = np.append(order, np.array([] if end is None else [end], dtype=order.dtype))
    return search.Ordering(order, _length(cost, order, closed), False)


def _group_of_rows(ways: Groups) -> NDArray[np.int64]:
    return np.repeat(np.arange(len(ways)), [len(way) for way in ways]).astype(np.int64)


def _order_by_due(
    cost: NDArray[np.float64],
    ways: Groups,
    start: int,
    end: int | None,
    closed: bool,
    due: NDArray[np.float64],
    ranks: NDArray[np.float64],
    time_limit: float | None,
) -> search.Ordering:
    """Keep what is due; of what cannot all be kept, the stops of higher priority, then the most stops."""
    weight = _worth(ranks)
    latest = np.array([due[way].max() for way in ways])
    if search.is_small(_group_of_rows(ways)):
        return _few(cost, ways, start, end, closed, due=latest, weight=weight)
    from bimnav.plan._routing import Robots, route

    robots = Robots([cost], [start], [start if closed else end])
    found = route(robots, ways, due=latest, weight=weight, time_limit=time_limit)
    order = np.array([start, *found.routes[0], *([] if end is None else [end])])
    return search.Ordering(order, 0.0, found.is_cut_short)


def _worth(ranks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weights such that one stop is worth more than all stops of lower priority together."""
    weight, total = np.ones(len(ranks)), 0.0
    for rank in sorted(set(ranks.tolist())):
        weight[ranks == rank] = total + 1
        total += float(weight[ranks == rank].sum())
    return weight


def _order_by_priority(
    cost: NDArray[np.float64],
    ways: Groups,
    start: int,
    end: int | None,
    closed: bool,
    ranks: NDArray[np.float64],
    time_limit: float | None,
) -> search.Ordering:
    """Visit all stops of a priority before those of a lower one.

    Many stops are ordered priority by priority, each from where the one before ends to where the next begins,
    until nothing changes.
    """
    levels = [np.flatnonzero(ranks == rank).tolist() for rank in sorted(set(ranks.tolist()), reverse=True)]
    if search.is_small(_group_of_rows(ways)):
        before = np.zeros(len(ways), dtype=np.int64)
        done = 0
        for level in levels:
            before[level] = done
            done |= sum(1 << group for group in level)
        return _few(cost, ways, start, end, closed, before=before)
    final = start if closed else end
    bound = search.order_groups(cost, ways, start, end, closed, 0.0).bound
    parts: list[NDArray[np.intp]] = []
    is_cut_short = False

    def ordered(k: int, goal: int | None) -> NDArray[np.intp]:
        nonlocal is_cut_short
        here = int(parts[k - 1][-1]) if k else start
        closes = goal is not None and goal == here
        part = search.order_groups(
            cost, [ways[g] for g in levels[k]], here, None if closes else goal, closes, time_limit
        )
        is_cut_short |= part.is_cut_short
        return part.order[1 : len(part.order) - (goal is not None and not closes)]

    for k in range(len(levels)):  # each begins where the one before ends
        parts += [ordered(k, final if k == len(levels) - 1 else None)]

    def whole() -> NDArray[np.intp]:
        return np.concatenate([[start], *parts, [] if end is None else [end]]).astype(np.intp)

    best = _length(cost, whole(), closed)
    for _ in range(_PASSES):
        for k in range(len(levels)):
            kept = parts[k]
            parts[k] = ordered(k, int(parts[k + 1][0]) if k + 1 < len(levels) else final)
            length = _length(cost, whole(), closed)
            if length >= best:
                parts[k] = kept
            best = min(best, length)
    return search.Ordering(whole(), bound, is_cut_short)
