# mypy: disable-error-code="assignment, no-any-return, operator"
"""Distance fields that follow a changing map: only what changes is searched again.

Cells that lose all support are taken back in the order of their lengths, then searched again from the rim of
what is left. When that touches too many cells, the whole field is cheaper and is searched instead.
Ramalingam and Reps, An incremental algorithm for a generalization of the shortest-path problem, Journal of
Algorithms 21, 1996, for the order of the two phases.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.search.astar import astar
from bimnav.search.compiled import FOUND, FULL, NEVER, first_at_least, forget, lean, pop_least, push
from bimnav.search.field import spread, unpad
from bimnav.search.flow import flood
from bimnav.search.layout import HUB, Layout, Links, moves_at
from bimnav.search.lengths import DIAGONAL, FAR, STRAIGHT, to_cells
from bimnav.search.workspace import workspace

__all__ = ["Field", "patch", "repair"]

_NONE = np.zeros(0, dtype=np.int64)
# The share of the free cells that a repair may touch before it gives up: it spends some forty times as long on a
# cell as a field of equal costs does, and a few times as long as one of others, and giving up must cost little
_SHARE_UNIFORM, _SHARE_WEIGHTED = 1 / 600, 1 / 150
_WAITS, _SOURCE = 1, 2
_UNITS = np.array([STRAIGHT] * 4 + [DIAGONAL] * 4)
_PLAN = np.array([0.5] * 4 + [0.5 * np.sqrt(2.0)] * 4)


class Field:
    """The cost from the nearest source to every cell, kept right while cells open, close and change cost.

    Always equal, to the last bit, to `distances` on a layout with the same costs.

    Parameters
    ----------
    layout
        Not touched; the field has its own copy of what changes.
    sources
        Flat indexes.
    """

    def __init__(self, layout: Layout, sources: ArrayLike) -> None:
        self._layout = layout
        self._cost = layout.cost.copy()
        self._moves = layout.moves.copy()
        self._sources: NDArray[np.int64] = layout.padded(np.asarray(sources, dtype=np.int64))
        self._free = np.count_nonzero(self._moves)
        self._level = layout.least if layout.is_uniform else math.nan
        self._marks = np.zeros(self._moves.size, dtype=np.uint8)
        self._hubs = np.unique(np.concatenate(layout.links[:2]))
        self._take_links()
        self._recompute()

    @property
    def is_uniform(self) -> bool:
        """Whether every free cell costs the same, as far as is known."""
        return not math.isnan(self._level)

    def update(self, cells: ArrayLike, cost: ArrayLike) -> bool:
        """Change the cost of cells; return whether the field was repaired rather than searched anew.

        Parameters
        ----------
        cells
            Flat indexes, none twice.
        cost
            New multipliers; inf closes a cell. Links that were closed in the layout stay closed.
        """
        padded: NDArray[np.int64] = np.atleast_1d(self._layout.padded(np.asarray(cells, dtype=np.int64)))
        new = np.broadcast_to(np.asarray(cost, dtype=np.float32), padded.shape)
        is_change = self._cost[padded] != new
        padded, new = padded[is_change], new[is_change]
        if not len(padded):
            return True
        self._cost[padded] = new
        patch(self._cost, self._moves, self._layout.stride, padded)
        if self.is_uniform and (new[np.isfinite(new)] != self._level).any():
            self._level = math.nan
            self._recompute()
            return False
        if np.isin(padded, self._hubs).any():
            self._take_links()
        elif self._may_repair and self._repair(padded):
            return True
        self._recompute()
        return False

    def distances(self, scale: float) -> NDArray[np.float64]:
        """Return the cost of every cell, (storeys, rows, cols), in cells times a scale; inf where there is no way."""
        layout = self._layout
        if self.is_uniform:
            exact = not len(self._links[0])
            return unpad(self._lengths, layout.shape, exact, scale * self._level)
        lengths = self._lengths.reshape(-1, layout.height, layout.stride)[:, 1:-1, 1:-1]
        return lengths * scale

    def at(self, cell: int, scale: float) -> float:
        """Return the cost of one cell, given by its flat index."""
        length = self._lengths[self._layout.padded(cell)]
        if not self.is_uniform:
            return float(length * scale)
        if length == FAR:
            return math.inf
        exact = not len(self._links[0])
        return float(scale * self._level * (to_cells(int(length)) if exact else length / STRAIGHT))

    def _take_links(self) -> None:
        """Take the links whose ends are open."""
        origin, end, length = self._layout.links
        is_open = np.isfinite(self._cost[origin]) & np.isfinite(self._cost[end])
        self._links: Links = origin[is_open], end[is_open], length[is_open]
        self._back = np.lexsort(self._links[:2])
        self._may_repair = bool((self._links[2] > 0).all())  # a link that costs nothing could hold itself up

    def _repair(self, changed: NDArray[np.int64]) -> bool:
        layout, space = self._layout, workspace()
        origin, end, length = self._links
        if self.is_uniform:
            length = np.array([round(cells / self._level * STRAIGHT) for cells in length.tolist()], dtype=np.int64)
        back = self._back
        share = _SHARE_UNIFORM if self.is_uniform else _SHARE_WEIGHTED
        room = max(64, int(share * self._free))
        lost = np.empty(room, dtype=np.int64)
        while len(space.keys) < 4 * room:
            space.grow_heap()
        steps = layout.steps[: layout.connectivity]
        cost, plan, far = (None, _UNITS, FAR) if self.is_uniform else (self._cost, _PLAN, np.inf)

        keys, never = (space.keys, NEVER) if self.is_uniform else (space.float_keys, np.inf)
        outcome = repair(
            cost, self._moves, plan, steps, origin, end, length, end[back], origin[back], length[back],
            self._sources, changed, self._lengths, self._marks, lost, far, keys, space.items, never, layout.stride,
        )  # fmt: skip
        return bool(outcome == FOUND)

    def _recompute(self) -> None:
        layout, space = self._layout, workspace()
        origin, end, length = self._links
        if self.is_uniform:
            reach, arrivals = np.empty(self._moves.size, dtype=np.int64), space.lengths(self._moves.size)[1]
            links = origin, end, length / self._level

            def uniform(_: int) -> int:
                return int(
                    spread(
                        self._moves, layout.turns, layout.steps, layout.covered, *links, self._sources, _NONE, reach,
                        arrivals, space.keys, space.items,
                    )
                )  # fmt: skip

            _until_it_fits(uniform, self._moves.size)
            self._lengths: NDArray[Any] = reach
            return
        steps = layout.steps[: layout.connectivity]
        finite = self._cost[np.isfinite(self._cost)]
        if len(finite):
            bounds = float(finite.min()), float(finite.max())
            lengths = flood(space, self._cost, self._moves, steps, self._links, *bounds, self._sources)
            if lengths is not None:
                self._lengths = lengths.copy()
                return

        def weighted(stamp: int) -> int:
            return int(
                astar(
                    self._cost, self._moves, steps, layout.height, layout.stride, origin, end, length,
                    self._sources, _NONE, 0.0, space.costs, space.float_keys, space.items, stamp,
                )
            )  # fmt: skip

        _until_it_fits(weighted, self._moves.size)
        nodes = space.costs[: self._moves.size]
        self._lengths = np.where(nodes["stamp"] == space.stamp, nodes["length"], np.inf)


def _until_it_fits(search: Callable[[int], int], cells: int) -> None:
    """Search with larger heaps until one is large enough."""
    space = workspace()
    while search(space.begin(cells)) == FULL:
        space.grow_heap()


@lean
def patch(cost: NDArray[np.float32], moves: NDArray[np.uint16], stride: int, changed: NDArray[np.int64]) -> None:
    """Set the moves out of changed cells and of those around them right."""
    for k in range(len(changed)):
        for around in range(9):
            i = changed[k] + (around // 3 - 1) * stride + around % 3 - 1
            kept = np.int64(moves[i]) & HUB
            moves[i] = kept if cost[i] == np.inf else moves_at(cost, i, stride) | kept


@lean
def _step(cost: NDArray[np.float32] | None, plan: NDArray[Any], way: int, a: int, b: int) -> Any:
    """Return what a step costs; without costs, its length. One of the branches is compiled."""
    if cost is None:
        return plan[way]
    return plan[way] * (np.float64(cost[a]) + cost[b])


@lean
def repair(
    cost: NDArray[np.float32] | None,
    moves: NDArray[np.uint16],
    plan: NDArray[Any],
    steps: NDArray[np.int64],
    link_from: NDArray[np.int32],
    link_to: NDArray[np.int32],
    link_length: NDArray[Any],
    back_from: NDArray[np.int32],
    back_to: NDArray[np.int32],
    back_length: NDArray[Any],
    sources: NDArray[np.int64],
    changed: NDArray[np.int64],
    lengths: NDArray[Any],
    marks: NDArray[np.uint8],
    lost: NDArray[np.int64],
    far: Any,
    keys: NDArray[Any],
    items: NDArray[np.int32],
    never: Any,
    stride: int,
) -> int:
    """Set lengths right after cells changed and `moves` were patched.

    Parameters
    ----------
    cost
        Multipliers; None where all cells cost the same and lengths are counted in units.
    plan : (8,)
        Lengths of the moves, or with costs their halves.
    link_from, link_to, link_length, back_from, back_to, back_length
        Links by the cell they come from, and again by the cell they lead to.
    lengths : (cells,), int64 units or float64, changed in place
    marks : (cells,) uint8, zeros
        Left as zeros.
    lost : scratch
        The most cells that may be taken back, and found again.
    far
        The length of a cell that cannot be reached.

    Returns
    -------
    outcome
        `FOUND`; or `FULL` if more was to be done than there is room for: then the lengths are of no use.
    """
    size, count, ways = 0, 0, len(steps)
    for source in sources:
        marks[source] |= _SOURCE
    # cells whose ways in may have become longer, in the order of their lengths
    for k in range(len(changed)):
        for around in range(9):
            cell = changed[k] + (around // 3 - 1) * stride + around % 3 - 1
            if lengths[cell] != far and not marks[cell] & _WAITS:
                marks[cell] |= _WAITS
                size = push(keys, items, size, lengths[cell], cell)
    outcome = FOUND
    while size:
        if size == len(keys) or count == len(lost):
            outcome = FULL
            break
        length, cell = keys[0], np.int64(items[0])
        size = pop_least(keys, items, size, never)
        m = np.int64(moves[cell])
        is_held = marks[cell] & _SOURCE != 0
        for way in range(ways):
            if is_held:
                break
            if m >> way & 1:
                other = cell + steps[way]
                if lengths[other] != far and lengths[other] + _step(cost, plan, way, cell, other) == length:
                    is_held = True
        if len(back_from) and not is_held:
            for k in range(first_at_least(back_from, cell), len(back_from)):
                if back_from[k] != cell:
                    break
                if lengths[back_to[k]] != far and lengths[back_to[k]] + back_length[k] == length:
                    is_held = True
        if is_held:
            marks[cell] &= ~np.uint8(_WAITS)
            continue
        lengths[cell] = far
        lost[count] = cell
        count += 1
        for way in range(ways):
            if m >> way & 1:
                other = cell + steps[way]
                if (
                    lengths[other] != far
                    and not marks[other] & _WAITS
                    and length + _step(cost, plan, way, cell, other) == lengths[other]
                ):
                    marks[other] |= _WAITS
                    size = push(keys, items, size, lengths[other], other)
        if m & HUB:
            for k in range(first_at_least(link_from, cell), len(link_from)):
                if link_from[k] != cell:
                    break
                other = np.int64(link_to[k])
                if lengths[other] != far and not marks[other] & _WAITS and length + link_length[k] == lengths[other]:
                    marks[other] |= _WAITS
                    size = push(keys, items, size, lengths[other], other)
    for k in range(min(size, len(keys) - 4)):  # a full heap has room for four more
        marks[items[k]] = 0
    forget(keys, size, never)
    size = 0
    for k in range(count):
        marks[lost[k]] = 0
    for source in sources:
        marks[source] = 0
    if outcome == FULL:
        return FULL
    # the best way in from what is left, for cells that were taken back and for those whose ways changed
    for k in range(count + 9 * len(changed)):
        if k < count:
            cell = lost[k]
        else:
            around = (k - count) % 9
            cell = changed[(k - count) // 9] + (around // 3 - 1) * stride + around % 3 - 1
        best, m = lengths[cell], np.int64(moves[cell])
        for way in range(ways):
            if m >> way & 1:
                other = cell + steps[way]
                if lengths[other] != far:
                    best = min(best, lengths[other] + _step(cost, plan, way, cell, other))
        if len(back_from):
            for j in range(first_at_least(back_from, cell), len(back_from)):
                if back_from[j] != cell:
                    break
                if lengths[back_to[j]] != far:
                    best = min(best, lengths[back_to[j]] + back_length[j])
        if best < lengths[cell]:
            lengths[cell] = best
            size = push(keys, items, size, best, cell)
            if size == len(keys):
                forget(keys, size, never)
                return FULL
    settled = 0
    while size:
        if size == len(keys) or settled == len(lost):
            forget(keys, size, never)
            return FULL
        length, cell = keys[0], np.int64(items[0])
        size = pop_least(keys, items, size, never)
        if lengths[cell] < length:
            continue
        settled += 1
        m = np.int64(moves[cell])
        for way in range(ways):
            if m >> way & 1:
                other = cell + steps[way]
                found = length + _step(cost, plan, way, cell, other)
                if found < lengths[other]:
                    lengths[other] = found
                    size = push(keys, items, size, found, other)
        if m & HUB:
            for k in range(first_at_least(link_from, cell), len(link_from)):
                if link_from[k] != cell:
                    break
                other, found = np.int64(link_to[k]), length + link_length[k]
                if found < lengths[other]:
                    lengths[other] = found
                    size = push(keys, items, size, found, other)
    return FOUND
