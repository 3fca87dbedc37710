"""Rooms, doors and connectors as a map, and routes that stay valid while the world changes."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav.errors import NoPathError, NothingWalkableError
from bimnav.plan.paths import smooth_path
from bimnav.testing import assert_valid_path, two_rooms, two_storeys
from tests.conftest import real_model

TASK = bn.Task("task")


def graph_of(building, **robot):
    environment = bn.make_environment(building, TASK, bn.Robot(radius=0.2, **robot))
    return bn.build_graph(environment, cell_size=0.2, connectivity=8)


def named(topology):
    places = [place.global_id for place in topology.places]
    return {frozenset(places[k] for k in edge) for edge in topology.edges.tolist()}


def test_rooms_touch_their_door_and_not_each_other():
    map_ = bn.topology(graph_of(two_rooms()))
    assert named(map_) == {frozenset({"space-west", "door"}), frozenset({"space-east", "door"})}
    assert map_.to_rustworkx().num_nodes() == 3
    route = map_.route((1, 1, 0), (7, 1, 0))
    assert [place.global_id for place in route] == ["space-west", "door", "space-east"]
    assert map_.route((1, 1, 0), (7, 1, 0), closed=["door"]) is None
    assert [place.global_id for place in map_.route((1, 1, 0), (2, 2, 0))] == ["space-west"]
    assert map_.place_at(1, 1, 0).global_id == "space-west"
    assert map_.place_at(100, 100, 0) is None


@pytest.mark.parametrize("kind", ["stair", "lift"])
def test_connectors_touch_the_floors_at_their_ends(kind):
    graph = graph_of(two_storeys(kind), max_riser=0.21)
    map_ = bn.topology(graph)
    route = map_.route((1, 3, 0), (1, 3, 1))
    assert [place.kind for place in route if place.kind == kind] == [kind]
    path = bn.find_path(graph, graph.frame.cell_at(1, 3, storey=0), graph.frame.cell_at(1, 3, storey=1))
    assert kind in [place.kind for place in map_.along(path.points)]


def test_a_path_through_a_door_passes_it_once():
    graph = graph_of(two_rooms())
    path = bn.find_path(graph, graph.frame.cell_at(1, 1), graph.frame.cell_at(7, 3))
    assert [place.global_id for place in bn.topology(graph).along(path.points)] == ["door"]
    beside = bn.find_path(graph, graph.frame.cell_at(1, 1), graph.frame.cell_at(3, 3))
    assert bn.topology(graph).along(beside.points) == ()


def test_a_mask_has_no_rooms():
    with pytest.raises(NothingWalkableError):
        bn.topology(bn.NavGraph.from_mask(np.ones((2, 2), bool)))


def test_the_rooms_of_a_real_model_are_joined_by_its_doors():
    graph = graph_of(bn.read_ifc(real_model("houses/SampleHouse4.ifc")))
    map_ = bn.topology(graph)
    frame, rooms = graph.frame, []
    for region in graph.environment.regions:
        cells = np.argwhere(graph.free[region.storey])
        centers = frame.centers_of(np.insert(cells, 0, region.storey, axis=1))
        inside = np.flatnonzero(shapely.contains_xy(region.polygon, centers[:, :2]))
        if region.source == "space" and len(inside):
            row, col = cells[inside[len(inside) // 2]].tolist()
            rooms.append((*centers[inside[len(inside) // 2], :2].tolist(), bn.Cell(region.storey, row, col)))
    assert len(rooms) >= 3
    for x, y, cell in rooms:
        for u, v, other in rooms:
            if graph.components[cell] == graph.components[other]:
                assert map_.route((x, y, cell.storey), (u, v, other.storey)) is not None


def replanner():
    graph = graph_of(two_rooms())
    return bn.Replanner(graph, graph.frame.cell_at(1, 1), graph.frame.cell_at(7, 3)), graph


def test_a_change_beside_the_way_needs_no_search():
    robot, graph = replanner()
    before = robot.path
    found = robot.update(graph.with_obstacle(shapely.box(0.4, 3.0, 0.8, 3.6)))
    assert (found.path.cells, found.path.cost) == (before.cells, before.cost)
    assert (found.is_changed, found.searched) == (False, False)


def test_a_closed_door_ends_the_route_and_an_open_one_brings_it_back():
    robot, graph = replanner()
    first = robot.path
    shut = robot.update(graph.close_door("door"))
    assert (shut.path, shut.is_changed, shut.causes) == (None, True, ("door",))
    assert shut.message == "there is no route now: blocked by Door (door)"
    back = robot.update(robot.graph.open_door("door"))
    assert back.is_changed
    assert back.path.cost == first.cost


def test_a_crate_on_the_way_is_named_and_driven_around():
    robot, graph = replanner()
    x, y, _ = robot.path.points[6]
    crate = shapely.box(x - 0.6, y - 0.6, x + 0.6, y + 0.6)
    found = robot.update(graph.with_obstacle(crate, global_id="crate", name="Crate"))
    assert (found.is_changed, found.causes) == (True, ("crate",))
    assert found.message.startswith("Crate (crate) closed the way; the new way is")
    back = robot.update(robot.graph.without_obstacle("crate"))
    assert back.causes == ("crate",)
    assert "no longer closes the way" in back.message


def test_a_robot_under_way_goes_on_from_where_it_is():
    robot, graph = replanner()
    cell = robot.path.cells[5]
    found = robot.update(graph.with_obstacle(shapely.box(0.3, 3.2, 0.6, 3.6)), cell)
    assert (found.is_changed, found.path.cells[0]) == (False, cell)
    assert_valid_path(found.path)
    off = graph.frame.cell_at(3.0, 3.5)
    assert robot.update(graph, off).message == "a route was found from where the robot is"


def test_without_a_route_to_begin_with_there_is_no_replanner():
    graph = graph_of(two_rooms()).close_door("door")
    with pytest.raises(NoPathError):
        bn.Replanner(graph, graph.frame.cell_at(1, 1), graph.frame.cell_at(7, 3))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_replanned_path_costs_what_a_new_one_does(seed):
    rng = np.random.default_rng(seed)
    shape = (1, 9, 9)
    graph = bn.NavGraph.from_mask(np.ones(shape, bool), connectivity=int(rng.choice([4, 8])))
    goal = bn.Cell(0, 8, 8)
    robot = bn.Replanner(graph, bn.Cell(0, 0, 0), goal)
    blocked = []
    for _ in range(6):
        cells = [bn.Cell(0, *(int(k) for k in rng.integers(9, size=2))) for _ in range(4)]
        cells = [cell for cell in cells if cell not in (goal, robot.at)]
        if rng.random() < 0.6:
            graph, blocked = graph.block(cells), blocked + cells
        elif blocked:
            graph = graph.unblock(blocked[:3])
        if rng.random() < 0.2:
            graph = graph.with_cost(rng.choice([1.0, 3.0], size=shape))
        at = None
        if robot.path is not None and rng.random() < 0.5:
            ahead = [cell for cell in robot.path.cells[:3] if graph.free[cell]]
            at = ahead[-1] if ahead else None
        found = robot.update(graph, at)
        try:
            new = bn.find_path(graph, robot.at, goal)
        except NoPathError:
            assert found.path is None
            assert found.why is not None
            continue
        assert_valid_path(found.path)
        assert found.path.graph.cost is not None
        assert found.path.cost == pytest.approx(new.cost)
        assert all(graph.free[cell] for cell in found.path.cells)


def test_a_replanner_shows_where_it_leads():
    graph = bn.NavGraph.from_mask(np.ones((1, 4), dtype=bool))
    robot = bn.Replanner(graph, bn.Cell(0, 0, 0), bn.Cell(0, 0, 3))
    assert repr(robot) == f"Replanner({bn.Cell(0, 0, 0)} to {bn.Cell(0, 0, 3)}, 4 cells, 3.000 m)"
    robot.update(graph.block([bn.Cell(0, 0, 2)]))
    assert repr(robot).endswith("no route now)")


def test_a_way_that_stays_as_it_was_is_drawn_straight_past_what_is_new():
    graph = bn.NavGraph.from_mask(np.ones((12, 12), bool), connectivity=4)
    robot = bn.Replanner(graph, bn.Cell(0, 0, 0), bn.Cell(0, 11, 11))
    crate = shapely.box(5.2, 5.2, 6.8, 6.8)
    assert not shapely.LineString(robot.path.waypoints[:, :2]).intersects(crate)
    found = robot.update(graph.with_obstacle(crate))
    assert not found.is_changed
    assert not shapely.LineString(smooth_path(found.path).waypoints[:, :2]).intersects(crate)
