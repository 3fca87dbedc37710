"""A* and Dijkstra's search over costs, from one or several cells, to some cells or to all."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import FOUND, FULL, NOTHING, first_at_least, forget, lean, pop_least, put
from bimnav.search.layout import COL_STEP, HUB, ROW_STEP

__all__ = ["astar"]

_CLOSED = 1
_ROOT = np.sqrt(2.0)


@lean
def _to_go(d_row: int, d_col: int, factor: float, saved: float) -> float:
    """Return a lower bound on the cost of getting so many rows and columns further."""
    d_row, d_col = abs(d_row), abs(d_col)
    return factor * (d_row + d_col - min(d_row, d_col) * saved)


@lean
def astar(
    cost: NDArray[np.float32],
    moves: NDArray[np.uint16],
    steps: NDArray[np.int64],
    height: int,
    stride: int,
    link_from: NDArray[np.int32],
    link_to: NDArray[np.int32],
    link_length: NDArray[np.float64],
    sources: NDArray[np.int64],
    targets: NDArray[np.int64],
    factor: float,
    nodes: Any,
    keys: NDArray[np.float64],
    items: NDArray[np.int32],
    stamp: int,
) -> int:
    """Search until all targets are settled; leave costs and parents in `nodes`.

    A step costs its length times the mean of both cells' costs. A parent that a link comes from is
    stored as its complement.

    Parameters
    ----------
    steps : (4,) or (8,) int64
        The moves a robot may use.
    targets
        At most one with a heuristic. None to settle all cells.
    factor
        Of the heuristic: a lower bound on cost over plan distance; 0 to search without.

    Returns
    -------
    outcome
        `FOUND`, `NOTHING` if not all targets can be reached, or `FULL` if the heap was too small.
    """
    size, settled, ways = 0, 0, len(steps)
    saved = 2.0 - _ROOT if ways == 8 else 0.0  # by a diagonal step instead of two straight ones
    goal = targets[0] if len(targets) else 0
    goal_row, goal_col = goal // stride % height, goal % stride
    for source in sources:
        node = nodes[source]
        node.stamp, node.length, node.parent, node.todo = stamp, 0.0, source, 0
        to_go = _to_go(source // stride % height - goal_row, source % stride - goal_col, factor, saved)
        size = put(keys, items, size, to_go, source)
    while True:
        if size < 0:
            size = pop_least(keys, items, -size, np.inf)
        if size == 0:
            return NOTHING
        if size == len(keys):
            return FULL
        cell = np.int64(items[0])
        size = -size  # the best of what is put next often belongs to the top
        node = nodes[cell]
        if node.todo == _CLOSED:
            continue
        node.todo = _CLOSED
        while settled < len(targets):
            target = nodes[targets[settled]]
            if target.stamp != stamp or target.todo != _CLOSED:
                break
            settled += 1
            if settled == len(targets):
                forget(keys, abs(size), np.inf)
                return FOUND
        row, col = cell // stride % height - goal_row, cell % stride - goal_col
        so_far, here, m = node.length, np.float64(cost[cell]), np.int64(moves[cell])
        for way in range(ways):
            if not m >> way & 1:
                continue
            end = cell + steps[way]
            length = so_far + (0.5 if way < 4 else 0.5 * _ROOT) * (here + cost[end])
            other = nodes[end]
            if other.stamp != stamp or length < other.length:
                other.stamp, other.length, other.parent, other.todo = stamp, length, cell, 0
                to_go = _to_go(row + ROW_STEP[way], col + COL_STEP[way], factor, saved)
                size = put(keys, items, size, length + to_go, end)
        if m & HUB:
            for k in range(first_at_least(link_from, cell), len(link_from)):
                if link_from[k] != cell:
                    break
                end = np.int64(link_to[k])
                length = so_far + link_length[k]
                other = nodes[end]
                if other.stamp != stamp or length < other.length:
                    other.stamp, other.length, other.parent, other.todo = stamp, length, ~cell, 0
                    to_go = _to_go(end // stride % height - goal_row, end % stride - goal_col, factor, saved)
                    size = put(keys, items, size, length + to_go, end)
