"""Two plain ways from an IFC file to occupied cells, written as short scripts usually write them.

Both let OpenCASCADE tessellate in world coordinates with openings cut. `sliced` then cuts every mesh at both
ends of the band, caps and projects it, and asks a tree of boxes; `voxelized` fills every mesh with cubes of
the size of a cell.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from bimnav.grid import EROSION, GridFrame

__all__ = ["boxes_of", "sliced", "voxelized"]

Band = tuple[float, float]
_SPECK = 1e-8  # square metres


def boxes_of(frame: GridFrame) -> NDArray[np.object_]:
    """Return every cell of a storey as a box, eroded as `rasterize` does it, row by row."""
    x = (frame.first_col + np.arange(frame.cols)) * frame.cell_size
    y = (frame.first_row + np.arange(frame.rows)) * frame.cell_size
    x, y = (grid.ravel() for grid in np.meshgrid(x, y))
    side = frame.cell_size
    boxes: NDArray[np.object_] = shapely.box(x + EROSION, y + EROSION, x + side - EROSION, y + side - EROSION)
    return boxes


def sliced(path: Path, wanted: Collection[str], bands: Sequence[Band], frame: GridFrame) -> NDArray[np.bool_]:
    """Mark the cells that products cover in each band: trimesh slices, shapely boxes.

    Returns
    -------
    occupied : (bands, rows, cols) bool
    """
    found: list[list[Any]] = [[] for _ in bands]
    for mesh in _meshes(path, wanted):
        for polygons, (low, high) in zip(found, bands, strict=True):
            if mesh.bounds[1, 2] > low and mesh.bounds[0, 2] < high:
                polygons.append(_projected(_between(mesh, low, high)))
    occupied = np.zeros((len(bands), frame.rows * frame.cols), dtype=np.bool_)
    boxes = boxes_of(frame)
    for layer, polygons in zip(occupied, found, strict=True):
        tree = shapely.STRtree([polygon for polygon in polygons if polygon is not None])
        layer[tree.query(boxes, predicate="intersects")[0]] = True
    return occupied.reshape(-1, frame.rows, frame.cols)


def voxelized(path: Path, wanted: Collection[str], bands: Sequence[Band], frame: GridFrame) -> NDArray[np.bool_]:
    """Mark the cells that products cover in each band: filled voxels of the size of a cell; see `sliced`."""
    occupied = np.zeros((len(bands), frame.rows, frame.cols), dtype=np.bool_)
    half = frame.cell_size / 2
    for mesh in _meshes(path, wanted):
        mesh.apply_translation((-half, -half, -half))  # trimesh puts the middles of cubes on multiples of their size
        try:
            points = mesh.voxelized(frame.cell_size).fill().points + half
        except ValueError:  # a face that trimesh does not get small enough: the product counts as missed
            continue
        cells = np.floor(points / frame.cell_size).astype(np.int64) - (frame.first_col, frame.first_row, 0)
        for layer, (low, high) in zip(occupied, bands, strict=True):
            column, row, _ = cells[(points[:, 2] > low) & (points[:, 2] < high)].T
            layer[row, column] = True
    return occupied


def _meshes(path: Path, wanted: Collection[str]) -> Iterator[trimesh.Trimesh]:
    file: Any = ifcopenshell.open(path)
    settings: Any = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    products = [product for product in file.by_type("IfcProduct") if product.GlobalId in wanted]
    iterator: Any = ifcopenshell.geom.iterator(settings, file, 1, include=products)
    going = iterator.initialize()
    while going:
        geometry = iterator.get().geometry
        vertices, faces = np.reshape(geometry.verts, (-1, 3)), np.reshape(geometry.faces, (-1, 3))
        if len(faces):
            yield trimesh.Trimesh(vertices, faces)
        going = iterator.next()


def _between(mesh: trimesh.Trimesh, low: float, high: float) -> trimesh.Trimesh:
    for height, normal in ((low, (0, 0, 1)), (high, (0, 0, -1))):
        try:
            mesh = mesh.slice_plane((0, 0, height), normal, cap=True)
        except ValueError:  # it is not watertight
            mesh = mesh.slice_plane((0, 0, height), normal)
    return mesh


def _projected(mesh: trimesh.Trimesh) -> Any:
    if not len(mesh.faces):
        return None
    try:
        return trimesh.path.polygons.projected(mesh, normal=(0, 0, 1))
    except (ValueError, IndexError):  # nothing but faces on edge
        return None
