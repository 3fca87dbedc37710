# mypy: disable-error-code="no-any-return, operator"
"""Cheapest motions of a body that drives along its heading and turns on the spot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import kernel, lean, pop_least, push

__all__ = ["HEADINGS", "find_motion", "move"]

HEADINGS = 8
"""Headings, counter-clockwise from along the columns, an eighth of a turn apart."""

_COL = np.array([1, 1, 0, -1, -1, -1, 0, 1])
_ROW = np.array([0, 1, 1, 1, 0, -1, -1, -1])


def find_motion(
    free: NDArray[np.bool_],
    turns: NDArray[np.bool_],
    start: tuple[int, int, int],
    goal: tuple[int, int, int],
    turn_cost: float,
    reverse: float,
) -> tuple[NDArray[np.int64], float] | None:
    """Find the cheapest motion between two poses; None if there is none.

    Parameters
    ----------
    free : (8, rows, cols) bool
        Where the body may be in each heading.
    turns : (8, rows, cols) bool
        Where it may turn from a heading to the next one, and back.
    start, goal
        Heading, row and column; heading -1 for any.
    turn_cost
        Of an eighth of a turn, in cells; more than 0.
    reverse
        Multiplier of a step backwards, at least 1; inf to drive ahead only.

    Returns
    -------
    poses : (n, 3) int64
        Heading, row and column.
    cost
        In cells.
    """
    padded = np.pad(free, ((0, 0), (1, 1), (1, 1)))
    may_turn = np.pad(turns, ((0, 0), (1, 1), (1, 1)))
    begin, end = ((h, row + 1, col + 1) for h, row, col in (start, goal))
    states, cost = move(padded, may_turn, *begin, *end, turn_cost, reverse)
    return (states - (0, 1, 1), cost) if len(states) else None


@lean
def _octile(d_row: int, d_col: int) -> float:
    d_row, d_col = abs(d_row), abs(d_col)
    return max(d_row, d_col) + (math.sqrt(2.0) - 1) * min(d_row, d_col)


@kernel
def move(
    free: NDArray[np.bool_],
    turns: NDArray[np.bool_],
    start_heading: int,
    start_row: int,
    start_col: int,
    goal_heading: int,
    goal_row: int,
    goal_col: int,
    turn_cost: float,
    reverse: float,
) -> tuple[NDArray[np.int64], float]:
    """Search by A*; see `find_motion`. The arrays have a rim that is blocked."""
    _, rows, cols = free.shape
    plane = rows * cols
    lengths = np.full(HEADINGS * plane, np.inf)
    parents = np.full(HEADINGS * plane, -1, dtype=np.int32)
    room, size = 4096, 0
    keys = np.full(room, np.inf)
    items = np.empty(room, dtype=np.int32)
    for heading in range(HEADINGS):
        if (start_heading < 0 or heading == start_heading) and free[heading, start_row, start_col]:
            state = heading * plane + start_row * cols + start_col
            lengths[state] = 0.0
            size = push(keys, items, size, _octile(goal_row - start_row, goal_col - start_col), state)
    while size:
        if size + 8 > room - 8:
            more_keys, more_items = np.full(4 * room, np.inf), np.empty(4 * room, dtype=np.int32)
            more_keys[:room], more_items[:room] = keys, items
            keys, items, room = more_keys, more_items, 4 * room
        key, state = keys[0], np.int64(items[0])
        size = pop_least(keys, items, size, np.inf)
        heading, place = state // plane, state % plane
        row, col = place // cols, place % cols
        length = lengths[state]
        if key > length + _octile(goal_row - row, goal_col - col) + 1e-9:
            continue
        if row == goal_row and col == goal_col and (goal_heading < 0 or heading == goal_heading):
            count, at = 1, state
            while parents[at] >= 0:
                at = np.int64(parents[at])
                count += 1
            found = np.empty((count, 3), dtype=np.int64)
            at = state
            for k in range(count - 1, -1, -1):
                found[k, 0], found[k, 1], found[k, 2] = at // plane, at % plane // cols, at % cols
                at = np.int64(parents[at])
            return found, length
        for way in range(4):  # ahead, back, left, right
            if way < 2:
                sign = 1 - 2 * way
                r, c, h = row + sign * _ROW[heading], col + sign * _COL[heading], heading
                step = 1.0 if heading % 2 == 0 else math.sqrt(2.0)
                step *= reverse if way else 1.0
            else:
                h = (heading + (1 if way == 2 else HEADINGS - 1)) % HEADINGS
                r, c, step = row, col, turn_cost
                if not turns[heading if way == 2 else h, row, col]:
                    continue
            if not free[h, r, c]:
                continue
            other = h * plane + r * cols + c
            if length + step < lengths[other]:
                lengths[other] = length + step
                parents[other] = state
                size = push(keys, items, size, length + step + _octile(goal_row - r, goal_col - c), other)
    return np.empty((0, 3), dtype=np.int64), np.inf
