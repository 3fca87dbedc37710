"""The way of the flow: what is connected through ports, and walks along it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from bimnav.assets._facts import facts_of
from bimnav.building import Building
from bimnav.tasks._words import haystack, needle

__all__ = ["Neighbor", "find_along", "neighbors_of"]

_FARTHEST = 10_000  # elements; a walk along the flow that is longer goes in circles through a whole city
_KINDS = {  # classes and their types, and words met in names
    "valve": (
        "IfcValve",
        """valve ventil absperrventil kugelhahn schieber hahn afsluiter klep kraan vanne robinet valvola valvula
        вентиль клапан задвижка バルブ 阀""",
    ),
    "breaker": (
        "IfcProtectiveDevice",
        """breaker fuse sicherung leitungsschutzschalter zekering disjoncteur fusible interruttore автомат
        предохранитель ブレーカー 断路器""",
    ),
    "pump": ("IfcPump", "pump pumpe pomp pompe pompa bomba насос ポンプ 泵"),
    "damper": ("IfcDamper", "damper brandschutzklappe klappe brandklep clapet serranda compuerta заслонка"),
    "switch": ("IfcSwitchingDevice", "switch schalter schakelaar interrupteur interruptor выключатель 开关"),
    "panel": (
        "IfcElectricDistributionBoard IfcElectricDistributionPoint IfcDistributionBoard",
        "panelboard verteiler schaltschrank groepenkast tableau quadro щит 分電盤 配电箱",
    ),
}


class Neighbor(NamedTuple):
    """An element connected through ports."""

    global_id: str
    name: str
    ifc_class: str


def neighbors_of(building: Building, facts: Sequence[tuple[str, Mapping[str, Any]]]) -> dict[str, tuple[Neighbor, ...]]:
    """Return the neighbors that the files name, by which way they lie."""
    found: dict[str, tuple[Neighbor, ...]] = {}
    for way in ("upstream", "downstream", "connected"):
        ids = dict.fromkeys(global_id for _, told in facts for global_id in told.get(way, ()))
        found[way] = tuple(_neighbor(building, global_id) for global_id in ids)
    return found


def _neighbor(building: Building, global_id: str) -> Neighbor:
    if global_id not in building:
        return Neighbor(global_id, "", "")
    element = building[global_id]
    return Neighbor(global_id, element.name, element.ifc_class)


def find_along(building: Building, start: str, way: str, kind: str) -> tuple[Neighbor, ...]:
    """Walk along the flow, breadth first, to the first element of a kind."""
    is_it = _test_of(building, kind)
    before: dict[str, str] = {start: ""}
    waiting = [start]
    for here in waiting:
        facts = facts_of(building, here)
        steps = [g for _, told in facts for g in told.get(way, ())]
        steps += [g for _, told in facts for g in told.get("connected", ())]
        for there in steps:
            if there in before or len(before) > _FARTHEST:
                continue
            before[there] = here
            if is_it(there):
                return tuple(_neighbor(building, global_id) for global_id in _trail(before, there))
            waiting.append(there)
    return ()


def _trail(before: Mapping[str, str], end: str) -> list[str]:
    trail = [end]
    while before[trail[-1]] and before[before[trail[-1]]]:
        trail.append(before[trail[-1]])
    return trail[::-1]


def _test_of(building: Building, kind: str) -> Callable[[str], bool]:
    named, words = _KINDS.get(kind.casefold(), (kind, ""))
    classes = {each for name in named.split() for each in (name, f"{name}Type")}
    sought = [needle(word) for word in words.split() or [kind]]

    def is_it(global_id: str) -> bool:
        if global_id not in building:
            return False
        element = building[global_id]
        if element.ifc_class in classes:
            return True
        if any(told.get("type_class") in classes for _, told in facts_of(building, global_id)):
            return True
        texts: Iterable[str] = (element.name, element.type_name, element.object_type)
        return any(word in haystack(text) for text in texts if text for word in sought)

    return is_it
