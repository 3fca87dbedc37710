"""What a file says of a product beside names and geometry: properties, classifications, systems."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from ifcopenshell.util.element import get_psets, get_type

from bimnav.building import Classification, Facts
from bimnav.ifc._query import plain
from bimnav.ifc._semantics import text_of

__all__ = ["FactsReader", "classified_as"]

_type_of: Any = get_type


class FactsReader:
    """Reads the facts of products of one file; what many share, such as a type, is read once."""

    def __init__(self) -> None:
        self._of_types: dict[int, tuple[dict[str, dict[str, Any]], tuple[Classification, ...]]] = {}

    def __call__(self, product: Any) -> Facts:
        """Return the facts of a product."""
        kind = _type_of(product)
        of_type, references = ({}, ()) if kind is None or kind == product else self._of_type(kind)
        own = _references(product)
        return Facts(
            _sets(product),
            of_type,
            tuple(dict.fromkeys((*own, *references))),
            tuple(dict.fromkeys(_system_names(product))),
        )

    def _of_type(self, kind: Any) -> tuple[dict[str, dict[str, Any]], tuple[Classification, ...]]:
        if kind.id() not in self._of_types:
            self._of_types[kind.id()] = _sets(kind), tuple(_references(kind))
        return self._of_types[kind.id()]


def _sets(entity: Any) -> dict[str, dict[str, Any]]:
    sets: dict[str, dict[str, Any]] = plain(get_psets(entity, should_inherit=False))
    return sets


def _references(entity: Any) -> Iterable[Classification]:
    relations = getattr(entity, "HasAssociations", None) or ()
    found = [r.RelatingClassification for r in relations if r.is_a("IfcRelAssociatesClassification")]
    return [classified_as(reference) for reference in found if reference is not None]


def classified_as(reference: Any) -> Classification:
    """Return what a reference to a classification says."""
    if reference.is_a("IfcClassificationNotation"):  # IFC2X3: a code in facets, of no named system
        return Classification("", " ".join(text_of(facet.NotationValue) for facet in reference.NotationFacets))
    if reference.is_a("IfcClassification"):
        return Classification(text_of(reference.Name), "")
    code = getattr(reference, "Identification", None) or getattr(reference, "ItemReference", None)
    return Classification(_system_of(reference), text_of(code).strip(), text_of(reference.Name).strip())


def _system_of(reference: Any) -> str:
    """Climb from a reference to the name of its classification; references may refer to references."""
    seen = set()
    while reference is not None and reference.id() not in seen:
        seen.add(reference.id())
        if reference.is_a("IfcClassification"):
            return text_of(reference.Name) or text_of(reference.Source)
        reference = getattr(reference, "ReferencedSource", None)
    return ""


def _system_names(product: Any) -> Iterator[str]:
    """Yield the names of the systems of a product and of those that hold them."""
    pending, seen = [product], set()
    while pending:
        member = pending.pop(0)
        for relation in getattr(member, "HasAssignments", None) or ():
            group = relation.RelatingGroup if relation.is_a("IfcRelAssignsToGroup") else None
            if group is None or group.id() in seen or not group.is_a("IfcSystem") or group.is_a("IfcZone"):
                continue
            seen.add(group.id())
            pending.append(group)
            for field in ("Name", "LongName", "ObjectType", "PredefinedType"):
                name = getattr(group, field, None)
                if name and name not in ("NOTDEFINED", "USERDEFINED"):
                    yield str(name)
