# mypy: disable-error-code="assignment"
"""Distance fields over costs, without a heap.

No step costs less than the least multiplier, so cells whose lengths lie within one such width are final
together: they go into buckets of that width, in a ring as long as the dearest step. Buckets are chains of
blocks, so that they are read straight through and no bucket has a largest size.
Dial, Algorithm 360: shortest-path forest with topological ordering, Communications of the ACM 12, 1969.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import FOUND, FULL, first_at_least, lean, trailing_zeros
from bimnav.search.layout import HUB, Links
from bimnav.search.workspace import Workspace

__all__ = ["MOST_BUCKETS", "flood", "flow"]

MOST_BUCKETS = 4096
"""A longer ring is mostly empty; then a heap is better."""

_HALF_ROOT = 0.5 * np.sqrt(2.0)
_SHIFT = 8
_BLOCK = 1 << _SHIFT  # cells


def flood(
    space: Workspace,
    cost: NDArray[np.float32],
    moves: NDArray[np.uint16],
    steps: NDArray[np.int64],
    links: Links,
    least: float,
    greatest: float,
    sources: NDArray[np.int64],
) -> NDArray[np.float64] | None:
    """Return the cost of every padded cell from the nearest source; None where buckets do not serve.

    Parameters
    ----------
    space
        Holds the answer, until its next search.
    least, greatest
        Bounds of the finite costs.
    """
    count = math.ceil(max(greatest * 1.5, links[2].max(initial=0)) / least) + 3
    if count > MOST_BUCKETS or (links[2] < least).any():
        return None
    ring = 1 << (count - 1).bit_length()
    ends = np.empty((2, ring), dtype=np.int32)
    lengths = space.lengths(moves.size)[0].view(np.float64)
    while True:
        following = np.empty(len(space.items) >> _SHIFT, dtype=np.int32)
        if flow(cost, moves, steps, *links, sources, lengths, least, *ends, space.items, following) == FOUND:
            return lengths
        space.grow_heap()


@lean
def _add(
    cell: int,
    slot: int,
    first: NDArray[np.int32],
    after: NDArray[np.int32],
    cells: NDArray[np.int32],
    following: NDArray[np.int32],
    unused: int,
) -> int:
    """Put a cell into a bucket; return the first unused block, or -1 if none was left."""
    place = np.int64(after[slot])
    if not place & _BLOCK - 1:  # no block yet, or the last is full
        if unused == 0:
            return -1
        block, unused = unused, np.int64(following[unused])
        following[block] = 0
        if place:
            following[(place - 1) >> _SHIFT] = block
        else:
            first[slot] = block
        place = block << _SHIFT
    cells[place] = cell
    after[slot] = place + 1
    return unused


@lean
def flow(
    cost: NDArray[np.float32],
    moves: NDArray[np.uint16],
    steps: NDArray[np.int64],
    link_from: NDArray[np.int32],
    link_to: NDArray[np.int32],
    link_length: NDArray[np.float64],
    sources: NDArray[np.int64],
    lengths: NDArray[np.float64],
    width: float,
    first: NDArray[np.int32],
    after: NDArray[np.int32],
    cells: NDArray[np.int32],
    following: NDArray[np.int32],
) -> int:
    """Fill in the lengths; see `flood`.

    Parameters
    ----------
    first, after : (a power of two,) int32, scratch
        The first block of every bucket, and the place after its last cell; 0 for an empty one.
    cells, following : (blocks * 256,) and (blocks,) int32, scratch
        What the blocks hold, 256 cells each, and which block follows; block 0 is none.

    Returns
    -------
    outcome
        `FOUND`, or `FULL` if there were too few blocks.
    """
    for k in range(len(lengths)):
        lengths[k] = np.inf
    for k in range(len(first)):
        first[k] = after[k] = 0
    blocks, last = len(following), len(first) - 1
    for k in range(1, blocks):
        following[k] = k + 1 if k + 1 < blocks else 0
    unused, waiting, bucket, scale, up = 1, 0, 0, 1.0 / width, steps[1]
    is_octile = len(steps) == 8
    for source in sources:
        if lengths[source] > 0:
            lengths[source] = 0.0
            unused = _add(source, 0, first, after, cells, following, unused)
            if unused < 0:
                return FULL
            waiting += 1
    while waiting:
        slot = bucket & last
        block, stop = np.int64(first[slot]), np.int64(after[slot])
        if block == 0:
            bucket += 1
            continue
        first[slot] = after[slot] = 0
        while block:
            begin, then = block << _SHIFT, np.int64(following[block])
            end = begin + _BLOCK if then else stop
            waiting -= end - begin
            for place in range(begin, end):
                cell = np.int64(cells[place])
                length = lengths[cell]
                if length * scale < bucket:  # it was reached on a shorter way, and dealt with
                    continue
                here, m = np.float64(cost[cell]), np.int64(moves[cell])
                # all ways at once: a branch for each would often be guessed wrong
                shorter = np.int64(length + 0.5 * (here + cost[cell + 1]) < lengths[cell + 1])
                shorter |= np.int64(length + 0.5 * (here + cost[cell + up]) < lengths[cell + up]) << 1
                shorter |= np.int64(length + 0.5 * (here + cost[cell - 1]) < lengths[cell - 1]) << 2
                shorter |= np.int64(length + 0.5 * (here + cost[cell - up]) < lengths[cell - up]) << 3
                if is_octile:
                    a, b = cell + up, cell - up
                    shorter |= np.int64(length + _HALF_ROOT * (here + cost[a + 1]) < lengths[a + 1]) << 4
                    shorter |= np.int64(length + _HALF_ROOT * (here + cost[a - 1]) < lengths[a - 1]) << 5
                    shorter |= np.int64(length + _HALF_ROOT * (here + cost[b - 1]) < lengths[b - 1]) << 6
                    shorter |= np.int64(length + _HALF_ROOT * (here + cost[b + 1]) < lengths[b + 1]) << 7
                shorter &= m
                while shorter:
                    way = trailing_zeros(np.uint64(shorter))
                    shorter &= shorter - 1
                    to = cell + steps[way]
                    found = length + (0.5 if way < 4 else _HALF_ROOT) * (here + cost[to])
                    lengths[to] = found
                    unused = _add(to, np.int64(found * scale) & last, first, after, cells, following, unused)
                    if unused < 0:
                        return FULL
                    waiting += 1
                if m & HUB:
                    for k in range(first_at_least(link_from, cell), len(link_from)):
                        if link_from[k] != cell:
                            break
                        to, found = np.int64(link_to[k]), length + link_length[k]
                        if found < lengths[to]:
                            lengths[to] = found
                            unused = _add(to, np.int64(found * scale) & last, first, after, cells, following, unused)
                            if unused < 0:
                                return FULL
                            waiting += 1
            following[block] = unused
            unused = block
            block = then
    return FOUND
