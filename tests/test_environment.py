"""Floor, obstacles and targets, in worlds small enough to check by eye."""

from __future__ import annotations

from dataclasses import replace

import pytest
import shapely

import bimnav as bn
from bimnav.errors import NothingWalkableError
from bimnav.testing import box, prism_shape, room, two_rooms

LOOK = bn.Task("look", "nothing to visit")


def footprints(building, robot=None):
    environment = bn.make_environment(building, LOOK, robot)
    return {o.global_id: o.footprint for o in environment.obstacles}


def test_a_table_blocks_with_its_legs_alone_below_the_top():
    top = box("top", 1, 1, 0.7, 3, 2, 0.75).shapes
    leg = box("leg", 1, 1, 0.0, 1.1, 1.1, 0.7).shapes
    table = bn.Element("table", "IfcFurniture", "Table", shapes=top + leg)
    building = room(elements=[table])
    assert footprints(building, bn.Robot(height=1.0))["table"].area == pytest.approx(2.0, abs=1e-6)
    assert footprints(building, bn.Robot(height=0.4))["table"].area == pytest.approx(0.01, abs=1e-6)


def test_what_hangs_above_the_robot_and_what_it_drives_over_do_not_block():
    lamp, rug = box("lamp", 1, 1, 2.0, 2, 2, 2.2), box("rug", 1, 1, 0.0, 2, 2, 0.02)
    blocking = footprints(room(elements=[lamp, rug]))
    assert not {"lamp", "rug"} & set(blocking)


def test_a_closed_door_is_floor_and_no_obstacle():
    environment = bn.make_environment(two_rooms(), LOOK)
    assert "door" not in {o.global_id for o in environment.obstacles}
    assert [r.source for r in environment.regions].count("door") == 1
    assert bn.build_graph(environment, cell_size=0.1).components.max() == 1


def test_rooms_without_a_door_are_apart():
    environment = bn.make_environment(two_rooms(door_width=None), LOOK)
    assert bn.build_graph(environment, cell_size=0.1).components.max() == 2


def test_a_door_narrower_than_the_robot_keeps_it_out():
    building = two_rooms(door_width=0.9)
    for radius, parts in ((0.40, 1), (0.46, 2)):
        environment = bn.make_environment(building, LOOK, bn.Robot(radius=radius))
        assert bn.build_graph(environment, cell_size=0.02).components.max() == parts


def test_outside_the_rooms_is_no_floor():
    environment = bn.make_environment(room(5, 4), LOOK)
    assert environment.floor(0).area == pytest.approx(20.0, abs=1e-6)
    graph = bn.build_graph(environment, cell_size=0.5)
    assert graph.free.sum() == 80


def test_a_wall_that_touches_the_floor_takes_none_of_its_cells():
    graph = bn.build_graph(bn.make_environment(room(5, 4), LOOK), cell_size=0.1)
    assert graph.free.sum() == 50 * 40


def test_spaces_at_two_heights_are_two_levels():
    lower, upper = (
        bn.Space(name, name, storey="s", shapes=(prism_shape(shapely.box(x, 0, x + 3, 3), z, z + 2.5),))
        for name, x, z in (("lower", 0, 0.0), ("upper", 3, 0.36))
    )
    building = bn.Building("split", (bn.Storey("s", "Level", 0.0),), (lower, upper))
    environment = bn.make_environment(building, LOOK)
    assert environment.levels == (0.0, 0.36)
    assert [r.storey for r in environment.regions] == [0, 1]


def test_a_storey_without_spaces_has_the_floor_of_its_slab():
    slab = box("slab", 0, 0, -0.2, 6, 5, 0.0, ifc_class="IfcSlab")
    building = bn.Building("plate", (bn.Storey("s", "Level", 0.0),), elements=(slab,))
    environment = bn.make_environment(building, LOOK)
    assert [(r.source, round(r.polygon.area, 6)) for r in environment.regions] == [("slab", 30.0)]


def test_a_storey_without_spaces_and_slabs_has_the_hull_of_its_walls_and_says_so():
    building = replace(room(5, 4), spaces=())
    environment = bn.make_environment(building, LOOK)
    assert [r.source for r in environment.regions] == ["hull"]
    assert [issue.code for issue in environment.issues] == ["floor-guessed"]


def test_a_building_without_any_floor_is_refused_when_cells_are_asked_for():
    building = bn.Building("void", (bn.Storey("s", "Level", 0.0),))
    with pytest.raises(NothingWalkableError, match="no floor"):
        bn.build_graph(bn.make_environment(building, LOOK), cell_size=0.1)


def test_a_robots_radius_is_kept_from_obstacles_and_never_less():
    column = box("column", 2, 2, 0, 3, 3, 2.5)
    environment = bn.make_environment(room(6, 6, elements=[column]), LOOK, bn.Robot(radius=0.3))
    body = {o.global_id: b for o, b in environment.bodies_on(0)}["column"]
    for angle in range(360):
        edge = shapely.affinity.rotate(shapely.Point(3 + 0.3, 3), angle, origin=(3, 3))
        assert body.distance(edge) < 1e-9 or not (0 < angle < 90)
        assert body.buffer(1e-9).covers(edge)


def test_a_target_on_the_table_is_served_from_beside_it_and_not_through_a_wall():
    table = box("table", 3.2, 1, 0, 4.0, 3, 0.75, name="Table")  # against the wall between the rooms
    building = two_rooms(door_width=None, elements=[table]).with_targets([("cup", 3.9, 2.0)])
    graph = bn.build_graph(bn.make_environment(building, LOOK), cell_size=0.1)
    (stop,) = graph.stops
    assert stop.approach == "standing"
    assert stop.end[0] < 3.2  # in the same room; the other room is nearer
    assert stop.destination == (3.9, 2.0, 0.0)


def test_the_papers_rule_keeps_the_cell_of_a_conflict_reachable():
    chair = box("chair", 1.0, 1.0, 0, 1.25, 1.5, 0.9, name="Chair")
    building = room(elements=[chair]).with_targets([("peel", 1.4, 1.2)])
    environment = bn.make_environment(building, LOOK)
    graph = bn.build_graph(environment, cell_size=0.5, on_conflict="reach")
    (conflict,) = graph.conflicts
    assert conflict.obstacles == ("chair",)
    assert conflict.curable
    assert graph.free[conflict.cell]
    assert graph.stops[0].approach == "reach"


def test_refining_halves_the_cells_until_the_conflict_is_gone():
    chair = box("chair", 1.0, 1.0, 0, 1.25, 1.5, 0.9, name="Chair")
    building = room(elements=[chair]).with_targets([("peel", 1.4, 1.2)])
    graph = bn.build_graph(bn.make_environment(building, LOOK), cell_size=0.5, refine="auto")
    assert graph.frame.cell_size == 0.25
    assert graph.conflicts == ()


def test_refining_gives_up_on_a_target_inside_an_obstacle():
    building = room(elements=[box("safe", 1, 1, 0, 2, 2, 1)]).with_targets([("gold", 1.5, 1.5)])
    graph = bn.build_graph(bn.make_environment(building, LOOK), cell_size=0.5, refine="auto")
    assert graph.frame.cell_size == 0.5
    assert not graph.conflicts[0].curable


def test_a_detection_without_a_storey_lies_on_the_storey_of_the_start():
    def level(name, z):
        return bn.Space(name, name, storey=name, shapes=(prism_shape(shapely.box(0, 0, 4, 4), z, z + 2.5),))

    storeys = (bn.Storey("low", "Low", 0.0), bn.Storey("high", "High", 3.0))
    building = bn.Building("two", storeys, (level("low", 0.0), level("high", 3.0))).with_targets([("spill", 1, 1)])
    assert bn.make_environment(building, LOOK).targets[0].storey == 0
    assert bn.make_environment(building, LOOK, start=(2, 2, "High")).targets[0].storey == 1
    with_height = building.with_targets([bn.Detection("cup", 1, 1, z=3.8)])
    assert bn.make_environment(with_height, LOOK).targets[1].storey == 1


def test_a_level_split_off_a_storey_is_called_by_its_own_name():
    deck = box("deck", 0, 0, 2.3, 4, 6, 2.5, ifc_class="IfcSlab")
    environment = bn.make_environment(room(8, 6, height=5, elements=[deck]), LOOK)
    assert environment.storeys_at((1, 1, "Ground floor (+2.50 m)")) == (1,)
    assert environment.storeys_at((1, 1, "Ground floor"))[0] == 0
    assert set(environment.storeys_at((1, 1, "Ground floor"))) == {0, 1}
