"""In which order to visit the rows of a matrix of costs."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.search.tours import best_order, climb, nearest_first, one_tree_bound

__all__ = ["EXACT", "Ordering", "order_rows"]

EXACT = 15  # stops besides start and end; 13 ms, and twice as much for one more
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
        order = rows[best_order(_round_trip(cost, rows, end, closed))]
        order = order if end is None else np.append(order, end)
        return Ordering(order, _length(cost, order, closed), False)
    finite = np.isfinite(cost)
    cost = np.where(finite, cost, _more_than_any_tour(np.where(finite, cost, 0.0)))
    if np.allclose(cost, cost.T, rtol=_PROVED, atol=0.0):
        return _order_symmetric(cost, start, end, closed, time_limit)
    trip = _round_trip(cost, rows, end, closed)
    order, cut_short = _improve(trip, False, time_limit)
    order = rows[np.roll(order, -int(np.flatnonzero(order == 0)[0]))]
    order = order if end is None else np.append(order, end)
    return Ordering(order, _directed_bound(trip), cut_short)


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


def _order_symmetric(
    cost: NDArray[np.float64], start: int, end: int | None, closed: bool, time_limit: float | None
) -> Ordering:
    if closed:
        order, cut_short = _improve(cost, True, time_limit)
        order = np.roll(order, -int(np.flatnonzero(order == start)[0]))
        return Ordering(order, one_tree_bound(cost, _rounds(cost)), cut_short)
    last = len(cost) if end is None else end
    if end is None:
        cost = np.pad(cost, (0, 1))  # a row that costs nothing to go to, after the real last one
    bribe = _more_than_any_tour(cost)  # for a round trip that goes from its last row straight to the start
    cost[start, last] = cost[last, start] = -bribe
    order, cut_short = _improve(cost, True, time_limit)
    order = np.roll(order, -int(np.flatnonzero(order == start)[0]))
    if order[1] == last:
        order = np.roll(order[::-1], 1)
    cost = np.roll(cost, -last, axis=(0, 1))  # the bound is tighter when row 0 is the one with the bribe
    bound = one_tree_bound(cost, _rounds(cost)) + bribe
    return Ordering(order[:-1] if end is None else order, bound, cut_short)


def _improve(cost: NDArray[np.float64], is_symmetric: bool, time_limit: float | None) -> tuple[NDArray[np.intp], bool]:
    begun, count = time.monotonic(), len(cost)
    others = cost.copy()
    np.fill_diagonal(others, np.inf)
    near = np.argsort(others, axis=1, kind="stable")[:, :_NEIGHBORS].astype(np.int32)
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
