"""What is doubtful in a model, seen from a robot: doors that lead nowhere, islands, furniture without a class."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bimnav._gates import DoorCheck
from bimnav._placeholders import is_placeholder
from bimnav._reach import Reach
from bimnav._wording import counted
from bimnav.building import Building, Issue
from bimnav.environment import IndoorEnvironment

if TYPE_CHECKING:
    from bimnav.readiness import RoomCheck

__all__ = ["findings"]

_FURNITURE = re.compile(
    r"\b(chairs?|tables?|desks?|sofas?|couch(es)?|beds?|cabinets?|shel(f|ves|ving)|wardrobes?|bookcases?|bench(es)?"
    r"|stools?|lockers?|dressers?|refrigerators?|fridges?|stuhl|st[uü]hle|tische?|\w*schrank|\w*schr[aä]nke|sessel"
    r"|betten|bett|regale?|sillas?|mesas?|camas?|armarios?|sedi[ae]|tavol[io]|letti|letto|armadi[o]?|chaises?|lits?"
    r"|armoires?|stoel(en)?|tafels?|kast(en)?|стол|стул|кровать|шкаф|диван)\b",
    re.IGNORECASE,
)
_ROOMS_AT = {"inside": 2, "outside": 1, "nowhere": 0}
_LOOKED_AT = 40  # products whose properties are read in search of placeholders
_ZERO = "0"  # as a text; the number may be meant
_LEAST = 3  # placeholders that make a habit
_RECORDED = ("IfcFurn", "IfcFlow", "IfcDoor", "IfcSanitary", "IfcSystemFurniture", "IfcBuildingElementProxy")


def findings(
    environment: IndoorEnvironment, reach: Reach | None, rooms: Sequence[RoomCheck], doors: Sequence[DoorCheck]
) -> Iterable[Issue]:
    """Yield what is doubtful, each with GlobalIds and advice."""
    building = environment.building

    def issue(code: str, message: str, ids: Iterable[str], hint: str, severity: Any = "warning") -> Iterable[Issue]:
        found = tuple(ids)
        if found:
            yield Issue(code, counted(message, len(found)), found, severity, hint)

    yield from issue(
        "room-without-door",
        "{n} [room has|rooms have] no door or passage.",
        (room.global_id for room in rooms if room.reason == "no-door"),
        "Model the doors or openings that lead there; name shafts as such.",
    )
    yield from issue(
        "door-to-nowhere",
        "{n} [door has|doors have] no floor on either side.",
        (door.global_id for door in doors if door.leads == "nowhere"),
        "Model the rooms or slabs that they join, at the height of the doors.",
    )
    if building.spaces:
        yield from issue(
            "door-without-room",
            "{n} [door touches|doors touch] no room, or a room on one side and floor without a room on the other.",
            (door.global_id for door in doors if len(door.spaces) < _ROOMS_AT[door.leads]),
            "Model the rooms or corridors that they open to.",
            "info",
        )
    yield from issue(
        "furniture-as-proxy",
        "{n} [proxy is|proxies are] called like furniture.",
        (e.global_id for e in building.elements if e.ifc_class == "IfcBuildingElementProxy" and _is_furniture(e)),
        "Map the family to IfcFurniture, so that tasks find it by its class.",
        "info",
    )
    if reach is not None:
        yield from _islands(environment, reach)
    yield from _placeholders(building)


def _is_furniture(element: Any) -> bool:
    words = " ".join((element.name, element.type_name, element.object_type)).replace("_", " ")
    return bool(_FURNITURE.search(words))


def _islands(environment: IndoorEnvironment, reach: Reach) -> Iterable[Issue]:
    """Tell of parts of the floor that hold no room and that the robot does not reach."""
    d, (x0, y0) = reach.frame.cell_size, reach.frame.origin
    for storey in range(len(environment.levels)):
        in_rooms = {part for room in reach.rooms.values() if room.storey == storey for part in room.parts}
        for part in reach.parts_on(storey):
            if part == reach.main[storey] or part in in_rooms:
                continue
            rows, cols = np.nonzero(reach.parts[storey] == part)
            x, y = x0 + (np.median(cols) + 0.5) * d, y0 + (np.median(rows) + 0.5) * d
            regions = (region for region in environment.regions if region.storey == storey)
            under = tuple(r.global_id for r in regions if part in reach.parts_in(storey, r.polygon))
            yield Issue(
                "island",
                f"{len(rows) * d * d:.1f} m2 of floor without a room, near ({x:.1f}, {y:.1f}) on "
                f"{environment.storeys[storey].name}, cannot be reached.",
                under,
                "info",
                "If it is floor, model its room and the doors that lead there.",
            )


def _placeholders(building: Building) -> Iterable[Issue]:
    """Tell of property values that are nothing but their own name, or words for nothing, in a sample of products."""
    if building.property_reader is None:
        return
    sample = [e for e in building.elements if e.ifc_class.startswith(_RECORDED)]
    sample = sample[:: max(len(sample) // _LOOKED_AT, 1)][:_LOOKED_AT]
    examples = Counter[str]()
    found = []
    for element in sample:
        empty = list(_empty(building.properties(element.global_id)))
        examples.update(empty)
        found += [element.global_id] if len(empty) >= _LEAST else []
    if found:
        common = ", ".join(example for example, _ in examples.most_common(5))
        message = f"{len(found)} of {len(sample)} products looked at hold placeholders for data, such as {common}."
        yield Issue("placeholder-data", message, tuple(found), "info", "Fill them in or leave them out of the export.")


def _empty(sets: Mapping[str, Mapping[str, Any]]) -> Iterable[str]:
    for properties in sets.values():
        for name, value in properties.items():
            if is_placeholder(name, value) or value == _ZERO:
                yield f"{name} = {value!r}"
