"""A changing world: what is closed and opened again equals a graph built anew, bit for bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav.errors import GeometryError, GridError, ModelError, NoPathError, ValueRangeError
from bimnav.testing import box, two_rooms, two_storeys
from bimnav.verify import check_path

ROBOT = bn.Robot(radius=0.2, max_riser=0.21)
TABLE = box("table", 1.0, 1.0, 0.0, 1.6, 1.8, 0.8)


def environment_of(building, *targets):
    return bn.make_environment(building.with_targets(targets), bn.Task("task"), ROBOT)


def rooms(**options):
    environment = environment_of(two_rooms(elements=[TABLE]), ("a", 0.5, 0.5), ("b", 1.3, 1.4), ("c", 6.0, 2.0))
    return bn.build_graph(environment, cell_size=0.2, **options)


def assert_equal(graph, built):
    for name in ("cost", "obstacle", "floor", "free", "kinds", "components"):
        assert getattr(graph, name).tobytes() == getattr(built, name).tobytes(), name
    assert [link_values(link) for link in graph.connectors] == [link_values(link) for link in built.connectors]
    assert graph.refused_connectors == built.refused_connectors
    conflicts = [[(c.global_id, c.cell, c.obstacles, c.curable) for c in g.conflicts] for g in (graph, built)]
    assert conflicts[0] == conflicts[1]


def link_values(link):
    return link.begin, link.end, link.length, link.seconds, link.points.tobytes()


def test_what_did_not_change_is_shared():
    graph = rooms()
    closed = graph.block([bn.Cell(0, 3, 3)])
    assert closed.floor is graph.floor
    assert closed.environment is graph.environment
    assert graph.with_cost(2.0).obstacle is graph.obstacle


def test_unblocking_opens_only_what_was_blocked():
    graph = rooms()
    cell, table = graph.frame.cell_at(3.0, 3.0), graph.frame.cell_at(1.3, 1.4)
    opened = graph.block([cell, table]).unblock([cell, table])
    assert_equal(opened, graph)
    assert not opened.free[table]


def test_a_closed_door_parts_the_rooms_and_an_open_one_joins_them():
    graph = rooms()
    a, b = graph.frame.cell_at(3.0, 3.0), graph.frame.cell_at(6.0, 3.0)
    path = bn.find_path(graph, a, b)
    closed = graph.close_door("door")
    with pytest.raises(NoPathError):
        bn.find_path(closed, a, b)
    assert {v.global_id for v in check_path(path.points, closed.environment).violations} == {"door"}
    assert closed.close_door("door") is closed
    assert_equal(closed.open_door("door"), graph)
    assert graph.open_door("door") is graph


def test_an_obstacle_is_grown_by_the_robot_and_seen_by_the_judge():
    graph = rooms()
    crate = shapely.box(2.6, 2.6, 3.0, 3.0)
    changed = graph.with_obstacle(crate, global_id="crate")
    assert not changed.free[graph.frame.cell_at(2.5, 2.8)]
    points = [[2.0, 2.5, 0.0], [3.5, 2.5, 0.0]]
    assert check_path(points, graph.environment).ok
    assert not check_path(points, changed.environment).ok
    assert_equal(changed.without_obstacle("crate"), graph)


def test_an_obstacle_without_a_name_is_known_by_its_place():
    one, same = (rooms().with_obstacle(shapely.box(2, 2, 3, 3)).changes.placed[0].global_id for _ in range(2))
    assert one == same
    assert len(one) == 22


def test_an_obstacle_on_a_mask_closes_its_cells():
    graph = bn.NavGraph.from_mask(np.ones((4, 4), bool))
    changed = graph.with_obstacle(shapely.box(1, 1, 2, 3), global_id="x")
    assert np.argwhere(~changed.free[0]).tolist() == [[1, 1], [2, 1]]
    assert changed.without_obstacle("x").free.all()


@pytest.mark.parametrize("on_conflict", ["approach", "reach"])
def test_an_obstacle_on_a_target_is_a_conflict(on_conflict):
    graph = rooms(on_conflict=on_conflict).with_obstacle(shapely.box(5.8, 1.8, 6.2, 2.2), global_id="crate")
    assert [(c.name, c.obstacles) for c in graph.conflicts] == [("b", ("table",)), ("c", ("crate",))]
    assert graph.free[graph.targets[2][1]] == (on_conflict == "reach")


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (lambda graph: graph.without_obstacle("nothing"), ModelError),
        (lambda graph: graph.close_door("nothing"), ModelError),
        (lambda graph: graph.with_obstacle(shapely.Polygon()), GeometryError),
        (lambda graph: graph.with_obstacle(shapely.box(0, 0, 1, 1), 7), ValueRangeError),
        (lambda graph: graph.with_obstacle(shapely.box(0, 0, 1, 1), "attic"), ValueRangeError),
        (lambda graph: graph.unblock([bn.Cell(0, 99, 0)]), GridError),
    ],
)
def test_a_change_that_names_nothing_is_refused(change, error):
    with pytest.raises(error):
        change(rooms())


def test_a_stair_whose_foot_is_blocked_is_joined_beside_it_or_refused():
    graph = bn.build_graph(environment_of(two_storeys()), cell_size=0.2)
    (link,) = graph.connectors
    beside = graph.block([link.begin])
    assert [other.begin for other in beside.connectors] != [link.begin]
    assert len(beside.connectors) == 1
    closed = graph.with_obstacle(shapely.box(1.5, 0, 2.9, 4), "Lower floor", global_id="crates")
    assert closed.connectors == ()
    assert closed.refused_connectors[0].global_id == "connector"
    assert_equal(closed.without_obstacle("crates").unblock([]), graph)


STEPS = st.one_of(
    st.tuples(st.just("block"), st.integers(0, 60), st.integers(0, 25)),
    st.tuples(st.just("unblock"), st.integers(0, 60), st.integers(0, 25)),
    st.tuples(st.just("place"), st.integers(0, 80), st.integers(0, 40)),
    st.tuples(st.just("take"), st.integers(0, 3), st.just(0)),
    st.tuples(st.just("door"), st.booleans(), st.just(0)),
    st.tuples(st.just("cost"), st.integers(1, 4), st.integers(0, 2)),
    st.tuples(st.just("clearance"), st.integers(0, 9), st.integers(0, 2)),
)
FRESH = {how: rooms(on_conflict=how) for how in ("approach", "reach")}
STAIRS = bn.build_graph(environment_of(two_storeys(), ("a", 1, 3), ("b", 2.6, 0.6)), cell_size=0.25)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(["approach", "reach", "stairs"]), st.lists(STEPS, max_size=8))
def test_any_changes_equal_a_graph_built_anew(world, steps):
    first = graph = STAIRS if world == "stairs" else FRESH[world]
    blocked, placed, costs = set(), {}, []
    for k, (what, x, y) in enumerate(steps):
        if what in ("block", "unblock"):
            _, rows, cols = graph.frame.shape
            cells = [bn.Cell(0, y % rows, (x + n) % cols) for n in range(3)]
            graph = getattr(graph, what)(cells)
            blocked = blocked | set(cells) if what == "block" else blocked - set(cells)
        elif what == "place":
            footprint = shapely.box(x / 10, y / 10, x / 10 + 0.7, y / 10 + 0.33)
            graph = graph.with_obstacle(footprint, global_id=f"crate-{k}")
        elif what == "take" and len(graph.changes.placed) > x:
            graph = graph.without_obstacle(graph.changes.placed[x].global_id)
        elif what == "door" and world != "stairs":
            graph = graph.close_door("door") if x else graph.open_door("door")
        elif what == "cost":
            factor = np.random.default_rng(y).choice(
                [1.0, float(x), 2.5, np.inf], size=graph.frame.shape, p=[0.5, 0.2, 0.28, 0.02]
            )
            costs.append(("with_cost", factor))
            graph = graph.with_cost(factor)
        elif what == "clearance":
            costs.append(("with_clearance", x / 5, float(y)))
            graph = graph.with_clearance(x / 5, float(y))
    placed = tuple(entry.obstacle for entry in graph.changes.placed)
    environment = replace(first.environment, obstacles=(*first.environment.obstacles, *placed))
    built = bn.build_graph(environment, cell_size=first.frame.cell_size, on_conflict=first.on_conflict)
    built = built.block(blocked)
    for change, *asked in costs:
        built = getattr(built, change)(*asked)
    assert_equal(graph, built)


def test_what_stands_in_the_way_since_repels_like_what_stood_there_before():
    graph = rooms(clearance=0.8)
    cell = graph.frame.cell_at(3.0, 3.0)
    changed = graph.with_obstacle(shapely.box(2.6, 2.6, 2.8, 2.8), global_id="crate")
    assert changed.cost[cell] > graph.cost[cell]
    assert_equal(changed.without_obstacle("crate"), graph)
    twice = rooms().with_clearance(0.8).with_clearance(0.4, 2.0).block([cell])
    assert_equal(twice, rooms().block([cell]).with_clearance(0.8).with_clearance(0.4, 2.0))
    assert twice.clearances == ((0.8, 4.0), (0.4, 2.0))
    assert_equal(twice.with_cost(1.0), rooms().block([cell]))


def test_a_cost_given_to_a_target_without_floor_outlasts_changes_on_top_of_it():
    environment = bn.make_environment(
        bn.read_ifc(bn.sample("apartment")), bn.load_task("cleaning"), bn.Robot(radius=0.25)
    )
    graph = bn.build_graph(environment, cell_size=0.2, on_conflict="reach")
    cell = next(c.cell for c in graph.conflicts if not graph.floor[c.cell])
    dear, crate = np.full(graph.frame.shape, 3.0), shapely.box(*graph.frame.box_of(cell))
    before, after = graph.with_cost(dear).with_obstacle(crate), graph.with_obstacle(crate).with_cost(dear)
    assert before.cost[cell] == after.cost[cell] == 3


def test_a_crate_that_bears_the_name_of_a_door_is_not_that_door():
    graph = rooms()
    west, east = graph.frame.cell_at(0.5, 0.5), graph.frame.cell_at(6.0, 2.0)
    crate = graph.with_obstacle(shapely.box(0.3, 3.2, 0.6, 3.5), global_id="door")
    shut = crate.close_door("door")
    assert crate.components[west] == crate.components[east]
    assert shut.components[west] != shut.components[east]
    assert shut.open_door("door").cost.tobytes() == crate.cost.tobytes()
