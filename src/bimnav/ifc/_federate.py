"""Several models of one building, joined into one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from bimnav import _checks
from bimnav._georeference import Georeference, turn_of
from bimnav._select import select_by_hand
from bimnav.building import Building, Door, Element, Facts, Issue, Ledger, Opening, Space, Storey
from bimnav.errors import SelectorError, ValueRangeError
from bimnav.ifc._findings import Findings
from bimnav.ifc._frames import (
    SAME,
    Frame,
    boxes_of,
    called,
    doors_with,
    extent_of,
    find_frame,
    map_error,
    moved,
    placement_of,
)

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["checked_offsets", "federate"]

_SAME_SPACE = 0.95  # of the smaller footprint: services draw rooms to the middle of walls, architects to their faces
_AT_MOST = 2.0  # times larger; else the larger one is a zone and the other a closet in it
_MAP_ERROR = 0.1  # metres; scales that differ by a rounding move the far end of a building by less
_RECOUNTED = frozenset(  # asked of the joined building again
    [
        "connector-without-shape",
        "door-without-opening",
        "empty-storey",
        "level-storey",
        "no-geometry",
        "no-shape",
        "no-slabs",
        "no-spaces",
        "outside-storeys",
        "space-without-shape",
    ]
)

Product = TypeVar("Product", Element, Space, Opening, Door)
Solid = TypeVar("Solid", Element, Space, Opening)
Value = TypeVar("Value")
Reader = Callable[[str], Mapping[str, Mapping[str, Any]]]


def federate(buildings: Sequence[Building], *, offsets: Sequence[ArrayLike | None] | None = None) -> Building:
    """Join several models of one building into one.

    Products with the same GlobalId are one product. Of what several models say of it the first holds, and
    the others fill in what it leaves out; a model without any geometry comes after the others. Of a
    property in several models the first holds, in the order given.

    Model coordinates are kept, unless the models show that theirs differ. What shows it is, in this
    order: where products of the same GlobalId and size lie; the placements of sites, buildings and
    storeys of the same GlobalId; map coordinates in the same reference system; the heights of storeys of
    the same name. An issue, `federated-offset`, names every model that was moved.

    Parameters
    ----------
    buildings
        At least one.
    offsets
        For each building what to add to its coordinates, (3,) metres, or None to find that out.

    Returns
    -------
    building
        With the storeys, spaces and elements of all, and a ledger that closes over all.

    Raises
    ------
    ValueRangeError
        If there is no building, or the offsets do not fit.
    """
    buildings = _checks.many("buildings", buildings, Building)
    if not buildings:
        raise ValueRangeError("there is no building to join.", "Give at least one.")
    wanted = checked_offsets(offsets, len(buildings))
    first, *others = sorted(
        range(len(buildings)), key=lambda k: (extent_of(buildings[k]) is None, _is_derived(buildings[k]))
    )
    aliases: dict[str, str] = {}
    joined = _placed(buildings[first], wanted[first], None)
    if others:
        joined = replace(joined, issues=tuple(_with_name(joined.issues, _name_of(joined))))
    for k in others:
        building = _placed(buildings[k], wanted[k], joined)
        building = replace(building, issues=tuple(_with_name(building.issues, _name_of(building))))
        joined = _join(joined, building, aliases)
    answers = _Answers.of(buildings)
    return replace(
        joined,
        doors=tuple(replace(door, clear_width=None, sill=None, spaces=()) for door in joined.doors),
        issues=tuple(_recounted(joined)),
        schema=", ".join(dict.fromkeys(building.schema for building in buildings if building.schema)),
        unit=", ".join(dict.fromkeys(building.unit for building in buildings if building.unit)),
        sources=tuple(source for building in buildings for source in building.sources),
        selector=answers.select,
        property_reader=answers.properties,
        property_readers=answers.readers,
        facts_reader=answers.facts,
        asset_readers=_united(building.asset_readers for building in buildings),
    )


def checked_offsets(offsets: Sequence[ArrayLike | None] | None, count: int) -> list[NDArray[np.float64] | None]:
    """Return one offset or None for each of so many models.

    Raises
    ------
    ValueRangeError
        If there are more or fewer, or one is not three finite numbers.
    """
    if offsets is None:
        return [None] * count
    found = [None if offset is None else np.array(offset, dtype=np.float64) for offset in offsets]
    for offset in found:
        if offset is not None and not (offset.shape == (3,) and np.isfinite(offset).all()):
            raise ValueRangeError(f"an offset is {offset.tolist()}.", "Give x, y and z in metres, or None.")
    if len(found) != count:
        raise ValueRangeError(f"there are {len(found)} offsets for {count} models.", "Give one, or None, for each.")
    return found


def _is_derived(building: Building) -> bool:
    """Tell whether the one storey of a building was made up."""
    return any(issue.code == "no-storeys" for issue in building.issues)


def _name_of(building: Building) -> str:
    return Path(building.sources[0]).name if building.sources else building.name


def _with_name(issues: Iterable[Issue], name: str) -> Iterable[Issue]:
    return (replace(issue, message=f"{name}: {issue.message}") for issue in issues)


def _placed(building: Building, offset: NDArray[np.float64] | None, reference: Building | None) -> Building:
    """Move a building into the frame of the others, if it is not there, and say so."""
    frame = find_frame(building, reference) if offset is None and reference else None
    if offset is not None:
        frame = Frame(placement_of(offset), "as asked")
    extent = extent_of(building)
    if frame is None or extent is None:
        return building
    shift, rotation = frame.placement[:3, 3], frame.placement[:3, :3]
    if np.abs(extent @ rotation.T + shift - extent).max() <= SAME:
        return building
    x, y, z = shift.tolist()
    turn = math.degrees(turn_of(frame.placement))
    turned = f" after a turn by {turn:.4f} degrees" if turn else ""
    issue = Issue(
        "federated-offset",
        f"it was moved by ({x:.3f}, {y:.3f}, {z:.3f}) m{turned}, {frame.reason}.",
        frame.evidence,
        "info" if offset is not None else "warning",
        "offsets= states another.",
    )
    building = moved(building, frame.placement)
    return replace(building, issues=(*building.issues, issue))


def _join(first: Building, other: Building, aliases: dict[str, str]) -> Building:
    """Join two buildings that are in one frame.

    Parameters
    ----------
    aliases
        Other GlobalIds of spaces and storeys in `first`; more are added.
    """
    name, findings = _name_of(other), Findings({})
    storeys, storey_of = _storeys(first, other, aliases, findings)
    twins = _twins(first, other) | {s.global_id: aliases[s.global_id] for s in other.spaces if s.global_id in aliases}
    aliases |= twins | storey_of
    kinds = _kinds(first)
    clashing = {global_id: kind for global_id, kind in _kinds(other).items() if kinds.get(global_id, kind) != kind}
    _compare_places(first, other, findings)
    findings.add(
        "same-space",
        f"{{n}} [space|spaces] of {name} known under other GlobalIds [was|were] left out.",
        twins,
        severity="info",
    )
    findings.add(
        "global-id-clash",
        f"{{n}} [product|products] of {name} with the GlobalIds of products of another kind [was|were] left out.",
        clashing,
        severity="error",
        hint="Give them GlobalIds of their own.",
    )

    def merged(mine: Iterable[Product], theirs: Iterable[Product]) -> dict[str, Product]:
        known = {product.global_id: product for product in mine}
        for product in theirs:
            global_id = product.global_id
            if global_id in known:
                known[global_id] = _filled(known[global_id], product)
            elif global_id not in twins and global_id not in clashing:
                known[global_id] = product
        return known

    spaces = [replace(space, storey=storey_of.get(space.storey or "")) for space in other.spaces]
    elements = merged(
        _without_lost(first.elements, first, other),
        [
            replace(e, storey=storey_of.get(e.storey or ""), space=twins.get(e.space or "", e.space))
            for e in other.elements
        ],
    )
    openings = merged(_without_lost(first.openings, first, other), other.openings)
    doors = merged(first.doors, other.doors)
    return replace(
        first,
        storeys=storeys,
        spaces=tuple(merged(_without_lost(first.spaces, first, other), spaces).values()),
        elements=tuple(elements.values()),
        openings=tuple(openings.values()),
        terrain=tuple(merged(first.terrain, other.terrain).values()),
        doors=doors_with(doors.values(), elements, openings),
        connectors=tuple(_united({c.global_id: c for c in b.connectors} for b in (first, other)).values()),
        issues=(*first.issues, *other.issues, *_issues(findings)),
        ledger=_ledger(first.ledger, other.ledger, twins),
        detections=first.detections + other.detections,
        georeference=_better(first.georeference, other.georeference),
        anchors=_united([first.anchors, other.anchors]),
    )


def _united(tables: Iterable[Mapping[str, Value]]) -> dict[str, Value]:
    """Join tables; of equal keys the first holds."""
    found: dict[str, Value] = {}
    for table in tables:
        found = {**found, **{key: value for key, value in table.items() if key not in found}}
    return found


def _filled(known: Product, other: Product) -> Product:
    """Fill in what a product leaves out."""
    names = [field.name for field in fields(known) if getattr(known, field.name) in ("", None, ())]
    return replace(known, **{name: getattr(other, name) for name in names})


def _without_lost(products: Iterable[Solid], first: Building, other: Building) -> list[Solid]:
    """Drop what is left of shapes that were lost, in part, and are whole in the other building."""
    whole = first.ledger.lost.keys() & set(other.ledger.read)
    return [replace(product, shapes=()) if product.global_id in whole else product for product in products]


def _kinds(building: Building) -> dict[str, str]:
    kinds = (("element", building.elements), ("space", building.spaces), ("opening", building.openings))
    return {product.global_id: kind for kind, products in kinds for product in products}


def _better(here: Georeference | None, there: Georeference | None) -> Georeference | None:
    """Return the first of two georeferences; one that knows a map comes before one that does not."""
    if here is None or (there is not None and there.is_mapped and not here.is_mapped):
        return there
    return here


def _ledger(first: Ledger, other: Ledger, twins: Mapping[str, str]) -> Ledger:
    asked = dict.fromkeys((*first.asked, *other.asked))
    read = {*first.read, *other.read}
    lost = {g: reason for g, reason in _united([first.lost, other.lost]).items() if g not in read}
    left_out = _united([first.left_out, other.left_out])
    return Ledger(
        asked=tuple(asked),
        left_out={g: rule for g, rule in left_out.items() if g not in read and g not in lost}
        | {g: "same-space" for g in twins if g in asked},
        lost=lost,
        lost_bounds={g: box for g, box in _united([first.lost_bounds, other.lost_bounds]).items() if g in lost},
    )


def _storeys(
    first: Building, other: Building, aliases: Mapping[str, str], findings: Findings
) -> tuple[tuple[Storey, ...], dict[str, str]]:
    """Join storeys by GlobalId, else by name and height.

    Returns
    -------
    storeys
        From the lowest to the highest.
    storey_of
        GlobalId of a storey of the other building to that of the same storey here.
    """
    if _is_derived(other):
        return first.storeys, {}
    name, is_placed = _name_of(other), extent_of(other) is not None
    known = {storey.global_id: storey for storey in first.storeys}
    storey_of: dict[str, str] = {}
    for storey in other.storeys:
        alike = [
            here
            for here in first.storeys
            if called(here) == called(storey) and (not is_placed or abs(here.elevation - storey.elevation) <= SAME)
        ]
        same = known.get(aliases.get(storey.global_id, storey.global_id)) or next(iter(alike), storey)
        storey_of[storey.global_id] = known.setdefault(same.global_id, same).global_id
    findings.add(
        "storey-heights",
        f"{{n}} [storey has another height|storeys have other heights] in {name}; those of {_name_of(first)} hold.",
        [s.global_id for s in other.storeys if abs(known[storey_of[s.global_id]].elevation - s.elevation) > SAME],
        severity="warning" if is_placed else "info",
        hint="Check the length unit and the storeys of both.",
    )
    findings.add(
        "separate-storey",
        f"{{n}} [storey|storeys] of {name} [is|are] none of the others, by GlobalId or by name and height.",
        [global_id for global_id in known if global_id not in {storey.global_id for storey in first.storeys}],
        severity="info",
        hint="If they are the same, export both files from the same levels, or state offsets=.",
    )
    return tuple(sorted(known.values(), key=lambda s: (s.elevation, s.name, s.global_id))), storey_of


def _compare_places(first: Building, other: Building, findings: Findings) -> None:
    """Note what speaks against the frame."""
    name, there, here = _name_of(other), boxes_of(first), boxes_of(other)
    findings.add(
        "moved-product",
        f"{{n}} [product lies|products lie] elsewhere in {name}; the shapes of {_name_of(first)} hold.",
        [g for g, box in here.items() if g in there and _gap(box, there[g]) > SAME],
        hint="The files may be of different dates, or need offsets=.",
    )
    extent, around = extent_of(other), extent_of(first)
    if extent is not None and around is not None and (gap := _gap(extent[:, :2], around[:, :2])) > SAME:
        findings.add(
            "federated-apart",
            f"{name} lies {gap:.3f} m beside the others.",
            hint="State offsets= if it belongs to the same building.",
        )
    error = map_error(other, first)
    if error is not None and error > _MAP_ERROR:
        findings.add(
            "georeference-differs",
            f"{name} and {_name_of(first)} put the same point {error:.3f} m apart on the map; the latter holds.",
            hint="Export both with one georeference.",
        )


def _gap(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the distance between two boxes along the axis where it is largest, metres; below 0 if they overlap."""
    return float(np.maximum(one[0] - other[1], other[0] - one[1]).max())


def _twins(first: Building, other: Building) -> dict[str, str]:
    """Find the spaces of the other building that are here under another GlobalId: they cover the same floor."""
    from bimnav.footprint import outline

    @cache
    def floor_of(space: Space) -> BaseGeometry:
        return outline(space.shapes)

    known = {space.global_id for space in first.spaces}
    rooms = [(room, box) for room in first.spaces if (box := room.bounds) is not None]
    twins = {}
    for space in other.spaces:
        if space.global_id in known or (box := space.bounds) is None:
            continue
        near = (room for room, around in rooms if _shares_height(box, around) and _gap(box, around) < 0)
        twin = next((room for room in near if _is_same_floor(floor_of(room), floor_of(space))), None)
        if twin:
            twins[space.global_id] = twin.global_id
    return twins


def _shares_height(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Tell whether two boxes share half the height of the lower one."""
    (low, high), (bottom, top) = one[:, 2], other[:, 2]
    return bool(2 * (min(high, top) - max(low, bottom)) > min(high - low, top - bottom))


def _is_same_floor(one: BaseGeometry, other: BaseGeometry) -> bool:
    small, large = sorted((one.area, other.area))
    return bool(large <= _AT_MOST * small and shapely.intersection(one, other).area > _SAME_SPACE * small)


def _issues(findings: Findings) -> Iterable[Issue]:
    return (Issue(**row | {"global_ids": tuple(row["global_ids"])}) for row in findings.rows)


def _recounted(building: Building) -> Iterable[Issue]:
    """Ask again, of all models together, what is missing; what one lacks another may have."""
    lost = building.ledger.lost
    for issue in building.issues:
        is_mended = issue.code == "lost-shape" and not any(global_id in lost for global_id in issue.global_ids)
        if issue.code not in _RECOUNTED and not is_mended:
            yield issue
    joined = {connector.global_id for connector in building.connectors}
    without = [g for i in building.issues if i.code == "connector-without-shape" for g in i.global_ids]
    findings = Findings({})
    elements, spaces = _rows(building.elements), _rows(building.spaces)
    doors = [{"global_id": door.global_id, "opening": door.opening} for door in building.doors]
    findings.about_storeys(_rows(building.storeys), elements, spaces)
    findings.about_contents(elements, spaces, doors, [g for g in dict.fromkeys(without) if g not in joined])
    yield from (issue for issue in _issues(findings) if issue.code in _RECOUNTED)


def _rows(values: Iterable[Any]) -> list[dict[str, Any]]:
    return [{field.name: getattr(value, field.name) for field in fields(value)} for value in values]


@dataclass(frozen=True, slots=True)
class _Answers:
    """Answers for several models, each in its own schema.

    Parameters
    ----------
    selectors
        What answers queries, for each model.
    readers
        What reads properties, by path.
    tellers
        What tells the facts of a product, for each model.
    """

    selectors: tuple[Callable[[str], Iterable[str]], ...]
    readers: Mapping[str, Reader]
    tellers: tuple[Callable[[str], Facts], ...]

    @classmethod
    def of(cls, buildings: Iterable[Building]) -> _Answers:
        selectors: list[Callable[[str], Iterable[str]]] = []
        readers: dict[str, Reader] = {}
        tellers: list[Callable[[str], Facts]] = []
        for building in buildings:
            tellers.append(building.facts_reader or building.facts)
            selectors.append(building.selector or partial(select_by_hand, (*building.elements, *building.spaces)))
            if building.property_readers:
                readers |= building.property_readers
            elif building.property_reader:
                readers[building.sources[0] if building.sources else building.name] = building.property_reader
        return cls(tuple(selectors), readers, tuple(tellers))

    def select(self, query: str) -> tuple[str, ...]:
        """Return what a query picks in any model; that some have no such class is no error."""
        found: dict[str, None] = {}
        refusals = []
        for selector in self.selectors:
            try:
                found |= dict.fromkeys(selector(query))
            except SelectorError as error:
                if "schema" not in error.context:
                    raise
                refusals.append(error)
        if len(refusals) == len(self.selectors):
            raise refusals[0]
        return tuple(found)

    def facts(self, global_id: str) -> Facts:
        """Return what all models say of a product; of a property in several the first holds."""
        told = [tell(global_id) for tell in self.tellers]
        return Facts(
            _merged(facts.properties for facts in told),
            _merged(facts.type_properties for facts in told),
            tuple(dict.fromkeys(each for facts in told for each in facts.classifications)),
            tuple(dict.fromkeys(name for facts in told for name in facts.systems)),
        )

    def properties(self, global_id: str) -> dict[str, dict[str, Any]]:
        """Return all property sets of a product; of a property in several models the first holds."""
        return _merged(read(global_id) for read in self.readers.values())


def _merged(told: Iterable[Mapping[str, Mapping[str, Any]]]) -> dict[str, dict[str, Any]]:
    merged: dict[str, dict[str, Any]] = {}
    for sets in told:
        for name, values in sets.items():
            merged[name] = {**values, **merged.get(name, {})}
    return merged
