"""What classes the schemas have, and what a class is taken for in a schema that lacks it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple

import ifcopenshell

from bimnav.ifc._prescan import SCHEMAS

__all__ = ["Taken", "attributes", "entities_of", "is_a", "is_void", "nearest", "products", "products_of", "taken_for"]

_RENAMED = {  # a class to what holds its elements where the schema lacks it
    "IfcBuildingElement": ("IfcBuiltElement",),
    "IfcBuiltElement": ("IfcBuildingElement",),
    "IfcDistributionBoard": ("IfcElectricDistributionBoard", "IfcElectricDistributionPoint"),
    "IfcElectricDistributionBoard": ("IfcDistributionBoard", "IfcElectricDistributionPoint"),
    "IfcElectricDistributionPoint": ("IfcElectricDistributionBoard", "IfcDistributionBoard"),
    "IfcFurniture": ("IfcFurnishingElement",),
    "IfcSpatialElement": ("IfcSpatialStructureElement",),
    "IfcTransportationDevice": ("IfcTransportElement",),
}
_CASE = re.compile(r"(Standard|Elemented)Case$")
_kernel: Any = ifcopenshell


class Taken(NamedTuple):
    """What a class is taken for in one schema.

    Parameters
    ----------
    name
        The class to look for; empty if the schema has nothing of the kind.
    by_type
        Whether it is the class of type objects that is looked for: IfcValve in IFC2X3 is what has an
        IfcValveType.
    """

    name: str
    by_type: bool = False


def taken_for(name: str, schema: str) -> Taken:
    """Return what a class of products is taken for in a schema."""
    for known in (name, _CASE.sub("", name), *_RENAMED.get(name, ())):
        if known in products_of(schema):
            return Taken(known)
    if name in products() and f"{name}Type" in entities_of(schema):
        return Taken(f"{name}Type", by_type=True)
    return Taken("")


def is_a(name: str, ancestor: str, schema: str) -> bool:
    """Tell whether a class is another one or a subtype of it."""
    return ancestor in _ancestors(name, schema)


def is_void(name: str) -> bool:
    """Tell whether a class holds voids, which are no part of any answer."""
    return any("IfcFeatureElementSubtraction" in _ancestors(name, schema) for schema in SCHEMAS)


@cache
def _declarations_of(schema: str) -> dict[str, Any]:
    declared = _kernel.schema_by_name(schema).declarations()
    return {declaration.name(): declaration for declaration in declared if declaration.as_entity()}


@cache
def entities_of(schema: str) -> frozenset[str]:
    """Return the names of all entities of a schema."""
    return frozenset(_declarations_of(schema))


@cache
def products_of(schema: str) -> frozenset[str]:
    """Return the names of IfcProduct, of all its subtypes and of its supertypes."""
    lines = [_ancestors(name, schema) for name in _declarations_of(schema)]
    return frozenset(name for line in lines if "IfcProduct" in line for name in line)


@cache
def products() -> frozenset[str]:
    """Return the names of the products of all schemas."""
    return frozenset().union(*map(products_of, SCHEMAS))


@cache
def attributes() -> frozenset[str]:
    """Return the names of the attributes of all products of all schemas."""
    return frozenset(
        attribute.name()
        for schema in SCHEMAS
        for name in products_of(schema)
        for attribute in _declarations_of(schema)[name].all_attributes()
    ) | {"PredefinedType"}


@cache
def _ancestors(name: str, schema: str) -> tuple[str, ...]:
    """Return a class and its supertypes."""
    return tuple(_climb(_declarations_of(schema).get(name)))


def _climb(declaration: Any) -> Iterator[str]:
    while declaration:
        yield declaration.name()
        declaration = declaration.supertype()


def nearest(name: str, known: Iterable[str]) -> str:
    """Return advice that names what a name may be a slip of."""
    close = difflib.get_close_matches(name, sorted(known), n=1)
    return f"Did you mean {close[0]}?" if close else "Check its spelling."
