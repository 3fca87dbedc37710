# mypy: disable-error-code="assignment, no-any-return, operator, return-value"
"""Jump point search: a shortest path with eight neighbors where every cell costs the same.

All runs are read off lines of bits: a word of `Layout.stops` says where a straight run over 64 cells
ends, and from which of 64 cells a diagonal run should look aside. What it sees there is listed at
once, without a node in between.

Harabor and Grastien, Online graph pruning for pathfinding on grid maps, AAAI 2011; Improving jump
point search, ICAPS 2014 (blocks, intermediate jump points). Unlike there, lines of bits run along
diagonals too; a cell that is reached equally well from several sides goes on in the ways of all of
them; and cells where links begin are jump points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import (
    FOUND,
    FULL,
    NEVER,
    NOTHING,
    first_at_least,
    forget,
    leading_zeros,
    lean,
    pop_least,
    push,
    trailing_zeros,
)
from bimnav.search.layout import HUB, SEES
from bimnav.search.lengths import DIAGONAL, STRAIGHT

__all__ = ["WHOLE", "jump"]

WHOLE = 1 << 16  # of `shrink`: plan distance is a lower bound as it is


@lean
def _next_stop(stops: NDArray[np.uint64], first: int, place: int) -> int:
    """Return the first stop after a place; the rim of the map is one."""
    place += 1
    word = first + (place >> 6)
    bits = stops[word] >> np.uint64(place & 63)
    if bits:
        return place + trailing_zeros(bits)
    place |= 63
    while True:
        word += 1
        if stops[word]:
            return place + 1 + trailing_zeros(stops[word])
        place += 64


@lean
def _last_stop(stops: NDArray[np.uint64], first: int, place: int) -> int:
    """Return the last stop before a place; the rim of the map is one."""
    place -= 1
    word = first + (place >> 6)
    bits = stops[word] << np.uint64(63 - (place & 63))
    if bits:
        return place - leading_zeros(bits)
    place &= ~63
    while True:
        word -= 1
        if stops[word]:
            return place - 1 - leading_zeros(stops[word])
        place -= 64


@lean
def _look(
    stops: NDArray[np.uint64],
    first_stop: NDArray[np.int64],
    row_words: int,
    col_words: int,
    goal_row: int,
    goal_col: int,
    row: int,
    col: int,
    way: int,
) -> tuple[int, int]:
    """Return row and column of the cell where a straight run ends: a stop, or the goal before it."""
    if way == 0:
        end = _next_stop(stops, first_stop[0] + row * row_words, col)
        return row, goal_col if row == goal_row and col < goal_col < end else end
    if way == 2:
        end = _last_stop(stops, first_stop[2] + row * row_words, col)
        return row, goal_col if row == goal_row and end < goal_col < col else end
    if way == 1:
        end = _next_stop(stops, first_stop[1] + col * col_words, row)
        return goal_row if col == goal_col and row < goal_row < end else end, col
    end = _last_stop(stops, first_stop[3] + col * col_words, row)
    return goal_row if col == goal_col and end < goal_row < row else end, col


@lean
def _reach(
    nodes: Any,
    keys: NDArray[np.int64],
    items: NDArray[np.int32],
    size: int,
    stamp: int,
    shrink: int,
    d_row: int,
    d_col: int,
    cell: int,
    parent: int,
    length: int,
    ways: int,
) -> int:
    """Note that a cell can be reached, and where to go on from it; return the new size of the heap.

    `d_row` and `d_col` are how far the goal is.
    """
    node = nodes[cell]
    if node.stamp != stamp or length < node.length:
        node.stamp = stamp
        node.length = length
        node.parent = parent
        node.todo = ways
        node.done = 0
    elif length == node.length and ways & ~(node.todo | node.done):
        waits = node.todo != 0
        node.todo |= ways & ~node.done
        if waits:
            return size
    else:
        return size
    d_row, d_col = abs(d_row), abs(d_col)
    plan = (d_row + d_col) * STRAIGHT - min(d_row, d_col) * (2 * STRAIGHT - DIAGONAL)
    if shrink < WHOLE:
        plan = plan // WHOLE * shrink
    return push(keys, items, size, length + plan, cell)


@lean
def jump(
    moves: NDArray[np.uint16],
    turns: NDArray[np.uint8],
    stops: NDArray[np.uint64],
    first_stop: NDArray[np.int64],
    height: int,
    stride: int,
    link_from: NDArray[np.int32],
    link_to: NDArray[np.int32],
    link_length: NDArray[np.float64],
    start: int,
    goal: int,
    shrink: int,
    nodes: Any,
    keys: NDArray[np.int64],
    items: NDArray[np.int32],
    stamp: int,
) -> int:
    """Search from start to goal, two free cells; leave the parents of jump points in `nodes`.

    A parent that a link comes from is stored as its complement.

    Returns
    -------
    outcome
        `FOUND`, `NOTHING`, or `FULL` if the heap was too small.
    """
    row_words, col_words = (stride + 63) >> 6, (len(moves) // stride + 63) >> 6
    goal_row, goal_col = goal // stride, goal % stride
    goal_plan = goal_row % height
    size = _reach(nodes, keys, items, 0, stamp, shrink, 0, 0, start, start, 0, max(moves[start] & 255, 1))
    while size:
        if size == len(keys):
            return FULL
        key, cell = keys[0], np.int64(items[0])
        if cell == goal:
            forget(keys, size, NEVER)
            return FOUND
        size = pop_least(keys, items, size, NEVER)
        node = nodes[cell]
        todo = np.int64(node.todo)
        if not todo:
            continue
        node.todo = 0
        node.done |= todo
        length = node.length
        row, col = cell // stride, cell % stride
        storey_row = row - row % height
        if moves[cell] & HUB:
            for k in range(first_at_least(link_from, cell), len(link_from)):
                if link_from[k] != cell:
                    break
                end = np.int64(link_to[k])
                size = _reach(
                    nodes, keys, items, size, stamp, shrink,
                    end // stride % height - goal_plan, end % stride - goal_col,
                    end, ~cell, length + np.int64(round(link_length[k] * STRAIGHT)), max(moves[end] & 255, 1),
                )  # fmt: skip
        shift = row % stride
        rising, falling = col - shift, col + shift
        rising += stride if rising < 0 else 0
        falling -= stride if falling >= stride else 0
        for way in range(8):
            if not todo >> way & 1:
                continue
            at_row, at_col, so_far = row, col, length
            side, last_side = way, way
            d_row, d_col = 0, 0
            first = np.int64(0)
            to_goal = np.int64(0)  # steps until the goal's row or column is met
            if way >= 4:
                d_row = 1 if way < 6 else -1
                d_col = 1 if way == 4 or way == 7 else -1
                first = first_stop[way] + (falling if way & 1 else rising) * col_words
                to_goal = min((goal_row - row) * d_row, (goal_col - col) * d_col)
            while True:
                if way >= 4:
                    if d_row > 0:
                        walked = _next_stop(stops, first, at_row) - at_row
                    else:
                        walked = at_row - _last_stop(stops, first, at_row)
                    if 0 < to_goal < walked:
                        walked = to_goal
                    to_goal -= walked
                    at_row += walked * d_row
                    at_col += walked * d_col
                    so_far += walked * DIAGONAL
                    side, last_side = 1 - d_col, 2 - d_row
                at = at_row * stride + at_col
                here = np.int64(moves[at])
                if way >= 4 and (at == goal or here & HUB):
                    size = _reach(
                        nodes, keys, items, size, stamp, shrink,
                        at_row - storey_row - goal_plan, at_col - goal_col,
                        at, cell, so_far, max(turns[way, here & 255], 1),
                    )  # fmt: skip
                    break
                while True:
                    if here >> SEES + side & 1 or at_row == goal_row or at_col == goal_col:
                        end_row, end_col = _look(
                            stops, first_stop, row_words, col_words, goal_row, goal_col, at_row, at_col, side
                        )
                        end = end_row * stride + end_col
                        if moves[end]:
                            size = _reach(
                                nodes, keys, items, size, stamp, shrink,
                                end_row - storey_row - goal_plan, end_col - goal_col,
                                end, cell, so_far + (abs(end_row - at_row) + abs(end_col - at_col)) * STRAIGHT,
                                max(turns[side, moves[end] & 255], 1),
                            )  # fmt: skip
                            if end == goal and nodes[goal].length <= key:
                                forget(keys, size, NEVER)
                                return FOUND
                    if side == last_side:
                        break
                    side = last_side
                if way < 4 or not here >> way & 1:
                    break
    return NOTHING
