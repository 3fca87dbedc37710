"""How cells lie in memory for a search: padded, flat, every storey after the other.

Each storey has a rim of blocked cells, so that no kernel asks where the map ends. The moves out of a
cell are the bits of one number, in the order of `ROW_STEP` and `COL_STEP`: east, north, west, south,
then northeast, northwest, southwest, southeast. The diagonal bits say where a robot could go with
eight neighbors, also when it may use only four: pruning needs to know.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.search.compiled import lean

__all__ = ["COL_STEP", "HUB", "ROW_STEP", "SEES", "Layout"]

COL_STEP = (1, 0, -1, 0, 1, -1, -1, 1)
ROW_STEP = (0, 1, 0, -1, 1, 1, -1, -1)
HUB = 256  # bit of a cell where links begin
SEES = 9  # first of four bits: a straight run from the cell ends at a turn and not at a wall
Links = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]
_EAST, _NORTH, _WEST, _SOUTH, _NORTHEAST, _NORTHWEST, _SOUTHWEST, _SOUTHEAST = range(8)


def _canonical_turns(connectivity: int) -> NDArray[np.uint8]:
    """Return where a shortest path may go on, by the direction it comes in and the moves there are.

    Among equally long paths the one that takes its diagonal steps first stands for all of them
    (with four neighbors: north and south first). So a straight step is followed by a turn only at
    the end of an obstacle. Row 8 is for a path that begins: every move.

    See Harabor and Grastien, Improving jump point search, ICAPS 2014, section 2, for the rule
    without corner cutting.
    """
    turns = np.zeros((9, 256), dtype=np.uint8)
    for moves in range(256):

        def bits(*directions: int, moves: int = moves) -> int:
            return sum(1 << d for d in directions if moves >> d & 1)

        turns[8, moves] = moves
        for along, back, sides in (
            (_EAST, (_NORTHWEST, _SOUTHWEST), ((_NORTH, _NORTHEAST), (_SOUTH, _SOUTHEAST))),
            (_WEST, (_NORTHEAST, _SOUTHEAST), ((_NORTH, _NORTHWEST), (_SOUTH, _SOUTHWEST))),
            (_NORTH, (_SOUTHEAST, _SOUTHWEST), ((_EAST, _NORTHEAST), (_WEST, _NORTHWEST))),
            (_SOUTH, (_NORTHEAST, _NORTHWEST), ((_EAST, _SOUTHEAST), (_WEST, _SOUTHWEST))),
        ):
            turns[along, moves] = bits(along)
            for behind, side in zip(back, sides, strict=True):
                if moves >> side[0] & 1 and not moves >> behind & 1:  # beside is free, behind it is not
                    turns[along, moves] |= bits(*side)
        for along, parts in (
            (_NORTHEAST, (_NORTH, _EAST)),
            (_NORTHWEST, (_NORTH, _WEST)),
            (_SOUTHWEST, (_SOUTH, _WEST)),
            (_SOUTHEAST, (_SOUTH, _EAST)),
        ):
            turns[along, moves] = bits(along, *parts)
        if connectivity == 4:
            turns[_NORTH, moves] = bits(_NORTH, _EAST, _WEST)
            turns[_SOUTH, moves] = bits(_SOUTH, _EAST, _WEST)
    if connectivity == 4:
        turns &= 15
    return turns


_TURNS = {connectivity: _canonical_turns(connectivity) for connectivity in (4, 8)}
# arrivals, as bits, whose runs do all that a run in this way would do: a carrier sends the straight ones
_COVERED = {
    8: np.array([0x91, 0x32, 0x64, 0xC8, 0x10, 0x20, 0x40, 0x80], dtype=np.uint8),
    4: np.array([0x0B, 0x02, 0x0E, 0x08, 0, 0, 0, 0], dtype=np.uint8),
}
_IS_STOP = np.zeros(256, dtype=np.uint8)  # for the four straight ways: a wall, or a path may turn here
for _d in range(4):
    _IS_STOP |= ((_TURNS[8][_d] & ~np.uint8(1 << _d)) != 0).astype(np.uint8) << _d
_IS_STOP[0] = 15


@lean
def moves_at(cost: NDArray[np.float32], i: int, stride: int) -> int:
    """Return the moves out of a free cell, as bits."""
    found: int
    east, west = cost[i + 1] < np.inf, cost[i - 1] < np.inf
    north, south = cost[i + stride] < np.inf, cost[i - stride] < np.inf
    found = east | north << 1 | west << 2 | south << 3
    found |= (north & east & (cost[i + stride + 1] < np.inf)) << 4
    found |= (north & west & (cost[i + stride - 1] < np.inf)) << 5
    found |= (south & west & (cost[i - stride - 1] < np.inf)) << 6
    found |= (south & east & (cost[i - stride + 1] < np.inf)) << 7
    return found


@lean
def _find_moves(cost: NDArray[np.float32], moves: NDArray[np.uint16], stride: int) -> tuple[float, float]:
    """Fill in the moves out of every cell; return the least and the greatest finite cost."""
    least, greatest = np.inf, 0.0
    for i in range(stride, len(cost) - stride):
        if cost[i] == np.inf:
            continue
        least = min(least, cost[i])
        greatest = max(greatest, cost[i])
        moves[i] = moves_at(cost, i, stride)
    return least, greatest


@lean
def _find_stops(
    moves: NDArray[np.uint16],
    is_stop: NDArray[np.uint8],
    stride: int,
    stops: NDArray[np.uint64],
    first: NDArray[np.int64],
) -> None:
    """Set, for each way, the bits of the cells where a run ends or has something to see; add `SEES`."""
    rows = len(moves) // stride
    for i in range(len(moves) - stride - 1, -1, -1):
        if moves[i]:
            for way, ahead in ((0, i + 1), (1, i + stride)):
                m = np.int64(moves[ahead])
                if m & HUB or is_stop[m & 255] >> way & 1:
                    moves[i] |= (m != 0) << SEES + way
                else:
                    moves[i] |= m & 1 << SEES + way
    row_words, col_words = (stride + 63) >> 6, (rows + 63) >> 6
    for row in range(rows):
        row_bit = np.uint64(1) << np.uint64(row & 63)
        shift = row % stride
        for col in range(stride):
            i = row * stride + col
            if moves[i]:
                for way, ahead in ((2, i - 1), (3, i - stride)):
                    m = np.int64(moves[ahead])
                    if m & HUB or is_stop[m & 255] >> way & 1:
                        moves[i] |= (m != 0) << SEES + way
                    else:
                        moves[i] |= m & 1 << SEES + way
            m = np.int64(moves[i])
            straight = 15 if m & HUB else is_stop[m & 255]
            across = row * row_words + (col >> 6)
            col_bit = np.uint64(1) << np.uint64(col & 63)
            if straight & 1:
                stops[first[0] + across] |= col_bit
            if straight & 4:
                stops[first[2] + across] |= col_bit
            up = col * col_words + (row >> 6)
            if straight & 2:
                stops[first[1] + up] |= row_bit
            if straight & 8:
                stops[first[3] + up] |= row_bit
            # a diagonal run ends where it cannot go on or one of its two sides has something to see
            seen = 15 if m & HUB else m >> SEES
            rising = (col - shift if col >= shift else col - shift + stride) * col_words + (row >> 6)
            falling = (col + shift if col + shift < stride else col + shift - stride) * col_words + (row >> 6)
            if seen & 3 or not m & 16:
                stops[first[4] + rising] |= row_bit
            if seen & 6 or not m & 32:
                stops[first[5] + falling] |= row_bit
            if seen & 12 or not m & 64:
                stops[first[6] + rising] |= row_bit
            if seen & 9 or not m & 128:
                stops[first[7] + falling] |= row_bit


class Layout:
    """The arrays of one map, as the kernels want them.

    Parameters
    ----------
    cost : (storeys, rows, cols) float32
        Multiplier of the length of a step; inf where blocked.
    connectivity
        4 or 8.
    links : (k, 2) int
        Extra one-way edges, from and to, as flat indexes into `cost`; one at a blocked cell is closed.
    link_costs : (k,) float
        What a link costs, in cells; at least 0. Multipliers do not apply to links.

    Attributes
    ----------
    moves : (cells,) uint16
        Bits of the moves out of every padded cell, and `HUB`.
    turns : (9, 256) uint8
        Moves worth making, by the direction one comes from and the moves there are.
    steps : (8,) int64
        How far a move leads in flat indexes.
    least, greatest
        Bounds of the finite costs.
    is_uniform
        Whether every free cell costs the same.
    """

    def __init__(
        self,
        cost: NDArray[np.float32],
        connectivity: int = 8,
        links: ArrayLike | None = None,
        link_costs: ArrayLike | None = None,
    ) -> None:
        self.shape = cost.shape
        storeys, rows, cols = cost.shape
        self.connectivity = connectivity
        self.height, self.stride = rows + 2, cols + 2
        padded = np.full((storeys, self.height, self.stride), np.inf, dtype=np.float32)
        padded[:, 1:-1, 1:-1] = cost
        self.cost: NDArray[np.float32] = padded.ravel()
        self.moves: NDArray[np.uint16] = np.zeros(self.cost.size, dtype=np.uint16)
        self.least, self.greatest = _find_moves(self.cost, self.moves, self.stride)
        self.is_uniform = self.least == self.greatest
        self.steps: NDArray[np.int64] = np.array(ROW_STEP) * self.stride + np.array(COL_STEP)
        self.turns, self.covered = _TURNS[connectivity], _COVERED[connectivity]
        origin, end = self.padded(np.asarray(() if links is None else links, dtype=np.int64).reshape(-1, 2).T)
        length = np.asarray(() if link_costs is None else link_costs, dtype=np.float64)
        order = np.lexsort((length, end, origin))
        order = order[np.isfinite(self.cost[origin[order]]) & np.isfinite(self.cost[end[order]])]
        length = length[order]
        self.links: Links = origin[order].astype(np.int32), end[order].astype(np.int32), length
        self.moves[self.links[0]] |= HUB

    def padded(self, index: Any) -> Any:
        """Return the padded flat index of a flat index, or of an array of them."""
        _, rows, cols = self.shape
        row, col = index // cols, index % cols
        return (row + 2 * (row // rows) + 1) * self.stride + col + 1

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether every link is as long as the one back."""
        origin, end, length = self.links
        back = np.lexsort((origin, end))
        same = (origin == end[back]) & (end == origin[back]) & (length == length[back])
        return bool(same.all())

    @cached_property
    def uniform_links(self) -> Links:
        """The links as seen from a map where a step costs its length."""
        return *self.links[:2], self.links[2] / self.least

    @cached_property
    def shrink(self) -> float:
        """Factor on plan distance that makes it a lower bound although links may be shortcuts."""
        origin, end, length = self.links
        d_row = np.abs(origin // self.stride % self.height - end // self.stride % self.height)
        d_col = np.abs(origin % self.stride - end % self.stride)
        plan = d_row + d_col - (2 - np.sqrt(2)) * np.minimum(d_row, d_col) * (self.connectivity == 8)
        far = plan > 0
        return float(min(1.0, (length[far] / (plan[far] * self.least)).min(initial=1.0)))

    @cached_property
    def first_stop(self) -> NDArray[np.int64]:
        """(9,) int64, where the words of each way begin in `stops`, and where they end."""
        rows = self.moves.size // self.stride
        along_row, along_col = rows * ((self.stride + 63) >> 6), self.stride * ((rows + 63) >> 6)
        return np.cumsum([0, along_row, along_col, along_row, *[along_col] * 5])

    @cached_property
    def stops(self) -> NDArray[np.uint64]:
        """uint64 words: for every way, a bit for each cell that ends a run of a jump point search.

        The cells of a row follow each other in the words of east and west, those of a column in north
        and south. Diagonals run around the map like the thread of a screw: the cells with equal
        `(col - row) % stride` for northeast and southwest, with equal `(col + row) % stride` for
        northwest and southeast, by row. The rim ends all runs, so none goes around.
        """
        words = np.zeros(self.first_stop[8], dtype=np.uint64)
        _find_stops(self.moves, _IS_STOP, self.stride, words, self.first_stop)
        return words

    @cached_property
    def jump_arguments(self) -> tuple[Any, ...]:
        """What `jump` wants to know of the map."""
        map_ = self.moves, self.turns, self.stops, self.first_stop, self.height, self.stride
        return *map_, *self.uniform_links

    @cached_property
    def astar_arguments(self) -> tuple[Any, ...]:
        """What `astar` wants to know of the map."""
        steps = self.steps[: self.connectivity]
        return self.cost, self.moves, steps, self.height, self.stride, *self.links

    @cached_property
    def spread_arguments(self) -> tuple[Any, ...]:
        """What `spread` wants to know of the map."""
        return self.moves, self.turns, self.steps, self.covered, *self.uniform_links
