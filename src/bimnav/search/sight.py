# mypy: disable-error-code="assignment, no-any-return, operator"
"""Straight lines over cells: what they cost, and the cheapest way to leave out turns of a path."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import kernel, lean

__all__ = ["along", "dearest", "relax", "shorten"]

_NEAR = 1e-9  # cells; a line that passes a corner closer than this passes through it
_AHEAD = 256  # turns that one straight leg may replace
_SWEEPS = 100  # over all turns, with steps of one length
_FINEST = 0.125  # cells; the shortest step
_WAYS = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))


@lean
def along(cost: NDArray[np.float32], x: float, y: float, end_x: float, end_y: float) -> float:
    """Return the cost of a straight line, in cells; inf if it enters a blocked cell or cuts a corner.

    A line through a point where four cells meet needs all four; a line along a side needs both cells.

    Parameters
    ----------
    cost : (rows, cols) float32
        Multiplier of each cell; inf where blocked. Outside is blocked.
    x, y, end_x, end_y
        Cell (row, col) is the square from (col, row) to (col + 1, row + 1).
    """
    rows, cols = cost.shape
    dx, dy = end_x - x, end_y - y
    length = math.hypot(dx, dy)
    total, done = 0.0, 0.0
    while True:
        # the next line of the lattice, at most one cell away
        px, py = x + done * dx, y + done * dy
        to_x, to_y = 2.0, 2.0
        if abs(dx) * (1 - done) > _NEAR:
            line = math.floor(px + _NEAR) + 1.0 if dx > 0 else math.ceil(px - _NEAR) - 1.0
            to_x = (line - x) / dx
        if abs(dy) * (1 - done) > _NEAR:
            line = math.floor(py + _NEAR) + 1.0 if dy > 0 else math.ceil(py - _NEAR) - 1.0
            to_y = (line - y) / dy
        step = min(to_x, to_y, 1.0)
        mx, my = x + (done + step) / 2 * dx, y + (done + step) / 2 * dy
        dear = 0.0
        for row in range(math.floor(my - _NEAR), math.floor(my + _NEAR) + 1):
            for col in range(math.floor(mx - _NEAR), math.floor(mx + _NEAR) + 1):
                if not (0 <= row < rows and 0 <= col < cols):
                    return np.inf
                dear = max(dear, cost[row, col])
        total += dear * (step - done) * length
        if total == np.inf:
            return np.inf
        if step >= 1.0:
            return total
        cx, cy = x + step * dx, y + step * dy
        at_col, at_row = math.floor(cx + 0.5), math.floor(cy + 0.5)
        if abs(cx - at_col) < _NEAR and abs(cy - at_row) < _NEAR:
            for row in (at_row - 1, at_row):
                for col in (at_col - 1, at_col):
                    if not (0 <= row < rows and 0 <= col < cols) or cost[row, col] == np.inf:
                        return np.inf
        done = step


@lean
def dearest(cost: NDArray[np.float32], x: float, y: float, end_x: float, end_y: float) -> float:
    """Return the greatest finite multiplier that a straight line meets, 0 if none."""
    rows, cols = cost.shape
    low, high = sorted_pair(y, end_y)
    worst = 0.0
    for row in range(max(math.floor(low), 0), min(math.floor(high), rows - 1) + 1):
        if high - low > _NEAR:
            begin = (max(low, row) - y) / (end_y - y)
            end = (min(high, row + 1) - y) / (end_y - y)
        else:
            begin, end = 0.0, 1.0
        left, right = sorted_pair(x + begin * (end_x - x), x + end * (end_x - x))
        for col in range(max(math.floor(left - _NEAR), 0), min(math.floor(right + _NEAR), cols - 1) + 1):
            if cost[row, col] < np.inf:
                worst = max(worst, cost[row, col])
    return worst


@lean
def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """Return two numbers, the lesser first."""
    return (a, b) if a <= b else (b, a)


@kernel
def shorten(cost: NDArray[np.float32], points: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
    """Return which points of a path to keep so that the straight legs between them cost least, and the cost.

    Parameters
    ----------
    cost : (rows, cols) float32
        As for `along`.
    points : (n, 2) float64
        Column and row, in cells. Consecutive points must see each other.
    """
    count = len(points)
    best = np.full(count, np.inf)
    before = np.zeros(count, dtype=np.int64)
    best[0] = 0.0
    for i in range(count - 1):
        for j in range(i + 1, min(count, i + 1 + _AHEAD)):
            bound = math.hypot(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1])
            if best[i] + bound >= best[j]:
                continue
            total = best[i] + along(cost, points[i, 0], points[i, 1], points[j, 0], points[j, 1])
            if total < best[j]:
                best[j], before[j] = total, i
    kept = 1
    at = count - 1
    while at > 0:
        kept += 1
        at = before[at]
    found = np.zeros(kept, dtype=np.int64)
    at = count - 1
    while at > 0:
        kept -= 1
        found[kept] = at
        at = before[at]
    return found, best[count - 1]


@kernel
def relax(cost: NDArray[np.float32], points: NDArray[np.float64]) -> None:
    """Move the turns of a path, each by steps that become finer, while its two legs cost less for it.

    Parameters
    ----------
    cost : (rows, cols) float32
        As for `along`.
    points : (n, 2) float64, changed in place
        Column and row, in cells; the ends stay. Consecutive points must see each other, and still do.
    """
    waits = np.empty(len(points), dtype=np.bool_)
    step = 1.0
    while step >= _FINEST:
        waits[:] = True
        for _ in range(_SWEEPS):
            is_still = True
            for k in range(1, len(points) - 1):
                if not waits[k]:
                    continue
                waits[k] = False
                ax, ay, bx, by = points[k - 1, 0], points[k - 1, 1], points[k + 1, 0], points[k + 1, 1]
                x, y = points[k, 0], points[k, 1]
                least = along(cost, ax, ay, x, y) + along(cost, x, y, bx, by) - _NEAR
                for right, up in _WAYS:
                    to_x, to_y = x + step * right, y + step * up
                    if math.hypot(to_x - ax, to_y - ay) + math.hypot(bx - to_x, by - to_y) >= least:
                        continue  # no multiplier is below 1
                    total = along(cost, ax, ay, to_x, to_y)
                    if total < least:
                        total += along(cost, to_x, to_y, bx, by)
                    if total < least:
                        least, is_still = total, False
                        points[k, 0], points[k, 1] = to_x, to_y
                        waits[k - 1 : k + 2] = True
            if is_still:
                break
        step *= 0.5
