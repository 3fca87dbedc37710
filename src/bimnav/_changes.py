"""What has been closed in a graph since it was built, kept so that opening it again restores every value."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bimnav._kept import Kept
from bimnav.grid import GridFrame, rasterize

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import Obstacle

__all__ = ["Changes", "Placed", "cells_under", "changed_arrays", "indexes_of"]

_NO_CELLS = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Placed(Kept):
    """Something that stands in the way since, and the cells, as flat indexes, that it closes."""

    obstacle: Obstacle
    cells: NDArray[np.int64]

    @property
    def global_id(self) -> str:
        """Of the obstacle."""
        return self.obstacle.global_id


@dataclass(frozen=True, slots=True, eq=False)
class Changes(Kept):
    """What has been closed, and what its cells were like before.

    Parameters
    ----------
    blocked : (n,) int64
        Flat indexes of cells closed by `NavGraph.block`, rising.
    placed
        Obstacles and closed doors, in the order they came.
    cells : (k,) int64
        All that is closed, rising.
    cost, obstacle : (k,) float32, (k,) bool
        The values of these cells when nothing of this is closed.
    """

    blocked: NDArray[np.int64] = field(default_factory=lambda: _NO_CELLS)
    placed: tuple[Placed, ...] = ()
    cells: NDArray[np.int64] = field(default_factory=lambda: _NO_CELLS)
    cost: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, dtype=np.float32))
    obstacle: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    def with_cost(self, factor: NDArray[np.float32]) -> Changes:
        """Return the record with other costs, (storeys, rows, cols), of what can be opened again."""
        if not len(self.cells):
            return self
        return replace(self, cost=np.where(np.isfinite(self.cost), factor.ravel()[self.cells], self.cost))


def changed_arrays(
    cost: NDArray[np.float32],
    obstacle: NDArray[np.bool_],
    changes: Changes,
    blocked: NDArray[np.int64],
    placed: Sequence[Placed],
    kept: NDArray[np.int64],
) -> tuple[NDArray[np.float32], NDArray[np.bool_], Changes, NDArray[np.int64]]:
    """Return cost and obstacles with other things closed, the record of it, and the cells that differ.

    Parameters
    ----------
    kept
        Cells that stay as cheap as they were when an obstacle comes to stand on them.
    """
    cost, obstacle = cost.copy(), obstacle.copy()
    flat_cost, flat_obstacle = cost.reshape(-1), obstacle.reshape(-1)
    flat_cost[changes.cells], flat_obstacle[changes.cells] = changes.cost, changes.obstacle
    under = [entry.cells for entry in placed]
    closed = np.unique(np.concatenate([blocked, *under]))
    record = Changes(blocked, tuple(placed), closed, flat_cost[closed], flat_obstacle[closed])
    kept = np.setdiff1d(kept, blocked)
    before = flat_cost[kept]
    flat_cost[closed], flat_obstacle[closed] = np.inf, True
    flat_cost[kept] = before
    return cost, obstacle, record, np.union1d(changes.cells, closed)


def cells_under(frame: GridFrame, storey: int, body: BaseGeometry) -> NDArray[np.int64]:
    """Return the flat indexes of the cells of a storey that share area with a polygon."""
    x0, y0, x1, y1 = body.bounds
    d = frame.cell_size
    row, rows = _clip(y0 / d - frame.first_row, y1 / d - frame.first_row, frame.rows)
    col, cols = _clip(x0 / d - frame.first_col, x1 / d - frame.first_col, frame.cols)
    if not rows or not cols:
        return _NO_CELLS
    window = replace(frame, first_row=frame.first_row + row, first_col=frame.first_col + col, rows=rows, cols=cols)
    found_rows, found_cols = np.nonzero(rasterize(window, body))
    return ((storey * frame.rows + row + found_rows) * frame.cols + col + found_cols).astype(np.int64)


def _clip(low: float, high: float, size: int) -> tuple[int, int]:
    """Return the first of the cells from one coordinate to another, and how many of them there are."""
    first = min(max(int(np.floor(low)) - 1, 0), size)
    return first, max(min(int(np.ceil(high)) + 1, size) - first, 0)


def indexes_of(cells: Iterable[tuple[int, int, int]], frame: GridFrame) -> NDArray[np.int64]:
    """Return the flat indexes of cells, rising, each once."""
    index = np.array(list(cells), dtype=np.int64).reshape(-1, 3)
    return np.unique((index[:, 0] * frame.rows + index[:, 1]) * frame.cols + index[:, 2])
