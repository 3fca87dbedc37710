# mypy: disable-error-code="assignment, no-any-return, operator, return-value"
"""Orders proved shortest by dynamic programming over sets of stops, for a few stops.

A stop is a group of rows, its alternatives: one of them is visited. Row 0 is where all orders begin, and
its column leads to where they end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import kernel

__all__ = ["share_out", "trace_visits", "visit_table"]


@kernel
def visit_table(
    cost: NDArray[np.float64], group: NDArray[np.int64], before: NDArray[np.int64], due: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the least cost of beginning at row 0, visiting a set of groups, and ending on one of their rows.

    Held and Karp, A dynamic programming approach to sequencing problems, 1962, with alternatives.

    Parameters
    ----------
    cost : (m + 1, m + 1)
        From row to column.
    group : (m,)
        Group of rows 1 to m.
    before : (groups,)
        Which groups must be visited before each: bit g stands for group g.
    due : (groups,)
        The most that it may have cost when a group has been visited; inf for any.

    Returns
    -------
    best : (2 ** groups, m) float64
        By the bits of the groups visited, and the last row, minus one; inf where there is no way.
    """
    rows, groups = len(group), len(due)
    best = np.empty((1 << groups, rows))
    best[:] = np.inf
    for k in range(rows):
        if before[group[k]] == 0 and cost[0, k + 1] <= due[group[k]]:
            best[1 << group[k], k] = cost[0, k + 1]
    for visited in range(1, 1 << groups):
        for k in range(rows):
            so_far = best[visited, k]
            if so_far == np.inf:
                continue
            for other in range(rows):
                g = group[other]
                if visited >> g & 1 or before[g] & ~visited:
                    continue
                total = so_far + cost[k + 1, other + 1]
                if total < best[visited | 1 << g, other] and total <= due[g]:
                    best[visited | 1 << g, other] = total
    return best


@kernel
def trace_visits(
    cost: NDArray[np.float64], group: NDArray[np.int64], best: NDArray[np.float64], visited: int, last: int
) -> NDArray[np.int64]:
    """Return the rows of a cheapest order that visits a set of groups and ends on a row; ties go to low rows."""
    count = 0
    for g in range(64):
        count += visited >> g & 1
    order = np.zeros(count + 1, dtype=np.int64)
    for place in range(count, 0, -1):
        order[place] = last
        visited ^= 1 << group[last - 1]
        chosen, least = 0, np.inf
        for k in range(len(group)):
            total = best[visited, k] + cost[k + 1, last]
            if total < least:
                chosen, least = k + 1, total
        last = chosen
    return order


@kernel
def share_out(cost: NDArray[np.float64], by_largest: bool) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Share a set out among robots, so that the sum of their costs is least, or the largest of them.

    Of shares with the same largest cost the one with the least sum is taken, of those the lowest.

    Parameters
    ----------
    cost : (robots, 2 ** n)
        What each robot pays for every subset, by its bits.

    Returns
    -------
    least : (2,)
        The largest cost, and the sum.
    share : (robots,)
        The subset of each.
    """
    robots, sets = cost.shape
    most, total = cost[0].copy(), cost[0].copy()
    taken = np.zeros((robots, sets), dtype=np.int64)
    for robot in range(1, robots):
        new_most, new_total = np.empty(sets), np.empty(sets)
        for whole in range(sets):
            own = whole
            first, second = np.inf, np.inf
            while True:  # all subsets of the whole, from the largest to the empty one
                rest = whole ^ own
                a = max(most[rest], cost[robot, own])
                b = total[rest] + cost[robot, own]
                if not by_largest:
                    a = 0.0 if b < np.inf else np.inf
                if a < first or (a == first and b <= second):
                    first, second = a, b
                    taken[robot, whole] = own
                    new_most[whole], new_total[whole] = max(most[rest], cost[robot, own]), b
                if own == 0:
                    break
                own = (own - 1) & whole
        most, total = new_most, new_total
    share = np.zeros(robots, dtype=np.int64)
    left = sets - 1
    for robot in range(robots - 1, 0, -1):
        share[robot] = taken[robot, left]
        left ^= share[robot]
    share[0] = left
    return np.array([most[sets - 1], total[sets - 1]]), share
