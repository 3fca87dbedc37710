"""Write the sample apartment: one flat as IFC4 in feet, IFC2X3 in millimetres and IFC4X3 in metres.

    python data/ifc/make_samples.py

rewrites the files beside this script, to the byte. The flat is that of the experiment of Xu and Gao,
whose living room runs from 0 to 11 ft in x and from 51 to 63 ft in y; the rest of it is our own design.
All numbers in this script are feet. Rooms and door openings end on the lines of a 0.5 ft grid; furniture
keeps clear of those lines, so that no rounding decides which cells it takes.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ifcopenshell.guid
from ifcopenshell import entity_instance
from ifcopenshell.api import (
    aggregate,
    classification,
    context,
    feature,
    geometry,
    owner,
    project,
    pset,
    root,
    spatial,
    type as types,
    unit,
)
from ifcopenshell.util.shape_builder import ShapeBuilder

_FOOT = 0.3048  # metres
_DECIMALS = 9  # of a model unit: below a nanometre in feet, metres and millimetres
_WRITTEN = ("2026-01-01T00:00:00", 1767225600)  # the same moment, as the header and as an owner history say it

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to write the flat: file name, schema, view definition, metres in a model unit."""

    name: str
    schema: str
    view: str
    scale: float


VARIANTS = (
    Variant("apartment", "IFC4", "DesignTransferView_V1.0", _FOOT),
    Variant("apartment_ifc2x3_mm", "IFC2X3", "CoordinationView_V2.0", 0.001),
    Variant("apartment_ifc4x3_m", "IFC4X3", "DesignTransferView", 1.0),
)
_IFC2X3 = {  # IFC4 classes by the name IFC2X3 has for them
    "IfcDoorType": "IfcDoorStyle",
    "IfcElectricAppliance": "IfcFlowTerminal",
    "IfcFurniture": "IfcFurnishingElement",
    "IfcSanitaryTerminal": "IfcFlowTerminal",
    "IfcWindowType": "IfcWindowStyle",
}


# --- Shapes: everything in the flat is made of upright prisms.


@dataclass(frozen=True, slots=True)
class Prism:
    """An upright solid: a profile put at a point, from one height to another.

    The profile is a rectangle (width, depth) about the point, a circle (radius,), or an outline of points.
    """

    profile: tuple[float, ...] | tuple[Point, ...]
    low: float
    high: float
    at: Point = (0.0, 0.0)


def block(x0: float, y0: float, x1: float, y1: float, low: float, high: float) -> Prism:
    """Return the box between two corners."""
    return Prism((x1 - x0, y1 - y0), low, high, ((x0 + x1) / 2, (y0 + y1) / 2))


def legs(x: float, y: float, size: float, height: float) -> tuple[Prism, ...]:
    """Return four square legs around the origin."""
    return tuple(Prism((size, size), 0, height, (x * i, y * j)) for i in (-1, 1) for j in (-1, 1))


def ring(count: int, width: float, depth: float, *pattern: float) -> tuple[Point, ...]:
    """Return `count` points around the origin; the pattern, repeated, draws some of them inwards."""
    turns = [(2 * math.pi * k / count, pattern[k % len(pattern)]) for k in range(count)]
    return tuple((r * width / 2 * math.cos(a), r * depth / 2 * math.sin(a)) for a, r in turns)


def leaf(width: float, height: float, sill: float = 0.0) -> tuple[Prism, ...]:
    """Return a closed leaf, or a pane, in a frame that fills an opening; doors have no sill."""
    edge, middle = 0.15, WALL / 2
    bottom = (block(edge, 0, width - edge, WALL, 0, sill),) if sill else ()
    return (
        block(0, 0, edge, WALL, 0, height),
        block(width - edge, 0, width, WALL, 0, height),
        block(edge, 0, width - edge, WALL, height - edge, height),
        block(edge, middle - 0.07, width - edge, middle + 0.07, sill, height - edge),
        *bottom,
    )


# --- The flat.

WALL, CEILING, ROOM_HEIGHT = 0.5, 8.5, 8.0
DOOR, WINDOW, WINDOW_SILL = (3.0, 7.0), (4.0, 4.0), 3.0  # (width, height)


@dataclass(frozen=True, slots=True)
class Kind:
    """A family and type: class, shape about its own origin, and what a manager knows about it."""

    ifc_class: str
    family: str
    solids: tuple[Prism, ...] = ()
    predefined: str | None = None
    code: str | None = None
    maker: Mapping[str, str] = field(default_factory=dict)


CODES = {
    "Pr_40_10": "Seating",
    "Pr_40_20": "Tables",
    "Pr_60_10": "Cold storage appliances",
    "Pr_60_70": "Robot charging equipment",
    "Pr_90_10": "Litter",
    "Pr_90_20": "Spilled liquids",
}

KINDS = {
    "exterior": Kind("IfcWall", "Basic Wall:Exterior - 6 in", predefined="STANDARD"),
    "interior": Kind("IfcWall", "Basic Wall:Interior - 6 in", predefined="STANDARD"),
    "floor": Kind("IfcSlab", "Floor:Concrete - 6 in", predefined="FLOOR"),
    "ceiling": Kind("IfcSlab", "Basic Roof:Concrete - 6 in", predefined="ROOF"),
    "entrance": Kind("IfcDoor", "Entrance Door:36 x 84 in", leaf(*DOOR), predefined="DOOR"),
    "door": Kind("IfcDoor", "Single Flush Door:36 x 84 in", leaf(*DOOR), predefined="DOOR"),
    "window": Kind("IfcWindow", "Fixed Window:48 x 48 in", leaf(*WINDOW, sill=0.15), predefined="WINDOW"),
    "chair": Kind(
        "IfcFurniture",
        "Dining Chair:Wood",
        (Prism((1.4, 1.4), 1.4, 1.5), Prism((1.4, 0.12), 1.5, 3.0, (0, 0.64)), *legs(0.6, 0.6, 0.12, 1.4)),
        code="Pr_40_10",
    ),
    "dining table": Kind(
        "IfcFurniture",
        "Dining Table:48 x 28 in",
        (Prism((4.0, 2.3), 2.3, 2.45), *legs(1.8, 0.95, 0.25, 2.3)),
        code="Pr_40_20",
    ),
    "round table": Kind(
        "IfcFurniture",
        "Round Table:36 in Diameter",
        (Prism((1.5,), 2.3, 2.4), Prism((0.2,), 0.1, 2.3), Prism((0.8,), 0, 0.1)),
        code="Pr_40_20",
    ),
    "sofa": Kind(
        "IfcFurniture",
        "Sofa:62 in",
        (
            Prism((5.2, 2.7), 0.3, 1.4),
            Prism((5.2, 0.7), 1.4, 2.8, (0, 1.0)),
            *(Prism((0.5, 2.0), 1.4, 2.0, (x, -0.35)) for x in (-2.35, 2.35)),
            *legs(2.4, 1.15, 0.2, 0.3),
        ),
        code="Pr_40_10",
        maker={"Manufacturer": "Halden & Roe", "ModelLabel": "Lido", "ArticleNumber": "HR-LIDO-62"},
    ),
    "bed": Kind(
        "IfcFurniture",
        "Bed:Queen",
        (
            Prism((5.0, 6.3), 0.6, 1.9, (0, -0.15)),
            Prism((5.0, 0.3), 0, 3.5, (0, 3.15)),
            *legs(2.3, 2.8, 0.25, 0.6),
        ),
    ),
    "nightstand": Kind("IfcFurniture", "Nightstand:17 in", (Prism((1.4, 1.4), 0, 1.8),)),
    "wardrobe": Kind("IfcFurniture", "Wardrobe:48 x 24 in", (Prism((4.0, 2.0), 0, 7.0),)),
    "counter": Kind("IfcFurniture", "Base Cabinet:60 in", (Prism((5.0, 2.0), 0, 3.0),)),
    "upper cabinet": Kind("IfcFurniture", "Upper Cabinet:29 in", (Prism((2.4, 1.0), 0, 2.5),)),
    "fridge": Kind(
        "IfcElectricAppliance",
        "Refrigerator:28 in",
        (Prism((2.4, 2.3), 0, 6.0),),
        predefined="FRIDGE_FREEZER",
        code="Pr_60_10",
        maker={
            "Manufacturer": "Polarbrook",
            "ModelLabel": "Frost 340",
            "ModelReference": "PB-F340",
            "ArticleNumber": "340-28-W",
            "ProductionYear": "2025",
        },
    ),
    "toilet": Kind(
        "IfcSanitaryTerminal",
        "Toilet:Floor Standing",
        (Prism((1.2, 1.6), 0, 1.35, (0, -0.3)), Prism((1.4, 0.6), 1.35, 2.6, (0, 0.8))),
        predefined="TOILETPAN",
    ),
    "washbasin": Kind(
        "IfcSanitaryTerminal", "Washbasin:20 in", (Prism((1.7, 1.4), 0, 0.5),), predefined="WASHHANDBASIN"
    ),
    "dock": Kind(
        "IfcElectricAppliance",
        "Charging Dock:Robot Dock",
        (Prism((1.3, 1.0), 0, 0.08),),
        predefined="ROBOTDOCK",
        code="Pr_60_70",
        maker={
            "Manufacturer": "Marten Robotics",
            "ModelLabel": "Nest 2",
            "ModelReference": "MR-N2",
            "ArticleNumber": "N2-120V",
            "ProductionYear": "2026",
        },
    ),
    "peel": Kind(
        "IfcBuildingElementProxy",
        "Banana Peel:Banana Peel",
        (Prism(ring(8, 0.5, 0.5, 1, 0.4), 0, 0.1),),
        code="Pr_90_10",
    ),
    "small spill": Kind(
        "IfcBuildingElementProxy",
        "Water Spill:Water Spill - Small",
        (Prism(ring(16, 0.5, 0.5, 1), 0, 0.001 / _FOOT),),
        code="Pr_90_20",
    ),
    "large spill": Kind(
        "IfcBuildingElementProxy",
        "Water Spill:Water Spill - Large",
        (Prism(ring(24, 1.0, 0.7, 1), 0, 0.001 / _FOOT),),
        code="Pr_90_20",
    ),
}

ROOMS = {  # number: long name, x0, y0, x1, y1
    "1": ("Living Room", 0.0, 51.0, 11.0, 63.0),
    "2": ("Bedroom", 11.5, 51.0, 22.0, 63.0),
    "3": ("Kitchen", 0.0, 41.0, 11.0, 50.5),
    "4": ("Hall", 11.5, 41.0, 16.0, 50.5),
    "5": ("Bathroom", 16.5, 41.0, 22.0, 50.5),
}

WALLS = {  # tag: kind, start, end; the wall lies to the left of this line
    345001: ("exterior", (-0.5, 40.5), (22.5, 40.5)),
    345002: ("exterior", (22.5, 41.0), (22.5, 63.0)),
    345003: ("exterior", (-0.5, 63.0), (22.5, 63.0)),
    345004: ("exterior", (0.0, 41.0), (0.0, 63.0)),
    345005: ("interior", (0.0, 50.5), (22.0, 50.5)),
    345006: ("interior", (11.5, 51.0), (11.5, 63.0)),
    345007: ("interior", (11.5, 41.0), (11.5, 50.5)),
    345008: ("interior", (16.5, 41.0), (16.5, 50.5)),
}

OPENINGS = {  # tag: kind, wall, first edge of the opening along x or y
    345101: ("entrance", 345001, 12.0),  # from outside to the hall
    345102: ("door", 345007, 45.0),  # hall, kitchen
    345103: ("door", 345005, 6.0),  # kitchen, living room
    345104: ("door", 345006, 53.0),  # living room, bedroom
    345105: ("door", 345005, 12.0),  # hall, bedroom
    345106: ("door", 345008, 42.0),  # hall, bathroom
    345201: ("window", 345003, 4.0),
    345202: ("window", 345004, 55.0),
    345203: ("window", 345003, 15.0),
    345204: ("window", 345004, 44.0),
    345205: ("window", 345001, 17.0),
}

PIECES = {  # tag: kind, room, position, quarter turns; backs point north, turned once west
    345301: ("round table", "1", (9.2, 58.7, 0.0), 0),
    345302: ("dining table", "1", (2.9, 59.75, 0.0), 0),
    345303: ("chair", "1", (1.95, 58.35, 0.0), 2),
    345304: ("chair", "1", (3.75, 58.35, 0.0), 2),
    345305: ("chair", "1", (1.95, 61.15, 0.0), 0),
    345306: ("chair", "1", (3.75, 61.15, 0.0), 0),
    345307: ("sofa", "1", (2.85, 52.55, 0.0), 2),
    345308: ("dock", "1", (10.25, 52.25, 0.0), 0),
    345401: ("bed", "2", (18.6, 59.7, 0.0), 3),
    345402: ("nightstand", "2", (21.1, 56.25, 0.0), 3),
    345403: ("wardrobe", "2", (18.9, 52.15, 0.0), 2),
    345501: ("counter", "3", (2.6, 42.1, 0.0), 2),
    345502: ("upper cabinet", "3", (1.35, 41.6, 4.5), 2),
    345503: ("upper cabinet", "3", (3.85, 41.6, 4.5), 2),
    345504: ("upper cabinet", "3", (9.1, 41.6, 4.5), 2),  # nothing stands below it
    345505: ("fridge", "3", (6.4, 42.25, 0.0), 2),
    345601: ("toilet", "5", (20.8, 44.0, 0.0), 3),
    345602: ("washbasin", "5", (21.25, 47.5, 2.3), 3),
    345678: ("peel", "1", (1.25, 55.75, 0.0), 0),
    345679: ("peel", "1", (9.75, 61.75, 0.0), 1),
    345680: ("small spill", "1", (7.25, 58.25, 0.0), 0),  # shares a 1 ft cell with the round table
    345681: ("large spill", "1", (5.75, 61.75, 0.0), 0),
}

RECORDS = {  # tag: what the manager keeps about one piece
    345308: {
        "Pset_ManufacturerOccurrence": {"SerialNumber": "N2-000417", "AcquisitionDate": "2026-01-15"},
        "Pset_Warranty": {
            "WarrantyIdentifier": "MR-W-417",
            "WarrantyStartDate": "2026-01-15",
            "WarrantyPeriod": "P2Y",
            "PointOfContact": "Marten Robotics service",
        },
    },
    345505: {
        "Pset_ManufacturerOccurrence": {
            "SerialNumber": "F340-25-10388",
            "BarCode": "4000345505",
            "AcquisitionDate": "2025-11-03",
        },
        "Pset_Warranty": {
            "WarrantyIdentifier": "PB-10388",
            "WarrantyStartDate": "2025-11-03",
            "WarrantyPeriod": "P5Y",
            "PointOfContact": "Polarbrook customer care",
            "WarrantyContent": "Compressor and electronics.",
        },
    },
    345307: {"Pset_ManufacturerOccurrence": {"SerialNumber": "LIDO-2231"}},
}
_REFERENCES_IN_IFC2X3 = {  # to dates and organizations; exporters write plain text instead, and so do we
    "AcquisitionDate",
    "PointOfContact",
    "WarrantyPeriod",
    "WarrantyStartDate",
}


# --- Writing.


class Author:
    """A model in the making. Lengths come in feet; names are unique and decide the GlobalIds."""

    def __init__(self, variant: Variant, name: str = "Apartment", known: Mapping[str, Kind] | None = None) -> None:
        self.variant = variant
        self.known = KINDS if known is None else known
        self.model = project.create_file(variant.schema)
        self.builder = ShapeBuilder(self.model)
        self.kinds: dict[str, entity_instance] = {}
        developer = owner.add_organisation(self.model, "bimnav", "The bimnav developers")
        owner.add_person_and_organisation(
            self.model, owner.add_person(self.model, "bimnav", "developers", "bimnav"), developer
        )
        owner.add_application(self.model, developer, "1", "bimnav samples", "bimnav samples")
        self.project = self.root("IfcProject", name)
        unit.assign_unit(self.model, self._units())
        solid, plan = (context.add_context(self.model, kind) for kind in ("Model", "Plan"))
        self.body = context.add_context(self.model, "Model", "Body", "MODEL_VIEW", parent=solid)
        self.axis = context.add_context(self.model, "Plan", "Axis", "GRAPH_VIEW", parent=plan)
        self.center = self.builder.create_axis2_placement_2d()

    def _units(self) -> list[entity_instance]:
        angle = unit.add_si_unit(self.model, "PLANEANGLEUNIT")
        if self.variant.scale == _FOOT:
            names = ("foot", "square foot", "cubic foot")
            return [*(unit.add_conversion_based_unit(self.model, name) for name in names), angle]
        prefix = "MILLI" if self.variant.scale == 0.001 else None
        return [
            unit.add_si_unit(self.model, "LENGTHUNIT", prefix),
            unit.add_si_unit(self.model, "AREAUNIT"),
            unit.add_si_unit(self.model, "VOLUMEUNIT"),
            angle,
        ]

    def lengths(self, feet: Iterable[float]) -> tuple[float, ...]:
        """Convert feet to model units, without a trace of the conversion."""
        return tuple(round(value * _FOOT / self.variant.scale, _DECIMALS) for value in feet)

    def root(self, ifc_class: str, name: str, predefined: str | None = None) -> entity_instance:
        """Create an entity by its IFC4 class."""
        if self.variant.schema == "IFC2X3":
            ifc_class = _IFC2X3.get(ifc_class, ifc_class)
        entity = root.create_entity(self.model, ifc_class, predefined, name)
        entity.GlobalId = _global_id(name)
        return entity

    @staticmethod
    def root_id(name: str) -> str:
        """Return the GlobalId that goes with a name."""
        return _global_id(name)

    def describe(self, entity: entity_instance, name: str, values: Mapping[str, Any]) -> None:
        """Give an entity a property set."""
        if self.variant.schema == "IFC2X3":
            values = {
                key: self.model.create_entity("IfcLabel", value) if key in _REFERENCES_IN_IFC2X3 else value
                for key, value in values.items()
            }
        properties = pset.add_pset(self.model, entity, name)
        properties.GlobalId = _global_id(f"{name} of {entity.Name}")
        pset.edit_pset(self.model, properties, properties=dict(values))

    def shape(self, entity: entity_instance, solids: Iterable[Prism]) -> None:
        """Give a product, or a type for all its products, a body."""
        items = []
        for solid in solids:
            height, *position = self.lengths((solid.high - solid.low, *solid.at, solid.low))
            items.append(self.builder.extrude(self._profile(solid.profile), height, position))
        geometry.assign_representation(self.model, entity, self.builder.get_representation(self.body, items))

    def _profile(self, profile: tuple[float, ...] | tuple[Point, ...]) -> entity_instance:
        if isinstance(profile[0], tuple):
            return self.builder.profile(self.builder.polyline([self.lengths(p) for p in profile], closed=True))
        ifc_class = "IfcCircleProfileDef" if len(profile) == 1 else "IfcRectangleProfileDef"
        return self.model.create_entity(ifc_class, "AREA", None, self.center, *self.lengths(profile))

    def place(
        self,
        product: entity_instance,
        parent: entity_instance | None,
        at: tuple[float, float, float] = (0.0, 0.0, 0.0),
        turns: int = 0,
    ) -> None:
        """Put a product somewhere in its parent, in quarter turns.

        `api.geometry.edit_object_placement` calculates in metres and back, and 53 ft are 53 no more.
        """
        x_axis = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))[turns]
        product.ObjectPlacement = self.model.create_entity(
            "IfcLocalPlacement",
            parent and parent.ObjectPlacement,
            self.builder.create_axis2_placement_3d(self.lengths(at), x_axis=x_axis),
        )

    def spatial(self, ifc_class: str, name: str, parent: entity_instance, **attributes: Any) -> entity_instance:
        """Create a part of the spatial structure, at the origin of the site."""
        part = self.root(ifc_class, name)
        for key, value in attributes.items():
            setattr(part, key, value)
        aggregate.assign_object(self.model, [part], parent)
        self.place(part, None if parent == self.project else parent)
        return part

    def element(self, key: str, tag: int, container: entity_instance) -> entity_instance:
        """Create an element of a kind, named as Revit names it: family, type, element id."""
        kind = self.known[key]
        element = self.root(kind.ifc_class, f"{kind.family}:{tag}")
        element.Tag = str(tag)
        types.assign_type(self.model, [element], self._type(key))
        element.ObjectType = kind.family
        spatial.assign_container(self.model, [element], container)
        return element

    def _type(self, key: str) -> entity_instance:
        if key not in self.kinds:
            kind = self.known[key]
            self.kinds[key] = entity = self.root(f"{kind.ifc_class}Type", kind.family, kind.predefined)
            if kind.solids:
                self.shape(entity, kind.solids)
            if kind.maker:
                self.describe(entity, "Pset_ManufacturerTypeInformation", kind.maker)
            if kind.ifc_class == "IfcDoor":
                entity.OperationType = "SINGLE_SWING_LEFT"
        return self.kinds[key]

    def write(self, path: Path) -> None:
        """Write the file, with nothing in it that another run would write differently."""
        for unordered in (*self.model.by_type("IfcRelationship"), *self.model.by_type("IfcUnitAssignment")):
            for index, value in enumerate(unordered):
                if isinstance(value, tuple):  # the api keeps its sets in the order of their hashes
                    unordered[index] = sorted(value, key=entity_instance.id)
        for relation in self.model.by_type("IfcRelationship"):
            relation.GlobalId = _global_id(_relation_key(relation))
        history, *others = sorted(self.model.by_type("IfcOwnerHistory"), key=entity_instance.id)
        history.CreationDate = history.LastModifiedDate = _WRITTEN[1]
        for entity in self.model.by_type("IfcRoot"):
            entity.OwnerHistory = history
        for other in others:
            self.model.remove(other)
        header = self.model.header
        header.file_description.description = (f"ViewDefinition [{self.variant.view}]",)
        header.file_name.name = path.name
        header.file_name.time_stamp = _WRITTEN[0]
        header.file_name.author = ("The bimnav developers",)
        header.file_name.organization = ("bimnav",)
        header.file_name.preprocessor_version = "IfcOpenShell"
        header.file_name.originating_system = "bimnav samples"
        header.file_name.authorization = "none"
        self.model.write(str(path))


def _global_id(key: str) -> str:
    return str(ifcopenshell.guid.compress(uuid.uuid5(uuid.NAMESPACE_URL, f"bimnav samples: {key}").hex))


def _relation_key(relation: entity_instance) -> str:
    ends = [end for end in list(relation)[4:] if isinstance(end, entity_instance)]  # the lists may grow
    return " ".join([relation.is_a(), *(getattr(end, "GlobalId", None) or end.Name for end in ends)])


def write_apartment(variant: Variant, path: Path) -> None:
    """Write the flat in one schema and unit."""
    author = Author(variant)
    site = author.spatial("IfcSite", "Site", author.project)
    building = author.spatial("IfcBuilding", "Apartment Building", site)
    storey = author.spatial("IfcBuildingStorey", "Ground Floor", building, Elevation=0.0)
    rooms = {number: _write_room(author, storey, number) for number in ROOMS}
    for key, tag, low, high in (("floor", 345011, -0.5, 0.0), ("ceiling", 345012, CEILING, CEILING + 0.5)):
        slab = author.element(key, tag, storey)
        author.place(slab, storey)
        author.shape(slab, [block(-0.5, 40.5, 22.5, 63.5, low, high)])
        facts = {"Reference": KINDS[key].family, "IsExternal": key == "ceiling", "LoadBearing": True}
        author.describe(slab, "Pset_SlabCommon", facts)
    walls = {tag: _write_wall(author, storey, tag) for tag in WALLS}
    for tag, (_, wall, _) in OPENINGS.items():
        _write_opening(author, storey, walls[wall], tag)
    for tag, (key, room, at, turns) in PIECES.items():
        piece = author.element(key, tag, rooms[room])
        author.place(piece, rooms[room], at, turns)
        for name, values in RECORDS.get(tag, {}).items():
            author.describe(piece, name, values)
    _write_codes(author)
    author.write(path)


def _write_room(author: Author, storey: entity_instance, number: str) -> entity_instance:
    long_name, *corners = ROOMS[number]
    inside = "InteriorOrExteriorSpace" if author.variant.schema == "IFC2X3" else "PredefinedType"
    room = author.spatial("IfcSpace", number, storey, LongName=long_name, **{inside: "INTERNAL"})
    author.shape(room, [block(*corners, 0.0, ROOM_HEIGHT)])
    facts = {"Reference": long_name, "PubliclyAccessible": False, "HandicapAccessible": True}
    author.describe(room, "Pset_SpaceCommon", facts)
    return room


def _direction(start: Point, end: Point) -> int:
    return int(start[0] == end[0])  # 0 along x, 1 along y


def _write_wall(author: Author, storey: entity_instance, tag: int) -> entity_instance:
    key, start, end = WALLS[tag]
    length = math.dist(start, end)
    wall = author.element(key, tag, storey)
    author.place(wall, storey, (*start, 0.0), turns=_direction(start, end))
    line = author.builder.polyline([author.lengths(point) for point in ((0.0, 0.0), (length, 0.0))])
    geometry.assign_representation(author.model, wall, author.builder.get_representation(author.axis, line, "Curve2D"))
    author.shape(wall, [block(0.0, 0.0, length, WALL, 0.0, CEILING)])
    outside = key == "exterior"
    facts = {"Reference": KINDS[key].family, "IsExternal": outside, "LoadBearing": outside}
    author.describe(wall, "Pset_WallCommon", facts)
    return wall


def _write_opening(author: Author, storey: entity_instance, wall: entity_instance, tag: int) -> None:
    key, wall_tag, edge = OPENINGS[tag]
    _, start, end = WALLS[wall_tag]
    is_door = key != "window"
    width, height = DOOR if is_door else WINDOW
    void = author.root("IfcOpeningElement", f"Opening:{tag}")
    if author.variant.schema != "IFC2X3":
        void.PredefinedType = "OPENING"
    feature.add_feature(author.model, void, wall)
    author.place(void, wall, (edge - start[_direction(start, end)], 0.0, 0.0 if is_door else WINDOW_SILL))
    author.shape(void, [block(0.0, 0.0, width, WALL, 0.0, height)])
    filling = author.element(key, tag, storey)
    feature.add_filling(author.model, void, filling)
    author.place(filling, void)
    filling.OverallWidth, filling.OverallHeight = author.lengths((width, height))
    facts = {"Reference": KINDS[key].family, "IsExternal": key != "door"}
    author.describe(
        filling,
        "Pset_DoorCommon" if is_door else "Pset_WindowCommon",
        {**facts, "HandicapAccessible": True, "FireExit": key == "entrance"} if is_door else facts,
    )


def _write_codes(author: Author) -> None:
    # `add_classification` relates the system to the project, which IFC2X3 does not allow
    system = author.model.create_entity(
        "IfcClassification", Source="The bimnav developers", Edition="1", Name="bimnav samples"
    )
    for code, name in CODES.items():
        kinds = [author.kinds[key] for key, kind in KINDS.items() if kind.code == code]
        classification.add_reference(author.model, kinds, identification=code, name=name, classification=system)


def write_samples(folder: Path) -> list[Path]:
    """Write all sample models into a folder."""
    paths = [folder / f"{variant.name}.ifc" for variant in VARIANTS]
    for variant, path in zip(VARIANTS, paths, strict=True):
        write_apartment(variant, path)
    return paths


if __name__ == "__main__":
    for written in write_samples(Path(__file__).parent):
        print(f"wrote {written.name}")
