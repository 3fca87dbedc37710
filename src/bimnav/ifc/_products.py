"""Which products there are, who they are, and what their bodies consist of."""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Iterable, Sequence
from typing import Any

import ifcopenshell.guid

from bimnav.ifc._kernel import Entity, File, attribute

__all__ = [
    "BodyFinder",
    "derived_id",
    "identify",
    "is_body",
    "is_global_id",
    "is_terrain",
    "left_out_by_class",
    "sanitize",
    "sorted_of",
]

_RULES = {
    "annotation": ("IfcAnnotation",),
    "grid": ("IfcGrid",),
    "port": ("IfcPort",),
    "site": ("IfcSite",),
    "spatial-structure": (
        "IfcBuilding",
        "IfcBuildingStorey",
        "IfcExternalSpatialStructureElement",
        "IfcFacility",
        "IfcFacilityPart",
        "IfcSpatialZone",
    ),
    "virtual-element": ("IfcVirtualElement",),
    "structural-analysis": ("IfcStructuralActivity", "IfcStructuralItem"),
    "alignment": ("IfcLinearElement", "IfcPositioningElement"),
    "surface-feature": ("IfcSurfaceFeature",),
}
_NO_BODY = frozenset(
    [
        "annotation",
        "axis",
        "boundary",
        "box",
        "clearance",
        "cog",
        "footprint",
        "lighting",
        "plan",
        "profile",
        "reference",
        "surveypoints",
        "walkingline",
    ]
)
_OF_SOLIDS = frozenset(
    [
        "advancedbrep",
        "advancedsweptsolid",
        "brep",
        "clipping",
        "csg",
        "solidmodel",
        "surfacemodel",
        "sweptsolid",
        "tessellation",
    ]
)
_SOLIDS = (
    "IfcSolidModel",
    "IfcBooleanResult",
    "IfcTessellatedItem",
    "IfcFaceBasedSurfaceModel",
    "IfcShellBasedSurfaceModel",
    "IfcCsgPrimitive3D",
    "IfcSurface",
    "IfcSectionedSpine",
)
_TERRAIN = ("site", "terrain")  # rules; what they leave out is ground
_GLOBAL_ID = re.compile(r"[0-9A-Za-z_$]{22}")


def sorted_of(file: File, *classes: str) -> list[Entity]:
    """Return all instances of classes in the order of their step ids; none of a class the schema lacks."""
    found: dict[int, Entity] = {}
    for name in classes:
        try:
            found |= {entity.id(): entity for entity in file.by_type(name)}
        except RuntimeError:  # the schema has no such class
            continue
    return [found[key] for key in sorted(found)]


def sanitize(products: Iterable[Entity]) -> list[Entity]:
    """Empty the text attributes that are written as `*`; return the products that had any.

    Renga writes them so; the geometry kernel then drops the product without a word.
    """
    starred = []
    for product in products:
        if "*" not in str(product):
            continue
        stars = [name for name in ("Name", "Description", "ObjectType", "Tag") if getattr(product, name, "") is None]
        for name in stars:
            setattr(product, name, None)
        if stars:
            starred.append(product)
    return starred


def derived_id(text: str) -> str:
    """Return the GlobalId that follows from a text: the same in every run."""
    return str(ifcopenshell.guid.compress(uuid.uuid5(uuid.NAMESPACE_OID, f"bimnav {text}").hex))


def identify(products: Sequence[Entity]) -> tuple[dict[int, str], list[int]]:
    """Give every product a GlobalId of its own.

    The first product keeps an id that several share; the others, and those whose id is not 22 characters
    of the IFC alphabet, get one that follows from their class, their step id and the ids of the others.

    Returns
    -------
    ids
        Step id to GlobalId.
    renamed
        Step ids of the products that got another GlobalId than the file gives.
    """
    ids: dict[int, str] = {}
    for product in products:
        written = str(attribute(product, "GlobalId"))
        if is_global_id(written):
            ids.setdefault(product.id(), written)
    first: dict[str, int] = {}
    for step_id, written in ids.items():
        first.setdefault(written, step_id)
    renamed = []
    file_mark = hashlib.sha256("".join(first).encode()).hexdigest()  # so that no other file derives the same
    for product in products:
        step_id = product.id()
        if first.get(ids.get(step_id, "")) == step_id:
            continue
        text = f"{product.is_a()} #{step_id} of {file_mark}"
        while (new := derived_id(text)) in first:
            text += "'"
        first[new] = step_id
        ids[step_id] = new
        renamed.append(step_id)
    return ids, renamed


def is_global_id(text: str) -> bool:
    """Tell whether a text is 22 characters of the IFC alphabet."""
    return _GLOBAL_ID.fullmatch(text) is not None


def left_out_by_class(file: File) -> dict[int, str]:
    """Return step id to rule of all products whose class is no part of the building's body."""
    rules: dict[int, str] = {}
    for rule, classes in _RULES.items():
        for product in sorted_of(file, *classes):
            rules.setdefault(product.id(), rule)
    for product in sorted_of(file, "IfcGeographicElement"):
        if product.PredefinedType == "TERRAIN":
            rules.setdefault(product.id(), "terrain")
    return rules


def is_terrain(rule: str | None) -> bool:
    """Tell whether what a rule leaves out is ground to walk on, outdoors."""
    return rule in _TERRAIN


def is_body(identifier: str | None) -> bool:
    """Tell whether a representation of this name is a body, as opposed to an axis, a box or a plan symbol."""
    return (identifier or "").casefold() not in _NO_BODY


class BodyFinder:
    """Finds what the bodies of products consist of; a mapped representation is looked into once."""

    def __init__(self) -> None:
        self._mapped: dict[int, dict[int, Entity]] = {}
        self._sources: dict[int, int] = {}  # a map to what it maps
        self._is_solid: dict[str, bool] = {}  # by class: `is_a` is too slow to ask for every item

    def solids_of(self, product: Entity) -> tuple[list[Entity], set[int]]:
        """Return the solids and surfaces of a product's bodies, and the step ids of the contexts they are in.

        Raises
        ------
        AttributeError, RuntimeError, TypeError
            If its representation is empty, or holds something else than shapes or than it says.
        """
        solids: dict[int, Entity] = {}
        contexts: set[int] = set()
        for representation in _some(attribute(attribute(product, "Representation"), "Representations")):
            if is_body(attribute(representation, "RepresentationIdentifier")):
                found = self._solid_items(representation)
                solids |= found
                if found and (context := attribute(representation, "ContextOfItems")) is not None:
                    contexts.add(context.id())
        return list(solids.values()), contexts

    def _solid_items(self, representation: Entity) -> dict[int, Entity]:
        found: dict[int, Entity] = {}
        for item in _some(attribute(representation, "Items")):
            name = item.is_a()
            if name == "IfcMappedItem":
                found |= self._items_of(attribute(item, "MappingSource"))
                continue
            if name not in self._is_solid:
                if not item.is_a("IfcRepresentationItem"):
                    raise TypeError(f"{name} is no shape")
                self._is_solid[name] = any(item.is_a(solid) for solid in _SOLIDS)
            if self._is_solid[name]:
                found[item.id()] = item
        if not found and str(representation.RepresentationType).casefold() in _OF_SOLIDS:
            raise TypeError(f"{representation.RepresentationType} without a solid")
        return found

    def _items_of(self, mapped: Entity) -> dict[int, Entity]:
        step_id = mapped.id()
        if step_id not in self._sources:
            source = mapped.MappedRepresentation
            if source.id() not in self._mapped:
                self._mapped[source.id()] = self._solid_items(source)
            self._sources[step_id] = source.id()
        return self._mapped[self._sources[step_id]]


def _some(items: Any) -> tuple[Entity, ...]:
    """Return the members of a list that may not be empty."""
    if not isinstance(items, tuple) or not items:
        raise TypeError(f"{items!r:.50} where shapes should be")
    return items
