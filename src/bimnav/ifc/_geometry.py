"""The bodies of all products: tessellated, cut, made whole, and packed into arrays."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.ifc._facets import Facets
from bimnav.ifc._kernel import Entity, File
from bimnav.ifc._tessellate import Reading, Tessellator
from bimnav.ifc._voids import Cutter, Placed, cut_all

__all__ = ["Geometry", "read_geometry"]


@dataclass(slots=True)
class Geometry:
    """What was made of the products, by step id.

    Parameters
    ----------
    meshes
        All triangles; some may be of no use any more.
    shapes
        Index of a mesh and placement of each body; openings are subtracted.
    lost
        Why a product has no body, or not all of it.
    flawed
        What the kernel said about products it read all the same.
    uncut
        Hosts whose openings could not be subtracted.
    eaten
        Hosts of which the openings leave nothing.
    """

    meshes: list[Mesh] = field(default_factory=list)
    shapes: dict[int, list[Placed]] = field(default_factory=dict)
    lost: dict[int, str] = field(default_factory=dict)
    flawed: dict[int, list[str]] = field(default_factory=dict)
    uncut: list[int] = field(default_factory=list)
    eaten: list[int] = field(default_factory=list)
    _bounds: dict[int, NDArray[np.float64] | None] = field(default_factory=dict)

    def bounds(self, step_id: int) -> NDArray[np.float64] | None:
        """Return lowest and highest world coordinates of a product, (2, 3) metres; None without a body."""
        if step_id not in self._bounds:
            points = [
                self.meshes[mesh].vertices @ placement[:3, :3].T + placement[:3, 3]
                for mesh, placement in self.shapes.get(step_id, ())
            ]
            boxes = np.array([(p.min(axis=0), p.max(axis=0)) for p in points])
            self._bounds[step_id] = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]) if points else None
        return self._bounds[step_id]

    def is_open(self, step_id: int) -> bool:
        """Tell whether a body of the product does not close."""
        return any(self.meshes[mesh].quality == "surface" for mesh, _ in self.shapes.get(step_id, ()))

    def pack(
        self, order: Iterable[int]
    ) -> tuple[list[dict[str, Any]], dict[str, NDArray[np.generic]], dict[int, list[int]]]:
        """Put the bodies of products one after the other.

        Returns
        -------
        meshes, arrays
            As in `Model`, with the meshes in the order in which they are first used.
        shapes
            Step id to indexes of shapes.
        """
        used: dict[int, int] = {}
        shape_mesh: list[int] = []
        placements: list[NDArray[np.float64]] = []
        shapes: dict[int, list[int]] = {}
        for step_id in order:
            shapes[step_id] = []
            for mesh, placement in self.shapes.get(step_id, ()):
                shapes[step_id].append(len(shape_mesh))
                shape_mesh.append(used.setdefault(mesh, len(used)))
                placements.append(placement)
        meshes = [self.meshes[mesh] for mesh in used]
        arrays: dict[str, NDArray[np.generic]] = {
            "vertices": np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in meshes)]),
            "faces": np.concatenate([np.empty((0, 3), np.int32), *(mesh.faces for mesh in meshes)]),
            "vertex_offsets": np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)], dtype=np.int64),
            "face_offsets": np.cumsum([0, *(len(mesh.faces) for mesh in meshes)], dtype=np.int64),
            "shape_mesh": np.array(shape_mesh, dtype=np.int32),
            "placements": np.array(placements, dtype=np.float64).reshape(-1, 4, 4),
        }
        return [{"quality": mesh.quality} for mesh in meshes], arrays, shapes


def read_geometry(
    file: File,
    products: Sequence[Entity],
    solids: Mapping[int, Sequence[Entity]],
    contexts: set[int],
    openings: Mapping[int, Sequence[int]],
    working_on: Callable[[int], None],
    *,
    thorough: Collection[int] = (),
    text: bytes = b"",
    unit_scale: float = 1.0,
    careful: bool = False,
) -> Geometry:
    """Tessellate products and cut their openings.

    Parameters
    ----------
    products
        Whose bodies are wanted, openings and spaces among them.
    solids
        Step id of each to the representation items that its body consists of.
    contexts
        Step ids of the representation contexts these are in.
    openings
        Step id of a host to the step ids of what cuts it.
    working_on
        Called with the step id of each product before it is touched; 0 before all are.
    thorough
        Step ids of products that the fast kernel must not touch.
    text
        What `file` was parsed from; without it all goes through the kernel.
    unit_scale
        Metres per length unit.
    careful
        Whether to touch only one at a time.
    """
    facets = Facets(text, unit_scale) if text else None
    tessellator = Tessellator(
        file, solids, contexts, working_on, facets=facets, unit_scale=unit_scale, thorough=thorough, careful=careful
    )
    readings = tessellator.read(products)
    geometry = Geometry(meshes=tessellator.meshes)
    cutter = Cutter(geometry.meshes)
    for step_id, reading in readings.items():
        working_on(step_id)
        for mesh in {mesh for mesh, _ in reading.shapes}:
            cutter.whole(mesh)
        reading.shapes = [shape for shape in reading.shapes if len(geometry.meshes[shape[0]].faces)]
        if reason := _loss(reading, len(tessellator.missing_items(step_id, reading)), len(solids[step_id])):
            geometry.lost[step_id] = reason
        elif reading.errors:
            geometry.flawed[step_id] = reading.errors
    with_body = {step_id for step_id, reading in readings.items() if reading.shapes}
    failed = cut_all(readings, openings, cutter, working_on)
    by_id = {product.id(): product for product in products}
    for step_id, reading in tessellator.read_cut([by_id[step_id] for step_id in failed]).items():
        if reading.shapes:
            for mesh, _ in reading.shapes:
                cutter.whole(mesh)
            readings[step_id].shapes = reading.shapes
        else:
            geometry.uncut.append(step_id)
    geometry.shapes = {step_id: reading.shapes for step_id, reading in readings.items()}
    geometry.eaten = sorted(step_id for step_id in with_body if not readings[step_id].shapes)
    return geometry


def _loss(reading: Reading, missing: int, solids: int) -> str | None:
    """Return why a product has no body, or not all of it; None if it has."""
    if reading.shapes and not missing:
        return None
    said = "; ".join(dict.fromkeys(error.rstrip(" :") for error in reading.errors))
    said = said or "the geometry kernel made nothing of it"
    return f"{missing} of the {solids} parts of its body are missing: {said}" if reading.shapes else said
