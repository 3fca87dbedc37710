"""What products mean: storeys, rooms, elements, doors, stairs and lifts, as rows of plain values."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from ifcopenshell.util.placement import get_local_placement
from numpy.typing import NDArray

from bimnav.ifc._kernel import Entity, File, attribute, is_kind, written
from bimnav.ifc._products import derived_id, sorted_of
from bimnav.ifc._relations import Relations

__all__ = ["Rows", "derived_storey", "lowest_floor", "storey_rows", "text_of"]

Row = dict[str, Any]
Bounds = NDArray[np.float64]

_LIFT = re.compile(r"(?<![^\W_])(elevator|lift)s?(?![^\W_])", re.IGNORECASE)
_DOOR = re.compile(r"(?<![^\W_])doors?(?![^\W_])", re.IGNORECASE)
_LIFT_CLASSES = ("IfcFlowTerminal", "IfcBuildingElementProxy")  # how Revit writes the families of lifts
_BY_CLASS = {
    "IfcStair": "stair",
    "IfcStairFlight": "stair",
    "IfcRamp": "ramp",
    "IfcRampFlight": "ramp",
    "IfcTransportElement": "lift",
}
_TRANSPORT = {"ESCALATOR": "stair", "MOVINGWALKWAY": "ramp", "CRANEWAY": None, "LIFTINGGEAR": None}
_TREADS = ("IfcStairFlight", "IfcRampFlight", "IfcSlab")


def text_of(value: object) -> str:
    """Return a text attribute; empty where the file says nothing."""
    return "" if value is None else str(value)


def storey_rows(file: File, ids: Mapping[int, str], unit_scale: float) -> list[Row]:
    """List the storeys from the lowest to the highest.

    A storey's height is that of its placement in the world; the attribute `Elevation` counts only where
    there is no placement or all of them are at zero.
    """
    rows = []
    for storey in sorted_of(file, "IfcBuildingStorey"):
        stated = _metres(storey.Elevation, unit_scale)
        rows.append((storey, _placement_height(storey, unit_scale), stated))
    all_zero = not any(height for _, height, _ in rows)
    storeys = [
        {
            "global_id": ids[storey.id()],
            "name": text_of(storey.Name),
            "elevation": stated or 0.0 if height is None or all_zero else height,
        }
        for storey, height, stated in rows
    ]
    return sorted(storeys, key=lambda row: (row["elevation"], row["name"], row["global_id"]))


def _placement_height(product: Entity, unit_scale: float) -> float | None:
    try:
        return (
            _metres(get_local_placement(product.ObjectPlacement)[2][3], unit_scale) if product.ObjectPlacement else None
        )
    except (AttributeError, IndexError, TypeError, ValueError):  # a placement of another kind, or a broken one
        return None


def _metres(value: object, unit_scale: float) -> float | None:
    try:
        metres = float(value) * unit_scale  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None
    return metres + 0.0 if math.isfinite(metres) else None


class Rows:
    """Makes the rows of one file.

    Parameters
    ----------
    ids
        Step id to GlobalId, of all products.
    bounds
        Step id to lowest and highest world coordinates, (2, 3) metres; None without geometry.
    shapes
        Step id to indexes of shapes.
    """

    def __init__(
        self,
        file: File,
        ids: Mapping[int, str],
        relations: Relations,
        bounds: Callable[[int], Bounds | None],
        shapes: Callable[[int], list[int]],
        unit_scale: float,
    ) -> None:
        self._ids = ids
        self._relations = relations
        self._bounds = bounds
        self._shapes = shapes
        self._unit_scale = unit_scale
        self._storeys = {storey.id() for storey in sorted_of(file, "IfcBuildingStorey")}
        self._spatial = {each.id() for each in sorted_of(file, "IfcSpatialElement", "IfcSpatialStructureElement")}
        self._spaces = {space.id() for space in sorted_of(file, "IfcSpace")}
        self._types: dict[int, Row] = {}
        self._held: dict[tuple[int, str], str | None] = {}
        self._fillings: dict[int, list[int]] = defaultdict(list)
        for filling, opening in sorted(relations.fills.items()):
            self._fillings[opening].append(filling)

    def element(self, product: Entity) -> Row:
        """Describe a product that is neither space nor opening."""
        step_id = product.id()
        whole = self._relations.whole.get(step_id)
        return {
            "global_id": self._ids[step_id],
            "ifc_class": product.is_a(),
            "name": text_of(attribute(product, "Name")),
            **self._typed(product),
            "tag": text_of(written(product, "Tag")),
            "storey": self._nearest(step_id, "storey"),
            "space": self._nearest(step_id, "space"),
            "parent": None if whole in self._spatial else self._ids.get(whole or 0),
            "step_id": step_id,
            "shapes": self._shapes(step_id),
        }

    def space(self, space: Entity) -> Row:
        """Describe a room."""
        return {
            "global_id": self._ids[space.id()],
            "name": text_of(space.Name),
            "long_name": text_of(space.LongName),
            **self._typed(space),
            "storey": self._nearest(space.id(), "storey"),
            "step_id": space.id(),
            "shapes": self._shapes(space.id()),
        }

    def opening(self, opening: Entity) -> Row:
        """Describe a void: what it cuts, and what fills it."""
        step_id = opening.id()
        return {
            "global_id": self._ids[step_id],
            "host": self._ids.get(self._relations.voids.get(step_id, 0)),
            "fillings": [self._ids[filling] for filling in self._fillings[step_id] if filling in self._ids],
            "shapes": self._shapes(step_id),
        }

    def door(self, door: Entity) -> Row:
        """Describe a door; a size that is no positive number is as good as none."""
        width, height = (_metres(size, self._unit_scale) for size in (door.OverallWidth, door.OverallHeight))
        return {
            "global_id": self._ids[door.id()],
            "opening": self._ids.get(self._relations.fills.get(door.id(), 0)),
            "width": width if width and width > 0 else None,
            "height": height if height and height > 0 else None,
        }

    def connectors(self, products: Sequence[Entity]) -> tuple[list[Row], list[str]]:
        """Describe stairs, ramps and lifts; return also the GlobalIds of those without any geometry."""
        rows, shapeless = [], []
        kinds = {product.id(): kind for product in products if (kind := self._connector_kind(product))}
        by_id = {product.id(): product for product in products}
        for step_id, kind in kinds.items():
            if any(whole in kinds for whole in self._relations.wholes(step_id)):
                continue  # a flight of a stair
            parts = [part for part in sorted({step_id, *self._relations.below(step_id)}) if self._shapes(part)]
            span = self._span([by_id[part] for part in parts if part in by_id])
            if span is None:
                shapeless.append(self._ids[step_id])
                continue
            rows.append(
                {
                    "global_id": self._ids[step_id],
                    "name": text_of(by_id[step_id].Name),
                    "kind": kind,
                    "parts": [self._ids[part] for part in parts],
                    "low": span[0],
                    "high": span[1],
                }
            )
        return rows, shapeless

    def _typed(self, product: Entity) -> Row:
        """Describe the kind of a product: by its type object, of which many share one, and by its own words."""
        kind = self._relations.kind.get(product.id())
        known = kind.id() if kind else 0
        if known not in self._types:
            self._types[known] = {
                "type_name": text_of(kind.Name) if kind else "",
                "type_class": kind.is_a() if kind else "",
                "object_type": "",
                "predefined_type": _own_type(kind, "ElementType") if kind else "",
            }
        row = self._types[known] | {"object_type": text_of(written(product, "ObjectType"))}
        row["predefined_type"] = row["predefined_type"] or _own_type(product, "ObjectType")
        return row

    def _nearest(self, step_id: int, wanted: Literal["storey", "space"]) -> str | None:
        """Return the GlobalId of the nearest storey or space that holds a product; many are held by one thing."""
        holder = next(self._relations.above(step_id), None)
        if holder is None:
            return None
        if (holder, wanted) not in self._held:
            places = self._storeys if wanted == "storey" else self._spaces
            held_by = (above for above in (holder, *self._relations.above(holder)) if above in places)
            self._held[holder, wanted] = next((self._ids[above] for above in held_by), None)
        return self._held[holder, wanted]

    def _connector_kind(self, product: Entity) -> str | None:
        kind = _BY_CLASS.get(product.is_a())
        typed = self._relations.kind.get(product.id())
        if kind == "lift":
            stated = getattr(product, "OperationType", None) or _predefined_type(product, typed)
            return _TRANSPORT.get(stated, "lift")
        if kind is None and any(is_kind(product, name) for name in _LIFT_CLASSES):
            words = " ".join(text_of(v) for v in (product.Name, product.ObjectType, typed and typed.Name))
            return "lift" if _LIFT.search(words) and not _DOOR.search(words) else None
        return kind

    def _span(self, parts: Iterable[Entity]) -> tuple[float, float] | None:
        """Find the lower and upper end of the parts one walks on; a railing ends higher than its stair."""
        parts = list(parts)
        treads = [part for part in parts if any(part.is_a(name) for name in _TREADS)]
        treads = treads or [part for part in parts if not part.is_a("IfcRailing")] or parts
        boxes = [box for part in treads if (box := self._bounds(part.id())) is not None]
        if not boxes:
            return None
        return float(min(box[0, 2] for box in boxes)), float(max(box[1, 2] for box in boxes))


def _predefined_type(product: Entity, kind: Entity | None) -> str:
    """Return the predefined type, the type object's first; a user's own word where it says so."""
    return (_own_type(kind, "ElementType") if kind else "") or _own_type(product, "ObjectType")


def _own_type(owner: Entity, own_word: str) -> str:
    value = written(owner, "PredefinedType")
    if value == "USERDEFINED":
        value = written(owner, own_word)
    return str(value) if value and value != "NOTDEFINED" else ""


def derived_storey(file: File, elevation: float) -> Row:
    """Make the one storey of a building without storeys."""
    project = sorted_of(file, "IfcProject")[0]
    return {
        "global_id": derived_id(f"storey of {project.GlobalId}"),
        "name": "derived",
        "elevation": elevation,
    }


def lowest_floor(spaces: Sequence[Entity], elements: Sequence[Entity], bounds: Callable[[int], Bounds | None]) -> float:
    """Find the height of the lowest floor: the base of a room, else the top of a slab, else the lowest body."""
    bases = [box[0, 2] for space in spaces if (box := bounds(space.id())) is not None]
    if bases:
        return float(min(bases))
    tops = [
        box[1, 2]
        for element in elements
        if element.is_a("IfcSlab") and element.PredefinedType != "ROOF"
        if (box := bounds(element.id())) is not None
    ]
    if tops:
        return float(min(tops))
    lows = [box[0, 2] for element in elements if (box := bounds(element.id())) is not None]
    return float(min(lows, default=0.0))
