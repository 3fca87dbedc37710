"""Bodies read past the geometry kernel: those of flat faces between straight edges, from the text of the model.

They are most of what a kernel spends its time on, and need none of its art.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from ifcopenshell.util.placement import get_mappeditem_transformation
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.errors import GeometryError
from bimnav.footprint import triangulate
from bimnav.ifc._clips import Clipper
from bimnav.ifc._kernel import Entity, check_size
from bimnav.ifc._pipes import Pipes
from bimnav.ifc._products import is_body
from bimnav.ifc._step import divide, gather, index

__all__ = ["Bodies", "Facets"]

_FACETED = frozenset(["IfcFacetedBrep", "IfcFaceBasedSurfaceModel", "IfcShellBasedSurfaceModel"])
_FLAT, _ROUND, _OTHER = range(3)
_MANY = 100  # parts of a body; more are better joined by the kernel

Matrix = NDArray[np.float64]
Placed = tuple[int, Matrix]


class Facets:
    """Reads polyhedra.

    Parameters
    ----------
    text
        A whole model; nothing is read from an empty one.
    unit_scale
        Metres per length unit.
    """

    def __init__(self, text: bytes, unit_scale: float) -> None:
        self._text = np.frombuffer(text, np.uint8)
        self._unit_scale = unit_scale
        numbers, places = index(self._text)
        if (np.diff(numbers) <= 0).any():
            order = np.argsort(numbers, kind="stable")
            numbers, places = numbers[order], places[order]
        self._is_sound = len(numbers) > 0 and bool((np.diff(numbers) > 0).all())  # no number is given twice
        self._numbers, self._places = numbers, places

    def read(self, items: Sequence[Entity]) -> Mesh | None:
        """Return the faces of all items as one mesh in metres; shells that touch stay apart.

        Returns
        -------
        mesh
            None if a face has curved edges or cannot be divided, or anything is damaged.
        """
        if not self._is_sound:
            return None
        step_ids = np.array([item.id() for item in items])
        is_read, points, corners, loops, faces = gather(self._text, self._numbers, self._places, step_ids)
        if not is_read or len(faces) < 2:
            return None
        points = points * self._unit_scale
        triangles, left = divide(points, corners, loops, faces)
        parts = [triangles]
        for face in left.tolist():
            rings = [corners[loops[k] : loops[k + 1]] for k in range(faces[face], faces[face + 1])]
            divided = _divided(points, rings)
            if divided is None:
                return None
            parts.append(divided)
        check_size(points)
        return Mesh(points, np.concatenate(parts))


def _divided(points: NDArray[np.float64], rings: Sequence[NDArray[np.int64]]) -> NDArray[np.int32] | None:
    """Divide a face into triangles; its largest ring goes round the others. None if it has no area."""
    normals = [_normal_of(points[ring]) for ring in rings]
    areas = [float(np.linalg.norm(normal)) for normal in normals]
    outer = int(np.argmax(areas))
    if areas[outer] == 0.0:
        return None
    normal = normals[outer] / areas[outer]
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    across /= np.linalg.norm(across)
    plane = np.stack([across, np.cross(normal, across)], axis=1)
    turned = [ring if k == outer or normals[k] @ normal < 0.0 else ring[::-1] for k, ring in enumerate(rings)]
    flat = [(points[ring] - points[rings[outer][0]]) @ plane for ring in turned]
    triangles: NDArray[np.int32] = np.concatenate(turned)[triangulate(flat)].astype(np.int32)
    return triangles if len(triangles) else None


def _normal_of(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal of a ring, as long as its area."""
    local = ring - ring[0]
    normal: NDArray[np.float64] = np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0) / 2.0
    return normal


def _together(meshes: Sequence[Mesh]) -> Mesh:
    if len(meshes) == 1:
        return meshes[0]
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


class Bodies:
    """Reads products of whose bodies a part is faceted or round; the other parts come one by one from the kernel.

    Parameters
    ----------
    facets
        Reads the faceted parts.
    pipes
        Reads the round ones.
    clipper
        Reads placements and the other parts.
    solids
        Step id of a product to the representation items that its body consists of.
    unit_scale
        Metres per length unit.
    keep
        Takes a mesh and returns its index.
    """

    def __init__(
        self,
        facets: Facets,
        pipes: Pipes,
        clipper: Clipper,
        solids: Mapping[int, Sequence[Entity]],
        unit_scale: float,
        keep: Callable[[Mesh], int],
    ) -> None:
        self._facets, self._pipes, self._clipper, self._solids = facets, pipes, clipper, solids
        self._unit_scale, self._keep = unit_scale, keep
        self._known: dict[int, list[Placed] | None] = {}
        self._kinds: dict[int, int] = {}

    def has_any(self, product: Entity) -> bool:
        """Tell whether there is anything faceted or round in a product's body."""
        return any(self._kind_of(item) is not _OTHER for item in self._solids[product.id()])

    def read(self, product: Entity) -> list[Placed] | None:
        """Return the bodies of a product, in the world; None if the kernel must read it."""
        try:
            placement = self._clipper.matrix(product.ObjectPlacement)
            wanted = {item.id() for item in self._solids[product.id()]}
            own = [r for r in product.Representation.Representations if is_body(r.RepresentationIdentifier)]
            parts = [self._parts(representation, wanted) for representation in own]
        except GeometryError:
            return None
        if placement is None or any(part is None for part in parts):
            return None
        return [(mesh, placement @ where) for part in parts for mesh, where in part or ()]

    def _kind_of(self, item: Entity) -> int:
        step_id = item.id()
        if step_id not in self._kinds:
            name = item.is_a()
            is_round = name not in _FACETED and self._pipes.can_read(item, name)
            self._kinds[step_id] = _FLAT if name in _FACETED else _ROUND if is_round else _OTHER
        return self._kinds[step_id]

    def _parts(self, representation: Entity, wanted: set[int]) -> list[Placed] | None:
        step_id = representation.id()
        if step_id not in self._known:
            self._known[step_id] = self._read(representation, wanted)
        return self._known[step_id]

    def _read(self, representation: Entity, wanted: set[int]) -> list[Placed] | None:
        plain = [item for item in representation.Items if item.id() in wanted]
        faceted = [item for item in plain if self._kind_of(item) is _FLAT]
        meshes = [self._facets.read(faceted)] if faceted else []
        for item in plain:
            kind = self._kind_of(item)
            if kind is not _FLAT:
                meshes.append(self._pipes.read(item) if kind is _ROUND else self._clipper.plain(item))
        made = [mesh for mesh in meshes if mesh is not None and len(mesh.faces)]
        if len(made) < len(meshes):
            return None
        found: list[Placed] = [(self._keep(_together(made)), np.eye(4))] if made else []
        mapped = [item for item in representation.Items if item.is_a() == "IfcMappedItem"]
        for item in mapped:
            to_product = self._mapping(item)
            parts = self._parts(item.MappingSource.MappedRepresentation, wanted)
            if to_product is None or parts is None:
                return None
            found += [(mesh, to_product @ where) for mesh, where in parts]
            if len(found) > _MANY:
                return None
        return found

    def _mapping(self, item: Entity) -> Matrix | None:
        """Return where a mapped item puts its source; None if it is flat or damaged."""
        try:
            matrix = np.array(get_mappeditem_transformation(item), dtype=np.float64)
        except (AttributeError, TypeError, ValueError):
            return None
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            return None
        matrix[:3, 3] *= self._unit_scale
        return matrix
