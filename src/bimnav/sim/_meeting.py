"""The kernel that finds when somebody who walks and a robot that drives come near; arrays only."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["meeting"]


@njit(cache=True, error_model="numpy", nogil=True)
def _at(moment: float, k: int, times: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Return a value between two rows; `k` is the last row that is not later than the moment."""
    if k == len(times) - 1 or times[k] == moment:
        return float(values[k])
    slope = (values[k + 1] - values[k]) / (times[k + 1] - times[k])
    return float(slope * (moment - times[k]) + values[k])


@njit(cache=True, error_model="numpy", nogil=True)
def _row(moment: float, k: int, times: NDArray[np.float64]) -> int:
    while k + 1 < len(times) and times[k + 1] <= moment:
        k += 1
    return k


@njit(cache=True, error_model="numpy", nogil=True)
def meeting(
    own_times: NDArray[np.float64],
    own_points: NDArray[np.float64],
    reached: NDArray[np.float64],
    times: NDArray[np.float64],
    points: NDArray[np.float64],
    square: float,
) -> float:
    """Return when two that move straight between their rows come nearer than a distance while the first moves.

    Parameters
    ----------
    own_times, times : (n,), (m,) seconds
    own_points, points : (2, n), (2, m) metres
    reached : (n,) metres the first has driven
    square
        Of the distance, square metres.

    Returns
    -------
    seconds
        nan if they never do, or only move apart.
    """
    before, last = max(times[0], 0.0), min(times[-1], own_times[-1])
    if before >= last:
        return math.nan
    i, j = _row(before, 0, own_times), _row(before, 0, times)
    x = _at(before, i, own_times, own_points[0]) - _at(before, j, times, points[0])
    y = _at(before, i, own_times, own_points[1]) - _at(before, j, times, points[1])
    driven = _at(before, i, own_times, reached)
    while before < last:
        after = last
        if i + 1 < len(own_times):
            after = min(after, own_times[i + 1])
        if j + 1 < len(times):
            after = min(after, times[j + 1])
        i, j = _row(after, i, own_times), _row(after, j, times)
        next_x = _at(after, i, own_times, own_points[0]) - _at(after, j, times, points[0])
        next_y = _at(after, i, own_times, own_points[1]) - _at(after, j, times, points[1])
        farther = _at(after, i, own_times, reached)
        span = after - before
        vx, vy = (next_x - x) / span, (next_y - y) / span
        a, b, c = vx * vx + vy * vy, x * vx + y * vy, x * x + y * y - square
        root = b * b - a * c
        if farther - driven > 0 and b < 0 and root > 0:
            entry = 0.0 if c <= 0 else (-b - math.sqrt(root)) / a
            if entry <= span:
                return float(before + max(entry, 0.0))
        before, x, y, driven = after, next_x, next_y, farther
    return math.nan
