"""The door to ifcopenshell's geometry kernels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import numpy as np
from ifcopenshell.util.shape import get_faces, get_vertices
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.errors import GeometryError

__all__ = [
    "FAST",
    "THOROUGH",
    "Entity",
    "File",
    "attribute",
    "check_size",
    "is_kind",
    "iterate",
    "mesh_of",
    "new_log",
    "one_by_one",
    "settings_for",
    "written",
]

Entity = Any  # an ifcopenshell.entity_instance; what attributes it has depends on its class
File = Any  # an ifcopenshell.file

FAST = "cgal-simple"  # 5 to 30 times faster than OpenCASCADE, but knows neither booleans nor revolved solids
THOROUGH = "opencascade"
_LARGEST = 1e5  # metres; no product of a building is longer than 100 km

_ABSENT, _ELSEWHERE = -1, -2  # instead of a place: there is none of that name; it is derived, or leads back
_PLACES: dict[tuple[str, str], int] = {}  # schema with class, and attribute
_KINDS: dict[tuple[str, str], bool] = {}  # schema with class, and another class

_ifc: Any = ifcopenshell
_geom: Any = ifcopenshell.geom


def attribute(entity: Entity, name: str) -> Any:
    """Return an attribute of an entity as `getattr` does, but find out only once where it stands in a class."""
    stands = _place_of(entity, name)
    return entity.get_argument(stands) if stands >= 0 else getattr(entity, name)


def written(entity: Entity, name: str) -> Any:
    """Return an attribute of an entity; None if its class has none of that name."""
    stands = _place_of(entity, name)
    return entity.get_argument(stands) if stands >= 0 else None if stands == _ABSENT else getattr(entity, name, None)


def _place_of(entity: Entity, name: str) -> int:
    key = entity.is_a(True), name
    if key not in _PLACES:
        category = entity.get_attribute_category(name)
        _PLACES[key] = entity.get_argument_index(name) if category == 1 else _ABSENT if category == 0 else _ELSEWHERE
    return _PLACES[key]


def is_kind(entity: Entity, name: str) -> bool:
    """Tell as `is_a` does whether an entity is of a class, but find out only once for all of its own class."""
    key = entity.is_a(True), name
    if key not in _KINDS:
        _KINDS[key] = bool(entity.is_a(name))
    return _KINDS[key]


def new_log() -> Any:
    """Return a log of errors that stays in memory."""
    log = _ifc.logger()
    log.output_format(log.FMT_INMEMORY)
    log.verbosity(log.LOG_ERROR)
    return log


def settings_for(contexts: Iterable[int], *, openings: bool = False) -> Any:
    """Return settings for un-cut solids, or for solids with openings cut, of representation contexts."""
    settings = _geom.settings()
    settings.set("disable-opening-subtractions", not openings)
    settings.set("no-normals", True)
    settings.set("apply-default-materials", False)
    settings.set("context-ids", sorted(contexts))
    settings.set("no-wire-intersection-check", not openings)  # more than half of OpenCASCADE's time
    return settings


def iterate(
    file: File, products: Sequence[Entity], library: str, settings: Any, log: Any, working_on: Callable[[int], None]
) -> Iterator[tuple[Any, list[int]]]:
    """Yield the shapes of products, each with the step ids of the products that gave none just before it.

    One product may have several shapes. The last of what is yielded has no shape, only the rest of those
    without. `working_on` is called with the step id of the product that the kernel takes up next; 0 while it
    takes up all of several.
    """
    if not products:
        return
    working_on(products[0].id() if len(products) == 1 else 0)
    threads = 1  # more of them poll, and abort the process when an exception leaves the loop
    iterator = _geom.iterator(settings, file, threads, include=list(products), geometry_library=library, logger=log)
    found = iterator.initialize()
    tasks = _ifc.ifcopenshell_wrapper.iterator.get_task_products(iterator) if found else [products]
    queue = [step_id for step_id, _ in groupby(product.id() for task in tasks for product in task)]
    following = 0
    working_on(queue[0])
    while found:
        shape = iterator.get()
        before = following
        if following == 0 or queue[following - 1] != shape.id:  # not a second body of the same product
            with suppress(ValueError):
                following = queue.index(shape.id, following) + 1
        yield shape, queue[before : following - 1]
        if following < len(queue):
            working_on(queue[following])
        found = iterator.next()
    yield None, queue[following:]


def one_by_one(file: File, settings: Any, log: Any) -> Any:
    """Return a fast kernel whose `create_shape` takes single items and placements."""
    return _geom.kernel(settings, file, FAST, logger=log)


def mesh_of(geometry: Any) -> Mesh:
    """Copy the triangles of a kernel.

    Raises
    ------
    GeometryError
        If they are not finite, or larger than any building.
    """
    vertices = get_vertices(geometry)
    check_size(vertices)
    return Mesh(vertices, get_faces(geometry))


def check_size(vertices: NDArray[np.float64]) -> None:
    """Refuse a body, (n, 3) metres, that is larger than any building.

    Raises
    ------
    GeometryError
        If it is.
    """
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    if size > _LARGEST:
        raise GeometryError(f"its body is {size:.6g} m long.")
