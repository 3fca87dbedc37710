"""Reading IFC: from a file in memory to a building in metres, with nothing lost in silence."""

from __future__ import annotations

import json
from itertools import pairwise

import ifcopenshell
import ifcopenshell.guid
import numpy as np
import pytest

from bimnav.building import Building, Mesh, Shape
from bimnav.errors import IfcStructureError, IfcUnitsError
from bimnav.ifc import _kernel, _tessellate
from bimnav.ifc._canonical import canonical
from bimnav.ifc._extract import extract, to_building
from tests.conftest import REAL_IFC, real_model

METRES = {"metre": 1.0, "millimetre": 0.001, "foot": 0.3048}
SCHEMAS = ("IFC2X3", "IFC4", "IFC4X3_ADD2")


class Sketch:
    """A small IFC file; what it is told in metres it writes in its own unit."""

    def __init__(self, schema="IFC4", unit="metre", storeys=(("Ground", 0.0),)):
        self.file = (
            ifcopenshell.file(schema_version=(4, 3, 2, 0))
            if schema[:5] == "IFC4X"
            else ifcopenshell.file(schema=schema)
        )
        self.per_metre = 1 / METRES[unit]
        self._count = 0
        context = self.file.create_entity("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, self.axes())
        self.body = self.context("Body", context)
        self.axis = self.context("Axis", context)
        units = [self.length_unit(unit), self.make("IfcSIUnit", None, "PLANEANGLEUNIT", None, "RADIAN")]
        self.project = self.root(
            "IfcProject",
            Name="Sketch",
            RepresentationContexts=[context],
            UnitsInContext=self.make("IfcUnitAssignment", units),
        )
        self.building = self.root("IfcBuilding", ObjectPlacement=self.place((0, 0, 0)))
        self.whole(self.project, self.building)
        self.storeys = [
            self.root("IfcBuildingStorey", Name=name, ObjectPlacement=self.place((0, 0, z), self.building))
            for name, z in storeys
        ]
        if self.storeys:
            self.whole(self.building, *self.storeys)

    def make(self, *args, **kwargs):
        return self.file.create_entity(*args, **kwargs)

    def root(self, ifc_class, **kwargs):
        self._count += 1
        return self.make(ifc_class, f"{self._count:022d}", **kwargs)

    def context(self, name, parent):
        return self.make(
            "IfcGeometricRepresentationSubContext", name, "Model", ParentContext=parent, TargetView="MODEL_VIEW"
        )

    def length_unit(self, unit):
        if unit != "foot":
            return self.make("IfcSIUnit", None, "LENGTHUNIT", "MILLI" if unit == "millimetre" else None, "METRE")
        size = self.make("IfcMeasureWithUnit", self.make("IfcLengthMeasure", 0.3048), self.length_unit("metre"))
        return self.make(
            "IfcConversionBasedUnit",
            self.make("IfcDimensionalExponents", 1, 0, 0, 0, 0, 0, 0),
            "LENGTHUNIT",
            "FOOT",
            size,
        )

    def point(self, *metres):
        return self.make("IfcCartesianPoint", [float(x) * self.per_metre for x in metres])

    def direction(self, *ratios):
        return self.make("IfcDirection", [float(x) for x in ratios])

    def axes(self, at=(0, 0, 0), up=None, along=None):
        return self.make(
            "IfcAxis2Placement3D", self.point(*at), up and self.direction(*up), along and self.direction(*along)
        )

    def place(self, at, relative_to=None):
        return self.make("IfcLocalPlacement", relative_to and relative_to.ObjectPlacement, self.axes(at))

    def box(self, size, at=(0, 0, 0)):
        """A box whose lower left corner is at `at`."""
        corner = self.make("IfcAxis2Placement2D", self.point(size[0] / 2, size[1] / 2), None)
        profile = self.make(
            "IfcRectangleProfileDef", "AREA", None, corner, size[0] * self.per_metre, size[1] * self.per_metre
        )
        up = self.direction(0, 0, 1)
        return self.make("IfcExtrudedAreaSolid", profile, self.axes(at), up, size[2] * self.per_metre)

    def shape(self, *items, identifier="Body", context=None):
        return self.make("IfcShapeRepresentation", context or self.body, identifier, "SweptSolid", list(items))

    def add(self, ifc_class, *representations, at=(0, 0, 0), within=None, **kwargs):
        """A product; solids given for representations are its body."""
        shapes = [r if r.is_a("IfcRepresentation") else self.shape(r) for r in representations]
        definition = self.make("IfcProductDefinitionShape", None, None, shapes) if shapes else None
        product = self.root(ifc_class, ObjectPlacement=self.place(at), Representation=definition, **kwargs)
        if within is not None:
            self.contain(within, product)
        return product

    def wall(self, size=(4, 0.2, 3), **kwargs):
        return self.add("IfcWall", self.box(size), **kwargs)

    def whole(self, whole, *parts):
        return self.root("IfcRelAggregates", RelatingObject=whole, RelatedObjects=list(parts))

    def contain(self, structure, *products):
        self.root("IfcRelContainedInSpatialStructure", RelatedElements=list(products), RelatingStructure=structure)

    def void(self, host, size, at, filling=None):
        opening = self.add("IfcOpeningElement", self.box(size), at=at)
        self.root("IfcRelVoidsElement", RelatingBuildingElement=host, RelatedOpeningElement=opening)
        if filling is not None:
            self.root("IfcRelFillsElement", RelatingOpeningElement=opening, RelatedBuildingElement=filling)
        return opening

    def type(self, ifc_class, *products, **kwargs):
        kind = self.root(ifc_class, **kwargs)
        self.root("IfcRelDefinesByType", RelatedObjects=list(products), RelatingType=kind)
        return kind

    def read(self, **kwargs) -> Building:
        return to_building(extract(self.file, self.file.to_string().encode(), **kwargs))


def volume(shapes) -> float:
    corners = [shape.world_vertices()[shape.mesh.faces] for shape in shapes]
    return sum(float(np.einsum("ij,ij->i", c[:, 0], np.cross(c[:, 1], c[:, 2])).sum() / 6) for c in corners)


def issue(building, code):
    found = [issue for issue in building.issues if issue.code == code]
    assert len(found) == 1, [issue.code for issue in building.issues]
    return found[0]


def codes(building):
    return {issue.code for issue in building.issues}


def assert_ledger_closes(building):
    ledger = building.ledger
    assert sorted(ledger.asked) == sorted([*ledger.read, *ledger.left_out, *ledger.lost])
    assert len(set(ledger.asked)) == len(ledger.asked)


# ---------------------------------------------------------------- a wall with a door


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("unit", METRES)
def test_a_wall_with_a_door_is_the_same_in_every_schema_and_unit(schema, unit):
    sketch = Sketch(schema, unit, storeys=(("Upper", 3.0), ("Ground", 0.0)))
    ground = sketch.storeys[1]
    wall = sketch.wall(at=(1, 2, 0), within=ground, Name="Wall:thick:1", Tag="77")
    door = sketch.add(
        "IfcDoor",
        sketch.box((0.9, 0.1, 2.1)),
        at=(2, 2, 0),
        Name="Door",
        OverallWidth=0.9 * sketch.per_metre,
        OverallHeight=2.1 * sketch.per_metre,
    )
    opening = sketch.void(wall, (0.9, 0.2, 2.1), (2, 2, 0), filling=door)
    building = sketch.read()

    assert (building.schema, building.unit) == (schema, unit)
    assert [(s.name, pytest.approx(s.elevation)) for s in building.storeys] == [("Ground", 0.0), ("Upper", 3.0)]
    read = building[wall.GlobalId]
    assert (read.family, read.tag, read.storey) == ("Wall", "77", ground.GlobalId)
    assert read.bounds == pytest.approx(np.array([[1, 2, 0], [5, 2.2, 3]]))
    assert volume(read.shapes) == pytest.approx(4 * 0.2 * 3 - 0.9 * 0.2 * 2.1, rel=1e-4)
    assert {shape.mesh.quality for shape in read.shapes} == {"exact"}
    [found] = building.doors
    assert (found.global_id, found.opening.global_id) == (door.GlobalId, opening.GlobalId)
    assert (found.width, found.height) == (pytest.approx(0.9), pytest.approx(2.1))
    assert (found.opening.host, found.opening.fillings) == (wall.GlobalId, (door.GlobalId,))
    assert found.element.storey == ground.GlobalId  # not contained itself: it stands in a wall that is
    assert found.opening.bounds[1] - found.opening.bounds[0] == pytest.approx([0.9, 0.2, 2.1])
    assert_ledger_closes(building)
    assert len(building.ledger.read) == 3


def test_a_door_without_size_or_opening_says_so():
    sketch = Sketch()
    door = sketch.add("IfcDoor", sketch.box((0.9, 0.1, 2)), within=sketch.storeys[0], OverallHeight=0.0)
    building = sketch.read()
    assert (building.doors[0].width, building.doors[0].height, building.doors[0].opening) == (None, None, None)
    assert issue(building, "door-without-opening").global_ids == (door.GlobalId,)


# ---------------------------------------------------------------- openings


def test_the_openings_of_a_whole_cut_its_parts():
    sketch = Sketch()
    whole = sketch.add("IfcWall", within=sketch.storeys[0])
    left, right = (sketch.add("IfcBuildingElementPart", sketch.box((2, 0.2, 3)), at=(x, 0, 0)) for x in (0, 2))
    far = sketch.add("IfcBuildingElementPart", sketch.box((2, 0.2, 3)), at=(20, 0, 0))
    sketch.whole(whole, left, right, far)
    sketch.void(whole, (1, 0.2, 2), (1.5, 0, 0))
    building = sketch.read()
    for part in (left, right):
        assert volume(building[part.GlobalId].shapes) == pytest.approx(2 * 0.2 * 3 - 0.5 * 0.2 * 2, rel=1e-4)
        assert building[part.GlobalId].parent == whole.GlobalId
        assert building[part.GlobalId].storey == sketch.storeys[0].GlobalId
    assert volume(building[far.GlobalId].shapes) == pytest.approx(2 * 0.2 * 3)
    assert building[whole.GlobalId].shapes == ()
    assert "no-shape" not in codes(building)


def test_equal_walls_with_equal_openings_share_one_mesh():
    sketch = Sketch()
    body = sketch.make("IfcRepresentationMap", sketch.axes(), sketch.shape(sketch.box((4, 0.2, 3))))
    walls = []
    for y in range(3):
        item = sketch.make(
            "IfcMappedItem",
            body,
            sketch.make("IfcCartesianTransformationOperator3D", LocalOrigin=sketch.point(0, 0, 0)),
        )
        walls.append(sketch.add("IfcWall", item, at=(0, y, 0)))
        sketch.void(walls[-1], (1, 0.2, 2), (1.5, y, 0))
    model = extract(sketch.file)
    building = to_building(model)
    assert len({id(building[wall.GlobalId].shapes[0].mesh) for wall in walls}) == 1
    assert len(model.tables["meshes"]) == 2  # the cut wall and the opening


def test_a_wall_eaten_by_its_opening_is_read_and_empty():
    sketch = Sketch()
    wall = sketch.wall((1, 0.2, 2))
    sketch.void(wall, (1.2, 0.4, 2.2), (-0.1, -0.1, -0.1))
    building = sketch.read()
    assert building[wall.GlobalId].shapes == ()
    assert issue(building, "eaten-by-openings").global_ids == (wall.GlobalId,)
    assert wall.GlobalId in building.ledger.read


def test_an_open_wall_is_cut_by_the_other_kernel_or_reported():
    sketch = Sketch()
    corners = [sketch.point(*xyz) for xyz in ((0, 0, 0), (4, 0, 0), (4, 0, 3), (0, 0, 3))]
    face = sketch.make("IfcFace", [sketch.make("IfcFaceOuterBound", sketch.make("IfcPolyLoop", corners), True)])
    sheet = sketch.make("IfcFaceBasedSurfaceModel", [sketch.make("IfcConnectedFaceSet", [face])])
    wall = sketch.add("IfcWall", sketch.make("IfcShapeRepresentation", sketch.body, "Body", "SurfaceModel", [sheet]))
    sketch.void(wall, (1, 0.4, 2), (1, -0.2, 0))
    building = sketch.read()
    assert building[wall.GlobalId].shapes
    assert issue(building, "open-shape").global_ids == (wall.GlobalId,)
    assert_ledger_closes(building)


# ---------------------------------------------------------------- bodies


def test_two_bodies_of_one_product_stay_one_element():
    sketch = Sketch()
    representations = [sketch.shape(sketch.box((1, 1, 1), (x, 0, 0))) for x in (0, 5)]
    product = sketch.add("IfcBuildingElementProxy", *representations)
    building = sketch.read()
    assert len(building[product.GlobalId].shapes) == 2
    assert building[product.GlobalId].bounds[1] == pytest.approx([6, 1, 1])
    assert building.ledger.read == (product.GlobalId,)


def test_the_same_body_written_twice_counts_once():
    sketch = Sketch()
    representation = sketch.shape(sketch.box((1, 1, 1)))
    product = sketch.add("IfcBuildingElementProxy", representation, representation)
    assert len(sketch.read()[product.GlobalId].shapes) == 1


@pytest.mark.parametrize("unit", METRES)
def test_half_spaces_are_cut_off(unit):
    sketch = Sketch(unit=unit)
    plane = sketch.make("IfcPlane", sketch.axes((0, 0, 2), up=(0, 0, 1)))
    above = sketch.make("IfcHalfSpaceSolid", plane, False)  # the normal points into the material
    sloped = sketch.make("IfcPlane", sketch.axes((4, 0, 1), up=(1, 0, 1), along=(0, 1, 0)))
    corners = [sketch.make("IfcCartesianPoint", [x * sketch.per_metre, y * sketch.per_metre]) for x, y in
               ((3.0, -1.0), (9.0, -1.0), (9.0, 1.0), (3.0, 1.0), (3.0, -1.0))]  # fmt: skip
    bounded = sketch.make(
        "IfcPolygonalBoundedHalfSpace", sloped, False, sketch.axes(), sketch.make("IfcPolyline", corners)
    )
    item = sketch.box((4, 0.2, 3))
    for cutter in (above, bounded):
        item = sketch.make("IfcBooleanClippingResult", "DIFFERENCE", item, cutter)
    wall = sketch.add("IfcWall", item)
    building = sketch.read()
    corner = 0.5  # a triangle of legs 1 m at x 3..4, z 1..2
    assert volume(building[wall.GlobalId].shapes) == pytest.approx(0.2 * (4 * 2 - corner), rel=1e-4)
    assert building[wall.GlobalId].bounds[1] == pytest.approx([4, 0.2, 2], abs=1e-4)


def test_prisms_that_share_a_slanting_side_leave_no_fin():
    sketch = Sketch()
    item = sketch.box((6, 0.4, 7))
    plane = sketch.make("IfcPlane", sketch.axes((0, 0, 2)))
    outlines = (((-1, -1), (2.7, -1), (3.3, 1.4), (-1, 1.4)), ((2.7, -1), (7, -1), (7, 1.4), (3.3, 1.4)))
    for outline in outlines:
        corners = [sketch.make("IfcCartesianPoint", [float(x), float(y)]) for x, y in (*outline, outline[0])]
        half = sketch.make(
            "IfcPolygonalBoundedHalfSpace", plane, False, sketch.axes(), sketch.make("IfcPolyline", corners)
        )
        item = sketch.make("IfcBooleanResult", "DIFFERENCE", item, half)
    wall = sketch.add("IfcWall", item)
    assert sketch.read()[wall.GlobalId].bounds[1, 2] == pytest.approx(2, abs=1e-4)


def test_what_the_fast_kernel_lacks_the_thorough_one_makes():
    sketch = Sketch()
    disc = sketch.make("IfcCircleProfileDef", "AREA", None, None, 0.1)
    ring = sketch.make(
        "IfcRevolvedAreaSolid",
        disc,
        sketch.axes(),
        sketch.make("IfcAxis1Placement", sketch.point(1, 0, 0), sketch.direction(0, 1, 0)),
        np.pi / 2,
    )
    elbow = sketch.add("IfcPipeFitting", ring)
    building = sketch.read()
    assert volume(building[elbow.GlobalId].shapes) == pytest.approx(np.pi * 0.01 * np.pi / 2, rel=0.03)
    assert building.ledger.lost == {}


def test_equal_solids_get_equal_triangles_whatever_their_numbering():
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.vstack([np.column_stack([rim, np.full(12, z)]) for z in (0.0, 1.0)])
    sides = [f for i in range(12) for f in ((i, (i + 1) % 12, 12 + i), ((i + 1) % 12, 12 + (i + 1) % 12, 12 + i))]

    def cylinder(first):
        ring = np.roll(np.arange(12), first)
        caps = [(ring[0], b, a) for a, b in pairwise(ring[1:])] + [
            (12 + ring[0], 12 + a, 12 + b) for a, b in pairwise(ring[1:])
        ]
        faces = np.array(caps + sides)
        shuffle = rng.permutation(24)
        back = np.argsort(shuffle)
        return canonical(Mesh(vertices[shuffle], back[rng.permutation(faces)]))

    first, *others = [cylinder(k) for k in range(6)]
    assert volume([Shape(first)]) == pytest.approx(3.0)
    for other in others:
        assert np.array_equal(first.vertices, other.vertices)
        assert np.array_equal(first.faces, other.faces)


# ---------------------------------------------------------------- the ledger


def test_what_is_no_part_of_the_building_is_left_out_by_a_named_rule():
    sketch = Sketch()
    wall = sketch.wall()
    expected = {}
    for ifc_class, rule in (
        ("IfcAnnotation", "annotation"),
        ("IfcGrid", "grid"),
        ("IfcDistributionPort", "port"),
        ("IfcSite", "site"),
        ("IfcVirtualElement", "virtual-element"),
        ("IfcStructuralCurveMember", "structural-analysis"),
        ("IfcSpatialZone", "spatial-structure"),
    ):
        expected[sketch.add(ifc_class, sketch.box((1, 1, 1))).GlobalId] = rule
    terrain = sketch.add("IfcGeographicElement", sketch.box((1, 1, 1)), PredefinedType="TERRAIN")
    line = sketch.make("IfcPolyline", [sketch.point(0, 0), sketch.point(1, 0)])
    axis = sketch.shape(line, identifier="Axis", context=sketch.axis)
    axis_only = sketch.add("IfcWall", axis)
    clearance = sketch.add("IfcDoor", sketch.shape(sketch.box((1, 1, 1)), identifier="Clearance"))
    expected |= {terrain.GlobalId: "terrain", axis_only.GlobalId: "no-body", clearance.GlobalId: "no-body"}
    building = sketch.read()
    assert building.ledger.left_out == expected
    assert building.ledger.read == (wall.GlobalId,)
    assert_ledger_closes(building)
    assert building[axis_only.GlobalId].shapes == ()  # an element all the same
    assert {each.ifc_class for each in building.terrain} == {"IfcSite", "IfcGeographicElement"}
    assert all(each.shapes and each.global_id not in building for each in building.terrain)
    assert set(issue(building, "no-body").global_ids) == {axis_only.GlobalId, clearance.GlobalId}


def test_a_clearance_beside_the_body_is_no_obstacle():
    sketch = Sketch()
    chair = sketch.add(
        "IfcFurniture",
        sketch.shape(sketch.box((0.5, 0.5, 1))),
        sketch.shape(sketch.box((3, 3, 1)), identifier="Clearance"),
    )
    assert sketch.read()[chair.GlobalId].bounds[1] == pytest.approx([0.5, 0.5, 1])


def test_a_body_nobody_can_make_is_lost_with_a_reason():
    sketch = Sketch()
    wall = sketch.wall()
    flat = sketch.box((1, 1, 1))
    flat.Depth = 0.0
    broken = sketch.add("IfcBeam", flat)
    huge = sketch.add("IfcSlab", sketch.box((3e5, 1, 1)))
    building = sketch.read()
    assert set(building.ledger.lost) == {broken.GlobalId, huge.GlobalId}
    assert "extrusion" in building.ledger.lost[broken.GlobalId]
    assert "m long" in building.ledger.lost[huge.GlobalId]
    assert building.ledger.read == (wall.GlobalId,)
    assert set(issue(building, "lost-shape").global_ids) == {broken.GlobalId, huge.GlobalId}
    assert issue(building, "lost-shape").severity == "error"
    assert_ledger_closes(building)


def test_a_body_of_which_one_part_fails_is_read_and_listed():
    sketch = Sketch()
    flat = sketch.box((1, 1, 1))
    flat.Depth = 0.0
    table = sketch.add("IfcFurniture", sketch.shape(sketch.box((1, 1, 0.1), (0, 0, 0.7)), flat))
    building = sketch.read()
    assert building.ledger.lost[table.GlobalId].startswith("1 of the 2 parts")
    assert building[table.GlobalId].shapes
    assert_ledger_closes(building)


def test_a_damaged_representation_costs_its_own_product_only():
    sketch = Sketch()
    wall, broken = sketch.wall(), sketch.wall()
    sketch.make("IfcMappedItem")  # without a source
    broken.Representation.Representations[0].Items = [sketch.file.by_type("IfcMappedItem")[0]]
    building = sketch.read()
    assert building.ledger.read == (wall.GlobalId,)
    assert "its representation is empty" in building.ledger.lost[broken.GlobalId]
    assert_ledger_closes(building)


@pytest.mark.parametrize(("kind", "is_lost"), [("SweptSolid", True), ("Brep", True), ("Curve2D", False), (None, False)])
def test_a_representation_that_says_solid_and_holds_none_is_lost(kind, is_lost):
    sketch = Sketch()
    line = sketch.make("IfcPolyline", [sketch.point(0, 0), sketch.point(1, 0)])
    beam = sketch.add("IfcBeam", sketch.shape(line))
    beam.Representation.Representations[0].RepresentationType = kind
    building = sketch.read()
    assert (beam.GlobalId in building.ledger.lost) == is_lost
    assert (building.ledger.left_out == {beam.GlobalId: "no-body"}) != is_lost


def test_the_heartbeat_names_every_product_before_it_is_touched_and_crashed_ones_are_skipped():
    sketch = Sketch()
    walls = [sketch.wall(at=(x, 0, 0)) for x in range(4)]
    beats = []
    sketch.read(heartbeat=lambda *beat: beats.append(beat))
    assert {global_id for _, _, global_id in beats if global_id} == {wall.GlobalId for wall in walls}
    assert beats[-1] == (4, 4, "")  # from here on no product is to blame
    assert [done for done, _, _ in beats] == sorted(done for done, _, _ in beats)
    assert {total for _, total, _ in beats} == {4}
    building = sketch.read(skip={walls[2].GlobalId})
    assert building.ledger.lost == {walls[2].GlobalId: "it crashed the geometry kernel"}
    assert building[walls[2].GlobalId].shapes == ()
    assert_ledger_closes(building)


def test_a_distrusted_product_is_left_to_the_thorough_kernel(monkeypatch):
    sketch = Sketch()
    walls = [sketch.wall(at=(x, 0, 0)) for x in range(3)]
    touched = []

    def recording(file, products, library, *rest):
        touched.extend((library, product.GlobalId) for product in products)
        return _kernel.iterate(file, products, library, *rest)

    monkeypatch.setattr(_tessellate, "iterate", recording)
    building = sketch.read(thorough={walls[1].GlobalId})
    assert touched == [
        *((_kernel.FAST, walls[k].GlobalId) for k in (0, 2)),
        (_kernel.THOROUGH, walls[1].GlobalId),
    ]
    assert volume(building[walls[1].GlobalId].shapes) == pytest.approx(volume(building[walls[0].GlobalId].shapes))


# ---------------------------------------------------------------- identity and text


def test_descriptions_that_say_nothing_are_listed():
    sketch = Sketch()
    sketch.wall()
    assert "placeholder-name" not in codes(sketch.read())
    sketch.project.Phase, sketch.building.LongName = "Project Status", "North wing"
    lines = {"AddressLines": ("Enter address here",), "Town": "Delft"}
    sketch.building.BuildingAddress = sketch.make("IfcPostalAddress", **lines)
    found = issue(sketch.read(), "placeholder-name")
    assert found.message.endswith("project phase 'Project Status', building address 'Enter address here'.")
    assert found.severity == "info"


def test_an_issue_about_one_thing_reads_so():
    sketch = Sketch()
    slab = sketch.add("IfcSlab")
    assert issue(sketch.read(), "no-shape").message == "1 element has neither geometry nor parts, and blocks nothing."
    sketch.add("IfcSlab")
    found = issue(sketch.read(), "no-shape")
    assert found.message == "2 elements have neither geometry nor parts, and block nothing."
    assert found.global_ids[0] == slab.GlobalId


@pytest.mark.parametrize(("rooms", "slabs"), [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_what_the_floor_is_taken_from_is_said_where_rooms_or_slabs_are_missing(rooms, slabs):
    sketch = Sketch()
    sketch.wall()
    for ifc_class, number in (("IfcSpace", rooms), ("IfcSlab", slabs)):
        if number:
            sketch.add(ifc_class, sketch.box((4, 4, 0.2)))
    building = sketch.read()
    source = "rooms" if rooms else "slabs" if slabs else "walls"
    hints = [found.hint for found in building.issues if found.code in ("no-spaces", "no-slabs")]
    assert len(hints) == (not rooms) + (not slabs)
    assert all(f"taken from {source}" in hint for hint in hints)


def test_every_product_has_a_global_id_of_its_own():
    sketch = Sketch()
    good, same, empty, none, short = (sketch.wall(at=(x, 0, 0)) for x in range(5))
    same.GlobalId, empty.GlobalId, none.GlobalId, short.GlobalId = good.GlobalId, "", "None", "wall-1"
    first, second = sketch.read(), sketch.read()
    ids = [element.global_id for element in first.elements]
    assert ids[0] == good.GlobalId
    assert len(set(ids)) == 5
    assert all(len(global_id) == 22 for global_id in ids)
    assert ids == [element.global_id for element in second.elements]
    assert issue(first, "bad-global-id").global_ids == tuple(ids[1:])
    assert_ledger_closes(first)


def test_names_written_as_a_star_do_not_cost_the_body():
    sketch = Sketch("IFC2X3")
    wall = sketch.wall(Name="W", Description="D", Tag="T", within=sketch.storeys[0])
    text = sketch.file.to_string().replace("'W','D'", "*,*").replace("'T'", "*")
    building = to_building(extract(ifcopenshell.file.from_string(text)))
    assert (building[wall.GlobalId].name, building[wall.GlobalId].tag) == ("", "")
    assert volume(building[wall.GlobalId].shapes) == pytest.approx(2.4)
    assert issue(building, "star-attributes").global_ids == (wall.GlobalId,)


def test_type_and_predefined_type_come_from_the_type_object_too():
    sketch = Sketch()
    chair, own, plain = (sketch.add("IfcFurniture", ObjectType="oak") for _ in range(3))
    own.PredefinedType = "USERDEFINED"
    sketch.type("IfcFurnitureType", chair, Name="Breuer", PredefinedType="CHAIR")
    building = sketch.read()
    read = building[chair.GlobalId]
    assert (read.type_name, read.object_type, read.predefined_type) == ("Breuer", "oak", "CHAIR")
    assert building[own.GlobalId].predefined_type == "oak"
    assert building[plain.GlobalId].predefined_type == ""


# ---------------------------------------------------------------- storeys and rooms


@pytest.mark.parametrize("unit", METRES)
def test_a_storey_is_as_high_as_its_placement_in_the_world(unit):
    sketch = Sketch(unit=unit, storeys=(("B", 3.0), ("A", 0.0)))
    sketch.building.ObjectPlacement.RelativePlacement.Location.Coordinates = (0.0, 0.0, 10 * sketch.per_metre)
    for storey in sketch.storeys:
        storey.Elevation = 99.0
    assert [(s.name, pytest.approx(s.elevation)) for s in sketch.read().storeys] == [("A", 10), ("B", 13)]


def test_elevation_counts_where_all_placements_are_at_zero_or_missing():
    sketch = Sketch(unit="millimetre", storeys=(("A", 0.0), ("B", 0.0)))
    sketch.storeys[1].Elevation = 3000.0
    assert [s.elevation for s in sketch.read().storeys] == [0.0, 3.0]
    sketch.storeys[0].ObjectPlacement = None
    sketch.storeys[0].Elevation = -2500.0
    assert [s.elevation for s in sketch.read().storeys] == [-2.5, 3.0]


def test_a_model_without_storeys_gets_one_at_its_lowest_floor():
    sketch = Sketch(storeys=())
    sketch.wall(at=(0, 0, -1), within=sketch.building)
    first, second = sketch.read(), sketch.read()
    assert [(s.name, s.elevation) for s in first.storeys] == [("derived", -1.0)]
    assert first.storeys[0].global_id == second.storeys[0].global_id
    assert first.elements[0].storey == first.storeys[0].global_id
    assert "no-storeys" in codes(first)
    sketch.add("IfcSlab", sketch.box((4, 4, 0.25)), at=(0, 0, -0.5))
    assert sketch.read().storeys[0].elevation == pytest.approx(-0.25)
    sketch.add("IfcSpace", sketch.box((4, 4, 2)), at=(0, 0, 0.5))
    assert sketch.read().storeys[0].elevation == pytest.approx(0.5)


def test_furniture_in_a_room_belongs_to_the_storey_of_the_room():
    sketch = Sketch()
    room = sketch.add("IfcSpace", sketch.box((4, 4, 2.5)), Name="1", LongName="Living room")
    sketch.whole(sketch.storeys[0], room)
    sofa = sketch.add("IfcFurniture", sketch.box((2, 1, 1)), within=room)
    lost = sketch.add("IfcFurniture", sketch.box((2, 1, 1)))
    sketch.whole(sketch.building, lost)
    building = sketch.read()
    read = building[sofa.GlobalId]
    assert (read.space, read.storey, read.parent) == (room.GlobalId, sketch.storeys[0].GlobalId, None)
    assert (building.spaces[0].label, building.spaces[0].storey) == ("1 Living room", read.storey)
    assert building.spaces[0].bounds[1] == pytest.approx([4, 4, 2.5])
    assert room.GlobalId not in building
    assert issue(building, "outside-storeys").global_ids == (lost.GlobalId,)
    assert building[lost.GlobalId].parent is None  # a building is no element


def test_storeys_that_hold_nothing_or_are_only_levels_are_named():
    sketch = Sketch(storeys=(("Floor", 0.0), ("T.O. floor", 0.36), ("Roof", 6.0)))
    sketch.wall(within=sketch.storeys[0])
    building = sketch.read()
    assert issue(building, "empty-storey").global_ids == tuple(s.global_id for s in building.storeys[1:])
    assert issue(building, "level-storey").global_ids == tuple(s.global_id for s in building.storeys[:2])


def test_parts_that_are_wholes_of_each_other_are_told_apart():
    sketch = Sketch()
    left, right = sketch.wall(), sketch.wall()
    sketch.whole(left, right)
    sketch.whole(right, left)
    sketch.void(left, (1, 0.2, 2), (1, 0, 0))
    building = sketch.read()
    assert building[right.GlobalId].parent == left.GlobalId
    assert building[left.GlobalId].parent is None
    assert issue(building, "part-of-itself").global_ids == (left.GlobalId,)
    assert volume(building[right.GlobalId].shapes) == pytest.approx(2.0, rel=1e-4)


def test_what_a_robot_would_miss_is_said():
    sketch = Sketch()
    room = sketch.add("IfcSpace", Name="1")
    bare = sketch.add("IfcFurniture", within=sketch.storeys[0])
    building = sketch.read()
    assert issue(building, "space-without-shape").global_ids == (room.GlobalId,)
    assert issue(building, "no-shape").global_ids == (bare.GlobalId,)
    assert "no-geometry" in codes(building)


# ---------------------------------------------------------------- connectors


def test_a_stair_ends_at_its_treads_and_not_at_its_railing():
    sketch = Sketch()
    stair = sketch.add("IfcStair", within=sketch.storeys[0], Name="Main")
    flight = sketch.add("IfcStairFlight", sketch.box((1, 3, 2.8)), within=sketch.storeys[0])
    railing = sketch.add("IfcRailing", sketch.box((0.05, 3, 3.8)))
    sketch.whole(stair, flight, railing)
    [found] = sketch.read().connectors
    assert (found.global_id, found.name, found.kind) == (stair.GlobalId, "Main", "stair")
    assert found.parts == (flight.GlobalId, railing.GlobalId)
    assert (found.low, found.high) == (pytest.approx(0), pytest.approx(2.8))


def test_lifts_are_known_by_class_or_by_a_whole_word():
    sketch = Sketch()
    body = (2, 2, 8)
    lift = sketch.add("IfcTransportElement", sketch.box(body), PredefinedType="ELEVATOR")
    escalator = sketch.add("IfcTransportElement", sketch.box(body), PredefinedType="ESCALATOR")
    crane = sketch.add("IfcTransportElement", sketch.box(body), PredefinedType="CRANEWAY")
    revit = sketch.add("IfcFlowTerminal", sketch.box(body), Name="M_Elevator-Hydraulic:3500 lbs:215470")
    for name in ("M_Elevator Door-Center:48", "Duplex Receptacle", "Shoplifter", "Forklifts"):
        sketch.add("IfcFlowTerminal", sketch.box(body), Name=name)
    ramp = sketch.add("IfcRampFlight", sketch.box(body))
    empty = sketch.add("IfcRamp")
    building = sketch.read()
    kinds = {connector.global_id: connector.kind for connector in building.connectors}
    assert kinds == {
        lift.GlobalId: "lift",
        escalator.GlobalId: "stair",
        revit.GlobalId: "lift",
        ramp.GlobalId: "ramp",
    }
    assert crane.GlobalId in building
    assert issue(building, "connector-without-shape").global_ids == (empty.GlobalId,)


# ---------------------------------------------------------------- refusals


def test_a_file_without_project_is_refused():
    with pytest.raises(IfcStructureError, match="no IfcProject"):
        extract(ifcopenshell.file(schema="IFC4"))


@pytest.mark.parametrize("scale", [0.0, -1.0, float("inf"), 1e18])
def test_a_length_unit_must_be_a_sensible_number_of_metres(scale):
    sketch = Sketch(unit="foot")
    text = sketch.file.to_string().replace("IFCLENGTHMEASURE(0.3048)", f"IFCLENGTHMEASURE({scale:.1e})".upper())
    with pytest.raises(IfcUnitsError):
        extract(ifcopenshell.file.from_string(text))


def test_none_or_several_length_units_are_refused():
    sketch = Sketch()
    assignment = sketch.project.UnitsInContext
    assignment.Units = [*assignment.Units, sketch.length_unit("millimetre")]
    with pytest.raises(IfcUnitsError, match="2 length units"):
        extract(sketch.file)
    assignment.Units = assignment.Units[1:2]
    with pytest.raises(IfcUnitsError, match="no length unit"):
        extract(sketch.file)
    sketch.project.UnitsInContext = None
    with pytest.raises(IfcUnitsError, match="no length unit"):
        extract(sketch.file)


def test_equal_files_give_equal_models():
    def model():
        sketch = Sketch()
        wall = sketch.wall(within=sketch.storeys[0])
        sketch.void(wall, (1, 0.2, 2), (1, 0, 0))
        return extract(sketch.file)

    first, second = model(), model()
    assert json.dumps(first.tables, allow_nan=False) == json.dumps(second.tables, allow_nan=False)
    assert all(np.array_equal(first.arrays[name], second.arrays[name]) for name in first.arrays)


# ---------------------------------------------------------------- real models


def read_real(name) -> Building:
    return to_building(extract(ifcopenshell.open(real_model(name))))


def manifest():
    path = REAL_IFC / "manifest.json"
    files = json.loads(path.read_text())["files"] if path.exists() else []
    slow = {"fm/Ifc4WithNestedLists.ifczip"}  # one body of rational splines
    return [facts for facts in files if facts["name"] not in slow and facts["storeys"]]


@pytest.mark.parametrize("facts", manifest(), ids=lambda facts: facts["name"])
def test_real_models_are_read_as_their_facts_say(facts):
    building = read_real(facts["name"])
    counts, geometry = facts["counts"], facts["geometry"]
    assert_ledger_closes(building)
    assert building.ledger.lost == {}
    assert building.schema == facts["schema"]
    assert sorted(s.name for s in building.storeys) == sorted(s["name"] for s in facts["storeys"])
    stated = [storey["placement_z"] for storey in facts["storeys"]]
    if any(stated):
        heights = sorted(z * facts["unit_scale_m"] for z in stated)
        assert [s.elevation for s in building.storeys] == pytest.approx(heights, abs=1e-3)
    assert len(building.spaces) == counts.get("IfcSpace", 0)
    assert len(building.doors) == counts.get("IfcDoor", 0)
    assert len({e.global_id for e in building.elements}) == len(building.elements)
    if geometry["bbox_elements_m"] and not geometry["missing"]:
        boxes = [element.bounds for element in building.elements if element.shapes]
        lows, highs = zip(*boxes, strict=True)
        found = np.array([np.min(lows, axis=0), np.max(highs, axis=0)])
        assert np.allclose(found, geometry["bbox_elements_m"], rtol=0, atol=0.006)


def test_renga_house_gives_all_its_147_shapes():
    building = read_real("nasty/House.ifc")
    shaped = [thing for thing in (*building.elements, *building.spaces) if thing.shapes]
    assert len(shaped) == 147
    roof = building["2FzACFrWn78vGKEK4Md6ha"]  # eleven polygonal half-spaces
    assert volume(roof.shapes) == pytest.approx(5.9503, rel=1e-4)
    assert roof.bounds[1, 2] - roof.bounds[0, 2] == pytest.approx(4.4753, abs=1e-3)


def test_pipe_fittings_with_two_bodies_stay_one_product():
    building = read_real("mep/b03_heating_with_building_blenderBIM.ifc")
    assert sum(bool(thing.shapes) for thing in (*building.elements, *building.spaces)) == 255


def test_a_model_with_bad_ids_keeps_its_two_doors_apart():
    building = read_real("nasty/AC20-FZK-Haus_NoneAndDoubleGUID.ifc")
    assert len(issue(building, "bad-global-id").global_ids) == 4
    assert len({door.global_id for door in building.doors}) == 5


def test_an_office_has_stairs_and_a_lift_that_is_a_flow_terminal_but_no_floor():
    building = read_real("office/Office_A_20110811.ifc")
    assert [c.kind for c in building.connectors] == ["stair", "stair", "lift"]
    lift = building.connectors[2]
    assert lift.global_id == "30m8$YfMH4shi72utyayEh"
    assert (lift.low, lift.high) == (pytest.approx(-1.22, abs=0.01), pytest.approx(8.53, abs=0.01))
    assert "no-slabs" in codes(building)


def test_feet_and_metres_of_one_building_agree():
    feet, metres = read_real("duplex/Ifc2s3_Duplex_Electrical.ifc"), read_real("duplex/Duplex_A_20110907.ifc")
    level = {storey.name: storey.elevation for storey in metres.storeys}
    for storey in feet.storeys:
        assert storey.elevation == pytest.approx(level[storey.name], abs=1e-3)


def test_a_hand_over_file_without_geometry_is_read_and_its_unit_doubted():
    building = read_real("duplex/2012-03-23-Duplex-Handover.ifc")
    assert len(building.elements) == 232
    assert {"no-geometry", "doubtful-unit"} <= codes(building)


def test_a_library_of_types_is_an_empty_building():
    building = read_real("library/IFC4 Furniture Library.ifc")
    assert (building.elements, building.storeys[0].name) == ((), "derived")
    assert {"no-geometry", "no-storeys"} <= codes(building)


def test_a_model_without_storeys_is_read_in_whole():
    building = read_real("nasty/nested_mapped_item.ifc")
    assert (len(building.ledger.read), building.ledger.lost) == (70, {})
    assert building.storeys[0].elevation == pytest.approx(-0.15)  # the base of its rooms


def test_a_file_that_lost_its_project_is_refused():
    with pytest.raises(IfcStructureError):
        read_real("nasty/errorfile.ifc")
