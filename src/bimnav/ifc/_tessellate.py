"""Triangles from the geometry kernel: every product once, and what fails a second time another way."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from ifcopenshell.util.shape import get_shape_matrix
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.errors import GeometryError
from bimnav.ifc._canonical import canonical
from bimnav.ifc._clips import Clipper
from bimnav.ifc._facets import Bodies, Facets
from bimnav.ifc._kernel import FAST, THOROUGH, Entity, File, iterate, mesh_of, new_log, settings_for
from bimnav.ifc._pipes import Pipes
from bimnav.ifc._products import is_body
from bimnav.ifc._units import angle_unit

__all__ = ["Reading", "Tessellator"]

_FARTHEST = 1e8  # metres from the origin
_LARGE = 100  # faces; the fast kernel makes smaller meshes alike in every run, and 600 are not
_FEW = 50  # products; so many are soon set up one by one, and then it is known which one stalls
_MIRROR = np.diag((-1.0, 1.0, 1.0, 1.0))
_STEP_ID = re.compile(r"#(\d+)=")


@dataclass(slots=True)
class Reading:
    """What the kernel made of one product.

    Parameters
    ----------
    shapes
        Index of a mesh and placement, (4, 4) float64 in metres, of each body.
    items
        Step ids of the representation items the triangles come from.
    errors
        What the kernel said about it.
    """

    shapes: list[tuple[int, NDArray[np.float64]]] = field(default_factory=list)
    items: set[int] = field(default_factory=set)
    errors: list[str] = field(default_factory=list)

    def add(self, mesh: int, placement: NDArray[np.float64]) -> None:
        """Add a body; the same body in the same place counts once."""
        if not any(mesh == known and np.array_equal(placement, where) for known, where in self.shapes):
            self.shapes.append((mesh, placement))


class Tessellator:
    """The geometry kernel, with the meshes it has made.

    Parameters
    ----------
    file
        Model to read.
    solids
        Step id of a product to the representation items that its body consists of.
    contexts
        Step ids of the representation contexts in which bodies are looked for.
    working_on
        Called with the step id of each product before the kernel touches it; with 0 before it touches all.
    thorough
        Step ids of products that the fast kernel must not touch.
    facets
        Reads faceted bodies; the kernel does, if there is none.
    unit_scale
        Metres per length unit.
    careful
        Whether to give the kernel one product at a time, which is slower, and never touches all.
    """

    def __init__(
        self,
        file: File,
        solids: Mapping[int, Sequence[Entity]],
        contexts: set[int],
        working_on: Callable[[int], None],
        *,
        thorough: Collection[int] = (),
        facets: Facets | None = None,
        unit_scale: float = 1.0,
        careful: bool = False,
    ) -> None:
        self.file = file
        self.meshes: list[Mesh] = []
        self._solids = solids
        self._contexts = contexts
        self._working_on = working_on
        self._thorough = thorough
        self._facets = facets
        self._unit_scale = unit_scale
        self._careful = careful
        self._index: dict[tuple[bytes, bytes], int] = {}
        self._known: dict[tuple[str, bool, str], tuple[int, frozenset[int]]] = {}

    def read(self, products: Sequence[Entity]) -> dict[int, Reading]:
        """Tessellate products without cutting their openings.

        Faceted bodies and pipes do not go to a kernel. What the fast one drops, leaves incomplete or complains about
        is clipped by our own means or handed to the thorough one; the better of the two readings counts.
        """
        trusted = [product for product in products if product.id() not in self._thorough]
        past = self._read_past(trusted)
        fast = self._iterate([p for p in trusted if p.id() not in past or not past[p.id()].shapes], FAST)
        known = past | fast
        readings = {step_id: known.get(step_id) or Reading() for step_id in (product.id() for product in products)}
        doubtful = [product for product in products if not self._is_complete(product, readings)]
        clipped = self._clip_all([product for product in doubtful if product.id() not in self._thorough])
        readings |= clipped
        left = [product for product in doubtful if product.id() not in clipped]
        for step_id, second in self._iterate(left, THOROUGH).items():
            first = readings[step_id]
            if self._worth(step_id, second) > self._worth(step_id, first):
                readings[step_id] = second
            elif not first.shapes:
                first.errors += second.errors
        return readings

    def read_cut(self, products: Sequence[Entity]) -> dict[int, Reading]:
        """Tessellate products with their openings cut by the thorough kernel."""
        return self._iterate(products, THOROUGH, openings=True)

    def missing_items(self, step_id: int, reading: Reading) -> list[Entity]:
        """Return the items of a product's body that left no triangle."""
        unseen = [item for item in self._solids[step_id] if item.id() not in reading.items]
        return [item for item in unseen if not self._left_triangles(item, reading.items)]

    def _left_triangles(self, item: Entity, seen: set[int]) -> bool:
        shells = getattr(item, "FbsmFaces", None) or getattr(item, "SbsmBoundary", None) or ()
        if any(shell.id() in seen for shell in shells):
            return all(shell.id() in seen for shell in shells)
        return any(part.id() in seen for part in self.file.traverse(item))  # slow, but of other kinds there are few

    def _is_complete(self, product: Entity, readings: Mapping[int, Reading]) -> bool:
        reading = readings[product.id()]
        return bool(reading.shapes) and not reading.errors and not self.missing_items(product.id(), reading)

    def _worth(self, step_id: int, reading: Reading) -> tuple[bool, int, int]:
        return bool(reading.shapes), -len(self.missing_items(step_id, reading)), -len(reading.errors)

    def _iterate(self, products: Sequence[Entity], library: str, *, openings: bool = False) -> dict[int, Reading]:
        readings = {product.id(): Reading() for product in products}
        log = new_log()
        settings = settings_for(self._contexts, openings=openings)
        singly = self._careful or (library == THOROUGH and len(products) <= _FEW)
        for group in [[product] for product in products] if singly else [products]:
            try:
                for shape, dropped in iterate(self.file, group, library, settings, log, self._working_on):
                    _take_errors(log, readings, dropped or ([shape.id] if shape else []))
                    if shape is not None and is_body(shape.context):
                        self._take_shape(shape, readings[shape.id], (library, openings, shape.geometry.id))
            except RuntimeError as error:
                for reading in (readings[product.id()] for product in group):
                    if not reading.shapes:
                        reading.errors.append(str(error))
        _share_errors(readings)
        return readings

    def _take_shape(self, shape: Any, reading: Reading, key: tuple[str, bool, str]) -> None:
        geometry = shape.geometry
        if key not in self._known and not geometry.faces_buffer:
            return
        placement = get_shape_matrix(shape).copy()
        if not np.abs(placement).max() <= _FARTHEST:
            reading.errors.append("its placement is not finite, or out of range")
            return
        if key not in self._known:
            try:
                mesh = mesh_of(geometry)
            except GeometryError as error:
                reading.errors.append(error.message)
                return
            is_settled = key[0] == FAST and len(mesh.faces) < _LARGE
            index = self._keep(mesh if is_settled else canonical(mesh))
            self._known[key] = index, frozenset(np.frombuffer(geometry.item_ids_buffer, np.int32).tolist())
        index, items = self._known[key]
        reading.add(index, placement)
        reading.items |= items

    def _keep(self, mesh: Mesh) -> int:
        """Return the index of a mesh; equal ones are kept once, for exporters repeat openings and furniture."""
        content = mesh.vertices.tobytes(), mesh.faces.tobytes()
        if content not in self._index:
            self._index[content] = len(self.meshes)
            self.meshes.append(mesh)
        return self._index[content]

    def _read_past(self, products: Sequence[Entity]) -> dict[int, Reading]:
        """Read those of the products that have faceted or round bodies, perhaps beside others."""
        readings: dict[int, Reading] = {}
        if self._facets is None:
            return readings
        clipper = Clipper(self.file, settings_for(self._contexts))
        pipes = Pipes(clipper, self._unit_scale, angle_unit(self.file))
        bodies = Bodies(self._facets, pipes, clipper, self._solids, self._unit_scale, self._keep)
        for product in products:
            if not bodies.has_any(product):
                continue
            self._working_on(product.id())
            placed = bodies.read(product)
            if placed is None or not all(np.abs(where).max() <= _FARTHEST for _, where in placed):
                continue
            readings[product.id()] = Reading(items={item.id() for item in self._solids[product.id()]})
            for mesh, where in placed:
                readings[product.id()].add(*self._unmirrored(mesh, where))
        return readings

    def _unmirrored(self, index: int, placement: NDArray[np.float64]) -> tuple[int, NDArray[np.float64]]:
        """Mirror a mesh that its placement mirrors, so that the placement need not."""
        if np.linalg.det(placement[:3, :3]) > 0.0:
            return index, placement
        mesh = self.meshes[index]
        return self._keep(Mesh(mesh.vertices @ _MIRROR[:3, :3], mesh.faces[:, ::-1], mesh.quality)), placement @ _MIRROR

    def _clip_all(self, products: Sequence[Entity]) -> dict[int, Reading]:
        """Read those of the products that are solids minus half-spaces or other solids."""
        readings: dict[int, Reading] = {}
        chained = [p for p in products if any(item.is_a("IfcBooleanResult") for item in self._solids[p.id()])]
        clipper = Clipper(self.file, settings_for(self._contexts)) if chained else None
        for product in chained:
            self._working_on(product.id())
            with suppress(GeometryError):  # out of range: the other kernel may know better
                if clipper is not None and (reading := self._clip(product, clipper)) is not None:
                    readings[product.id()] = reading
        return readings

    def _clip(self, product: Entity, clipper: Clipper) -> Reading | None:
        items = self._solids[product.id()]
        own = [r for r in product.Representation.Representations if is_body(r.RepresentationIdentifier)]
        if any(item.is_a("IfcMappedItem") for representation in own for item in representation.Items):
            return None
        placement = clipper.matrix(product.ObjectPlacement)
        meshes = [mesh for item in items if (mesh := clipper.solid(item)) is not None and len(mesh.faces)]
        if placement is None or len(meshes) < len(items):
            return None
        reading = Reading(items={item.id() for item in items})
        for mesh in meshes:
            reading.add(self._keep(mesh), placement)
        return reading


def _take_errors(log: Any, readings: Mapping[int, Reading], suspects: Sequence[int]) -> None:
    """Move the messages of the kernel to the product they name, else to those it was working on."""
    messages = log.log_messages()
    for message in messages:
        match = _STEP_ID.match(message.product or "") or _STEP_ID.match(message.instance or "")
        named = int(match[1]) if match else 0
        for step_id in [named] if named in readings else suspects:
            readings[step_id].errors.append(" ".join(str(message.message).split()))
    if messages:
        log.clear()


def _share_errors(readings: Mapping[int, Reading]) -> None:
    """Tell the products that share a mesh with one the kernel complained about; it complains only once."""
    said = {mesh: reading.errors for reading in readings.values() if reading.errors for mesh, _ in reading.shapes}
    for reading in readings.values() if said else ():
        if not reading.errors:
            reading.errors = next((list(said[mesh]) for mesh, _ in reading.shapes if mesh in said), [])
