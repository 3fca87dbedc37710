# mypy: disable-error-code="assignment, no-any-return, operator, return-value"
"""Round trips: improved from a good beginning, and bounds from below.

A tour is an order of the rows of a square matrix of costs, and returns to its first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import kernel, lean

__all__ = ["climb", "nearest_first", "one_tree_bound"]

_GAIN = 1e-9  # relative; a smaller gain is rounding
_STRETCH = 50  # rows; a kick swaps two neighboring stretches of at most this length


@kernel
def nearest_first(cost: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the order that always goes to the nearest row left, from row 0."""
    order = np.zeros(len(cost), dtype=np.int32)
    visited = np.zeros(len(cost), dtype=np.bool_)
    visited[0] = True
    for place in range(1, len(cost)):
        chosen = -1
        for k in range(len(cost)):
            if not visited[k] and (chosen < 0 or cost[order[place - 1], k] < cost[order[place - 1], chosen]):
                chosen = k
        order[place] = chosen
        visited[chosen] = True
    return order


@lean
def _flip(order: NDArray[np.int32], place: NDArray[np.int32], first: int, count: int) -> None:
    """Turn around the stretch of so many rows that begins at a place."""
    n = len(order)
    first %= n
    last = (first + count - 1) % n
    for _ in range(count // 2):
        a, b = order[first], order[last]
        order[first], order[last] = b, a
        place[b], place[a] = first, last
        first = first + 1 if first + 1 < n else 0
        last = last - 1 if last > 0 else n - 1


@lean
def _random(state: NDArray[np.uint64], below: int) -> int:
    """Return a number from 0; xorshift64* (Vigna 2016)."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return np.int64((x * np.uint64(2685821657736338717)) >> np.uint64(33)) % below


@lean
def _move_stretch(
    order: NDArray[np.int32], place: NDArray[np.int32], low: int, count: int, gap: int, turned: bool
) -> None:
    """Move `count` rows from place `low` in between the places `gap` and `gap + 1`, turned around or not."""
    n = len(order)
    ahead, behind = (gap - low - count + 1) % n, (low - 1 - gap) % n
    if ahead <= behind:
        _flip(order, place, low, count + ahead)
        _flip(order, place, low, ahead)
        moved = low + ahead
    else:
        moved = gap + 1
        _flip(order, place, moved, behind + count)
        _flip(order, place, moved + count, behind)
    if not turned:
        _flip(order, place, moved, count)


@lean
def _swap_stretches(
    order: NDArray[np.int32],
    place: NDArray[np.int32],
    spare: NDArray[np.int32],
    first: int,
    count: int,
    next_count: int,
) -> None:
    """Swap two stretches that follow each other, the first of which begins at a place."""
    n = len(order)
    for k in range(count + next_count):
        spare[k] = order[(first + k) % n]
    for k in range(count + next_count):
        at = (first + k) % n
        row = spare[k + count if k < next_count else k - next_count]
        order[at] = row
        place[row] = at


@lean
def _improve(
    cost: NDArray[np.float64],
    near: NDArray[np.int32],
    order: NDArray[np.int32],
    place: NDArray[np.int32],
    ends: NDArray[np.int32],
    a: int,
    least: float,
) -> float:
    """Apply one move, good for a symmetric matrix, that joins `a` to one of its neighbors; return the gain.

    `ends` receives the rows whose edges changed.
    """
    n = len(order)
    for step in (1, -1):
        b = order[(place[a] + step) % n]
        for c in near[a]:
            saved = cost[a, b] - cost[a, c]
            if saved <= least:
                break
            e = order[(place[c] + step) % n]
            gain = saved + cost[c, e] - cost[b, e]
            if gain > least:  # 2-opt: a-b and c-e become a-c and b-e
                first = place[b] if step > 0 else place[c]
                last = place[c] if step > 0 else place[b]
                count = (last - first) % n + 1
                if 2 * count > n:  # turn around the rest instead
                    first, count = last + 1, n - count
                _flip(order, place, first, count)
                ends[0], ends[1], ends[2], ends[3], ends[4], ends[5] = a, b, c, e, a, b
                return gain
            # Or-opt: a and up to two rows behind it go in between c and one of its neighbors
            x = a
            for count in range(1, 4):
                if x == c:
                    break
                p = order[(place[x] - step) % n]
                loose = saved + cost[x, p] - cost[p, b]
                for side in (1, -1):
                    e = order[(place[c] + side) % n]
                    if (place[a] - place[e]) * step % n < count:
                        continue  # it is one of those that move
                    gain = loose + cost[c, e] - cost[x, e]
                    if gain > least:
                        low = place[x] if step > 0 else place[a]
                        gap = place[c] if side > 0 else place[e]
                        _move_stretch(order, place, low, count, gap, step == side)
                        ends[0], ends[1], ends[2], ends[3], ends[4], ends[5] = a, b, c, e, x, p
                        return gain
                x = p
    return 0.0


@lean
def _improve_directed(
    cost: NDArray[np.float64],
    near: NDArray[np.int32],
    order: NDArray[np.int32],
    place: NDArray[np.int32],
    spare: NDArray[np.int32],
    ends: NDArray[np.int32],
    a: int,
    least: float,
) -> float:
    """Apply one move that sends `a` to one of its neighbors and turns nothing around; return the gain.

    The move swaps two stretches: a-b, c-d, e-f become a-d, e-b, c-f.
    """
    n = len(order)
    first = (place[a] + 1) % n
    b = order[first]
    for d in near[a]:
        saved = cost[a, b] - cost[a, d]
        if saved <= least:
            break
        count = (place[d] - first) % n
        c = order[(place[d] - 1) % n]
        for f in near[c]:
            more = saved + cost[c, d] - cost[c, f]
            if more <= least:
                break
            next_count = (place[f] - place[d]) % n
            if next_count == 0 or count + next_count >= n:
                continue  # f lies in the first stretch: the tour would fall apart
            e = order[(place[f] - 1) % n]
            gain = more + cost[e, f] - cost[e, b]
            if gain > least:
                _swap_stretches(order, place, spare, first, count, next_count)
                ends[0], ends[1], ends[2], ends[3], ends[4], ends[5] = a, b, c, d, e, f
                return gain
    return 0.0


@lean
def _descend(
    cost: NDArray[np.float64],
    near: NDArray[np.int32],
    is_symmetric: bool,
    order: NDArray[np.int32],
    place: NDArray[np.int32],
    spare: NDArray[np.int32],
    waiting: NDArray[np.int32],
    is_waiting: NDArray[np.bool_],
    ends: NDArray[np.int32],
    count: int,
    least: float,
) -> float:
    """Improve around the first `count` waiting rows until nothing helps; return what was gained."""
    n = len(order)
    head, total = 0, 0.0
    while count:
        a = waiting[head]
        head = head + 1 if head + 1 < n else 0
        count -= 1
        is_waiting[a] = False
        while True:
            if is_symmetric:
                gain = _improve(cost, near, order, place, ends, a, least)
            else:
                gain = _improve_directed(cost, near, order, place, spare, ends, a, least)
            if gain == 0.0:
                break
            total += gain
            for x in ends:
                if not is_waiting[x] and x != a:
                    is_waiting[x] = True
                    waiting[(head + count) % n] = x
                    count += 1
    return total


@kernel
def climb(
    cost: NDArray[np.float64],
    near: NDArray[np.int32],
    is_symmetric: bool,
    order: NDArray[np.int32],
    state: NDArray[np.uint64],
    kicks: int,
) -> None:
    """Improve an order of at least 8 rows in place: local search, then kicks that are kept unless they harm.

    A kick swaps two neighboring stretches somewhere, which local search does not undo by itself
    (a double bridge: Martin, Otto and Felten 1991), and only the rows around it are searched again.

    Parameters
    ----------
    near : (n, k) int32
        The nearest other rows to go to from each, nearest first.
    state : (1,) uint64
        Of the random numbers; not 0.
    kicks
        Their number.
    """
    n = len(order)
    place = np.empty(n, dtype=np.int32)
    spare = np.empty(n, dtype=np.int32)
    waiting = order.copy()
    is_waiting = np.zeros(n, dtype=np.bool_)
    ends = np.empty(6, dtype=np.int32)
    least = 0.0
    for k in range(n):
        place[order[k]] = k
        is_waiting[k] = True
        least += _GAIN / n * abs(cost[order[k - 1], order[k]])
    _descend(cost, near, is_symmetric, order, place, spare, waiting, is_waiting, ends, n, least)
    kept, kept_place = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    longest = min(_STRETCH, n // 2 - 1)
    for _ in range(kicks):
        kept[:] = order
        kept_place[:] = place
        low, count, next_count = _random(state, n), 1 + _random(state, longest), 1 + _random(state, longest)
        a, b = order[low], order[(low + 1) % n]
        c, d = order[(low + count) % n], order[(low + count + 1) % n]
        e, f = order[(low + count + next_count) % n], order[(low + count + next_count + 1) % n]
        lost = cost[a, d] + cost[e, b] + cost[c, f] - cost[a, b] - cost[c, d] - cost[e, f]
        _swap_stretches(order, place, spare, (low + 1) % n, count, next_count)
        queued = 0
        for x in (a, b, c, d, e, f):
            if not is_waiting[x]:
                is_waiting[x] = True
                waiting[queued] = x
                queued += 1
        gained = _descend(cost, near, is_symmetric, order, place, spare, waiting, is_waiting, ends, queued, least)
        if gained < lost - least:
            order[:] = kept
            place[:] = kept_place


@kernel
def one_tree_bound(cost: NDArray[np.float64], rounds: int) -> float:
    """Return a lower bound on the round trips of a symmetric matrix.

    A tree over all rows but the first, and two edges that join it, are never longer than a tour. Fees
    on rows, which any tour pays twice, push the tree towards one.

    Held and Karp, The traveling-salesman problem and minimum spanning trees: part II, 1971; the pace
    at which fees change follows Volgenant and Jonker 1982.

    Parameters
    ----------
    rounds
        Number of changes of the fees.
    """
    n = len(cost)
    fee = np.zeros(n)
    degree, excess = np.empty(n, dtype=np.int64), np.zeros(n)
    nearest, joined = np.empty(n), np.empty(n, dtype=np.int32)
    best, pace, forced = -np.inf, 0.0, 0.0
    for a in range(n):
        for b in range(n):
            forced = min(forced, cost[a, b])  # a negative edge is in every tour
    for turn in range(rounds):
        for a in range(n):
            degree[a], nearest[a] = 0, np.inf
        # the tree, from row 1; a row in it is at -inf
        total, a = 0.0, 1
        nearest[0] = -np.inf
        for _ in range(n - 2):
            nearest[a] = -np.inf
            following, shortest = -1, np.inf
            for b in range(1, n):
                if nearest[b] == -np.inf:
                    continue
                weight = cost[a, b] + fee[a] + fee[b]
                if weight < nearest[b]:
                    nearest[b], joined[b] = weight, a
                if nearest[b] < shortest:
                    following, shortest = b, nearest[b]
            total += shortest
            degree[following] += 1
            degree[joined[following]] += 1
            a = following
        first, second = -1, -1
        for b in range(1, n):
            weight = cost[0, b] + fee[b]
            if first < 0 or weight < cost[0, first] + fee[first]:
                first, second = b, first
            elif second < 0 or weight < cost[0, second] + fee[second]:
                second = b
        total += cost[0, first] + cost[0, second] + fee[first] + fee[second]
        degree[first] += 1
        degree[second] += 1
        is_tour = True
        for a in range(1, n):
            total -= 2 * fee[a]
            is_tour &= degree[a] == 2
        best = max(best, total)
        if is_tour:
            break
        if turn == 0:
            pace = (total - forced) / (2 * n)
        step = pace * (1 - turn / rounds) ** 2
        for a in range(1, n):
            fee[a] += step * (0.6 * (degree[a] - 2) + 0.4 * excess[a])
            excess[a] = degree[a] - 2
    return best
