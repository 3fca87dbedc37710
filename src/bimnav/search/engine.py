"""Searches as functions of a layout: they pick the kernel, lend it memory, and read the answer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.search.astar import astar
from bimnav.search.compiled import FOUND, FULL
from bimnav.search.field import spread, unpad
from bimnav.search.flow import flood
from bimnav.search.jump import WHOLE, jump
from bimnav.search.layout import Layout
from bimnav.search.lengths import FAR, STRAIGHT, to_cells
from bimnav.search.trace import trace
from bimnav.search.workspace import Workspace, workspace

__all__ = ["Found", "distances", "distances_between", "find"]

_TOWARD_GOAL = 1 + 2**-40  # among equal sums take what is nearer to the goal; far below any true difference
_ROOT = math.sqrt(2)
_NONE = np.zeros(0, dtype=np.int64)


class Found(NamedTuple):
    """A cheapest path: (n, 3) int32 storey, row, column; its length and its cost in cells."""

    indices: NDArray[np.int32]
    length: float
    cost: float


def find(
    layout: Layout, start: int, goal: int, algorithm: Literal["auto", "jump", "astar", "dijkstra"] = "auto"
) -> Found | None:
    """Find a cheapest path between two free cells; None if there is none.

    Parameters
    ----------
    start, goal
        Flat indexes.
    algorithm
        `jump` needs eight neighbors and equal costs; `auto` takes it where it can.
    """
    start, goal = layout.padded(start), layout.padded(goal)
    space = workspace()
    if algorithm == "auto":
        algorithm = "jump" if layout.connectivity == 8 and layout.is_uniform else "astar"
    if algorithm == "jump":
        found = _jump(space, layout, start, goal)
    else:
        factor = layout.least * layout.shrink * _TOWARD_GOAL if algorithm == "astar" else 0.0
        found = _astar(space, layout, np.array([start]), np.array([goal]), factor)
    if not found:
        return None
    indices, straight, diagonal, linked = trace(space.units, layout.height, layout.stride, *layout.links, goal)
    plan = straight + diagonal * _ROOT
    cost = layout.least * plan + linked if layout.is_uniform else float(space.costs["length"][goal])
    return Found(indices, float(plan + linked), float(cost))


def distances(layout: Layout, sources: NDArray[np.int64], scale: float) -> NDArray[np.float64]:
    """Return the cost from the nearest source to every cell, (storeys, rows, cols), in cells times a scale."""
    space = workspace()
    if layout.is_uniform:
        reach = _spread(space, layout, layout.padded(sources), _NONE)
        exact = not len(layout.links[0])
        return unpad(reach, layout.shape, exact, scale * layout.least)  # type: ignore[no-any-return]
    lengths = _costs_from(space, layout, layout.padded(sources))
    return lengths.reshape(-1, layout.height, layout.stride)[:, 1:-1, 1:-1] * scale


def distances_between(
    layout: Layout, cells: NDArray[np.int64], scale: float, report: Callable[[int, int, str], None] | None = None
) -> NDArray[np.float64]:
    """Return the (n, n) costs between free cells, in cells times a scale; row to column. Every row is reported."""
    space = workspace()
    cells = layout.padded(cells)
    matrix = np.zeros((len(cells), len(cells)))
    for k, cell in enumerate(cells):
        if report is not None:
            report(k, len(cells), "rows")
        ends = slice(k + 1, None) if layout.is_symmetric else slice(None)
        targets = cells[ends]
        if not len(targets):
            continue
        if layout.is_uniform:
            units, exact = _spread(space, layout, cell[None], targets)[targets], not len(layout.links[0])
            found = np.array([to_cells(u) for u in units]) if exact else units / STRAIGHT
            row = np.where(units == FAR, np.inf, found * (scale * layout.least))
        else:
            row = _costs_from(space, layout, cell[None])[targets] * scale
        matrix[k, ends] = row
        if layout.is_symmetric:
            matrix[ends, k] = row
    return matrix


def _costs_from(space: Workspace, layout: Layout, sources: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the cost of every padded cell from the nearest source."""
    steps = layout.steps[: layout.connectivity]
    lengths = flood(space, layout.cost, layout.moves, steps, layout.links, layout.least, layout.greatest, sources)
    if lengths is None:
        _astar(space, layout, sources, _NONE, 0.0)
        nodes = space.costs[: layout.moves.size]
        lengths = np.where(nodes["stamp"] == space.stamp, nodes["length"], np.inf)
    return lengths


def _jump(space: Workspace, layout: Layout, start: int, goal: int) -> bool:
    arguments, shrink = layout.jump_arguments, int(layout.shrink * WHOLE)
    return _retry(
        space,
        layout,
        lambda stamp: jump(*arguments, start, goal, shrink, space.units, space.keys, space.items, stamp),
    )


def _astar(
    space: Workspace, layout: Layout, sources: NDArray[np.int64], targets: NDArray[np.int64], factor: float
) -> bool:
    arguments = layout.astar_arguments
    return _retry(
        space,
        layout,
        lambda stamp: astar(*arguments, sources, targets, factor, space.costs, space.float_keys, space.items, stamp),
    )


def _spread(
    space: Workspace, layout: Layout, sources: NDArray[np.int64], targets: NDArray[np.int64]
) -> NDArray[np.int64]:
    arguments = layout.spread_arguments
    reach, arrivals = space.lengths(layout.moves.size)
    _retry(
        space,
        layout,
        lambda _: spread(*arguments, sources, targets, reach, arrivals, space.keys, space.items),
    )
    return reach


def _retry(space: Workspace, layout: Layout, search: Callable[[int], int]) -> bool:
    """Search until the heap is large enough; return whether all was found."""
    while True:
        outcome = search(space.begin(layout.moves.size))
        if outcome != FULL:
            return outcome == FOUND
        space.grow_heap()
