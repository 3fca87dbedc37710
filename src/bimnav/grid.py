"""Cells: the discretized world, and which of its cells a polygon touches."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks
from bimnav.errors import GridError, GridTooLargeError, OutsideMapError, ValueRangeError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["CELL_LIMIT", "EROSION", "Cell", "GridFrame", "cells_within", "rasterize"]

CELL_LIMIT = 50_000_000
"""The most cells a grid may have."""

EROSION = 1e-6
"""A cell is occupied when the cell, eroded by this many metres, meets a polygon: touching is not overlap."""

_FARTHEST = 2.0**53  # cells; beyond, not every one has a number of its own
_EDGE_SLACK = 1e-9  # fraction of a cell; 0.6 / 0.2 is 2.9999999999999996 but belongs to cell 3


class Cell(NamedTuple):
    """One cell: row grows with y, column with x. Indexes arrays of shape (storeys, rows, cols)."""

    storey: int
    row: int
    col: int


@dataclass(frozen=True, slots=True)
class GridFrame:
    """Where the cells are.

    The origin is a multiple of the cell size in world coordinates, so that two storeys and two runs
    share cells. Cells are half-open: their lower and left edges belong to them.

    Parameters
    ----------
    cell_size
        Edge of a cell in metres.
    first_row, first_col
        World index of row 0 and column 0: row 0 begins at `y = first_row * cell_size`.
    rows, cols
        Number of cells on every storey.
    elevations
        World height of each storey's floor in metres, one per storey.
    ground
        Storey meant when neither storey nor height is given.

    Raises
    ------
    ValueRangeError
        If the cell size is not a positive number.
    GridTooLargeError
        If there were more cells than `CELL_LIMIT`.
    """

    cell_size: float
    first_row: int = 0
    first_col: int = 0
    rows: int = 1
    cols: int = 1
    elevations: tuple[float, ...] = (0.0,)
    ground: int = 0

    def __post_init__(self) -> None:
        _check_cell_size(self.cell_size)
        for name in ("first_row", "first_col", "rows", "cols", "ground"):
            _checks.whole(name, getattr(self, name))
        object.__setattr__(self, "elevations", tuple(_checks.numbers("elevations", self.elevations).ravel().tolist()))
        if self.rows < 1 or self.cols < 1 or not self.elevations:
            raise GridError(f"a frame of {self.shape} cells is empty.", "Give at least one cell.")
        if not 0 <= self.ground < len(self.elevations):
            raise GridError(f"ground storey {self.ground} is not one of {len(self.elevations)} storeys.")
        if math.prod(self.shape) > CELL_LIMIT:
            raise _too_large(self.shape, self.cell_size)

    @classmethod
    def covering(
        cls,
        bounds: Sequence[float],
        cell_size: float,
        *,
        elevations: Sequence[float] = (0.0,),
        ground: int = 0,
        margin: int = 1,
    ) -> GridFrame:
        """Make the smallest frame whose cells cover a box.

        Parameters
        ----------
        bounds
            `(x_min, y_min, x_max, y_max)` in metres.
        cell_size
            Edge of a cell in metres.
        elevations, ground
            As for the frame itself.
        margin
            Cells added on every side.
        """
        _check_cell_size(cell_size)
        elevations = _checks.many("elevations", elevations)
        box = _checks.numbers("bounds", bounds).ravel().tolist()
        if len(box) != 4:
            raise ValueRangeError(f"bounds is {bounds!r:.80}.", "Give (x_min, y_min, x_max, y_max) in metres.")
        x_min, y_min, x_max, y_max = box
        if not all(math.isfinite(value) for value in box) or x_min > x_max or y_min > y_max:
            raise ValueRangeError(f"the box {tuple(box)} is not finite and ordered.")
        size = max((x_max - x_min) / cell_size, (y_max - y_min) / cell_size)
        if size > CELL_LIMIT:  # before the numbers of rows and columns themselves run away
            shape = (
                len(elevations),
                int((y_max - y_min) / cell_size) + 1,
                int((x_max - x_min) / cell_size) + 1,
            )
            raise _too_large(shape, cell_size)
        first_col = math.floor(x_min / cell_size + _EDGE_SLACK) - margin
        first_row = math.floor(y_min / cell_size + _EDGE_SLACK) - margin
        cols = math.ceil(x_max / cell_size - _EDGE_SLACK) + margin - first_col
        rows = math.ceil(y_max / cell_size - _EDGE_SLACK) + margin - first_row
        return cls(cell_size, first_row, first_col, max(rows, 1), max(cols, 1), elevations, ground)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of storeys, rows and columns."""
        return len(self.elevations), self.rows, self.cols

    @property
    def origin(self) -> tuple[float, float]:
        """World point where row 0 and column 0 begin, metres."""
        return self.first_col * self.cell_size, self.first_row * self.cell_size

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """`(x_min, y_min, x_max, y_max)` of all cells in metres."""
        x, y = self.origin
        return (
            x,
            y,
            (self.first_col + self.cols) * self.cell_size,
            (self.first_row + self.rows) * self.cell_size,
        )

    def __contains__(self, cell: object) -> bool:
        return (
            isinstance(cell, tuple)
            and len(cell) == 3
            and all(
                isinstance(index, (int, np.integer)) and 0 <= index < size
                for index, size in zip(cell, self.shape, strict=True)
            )
        )

    def storey_at(self, z: float | None) -> int:
        """Return the storey whose floor is the highest at or below a world height; `ground` for None."""
        if z is None:
            return self.ground
        if not _is_finite(z):
            raise ValueRangeError(f"z is {z!r:.40}.", "Give a world height in metres.")
        below = [i for i, floor in enumerate(self.elevations) if floor <= z + 0.1]
        return max(below, key=lambda i: self.elevations[i]) if below else 0

    def cell_at(self, x: float, y: float, z: float | None = None, *, storey: int | None = None) -> Cell:
        """Return the cell that holds a world point.

        Parameters
        ----------
        x, y
            World point in metres.
        z
            World height in metres; picks the storey. Without it and without `storey`, the ground storey.
        storey
            Index of the storey, instead of `z`.

        Raises
        ------
        OutsideMapError
            If the point lies outside the frame.
        """
        if not _is_finite(x, y):
            raise ValueRangeError(f"({x!r:.40}, {y!r:.40}) is not a point.", "Give finite world coordinates in metres.")
        level = self.storey_at(z) if storey is None else storey
        cell = Cell(level, self._index(y) - self.first_row, self._index(x) - self.first_col)
        if cell not in self:
            x_min, y_min, x_max, y_max = self.bounds
            raise OutsideMapError(
                f"point ({x:g}, {y:g}) on storey {level} lies outside the map.",
                f"The map reaches from x {x_min:.2f} to {x_max:.2f} m and y {y_min:.2f} to {y_max:.2f} m.",
                {"x": x, "y": y, "storey": level},
            )
        return cell

    def _index(self, coordinate: float) -> int:
        cells = min(max(coordinate / self.cell_size, -_FARTHEST), _FARTHEST)
        return math.floor(cells + _EDGE_SLACK)

    def center_of(self, cell: Cell) -> tuple[float, float, float]:
        """Return the world point in the middle of a cell on its storey's floor, metres."""
        if cell not in self:
            raise GridError(f"{cell} is not a cell of a frame of shape {self.shape}.")
        storey, row, col = cell
        return (
            (self.first_col + col + 0.5) * self.cell_size,
            (self.first_row + row + 0.5) * self.cell_size,
            self.elevations[storey],
        )

    def centers_of(self, cells: NDArray[np.integer]) -> NDArray[np.float64]:
        """Return the middles of many cells: (n, 3) indexes to (n, 3) metres."""
        storey, row, col = np.asarray(cells).reshape(-1, 3).T
        return np.column_stack(
            [
                (self.first_col + col + 0.5) * self.cell_size,
                (self.first_row + row + 0.5) * self.cell_size,
                np.asarray(self.elevations)[storey],
            ]
        )

    def box_of(self, cell: Cell) -> tuple[float, float, float, float]:
        """Return `(x_min, y_min, x_max, y_max)` of a cell in metres."""
        _, row, col = cell
        d = self.cell_size
        col, row = self.first_col + col, self.first_row + row
        return col * d, row * d, (col + 1) * d, (row + 1) * d


def _is_finite(*numbers: float) -> bool:
    try:
        return all(map(math.isfinite, numbers))
    except TypeError:  # not a number
        return False


def _check_cell_size(cell_size: Any) -> None:
    is_number = isinstance(cell_size, (float, int, np.floating, np.integer))
    if not (is_number and math.isfinite(cell_size) and cell_size >= 1e-3):
        raise ValueRangeError(
            f"cell size is {cell_size!r}.",
            "Give metres, at least 0.001; common sizes are 0.3048 (1 ft), 0.1 and 0.05.",
            {"cell_size": cell_size},
        )


def _too_large(shape: tuple[int, int, int], cell_size: float) -> GridTooLargeError:
    count = math.prod(shape)
    fits = cell_size * math.sqrt(count / CELL_LIMIT)
    fits = math.ceil(fits * 1.01 * 1000) / 1000  # a little more, for the cells at the rim
    return GridTooLargeError(
        f"cells of {cell_size:g} m would make a grid of {shape[0]} x {shape[1]} x {shape[2]} = {count:.3g} cells; "
        f"the limit is {CELL_LIMIT:.0e}.",
        f"Use cells of at least {fits:g} m.",
        {"cell_size": cell_size, "cells": count, "limit": CELL_LIMIT, "fits": fits},
    )


def rasterize(frame: GridFrame, polygons: BaseGeometry | Iterable[BaseGeometry]) -> NDArray[np.bool_]:
    """Find the cells of one storey that share positive area with polygons.

    A cell counts when the cell, eroded by `EROSION`, meets a polygon. The answer is exact, never
    sampled. Lines and points count through every cell whose eroded box they meet.

    Parameters
    ----------
    frame
        The cells.
    polygons
        One geometry or several, in world coordinates.

    Returns
    -------
    occupied : (rows, cols) bool
    """
    _checks.need("frame", frame, GridFrame)
    if not isinstance(polygons, shapely.Geometry):
        polygons = _checks.many("polygons", polygons, shapely.Geometry)
    occupied = np.zeros((frame.rows, frame.cols), dtype=np.bool_)
    _mark(frame, polygons, occupied, occupied)
    return occupied


def cells_within(frame: GridFrame, polygons: BaseGeometry | Iterable[BaseGeometry]) -> NDArray[np.bool_]:
    """Find the cells of one storey that lie wholly in polygons that do not overlap.

    A cell counts when the cell, eroded by `EROSION`, lies in the polygons.

    Parameters
    ----------
    frame
        The cells.
    polygons
        One geometry or several, in world coordinates.

    Returns
    -------
    within : (rows, cols) bool
    """
    touched, inside = np.zeros((2, frame.rows, frame.cols), dtype=np.bool_)
    _mark(frame, polygons, touched, inside)
    return inside & ~touched


def nearest_cell(
    frame: GridFrame, among: NDArray[np.bool_], storey: int, x: float, y: float
) -> tuple[Cell, float] | None:
    """Find the cell nearest to a point; of equally near ones the first by row, then by column.

    Parameters
    ----------
    among : (rows, cols) bool
        Which cells of the storey count.
    x, y
        World metres.

    Returns
    -------
    found
        The cell, and how far its middle is from the point, metres; None if no cell counts.
    """
    rows, cols = np.nonzero(among)
    if not len(rows):
        return None
    centers = frame.centers_of(np.column_stack([np.full_like(rows, storey), rows, cols]))
    distance = np.round(np.hypot(centers[:, 0] - x, centers[:, 1] - y), 9)
    k = int(np.lexsort((cols, rows, distance))[0])
    return Cell(storey, int(rows[k]), int(cols[k])), float(distance[k])


def _mark(
    frame: GridFrame,
    polygons: BaseGeometry | Iterable[BaseGeometry],
    touched: NDArray[np.bool_],
    inside: NDArray[np.bool_],
) -> None:
    """Mark the cells whose eroded box meets an edge, and those whose middle lies inside."""
    from bimnav._raster import mark_edges, mark_inside

    runs, groups = _runs_of(_parts_of(polygons))
    if not len(runs):
        return
    points, index = shapely.get_coordinates(runs, return_index=True)
    points = points / frame.cell_size - (frame.first_col, frame.first_row)
    if not (np.abs(points) < _FARTHEST).all():  # nor a NaN
        raise GridError("a polygon has corners that are not finite, or too far off to count cells.")
    offsets = np.searchsorted(index, np.arange(len(runs) + 1)).astype(np.int64)
    mark_edges(touched, points, offsets, EROSION / frame.cell_size)
    mark_inside(inside, points, offsets, groups)


def _parts_of(polygons: BaseGeometry | Iterable[BaseGeometry]) -> NDArray[np.object_]:
    """Return polygons, lines and points, none of them empty; those in collections after the others."""
    single = [polygons] if isinstance(polygons, shapely.Geometry) else list(polygons)
    parts = np.asarray(single, dtype=object)
    while (is_collection := shapely.get_type_id(parts) >= 4).any():  # collections inside collections
        parts = np.concatenate([parts[~is_collection], shapely.get_parts(parts[is_collection])])
    solid: NDArray[np.object_] = parts[~(shapely.is_empty(parts) | shapely.is_missing(parts))]
    return solid


def _runs_of(parts: NDArray[np.object_]) -> tuple[NDArray[np.object_], NDArray[np.int64]]:
    """Return all rings, lines and points, rings first, and where the rings of each polygon begin among them."""
    is_areal = shapely.get_type_id(parts) == 3
    has_holes = is_areal & (shapely.get_num_interior_rings(parts) > 0)
    simple = parts[is_areal & ~has_holes]  # its corners are those of its only ring
    rings, owner = shapely.get_rings(parts[has_holes], return_index=True)
    starts = np.searchsorted(owner, np.arange(has_holes.sum() + 1))
    groups = np.concatenate([np.arange(len(simple)), len(simple) + starts])
    return np.concatenate([simple, rings, parts[~is_areal]]), groups.astype(np.int64)
