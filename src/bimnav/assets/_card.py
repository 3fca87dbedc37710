"""The asset card of an element."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from datetime import date
from functools import cached_property
from typing import Any, Literal, NamedTuple

from bimnav import _checks
from bimnav.assets._durations import day_of
from bimnav.assets._flow import Neighbor, find_along
from bimnav.building import Building

__all__ = ["Asset", "AssetCode", "AssetDocument"]


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
        end, start = day_of(self.warranty_end), day_of(self.warranty_start)
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
        _checks.need("kind", kind, str)
        return () if self.building is None else find_along(self.building, self.global_id, way, kind)

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
