"""Distance fields where every cell costs the same: lengths are drawn along whole runs.

Every shortest path can be made of canonical runs between jump points (`Layout.turns`): a carrier,
diagonal with eight neighbors and north or south with four, sends straight runs to both sides from
each of its cells, and a straight run ends where an obstacle ends. So only jump points need a queue.
Runs stop at cells that were reached on a shorter way, or equally well by a run that goes on likewise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import FOUND, FULL, NEVER, first_at_least, forget, kernel, lean, pop_least, push
from bimnav.search.layout import HUB
from bimnav.search.lengths import DIAGONAL, FAR, STRAIGHT, to_cells

__all__ = ["spread", "unpad"]

_ALL = 255  # in `arrivals`: from here every way was taken
_BEGIN = 8  # row of `turns` for a path that begins


@lean
def _run(
    moves: NDArray[np.uint16],
    turns: NDArray[np.uint8],
    step: int,
    way: int,
    covered: int,
    reach: NDArray[np.int64],
    arrivals: NDArray[np.uint8],
    keys: NDArray[np.int64],
    items: NDArray[np.int32],
    size: int,
    cell: int,
    length: int,
) -> int:
    """Draw a straight run from a cell; return the new size of the heap."""
    straight_on = 1 << way
    while True:
        cell += step
        length += STRAIGHT
        if length < reach[cell]:
            reach[cell] = length
            arrivals[cell] = straight_on
        elif length > reach[cell] or arrivals[cell] & covered:
            return size
        else:
            arrivals[cell] |= straight_on
        m = np.int64(moves[cell])
        onward = np.int64(turns[way, m & 255])
        if onward == straight_on and not m & HUB:
            continue
        if onward or m & HUB:
            size = push(keys, items, size, length, cell << 4 | way)
        return size


@lean
def spread(
    moves: NDArray[np.uint16],
    turns: NDArray[np.uint8],
    steps: NDArray[np.int64],
    covered: NDArray[np.uint8],
    link_from: NDArray[np.int32],
    link_to: NDArray[np.int32],
    link_length: NDArray[np.float64],
    sources: NDArray[np.int64],
    targets: NDArray[np.int64],
    reach: NDArray[np.int64],
    arrivals: NDArray[np.uint8],
    keys: NDArray[np.int64],
    items: NDArray[np.int32],
) -> int:
    """Find the length of the shortest path from the nearest source to every cell.

    Parameters
    ----------
    covered : (8,) uint8
        The arrivals, as bits, whose runs do all that a run in this way would do.
    targets
        The search ends when these are settled; none for all cells.
    reach : (cells,) int64, filled in
        Lengths in units; `FAR` where there is no path. Only those of targets count if there are some.
    arrivals : (cells,) uint8, scratch
        The ways in which runs have come to a cell, as bits.

    Returns
    -------
    outcome
        `FOUND`, or `FULL` if the heap was too small.
    """
    reach[:] = FAR
    size, settled = 0, 0
    for source in sources:
        reach[source] = 0
        arrivals[source] = _ALL
        size = push(keys, items, size, 0, source << 4 | _BEGIN)
    while size:
        if size == len(keys):
            return FULL
        length, item = keys[0], np.int64(items[0])
        size = pop_least(keys, items, size, NEVER)
        cell = item >> 4
        if reach[cell] < length:
            continue
        while settled < len(targets) and reach[targets[settled]] <= length:
            settled += 1
        if settled and settled == len(targets):
            forget(keys, size, NEVER)
            return FOUND
        m = np.int64(moves[cell])
        if m & HUB:
            for k in range(first_at_least(link_from, cell), len(link_from)):
                if link_from[k] != cell:
                    break
                end, far = np.int64(link_to[k]), length + np.int64(round(link_length[k] * STRAIGHT))
                if far < reach[end] or (far == reach[end] and arrivals[end] != _ALL):
                    reach[end], arrivals[end] = far, _ALL
                    size = push(keys, items, size, far, end << 4 | _BEGIN)
        ways = np.int64(turns[item & 15, m & 255])
        for way in range(8):
            if not ways >> way & 1:
                continue
            if covered[way] != 1 << way:
                size = _run(
                    moves, turns, steps[way], way, covered[way], reach, arrivals, keys, items, size, cell, length
                )  # fmt: skip
                continue
            at, so_far, onward = cell, length, np.int64(1) << way
            while onward >> way & 1:
                at += steps[way]
                so_far += STRAIGHT if way < 4 else DIAGONAL
                if so_far < reach[at]:
                    reach[at] = so_far
                    arrivals[at] = 1 << way
                elif so_far > reach[at] or arrivals[at] & covered[way]:
                    break
                else:
                    arrivals[at] |= 1 << way
                m = np.int64(moves[at])
                onward = np.int64(turns[way, m & 255])
                if m & HUB:
                    size = push(keys, items, size, so_far, at << 4 | way)
                    break
                for side in range(4):
                    if side != way and onward >> side & 1:
                        size = _run(
                            moves, turns, steps[side], side, covered[side], reach, arrivals, keys, items,
                            size, at, so_far,
                        )  # fmt: skip
    return FOUND


@kernel
def unpad(reach: NDArray[np.int64], shape: tuple[int, int, int], exact: bool, scale: float) -> NDArray[np.float64]:
    """Return lengths in units as (storeys, rows, cols) float64, times a scale; inf where there is no path.

    `exact`: they are made of straight and diagonal steps only.
    """
    storeys, rows, cols = shape
    out = np.empty(shape, dtype=np.float64)
    for storey in range(storeys):
        for row in range(rows):
            first = (storey * (rows + 2) + row + 1) * (cols + 2) + 1
            for col in range(cols):
                units = reach[first + col]
                if units == FAR:
                    out[storey, row, col] = np.inf
                else:
                    out[storey, row, col] = scale * (to_cells(units) if exact else units / STRAIGHT)
    return out
