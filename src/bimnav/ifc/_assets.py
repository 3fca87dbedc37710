"""What a file says about operating and maintaining a product: properties, systems, ports, documents, tasks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ifcopenshell.util.element import get_type

from bimnav.ifc._facts import classified_as
from bimnav.ifc._products import sorted_of
from bimnav.ifc._semantics import text_of

__all__ = ["AssetIndex"]

_NO_SYSTEMS = ("IfcZone", "IfcStructuralAnalysisModel", "IfcSpatialZone")
_OPPOSITE = {"SOURCE": "SINK", "SINK": "SOURCE"}
_type_of: Any = get_type


class AssetIndex:
    """Answers what a file says about an asset; its relations are walked once.

    Parameters
    ----------
    file
        The opened model.
    ids
        Step id to GlobalId of every product there is an answer about.
    """

    def __init__(self, file: Any, ids: Mapping[int, str]) -> None:
        self._file, self._ids = file, ids
        self._step_of = {global_id: step_id for step_id, global_id in reversed(list(ids.items()))}
        self._neighbors = _neighbors(file, ids)
        self._groups = _grouped(file)
        self._contacts = _contacts(file)
        self._known: dict[str, dict[str, Any]] = {}
        self._related: dict[str, dict[int, list[Any]]] = {
            "classification": _many(file, "IfcRelAssociatesClassification", "RelatedObjects", "RelatingClassification"),
            "document": _many(file, "IfcRelAssociatesDocument", "RelatedObjects", "RelatingDocument"),
            "task": _many(file, "IfcRelAssignsToProcess", "RelatedObjects", "RelatingProcess"),
            "resource": _many(file, "IfcRelAssignsToResource", "RelatedObjects", "RelatingResource"),
        }
        for relation in sorted_of(file, "IfcRelAssignsToProduct"):
            if relation.RelatingProduct is not None:
                for each in relation.RelatedObjects or ():
                    kind = "task" if each.is_a("IfcTask") else "resource" if each.is_a("IfcResource") else None
                    if kind:
                        self._related[kind].setdefault(relation.RelatingProduct.id(), []).append(each)

    def facts(self, global_id: str) -> dict[str, Any]:
        """Return plain values about a product; empty if the file does not have it.

        Returns
        -------
        facts
            - `type_class`: class of its type object, or empty
            - `properties`: `[{level, set, name, value, measure, unit, description}]`, level `occurrence` or `type`
            - `systems`: `[{global_id, name}]`
            - `upstream`, `downstream`, `connected`: GlobalIds of neighbors; the last without known direction
            - `classifications`: `[{system, code, title, level}]`
            - `documents`: `[{name, location, identification}]`
            - `tasks`: `[{name, start, finish, is_done}]`
            - `spares`: names
            - `contacts`: e-mail address to organization
        """
        if global_id not in self._known:
            self._known[global_id] = self._facts(global_id)
        return self._known[global_id]

    def _facts(self, global_id: str) -> dict[str, Any]:
        step_id = self._step_of.get(global_id)
        if step_id is None:
            return {}
        product = self._file.by_id(step_id)
        kind = _type_of(product)
        levels = [("occurrence", product)] + ([("type", kind)] if kind is not None else [])
        return {
            "type_class": kind.is_a() if kind is not None else "",
            "properties": [row for level, owner in levels for row in _properties(owner, level)]
            + [row for group in self._groups.get(step_id, ()) if group.is_a("IfcAsset") for row in _of_asset(group)],
            "systems": [
                {"global_id": text_of(group.GlobalId), "name": text_of(group.Name)}
                for group in self._groups.get(step_id, ())
                if group.is_a("IfcSystem") and not any(group.is_a(name) for name in _NO_SYSTEMS)
            ],
            **self._neighbors.get(step_id, {"upstream": [], "downstream": [], "connected": []}),
            "classifications": [
                {"system": found.system, "code": found.code, "title": found.title, "level": level}
                for level, owner in levels
                for reference in self._of("classification", owner)
                if (found := classified_as(reference)).code or found.title
            ],
            "documents": [
                row
                for _, owner in levels
                for document in self._of("document", owner)
                if any((row := _document(document)).values())
            ],
            "tasks": [_task(task) for _, owner in levels for task in self._of("task", owner) if task.is_a("IfcTask")],
            "spares": [
                text_of(each.Name)
                for _, owner in levels
                for each in self._of("resource", owner)
                if each.is_a("IfcConstructionProductResource") and each.Name
            ],
            "contacts": self._contacts,
        }

    def _of(self, kind: str, owner: Any) -> list[Any]:
        return self._related[kind].get(owner.id(), [])


def _contacts(file: Any) -> dict[str, str]:
    found: dict[str, str] = {}
    for person in sorted_of(file, "IfcPersonAndOrganization"):
        name = text_of(person.TheOrganization.Name) if person.TheOrganization is not None else ""
        for actor in (person.ThePerson, person.TheOrganization):
            for address in getattr(actor, "Addresses", None) or ():
                for mail in getattr(address, "ElectronicMailAddresses", None) or ():
                    found.setdefault(str(mail), name)
    return {mail: name for mail, name in found.items() if name}


def _many(file: Any, relation: str, many: str, one: str) -> dict[int, list[Any]]:
    """Return, by step id, what a relation says of each of its many objects."""
    found: dict[int, list[Any]] = defaultdict(list)
    for each in sorted_of(file, relation):
        value = getattr(each, one, None)
        for related in getattr(each, many, None) or ():
            if related is not None and value is not None:
                found[related.id()].append(value)
    return dict(found)


def _grouped(file: Any) -> dict[int, list[Any]]:
    groups = _many(file, "IfcRelAssignsToGroup", "RelatedObjects", "RelatingGroup")
    return {step_id: list({group.id(): group for group in listed}.values()) for step_id, listed in groups.items()}


def _neighbors(file: Any, ids: Mapping[int, str]) -> dict[int, dict[str, list[str]]]:
    """Return, by step id, the GlobalIds of what is connected to each product, by the direction of the flow.

    Ports belong to elements by a relation of their own, or are nested in them. A port that is a source
    lets the flow out of its element; where both ports are silent or contradict each other the direction
    is not known.
    """
    owner: dict[int, int] = {}
    for relation in sorted_of(file, "IfcRelConnectsPortToElement"):
        if relation.RelatingPort is not None and relation.RelatedElement is not None:
            owner.setdefault(relation.RelatingPort.id(), relation.RelatedElement.id())
    for relation in sorted_of(file, "IfcRelNests"):
        for part in relation.RelatedObjects or ():
            if part is not None and part.is_a("IfcPort") and relation.RelatingObject is not None:
                owner.setdefault(part.id(), relation.RelatingObject.id())
    found: dict[int, dict[str, dict[str, None]]] = defaultdict(
        lambda: {"upstream": {}, "downstream": {}, "connected": {}}
    )

    def join(a: int | None, b: int | None, direction: str) -> None:
        if a in ids and b in ids and a != b and a is not None and b is not None:
            found[a][direction][ids[b]] = None

    back = {"upstream": "downstream", "downstream": "upstream", "connected": "connected"}
    for relation in sorted_of(file, "IfcRelConnectsPorts"):
        one, other = relation.RelatingPort, relation.RelatedPort
        if one is None or other is None:
            continue
        direction = _direction(one, other)
        join(owner.get(one.id()), owner.get(other.id()), direction)
        join(owner.get(other.id()), owner.get(one.id()), back[direction])
    for relation in sorted_of(file, "IfcRelFlowControlElements"):
        if relation.RelatingFlowElement is not None:
            for control in relation.RelatedControlElements or ():
                join(control.id(), relation.RelatingFlowElement.id(), "connected")
                join(relation.RelatingFlowElement.id(), control.id(), "connected")
    return {step_id: {key: list(each) for key, each in table.items()} for step_id, table in found.items()}


def _direction(one: Any, other: Any) -> str:
    """Say where the other port's element lies, seen from the first one's: flow leaves an element at a source."""
    own = getattr(one, "FlowDirection", None)
    hers = getattr(other, "FlowDirection", None)
    stated = {flow for flow in (own, _OPPOSITE.get(str(hers))) if flow in _OPPOSITE}
    return {"SOURCE": "downstream", "SINK": "upstream"}[stated.pop()] if len(stated) == 1 else "connected"


def _properties(owner: Any, level: str) -> Iterator[dict[str, Any]]:
    """Yield the properties of a product or of a type object, as plain values."""
    if level == "type":
        sets: Iterable[Any] = owner.HasPropertySets or ()
    else:
        related = getattr(owner, "IsDefinedBy", None) or ()
        given = (getattr(relation, "RelatingPropertyDefinition", None) for relation in related)
        sets = (
            each for definition in given for each in (definition if isinstance(definition, tuple) else [definition])
        )
    for pset in sets:
        for prop in getattr(pset, "HasProperties", None) or ():
            yield from _property(prop, text_of(pset.Name).strip(), level)


def _property(prop: Any, pset: str, level: str, depth: int = 0) -> Iterator[dict[str, Any]]:
    nominal, measure = getattr(prop, "NominalValue", None), ""
    if prop.is_a("IfcComplexProperty") and depth < 8:
        for inner in prop.HasProperties or ():
            yield from _property(inner, pset, level, depth + 1)
        return
    if nominal is not None:
        value, measure = nominal.wrappedValue, nominal.is_a()
    else:
        several = getattr(prop, "EnumerationValues", None) or getattr(prop, "ListValues", None) or ()
        value = ", ".join(str(each.wrappedValue) for each in several)
    if value is None or value == "":
        return
    if not isinstance(value, (str, int, float, bool)):
        value = str(value)
    yield {
        "level": level,
        "set": pset,
        "name": text_of(prop.Name).strip(),
        "value": value,
        "measure": measure,
        "unit": _unit(getattr(prop, "Unit", None)),
        "description": text_of(prop.Description),
    }


def _unit(unit: Any) -> str:
    if unit is None:
        return ""
    return (text_of(getattr(unit, "Prefix", None)) + text_of(getattr(unit, "Name", None))).casefold()


def _of_asset(asset: Any) -> Iterator[dict[str, Any]]:
    """Yield what a group of class IfcAsset says, in the manner of properties."""
    stated = {
        "AssetIdentifier": getattr(asset, "Identification", None) or getattr(asset, "AssetID", None),
        "IncorporationDate": getattr(asset, "IncorporationDate", None),
    }
    for name, value in stated.items():
        if isinstance(value, str) and value:
            row = {"level": "occurrence", "set": "IfcAsset", "name": name, "value": value}
            yield row | {"measure": "", "unit": "", "description": ""}


def _document(document: Any) -> dict[str, str]:
    about = getattr(document, "ReferencedDocument", None) or document
    inner = next(iter(getattr(document, "DocumentReferences", None) or ()), None)

    def first(*names: str) -> str:
        values = (text_of(getattr(one, name, None)) for name in names for one in (document, about, inner))
        return next((value for value in values if value), "")

    return {
        "name": first("Name", "Description"),
        "location": first("Location"),
        "identification": first("Identification", "DocumentId", "ItemReference"),
    }


def _task(task: Any) -> dict[str, Any]:
    time = getattr(task, "TaskTime", None)
    finish = text_of(getattr(time, "ActualFinish", None))
    status = text_of(getattr(task, "Status", None)).casefold()
    return {
        "name": text_of(task.Name),
        "start": text_of(getattr(time, "ScheduleStart", None)),
        "finish": finish,
        "is_done": bool(finish) or status in ("completed", "finished", "done", "closed"),
    }
