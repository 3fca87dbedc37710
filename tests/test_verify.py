"""The judge is sharp: spoiled paths are all caught, good ones are never refused."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from shapely import affinity

from bimnav.building import Building, Element, Mesh, Shape, Storey
from bimnav.environment import IndoorEnvironment, Obstacle, Region, Zone
from bimnav.errors import GeometryError, UnsafePlanError
from bimnav.robot import Robot
from bimnav.verify import Check, check_path, check_plan

FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
FACES = FACES[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
FLOOR = (shapely.box(0, 0, 10, 10),)


def box(low: Any, high: Any, quality: str = "exact") -> Mesh:
    """A closed box with outward faces."""
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    return Mesh(np.array(corners, dtype=float), FACES, quality)


def thing(name: str, *meshes: Mesh) -> Element:
    return Element(f"id-{name}", "IfcFurniture", name, shapes=tuple(Shape(mesh) for mesh in meshes))


def blocks(element: Element, footprint: Any = None, storey: int = 0) -> Obstacle:
    """An obstacle; its footprint is the element's box unless another is given."""
    (x0, y0, z0), (x1, y1, z1) = element.bounds if element.bounds is not None else np.zeros((2, 3))
    plan = shapely.box(x0, y0, x1, y1) if footprint is None else footprint
    return Obstacle(element.global_id, element.name, element.ifc_class, storey, plan, z0, z1, "exact", "test")


def room(
    *obstacles: tuple[Element, Obstacle],
    radius: float = 0.0,
    floors: Any = FLOOR,
    levels: tuple[float, ...] = (0.0,),
    zones: tuple[Zone, ...] = (),
    **robot: float,
) -> IndoorEnvironment:
    """One room of 10 by 10 m on every level, with things in it."""
    storeys = tuple(Storey(f"s{k}", f"Level {k}", level) for k, level in enumerate(levels))
    building = Building("test", storeys, elements=tuple({e.global_id: e for e, _ in obstacles}.values()))
    regions = tuple(Region(f"r{k}", "Room", k, polygon, "space") for k in range(len(levels)) for polygon in floors)
    return IndoorEnvironment(
        building,
        None,  # type: ignore[arg-type]
        Robot(radius=radius, **robot),
        storeys,
        levels,
        regions,
        tuple(obstacle for _, obstacle in obstacles),
        (),
        zones,
    )


def put(element: Element, footprint: Any = None, storey: int = 0) -> tuple[Element, Obstacle]:
    return element, blocks(element, footprint, storey)


def line(*points: tuple[float, float], z: float = 0.0) -> np.ndarray:
    return np.array([(x, y, z) for x, y in points], dtype=float)


def kinds(check: Check) -> set[str]:
    return {violation.kind for violation in check.violations}


WALL = thing("Wall", box((4, 0, 0), (4.2, 8, 3)))
FAR = shapely.box(99, 99, 99.1, 99.1)  # a footprint that is wrong: far from its element


def test_a_clear_path_passes_and_its_clearance_is_the_distance_less_the_radius():
    check = check_path(line((1, 1), (1, 9), (3, 9), (3, 1)), room(put(WALL), radius=0.25))
    assert check.ok
    assert check.clearance == pytest.approx(0.75, abs=1e-12)
    assert check.clearance_3d == pytest.approx(0.75, abs=2e-4)
    assert check.checked_length == pytest.approx(18)
    check.raise_if_unsafe()


def test_an_empty_room_has_no_end_of_clearance():
    check = check_path(line((1, 1), (2, 2)), room())
    assert check.ok
    assert check.clearance == math.inf
    assert check.clearance_3d is None


def test_a_robot_one_millimetre_into_a_wall_is_caught_and_the_error_names_it():
    check = check_path(line((1, 1), (3.751, 1), (3.751, 3)), room(put(WALL), radius=0.25))
    assert kinds(check) == {"footprint"}
    assert check.violations[0].depth == pytest.approx(1e-3, abs=1e-9)
    assert check.clearance == pytest.approx(-1e-3, abs=1e-9)
    with pytest.raises(
        UnsafePlanError, match=r"0\.0010 m into Wall \(id-Wall\) at \(3\.751, \d\.\d+, 0\.000\)"
    ) as caught:
        check.raise_if_unsafe()
    assert caught.value.context["global_id"] == "id-Wall"


def test_a_round_robot_may_touch_and_a_point_may_come_as_near_as_it_likes():
    assert check_path(line((3.75, 1), (3.75, 7)), room(put(WALL), radius=0.25)).ok
    assert check_path(line((4 - 1e-6, 1), (4 - 1e-6, 7)), room(put(WALL))).ok


@pytest.mark.parametrize("gap", [0.0, 1e-10])  # no more than rounding
def test_a_point_that_touches_a_wall_is_refused(gap):
    check = check_path(line((4 - gap, 1), (4 - gap, 7)), room(put(WALL)))
    assert kinds(check) == {"footprint"}
    assert "touches Wall" in check.violations[0].message


def test_a_bend_of_half_a_millimetre_is_not_smoothed_away():
    check = check_path(line((3.75, 1), (3.7505, 4), (3.75, 7)), room(put(WALL), radius=0.25))
    assert check.violations[0].depth == pytest.approx(5e-4, abs=1e-9)


def test_the_deepest_of_several_touches_is_named_and_violations_come_worst_first():
    shelf = thing("Shelf", box((0, 7, 0), (2, 7.5, 2)))
    points = line((1, 6.8), (3, 6), (3.8, 6), (3.9, 2), (3.8, 2), (1, 2), (math.nan, 2))
    check = check_path(points, room(put(shelf), put(WALL), radius=0.25))
    assert [violation.kind for violation in check.violations] == ["not-finite", "footprint", "footprint"]
    assert [violation.name for violation in check.violations] == ["", "Wall", "Shelf"]
    assert check.violations[1].depth == pytest.approx(0.15)
    assert check.violations[1].point == pytest.approx((3.9, 2, 0))


def test_many_bad_points_are_one_violation():
    assert len(check_path(np.full((50, 3), math.nan), room()).violations) == 1


def test_a_path_right_through_a_wall_is_as_deep_as_the_wall_allows():
    check = check_path(line((1, 1), (9, 1)), room(put(WALL), radius=0.25))
    assert check.violations[0].depth == pytest.approx(0.35, abs=0.01)
    assert check.clearance == -check.violations[0].depth


def test_a_cut_corner_is_caught_though_both_ends_are_clear():
    pillar = thing("Pillar", box((5, 5, 0), (6, 6, 3)))
    assert check_path(line((4.7, 5.2), (4.7, 6.3), (5.8, 6.3)), room(put(pillar), radius=0.25)).ok
    check = check_path(line((4.7, 5.2), (5.8, 6.3)), room(put(pillar), radius=0.25))
    assert kinds(check) == {"footprint"}


def test_a_wall_of_a_millimetre_cannot_be_jumped():
    sheet = thing("Sheet", box((5, 0, 0), (5.001, 10, 3)))
    assert "footprint" in kinds(check_path(line((1, 5), (9, 5)), room(put(sheet))))


def test_a_footprint_without_area_blocks():
    sheet = thing("Sheet")
    environment = room(put(sheet, shapely.LineString([(5, 0), (5, 10)])))
    assert kinds(check_path(line((1, 5), (9, 5)), environment)) == {"footprint"}


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("place", [(0, 0), (1, 1), (2, 2)])
def test_a_point_that_is_not_finite_is_refused_and_the_rest_is_still_judged(bad, place):
    points = line((1, 1), (2, 1), (3, 1), (3.5, 1), (5, 1))
    points[place] = bad
    assert kinds(check_path(points, room(put(WALL)))) == {"not-finite", "footprint"}


@pytest.mark.parametrize("corner", [math.nan, math.inf])
def test_a_footprint_that_is_not_finite_or_empty_is_refused(corner):
    with np.errstate(invalid="ignore"):
        broken = shapely.Polygon([(0, 0), (1, 0), (corner, 1)])
    for footprint in (broken, shapely.Polygon()):
        check = check_path(line((7, 7), (8, 8)), room(put(thing("Ghost"), footprint)))
        assert kinds(check) == {"unknown-shape"}
        assert check.violations[0].name == "Ghost"


def test_a_footprint_that_crosses_itself_still_blocks():
    bow_tie = shapely.Polygon([(4, 4), (6, 6), (6, 4), (4, 6)])
    environment = room(put(thing("Bow tie"), bow_tie))
    assert not check_path(line((4.1, 3), (4.1, 7)), environment).ok
    assert not check_path(line((5.9, 3), (5.9, 7)), environment).ok
    assert check_path(line((5, 3), (5, 4.9)), environment).ok


def test_overlapping_parts_of_a_footprint_do_not_cancel():
    twice = shapely.MultiPolygon([shapely.box(4, 4, 6, 6), shapely.box(4.5, 4.5, 5.5, 5.5)])
    assert not check_path(line((5, 5), (5.1, 5)), room(put(thing("Twice"), twice))).ok


def test_a_path_without_points_is_no_pass():
    assert kinds(check_path(np.empty((0, 3)), room())) == {"empty"}


def test_a_robot_that_stands_is_judged_where_it_stands():
    environment = room(put(WALL), radius=0.25)
    assert check_path(line((2, 2)), environment).ok
    assert check_path(line((2, 2), (2, 2)), environment).ok
    for place in (line((3.9, 2)), line((4.1, 2), (4.1, 2))):
        assert kinds(check_path(place, environment)) == {"footprint"}
    assert kinds(check_path(line((20, 2)), environment)) == {"off-floor"}


@pytest.mark.parametrize("shape", [(4,), (4, 2), (2, 2, 3)])
def test_an_array_of_another_shape_is_a_clear_error(shape):
    with pytest.raises(GeometryError, match="shape"):
        check_path(np.zeros(shape), room())


def test_what_is_ignored_may_be_touched():
    assert check_path(line((1, 1), (9, 1)), room(put(WALL)), ignore={"id-Wall"}).ok


# The floor


def test_a_path_off_the_floor_is_refused_with_how_far():
    check = check_path(line((9, 9), (12, 9), (9, 8)), room())
    assert kinds(check) == {"off-floor"}
    assert check.violations[0].depth == pytest.approx(2, abs=1e-3)
    assert check.violations[0].point == (12, 9, 0)


@pytest.mark.parametrize(("gap", "ok"), [(0.0, True), (0.09, True), (0.13, False), (1.0, False)])
def test_small_gaps_between_regions_are_floor_and_others_are_not(gap, ok):
    rooms = shapely.box(0, 0, 5, 5), shapely.box(5 + gap, 0, 10, 5)
    assert check_path(line((1, 1), (9, 1)), room(floors=rooms)).ok is ok


def test_a_body_may_overhang_the_floor_by_a_small_gap_only():
    assert check_path(line((0.25, 1), (0.25, 9)), room(radius=0.3)).ok
    assert kinds(check_path(line((0.1, 1), (0.1, 9)), room(radius=0.3))) == {"off-floor"}


def test_a_storey_without_floor_is_off_floor():
    assert kinds(check_path(line((1, 1), (2, 2)), room(floors=()))) == {"off-floor"}


def test_the_middle_of_the_robot_never_enters_a_restricted_zone():
    zone = Zone("z", "Server room", 0, shapely.box(5, 5, 8, 8), math.inf, "test")
    costly = replace(zone, factor=3.0)
    assert kinds(check_path(line((4, 6), (9, 6)), room(zones=(zone,)))) == {"restricted"}
    assert check_path(line((4, 6), (5, 6), (4, 7)), room(zones=(zone,))).ok
    assert check_path(line((4, 6), (9, 6)), room(zones=(costly,))).ok


# Storeys


def test_a_path_at_a_height_that_is_no_level_is_refused():
    environment = room(levels=(0.0, 3.0))
    assert check_path(line((1, 1), (2, 2), z=3.0), environment).ok
    assert check_path(line((1, 1), (2, 2), z=3.0 + 9e-7), environment).ok
    assert kinds(check_path(line((1, 1), (2, 2), z=3.001), environment)) == {"no-storey"}


def test_a_path_that_changes_the_storey_is_refused():
    points = np.array([(1, 1, 0), (2, 1, 0), (2, 1, 3), (3, 1, 3)], dtype=float)
    check = check_path(points, room(levels=(0.0, 3.0)))
    assert kinds(check) == {"storey-jump"}
    assert check.checked_length == 2


def test_an_obstacle_counts_on_its_own_storey():
    upstairs = thing("Upstairs", box((4, 0, 3), (4.2, 10, 5)))
    environment = room(put(upstairs, storey=1), levels=(0.0, 3.0))
    assert check_path(line((1, 1), (9, 1)), environment).ok
    assert kinds(check_path(line((1, 1), (9, 1), z=3.0), environment)) == {"footprint"}


def test_storeys_at_one_height_share_floor_and_obstacles():
    west, east = shapely.box(0, 0, 5, 5), shapely.box(5, 0, 10, 5)
    environment = room(put(thing("Pillar"), shapely.box(7, 0, 8, 2), storey=1), levels=(0.0, 5e-7))
    environment = replace(environment, regions=(Region("w", "W", 0, west, "space"), Region("e", "E", 1, east, "space")))
    assert check_path(line((1, 3), (9, 3)), environment).ok
    assert kinds(check_path(line((1, 1), (9, 1)), environment)) == {"footprint"}


# The body in space. The footprints are wrong on purpose, so that only the meshes can tell.


@pytest.mark.parametrize("radius", [0.0, 0.25])
def test_a_path_through_a_closed_cabinet_is_caught_without_its_footprint(radius):
    cabinet = thing("Cabinet", box((4, 0.7, 0), (5, 1.3, 2)))
    environment = room(put(cabinet, FAR), radius=radius)
    check = check_path(line((1, 1), (9, 1)), environment)
    assert kinds(check) == {"body"}
    assert check.violations[0].name == "Cabinet"
    assert check.violations[0].depth == pytest.approx(radius)
    assert check.clearance_3d == 0
    assert check_path(line((1, 1), (9, 1)), environment, body=False).ok


@pytest.mark.parametrize("radius", [0.0, 0.25])
def test_a_path_wholly_inside_a_solid_is_caught(radius):
    block = thing("Block", box((1, 1, -9), (9, 9, 9)))
    for mesh_side in (1.0, -1.0):  # a mirrored placement turns the surface inside out
        placement = np.diag([mesh_side, 1.0, 1.0, 1.0])
        placement[0, 3] = 0.0 if mesh_side > 0 else 10.0
        solid = replace(block, shapes=(Shape(block.shapes[0].mesh, placement),))
        check = check_path(line((4, 4), (6, 6)), room(put(solid, FAR), radius=radius))
        assert kinds(check) == {"inside"}
        assert check.violations[0].depth == pytest.approx(3 + radius)


def test_a_hollow_solid_does_not_hold_what_stands_in_its_hollow():
    outer, inner = box((1, 1, -1), (9, 9, 4)), box((2, 2, -0.5), (8, 8, 3.5))
    faces = np.concatenate([outer.faces, inner.faces[:, ::-1] + 8])
    hollow = thing("Hall", Mesh(np.concatenate([outer.vertices, inner.vertices]), faces))
    assert check_path(line((4, 4), (6, 6)), room(put(hollow, FAR), radius=0.25)).ok


def test_sheets_around_a_robot_are_no_solid():
    screens = thing("Screens", box((1, 1, -1), (9, 9, 4), "surface"))
    assert check_path(line((4, 4), (6, 6)), room(put(screens, FAR), radius=0.25)).ok
    assert kinds(check_path(line((4, 4), (9.5, 6)), room(put(screens, FAR), radius=0.25))) == {"body"}


def test_a_small_thing_wholly_inside_the_swept_body_is_caught():
    pebble = thing("Pebble", box((5, 5.1, 0.3), (5.01, 5.11, 0.31)))
    check = check_path(line((3, 5), (7, 5)), room(put(pebble, FAR), radius=0.25))
    assert kinds(check) == {"body"}
    assert check.violations[0].depth == pytest.approx(0.15, abs=1e-3)


@pytest.mark.parametrize(("bottom", "ok"), [(1.5, True), (1.0, True), (0.99, False), (0.5, False)])
def test_a_hanging_cabinet_is_clear_above_the_robot_and_caught_below_its_height(bottom, ok):
    cabinet = thing("Hanging", box((4, 0, bottom), (5, 2, bottom + 1)))
    check = check_path(line((1, 1), (9, 1)), room(put(cabinet, FAR), radius=0.25, height=1.0))
    assert check.ok is ok
    assert check.clearance_3d == pytest.approx(max(bottom - 1.0, 0), abs=2e-4)


@pytest.mark.parametrize(("top", "ok"), [(0.02, True), (0.05, True), (0.06, False)])
def test_a_robot_drives_over_what_is_flat(top, ok):
    rug = thing("Rug", box((4, 0, 0), (5, 2, top)))
    assert check_path(line((1, 1), (9, 1)), room(put(rug, FAR), radius=0.25)).ok is ok


def test_a_round_pillar_that_is_touched_passes_and_a_millimetre_deeper_does_not():
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    ring = np.column_stack([5 + 0.5 * np.cos(turn), 5 + 0.5 * np.sin(turn)])
    lower, upper = np.column_stack([ring, np.zeros(64)]), np.column_stack([ring, np.full(64, 3.0)])
    i, j = np.arange(64), np.roll(np.arange(64), -1)
    faces = np.concatenate([np.stack([i, j, j + 64], 1), np.stack([i, j + 64, i + 64], 1)])
    pillar = thing("Pillar", Mesh(np.concatenate([lower, upper]), faces, "surface"))
    environment = room(put(pillar, shapely.Polygon(ring)), radius=0.25)
    assert check_path(line((1, 4.25), (9, 4.25)), environment).ok
    assert not check_path(line((1, 4.251), (9, 4.251)), environment).ok
    assert kinds(check_path(line((1, 4.251), (9, 4.251)), room(put(pillar, FAR), radius=0.25))) == {"body"}


def test_elements_without_triangles_and_flat_triangles_do_no_harm():
    empty = thing("Empty", Mesh(np.empty((0, 3)), np.empty((0, 3))), Mesh(np.zeros((3, 3)), np.empty((0, 3))))
    flat = thing("Flat", Mesh(np.ones((3, 3)), [[0, 1, 2]]))
    environment = room(put(empty, FAR), put(flat, FAR), radius=0.25)
    assert check_path(line((3, 1), (9, 1)), environment).ok


def test_an_element_is_reported_once_for_a_leg():
    check = check_path(line((1, 1), (9, 1), (9, 2), (1, 2)), room(put(WALL), radius=0.25))
    assert [violation.kind for violation in check.violations] == ["footprint"]


@pytest.mark.parametrize("shift", [0.0, 51.0, 1e6, 1e7])
def test_far_from_the_origin_the_verdicts_are_the_same(shift):
    def at(*points: tuple[float, float]) -> np.ndarray:
        return np.add(line(*points), (shift, shift, 0))

    floor = affinity.translate(shapely.box(0, 0, 10, 10), shift, shift)
    wall = thing("Wall", box((4 + shift, shift, 0), (4.2 + shift, 8 + shift, 3)))
    for footprint in (None, affinity.translate(FAR, shift, shift)):
        environment = room(put(wall, footprint), radius=0.25, floors=(floor,))
        assert check_path(at((3.75, 1), (3.75, 7)), environment).ok
        assert not check_path(at((3.751, 1), (3.751, 7)), environment).ok
        assert not check_path(at((1, 1), (9, 1)), environment).ok


# Plans


def tour_of(environment: Any, *legs: np.ndarray, **changes: Any) -> Any:
    """A tour by hand: every leg ends at a stop."""
    values: dict[str, Any] = {
        "graph": SimpleNamespace(environment=environment),
        "start_point": tuple(legs[0][0]) if legs else (1.0, 1.0, 0.0),
        "stops": tuple(SimpleNamespace(end=tuple(leg[-1]), approach="center") for leg in legs),
        "return_to_start": False,
        "route": legs,
    }
    return SimpleNamespace(**(values | changes))


LEGS = line((1, 1), (1, 5)), line((1, 5), (3, 5)), line((3, 5), (3, 9))


def test_a_sound_tour_passes_with_and_without_return():
    environment = room(put(WALL), radius=0.25)
    check = check_plan(tour_of(environment, *LEGS))
    assert check.ok
    assert check.clearance == pytest.approx(0.75)
    assert check.checked_length == pytest.approx(10)
    home = line((3, 9), (1, 1))
    tour = tour_of(environment, *LEGS)
    tour.route, tour.return_to_start = (*LEGS, home), True
    assert check_plan(tour).ok


def test_a_violation_knows_its_leg():
    legs = (*LEGS[:2], line((3, 5), (5, 5)))
    check = check_plan(tour_of(room(put(WALL), radius=0.25), *legs))
    assert [violation.leg for violation in check.violations] == [2]
    assert "on leg 2" in check.violations[0].message


def test_a_loop_and_a_way_back_keep_their_far_corners():
    environment = room(put(WALL), radius=0.25)
    for points in (line((1, 1), (3.9, 1), (1, 1)), line((1, 1), (3.9, 1), (3.9, 2), (1, 2), (1, 1))):
        assert kinds(check_path(points, environment)) == {"footprint"}
    assert check_path(line((1, 1), (3, 1), (1, 1)), environment).checked_length == 4


def test_a_teleport_between_legs_is_caught():
    legs = LEGS[0], LEGS[1] + (1e-3, 0, 0), LEGS[2] + (1e-3, 0, 0)
    check = check_plan(tour_of(room(), *legs))
    assert [(v.kind, v.leg) for v in check.violations] == [("teleport", 1)]
    assert check.violations[0].depth == pytest.approx(1e-3)
    assert check_plan(tour_of(room(), LEGS[0], LEGS[1] + 5e-7, LEGS[2])).ok


def test_a_tour_begins_at_its_start_and_every_leg_ends_at_its_stop():
    assert kinds(check_plan(tour_of(room(), *LEGS, start_point=(1, 1.1, 0)))) == {"wrong-start"}
    tour = tour_of(room(), *LEGS)
    tour.stops[1].end = (3, 5.1, 0)
    check = check_plan(tour)
    assert [(v.kind, v.leg) for v in check.violations] == [("wrong-end", 1)]


def test_a_plan_with_stops_and_no_route_is_a_failure():
    stops = (SimpleNamespace(end=(2.0, 2.0, 0.0)),)
    assert kinds(check_plan(tour_of(room(), stops=stops))) == {"missing-leg"}
    assert "missing-leg" in kinds(check_plan(tour_of(room(), *LEGS, stops=stops)))
    assert "missing-leg" in kinds(check_plan(tour_of(room(), *LEGS, return_to_start=True)))


def test_a_leg_without_points_is_a_failure():
    tour = tour_of(room(), *LEGS)
    tour.route = (LEGS[0], np.empty((0, 3)), LEGS[2])
    assert "empty" in kinds(check_plan(tour))


def test_of_a_tour_that_goes_nowhere_the_start_is_judged():
    environment = room(put(WALL), radius=0.25)
    assert check_plan(tour_of(environment)).ok
    assert kinds(check_plan(tour_of(environment, start_point=(4.1, 1, 0)))) == {"footprint"}
    assert kinds(check_plan(tour_of(environment, start_point=(math.nan, 1, 0)))) == {"not-finite"}


def test_a_leg_with_nan_is_torn_and_not_finite():
    spoiled = LEGS[1].copy()
    spoiled[0, 0] = math.nan
    tour = tour_of(room(), LEGS[0], spoiled, LEGS[2])
    assert {"not-finite", "teleport"} <= kinds(check_plan(tour))
    with pytest.raises(UnsafePlanError, match="more"):
        check_plan(tour).raise_if_unsafe()


def masked(rows: list[str], *legs: np.ndarray, size: float = 1.0, first: tuple[int, int] = (0, 0)) -> Any:
    """A tour over a mask; the first row of text is the highest."""
    free = np.array([[mark != "#" for mark in row] for row in reversed(rows)])[None]
    frame = SimpleNamespace(
        cell_size=size,
        first_row=first[0],
        first_col=first[1],
        rows=free.shape[1],
        cols=free.shape[2],
        elevations=(0.0,),
    )
    tour = tour_of(None, *legs)
    tour.graph = SimpleNamespace(environment=None, frame=frame, free=free, connectors=())
    return tour


ROWS = ["....", ".##.", "...."]


def test_a_tour_over_a_mask_is_judged_against_its_blocked_cells():
    around = line((0.5, 1.5), (0.5, 2.5), (3.5, 2.5), (3.5, 1.5))
    check = check_plan(masked(ROWS, around))
    assert check.ok
    assert check.clearance == 0.5
    assert kinds(check_plan(masked(ROWS, line((0.5, 1.5), (3.5, 1.5))))) == {"footprint"}
    assert kinds(check_plan(masked(ROWS, line((0.5, 0.5), (2.5, 2.5))))) == {"footprint"}  # through a corner
    assert kinds(check_plan(masked(ROWS, line((0.5, 0.5), (4.5, 0.5))))) == {"off-floor"}


def test_blocked_cells_lie_where_the_frame_says():
    shifted = masked(ROWS, line((10.1, -4.7), (10.7, -4.7)), size=0.2, first=(-25, 50))
    assert kinds(check_plan(shifted)) == {"footprint"}
    assert check_plan(masked(ROWS, line((10.1, -4.9), (10.7, -4.9)), size=0.2, first=(-25, 50))).ok


# Laws


def scattered(rng: np.random.Generator, radius: float) -> tuple[IndoorEnvironment, list[Any]]:
    """Turned boxes, some of them a millimetre thick, anywhere in the room."""
    things = []
    for k in range(int(rng.integers(1, 8))):
        width, depth = (float(rng.choice([1e-3, rng.uniform(0.05, 2)])) for _ in range(2))
        plan = affinity.rotate(shapely.box(0, 0, width, depth), float(rng.uniform(0, 360)))
        plan = affinity.translate(plan, *rng.uniform(1, 8, 2))
        ring = shapely.get_coordinates(plan.exterior)[:4]
        order = [0, 0, 1, 1, 3, 3, 2, 2]  # the corners of `box`: x, then y, then z
        mesh = Mesh(np.column_stack([ring[order], np.tile([0.0, 2.0], 4)]), FACES)
        things.append((thing(f"T{k}", mesh), plan))
    return room(*(put(element, plan) for element, plan in things), radius=radius), [plan for _, plan in things]


def test_a_thousand_spoiled_paths_are_all_caught_and_none_that_touches_is_refused():
    rng = np.random.default_rng(7)
    caught = 0
    while caught < 1000:
        radius = float(rng.choice([0.0, 0.05, 0.3]))
        environment, plans = scattered(rng, radius)
        fixed = rng.uniform(1, 9, 2)
        world = shapely.union_all(plans)
        for _ in range(20):
            begin = rng.uniform(1, 9, 2)
            track = shapely.LineString([begin, fixed])
            near = track.distance(world)
            if near <= radius + 0.01 or caught >= 1000:
                continue
            # slide the track until its rim lies a given depth beyond the nearest obstacle's
            here, there = shapely.get_coordinates(shapely.shortest_line(track, world))
            toward = (there - here) / near
            for depth in (1e-3, 0.0 if radius > 0 else -1e-8):
                points = np.array([begin, fixed]) + toward * (near - radius + depth)
                check = check_path(np.column_stack([points, [0, 0]]), environment)
                reached = "footprint" in kinds(check)
                assert reached is (depth > 0), (radius, points, check)
                if depth <= 0:
                    assert not {"body", "inside"} & kinds(check)
            caught += 1
            if caught % 10 == 0:  # the same fault, seen in space alone
                blind = replace(environment, obstacles=tuple(replace(o, footprint=FAR) for o in environment.obstacles))
                depth = 5e-3 if radius > 0 else 5e-4  # more than the chords hide, less than a thin thing
                deep = np.array([begin, fixed]) + toward * (near - radius + depth)
                assert {"body", "inside"} & kinds(check_path(np.column_stack([deep, [0, 0]]), blind))


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**9), st.sampled_from([0.0, 0.1, 0.4]))
def test_plan_view_and_space_agree(seed, radius):
    """Upright prisms are the same in both, so two libraries that share no code must give one verdict."""
    rng = np.random.default_rng(seed)
    environment, _ = scattered(rng, radius)
    xy = rng.uniform(0.5, 9.5, (int(rng.integers(1, 6)), 2))
    points = np.column_stack([xy, np.zeros(len(xy))])
    flat = check_path(points, environment, body=False)
    if abs(flat.clearance) < 5e-3:  # closer than the chords of the body tell
        return
    blind = replace(environment, obstacles=tuple(replace(o, footprint=FAR) for o in environment.obstacles))
    solid = check_path(points, blind)
    in_plan = {v.global_id for v in flat.violations if v.kind == "footprint" and (v.depth > 5e-3 or radius == 0)}
    in_space = {v.global_id for v in solid.violations if v.kind in ("body", "inside")}
    assert in_plan <= in_space
    assert in_space <= {v.global_id for v in flat.violations}
    if 0 < flat.clearance < 0.9:
        assert solid.clearance_3d == pytest.approx(flat.clearance, abs=5e-3)


def test_a_verdict_does_not_depend_on_points_within_straight_stretches():
    environment = room(put(WALL), radius=0.25)
    corners = np.array([(1, 1), (3.7, 1), (3.7, 7), (1, 7.3), (3, 7.3)])
    many = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(corners)])
    few, dense = (check_path(line(*points), environment) for points in (corners, many))
    assert few.ok
    assert dense.ok
    assert dense.clearance == pytest.approx(few.clearance, abs=2e-9)
    assert dense.checked_length == pytest.approx(few.checked_length)


def test_a_tour_of_two_hundred_pieces_among_three_hundred_things_is_quick():
    things = [
        thing(f"T{k}", box((0.5 + k % 20, 0.5 + k // 20, 0), (0.7 + k % 20, 0.7 + k // 20, 1))) for k in range(300)
    ]
    environment = room(*map(put, things), radius=0.2, floors=(shapely.box(0, 0, 21, 16),))
    zigzag = [(1.1 + (k + 1) // 2 % 17, 1.1 + k // 2 % 13) for k in range(201)]
    check = check_path(line(*zigzag), environment)
    begin = time.process_time()
    again = check_path(line(*zigzag), environment)
    assert time.process_time() - begin < 2  # about 0.1 s; the rest is for slow machines
    assert again == check


def test_the_judge_shares_nothing_with_the_planner():
    program = "import sys, bimnav.verify; print(*(m for m in sys.modules if m.startswith('bimnav.')))"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    planner = {f"bimnav.{room}" for room in ("_raster", "environment", "footprint", "graph", "grid", "plan", "search")}
    assert "bimnav.verify" in loaded
    assert not planner & set(loaded)
