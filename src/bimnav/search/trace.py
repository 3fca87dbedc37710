# mypy: disable-error-code="assignment, no-any-return, operator, return-value"
"""From parents to paths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import first_at_least, kernel

__all__ = ["centers", "trace"]


@kernel
def trace(
    nodes: Any,
    height: int,
    stride: int,
    link_from: NDArray[np.int32],
    link_to: NDArray[np.int32],
    link_length: NDArray[np.float64],
    goal: int,
) -> tuple[NDArray[np.int32], int, int, float]:
    """Follow the parents back from a goal that was found.

    Between a cell and its parent lie diagonal steps and then straight ones, or a link.

    Returns
    -------
    indices : (n, 3) int32
        Storey, row and column of every cell of the path.
    straight, diagonal
        Numbers of steps.
    linked
        Length of all links passed, in cells.
    """
    straight, diagonal, links, linked = 0, 0, 0, 0.0
    cell = goal
    while nodes[cell].parent != cell:
        parent = np.int64(nodes[cell].parent)
        if parent < 0:
            parent = ~parent
            shortest = np.inf
            for k in range(first_at_least(link_from, parent), len(link_from)):
                if link_from[k] != parent:
                    break
                if link_to[k] == cell:
                    shortest = min(shortest, link_length[k])
            links += 1
            linked += shortest
        else:
            d_row, d_col = abs(cell // stride - parent // stride), abs(cell % stride - parent % stride)
            diagonal += min(d_row, d_col)
            straight += max(d_row, d_col) - min(d_row, d_col)
        cell = parent
    at = straight + diagonal + links
    indices = np.empty((at + 1, 3), dtype=np.int32)
    cell = goal
    while True:
        row, col = cell // stride, cell % stride
        storey = row // height
        first_row = storey * height + 1
        parent = np.int64(nodes[cell].parent)
        parent_row, parent_col = (row, col) if parent < 0 else (parent // stride, parent % stride)
        while True:
            indices[at, 0], indices[at, 1], indices[at, 2] = storey, row - first_row, col - 1
            at -= 1
            d_row, d_col = parent_row - row, parent_col - col
            if abs(d_row) >= abs(d_col):
                row += (d_row > 0) - (d_row < 0)
            if abs(d_col) >= abs(d_row):
                col += (d_col > 0) - (d_col < 0)
            if row == parent_row and col == parent_col:
                break
        if parent == cell:
            return indices, straight, diagonal, linked
        cell = ~parent if parent < 0 else parent


@kernel
def centers(
    indices: NDArray[np.int32], first_row: int, first_col: int, cell_size: float, elevations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the middles of cells, (n, 3) metres: what `GridFrame.centers_of` returns, for long paths.

    Parameters
    ----------
    indices : (n, 3) int32
        Storey, row and column.
    """
    points = np.empty((len(indices), 3), dtype=np.float64)
    for k in range(len(indices)):
        points[k, 0] = (first_col + indices[k, 2] + 0.5) * cell_size
        points[k, 1] = (first_row + indices[k, 1] + 0.5) * cell_size
        points[k, 2] = elevations[indices[k, 0]]
    return points
