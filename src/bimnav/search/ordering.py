"""In which order to visit the rows of a matrix of costs, or one row of every group."""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.search.exact import trace_visits, visit_table
from bimnav.search.tours import climb, nearest_first, one_tree_bound

__all__ = ["EXACT", "Ordering", "is_small", "order_few", "order_groups", "order_rows"]

EXACT = 15  # stops besides start and end; 13 ms, and twice as much for one more
_EXACT_WORK = 300_000_000  # of stops with alternatives; half a second
_ROUNDS_OF_CHOICE = (200, 600)  # in which some stops take other alternatives: for many stops, for few
_WORK_OF_CHOICE = 20_000  # rounds times stops
_KICKS_OF_CHOICE = 30  # in each of them
_KICKS = 100  # per row; three times as many gained nothing on TSPLIB up to 200 rows
_CHUNK = 2000  # kicks between two looks at the clock
_NEIGHBORS = 10
_ROUNDS = 1000  # of a lower bound, fewer if the matrix is large
_ROUND_WORK = 300_000_000
_SEED = 88172645463325252  # the one of Marsaglia 2003
_PROVED = 1e-9  # relative


class Ordering(NamedTuple):
    """An order of all rows, a lower bound on any order's length, and whether time cut the search short."""

    order: NDArray[np.intp]
    bound: float
    is_cut_short: bool


def order_rows(
    cost: NDArray[np.float64], start: int, end: int | None, closed: bool, time_limit: float | None
) -> Ordering:
    """Find a cheap order of all rows of a square matrix, from `start`.

    Parameters
    ----------
    cost : (n, n) float64
        From row to column, at least 0; inf where there is no way.
    end
        The last row, another than `start`; None for any.
    closed
        Whether the way back to `start` counts; then without `end`.
    time_limit
        Seconds after which to stop improving; None for no limit but the amount of work.
    """
    fixed = [start] if end is None else [start, end]
    rows = np.array([start, *(k for k in range(len(cost)) if k not in fixed)])
    if len(rows) - 1 <= EXACT:
        order = rows[order_few(_round_trip(cost, rows, end, closed), np.arange(len(rows) - 1))]
        order = order if end is None else np.append(order, end)
        return Ordering(order, _length(cost, order, closed), False)
    trip = _as_round_trip(cost, rows, end, closed)
    order, is_cut_short = _improve(trip.cost, trip.is_symmetric, time_limit)
    return Ordering(trip.order_of(order), trip.bound(), is_cut_short)


def is_small(group: NDArray[np.int64]) -> bool:
    """Tell whether an order of so many stops with so many alternatives can be proved."""
    stops = int(group.max(initial=-1)) + 1
    return stops <= EXACT and 2**stops * len(group) ** 2 <= _EXACT_WORK


def order_few(
    trip: NDArray[np.float64],
    group: NDArray[np.int64],
    *,
    before: NDArray[np.int64] | None = None,
    due: NDArray[np.float64] | None = None,
    weight: NDArray[np.float64] | None = None,
) -> NDArray[np.int64]:
    """Return the rows of a cheapest round trip from row 0 over one row of every group, proved.

    If the dues cannot all be kept, the groups of the greatest total weight that can are visited.

    Parameters
    ----------
    trip : (m + 1, m + 1)
        From row to column.
    group : (m,)
        Group of rows 1 to m.
    before, due : (groups,)
        As in `visit_table`.
    weight : (groups,)
        What visiting each is worth; 1 if not given.
    """
    stops = int(group.max(initial=-1)) + 1
    if not stops:
        return np.zeros(1, dtype=np.int64)
    before = np.zeros(stops, dtype=np.int64) if before is None else before
    due = np.full(stops, np.inf) if due is None else due
    best = visit_table(trip, group, before, due)
    total = best + trip[1:, 0]
    visited = 2**stops - 1
    if not np.isfinite(total[visited]).any():
        if np.isinf(due).all():  # there is no way; any order that may be says so by its length
            rising = np.argsort(before, kind="stable")  # of what goes before, one set holds the other
            return np.array([0, *(np.flatnonzero(group == g)[0] + 1 for g in rising)])
        bits = np.arange(2**stops)[:, None] >> np.arange(stops) & 1
        worth = bits @ (np.ones(stops) if weight is None else weight)
        least = total.min(axis=1)
        least[0] = trip[0, 0]
        worth[~np.isfinite(least)] = -np.inf
        visited = int(np.lexsort((least, -worth))[0])
    if visited == 0:
        return np.zeros(1, dtype=np.int64)
    order: NDArray[np.int64] = trace_visits(trip, group, best, visited, int(total[visited].argmin()) + 1)
    return order


def order_groups(
    cost: NDArray[np.float64],
    groups: list[NDArray[np.intp]],
    start: int,
    end: int | None,
    closed: bool,
    time_limit: float | None,
) -> Ordering:
    """Find a cheap order that visits one row of every group, from `start`.

    Many stops are ordered with one alternative of each; then the best alternatives for that order are
    found by dynamic programming, and so on until nothing changes. Rounds follow in which some neighboring
    stops take other alternatives first.

    Parameters
    ----------
    cost : (n, n) float64
        From row to column, at least 0; inf where there is no way.
    groups
        Rows of every group; start and end lie in none.
    end, closed, time_limit
        As in `order_rows`.
    """
    if all(len(group) == 1 for group in groups):
        only = np.array([start, *(row for group in groups for row in group), *([] if end is None else [end])])
        found = order_rows(cost[np.ix_(only, only)], 0, None if end is None else len(only) - 1, closed, time_limit)
        return found._replace(order=only[found.order])
    tail = [] if end is None else [end]
    rows = np.array([start, *(row for group in groups for row in group)])
    group = np.repeat(np.arange(len(groups)), [len(rows) for rows in groups])
    if is_small(group):
        order = rows[order_few(_round_trip(cost, rows, end, closed), group)]
        order = np.append(order, np.array(tail, dtype=order.dtype))
        return Ordering(order, _length(cost, order, closed), False)
    begun = time.monotonic()
    trip = _as_round_trip(cost, rows, end, closed)
    ends = len(trip.rows) - len(rows)  # rows behind the stops that have no alternative
    ways = np.split(np.arange(len(trip.rows)), np.cumsum([1, *(len(group) for group in groups), ends])[:-1])
    ways = [way for way in ways if len(way)]
    nearest = np.array([[trip.cost[np.ix_(a, b)].min() for b in ways] for a in ways])
    chosen = np.array([way[_without(trip.cost[way], way).min(axis=1).argmin()] for way in ways])
    state, rng = np.array([_SEED], dtype=np.uint64), np.random.default_rng(_SEED)
    order = nearest_first(trip.cost[np.ix_(chosen, chosen)])

    def settled(
        chosen: NDArray[np.intp], order: NDArray[np.int32], kicks: int
    ) -> tuple[float, NDArray[np.intp], NDArray[np.int32]]:
        best = np.inf
        while True:
            _climb(trip.cost[np.ix_(chosen, chosen)], trip.is_symmetric, order, state, kicks)
            order = np.roll(order, -int(np.flatnonzero(order == 0)[0]))
            total, picked = _best_ways(trip.cost, [ways[k] for k in order])
            if not total < best - _PROVED * abs(total):
                return best, chosen, order
            best = total
            chosen = picked[np.argsort(order)]

    best, chosen, order = settled(chosen, order, _KICKS * len(ways))
    width, is_cut_short = max(3, len(groups) // 10), False
    for _ in range(int(np.clip(_WORK_OF_CHOICE // len(ways), *_ROUNDS_OF_CHOICE))):
        if time_limit is not None and time.monotonic() - begun >= time_limit:
            is_cut_short = True
            break
        other = chosen.copy()
        for k in np.roll(order, -int(rng.integers(len(order))))[:width].tolist():
            other[k] = rng.choice(ways[k])
        changed = settled(other, order.copy(), _KICKS_OF_CHOICE)
        if changed[0] < best:
            best, chosen, order = changed
    return Ordering(trip.order_of(chosen[order]), trip._replace(cost=nearest).bound(), is_cut_short)


class _RoundTrip(NamedTuple):
    """Costs whose round trips cost what the orders asked for cost, but for a constant.

    Parameters
    ----------
    cost
        Finite; node 0 is the start.
    rows
        The row of every node; -1 for one that stands for any end.
    is_symmetric
        Whether both directions cost the same.
    bribe
        What it costs less to go from the last node straight to the start, where an end is not the start.
    tail
        A row to add in the end.
    """

    cost: NDArray[np.float64]
    rows: NDArray[np.intp]
    is_symmetric: bool
    bribe: float
    tail: list[int]

    def order_of(self, nodes: NDArray[np.integer[Any]]) -> NDArray[np.intp]:
        """Return the rows in the order of a round trip."""
        nodes = np.roll(nodes, -int(np.flatnonzero(nodes == 0)[0]))
        if self.bribe and nodes[1] == len(self.rows) - 1:
            nodes = np.roll(nodes[::-1], 1)
        rows = self.rows[nodes]
        return np.append(rows[rows >= 0], np.array(self.tail, dtype=rows.dtype))

    def bound(self) -> float:
        """Return what no order costs less than."""
        if self.is_symmetric:  # the bound is tighter when row 0 is one with the bribe
            return float(one_tree_bound(np.roll(self.cost, 1, axis=(0, 1)), _rounds(self.cost))) + self.bribe
        return _directed_bound(self.cost)


def _as_round_trip(cost: NDArray[np.float64], rows: NDArray[np.intp], end: int | None, closed: bool) -> _RoundTrip:
    """Return the round trip over `rows`, the start first, that stands for an order of them that ends at `end`."""
    tail = [] if end is None else [end]
    finite = np.isfinite(cost)
    cost = np.where(finite, cost, _more_than_any_tour(np.where(finite, cost, 0.0)))
    part = cost[np.ix_([*rows, *tail], [*rows, *tail])]
    if not np.allclose(part, part.T, rtol=_PROVED, atol=0.0):
        return _RoundTrip(_round_trip(cost, rows, end, closed), rows, False, 0.0, tail)
    if closed:
        return _RoundTrip(part, rows, True, 0.0, [])
    if end is None:
        part = np.pad(part, (0, 1))  # a row that costs nothing to go to, after the real last one
    bribe = _more_than_any_tour(part)
    part[0, -1] = part[-1, 0] = -bribe
    return _RoundTrip(part, np.append(rows, -1 if end is None else end), True, bribe, [])


def _round_trip(
    cost: NDArray[np.float64], rows: NDArray[np.intp], end: int | None, closed: bool
) -> NDArray[np.float64]:
    """Return costs whose round trips over `rows` cost what the tours asked for cost."""
    trip = cost[np.ix_(rows, rows)].copy()
    if end is not None:
        trip[:, 0] = cost[rows, end]  # the start's row leads away from it, its column to the end
    elif not closed:
        trip[:, 0] = 0.0
    return trip


def _without(cost: NDArray[np.float64], columns: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return costs with some columns out of reach."""
    others = cost.copy()
    others[:, columns] = np.inf
    return others


def _best_ways(cost: NDArray[np.float64], ways: list[NDArray[np.intp]]) -> tuple[float, NDArray[np.intp]]:
    """Return the cheapest round trip over one node of every group, in a fixed order that begins with one node."""
    total, back = np.zeros(1), []
    for before, way in pairwise(ways):
        steps = total[:, None] + cost[np.ix_(before, way)]
        back.append(steps.argmin(axis=0))
        total = steps.min(axis=0)
    total = total + cost[ways[-1], ways[0][0]]
    chosen = [int(total.argmin())]
    for step in reversed(back):
        chosen.append(int(step[chosen[-1]]))
    return float(total.min()), np.array([way[k] for way, k in zip(ways, reversed(chosen), strict=True)])


def _climb(
    cost: NDArray[np.float64],
    is_symmetric: bool,
    order: NDArray[np.int32],
    state: NDArray[np.uint64],
    kicks: int,
) -> None:
    near = np.argsort(_others(cost), axis=1, kind="stable")[:, :_NEIGHBORS].astype(np.int32)
    climb(cost, near, is_symmetric, order, state, kicks)


def _others(cost: NDArray[np.float64]) -> NDArray[np.float64]:
    others = cost.copy()
    np.fill_diagonal(others, np.inf)
    return others


def _improve(cost: NDArray[np.float64], is_symmetric: bool, time_limit: float | None) -> tuple[NDArray[np.intp], bool]:
    begun, count = time.monotonic(), len(cost)
    near = np.argsort(_others(cost), axis=1, kind="stable")[:, :_NEIGHBORS].astype(np.int32)
    state = np.array([_SEED], dtype=np.uint64)
    order = nearest_first(cost)
    climb(cost, near, is_symmetric, order, state, 0)
    for left in range(_KICKS * count, 0, -_CHUNK):
        if time_limit is not None and time.monotonic() - begun >= time_limit:
            return order.astype(np.intp), True
        climb(cost, near, is_symmetric, order, state, min(left, _CHUNK))
    return order.astype(np.intp), False


def _directed_bound(cost: NDArray[np.float64]) -> float:
    """Return the better of two bounds: cheapest successors, each used once; the trip if ways back cost the same."""
    from scipy.optimize import linear_sum_assignment

    others = cost.copy()
    np.fill_diagonal(others, 4 * cost.sum() + 1)
    assigned = float(others[linear_sum_assignment(others)].sum())
    return max(assigned, float(one_tree_bound(np.minimum(cost, cost.T), _rounds(cost))))


def _more_than_any_tour(cost: NDArray[np.float64]) -> float:
    return 2 * cost.size**0.5 * float(cost.max(initial=0.0)) or 1.0


def _rounds(cost: NDArray[np.float64]) -> int:
    return int(np.clip(_ROUND_WORK // cost.size, 50, _ROUNDS))


def _length(cost: NDArray[np.float64], order: NDArray[np.intp], closed: bool) -> float:
    total = float(cost[order[:-1], order[1:]].sum())
    return total + float(cost[order[-1], order[0]]) if closed else total
