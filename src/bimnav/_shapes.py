"""Triangles, and where in the world they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.errors import GeometryError

__all__ = ["Mesh", "Shape", "bounds_of"]

_TOGETHER = 100_000  # vertices of copies that are worked on at once
_FARTHEST = 1e8  # metres from the origin; beyond it float64 no longer holds a tenth of a micrometre


def _frozen(values: ArrayLike, dtype: type[np.generic], columns: int, what: str) -> NDArray[Any]:
    array = np.array(values, dtype=dtype)  # a private copy
    if array.size == 0:
        array = array.reshape(0, columns)
    if array.ndim != 2 or array.shape[1] != columns:
        raise GeometryError(f"{what} have shape {array.shape}.", f"Give an array of shape (n, {columns}).")
    array.flags.writeable = False
    return array


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles in coordinates of their own; shared by every shape that repeats them.

    Parameters
    ----------
    vertices : (n, 3) float64, metres
    faces : (m, 3) int32, indexes into `vertices`; outward faces run counter-clockwise
    quality
        How the mesh came about: `exact` (closed as given), `repaired` (closed after welding),
        `surface` (open: treated as a set of sheets) or `hull`.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    quality: str = "exact"

    def __post_init__(self) -> None:
        vertices = _frozen(self.vertices, np.float64, 3, "vertices")
        faces = _frozen(self.faces, np.int32, 3, "faces")
        if not np.isfinite(vertices).all() or (vertices.size and float(np.abs(vertices).max()) > _FARTHEST):
            raise GeometryError("a mesh has vertices that are not finite or are out of range.")
        if faces.size and not (int(faces.min()) >= 0 and int(faces.max()) < len(vertices)):
            raise GeometryError(f"a mesh of {len(vertices)} vertices has faces that refer to others.")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    def __reduce__(self) -> tuple[type[Self], tuple[NDArray[np.float64], NDArray[np.int32], str]]:
        return type(self), (self.vertices, self.faces, self.quality)  # unpickled arrays are read-only as well


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A mesh put in its place.

    Parameters
    ----------
    mesh
        The triangles.
    placement : (4, 4) float64
        From mesh to world coordinates.
    """

    mesh: Mesh
    placement: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    bounds: NDArray[np.float64] = field(init=False)  # (2, 3) lowest and highest world coordinates

    def __post_init__(self) -> None:
        placement = np.array(self.placement, dtype=np.float64)
        if placement.shape != (4, 4) or not np.isfinite(placement).all():
            raise GeometryError("a placement is not a finite (4, 4) matrix.")
        placement.flags.writeable = False
        object.__setattr__(self, "placement", placement)
        points = self.world_vertices()
        bounds = np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else np.full((2, 3), np.nan)
        bounds.flags.writeable = False
        object.__setattr__(self, "bounds", bounds)

    @classmethod
    def copies(cls, mesh: Mesh, placements: NDArray[np.float64]) -> list[Self]:
        """Put a mesh in many places, (n, 4, 4): the same as one shape after the other, many times faster."""
        placements = np.array(placements, dtype=np.float64)
        if placements.shape[1:] != (4, 4) or not np.isfinite(placements).all():
            raise GeometryError("a placement is not a finite (4, 4) matrix.")
        bounds = np.full((len(placements), 2, 3), np.nan)
        together = max(1, _TOGETHER // max(1, len(mesh.vertices)))
        for k in range(0, len(placements) if len(mesh.vertices) else 0, together):
            some = placements[k : k + together]
            points = mesh.vertices @ some[:, :3, :3].transpose(0, 2, 1) + some[:, None, :3, 3]
            bounds[k : k + together, 0], bounds[k : k + together, 1] = points.min(axis=1), points.max(axis=1)
        placements.flags.writeable = bounds.flags.writeable = False
        shapes = []
        for placement, box in zip(placements, bounds, strict=True):
            shape = object.__new__(cls)
            object.__setattr__(shape, "mesh", mesh)
            object.__setattr__(shape, "placement", placement)
            object.__setattr__(shape, "bounds", box)
            shapes.append(shape)
        return shapes

    def __reduce__(self) -> tuple[type[Self], tuple[Mesh, NDArray[np.float64]]]:
        return type(self), (self.mesh, self.placement)

    def world_vertices(self) -> NDArray[np.float64]:
        """Return the vertices in world coordinates, (n, 3) metres."""
        points: NDArray[np.float64] = self.mesh.vertices @ self.placement[:3, :3].T + self.placement[:3, 3]
        return points


def bounds_of(shapes: Sequence[Shape]) -> NDArray[np.float64] | None:
    """Return the lowest and highest world coordinates of shapes, (2, 3) metres; None without vertices."""
    boxes = [shape.bounds for shape in shapes if not np.isnan(shape.bounds).any()]
    if not boxes:
        return None
    return np.array([np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)])
