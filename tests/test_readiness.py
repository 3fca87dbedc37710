"""What a robot reaches, and why not the rest: in small worlds with one fault each, and in real models."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
import shapely

import bimnav as bn
from bimnav.readiness import readiness
from bimnav.testing import box, prism_shape, room, two_rooms
from tests.conftest import real_model


def rooms(report):
    return {room.global_id: room for room in report.rooms}


def codes(report):
    return {issue.code for issue in report.issues}


def with_bath(house, *elements, door=True):
    """Add a room of 2 x 4 m east of two rooms, with a door of 0.9 m or none."""
    bath = bn.Space("bath", "Bath", storey="storey", shapes=(prism_shape(shapely.box(8.4, 0, 10.4, 4), 0, 2.5),))
    plan, gap = shapely.box(8.2, 0, 8.4, 4), shapely.box(8.2, 1.5, 8.4, 2.4)
    cut = list(plan.difference(gap).geoms) if door else [plan]
    wall = bn.Element("wall-bath", "IfcWall", shapes=tuple(prism_shape(part, 0, 2.5) for part in cut))
    east = [box("wall-far", 10.4, 0, 0, 10.6, 4, 2.5, ifc_class="IfcWall")]
    doors, openings = house.doors, house.openings
    if door:
        opening = bn.Opening("opening-bath", "wall-bath", ("door-bath",), (prism_shape(gap, 0, 2.1),))
        leaf = box("door-bath", 8.28, 1.5, 0, 8.32, 2.4, 2.1, ifc_class="IfcDoor", name="Bath door")
        doors, openings = (*doors, bn.Door(leaf, opening, 0.9, 2.1)), (*openings, opening)
        east.append(leaf)
    kept = [e for e in house.elements if e.global_id != "wall-east"]
    return replace(
        house,
        spaces=(*house.spaces, bath),
        elements=(*kept, wall, *east, *elements),
        doors=tuple(replace(d, clear_width=None) for d in doors),
        openings=openings,
        ledger=bn.Ledger(),
    )


def test_a_robot_that_fits_reaches_everything():
    report = readiness(two_rooms(), bn.Robot(radius=0.2))
    assert report.unreached == ()
    assert report.to_dict()["share"]["rooms"] == 1.0
    (storey,) = report.storeys
    assert (storey.rooms_reached, storey.rooms, storey.doors_connecting, storey.doors, storey.parts) == (2, 2, 1, 1, 1)
    assert storey.floor_area == pytest.approx(32.2, abs=0.2)
    assert 0.95 < storey.reached_area / storey.floor_area < 1  # corners are round


def test_the_default_robot_is_half_a_metre_wide():
    report = two_rooms().readiness()
    assert (report.robot.radius, report.cell_size) == (0.25, 0.05)


def test_a_point_reaches_all_of_the_floor():
    (storey,) = readiness(two_rooms(), bn.Robot(radius=0.0)).storeys
    assert storey.reached_area == storey.floor_area


def test_a_room_behind_a_narrow_door_tells_the_door_and_the_centimetres():
    report = readiness(two_rooms(4, 3, door_width=0.42))
    (lost,) = report.unreached
    assert (lost.reason, lost.culprits) == ("narrow", ("door",))
    assert "8 cm too narrow" in lost.detail
    assert lost.hint


def test_the_first_closed_door_on_the_way_is_told_and_how_many_follow():
    table = box("table", 5, 3.4, 0, 8, 4, 1.0, name="Table")  # makes the western room the larger part
    crate = box("crate", 8.4, 1.2, 0, 8.8, 2.7, 1.0, name="Crate")
    lost = rooms(readiness(with_bath(two_rooms(door_width=0.42), table, crate)))
    assert lost["space-west"].reached
    assert lost["space-east"].culprits == ("door",)
    assert lost["bath"].reason == "narrow"
    assert lost["bath"].detail.endswith("1 more on the way")
    assert lost["bath"].culprits == ("door", "door-bath", "crate")


def test_a_room_without_a_door_is_told_and_listed_as_an_issue():
    report = readiness(with_bath(two_rooms(), door=False))
    (lost,) = report.unreached
    assert (lost.global_id, lost.reason) == ("bath", "no-door")
    (issue,) = (issue for issue in report.issues if issue.code == "room-without-door")
    assert issue.global_ids == ("bath",)
    assert issue.hint


def test_a_crate_in_the_doorway_is_named():
    crate = box("crate", 8.4, 1.2, 0, 8.8, 2.7, 1.0, name="Crate")
    lost = rooms(readiness(with_bath(two_rooms(), crate)))["bath"]
    assert lost.reason == "blocked"
    assert lost.culprits == ("door-bath", "crate")
    assert "Crate" in lost.detail


def test_furniture_that_cuts_a_storey_in_two_is_named():
    halls = [
        bn.Space(name, name, storey="storey", shapes=(prism_shape(shapely.box(x, 0, x + 4, 4), 0, 2.5),))
        for name, x in (("west", 0), ("east", 4))
    ]
    shelf = box("shelf", 5.0, 0, 0, 5.4, 4, 2.0, ifc_class="IfcFurniture", name="Shelf")
    lost = rooms(readiness(replace(room(8, 4, elements=[shelf]), spaces=tuple(halls))))
    assert lost["west"].reached
    assert lost["east"].reached  # the shelf stands in it, but its western part is open
    full = [replace(halls[1], shapes=(prism_shape(shapely.box(5.4, 0, 8, 4), 0, 2.5),)), halls[0]]
    middle = bn.Space("middle", "middle", storey="storey", shapes=(prism_shape(shapely.box(4, 0, 5.4, 4), 0, 2.5),))
    lost = rooms(readiness(replace(room(8, 4, elements=[shelf]), spaces=(*full, middle))))["east"]
    assert (lost.reached, lost.reason, lost.culprits) == (False, "furniture", ("shelf",))


def test_a_room_full_of_things_and_one_too_small_are_told_apart():
    chests = [box(f"chest {k}", 8.4 + k * 0.5, 0, 0, 8.8 + k * 0.5, 4, 1.0, name="Chest") for k in range(4)]
    lost = rooms(readiness(with_bath(two_rooms(), *chests)))["bath"]
    assert lost.reason == "full"
    assert "Chest" in lost.detail
    lost = rooms(readiness(with_bath(two_rooms()), bn.Robot(radius=1.2)))["bath"]
    assert lost.reason == "small"


def test_a_part_with_a_door_to_the_outside_is_told_to_be_reached_from_there():
    west = two_rooms(door_width=None)
    far = replace(west, spaces=tuple(reversed(west.spaces)))
    gap = shapely.box(-0.2, 1.5, 0, 2.5)
    wall = far["wall-west"]
    plan = shapely.box(-0.2, 0, 0, 4).difference(gap)
    cut = replace(wall, shapes=tuple(prism_shape(part, 0, 2.5) for part in plan.geoms))
    opening = bn.Opening("opening", "wall-west", ("entrance",), (prism_shape(gap, 0, 2.1),))
    leaf = box("entrance", -0.12, 1.5, 0, -0.08, 2.5, 2.1, ifc_class="IfcDoor", name="Entrance")
    crate = box("crate", 0.5, 0.5, 0, 3.5, 1.0, 1.0)  # makes the western part the smaller one
    elements = (*(cut if e.global_id == "wall-west" else e for e in far.elements), leaf, crate)
    house = replace(
        far, elements=elements, doors=(bn.Door(leaf, opening, 1.0),), openings=(opening,), ledger=bn.Ledger()
    )
    (lost,) = readiness(house).unreached
    assert (lost.global_id, lost.reason, lost.culprits) == ("space-west", "outside", ("entrance",))


def test_a_gallery_that_only_a_stair_leads_to_is_told():
    loft = bn.Space("loft", "Loft", storey="storey", shapes=(prism_shape(shapely.box(4, 0, 6, 4), 2.5, 5),))
    deck = box("deck", 4, 0, 2.3, 8, 4, 2.5, ifc_class="IfcSlab")
    attic = bn.Space("attic", "Attic", storey="storey", shapes=(prism_shape(shapely.box(6.2, 0, 8, 4), 2.5, 5),))
    wall = box("wall", 6, 0, 2.5, 6.2, 4, 5, ifc_class="IfcWall")
    flight = bn.Element(
        "stair",
        "IfcStair",
        "Stair",
        shapes=tuple(
            prism_shape(shapely.box(1 + k * 0.25, 1, 1.25 + k * 0.25, 2), 0, 0.2 + 0.2 * k) for k in range(12)
        ),
    )
    hall = room(8, 4, height=5, elements=[deck, wall, flight])
    stair = bn.Connector("stair", "Stair", "stair", ("stair",), 0.0, 2.4)
    report = readiness(replace(hall, spaces=(*hall.spaces, loft, attic), connectors=(stair,)))
    assert report.storeys[1].connectors == ("stair",)
    lost = rooms(report)
    assert lost["loft"].reached
    assert (lost["attic"].reached, lost["attic"].reason) == (False, "no-door")
    smaller = replace(loft, shapes=(prism_shape(shapely.box(4, 0, 5.6, 4), 2.5, 5),))
    wide = replace(attic, shapes=(prism_shape(shapely.box(5.8, 0, 8, 4), 2.5, 5),))
    wall = box("wall", 5.6, 0, 2.5, 5.8, 4, 5, ifc_class="IfcWall")
    hall = room(8, 4, height=5, elements=[deck, wall, flight])
    lost = rooms(readiness(replace(hall, spaces=(*hall.spaces, smaller, wide), connectors=(stair,))))["loft"]
    assert (lost.reached, lost.reason, lost.culprits) == (False, "stairs", ("stair",))


def test_shafts_are_rooms_that_need_not_be_reached():
    house = two_rooms(door_width=None)
    lift = replace(house.spaces[1], name="Lift")
    report = readiness(replace(house, spaces=(house.spaces[0], lift)))
    assert report.to_dict()["share"]["rooms"] == 1.0
    assert rooms(report)["space-east"].reason == "shaft"


def test_what_is_doubtful_in_a_model_is_listed_with_advice():
    chair = bn.Element(
        "chair", "IfcBuildingElementProxy", "Office Chair:Black:123", shapes=box("x", 1, 1, 0, 1.5, 1.5, 1).shapes
    )
    receptacle = bn.Element(
        "socket", "IfcBuildingElementProxy", "Duplex Receptacle", shapes=box("x", 0, 1, 0.3, 0.02, 1.1, 0.4).shapes
    )
    lost_leaf = box("lost", 30, 0, 0, 31, 0.1, 2, ifc_class="IfcDoor")
    values = {
        "Pset": {"SerialNumber": "SerialNumber", "BarCode": "n/a", "Warranty": "DD/MM/YYYY", "Color": "red", "Phase": 0}
    }
    house = two_rooms(elements=[chair, receptacle, lost_leaf])
    house = replace(
        house,
        doors=(*house.doors, bn.Door(lost_leaf)),
        issues=(bn.Issue("doubtful-unit", "the unit looks wrong."),),
        property_reader=lambda global_id: values if global_id == "chair" else {},
    )
    issues = {issue.code: issue for issue in readiness(house).issues}
    assert issues["furniture-as-proxy"].global_ids == ("chair",)
    assert issues["door-to-nowhere"].global_ids == ("lost",)
    assert issues["placeholder-data"].global_ids == ("chair",)
    assert "SerialNumber = 'SerialNumber', BarCode = 'n/a'" in issues["placeholder-data"].message
    assert "doubtful-unit" in issues
    assert all(issue.hint for code, issue in issues.items() if code != "doubtful-unit")


def test_floor_without_a_room_that_cannot_be_reached_is_an_island():
    house = two_rooms(door_width=None, elements=[box("slab", -1, -1, -0.2, 10, 5, 0, ifc_class="IfcSlab")])
    report = readiness(replace(house, spaces=house.spaces[:1]))
    (island,) = (issue for issue in report.issues if issue.code == "island")
    assert island.global_ids == ("slab",)


def test_a_building_without_floor_gets_a_report_all_the_same():
    report = readiness(bn.Building("void", (bn.Storey("s", "Level", 0.0),)))
    assert report.to_dict()["share"] == {"rooms": None, "floor": None, "doors": None}
    assert report.to_html()


def test_cells_grow_where_the_grid_would_be_too_large(monkeypatch):
    monkeypatch.setattr("bimnav.grid.CELL_LIMIT", 8_000)
    report = readiness(two_rooms())
    assert report.cell_size > 0.05
    assert report.unreached == ()


# the report on paper


def test_the_report_is_plain_json():
    values = json.loads(json.dumps(readiness(with_bath(two_rooms(), door=False)).to_dict(), allow_nan=False))
    assert values["share"]["rooms"] == pytest.approx(2 / 3)
    assert {"building", "robot", "cell_size", "share", "storeys", "rooms", "doors", "connectors", "issues"} == set(
        values
    )


class _Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self.open, self.attributes = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_the_page_needs_nothing_else_and_runs_nothing():
    name = "<script>alert('x')</script>\"'&"
    house = replace(with_bath(two_rooms(), door=False), name=name)
    house = replace(house, spaces=tuple(replace(space, name=name) for space in house.spaces))
    text = readiness(house, bn.Robot(name=name, radius=0.2)).to_html()
    page = _Page(text)
    assert not page.open
    assert "script" not in page.tags
    assert not {"link", "img", "iframe", "object"} & set(page.tags)
    assert not any(key.startswith("on") or key in ("src", "href", "style") for key, _ in page.attributes)
    assert "default-src 'none'" in dict(page.attributes)["content"] or "default-src 'none'" in text
    assert not re.search(r"https?://|url\((?!#)", text)
    assert name in "".join(page.words)
    assert text.count("<svg viewBox") >= 1


def test_equal_inputs_give_an_equal_page():
    assert readiness(two_rooms()).to_html() == readiness(two_rooms()).to_html()


# real models


def test_the_office_tells_why_three_rooms_are_not_reached():
    report = bn.read_ifc(real_model("office/Office_A_20110811.ifc")).readiness()
    assert {room.name: room.reason for room in report.unreached} == {
        "118 MECH RM": "outside",
        "108 ELEC RM": "outside",
        "124 ELEV": "shaft",
    }
    assert report.to_dict()["share"]["doors"] == 1.0
    assert "placeholder-data" in codes(report)


def test_the_duplex_tells_that_its_flats_are_joined_outside_and_over_stairs_alone():
    report = bn.read_ifc(real_model("duplex/Duplex_A_20110907.ifc")).readiness()
    reasons = {(report.storeys[room.storey].name, room.reason) for room in report.unreached}
    assert reasons == {("Level 1", "outside"), ("Level 2", "stairs"), ("Roof", "full")}


def test_a_broken_identity_and_a_doubtful_unit_of_a_real_model_are_passed_on():
    report = bn.read_ifc(real_model("nasty/AC20-FZK-Haus_NoneAndDoubleGUID.ifc")).readiness()
    assert "bad-global-id" in codes(report)
    report = bn.read_ifc(real_model("duplex/2012-03-23-Duplex-Handover.ifc")).readiness()
    assert {"doubtful-unit", "space-without-shape"} <= codes(report)
    assert {room.reason for room in report.unreached} == {"no-shape"}


def test_the_hall_of_the_hand_written_model_is_kept_off_by_a_step():
    report = bn.read_ifc(real_model("fm/BasicFM_wAssembly.ifc")).readiness()
    assert {room.name: room.reason for room in report.unreached} == {
        "EG.003 Hall": "step",
        "OG1.004 Toilette": "no-door",
    }
    climber = bn.read_ifc(real_model("fm/BasicFM_wAssembly.ifc")).readiness(bn.Robot(radius=0.25, step_height=0.11))
    assert all(door.connects for door in climber.doors)
