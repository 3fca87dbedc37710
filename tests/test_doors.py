"""Doors measured and tried, in small worlds and in every real model that has doors."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
import shapely

import bimnav as bn
from bimnav._doorways import doorway_of
from bimnav.readiness import doors_of
from bimnav.testing import box, prism_shape, two_rooms
from tests.conftest import real_model

LOOK = bn.Task("look", "nothing to visit")
WIDE = bn.Robot(radius=0.25)

# doors, those that connect, and the reasons of the others, for a robot 0.5 m wide at cells of 5 cm;
# the page docs/readiness.md publishes them
REAL = {
    "duplex/Duplex_A_20110907.ifc": (14, 14, {}),
    "fm/BasicFM_wAssembly.ifc": (4, 3, {"step": 1}),
    "houses/231110AC11-FZK-Haus-IFC.ifc": (5, 5, {}),
    "houses/SampleHouse4.ifc": (3, 3, {}),
    "ifc4x3/wall_door_columnt_rgb4x3.ifc": (1, 1, {}),
    "nasty/AC20-FZK-Haus_NoneAndDoubleGUID.ifc": (5, 5, {}),
    "nasty/House.ifc": (19, 18, {"sill": 1}),
    "nasty/Jesse.1.ifc": (61, 61, {}),
    "nasty/nested_mapped_item.ifc": (7, 0, {"no-floor": 7}),
    "office/Office_A_20110811.ifc": (102, 102, {}),
    "office/demo2.ifc": (6, 6, {}),
    "rooms/3rooms_Heater_AirTerminal_Table_with_SB.ifc": (4, 4, {}),
    "rooms/Standard_Classroom_CIC_6_Project_mod2.ifc": (1, 1, {}),
    "rooms/tested_sample_project.ifc": (1, 1, {}),
}


def tried(building, robot=WIDE, **choices):
    return doors_of(bn.make_environment(building, LOOK, robot, **choices))


def with_sill(height):
    """Make two rooms whose door has a sill."""
    house = two_rooms()
    (door,) = house.doors
    gap = shapely.box(4, 1.55, 4.2, 2.45)
    opening = replace(door.opening, shapes=(prism_shape(gap, height, 2.1),))
    between = house["wall-between"]
    wall = replace(between, shapes=(*between.shapes, prism_shape(gap, 0, height)))
    elements = tuple(wall if e.global_id == wall.global_id else e for e in house.elements)
    doors = (replace(door, opening=opening, clear_width=None),)
    return replace(house, elements=elements, doors=doors, openings=(opening,))


# measures


def test_a_door_knows_its_width_its_sill_and_its_rooms():
    (door,) = two_rooms(door_width=0.8).doors
    assert door.clear_width == pytest.approx(0.8)
    assert door.sill == pytest.approx(0.0)
    assert set(door.spaces) == {"space-west", "space-east"}


def test_a_sill_is_measured_from_the_lower_floor():
    house = with_sill(0.12)
    assert house.doors[0].sill == pytest.approx(0.12)
    east = house.spaces[1]
    sunk = replace(east, shapes=(prism_shape(shapely.box(4.2, 0, 8.2, 4), -0.3, 2.5),))
    house = replace(house, spaces=(house.spaces[0], sunk), doors=(replace(house.doors[0], clear_width=None),))
    assert house.doors[0].sill == pytest.approx(0.42)


def test_a_door_leads_outside_if_no_room_lies_behind_it():
    house = two_rooms()
    unmeasured = replace(house.doors[0], clear_width=None)
    west, east = house.spaces
    assert not house.doors[0].to_outside
    assert replace(house, spaces=(west,), doors=(unmeasured,)).doors[0].to_outside
    assert not replace(house, spaces=(), doors=(unmeasured,)).doors[0].to_outside  # nobody knows
    up = replace(east, shapes=(prism_shape(shapely.box(4.2, 0, 8.2, 4), 0.6, 2.5),))  # a few steps up
    assert not replace(house, spaces=(west, up), doors=(unmeasured,)).doors[0].to_outside
    beyond = replace(east, shapes=(prism_shape(shapely.box(6.0, 0, 8.2, 4), 0.0, 2.5),))  # behind a stairwell
    assert not replace(house, spaces=(west, beyond), doors=(unmeasured,)).doors[0].to_outside


def test_a_door_to_a_balcony_does_not_lead_outside():
    house = two_rooms()
    (door,), (west, _) = house.doors, house.spaces
    upper = bn.building.Space("up", "up", shapes=(prism_shape(shapely.box(0, 0, 4, 4), 3.0, 5.5),))
    gap = prism_shape(shapely.box(4, 1.55, 4.2, 2.45), 3.0, 5.1)
    opening = bn.building.Opening("opening-up", "wall-between", ("door-up",), (gap,))
    leaf = box("door-up", 4.08, 1.55, 3.0, 4.12, 2.45, 5.1, ifc_class="IfcDoor")
    doors = (replace(door, clear_width=None), bn.building.Door(leaf, opening, 0.9, 2.1))
    house = replace(house, spaces=(west, upper), doors=doors, elements=(*house.elements, leaf))
    assert [door.to_outside for door in house.doors] == [True, False]


def test_without_rooms_a_sill_is_measured_from_the_slab_or_the_storey():
    house = replace(with_sill(0.12), spaces=())
    door = replace(house.doors[0], clear_width=None)
    assert replace(house, doors=(door,)).doors[0].sill == pytest.approx(0.12)  # the storey is at 0
    slab = box("slab", -1, -1, -0.3, 9, 5, -0.05, ifc_class="IfcSlab")
    house = replace(house, elements=(*house.elements, slab), doors=(door,))
    assert house.doors[0].sill == pytest.approx(0.17)
    assert house.doors[0].spaces == ()


def test_a_door_to_the_outside_has_one_room_and_one_within_a_room_has_it_twice():
    house = two_rooms()
    door = replace(house.doors[0], clear_width=None)
    assert replace(house, spaces=house.spaces[:1], doors=(door,)).doors[0].spaces == ("space-west",)
    hall = bn.Space("hall", "Hall", storey="storey", shapes=(prism_shape(shapely.box(0, 0, 8.2, 4), 0, 2.5),))
    assert replace(house, spaces=(hall,), doors=(door,)).doors[0].spaces == ("hall", "hall")


def test_the_leaf_tells_the_width_of_an_opening_deeper_than_wide():
    house = two_rooms(thickness=1.2)
    assert house.doors[0].clear_width == pytest.approx(0.9)
    (door,) = house.doors
    bare = replace(door, element=replace(door.element, shapes=()), clear_width=None)
    assert doorway_of(bare).width == pytest.approx(0.9)  # by the stated width
    assert doorway_of(replace(bare, width=None)).width == pytest.approx(1.2)
    assert doorway_of(replace(bare, width=None), house).width == pytest.approx(0.9)  # by the wall


def test_a_door_without_any_body_has_the_width_that_the_file_states():
    door = bn.Door(bn.Element("door", "IfcDoor"), width=0.75)
    house = replace(two_rooms(door_width=None), doors=(door,))
    assert (house.doors[0].clear_width, house.doors[0].sill) == (0.75, None)
    (check,) = tried(house)
    assert (check.connects, check.reason) == (False, "no-shape")


# trials


def test_a_door_connects_its_two_sides():
    (check,) = tried(two_rooms())
    assert (check.connects, check.reason, check.leads, check.storey) == (True, "", "inside", 0)


def test_a_narrow_door_is_said_to_be_narrow_and_by_how_much():
    (check,) = tried(two_rooms(door_width=0.45))
    assert (check.connects, check.reason) == (False, "narrow")
    assert "5 cm too narrow" in check.detail


def test_another_way_round_does_not_make_a_closed_door_connect():
    house = two_rooms()
    shut = [box("crate", 3.4, 1.6, 0, 3.9, 2.4, 1.0, name="Crate")]
    gap = shapely.box(4, 0.1, 4.2, 1.1)
    opening = bn.Opening("gap", "wall-between", (), (prism_shape(gap, 0, 2.5),))
    wall = house["wall-between"]
    plan = shapely.box(4, 0, 4.2, 4).difference(shapely.union_all([gap, shapely.box(4, 1.55, 4.2, 2.45)]))
    cut = replace(wall, shapes=tuple(prism_shape(part, 0, 2.5) for part in plan.geoms))
    elements = (*(cut if e.global_id == wall.global_id else e for e in house.elements), *shut)
    house = replace(house, elements=elements, openings=(*house.openings, opening), ledger=bn.Ledger())
    (check,) = tried(house)
    assert (check.connects, check.reason, check.obstacles[0]) == (False, "blocked", "crate")
    assert "Crate" in check.detail
    environment = bn.make_environment(house, LOOK, WIDE)
    assert bn.build_graph(environment, cell_size=0.05).components.max() == 1


def test_furniture_farther_away_does_not_hurt():
    (check,) = tried(two_rooms(elements=[box("crate", 1.0, 0.5, 0, 2.0, 3.5, 1.0)]))
    assert check.connects


def test_a_robot_taller_than_the_door_is_told_so():
    (check,) = tried(two_rooms(door_height=1.8), bn.Robot(radius=0.25, height=2.0))
    assert (check.connects, check.reason) == (False, "low")


@pytest.mark.parametrize(("step", "connects"), [(0.05, False), (0.11, False), (0.12, True)])
def test_a_sill_stops_a_robot_that_climbs_less(step, connects):
    (check,) = tried(with_sill(0.12), bn.Robot(radius=0.25, step_height=step))
    assert check.connects is connects
    assert check.sill == pytest.approx(0.12)
    assert check.reason == ("" if connects else "sill")


def test_a_step_behind_a_door_is_told_with_its_height():
    house = two_rooms()
    raised = bn.Space("up", "Up", storey="storey", shapes=(prism_shape(shapely.box(4.2, 0, 8.2, 4), 0.2, 2.5),))
    house = replace(house, spaces=(house.spaces[0], raised), doors=(replace(house.doors[0], clear_width=None),))
    (check,) = tried(house)
    assert (check.connects, check.reason) == (False, "step")
    assert "0.20 m higher" in check.detail


def test_at_a_door_to_the_outside_the_robot_stands_in_the_doorway():
    house = replace(two_rooms(), spaces=two_rooms().spaces[:1])
    (check,) = tried(house)
    assert (check.connects, check.leads) == (True, "outside")
    blocked = replace(house, elements=(*house.elements, box("crate", 3.5, 1.2, 0, 3.95, 2.8, 1.0)), ledger=bn.Ledger())
    (check,) = tried(blocked)
    assert (check.connects, check.reason) == (False, "blocked")


def test_a_door_in_the_void_leads_nowhere():
    house = replace(two_rooms(), spaces=())
    (check,) = tried(house, floor_from=("space", "door"))
    assert (check.connects, check.leads, check.reason) == (False, "nowhere", "no-floor")


def test_cells_that_are_too_large_are_told_from_doors_that_are_too_narrow():
    environment = bn.make_environment(two_rooms(door_width=0.54), LOOK, WIDE)
    assert doors_of(environment, cell_size=0.05)[0].reason in ("cells", "")
    assert doors_of(environment, cell_size=0.2)[0].reason == "cells"
    assert doors_of(environment, cell_size=0.01)[0].connects


# real models


@pytest.fixture(scope="module")
def real_checks():
    """Try the doors of a real model once."""
    known = {}

    def checks(name):
        if name not in known:
            building = bn.read_ifc(real_model(name))
            known[name] = building, tried(building)
        return known[name]

    return checks


@pytest.mark.parametrize("name", REAL)
def test_the_published_doors_of_a_real_model(name, real_checks):
    _, checks = real_checks(name)
    reasons = Counter(check.reason for check in checks if not check.connects)
    assert (len(checks), sum(check.connects for check in checks), dict(reasons)) == REAL[name]
    assert all(check.detail for check in checks if not check.connects)


def test_97_in_100_doors_that_fill_an_opening_without_a_sill_connect(real_checks):
    tested = []
    for name in REAL:
        building, checks = real_checks(name)
        for door, check in zip(building.doors, checks, strict=True):
            if door.opening is not None and door.opening.shapes and door.sill is not None and door.sill < 0.05:
                tested.append(check.connects)
    assert len(tested) > 200
    assert sum(tested) / len(tested) >= 0.97


def test_a_robot_wider_than_the_doors_of_the_office_gets_through_none_of_them():
    building = bn.read_ifc(real_model("office/Office_A_20110811.ifc"))
    widths = [door.clear_width for door in building.doors]
    checks = tried(building, bn.Robot(radius=max(widths) / 2 + 0.01))
    assert {(check.connects, check.reason) for check in checks} == {(False, "narrow")}


def test_openings_are_as_wide_as_the_files_state_and_most_reach_the_floor():
    measured = [
        (door.clear_width - door.width, door.sill)
        for name in REAL
        for door in bn.read_ifc(real_model(name)).doors
        if door.width and door.opening
    ]
    assert sum(abs(difference) < 2e-3 for difference, _ in measured) / len(measured) > 0.98
    assert sum(sill is not None and sill < 0.01 for _, sill in measured) / len(measured) > 0.95


def test_the_raised_door_of_the_split_house_is_measured():
    building = bn.read_ifc(real_model("nasty/House.ifc"))
    assert [round(door.sill, 3) for door in building.doors if door.sill > 0.05] == [0.6]
