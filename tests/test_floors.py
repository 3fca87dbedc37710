"""Where the floor is, in worlds small enough to check by eye, and in real models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav._indoors import Shell
from bimnav.footprint import unite
from bimnav.testing import box, prism, prism_shape, room, two_rooms
from tests.conftest import real_model

LOOK = bn.Task("look", "nothing to visit")
REAL = (
    "duplex/Duplex_A_20110907.ifc",
    "houses/231110AC11-FZK-Haus-IFC.ifc",
    "houses/SampleHouse4.ifc",
    "mep/b03_heating_with_building_blenderBIM.ifc",
    "nasty/AC20-FZK-Haus_NoneAndDoubleGUID.ifc",
    "nasty/House.ifc",
    "office/Office_A_20110811.ifc",
    "office/demo2.ifc",
    "rooms/3rooms_Heater_AirTerminal_Table_with_SB.ifc",
    "rooms/Standard_Classroom_CIC_6_Project_mod2.ifc",
)


def floor_of(building, robot=None, **choices):
    return bn.make_environment(building, LOOK, robot, **choices)


def plan(environment, storey=0, *sources):
    regions = (r for r in environment.regions if r.storey == storey and (not sources or r.source in sources))
    return unite(region.polygon for region in regions)


def sources(environment):
    return {(region.storey, region.source) for region in environment.regions}


def parts(building, radius=0.2, **choices):
    """Return the sizes of the parts a robot cannot leave, storey by storey, without pockets."""
    graph = bn.build_graph(floor_of(building, bn.Robot(radius=radius), **choices), cell_size=0.05)
    counted = (np.unique(level[level > 0], return_counts=True)[1] for level in graph.components)
    return [sorted((int(n) for n in counts if n > 200), reverse=True) for counts in counted]


def slab(global_id, x0, y0, x1, y1, top, thickness=0.2, **known):
    return box(global_id, x0, y0, top - thickness, x1, y1, top, ifc_class="IfcSlab", **known)


def with_elements(building, *elements):
    return replace(building, elements=(*building.elements, *elements), ledger=bn.Ledger())


def without(building, *global_ids):
    spaces = tuple(space for space in building.spaces if space.global_id not in global_ids)
    return replace(building, spaces=spaces)


def space(global_id, x0, y0, x1, y1, base, top, name="", storey="storey"):
    return bn.Space(
        global_id, name or global_id, storey=storey, shapes=(prism_shape(shapely.box(x0, y0, x1, y1), base, top),)
    )


# slabs between rooms and instead of them


def test_a_slab_is_floor_where_a_room_is_not_modelled_and_nowhere_outside():
    house = with_elements(without(two_rooms(), "space-east"), slab("slab", -3, -3, 12, 8, 0.0))
    environment = floor_of(house)
    assert sources(environment) == {(0, "space"), (0, "slab"), (0, "door")}
    assert plan(environment, 0, "slab").difference(shapely.box(4, 0, 8.2, 4)).area < 1e-6
    assert plan(environment).area == pytest.approx(4 * 4 + 4 * 4 + 0.2 * 0.9, abs=1e-6)
    assert len(parts(house)[0]) == 1


def test_a_slab_joins_no_rooms_that_a_wall_keeps_apart():
    house = with_elements(two_rooms(door_width=None), slab("slab", -3, -3, 12, 8, 0.0))
    assert len(parts(house)[0]) == 2


def test_the_inside_of_an_l_shaped_house_is_no_hull():
    outer = shapely.Polygon([(0, 0), (8, 0), (8, 3), (3, 3), (3, 8), (0, 8)])
    inner = shapely.buffer(outer, -0.2, join_style="mitre")
    wall = prism("wall", outer.difference(inner), 0.0, 2.5, ifc_class="IfcWall")
    house = bn.Building("L", (bn.Storey("s", "Level", 0.0),), elements=(wall, slab("slab", -2, -2, 10, 10, 0.0)))
    assert plan(floor_of(house)).symmetric_difference(inner).area < 1e-6


def test_a_gap_in_a_facade_as_wide_as_a_door_frame_lets_no_floor_out():
    house = room(6, 5)
    south = [
        box("a", -0.2, -0.2, 0, 2, 0, 2.5, ifc_class="IfcWall"),
        box("b", 2.4, -0.2, 0, 6.2, 0, 2.5, ifc_class="IfcWall"),
    ]
    walls = [wall for wall in house.elements if wall.global_id != "wall-south"]
    house = replace(house, spaces=(), elements=(*walls, *south, slab("slab", -5, -5, 11, 10, 0.0)), ledger=bn.Ledger())
    assert plan(floor_of(house)).difference(shapely.box(-0.2, -0.2, 6.2, 5.2)).area < 1e-6


def test_a_parapet_makes_no_floor_of_a_roof():
    roof = slab("roof", -0.2, -0.2, 5.2, 4.2, 2.7)
    parapet = [
        replace(w, global_id=f"p-{w.global_id}", shapes=(prism_shape(outline, 2.7, 3.7),)) for w, outline in _walls()
    ]
    house = with_elements(room(), roof, *parapet)
    assert {r.storey for r in floor_of(house).regions} == {0}


def _walls():
    return [(wall, shapely.box(*wall.bounds[0, :2], *wall.bounds[1, :2])) for wall in room().elements]


def test_each_source_of_floor_can_be_left_out():
    house = with_elements(without(two_rooms(), "space-east"), slab("slab", -3, -3, 12, 8, 0.0))
    assert sources(floor_of(house, floor_from=("space",))) == {(0, "space")}
    assert sources(floor_of(house, floor_from=("slab", "door"))) == {(0, "slab"), (0, "door")}
    assert sources(floor_of(room(), floor_from=("hull",))) == {(0, "hull")}


def test_a_covering_or_a_landing_at_floor_level_is_floor_and_said_to_be_one():
    finish = box("finish", 4.2, 0, -0.02, 8.2, 2, 0.0, ifc_class="IfcCovering")
    stair = bn.Element("stair", "IfcStair")
    landing = replace(slab("landing", 4.2, 2, 8.2, 4, 0.0), parent="stair")
    environment = floor_of(with_elements(without(two_rooms(), "space-east"), finish, stair, landing))
    assert {s for _, s in sources(environment)} == {"space", "door", "covering", "landing"}
    assert plan(environment, 0, "covering", "landing").area == pytest.approx(16, abs=1e-6)


# levels


def test_a_mezzanine_is_a_level_of_its_own_with_a_name_of_its_own():
    hall = room(8, 6, height=5, elements=[slab("deck", 0, 0, 4, 6, 2.5)])
    environment = floor_of(hall)
    assert environment.levels == (0.0, 2.5)
    assert [storey.name for storey in environment.storeys] == ["Ground floor", "Ground floor (+2.50 m)"]
    assert plan(environment, 1).symmetric_difference(shapely.box(0, 0, 4, 6)).area < 1e-6
    assert environment.ground == 0


def test_slabs_at_three_heights_of_one_storey_are_three_levels():
    walls = [replace(w, shapes=(prism_shape(outline, -3, 6),)) for w, outline in _walls()]
    decks = [slab(f"deck {z}", 0, 0, 5, 4, z) for z in (-3.0, 0.0, 3.0)]
    house = bn.Building("tower", (bn.Storey("s", "All", 0.0),), elements=(*walls, *decks))
    environment = floor_of(house)
    assert environment.levels == (-3.0, 0.0, 3.0)
    assert [round(plan(environment, k).area, 6) for k in range(3)] == [20.0, 20.0, 20.0]


def test_a_slab_under_a_screed_is_no_level():
    house = with_elements(
        replace(room(), spaces=()), slab("raw", -1, -1, 6, 5, -0.1), slab("screed", 0, 0, 5, 4, 0.0, 0.1)
    )
    assert floor_of(house).levels == (0.0,)


def test_a_slab_without_headroom_is_no_level():
    loft = [slab("ceiling", 0, 0, 5, 4, 2.4), slab("roof", -0.2, -0.2, 5.2, 4.2, 3.2)]
    assert {r.storey for r in floor_of(room(height=3, elements=loft)).regions} == {0}


def test_a_room_whose_finish_is_a_step_high_is_a_level():
    finish = box("finish", 4.2, 0, 0, 8.2, 4, 0.12, ifc_class="IfcCovering")
    house = two_rooms(elements=[finish, slab("slab", -1, -1, 10, 5, 0.0)])
    assert floor_of(house).levels == (0.0, 0.12)
    assert floor_of(house, bn.Robot(step_height=0.15)).levels == (0.0,)


def test_rooms_that_begin_below_their_doors_have_the_floor_of_the_doors():
    sunk = tuple(
        replace(s, shapes=(prism_shape(shapely.box(*s.bounds[0, :2], *s.bounds[1, :2]), -0.15, 2.5),))
        for s in two_rooms().spaces
    )
    one_door = replace(two_rooms(), spaces=sunk)
    assert floor_of(one_door).levels == (-0.15,)  # one door tells nothing: it may have a sill
    (door,) = one_door.doors
    second = replace(door, element=replace(door.element, global_id="door 2"), clear_width=None)
    environment = floor_of(replace(one_door, doors=(door, second)))
    assert environment.levels == (0.0,)
    assert len([r for r in environment.regions if r.source == "door"]) == 2


# holes, shafts and voids


def test_a_hole_in_the_slab_under_a_room_is_no_floor():
    well = shapely.box(1, 1, 2, 3)
    floor = prism("slab", shapely.box(-0.2, -0.2, 5.2, 4.2).difference(well), -0.2, 0.0, ifc_class="IfcSlab")
    environment = floor_of(room(elements=[floor]))
    assert plan(environment).symmetric_difference(shapely.box(0, 0, 5, 4).difference(well)).area < 1e-6


def test_a_joint_between_slabs_is_floor():
    slabs = [slab("a", -0.2, -0.2, 2.45, 4.2, 0.0), slab("b", 2.55, -0.2, 5.2, 4.2, 0.0)]
    assert plan(floor_of(room(elements=slabs))).area == pytest.approx(20, abs=1e-6)


def test_a_pit_in_a_slab_is_a_level_of_its_own():
    pit = shapely.box(1, 1, 2.5, 3)
    floor = prism("slab", shapely.box(-0.2, -0.2, 5.2, 4.2).difference(pit), -0.5, 0.0, ifc_class="IfcSlab")
    bottom = slab("bottom", 1, 1, 2.5, 3, -0.3)
    environment = floor_of(room(elements=[floor, bottom]))
    assert environment.levels == (-0.3, 0.0)
    assert plan(environment, 0).symmetric_difference(pit).area < 1e-6
    assert plan(environment, 1).area == pytest.approx(17, abs=1e-6)


def test_a_room_without_a_slab_is_floor_if_it_has_a_door_and_void_if_not():
    west = slab("slab", -0.2, -0.2, 4.2, 4.2, 0.0)
    environment = floor_of(two_rooms(elements=[west]))
    assert plan(environment, 0, "space").area == pytest.approx(32, abs=1e-6)
    assert [(i.code, i.global_ids) for i in environment.issues] == [("missing-slab", ("space-east",))]
    environment = floor_of(two_rooms(door_width=None, elements=[west]))
    assert plan(environment, 0, "space").area == pytest.approx(16, abs=1e-6)
    assert [(i.code, i.global_ids) for i in environment.issues] == [("shaft", ("space-east",))]


@pytest.mark.parametrize(
    ("name", "base", "is_floor"),
    [
        ("124 ELEV", 0.0, False),
        ("Aufzugsschacht", 0.0, False),
        ("Open to below", 0.0, False),
        ("123 ELEV EQ RM", 0.0, True),
        ("Elevator lobby", 0.0, True),
        ("Levels and lifting", 0.0, True),
        ("unnamed", -1.2, False),
        ("cellar", -2.6, True),
    ],
)
def test_a_shaft_is_known_by_its_shape_and_by_its_name(name, base, is_floor):
    top = 9.0 if base == -1.2 else base + 2.5
    storeys = (bn.Storey("storey", "Ground", 0.0), bn.Storey("upper", "Upper", 3.5))
    house = replace(two_rooms(door_width=None), storeys=storeys)
    house = replace(house, spaces=(house.spaces[0], space("tested", 4.2, 0, 8.2, 4, base, top, name)))
    environment = floor_of(house)
    assert ("tested" in {region.global_id for region in environment.regions}) is is_floor
    assert ("shaft" in {issue.code for issue in environment.issues}) is not is_floor


def test_a_passage_into_a_shaft_makes_no_floor_in_it():
    house = two_rooms()
    (opening,) = house.openings
    deep = replace(opening, fillings=(), shapes=(prism_shape(shapely.box(3, 1.55, 7, 2.45), 0, 2.1),))
    storeys = (*house.storeys, bn.Storey("upper", "Upper", 3.5))
    spaces = (house.spaces[0], space("lift", 4.2, 0, 8.2, 4, -1.2, 9.0, "Lift"))
    environment = floor_of(replace(house, storeys=storeys, spaces=spaces, doors=(), openings=(deep,)))
    assert (
        plan(environment).symmetric_difference(unite([shapely.box(0, 0, 4, 4), shapely.box(4, 1.55, 4.2, 2.45)])).area
        < 1e-6
    )


# doorways, windows and the outside


def test_an_opening_deeper_than_its_wall_is_floor_no_farther_than_the_wall():
    house = two_rooms()
    (door,) = house.doors
    deep = replace(door.opening, shapes=(prism_shape(shapely.box(2.1, 1.55, 6.1, 2.45), 0, 2.1),))
    house = replace(house, doors=(replace(door, opening=deep, clear_width=None),), openings=(deep,))
    assert plan(floor_of(house), 0, "door").bounds == pytest.approx((4.0, 1.55, 4.2, 2.45))
    assert house.doors[0].clear_width == pytest.approx(0.9)


def test_a_french_window_lets_no_robot_out_even_without_a_body():
    house = two_rooms()
    (door,) = house.doors
    window = bn.Element("window", "IfcWindow", "French window")
    elements = (*(e for e in house.elements if e.global_id != "door"), window, slab("slab", -3, -3, 12, 8, 0.0))
    opening = replace(door.opening, fillings=("window",))
    house = replace(house, elements=elements, doors=(), openings=(opening,), ledger=bn.Ledger())
    assert len(parts(house)[0]) == 2
    assert len(parts(replace(house, openings=(replace(opening, fillings=()),)))[0]) == 1


def test_a_door_in_a_curtain_wall_needs_no_opening():
    house = two_rooms()
    glass = [
        box(f"glass {k}", 4.08, y0, 0, 4.12, y1, 2.5, ifc_class="IfcPlate")
        for k, (y0, y1) in enumerate(((0, 1.5), (2.5, 4)))
    ]
    leaf = box("door", 4.08, 1.5, 0, 4.12, 2.5, 2.1, ifc_class="IfcDoor")
    elements = (*(e for e in house.elements if e.global_id not in ("door", "wall-between")), *glass, leaf)
    spaces = (space("west", 0, 0, 4.08, 4, 0, 2.5), space("east", 4.5, 0, 8.2, 4, 0, 2.5))
    house = replace(house, spaces=spaces, elements=elements, doors=(bn.Door(leaf),), openings=(), ledger=bn.Ledger())
    assert len(parts(house)[0]) == 1
    assert len(parts(replace(house, doors=()))[0]) == 2


def test_a_sill_keeps_out_a_robot_that_does_not_climb_it():
    house = two_rooms()
    (door,) = house.doors
    raised = replace(door.opening, shapes=(prism_shape(shapely.box(4, 1.55, 4.2, 2.45), 0.1, 2.1),))
    wall = bn.Element(
        "wall-between",
        "IfcWall",
        shapes=(*house["wall-between"].shapes, prism_shape(shapely.box(4, 1.55, 4.2, 2.45), 0, 0.1)),
    )
    elements = tuple(wall if e.global_id == "wall-between" else e for e in house.elements)
    house = replace(
        house, elements=elements, doors=(replace(door, opening=raised, clear_width=None),), openings=(raised,)
    )
    assert bn.build_graph(floor_of(house), cell_size=0.05).components.max() == 2
    assert bn.build_graph(floor_of(house, bn.Robot(step_height=0.1)), cell_size=0.05).components.max() == 1


def house_with_entrance(*elements):
    """Make a room with a door to the outside in its southern wall."""
    gap = shapely.box(2, -0.2, 3, 0)
    south = prism("wall-south", shapely.box(-0.2, -0.2, 5.2, 0).difference(gap).geoms[0], 0, 2.5, ifc_class="IfcWall")
    rest = shapely.box(-0.2, -0.2, 5.2, 0).difference(gap).geoms[1]
    south = replace(south, shapes=(*south.shapes, prism_shape(rest, 0, 2.5), prism_shape(gap, 2.1, 2.5)))
    opening = bn.Opening("opening", "wall-south", ("door",), (prism_shape(gap, 0, 2.1),))
    leaf = box("door", 2, -0.12, 0, 3, -0.08, 2.1, ifc_class="IfcDoor", name="Entrance")
    walls = [wall for wall in room().elements if wall.global_id != "wall-south"]
    return replace(
        room(),
        elements=(*walls, south, leaf, *elements),
        doors=(bn.Door(leaf, opening, 1.0, 2.1),),
        openings=(opening,),
        ledger=bn.Ledger(),
    )


def test_outside_is_floor_only_if_asked_for():
    house = house_with_entrance()
    indoors = shapely.box(-0.2, -0.2, 5.2, 4.2)
    assert plan(floor_of(house)).difference(indoors).area < 1e-6
    environment = floor_of(house, outdoors=True)
    assert plan(environment, 0, "outdoors").area == pytest.approx(9.4 * 8.4 - 5.4 * 4.4, abs=1e-6)
    assert len(parts(house, outdoors=True)[0]) == 1


def test_the_ground_is_that_of_the_model_where_it_shows_one():
    yard = slab("yard", -1, -6, 6, -0.2, 0.0)
    environment = floor_of(house_with_entrance(yard), outdoors=True)
    assert [r.global_id for r in environment.regions if r.source == "outdoors"] == ["yard"]
    terrain = prism(
        "site", shapely.box(-9, -9, 12, 12).difference(shapely.box(-0.2, -0.2, 5.2, 4.2)), -1, 0.0, ifc_class="IfcSite"
    )
    environment = floor_of(replace(house_with_entrance(), terrain=(terrain,)), outdoors=True)
    assert [r.global_id for r in environment.regions if r.source == "outdoors"] == ["site"]
    assert plan(environment, 0, "outdoors").area == pytest.approx(21 * 21 - 5.4 * 4.4, abs=1e-5)


@settings(max_examples=25, deadline=None)
@given(st.floats(2, 9), st.floats(2, 9), st.floats(0.6, 1.9), st.floats(-400, 400), st.integers(0, 359))
def test_the_floor_turns_and_moves_with_the_house(width, depth, door, shift, angle):
    house = with_elements(
        without(two_rooms(width, depth, door_width=door), "space-east"), slab("slab", -3, -3, 25, 12, 0.0)
    )
    turn = np.eye(4)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn[:2, :2], turn[:2, 3] = [[c, -s], [s, c]], (shift, -shift)

    def moved(product):
        return replace(product, shapes=tuple(bn.Shape(s.mesh, turn @ s.placement) for s in product.shapes))

    elements = {e.global_id: moved(e) for e in house.elements}
    openings = tuple(moved(o) for o in house.openings)
    doors = tuple(
        replace(d, element=elements[d.global_id], opening=o, clear_width=None)
        for d, o in zip(house.doors, openings, strict=True)
    )
    turned = replace(
        house,
        spaces=tuple(moved(s) for s in house.spaces),
        elements=tuple(elements.values()),
        doors=doors,
        openings=openings,
    )
    one, other = plan(floor_of(house)), plan(floor_of(turned))
    there = shapely.transform(one, lambda xy: xy @ turn[:2, :2].T + turn[:2, 3])
    assert there.symmetric_difference(other).area < 1e-3
    assert turned.doors[0].clear_width == pytest.approx(door, abs=1e-6)


# real models


@pytest.mark.parametrize(
    ("name", "reached"),
    [
        ("duplex/Duplex_A_20110907.ifc", {"Level 1": (5, 10), "Level 2": (5, 10)}),
        ("houses/231110AC11-FZK-Haus-IFC.ifc", {"Erdgeschoss": (6, 6), "Dachgeschoss": (1, 1)}),
        ("houses/SampleHouse4.ifc", {"Ground Floor": (3, 3)}),
        ("office/Office_A_20110811.ifc", {"Level 1": (57, 59), "Level 2": (39, 39)}),
        ("rooms/3rooms_Heater_AirTerminal_Table_with_SB.ifc", {"My Storey": (4, 4)}),
        ("nasty/House.ifc", {"Уровень 1 (-0.45 m)": (4, 4), "Уровень 1": (3, 3), "Уровень 2": (4, 4)}),
    ],
)
def test_a_wide_robot_reaches_the_rooms_of_a_real_model_from_their_largest_part(name, reached):
    report = bn.read_ifc(real_model(name)).readiness()
    found = {storey.name: (storey.rooms_reached, storey.rooms) for storey in report.storeys}
    assert {storey: found[storey] for storey in reached} == reached


def test_the_two_flats_of_the_duplex_stay_apart_and_meet_outdoors():
    building = bn.read_ifc(real_model("duplex/Duplex_A_20110907.ifc"))
    apart = parts(building)
    assert [len(level) for level in apart] == [0, 2, 2, 0]
    assert len(parts(building, outdoors=True)[1]) == 1


def test_the_lift_shaft_of_the_office_is_no_floor_and_the_room_of_its_machine_is():
    environment = floor_of(bn.read_ifc(real_model("office/Office_A_20110811.ifc")))
    names = {region.name for region in environment.regions}
    assert "123 ELEV EQ RM" in names
    assert "124 ELEV" not in names
    assert min(environment.levels) == 0.0


def test_the_ramp_deck_of_demo2_is_a_level_inside_the_first_storey():
    environment = floor_of(bn.read_ifc(real_model("office/demo2.ifc")))
    assert environment.storeys[1].name == "Level 1 (+1.50 m)"
    assert plan(environment, 1).area == pytest.approx(19.6, abs=0.1)
    assert {r.source for r in environment.regions if r.storey == 1} == {"slab"}


def test_the_stairwells_of_the_duplex_are_no_floor_upstairs():
    environment = floor_of(bn.read_ifc(real_model("duplex/Duplex_A_20110907.ifc")))
    upstairs = plan(environment, 2)
    for stairwell in (shapely.Point(7.9, -10.5), shapely.Point(0.9, -7.5)):
        assert upstairs.distance(stairwell) > 0.3


@pytest.mark.parametrize("name", REAL)
def test_slabs_and_walls_alone_tell_the_same_floor_as_the_rooms(name):
    building = bn.read_ifc(real_model(name))
    roomless = replace(building, spaces=())
    known, blind, shell = floor_of(building), floor_of(roomless), Shell(roomless)
    compared = 0
    for k, level in enumerate(known.levels):
        walls = unite(o.footprint for o in known.obstacles_on(k))
        one = plan(known, k).intersection(shell.inside(level)).difference(walls)  # without terraces and parking bays
        near = (j for j, other in enumerate(blind.levels) if abs(other - level) < 0.05)
        other = unite(plan(blind, j) for j in near).difference(walls)
        if one.area > 5:
            compared += 1
            assert one.intersection(other).area / unite([one, other]).area > 0.97
    assert compared


@pytest.mark.parametrize("name", REAL)
def test_no_floor_lies_outside_a_real_model_but_rooms_that_it_says_are_there(name):
    building = bn.read_ifc(real_model(name))
    environment, shell = floor_of(building), Shell(building)
    for k, level in enumerate(environment.levels):
        inside = shapely.buffer(unite([shell.inside(level), plan(environment, k, "space")]), 0.3)
        assert plan(environment, k).difference(inside).area < 0.05
