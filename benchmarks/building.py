"""A generated office building as an IFC file, drawn and written from the same numbers.

    python benchmarks/building.py FILE.ifc [PRODUCTS]

Every storey is two rows of rooms along a corridor. Walls span up to five rooms, with a door or a window for
each; doors, windows, furniture and lights are mapped from their types. Lengths in this script are whole
millimetres, so that what is drawn is exact.
"""

from __future__ import annotations

import sys
import uuid
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.guid
import shapely

__all__ = ["Drawing", "Plan", "write_building", "write_hall"]

Entity = Any
Box = tuple[int, int, int, int, int, int]  # x, y, z of the low corner, then of the high one
Disc = tuple[int, int, int]  # radius about the z axis, low, high
Solids = Sequence[Box | Disc]
Rectangle = tuple[int, int, int, int]  # x, y of the low corner, then of the high one
Point = tuple[int, int, int]

_WALL, _ROOM, _DEPTH, _CORRIDOR = 200, 4000, 6000, 2400  # thickness; width and depth of a room; width
_HEIGHT, _STOREY, _SLAB = 3000, 3200, 200  # of a wall; from floor to floor; thickness
_ROOMS_PER_WALL = 5
_SLOTS = [(500 + 1000 * i, 500 + 1000 * j) for j in range(5) for i in range(4)]  # a square metre for each piece
_DIRECTIONS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.8, 0.6), (-0.6, 0.8))


@dataclass(frozen=True, slots=True)
class _Filling:
    """A door or window: class, size, and height of the sill."""

    ifc_class: str
    width: int
    height: int
    sill: int = 0

    @property
    def solids(self) -> list[Box]:
        """A leaf or pane in a frame that fills the opening; the opening begins at the origin."""
        edge, middle, width, height = 50, _WALL // 2, self.width, self.height
        return [
            (0, 0, 0, edge, _WALL, height),
            (width - edge, 0, 0, width, _WALL, height),
            (edge, 0, height - edge, width - edge, _WALL, height),
            (edge, middle - 20, 0, width - edge, middle + 20, height - edge),
        ]


_DOOR, _EXIT = _Filling("IfcDoor", 900, 2100), _Filling("IfcDoor", 1000, 2100)
_WINDOW = _Filling("IfcWindow", 1600, 1200, 900)


def _legs(x: int, y: int, size: int, height: int) -> list[Box]:
    return [(i, j, 0, i + size, j + size, height) for i in (-x, x - size) for j in (-y, y - size)]


# All furniture stays within half a metre of its middle, whichever way it is turned.
_FURNITURE: Mapping[str, Solids] = {
    "Chair": [(-225, -225, 420, 225, 225, 470), (-225, 185, 470, 225, 225, 900), *_legs(225, 225, 40, 420)],
    "Desk": [(-400, -250, 720, 400, 250, 750), *_legs(400, 250, 50, 720)],
    "Cabinet": [(-400, -200, 0, 400, 200, 1800)],
    "Plant": [(180, 0, 400), (20, 400, 900), (300, 900, 1500)],
    "Shelf": [
        *((x, -150, 0, x + 20, 150, 2000) for x in (-400, 380)),
        *((-380, -150, z, 380, 150, z + 20) for z in range(100, 2000, 380)),
    ],
}
_LIGHT: Solids = [(-300, -300, 0, 300, 300, 80)]
_TYPES = {  # class: attributes its type must have
    "IfcDoor": {"PredefinedType": "DOOR", "OperationType": "SINGLE_SWING_LEFT"},
    "IfcFurniture": {"AssemblyPlace": "NOTDEFINED"},
    "IfcLightFixture": {"PredefinedType": "NOTDEFINED"},
    "IfcWindow": {"PredefinedType": "WINDOW", "PartitioningType": "SINGLE_PANEL"},
}


@dataclass(frozen=True, slots=True)
class Plan:
    """How large the building is.

    Parameters
    ----------
    storeys
        Number of storeys.
    rooms
        On every storey; even.
    furniture, lights
        Pieces in every room, at most 20 of each.
    """

    storeys: int = 10
    rooms: int = 60
    furniture: int = 20
    lights: int = 4

    @classmethod
    def of_size(cls, products: int) -> Plan:
        """Return the plan of a building of about so many products; one of 18,000 has ten storeys."""
        storeys = max(1, round(10 * (products / 18_000) ** (1 / 3)))
        return cls(storeys, 2 * max(1, round(products / storeys / 61)))


@dataclass(frozen=True, slots=True)
class Drawing:
    """What was drawn, by GlobalId; rectangles in plan view, metres.

    Parameters
    ----------
    levels
        Height of every storey's floor in metres.
    walls
        The walls, whole.
    doorways
        The door openings in each wall that has any.
    products
        Everything with a body.
    """

    levels: list[float] = field(default_factory=list)
    walls: dict[str, shapely.Polygon] = field(default_factory=dict)
    doorways: dict[str, list[shapely.Polygon]] = field(default_factory=dict)
    products: list[str] = field(default_factory=list)


def write_building(path: Path, plan: Plan | None = None) -> Drawing:
    """Write a building; equal plans give equal bytes."""
    plan = plan or Plan()
    author = _Author()
    for _ in range(plan.storeys):
        _draw_storey(author, plan)
    return author.write(path)


def write_hall(path: Path, chairs: int) -> Drawing:
    """Write one hall with so many copies of one mapped chair in it."""
    author = _Author()
    columns = max(1, int(chairs**0.5))
    author.storey()
    hall = author.space("Hall", (0, 0, 1000 * columns, 1000 * (chairs // columns + 1)))
    for k in range(chairs):
        at = (500 + 1000 * (k % columns), 500 + 1000 * (k // columns), 0)
        author.piece("Chair", hall, at, _DIRECTIONS[k % len(_DIRECTIONS)])
    return author.write(path)


def _draw_storey(author: _Author, plan: Plan) -> None:
    row, pitch = plan.rooms // 2, _ROOM + _WALL
    south, north = _WALL + _DEPTH, _DEPTH + 2 * _WALL + _CORRIDOR  # where the walls along the corridor begin
    length, width = row * pitch + _WALL, north + _WALL + _DEPTH + _WALL
    author.storey()
    author.slab((0, 0, length, width))
    author.space("Corridor", (_WALL, south + _WALL, length - _WALL, north))
    author.wall((0, 0, _WALL, width), _EXIT, [south + _WALL + (_CORRIDOR - _EXIT.width) // 2])
    author.wall((length - _WALL, 0, length, width))
    for first in range(0, row, _ROOMS_PER_WALL):
        rooms = range(first, min(first + _ROOMS_PER_WALL, row))
        x0, x1 = _WALL + rooms.start * pitch, rooms.stop * pitch + _WALL * (rooms.stop < row)
        doors = [_WALL + k * pitch + 300 + 400 * (k % 7) for k in rooms]
        windows = [_WALL + k * pitch + (_ROOM - _WINDOW.width) // 2 for k in rooms]
        for y in (south, north):
            author.wall((x0, y, x1, y + _WALL), _DOOR, doors)
        for y in (0, width - _WALL):
            author.wall((x0, y, x1, y + _WALL), _WINDOW, windows)
    kinds = list(_FURNITURE)
    for k in range(plan.rooms):
        is_north = k % 2
        x, y = _WALL + k // 2 * pitch, north + _WALL if is_north else _WALL
        if x > _WALL:
            author.wall((x - _WALL, y, x, y + _DEPTH))
        office = author.space("Office", (x, y, x + _ROOM, y + _DEPTH))
        y += 1000 * is_north  # a metre along the corridor stays free
        for n, (dx, dy) in enumerate(_SLOTS[: plan.furniture]):
            kind, direction = kinds[(3 * k + n) % len(kinds)], _DIRECTIONS[(k + n) % len(_DIRECTIONS)]
            author.piece(kind, office, (x + dx, y + dy, 0), direction)
        for dx, dy in _SLOTS[: plan.lights]:
            author.piece("Light", office, (x + dx, y + dy, _HEIGHT - 80))


class _Author:
    """A model in the making; products go to the storey begun last."""

    def __init__(self) -> None:
        self.drawing = Drawing()
        self._model = ifcopenshell.file(schema="IFC4")
        self._roots = 0
        self._maps: dict[str, tuple[Entity, Entity]] = {}
        self._whole: dict[Entity, list[Entity]] = defaultdict(list)
        self._container: dict[Entity, list[Entity]] = defaultdict(list)
        self._typed: dict[Entity, list[Entity]] = defaultdict(list)
        make = self._model.create_entity
        self._direction = cache(lambda *ratios: make("IfcDirection", ratios))
        origin = self._point(0, 0, 0)
        self._flat = make("IfcAxis2Placement2D", self._point(0, 0))
        self._as_is = make("IfcCartesianTransformationOperator3D", LocalOrigin=origin)
        world = make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, make("IfcAxis2Placement3D", origin))
        self._body = make(
            "IfcGeometricRepresentationSubContext", "Body", "Model", ParentContext=world, TargetView="MODEL_VIEW"
        )
        millimetre = make("IfcSIUnit", None, "LENGTHUNIT", "MILLI", "METRE")
        units = make("IfcUnitAssignment", [millimetre, make("IfcSIUnit", None, "PLANEANGLEUNIT", None, "RADIAN")])
        project = self._root("IfcProject", "Generated", RepresentationContexts=[world], UnitsInContext=units)
        site = self._spatial("IfcSite", "Site", project)
        self._building = self._storey = self._spatial("IfcBuilding", "Building", site)

    def storey(self) -> None:
        """Begin the next storey."""
        number = len(self.drawing.levels)
        self._storey = self._spatial("IfcBuildingStorey", f"Level {number}", self._building, (0, 0, number * _STOREY))
        self._storey.Elevation = float(number * _STOREY)
        self.drawing.levels.append(number * _STOREY / 1000)

    def space(self, name: str, area: Rectangle) -> Entity:
        """Add a room."""
        x0, y0, x1, y1 = area
        space = self._spatial("IfcSpace", str(self._roots), self._storey, (x0, y0, 0))
        space.LongName = name
        self._give_body(space, [(0, 0, 0, x1 - x0, y1 - y0, _HEIGHT)])
        return space

    def slab(self, area: Rectangle) -> None:
        """Add a floor whose top is the storey's level."""
        x0, y0, x1, y1 = area
        slab = self._product("IfcSlab", "Floor", self._storey, (x0, y0, -_SLAB), PredefinedType="FLOOR")
        self._give_body(slab, [(0, 0, 0, x1 - x0, y1 - y0, _SLAB)])
        self._container[self._storey].append(slab)

    def wall(self, area: Rectangle, filling: _Filling | None = None, begins: Iterable[int] = ()) -> None:
        """Add a wall, and doors or windows that begin at these x, or y if the wall runs along y."""
        x0, y0, x1, y1 = area
        runs_along_x = x1 - x0 > y1 - y0
        at, direction = ((x0, y0, 0), (1.0, 0.0)) if runs_along_x else ((x1, y0, 0), (0.0, 1.0))
        wall = self._product("IfcWall", "Wall", self._storey, at, direction)
        self._give_body(wall, [(0, 0, 0, max(x1 - x0, y1 - y0), _WALL, _HEIGHT)])
        self._container[self._storey].append(wall)
        self.drawing.walls[wall.GlobalId] = _rectangle(area)
        for begin in begins if filling else ():
            self._fill(wall, filling, begin - (x0 if runs_along_x else y0))
            if filling.ifc_class == "IfcDoor":
                end = begin + filling.width
                hole = (begin, y0, end, y1) if runs_along_x else (x0, begin, x1, end)
                self.drawing.doorways.setdefault(wall.GlobalId, []).append(_rectangle(hole))

    def piece(
        self,
        kind: str,
        space: Entity,
        at: Point,
        direction: tuple[float, float] = (1.0, 0.0),
    ) -> None:
        """Add a copy of a kind of furniture, or a light, to a space."""
        ifc_class = "IfcFurniture" if kind in _FURNITURE else "IfcLightFixture"
        piece = self._product(ifc_class, kind, self._storey, at, direction)
        self._give_copy(piece, kind, _FURNITURE.get(kind, _LIGHT))
        self._container[space].append(piece)

    def write(self, path: Path) -> Drawing:
        """Write the file; return what was drawn."""
        for whole, parts in self._whole.items():
            self._root("IfcRelAggregates", None, RelatingObject=whole, RelatedObjects=parts)
        for container, products in self._container.items():
            self._root("IfcRelContainedInSpatialStructure", None, RelatingStructure=container, RelatedElements=products)
        for kind, products in self._typed.items():
            self._root("IfcRelDefinesByType", None, RelatingType=kind, RelatedObjects=products)
        header = self._model.header
        header.file_description.description = ("ViewDefinition [ReferenceView_V1.2]",)
        header.file_name.name, header.file_name.time_stamp = path.name, "2026-01-01T00:00:00"
        self._model.write(str(path))
        return self.drawing

    def _fill(self, wall: Entity, filling: _Filling, begin: int) -> None:
        void = self._product("IfcOpeningElement", None, wall, (begin, 0, filling.sill), PredefinedType="OPENING")
        self._give_body(void, [(0, 0, 0, filling.width, _WALL, filling.height)])
        self._root("IfcRelVoidsElement", None, RelatingBuildingElement=wall, RelatedOpeningElement=void)
        name = f"{filling.ifc_class[3:]} {filling.width} x {filling.height}"
        product = self._product(filling.ifc_class, name, void)
        product.OverallWidth, product.OverallHeight = float(filling.width), float(filling.height)
        self._give_copy(product, name, filling.solids)
        self._root("IfcRelFillsElement", None, RelatingOpeningElement=void, RelatedBuildingElement=product)
        self._container[self._storey].append(product)

    def _root(self, ifc_class: str, name: str | None, **attributes: Any) -> Entity:
        self._roots += 1
        number = uuid.uuid5(uuid.NAMESPACE_URL, f"bimnav benchmark {self._roots}")
        return self._model.create_entity(
            ifc_class, GlobalId=ifcopenshell.guid.compress(number.hex), Name=name, **attributes
        )

    def _spatial(self, ifc_class: str, name: str, whole: Entity, at: Point = (0, 0, 0)) -> Entity:
        part = self._product(ifc_class, name, whole, at)
        self._whole[whole].append(part)
        return part

    def _product(
        self,
        ifc_class: str,
        name: str | None,
        beside: Entity,
        at: Point = (0, 0, 0),
        direction: tuple[float, float] = (1.0, 0.0),
        **attributes: Any,
    ) -> Entity:
        """Create a product placed relative to another."""
        placement = self._model.create_entity(
            "IfcLocalPlacement", getattr(beside, "ObjectPlacement", None), self._axes(at, direction)
        )
        return self._root(ifc_class, name, ObjectPlacement=placement, **attributes)

    def _axes(self, at: tuple[int, ...], direction: tuple[float, float] = (1.0, 0.0)) -> Entity:
        turn = () if direction == (1.0, 0.0) else (self._direction(0.0, 0.0, 1.0), self._direction(*direction, 0.0))
        return self._model.create_entity("IfcAxis2Placement3D", self._point(*at), *turn)

    def _point(self, *coordinates: float) -> Entity:
        return self._model.create_entity("IfcCartesianPoint", tuple(map(float, coordinates)))

    def _give_body(self, product: Entity, solids: Solids) -> None:
        self._give(product, self._representation("SweptSolid", [self._extrusion(solid) for solid in solids]))

    def _give_copy(self, product: Entity, kind: str, solids: Solids) -> None:
        if kind not in self._maps:
            body = self._representation("SweptSolid", [self._extrusion(solid) for solid in solids])
            source = self._model.create_entity("IfcRepresentationMap", self._axes((0, 0, 0)), body)
            ifc_class = product.is_a()
            attributes = {"RepresentationMaps": [source], **_TYPES[ifc_class]}
            self._maps[kind] = source, self._root(f"{ifc_class}Type", kind, **attributes)
        source, type_object = self._maps[kind]
        copy = self._model.create_entity("IfcMappedItem", source, self._as_is)
        self._give(product, self._representation("MappedRepresentation", [copy]))
        self._typed[type_object].append(product)

    def _give(self, product: Entity, representation: Entity) -> None:
        product.Representation = self._model.create_entity("IfcProductDefinitionShape", None, None, [representation])
        self.drawing.products.append(product.GlobalId)

    def _representation(self, kind: str, items: list[Entity]) -> Entity:
        return self._model.create_entity("IfcShapeRepresentation", self._body, "Body", kind, items)

    def _extrusion(self, solid: Box | Disc) -> Entity:
        make = self._model.create_entity
        if len(solid) == 3:
            radius, low, high = solid
            profile, at = make("IfcCircleProfileDef", "AREA", None, self._flat, float(radius)), (0, 0, low)
        else:
            x0, y0, low, x1, y1, high = solid
            profile = make("IfcRectangleProfileDef", "AREA", None, self._flat, float(x1 - x0), float(y1 - y0))
            at = ((x0 + x1) / 2, (y0 + y1) / 2, low)
        up = self._direction(0.0, 0.0, 1.0)
        return make("IfcExtrudedAreaSolid", profile, self._axes(at), up, float(high - low))


def _rectangle(area: Rectangle) -> shapely.Polygon:
    return shapely.box(*(side / 1000 for side in area))


if __name__ == "__main__":
    plan = Plan.of_size(int(sys.argv[2])) if len(sys.argv) > 2 else Plan()
    drawn = write_building(Path(sys.argv[1]), plan)
    print(f"wrote {sys.argv[1]}: {len(drawn.products)} products, {len(drawn.walls)} walls, {plan}")
