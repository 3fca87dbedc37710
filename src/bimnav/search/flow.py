# mypy: disable-error-code="assignment"
"""Distance fields over costs, without a heap.

No step costs less than the least multiplier, so cells whose lengths lie within one such width are final
together: they go into buckets of that width, in a ring as long as the dearest step.
Dial, Algorithm 360: shortest-path forest with topological ordering, Communications of the ACM 12, 1969.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import FOUND, FULL, first_at_least, lean
from bimnav.search.layout import HUB, Links

__all__ = ["MOST_BUCKETS", "flood", "flow"]

MOST_BUCKETS = 4096
"""A longer ring is mostly empty; then a heap is better."""

_ROOT = np.sqrt(2.0)


def flood(
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
    least, greatest
        Bounds of the finite costs.
    """
    count = math.ceil(max(greatest * 1.5, links[2].max(initial=0)) / least) + 3
    if count > MOST_BUCKETS or (links[2] < least).any():
        return None
    lengths = np.empty(moves.size, dtype=np.float64)
    heads = np.empty(count, dtype=np.int32)
    room = moves.size + 1024
    while True:
        pool = np.empty((2, room), dtype=np.int32)
        if flow(cost, moves, steps, *links, sources, lengths, least, heads, pool[0], pool[1]) == FOUND:
            return lengths
        room *= 4


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
    heads: NDArray[np.int32],
    cells: NDArray[np.int32],
    following: NDArray[np.int32],
) -> int:
    """Fill in the lengths; see `flood`. `cells` and `following` hold lists that begin at `heads`.

    Returns
    -------
    outcome
        `FOUND`, or `FULL` if the lists were too small.
    """
    for k in range(len(lengths)):
        lengths[k] = np.inf
    for k in range(len(heads)):
        heads[k] = -1
    free, used, waiting, bucket, ways, ring = -1, 0, 0, 0, len(steps), len(heads)
    scale = 1.0 / width
    for source in sources:
        if lengths[source] > 0:
            if used == len(cells):
                return FULL
            lengths[source] = 0.0
            cells[used], following[used] = source, heads[0]
            heads[0] = used
            used += 1
            waiting += 1
    slot = 0
    while waiting:
        at = np.int64(heads[slot])
        if at < 0:
            bucket += 1
            slot = slot + 1 if slot + 1 < ring else 0
            continue
        heads[slot] = following[at]
        following[at] = free
        free = at
        waiting -= 1
        cell = np.int64(cells[at])
        length = lengths[cell]
        if length * scale < bucket:  # it was reached on a shorter way, and dealt with
            continue
        m, here = np.int64(moves[cell]), np.float64(cost[cell])
        for way in range(ways):
            if m >> way & 1:
                end = cell + steps[way]
                found = length + (0.5 if way < 4 else 0.5 * _ROOT) * (here + cost[end])
                if found < lengths[end]:
                    lengths[end] = found
                    spot = free
                    if spot >= 0:
                        free = np.int64(following[spot])
                    else:
                        if used == len(cells):
                            return FULL
                        spot = used
                        used += 1
                    into = np.int64(found * scale) % ring
                    cells[spot], following[spot] = end, heads[into]
                    heads[into] = spot
                    waiting += 1
        if m & HUB:
            for k in range(first_at_least(link_from, cell), len(link_from)):
                if link_from[k] != cell:
                    break
                end, found = np.int64(link_to[k]), length + link_length[k]
                if found < lengths[end]:
                    lengths[end] = found
                    if used == len(cells):
                        return FULL
                    into = np.int64(found * scale) % ring
                    cells[used], following[used] = end, heads[into]
                    heads[into] = used
                    used += 1
                    waiting += 1
    return FOUND
