"""Kernels that mark the cells a polygon touches. Coordinates are in cells, row and column 0 at the frame's origin."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["mark_edges", "mark_inside"]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def mark_edges(
    occupied: NDArray[np.bool_], points: NDArray[np.float64], offsets: NDArray[np.int64], erosion: float
) -> None:
    """Mark every cell whose box, eroded, meets a run of edges; a run of one point is that point.

    Parameters
    ----------
    occupied : (rows, cols) bool, changed in place
    points : (n, 2) float64, cells
    offsets : (runs + 1,) int64, where each run begins in `points`
    erosion
        Taken off every side of a cell, in cells.
    """
    rows, cols = occupied.shape
    for run in range(len(offsets) - 1):
        first, last = offsets[run], offsets[run + 1] - 1
        for k in range(first, max(last, first + 1)):
            x0, y0 = points[k, 0], points[k, 1]
            x1, y1 = points[min(k + 1, last), 0], points[min(k + 1, last), 1]
            if y0 > y1:
                x0, y0, x1, y1 = x1, y1, x0, y0
            lowest = max(math.ceil(y0 - 1.0 + erosion), 0)
            highest = min(math.floor(y1 - erosion), rows - 1)
            for row in range(lowest, highest + 1):
                # the part of the edge between the eroded lower and upper side of the row
                xa, xb = x0, x1
                if y1 > y0:
                    slope = (x1 - x0) / (y1 - y0)
                    if y0 < row + erosion:
                        xa = x0 + (row + erosion - y0) * slope
                    if y1 > row + 1.0 - erosion:
                        xb = x0 + (row + 1.0 - erosion - y0) * slope
                if xa > xb:
                    xa, xb = xb, xa
                left = max(math.ceil(xa - 1.0 + erosion), 0)
                right = min(math.floor(xb - erosion), cols - 1)
                for col in range(left, right + 1):
                    occupied[row, col] = True


@numba.njit(cache=True, error_model="numpy", nogil=True)
def mark_inside(
    occupied: NDArray[np.bool_], points: NDArray[np.float64], offsets: NDArray[np.int64], groups: NDArray[np.int64]
) -> None:
    """Mark every cell whose middle lies inside one of some polygons, each given by its rings (even-odd).

    With the cells of `mark_edges` these are all cells the polygons touch: a cell that meets no edge of a
    polygon lies wholly inside or wholly outside.

    Parameters
    ----------
    occupied : (rows, cols) bool, changed in place
    points : (n, 2) float64, cells; closed rings
    offsets : (rings + 1,) int64, where each ring begins in `points`
    groups : (polygons + 1,) int64, where the rings of each polygon begin
    """
    for group in range(len(groups) - 1):
        _mark_inside_one(occupied, points, offsets[groups[group] : groups[group + 1] + 1])


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _mark_inside_one(occupied: NDArray[np.bool_], points: NDArray[np.float64], offsets: NDArray[np.int64]) -> None:
    rows, cols = occupied.shape
    x_min, y_min, x_max, y_max = np.inf, np.inf, -np.inf, -np.inf
    for k in range(offsets[0], offsets[-1]):
        x_min, x_max = min(x_min, points[k, 0]), max(x_max, points[k, 0])
        y_min, y_max = min(y_min, points[k, 1]), max(y_max, points[k, 1])
    lowest = min(max(math.ceil(y_min - 0.5), 0), rows)
    highest = max(min(math.floor(y_max - 0.5), rows - 1), -1)
    left = min(max(math.ceil(x_min - 0.5), 0), cols)
    right = max(min(math.floor(x_max - 0.5), cols - 1), -1)
    if lowest > highest or left > right:
        return
    flips = np.zeros((highest - lowest + 1, right - left + 2), dtype=np.bool_)
    for ring in range(len(offsets) - 1):
        for k in range(offsets[ring], offsets[ring + 1] - 1):
            x0, y0, x1, y1 = points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1]
            if y0 > y1:
                x0, y0, x1, y1 = x1, y1, x0, y0
            # half-open in y, so that a corner counts for one of its two edges
            for row in range(max(math.ceil(y0 - 0.5), lowest), min(math.ceil(y1 - 0.5) - 1, highest) + 1):
                x = x0 + (row + 0.5 - y0) * (x1 - x0) / (y1 - y0)
                col = min(max(math.ceil(x - 0.5), left), right + 1)
                flips[row - lowest, col - left] ^= True
    for row in range(flips.shape[0]):
        inside = False
        for col in range(flips.shape[1] - 1):
            inside ^= flips[row, col]
            if inside:
                occupied[row + lowest, col + left] = True
