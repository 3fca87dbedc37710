# mypy: disable-error-code="assignment"
"""How far every cell is from what blocks: the exact Euclidean distance transform."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import lean

__all__ = ["clearances", "squared_clearances", "transform"]


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
    return np.sqrt(squared_clearances(free))


def squared_clearances(free: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the squares of `clearances`, whole numbers."""
    squared = np.empty(free.shape, dtype=np.int32)
    transform(np.ascontiguousarray(free), squared, np.empty((3, free.shape[2] + 1), dtype=np.int64))
    return squared


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
