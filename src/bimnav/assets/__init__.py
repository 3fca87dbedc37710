"""What the models say about operating and maintaining an element: its asset card, and the way of its flow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import shapely

from bimnav.assets._card import Asset, AssetCode, AssetDocument
from bimnav.assets._durations import day_after, day_of, duration_text
from bimnav.assets._facts import facts_of
from bimnav.assets._flow import Neighbor, neighbors_of
from bimnav.assets._names import field_of, rank_of, squeezed, tells_nothing
from bimnav.building import Building, Element, Space, product_of
from bimnav.errors import ModelError

__all__ = ["Asset", "AssetCode", "AssetDocument", "Neighbor", "read_asset"]

_BESIDE = 0.35  # metres; what hangs on a wall, or is sunk into the floor, lies this far outside its room
_LISTED = ("document", "system", "spare_parts")
_DURATIONS = ("warranty_duration", "service_life", "service_interval")


def read_asset(building: Building, global_id: str) -> Asset:
    """Return the asset card of an element or a room.

    Raises
    ------
    ModelError
        If nothing has this GlobalId.
    """
    product = product_of(building, global_id)
    if product is None:
        raise ModelError(
            f"no element or room of {building.name!r} has the GlobalId {global_id!r}.",
            "building.elements and building.spaces list them all; upper and lower case count.",
            {"global_id": global_id},
        )
    facts = facts_of(building, global_id)
    values, sources = _values(facts)
    spares = [(name, f"spare parts in {file}") for file, told in facts for name in told.get("spares", ())]
    spares += [(values["spare_parts"], sources["spare_parts"])] if "spare_parts" in values else []
    documents = [
        AssetDocument(row["name"], row["location"], row["identification"], file)
        for file, told in facts
        for row in told.get("documents", ())
    ]
    if "document" in values:
        documents.append(AssetDocument("", values["document"], "", sources["document"]))
    systems = [row["name"] for _, told in facts for row in told.get("systems", ()) if row["name"]]
    of_property = [part.strip() for part in values.get("system", "").split(",") if part.strip()]
    classifications = [
        AssetCode(row["system"], row["code"], row["title"], f"{_of_level(row['level'])}, {file}")
        for level in ("occurrence", "type")
        for file, told in facts
        for row in told.get("classifications", ())
        if row["level"] == level and not tells_nothing("", row["code"] or row["title"])
    ]
    filled: dict[str, Any] = {n: t for n, t in values.items() if n not in _LISTED} | neighbors_of(building, facts)
    told_by = {name: sources[name] for name in values if name not in _LISTED}
    told_by |= {"systems": sources["system"]} if of_property and not systems else {}
    told_by |= {"spare_parts": "; ".join(dict.fromkeys(source for _, source in spares))} if spares else {}
    return Asset(
        global_id,
        product.name,
        product.ifc_class,
        product.type_name,
        product.tag,
        storey=_storey_of(building, product),
        space=_room_of(building, product),
        spare_parts=tuple(dict.fromkeys(name for name, _ in spares)),
        documents=tuple(dict.fromkeys(documents)),
        systems=tuple(dict.fromkeys(systems or of_property)),
        classifications=tuple({(c.system, c.code): c for c in reversed(classifications)}.values())[::-1],
        **filled,
        sources=MappingProxyType(told_by),
        building=building,
    )


def _of_level(level: str) -> str:
    return "of the type" if level == "type" else "of the element"


def _values(facts: Sequence[tuple[str, Mapping[str, Any]]]) -> tuple[dict[str, str], dict[str, str]]:
    """Choose the value of every field, and say where it comes from."""
    found: dict[str, list[tuple[tuple[bool, int, int], str, str]]] = {}
    for number, (file, told) in enumerate(facts):
        rows = told.get("properties", ())
        siblings = {(row["set"], row["name"].casefold()): row["value"] for row in rows}
        for row in rows:
            name, value = row["name"], row["value"]
            known = field_of(name)
            if known is None or tells_nothing(name, value):
                continue
            is_type = row["level"] == "type" or "type" in row["set"].casefold().replace("_", " ").split()
            is_type = is_type or "(type)" in row["set"].casefold() or "cobietype" in squeezed(name)
            text, doubt = _text(known, row, siblings)
            if text:
                where = f"{row['set']}.{name} {_of_level('type' if is_type else 'occurrence')}{doubt}, {file}"
                found.setdefault(known, []).append(((is_type, rank_of(name), number), text, where))
    best = {name: min(rows, key=lambda row: row[0]) for name, rows in found.items()}
    values = {name: text for name, (_, text, _) in best.items()}
    sources = {name: where for name, (_, _, where) in best.items()}
    _add_tasks(facts, values, sources)
    _add_warranty_end(values, sources)
    contacts = {mail: name for _, told in facts for mail, name in told.get("contacts", {}).items()}
    for name in ("maker", "warranty_guarantor"):
        contact = contacts.get(values.get(name, ""), "")
        if contact and not tells_nothing("Name", contact):
            values[name] += f" ({contact})"
    return values, sources


def _text(known: str, row: Mapping[str, Any], siblings: Mapping[tuple[str, str], Any]) -> tuple[str, str]:
    """Return a value as text, and what is doubtful about it."""
    value = row["value"]
    if row["measure"] == "IfcTimeStamp" and isinstance(value, int):
        return datetime.fromtimestamp(value, UTC).strftime("%Y-%m-%d"), ""
    if known not in _DURATIONS:
        return (f"{value:g}" if isinstance(value, float) else str(value).strip()), ""
    return duration_text(row, siblings)


def _add_tasks(facts: Sequence[tuple[str, Mapping[str, Any]]], values: dict[str, str], sources: dict[str, str]) -> None:
    """Take last and next service from the tasks of the model, if no property tells."""
    tasks = [(task, file) for file, told in facts for task in told.get("tasks", ())]
    done = [(task["finish"], task["name"], file) for task, file in tasks if task["is_done"] and task["finish"]]
    due = [(task["start"], task["name"], file) for task, file in tasks if not task["is_done"] and task["start"]]
    for name, found in (("last_service", max(done, default=None)), ("next_service", min(due, default=None))):
        if found and name not in values:
            values[name] = found[0]
            sources[name] = f"task {found[1]!r}, {found[2]}"


def _add_warranty_end(values: dict[str, str], sources: dict[str, str]) -> None:
    start = day_of(values.get("warranty_start", ""))
    if "warranty_end" in values or start is None:
        return
    end = day_after(start, values.get("warranty_duration", ""))
    if end is None:
        return
    values["warranty_end"] = end.isoformat()
    sources["warranty_end"] = "warranty_start and warranty_duration"


def _storey_of(building: Building, product: Element | Space) -> str:
    """Return the name of the storey that the file says, else of the highest one below the element."""
    stated = next((storey.name for storey in building.storeys if storey.global_id == product.storey), "")
    if stated or product.bounds is None:
        return stated
    low = float(product.bounds[0, 2]) + _BESIDE
    return next((storey.name for storey in reversed(building.storeys) if storey.elevation <= low), "")


def _room_of(building: Building, product: Element | Space) -> str:
    """Return the label of the room that the file says, else of the one where the middle of the element lies."""
    from bimnav.footprint import outline

    if isinstance(product, Space):
        return product.label
    stated = next((space.label for space in building.spaces if space.global_id == product.space), "")
    if stated or product.bounds is None:
        return stated
    x, y, z = product.bounds.mean(axis=0).tolist()
    point, near = shapely.Point(x, y), []
    for space in building.spaces:
        box = space.bounds
        if box is None or not (box[0, 2] - _BESIDE <= z <= box[1, 2] + _BESIDE):
            continue
        if box[0, 0] - _BESIDE <= x <= box[1, 0] + _BESIDE and box[0, 1] - _BESIDE <= y <= box[1, 1] + _BESIDE:
            away = outline(space.shapes).distance(point)
            near.append((away, not box[0, 2] <= z <= box[1, 2], space.label))
    best = min(near, default=(_BESIDE + 1, False, ""))
    return best[2] if best[0] <= _BESIDE else ""
