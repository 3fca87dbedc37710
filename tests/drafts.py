"""Sound models as text, and as drafts that can be taken apart and put together wrongly."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from functools import cache
from itertools import count, pairwise
from typing import Any

from tests.conftest import REPOSITORY
from tests.ifc_text import FOOTER, HEADER

__all__ = ["BASES", "Draft", "arguments", "base_text", "draft_of", "listed"]

# drafts


def arguments(text: str) -> list[str]:
    """Split at the commas that lie in no bracket and no string."""
    parts, depth, is_quoted = [""], 0, False
    for sign in text:
        is_quoted ^= sign == "'"
        if not is_quoted:
            depth += (sign == "(") - (sign == ")")
        if sign == "," and depth == 0 and not is_quoted:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def listed(numbers: Iterable[int]) -> str:
    """Step ids as a list of references."""
    return f"({','.join(f'#{number}' for number in numbers)})"


class Draft:
    """A model as text that can be taken apart: step id to `[class, argument, ...]`."""

    def __init__(self, head: str, entities: dict[int, list[str]]) -> None:
        self.head, self.entities = head, entities
        self.last = max(entities)

    @classmethod
    def of(cls, text: str) -> Draft:
        head, _, body = text.partition("DATA;\n")
        found = re.findall(r"^#(\d+)=(\w+)\((.*)\);$", body, re.MULTILINE)
        return cls(head, {int(number): [kind, *arguments(inner)] for number, kind, inner in found})

    def copy(self) -> Draft:
        return Draft(self.head, {number: list(parts) for number, parts in self.entities.items()})

    def __getitem__(self, number: int) -> list[str]:
        return self.entities[number]

    def all(self, *kinds: str) -> list[int]:
        """Step ids of all entities of some classes; `IFCREL*` stands for all that begin so."""
        wanted = re.compile("|".join(kinds).replace("*", r"\w*"))
        return [number for number, parts in self.entities.items() if wanted.fullmatch(parts[0])]

    def first(self, kind: str) -> int:
        """The first entity of a class."""
        return next(number for number, parts in self.entities.items() if parts[0] == kind)

    def products(self) -> list[int]:
        """Step ids of all entities that have a representation."""
        shapes = {f"#{number}" for number in self.all("IFCPRODUCTDEFINITIONSHAPE")}
        return [number for number, parts in self.entities.items() if len(parts) > 7 and parts[7] in shapes]

    def add(self, kind: str, *values: object) -> int:
        self.last += 1
        self.entities[self.last] = [kind, *map(str, values)]
        return self.last

    def relate(self, kind: str, *values: object) -> int:
        return self.add(kind, f"'{self.last:022d}'", "$", "$", "$", *values)

    def shape(self, product: int) -> int:
        """The first representation of a product."""
        return _first(self[_first(self[product][7])][3])

    def body(self, product: int) -> int:
        """The first item of the first representation of a product."""
        return _first(self[self.shape(product)][4])

    def set_body(self, product: int, item: int) -> None:
        self[self.shape(product)][4] = f"(#{item})"

    def lines(self) -> list[str]:
        return [f"#{number}={kind}({','.join(inner)});" for number, (kind, *inner) in self.entities.items()]

    def text(self) -> str:
        return self.head + "DATA;\n" + "\n".join([*self.lines(), *FOOTER]) + "\n"


def _first(references: str) -> int:
    return int(re.findall(r"#(\d+)", references)[0])


# sound models


@cache
def _zoo(schema: str, scale: float) -> str:
    """A small house with one body of every kind; `scale` is metres in a unit."""
    import ifcopenshell

    file = ifcopenshell.file(schema=schema)
    make: Any = file.create_entity
    serial = count(1)

    def lengths(*metres: float) -> tuple[float, ...]:
        return tuple(value / scale for value in metres)

    def point(*metres: float) -> Any:
        return make("IfcCartesianPoint", lengths(*metres))

    def axes(*at: float) -> Any:
        return make(f"IfcAxis2Placement{len(at)}D", point(*at))

    def root(kind: str, **values: object) -> Any:
        return make(kind, GlobalId=f"{next(serial):022d}", **values)

    def box(*size: float) -> Any:
        profile = make("IfcRectangleProfileDef", "AREA", None, axes(0.0, 0.0), *lengths(*size[:2]))
        return make("IfcExtrudedAreaSolid", profile, axes(0.0, 0.0, 0.0), up, *lengths(size[2]))

    def area(*corners: tuple[float, float]) -> Any:
        outline = make("IfcPolyline", [point(*corner) for corner in (*corners, corners[0])])
        return make("IfcArbitraryClosedProfileDef", "AREA", None, outline)

    def shape(item: Any, kind: str = "SweptSolid") -> Any:
        return make("IfcShapeRepresentation", body, "Body", kind, [item])

    def product(kind: str, name: str, item: Any, *at: float, within: Any = None, **values: object) -> Any:
        placement = make("IfcLocalPlacement", within or ground.ObjectPlacement, axes(*at))
        definition = item and make("IfcProductDefinitionShape", None, None, [shape(item)])
        return root(kind, Name=name, ObjectPlacement=placement, Representation=definition, **values)

    up = make("IfcDirection", (0.0, 0.0, 1.0))
    model = make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, axes(0.0, 0.0, 0.0))
    body = make("IfcGeometricRepresentationSubContext", "Body", "Model", ParentContext=model, TargetView="MODEL_VIEW")
    unit = make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix="MILLI" if scale == 0.001 else None, Name="METRE")
    angle = make("IfcSIUnit", UnitType="PLANEANGLEUNIT", Name="RADIAN")
    units = make("IfcUnitAssignment", [unit, angle])
    project = root("IfcProject", Name="zoo", RepresentationContexts=[model], UnitsInContext=units)
    base = make("IfcLocalPlacement", None, axes(0.0, 0.0, 0.0))
    site = root("IfcSite", Name="site", ObjectPlacement=base)
    building = root("IfcBuilding", Name="house", ObjectPlacement=make("IfcLocalPlacement", base, axes(0.0, 0.0, 0.0)))
    ground, upper = (
        root(
            "IfcBuildingStorey",
            Name=name,
            ObjectPlacement=make("IfcLocalPlacement", building.ObjectPlacement, axes(0.0, 0.0, height)),
            Elevation=height / scale,
        )
        for name, height in (("ground", 0.0), ("upper", 3.0))
    )
    for whole, parts in ((project, [site]), (site, [building]), (building, [ground, upper])):
        root("IfcRelAggregates", RelatingObject=whole, RelatedObjects=parts)

    wall = product("IfcWall", "wall", box(6, 0.2, 2.8), 3, 0, 0)
    void = product("IfcOpeningElement", "void", box(1, 0.4, 2.1), 0, 0, 0, within=wall.ObjectPlacement)
    door = product(
        "IfcDoor",
        "door",
        box(1, 0.05, 2.1),
        *(0, 0, 0),
        within=void.ObjectPlacement,
        OverallWidth=1 / scale,
        OverallHeight=2.1 / scale,
    )
    root("IfcRelVoidsElement", RelatingBuildingElement=wall, RelatedOpeningElement=void)
    root("IfcRelFillsElement", RelatingOpeningElement=void, RelatedBuildingElement=door)
    room = area((0.0, 0.1), (6.0, 0.1), (6.0, 5.0), (3.0, 5.0), (3.0, 4.0), (0.0, 4.0))
    space = product(
        "IfcSpace", "room", make("IfcExtrudedAreaSolid", room, axes(0.0, 0.0, 0.0), up, 2.8 / scale), 0, 0, 0
    )
    root("IfcRelAggregates", RelatingObject=ground, RelatedObjects=[space])

    corners = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    loops = [make("IfcPolyLoop", [point(*map(float, corners[k])) for k in side]) for side in sides]
    faces = [make("IfcFace", [make("IfcFaceOuterBound", loop, True)]) for loop in loops]
    shell = make("IfcClosedShell", faces)
    if schema == "IFC2X3":
        facets = make("IfcFaceBasedSurfaceModel", [make("IfcConnectedFaceSet", faces)])
    else:
        triangles = [tuple(c + 1 for c in trio) for a, b, c, d in sides for trio in ((a, b, c), (a, c, d))]
        points = make("IfcCartesianPointList3D", [lengths(*corner) for corner in corners])
        facets = make("IfcTriangulatedFaceSet", Coordinates=points, Closed=True, CoordIndex=triangles)
    roof = make("IfcPlane", make("IfcAxis2Placement3D", point(0.0, 0.0, 2.0), make("IfcDirection", (0.6, 0.0, 0.8))))
    clipped = make("IfcBooleanClippingResult", "DIFFERENCE", box(4, 0.2, 3), make("IfcHalfSpaceSolid", roof, False))
    drilled = make("IfcBooleanResult", "DIFFERENCE", box(1, 1, 1), box(0.5, 0.5, 2))
    axis = make("IfcAxis1Placement", point(-1.0, 0.0), make("IfcDirection", (0.0, 1.0)))
    revolved = make("IfcRevolvedAreaSolid", area((0, 0), (0.5, 0), (0.5, 0.5)), axes(0.0, 0.0, 0.0), axis, math.pi)
    track = [make("IfcPolyline", [point(*a), point(*b)]) for a, b in pairwise([(0, 0), (1, 0), (0.5, 1), (0, 0)])]
    segments = [make("IfcCompositeCurveSegment", "CONTINUOUS", True, line) for line in track]
    curve = make("IfcArbitraryClosedProfileDef", "AREA", None, make("IfcCompositeCurve", segments, False))
    chair = make("IfcRepresentationMap", axes(0.0, 0.0, 0.0), shape(box(0.5, 0.5, 0.9)))
    bodies: dict[str, Callable[[], Any]] = {
        "slab": lambda: box(7, 6, 0.2),
        "brep": lambda: make("IfcFacetedBrep", shell),
        "facets": lambda: facets,
        "clipped": lambda: clipped,
        "drilled": lambda: drilled,
        "revolved": lambda: revolved,
        "curved": lambda: make("IfcExtrudedAreaSolid", curve, axes(0.0, 0.0, 0.0), up, 1 / scale),
        **dict.fromkeys(
            ("chair one", "chair two", "chair three"),
            lambda: make(
                "IfcMappedItem", chair, make("IfcCartesianTransformationOperator3D", None, None, point(0, 0, 0))
            ),
        ),
    }
    furniture = "IfcFurnishingElement" if schema == "IFC2X3" else "IfcFurniture"
    kinds = {"slab": "IfcSlab", "clipped": "IfcWall", "brep": "IfcColumn"}
    things = [
        product(kinds.get(name, furniture), name, item(), float(k % 4), 1.0 + k // 4, -0.2 if name == "slab" else 0.0)
        for k, (name, item) in enumerate(bodies.items())
    ]
    root("IfcRelContainedInSpatialStructure", RelatedElements=[wall, door, *things], RelatingStructure=ground)
    whole = product("IfcElementAssembly", "assembly", None, 0, 0, 0)
    parts = [product("IfcBeam", name, box(0.2, 3, 0.2), k, 0, 2.5) for k, name in enumerate(("beam one", "beam two"))]
    root("IfcRelAggregates", RelatingObject=whole, RelatedObjects=parts)
    root("IfcRelContainedInSpatialStructure", RelatedElements=[whole], RelatingStructure=upper)
    head = "\n".join(HEADER[:-1]).replace("IFC4", schema) + "\n"
    return head + "DATA;\n" + file.to_string().partition("DATA;\n")[2]


BASES: dict[str, Callable[[], str]] = {
    **{
        name: (REPOSITORY / "data" / "ifc" / f"{name}.ifc").read_text
        for name in ("apartment", "apartment_ifc2x3_mm", "apartment_ifc4x3_m")
    },
    "zoo_ifc2x3_m": lambda: _zoo("IFC2X3", 1.0),
    "zoo_ifc4_mm": lambda: _zoo("IFC4", 0.001),
    "zoo_ifc4x3_m": lambda: _zoo("IFC4X3_ADD2", 1.0),
}
"""Name of a sound model to what gives its text."""


@cache
def base_text(name: str) -> str:
    return BASES[name]()


def draft_of(base: str) -> Draft:
    """A fresh draft of a sound model."""
    return _parsed(base).copy()


@cache
def _parsed(base: str) -> Draft:
    return Draft.of(base_text(base))
