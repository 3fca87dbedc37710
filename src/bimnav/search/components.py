# mypy: disable-error-code="assignment, no-any-return"
"""Which cells can reach each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.search.compiled import lean

__all__ = ["components", "join"]


def components(free: NDArray[np.bool_], links: ArrayLike | None = None) -> NDArray[np.int32]:
    """Number the parts of a map; diagonal steps that cut no corner join nothing that straight ones do not.

    Parameters
    ----------
    free : (storeys, rows, cols) bool
    links : (k, 2) int
        Flat indexes of cells that are joined if both are free, as in `Layout`; a link joins both ways.

    Returns
    -------
    labels : (storeys, rows, cols) int32
        From 1, in the order of the parts' first cells; 0 where blocked.
    """
    labels = np.empty(free.shape, dtype=np.int32)
    pairs = np.asarray(() if links is None else links, dtype=np.int64).reshape(-1, 2)
    join(np.ascontiguousarray(free), pairs, labels.reshape(-1))
    return labels


@lean
def _root(parents: NDArray[np.int32], cell: int) -> int:
    """Return the first cell of a part, and shorten the way there."""
    while parents[cell] != cell:
        parents[cell] = parents[parents[cell]]
        cell = np.int64(parents[cell])
    return cell


@lean
def _unite(parents: NDArray[np.int32], a: int, b: int) -> None:
    a, b = _root(parents, a), _root(parents, b)
    if a < b:
        parents[b] = a
    else:
        parents[a] = b


@lean
def join(free: NDArray[np.bool_], links: NDArray[np.int64], labels: NDArray[np.int32]) -> None:
    """Number the parts; `labels`, (cells,) int32, serves as the forest of a union-find before."""
    storeys, rows, cols = free.shape
    for storey in range(storeys):
        for row in range(rows):
            first = (storey * rows + row) * cols
            for col in range(cols):
                cell = first + col
                if not free[storey, row, col]:
                    labels[cell] = -1
                    continue
                west = col > 0 and free[storey, row, col - 1]
                labels[cell] = labels[cell - 1] if west else cell
                # where the cell to the southwest is free too, west and south are one part already
                if row > 0 and free[storey, row - 1, col] and not (west and free[storey, row - 1, col - 1]):
                    _unite(labels, cell - cols, cell)
    for k in range(len(links)):
        if labels[links[k, 0]] >= 0 and labels[links[k, 1]] >= 0:
            _unite(labels, links[k, 0], links[k, 1])
    count = 0
    for cell in range(len(labels)):
        above = np.int64(labels[cell])
        if above < 0:
            labels[cell] = 0
        elif above == cell:
            count += 1
            labels[cell] = count
        else:
            labels[cell] = labels[above]  # parents lie before their children, so theirs is known
