"""Tours in metres, seconds and joules: deadlines count seconds, bounds what the paths make least."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose

import bimnav as bn
from bimnav import Cell, NavGraph, Robot, Stop, plan_tour, plan_tours
from bimnav.errors import ValueRangeError
from bimnav.links import Link
from bimnav.testing import box, room

OBJECTIVES = ("distance", "time", "energy")
WALKER = Robot(speed=2.0, drive_power=50.0)


def hall(objective, robot=WALKER):
    """A hall of 10 m x 2 m in cells of half a metre, for a robot of 2 m/s that draws 50 W."""
    environment = bn.make_environment(room(10.0, 2.0), bn.Task("task"), robot)
    return bn.build_graph(environment, cell_size=0.5, objective=objective)


def stop_at(graph, cell, name, **asked):
    point = graph.frame.center_of(cell)
    return Stop(f"id-{name}", name, cell, point, point, **asked)


def stop_on(graph, x, name=None, **asked):
    return stop_at(graph, graph.frame.cell_at(x, 1.0), name or f"s{x:g}", **asked)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_deadline_counts_seconds_whatever_the_paths_make_least(objective):
    graph = hall(objective)
    start = graph.frame.cell_at(0.3, 1.0)
    for due, kept in ((4.2, True), (3.9, False)):  # 6 m of way take 3 s, then 1 s of work
        tour = plan_tour(graph, start, [stop_on(graph, 6.3, due=due, service_time=1.0)])
        assert bool(tour.stops) is kept, (due, objective)
        assert [lost.reason for lost in tour.unreached] == (
            [] if kept else ["it cannot be done within 3.9 s of the start"]
        )


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("due", [None, 1000.0])
def test_the_bound_is_in_the_unit_of_the_cost(objective, due):
    graph = hall(objective)
    stops = [stop_on(graph, x, due=due, service_time=3.0) for x in (8.3, 2.3, 6.3)]
    tour = plan_tour(graph, graph.frame.cell_at(0.3, 1.0), stops)
    unit = {"distance": 1.0, "time": 0.5, "energy": 25.0}[objective]
    assert tour.length == pytest.approx(8.0)
    assert tour.cost == pytest.approx(8.0 * unit)
    assert tour.lower_bound == pytest.approx(8.0 * unit)
    assert tour.is_optimal
    assert tour.gap == 0.0


def test_a_way_round_that_costs_less_takes_longer_and_its_seconds_count():
    graph = NavGraph.from_mask(np.ones((2, 11), dtype=bool), connectivity=4)
    factor = np.ones((1, 2, 11))
    factor[0, 0, 1:10] = 10.0  # straight on is 10 m and costs 91; the way round is 12 m
    graph = graph.with_cost(factor)
    robot = Robot(speed=1.0)
    for due, kept in ((12.0, True), (11.0, False)):
        stop = stop_at(graph, Cell(0, 0, 10), "far", due=due)
        tour = plan_tour(graph, Cell(0, 0, 0), [stop], robot=robot)
        assert bool(tour.stops) is kept
        assert tour.length == pytest.approx(12.0 if kept else 0.0)
        assert tour.lower_bound <= tour.cost
        assert tour.is_optimal


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_ride_in_a_lift_takes_its_own_time_and_a_stair_that_of_the_robot(objective):
    environment = bn.make_environment(room(10.0, 2.0), bn.Task("task"), WALKER)
    lift = Link(Cell(0, 0, 5), Cell(1, 0, 5), 3.0, seconds=40.0, kind="lift")
    stair = Link(Cell(0, 0, 5), Cell(1, 0, 5), 3.0, seconds=40.0, kind="stair")
    for link, due in ((lift, 5 / 1.0 + 40.0), (stair, 5 / 1.0 + 40.0 * 2.0 / 1.0)):
        mask = NavGraph.from_mask(np.ones((2, 1, 6), dtype=bool), connectors=[link])
        graph = NavGraph(
            mask.frame,
            mask.cost,
            mask.obstacle,
            mask.floor,
            8,
            environment,
            connectors=(link,),
            objective=objective,
        )
        slow = Robot(speed=1.0, drive_power=50.0)  # half as fast as the one the graph was made for
        for limit, kept in ((due + 1e-6, True), (due - 0.1, False)):
            stop = stop_at(graph, Cell(1, 0, 5), "above", due=limit)
            assert bool(plan_tour(graph, Cell(0, 0, 0), [stop], robot=slow).stops) is kept


@given(st.integers(0, 10**6), st.sampled_from(OBJECTIVES[:2]))
@settings(max_examples=25, deadline=None)
def test_no_stop_of_a_tour_is_later_than_it_is_due(seed, objective):
    rng = np.random.default_rng(seed)
    graph = NavGraph.from_mask(np.ones((6, 8), dtype=bool)).with_cost(rng.integers(1, 4, (1, 6, 8)))
    graph = graph.with_objective(objective)
    cells = [Cell(0, *divmod(k, 8)) for k in rng.choice(np.arange(1, 48), 4, replace=False).tolist()]
    stops = [
        stop_at(graph, c, str(k), due=float(rng.uniform(5, 30)), service_time=float(k)) for k, c in enumerate(cells)
    ]
    tour = plan_tour(graph, Cell(0, 0, 0), stops, robot=Robot(speed=0.7))
    clock = 0.0
    for stop, leg in zip(tour.stops, tour.legs, strict=True):
        clock += leg.length / 0.7 + stop.service_time
        assert clock <= stop.due + 1e-9
    assert tour.lower_bound <= tour.cost * (1 + 1e-9)
    fits = [s for s in stops if bn.find_path(graph, Cell(0, 0, 0), s.cell).length / 0.7 + s.service_time <= s.due]
    assert bool(tour.stops) == bool(fits)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_battery_lasts_as_far_whatever_the_paths_make_least(objective):
    robot = Robot(speed=2.0, drive_power=3600.0, battery_wh=5.0 / 2 / 0.9, charge_power=3600.0)  # 5 m
    graph = hall(objective, robot)
    start, dock = graph.frame.cell_at(0.3, 1.0), stop_on(graph, 4.3, "dock", kind="charger")
    tour = plan_tour(graph, start, [stop_on(graph, 8.3)], chargers=[dock])
    assert [stop.name for stop in tour.stops] == ["dock", "s8.3"]
    assert_allclose([tour.charges[0].detour, tour.charges[0].energy_wh], [0.0, 2.0], atol=1e-9)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_robots_share_out_seconds_whatever_the_paths_make_least(objective):
    graph = hall(objective)
    starts = [graph.frame.cell_at(x, 1.0) for x in (0.3, 9.7)]
    stops = [stop_on(graph, x, service_time=2.0) for x in (1.3, 8.7)]
    plan = plan_tours(graph, starts, stops)
    assert [[stop.name for stop in tour.stops] for tour in plan.tours] == [["s1.3"], ["s8.7"]]
    assert plan.lower_bound == pytest.approx(0.5 + 2.0)  # a metre at 2 m/s, and the work
    total = plan_tours(graph, starts, stops, objective="total")
    assert total.lower_bound == pytest.approx(2.0 * {"distance": 1.0, "time": 0.5, "energy": 25.0}[objective])


def test_a_team_says_of_what_it_cannot_reach_what_a_single_robot_says():
    wall = box("wall", 5.0, 0.0, 0.0, 5.2, 2.0, 3.0, ifc_class="IfcWall", name="Wall")
    building = room(10.0, 2.0, elements=[wall]).with_targets([("far", 8.0, 1.0), ("near", 2.0, 1.0)])
    graph = bn.build_graph(bn.make_environment(building, bn.Task("task"), WALKER), cell_size=0.25)
    start = graph.frame.cell_at(1.0, 1.0)
    one, team = plan_tour(graph, start), plan_tours(graph, [start, start])
    assert [lost.name for lost in one.unreached] == ["far"]
    assert "Wall" in one.unreached[0].reason
    assert [lost.reason for lost in team.unreached] == [lost.reason for lost in one.unreached]
    other = plan_tours(graph, [start, graph.frame.cell_at(9.0, 1.0)])
    assert other.unreached == ()
    given = plan_tours(graph, [start], graph.stops)
    alone = plan_tour(graph, start, graph.stops)
    assert [lost.reason for lost in given.unreached] == [lost.reason for lost in alone.unreached]


def test_ways_between_cells_are_measured_alike_with_and_without_a_look_at_every_path():
    from bimnav.plan.legs import legs_between

    graph = NavGraph.from_mask(np.random.default_rng(3).random((8, 9)) > 0.2)
    cells = [Cell(0, *rc) for rc in np.argwhere(graph.free[0])[::9].tolist()]
    cost = bn.distance_matrix(graph, cells)
    plain = legs_between(graph, cells, cost, Robot(speed=0.4))
    looked = legs_between(graph.with_cost(2.0), cells, 2 * cost, Robot(speed=0.4))
    assert_allclose(plain.metres, looked.metres)
    assert_allclose(plain.seconds, looked.seconds)
    for a, b in itertools.combinations(range(len(cells)), 2):
        if math.isfinite(cost[a, b]):
            assert plain.seconds[a, b] == pytest.approx(bn.find_path(graph, cells[a], cells[b]).length / 0.4)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_path_makes_least_what_it_is_asked_to(objective):
    environment = bn.make_environment(room(10.0, 2.0), bn.Task("task"), WALKER)
    link = Link(Cell(0, 0, 5), Cell(1, 0, 5), 3.0, seconds=40.0, kind="lift")
    stair = Link(Cell(0, 0, 0), Cell(1, 0, 0), 12.0, kind="stair")
    mask = NavGraph.from_mask(np.ones((2, 1, 6), dtype=bool))
    ways = {"connectors": (link, stair), "environment": environment}
    graph = NavGraph(mask.frame, mask.cost, mask.obstacle, mask.floor, 8, **ways)
    ends = Cell(0, 0, 5), Cell(1, 0, 5)
    found = bn.find_path(graph, *ends, objective=objective)
    built = bn.find_path(graph.with_objective(objective), *ends)
    assert (found.cost, found.cells) == (built.cost, built.cells)
    assert [ride.kind for _, ride in found.rides] == ["stair" if objective == "time" else "lift"]
    assert found.graph is bn.find_path(graph, *ends, objective=objective).graph
    with pytest.raises(ValueRangeError, match="objective is 'money'"):
        bn.find_path(graph, *ends, objective="money")
