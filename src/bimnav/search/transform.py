# mypy: disable-error-code="assignment"
"""How far every cell is from what blocks: the exact Euclidean distance transform, whole or near what blocks."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import lean

__all__ = ["by_clearance", "clearances", "transform"]

_WIDEST = 48  # cells; from there on the whole transform costs less than looking so far around every cell


def clearances(free: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the distance from the middle of every cell to that of the nearest blocked one, in cells.

    Parameters
    ----------
    free : (storeys, rows, cols) bool
        Every storey for itself; all around it is blocked.

    Returns
    -------
    distance : (storeys, rows, cols) float64
        0 where blocked.
    """
    return np.sqrt(_squared(free))


def by_clearance(free: NDArray[np.bool_], values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a value for every cell by the square of its distance from what blocks, as in `clearances`.

    Parameters
    ----------
    free : (storeys, rows, cols) bool
    values : (n,) float32
        For squared distances 0 to n - 1, in cells; the last also for all beyond.
    """
    reach = math.isqrt(max(len(values) - 2, 0)) + 1  # from here on the square of a whole number lies beyond
    if reach > _WIDEST:
        squared = _squared(free)
        beyond: NDArray[np.float32] = values[np.minimum(squared, len(values) - 1, out=squared)]
        return beyond
    found = np.empty(free.shape, dtype=np.float32)
    heights = np.empty(free.shape[1:], dtype=np.uint16)
    line = np.empty((2, free.shape[2] + 2 * reach), dtype=np.uint16)
    look_up(np.ascontiguousarray(free), values, reach, heights, line, found)
    return found


def _squared(free: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the squares of `clearances`, whole numbers."""
    squared = np.empty(free.shape, dtype=np.int32)
    transform(np.ascontiguousarray(free), squared, np.empty((3, free.shape[2] + 1), dtype=np.int64))
    return squared


@lean
def look_up(
    free: NDArray[np.bool_],
    values: NDArray[np.float32],
    reach: int,
    heights: NDArray[np.uint16],
    line: NDArray[np.uint16],
    found: NDArray[np.float32],
) -> None:
    """Fill in `found`: `by_clearance`, of distances that are cut off at `reach` cells.

    First along columns, then the least over a window in every row: many cells at a time, for all that are
    looked at lie next to each other.

    Parameters
    ----------
    heights : (rows, cols) uint16, scratch
    line : (2, cols + 2 * reach) uint16, scratch
    """
    storeys, rows, cols = free.shape
    most, last = np.uint16(reach), np.uint16(len(values) - 1)
    one = np.uint16(1)
    squares, least = line[0], line[1, :cols]
    squares[:reach] = 0  # the rim and what lies behind it
    squares[cols + reach :] = 0
    middle = squares[reach : reach + cols]
    for storey in range(storeys):
        for row in range(rows):
            here, is_free = heights[row], free[storey, row]
            for col in range(cols):
                here[col] = is_free[col]
            if row:
                below = heights[row - 1]
                for col in range(cols):
                    here[col] *= min(most, np.uint16(below[col] + one))
        for row in range(rows - 1, -1, -1):
            here = heights[row]
            if row < rows - 1:
                above = heights[row + 1]
                for col in range(cols):
                    here[col] = min(here[col], np.uint16(above[col] + one))
            else:
                for col in range(cols):
                    here[col] = min(here[col], one)
            for col in range(cols):
                middle[col] = np.uint16(here[col] * here[col])
            for col in range(cols):
                least[col] = middle[col]
            for away in range(1, reach):
                added = np.uint16(away * away)
                left, right = squares[reach - away : reach - away + cols], squares[reach + away : reach + away + cols]
                for col in range(cols):
                    least[col] = min(least[col], np.uint16(min(left[col], right[col]) + added))
            into = found[storey, row]
            for col in range(cols):
                into[col] = values[min(least[col], last)]


@lean
def transform(free: NDArray[np.bool_], squared: NDArray[np.int32], scratch: NDArray[np.int64]) -> None:
    """Fill in squared distances; `scratch` is (3, cols + 1).

    First along columns, then along every row by the lower envelope of the parabolas over its cells.
    Meijster, Roerdink and Hesselink, A general algorithm for computing distance transforms in linear time,
    in Mathematical Morphology and its Applications to Image and Signal Processing, 2000.
    """
    storeys, rows, cols = free.shape
    heights, tops, begins = scratch[0], scratch[1], scratch[2]
    for storey in range(storeys):
        plane = squared[storey]
        for row in range(rows):
            for col in range(cols):
                plane[row, col] = 0 if not free[storey, row, col] else 1 + (plane[row - 1, col] if row else 0)
        for row in range(rows - 1, -1, -1):
            for col in range(cols):
                plane[row, col] = min(plane[row, col], 1 + (plane[row + 1, col] if row < rows - 1 else 0))
        for row in range(rows):
            heights[cols] = 0  # of the rim, which stands at -1 and at cols
            for col in range(cols):
                heights[col] = np.int64(plane[row, col]) * plane[row, col]
            count = 0
            tops[0], begins[0] = -1, 0
            for col in range(cols):
                while True:
                    top = tops[count]
                    # from here on the new parabola is below the last one
                    begin = (col * col - top * top + heights[col] - heights[top]) // (2 * (col - top)) + 1
                    if count == 0 or begin > begins[count]:
                        break
                    count -= 1
                if begin < cols:
                    count += 1
                    tops[count], begins[count] = col, max(begin, 0)
            for col in range(cols - 1, -1, -1):
                while begins[count] > col:
                    count -= 1
                away = col - tops[count]
                plane[row, col] = min(away * away + heights[tops[count]], (cols - col) * (cols - col))
