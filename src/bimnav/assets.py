"""What the models say about operating and maintaining an element: its asset card, and the way of its flow."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, date, datetime
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import shapely

from bimnav._asset_names import field_of, rank_of, tells_nothing
from bimnav.building import Building, Element, Space
from bimnav.errors import ModelError
from bimnav.tasks._words import haystack, needle

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Asset", "AssetCode", "AssetDocument", "Neighbor", "read_asset"]

_FARTHEST = 10_000  # elements; a walk along the flow that is longer goes in circles through a whole city
_BESIDE = 0.35  # metres; what hangs on a wall, or is sunk into the floor, lies this far outside its room
_YEAR, _MONTH = 365.25, 30.4375  # days
_UNITS = {"years": _YEAR, "months": _MONTH, "weeks": 7.0, "days": 1.0, "hours": 1 / 24, "seconds": 1 / 86400}
_UNIT_WORDS = {
    word: unit
    for unit, words in {
        "years": "year years yr yrs y a jahr jahre jahren jaar ans annees anni anos лет года 年",
        "months": "month months mo monat monate monaten maand maanden mois mesi meses месяцев ヶ月 月",
        "weeks": "week weeks woche wochen weken",
        "days": "day days d tag tage tagen dag dagen jours giorni dias дней 日",
        "hours": "hour hours h hr hrs stunde stunden uur heures ore horas часов",
        "seconds": "second seconds s sec",
    }.items()
    for word in words.split()
}
_NUMBER = re.compile(r"\s*(\d+(?:[.,]\d+)?)\s*(\w*)\s*")
_ISO = re.compile(r"P(?:([\d.,]+)Y)?(?:([\d.,]+)M)?(?:([\d.,]+)W)?(?:([\d.,]+)D)?(?:T.*)?")
_DATE = re.compile(r"\s*(\d{4})-(\d{2})-(\d{2})")
_IN_YEARS = ("servicelife", "warrantyduration", "expectedlife")  # COBie counts these in years unless it says otherwise
_LISTED = ("document", "system", "spare_parts")
_DURATIONS = ("warranty_duration", "service_life", "service_interval")
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


class AssetDocument(NamedTuple):
    """A manual, a data sheet, a page: what it is called, where it lies, its number."""

    name: str
    location: str
    identification: str
    source: str


class AssetCode(NamedTuple):
    """A code in a classification system."""

    system: str
    code: str
    title: str
    source: str


@dataclass(frozen=True, eq=False)
class Asset:
    """What the models say about operating and maintaining one element.

    Text is as the file says, dates and all; empty where it says nothing, or only that nothing is known.
    What the element itself says comes before what its type says.

    Parameters
    ----------
    global_id, name, ifc_class, type_name, tag
        The element.
    storey, space
        Where it is: names, by the file, else by its geometry.
    maker, model, article, serial_number, barcode, asset_id
        What it is. A maker written as an e-mail address is followed by the name of the contact.
    installed, made
        When it was installed, and made or acquired.
    warranty_start, warranty_duration, warranty_end, warranty_guarantor, warranty_terms
        The end follows from start and duration where it is not stated.
    service_life, last_service, next_service, service_interval, replacement_cost
        Durations carry their unit.
    spare_parts, documents, systems, classifications
        Lists; empty where there are none.
    upstream, downstream, connected
        Neighbors through ports: where the flow comes from, where it goes, and where its direction is not known.
    sources
        Field to where its value comes from, such as `Pset_Warranty.WarrantyDurationParts of the type, fm.ifc`.

    Examples
    --------
    >>> from bimnav.testing import box, room
    >>> room(elements=[box("pump-1", 1, 1, 0, 2, 2, 1, name="Pump")]).asset("pump-1")
    Pump (pump-1), IfcBuildingElementProxy
      storey    Ground floor
      space     space
    """

    global_id: str
    name: str
    ifc_class: str
    type_name: str = ""
    tag: str = ""
    storey: str = ""
    space: str = ""
    maker: str = ""
    model: str = ""
    article: str = ""
    serial_number: str = ""
    barcode: str = ""
    asset_id: str = ""
    installed: str = ""
    made: str = ""
    warranty_start: str = ""
    warranty_duration: str = ""
    warranty_end: str = ""
    warranty_guarantor: str = ""
    warranty_terms: str = ""
    service_life: str = ""
    last_service: str = ""
    next_service: str = ""
    service_interval: str = ""
    replacement_cost: str = ""
    spare_parts: tuple[str, ...] = ()
    documents: tuple[AssetDocument, ...] = ()
    systems: tuple[str, ...] = ()
    classifications: tuple[AssetCode, ...] = ()
    upstream: tuple[Neighbor, ...] = ()
    downstream: tuple[Neighbor, ...] = ()
    connected: tuple[Neighbor, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict)
    building: Building | None = field(default=None, repr=False)

    @cached_property
    def summary(self) -> str:
        """The card in one line, for logs: what it is, its serial number, its warranty, its next service."""
        parts = [
            " ".join(part for part in (self.maker, self.model or self.article) if part),
            self.serial_number and f"serial {self.serial_number}",
            self.installed and f"installed {self.installed[:10]}",
            self.warranty_end and f"warranty until {self.warranty_end[:10]}",
            self.service_life and f"service life {self.service_life}",
            self.last_service and f"last service {self.last_service[:10]}",
            self.next_service and f"next service {self.next_service[:10]}",
            self.systems and f"system {', '.join(self.systems)}",
            self.documents and f"{len(self.documents)} document{'s' if len(self.documents) > 1 else ''}",
        ]
        return "; ".join([self.name or self.ifc_class, *(part for part in parts if part)])

    @property
    def is_empty(self) -> bool:
        """Whether the models say nothing about it but what and where it is."""
        return not any(getattr(self, name) for name in _TOLD)

    def is_under_warranty(self, day: date) -> bool | None:
        """Tell whether the warranty holds on a day; None if the models do not tell when it ends."""
        end, start = _day_of(self.warranty_end), _day_of(self.warranty_start)
        if end is None:
            return None
        return day <= end and (start is None or start <= day)

    def find_upstream(self, kind: str) -> tuple[Neighbor, ...]:
        """Walk against the flow to the first element of a kind.

        Where ports do not tell the direction of the flow, both are tried. The walk is the shortest one, and
        equal ones are decided by the order of the file.

        Parameters
        ----------
        kind
            `valve`, `breaker`, `pump`, `damper`, `switch`, `panel`; or any class such as `IfcTank`, or a word
            of a name.

        Returns
        -------
        way
            From the next neighbor to the element found, which is the last. Empty if there is none.
        """
        return self._find("upstream", kind)

    def find_downstream(self, kind: str) -> tuple[Neighbor, ...]:
        """Walk with the flow to the first element of a kind; see `find_upstream`."""
        return self._find("downstream", kind)

    def _find(self, way: Literal["upstream", "downstream"], kind: str) -> tuple[Neighbor, ...]:
        return () if self.building is None else _find(self.building, self.global_id, way, kind)

    def to_dict(self) -> dict[str, Any]:
        """Return the card as plain values."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("building", "sources")}
        for name, value in values.items():
            if isinstance(value, tuple):
                values[name] = [each._asdict() if hasattr(each, "_asdict") else each for each in value]
        return values | {"sources": dict(self.sources), "summary": self.summary}

    def rows(self) -> Iterator[tuple[str, str, str]]:
        """Yield what is known, line by line: field in words, value, and where it comes from."""
        for name in ("type_name", "tag", "storey", "space", *_TOLD):
            value = getattr(self, name)
            for each in value if isinstance(value, tuple) else (value,):
                if each:
                    source = getattr(each, "source", "") or self.sources.get(name, "")
                    yield name.replace("_", " "), _told(each), source

    def __repr__(self) -> str:
        lines = [f"{self.name or 'unnamed'} ({self.global_id}), {self.ifc_class}"]
        rows = list(self.rows())
        width = max((len(name) for name, _, _ in rows), default=0)
        lines += [
            f"  {name:<{max(width, 8)}}  {value}{f'  [{source}]' if source else ''}" for name, value, source in rows
        ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{html.escape(value)}</td>"
            f"<td style='color:#667'>{html.escape(source)}</td></tr>"
            for name, value, source in self.rows()
        )
        title = html.escape(f"{self.name or 'unnamed'} ({self.global_id}), {self.ifc_class}")
        return f"<div style='overflow-x:auto'><table><caption>{title}</caption>{cells}</table></div>"


_TOLD = tuple(
    f.name
    for f in fields(Asset)
    if f.name not in ("global_id", "name", "ifc_class", "type_name", "tag", "storey", "space", "sources", "building")
)


def _told(value: Any) -> str:
    if isinstance(value, Neighbor):
        return f"{value.name or value.ifc_class} ({value.global_id})"
    if isinstance(value, AssetCode):
        title = "" if value.title == value.code else value.title
        return " ".join(part for part in (value.system, value.code, title) if part)
    if isinstance(value, AssetDocument):
        return " ".join(part for part in (value.name, value.identification, value.location) if part)
    return str(value)


def read_asset(building: Building, global_id: str) -> Asset:
    """Return the asset card of an element or a room.

    Raises
    ------
    ModelError
        If nothing has this GlobalId.
    """
    product = _product(building, global_id)
    facts = _facts(building, global_id)
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
    filled: dict[str, Any] = {n: t for n, t in values.items() if n not in _LISTED} | _neighbors(building, facts)
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


def _product(building: Building, global_id: str) -> Element | Space:
    if global_id in building:
        return building[global_id]
    for space in building.spaces:
        if space.global_id == global_id:
            return space
    raise ModelError(
        f"no element or room of {building.name!r} has the GlobalId {global_id!r}.",
        "building.elements and building.spaces list them all; upper and lower case count.",
        {"global_id": global_id},
    )


def _facts(building: Building, global_id: str) -> list[tuple[str, Mapping[str, Any]]]:
    """Return what every file says, with its name; a building without files has its properties only."""
    readers = building.asset_readers
    if readers:
        return [(Path(path).name, told) for path, read in readers.items() if (told := read(global_id))]
    rows = [
        {"level": "occurrence", "set": pset, "name": name, "value": value, "measure": "", "unit": "", "description": ""}
        for pset, values in building.properties(global_id).items()
        for name, value in values.items()
    ]
    return [(building.name, {"properties": rows})] if rows else []


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
            is_type = is_type or "(type)" in row["set"].casefold() or "cobietype" in _squeezed(name)
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


def _squeezed(name: str) -> str:
    return "".join(char for char in name.casefold() if char.isalnum())


def _text(known: str, row: Mapping[str, Any], siblings: Mapping[tuple[str, str], Any]) -> tuple[str, str]:
    """Return a value as text, and what is doubtful about it."""
    value = row["value"]
    if row["measure"] == "IfcTimeStamp" and isinstance(value, int):
        return datetime.fromtimestamp(value, UTC).strftime("%Y-%m-%d"), ""
    if known not in _DURATIONS:
        return (f"{value:g}" if isinstance(value, float) else str(value).strip()), ""
    return _duration(row, siblings)


def _duration(row: Mapping[str, Any], siblings: Mapping[tuple[str, str], Any]) -> tuple[str, str]:
    """Write a duration with its unit: from the value, a unit beside it, its description, or as COBie counts."""
    value, name = row["value"], row["name"]
    if isinstance(value, str):
        found = _NUMBER.fullmatch(value)
        if found is None or found[2]:
            return _spelled(value), ""
        value = float(found[1].replace(",", "."))
    beside = {
        siblings.get((row["set"], f"{stem}unit".casefold()))
        for stem in (name, re.sub(r"(Parts|Labou?r)$", "", name), "Duration", "WarrantyDuration")
    }
    stated = [row["unit"], *(str(unit) for unit in beside if unit), *re.findall(r"\((\w+)\)", row["description"])]
    for unit in stated:
        known = _UNIT_WORDS.get(unit.casefold())
        if known == "seconds":
            return _counted(float(f"{value * _UNITS['seconds'] / _YEAR:.3g}"), "years"), ""
        if known:
            return _counted(value, known), ""
    if any(word in _squeezed(name) for word in _IN_YEARS):
        return _counted(value, "years"), " (no unit stated; COBie counts years)"
    return f"{value:g}", " (no unit stated)"


def _counted(count: float, unit: str) -> str:
    return f"{count:g} {unit.removesuffix('s') if count == 1 else unit}"


def _spelled(text: str) -> str:
    """Write an ISO 8601 duration in words, and anything else as it is."""
    found = _ISO.fullmatch(text.strip())
    if found is None or not any(found.groups()):
        return text.strip()
    counts = zip(found.groups(), ("years", "months", "weeks", "days"), strict=True)
    return " ".join(_counted(float(count.replace(",", ".")), unit) for count, unit in counts if count)


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
    start = _day_of(values.get("warranty_start", ""))
    if "warranty_end" in values or start is None:
        return
    end = _after(start, values.get("warranty_duration", ""))
    if end is None:
        return
    values["warranty_end"] = end.isoformat()
    sources["warranty_end"] = "warranty_start and warranty_duration"


def _day_of(text: str) -> date | None:
    found = _DATE.match(text)
    try:
        return date(*map(int, found.groups())) if found else None
    except ValueError:
        return None


def _after(start: date, duration: str) -> date | None:
    """Return the day on which a warranty ends: whole years and months go by the calendar; None if none is told."""
    months, days = 0, 0.0
    parts = re.findall(r"(\d+(?:[.,]\d+)?)\s*(\w+)", duration)
    for number, word in parts:
        count, unit = float(number.replace(",", ".")), _UNIT_WORDS.get(word.casefold())
        if unit is None:
            return None
        if unit in ("years", "months") and count.is_integer():
            months += int(count) * (12 if unit == "years" else 1)
        else:
            days += count * _UNITS[unit]
    if not parts or days > date.max.toordinal() or start.year + months // 12 >= date.max.year:
        return None
    turn, month = divmod(start.month - 1 + months, 12)
    first = date(start.year + turn, month + 1, 1)
    following = date(first.year + month // 11, (month + 1) % 12 + 1, 1)
    same_day = first.toordinal() + min(start.day, (following - first).days) - 1
    return date.fromordinal(min(same_day + round(days), date.max.toordinal()))


def _neighbors(building: Building, facts: Sequence[tuple[str, Mapping[str, Any]]]) -> dict[str, tuple[Neighbor, ...]]:
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


def _find(building: Building, start: str, way: str, kind: str) -> tuple[Neighbor, ...]:
    """Walk along the flow, breadth first, to the first element of a kind."""
    is_it = _test_of(building, kind)
    before: dict[str, str] = {start: ""}
    waiting = [start]
    for here in waiting:
        facts = _facts(building, here)
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
        if any(told.get("type_class") in classes for _, told in _facts(building, global_id)):
            return True
        texts: Iterable[str] = (element.name, element.type_name, element.object_type)
        return any(word in haystack(text) for text in texts if text for word in sought)

    return is_it


def _storey_of(building: Building, product: Element | Space) -> str:
    """Return the name of the storey that the file says, else of the highest one below the element."""
    stated = next((storey.name for storey in building.storeys if storey.global_id == product.storey), "")
    if stated or product.bounds is None:
        return stated
    low = float(product.bounds[0, 2]) + _BESIDE
    return next((storey.name for storey in reversed(building.storeys) if storey.elevation <= low), "")


def _room_of(building: Building, product: Element | Space) -> str:
    """Return the label of the room that the file says, else of the one where the middle of the element lies."""
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
            away = _outline(space).distance(point)
            near.append((away, not box[0, 2] <= z <= box[1, 2], space.label))
    best = min(near, default=(_BESIDE + 1, False, ""))
    return best[2] if best[0] <= _BESIDE else ""


def _outline(space: Space) -> BaseGeometry:
    from bimnav.footprint import project, unite

    return unite(project(shape).polygon for shape in space.shapes)
