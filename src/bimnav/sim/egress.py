"""Ways out of a building: how far every cell is from an exit, and what people need to get there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._doorways import doorway_of
from bimnav.building import Element, Space
from bimnav.errors import InputError
from bimnav.grid import Cell, rasterize
from bimnav.plan import distance_field

if TYPE_CHECKING:
    from bimnav.graph import NavGraph

__all__ = ["egress_cells", "egress_distances", "exit_cells"]

_BEFORE = 1.0  # metres in front of an exit within which its cells are looked for


def egress_distances(graph: NavGraph, exits: Iterable[Cell] | None = None) -> NDArray[np.float64]:
    """Find the length of the way out from every cell.

    Parameters
    ----------
    graph
        Where one can walk.
    exits
        Cells one is safe in. Without them, the free cells at what the task names as exits; without such a
        rule, at the doors that lead to one room only.

    Returns
    -------
    distance : (storeys, rows, cols) float64
        Metres to the nearest exit; where cells have multipliers, the cost. inf where no way leads out.

    Raises
    ------
    InputError
        If there is no exit.
    """
    _checks.need("graph", graph, "NavGraph")
    cells = exit_cells(graph) if exits is None else _checks.many("exits", exits)
    if not cells:
        raise InputError(
            "the building has no exit that a robot of this size can stand in.",
            "Name exits in the task, or give cells: egress_distances(graph, exits=[cell]).",
        )
    return distance_field(graph, cells)


def exit_cells(graph: NavGraph) -> list[Cell]:
    """Return the free cells at the exits of a building, by storey, row and column."""
    from bimnav.tasks import match

    environment = graph.environment
    if environment is None:
        return []
    building = environment.building
    named = {product.global_id for rule in environment.task.exits for product, _ in match(rule, building)}
    doors = [door for door in building.doors if door.global_id in named]
    if not named:
        doors = [door for door in building.doors if len(door.spaces) == 1]
    plans = []
    for door in doors:
        way = doorway_of(door, building)
        if way is not None:
            plans.append((way.rectangle(_BEFORE), way.bottom))
    others = named - {door.global_id for door in doors}
    products: list[Element | Space] = [*building.elements, *building.spaces]
    for product in products:
        bounds = product.bounds
        if product.global_id in others and bounds is not None:
            plans.append((shapely.box(*bounds[0, :2], *bounds[1, :2]), float(bounds[0, 2])))
    found: set[Cell] = set()
    for polygon, bottom in plans:
        storey = min(range(len(environment.levels)), key=lambda k: abs(environment.levels[k] - bottom))
        touched = rasterize(graph.frame, polygon) & graph.free[storey]
        found |= {Cell(storey, row, col) for row, col in np.argwhere(touched).tolist()}
    return sorted(found)


def egress_cells(graph: NavGraph, distance: NDArray[np.float64], width: float = 1.2) -> NDArray[np.bool_]:
    """Return the cells that people need on their ways out.

    From every room, or from every connected part of a storey without rooms, the way out begins at the cell
    that is farthest from an exit, and is widened by half the width to each side.

    Parameters
    ----------
    graph
        Where one can walk.
    distance : (storeys, rows, cols)
        From `egress_distances`.
    width
        Metres.

    Returns
    -------
    needed : (storeys, rows, cols) bool
    """
    needed: NDArray[np.bool_] = np.equal(distance, 0)
    for cells in _rooms(graph):
        cells &= np.isfinite(distance)
        if cells.any():
            start = np.unravel_index(int(np.where(cells, distance, -1.0).argmax()), distance.shape)
            _descend(graph, distance, Cell(*(int(k) for k in start)), needed)
    reach = math.ceil(width / 2 / graph.frame.cell_size)
    rows, cols = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disk = np.hypot(rows, cols) * graph.frame.cell_size <= width / 2 + 1e-9
    from scipy import ndimage

    for storey in range(len(needed)):
        needed[storey] = ndimage.binary_dilation(needed[storey], structure=disk) & graph.free[storey]
    return needed


def _rooms(graph: NavGraph) -> Sequence[NDArray[np.bool_]]:
    """Return the free cells of every room."""
    environment = graph.environment
    rooms = []
    for region in environment.regions if environment is not None else ():
        if region.source not in ("door", "passage"):
            cells = np.zeros(graph.frame.shape, dtype=np.bool_)
            cells[region.storey] = rasterize(graph.frame, region.polygon) & graph.free[region.storey]
            rooms.append(cells)
    if rooms:
        return rooms
    return [(graph.components == part) & graph.free for part in np.unique(graph.components[graph.free]).tolist()]


def _descend(graph: NavGraph, distance: NDArray[np.float64], cell: Cell, needed: NDArray[np.bool_]) -> None:
    """Mark the way that falls most steeply from a cell to an exit."""
    around = [(-1, 0), (0, -1), (0, 1), (1, 0)]
    while not needed[cell]:
        needed[cell] = True
        near = [Cell(cell.storey, cell.row + i, cell.col + j) for i, j in around]
        near += [
            link.end if link.begin == cell else link.begin
            for link in graph.connectors
            if cell in (link.begin, link.end)
        ]
        near = [other for other in near if other in graph.frame and distance[other] < distance[cell]]
        if not near:
            return
        cell = min(near, key=lambda other: (distance[other], other))
