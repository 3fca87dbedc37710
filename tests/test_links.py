"""Storeys joined: which connectors a robot uses, and paths, tours, checks and costs over them."""

from __future__ import annotations

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav.errors import GridError, NoPathError, ValueRangeError
from bimnav.links import Link
from bimnav.testing import assert_valid_path, box, two_storeys
from bimnav.verify import check_path
from tests.conftest import real_model

CLIMBER = bn.Robot(radius=0.25, max_riser=0.21, max_slope=0.3, uses_lifts=True)
TASK = bn.Task("task")
RUN = {"stair": 3.5, "ramp": 12.0, "lift": 2.0}


def graph_of(building, robot=CLIMBER, *, cell_size=0.2, **options):
    return bn.build_graph(bn.make_environment(building, TASK, robot), cell_size=cell_size, connectivity=8, **options)


def across(graph, x=1.0):
    """From the lower floor at the foot end to the upper floor at the same place."""
    lower, upper = (graph.frame.cell_at(x, 3.0, storey=storey) for storey in (0, 1))
    return bn.find_path(graph, lower, upper)


@pytest.mark.parametrize("kind", ["stair", "ramp", "lift"])
def test_a_robot_gets_upstairs_over_every_kind_of_connector(kind):
    graph = graph_of(two_storeys(kind, run=RUN[kind]))
    (link,) = graph.connectors
    assert (link.kind, link.global_id, link.begin.storey, link.end.storey) == (kind, "connector", 0, 1)
    path = across(graph)
    assert_valid_path(path)
    assert [ride for _, ride in path.rides] == [link]
    assert graph.components.max() == 1
    assert graph.parts.max() == 2
    drawn = np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum()
    assert path.length == pytest.approx(drawn)
    check = check_path(path.points, graph.environment)
    assert check.ok, check.violations


@pytest.mark.parametrize(
    ("kind", "robot", "reason"),
    [
        ("stair", bn.Robot(), "climbs no stairs"),
        ("stair", bn.Robot(max_riser=0.15), "its risers are 0.200 m; the robot climbs 0.15 m"),
        ("ramp", bn.Robot(max_slope=0.2), "its slope is 0.250; the robot drives up to 0.2"),
        ("lift", bn.Robot(uses_lifts=False), "does not ride in lifts"),
        ("stair", bn.Robot(radius=0.7, max_riser=0.2), "it is 1.20 m wide; the robot is 1.40 m"),
    ],
)
def test_what_a_robot_cannot_climb_is_refused_with_the_reason(kind, robot, reason):
    graph = graph_of(two_storeys(kind, run=RUN[kind]), robot)
    assert graph.connectors == ()
    (refused,) = graph.refused_connectors
    assert (refused.global_id, refused.kind) == ("connector", kind)
    assert reason in refused.reason
    with pytest.raises(NoPathError):
        across(graph)


def test_a_stair_under_a_low_beam_is_refused_and_names_the_beam():
    beam = box("beam", 4.0, 0.0, 2.1, 4.3, 4.0, 2.4, ifc_class="IfcBeam", name="Beam")
    (refused,) = graph_of(two_storeys(elements=[beam])).refused_connectors
    assert "blocked by Beam (beam)" in refused.reason


def test_a_connector_without_floor_before_it_is_refused_with_the_place():
    crate = box("crate", 2.0, 0.0, 0.0, 2.95, 4.0, 1.0)
    (refused,) = graph_of(two_storeys(elements=[crate])).refused_connectors
    assert "no free cell with a straight way lies within 1 m of its end at (2.60, 0.60, 0.00)" in refused.reason


def test_a_task_can_forbid_a_stair_or_make_it_dear():
    stair = "IfcStairFlight"
    dear = bn.Task("task", avoid=(bn.Rule(stair, factor=3.0),))
    closed = bn.Task("task", restricted=(bn.Rule(stair),))
    graphs = [bn.build_graph(bn.make_environment(two_storeys(), task, CLIMBER)) for task in (dear, closed)]
    assert [[link.factor for link in graph.connectors] for graph in graphs] == [[3.0], []]
    assert graphs[1].refused_connectors[0].reason == "the task restricts it"


def test_the_judge_refuses_a_way_upstairs_that_follows_no_connector():
    graph = graph_of(two_storeys())
    environment, points = graph.environment, across(graph).points.copy()
    climbing = np.flatnonzero(np.diff(points[:, 2]) > 0)
    aside = points.copy()
    aside[climbing[5], 1] += 0.05
    assert "no-storey" in {v.kind for v in check_path(aside, environment).violations}
    jump = np.delete(points, climbing[1:], axis=0)
    assert {v.kind for v in check_path(jump, environment).violations} >= {"storey-jump"}


def test_the_judge_refuses_a_stair_that_the_robot_cannot_climb():
    graph = graph_of(two_storeys())
    points = across(graph).points
    lame = bn.make_environment(two_storeys(), TASK, bn.Robot(radius=0.25))
    assert [v.kind for v in check_path(points, lame).violations] == ["climb"]


def test_the_judge_sees_what_hangs_over_a_stair():
    points = across(graph_of(two_storeys())).points
    beam = box("beam", 4.0, 0.0, 2.1, 4.3, 4.0, 2.4, ifc_class="IfcBeam", name="Beam")
    low = bn.make_environment(two_storeys(elements=[beam]), TASK, CLIMBER)
    (violation,) = check_path(points, low).violations
    assert (violation.kind, violation.global_id) == ("body", "beam")


def test_a_tour_over_two_storeys_is_planned_checked_and_played():
    building = two_storeys().with_targets([("below", 1.0, 3.0, "Lower floor"), ("above", 1.0, 3.0, "Upper floor")])
    mission = bn.run(building, robot=CLIMBER, start=(8.0, 3.0, "Lower floor"), cell_size=0.2, return_to_start=True)
    assert {stop.name for stop in mission.tour.stops} == {"below", "above"}
    assert mission.check.ok
    heights = np.concatenate([line[:, 2] for line in mission.tour.route])
    assert (heights.min(), heights.max()) == (0.0, 3.0)
    assert mission.result.metrics["served"] == 2


def test_parallel_connectors_are_one_edge_of_the_cheaper_and_both_engines_take_it():
    ends = bn.Cell(0, 0, 0), bn.Cell(1, 0, 1)
    links = [Link(*ends, 5.0, global_id="long"), Link(*ends[::-1], 2.0, global_id="short", kind="lift")]
    graph = bn.NavGraph.from_mask(np.ones((2, 1, 2), bool), connectors=links)
    assert len(graph.edges()[0]) == 3
    for engine in ("compiled", "rustworkx"):
        path = bn.find_path(graph, bn.Cell(0, 0, 1), bn.Cell(1, 0, 0), engine=engine)
        assert path.cost == path.length == 4.0
        assert [link.global_id for _, link in path.rides] == ["short"]


def test_a_connector_with_a_blocked_end_is_closed():
    link = Link((0, 0, 0), (1, 0, 0), 1.0)
    graph = bn.NavGraph.from_mask(np.ones((2, 1, 2), bool), connectors=[link]).block([bn.Cell(1, 0, 0)])
    assert len(graph.edges()[0]) == 1
    assert graph.components[0, 0, 0] != graph.components[1, 0, 1]
    with pytest.raises(NoPathError):
        bn.find_path(graph, bn.Cell(0, 0, 0), bn.Cell(1, 0, 1))


@pytest.mark.parametrize("link", [(-1.0,), (1.0, np.inf), (np.nan,)])
def test_a_link_with_numbers_out_of_range_is_refused(link):
    with pytest.raises(ValueRangeError):
        Link((0, 0, 0), (1, 0, 0), *link)


def test_a_link_joins_two_storeys_of_the_frame():
    with pytest.raises(ValueRangeError, match="joins two storeys"):
        Link((0, 0, 0), (0, 0, 3), 1.0)
    with pytest.raises(GridError):
        bn.NavGraph.from_mask(np.ones((2, 1, 2), bool), connectors=[Link((0, 0, 0), (2, 0, 0), 1.0)])


def test_objectives_choose_between_a_long_ramp_and_a_slow_lift():
    robot = bn.Robot(drive_power=100.0, idle_power=1.0)
    ramp = Link((0, 0, 0), (1, 0, 0), 20.0, 40.0, "ramp", "ramp")
    lift = Link((0, 0, 0), (1, 0, 0), 3.0, 60.0, "lift", "lift")
    environment = bn.make_environment(two_storeys(), TASK, robot)
    graph = bn.build_graph(environment, cell_size=0.5)
    a, b = graph.frame.cell_at(1, 3, storey=0), graph.frame.cell_at(1, 3, storey=1)
    links = tuple(replace(link, begin=a, end=b) for link in (ramp, lift))
    found = {}
    for objective in ("distance", "time", "energy"):
        aimed = replace(graph, connectors=links).with_objective(objective)
        path = bn.find_path(aimed, a, b)
        found[objective] = path.rides[0][1].kind, path.cost
        assert bn.find_path(aimed, a, b, engine="rustworkx").cost == pytest.approx(path.cost)
    assert found == {"distance": ("lift", 3.0), "time": ("ramp", 40.0), "energy": ("lift", 60.0)}


def test_a_robot_drives_to_the_cabin_and_waits_in_it():
    robot = bn.Robot(speed=0.5, drive_power=100.0, idle_power=1.0)
    graph = bn.build_graph(bn.make_environment(two_storeys(), TASK, robot), cell_size=0.5, objective="energy")
    a, b = graph.frame.cell_at(1, 3, storey=0), graph.frame.cell_at(1, 3, storey=1)
    rise = graph.frame.elevations[1] - graph.frame.elevations[0]
    lift = Link(a, b, rise + 4.0, 60.0, "lift", "lift")
    assert graph.cost_of(lift) == pytest.approx(8 * 100 + 52 * 1)
    assert graph.cost_of(replace(lift, seconds=5.0)) == pytest.approx(5 * 100)


def test_without_power_there_is_no_energy_to_save():
    with pytest.raises(ValueRangeError, match="drive_power"):
        graph_of(two_storeys(), objective="energy")


@st.composite
def linked_worlds(draw):
    shape = draw(st.tuples(st.integers(1, 3), st.integers(1, 6), st.integers(1, 6)))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    free = rng.random(shape) > 0.25
    cells = [bn.Cell(*cell) for cell in np.ndindex(*shape)]
    links = []
    for _ in range(int(rng.integers(0, 6))):
        a, b = (cells[int(rng.integers(len(cells)))] for _ in range(2))
        if a.storey != b.storey:
            links.append(Link(a, b, float(rng.choice([0.0, 0.5, 1.0, 4.0])), factor=float(rng.choice([1.0, 2.0]))))
    connectivity = draw(st.sampled_from([4, 8]))
    graph = bn.NavGraph.from_mask(free, cell_size=0.5, connectivity=connectivity, connectors=links)
    if draw(st.booleans()):
        graph = graph.with_cost(rng.choice([1.0, 2.0, 7.5], size=shape))
    ends = [cell for cell in cells if free[cell]]
    return graph, ends, rng


@settings(max_examples=60, deadline=None)
@given(linked_worlds())
def test_every_search_agrees_with_dijkstra_on_the_explicit_graph(world):
    graph, ends, rng = world
    if not ends:
        return
    start, goal = (ends[int(rng.integers(len(ends)))] for _ in range(2))
    lengths = nx.single_source_dijkstra_path_length(graph.to_networkx(), start)
    field = bn.distance_field(graph, start)
    best = lengths.get(goal, np.inf)
    assert field[goal] == pytest.approx(best)
    assert bn.distance_matrix(graph, [start, goal])[0, 1] == pytest.approx(best)
    assert (graph.components[start] == graph.components[goal]) == np.isfinite(best)
    for algorithm in ("auto", "astar", "dijkstra"):
        for engine in ("compiled", "rustworkx"):
            if np.isinf(best):
                with pytest.raises(NoPathError):
                    bn.find_path(graph, start, goal, algorithm=algorithm, engine=engine)
            else:
                path = bn.find_path(graph, start, goal, algorithm=algorithm, engine=engine)
                assert_valid_path(path)
                assert path.cost == pytest.approx(best)


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("duplex/Duplex_A_20110907.ifc", ["stair", "stair"]),
        ("office/Office_A_20110811.ifc", ["stair", "stair", "lift"]),
        ("office/demo2.ifc", ["ramp", "stair", "stair"]),
    ],
)
def test_the_storeys_of_a_real_model_are_joined_and_the_way_is_safe(name, kinds):
    building = bn.read_ifc(real_model(name))
    robot = bn.Robot(radius=0.25, max_riser=0.2, max_slope=0.4)
    graph = bn.build_graph(bn.make_environment(building, TASK, robot), cell_size=0.1, connectivity=8)
    assert [link.kind for link in graph.connectors] == kinds
    for link in graph.connectors:
        path = bn.find_path(graph, link.begin, link.end)
        assert path.length <= link.length + 1e-9
        assert check_path(path.points, graph.environment).ok


LONG = bn.Robot(name="long", outline=((0.5, 0.25), (-0.5, 0.25), (-0.5, -0.25), (0.5, -0.25)), max_riser=0.21)


@pytest.mark.parametrize("kind", ["stair", "lift"])
def test_a_long_robot_gets_on_farther_away(kind):
    building = two_storeys(kind)
    graph = graph_of(building, LONG)
    assert LONG.radius > 0.5
    assert LONG.half_width == 0.25
    (link,) = graph.connectors
    path = across(graph)
    assert check_path(path.points, graph.environment).ok
    assert link.length > across(graph_of(building)).rides[0][1].length
