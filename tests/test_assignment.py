"""Who serves what: compared with trying all, and with published routes."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import bimnav as bn
from bimnav import Cell, NavGraph, Robot, Stop, assign_stops, plan_tours
from bimnav.errors import InputError, NoPathError, ValueRangeError
from tests.conftest import bench_file


def spread(rng, count):
    xy = rng.random((count, 2))
    return np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))


def cheapest(cost, start, rows, end):
    tail = [] if end is None else [end]
    return min(
        sum(cost[a, b] for a, b in itertools.pairwise([start, *middle, *tail]))
        for middle in itertools.permutations(rows)
    )


def best_by_trying_all(costs, starts, ends, rows, objective, loads=None, most=None):
    combine = sum if objective == "total" else max
    best = math.inf
    for owner in itertools.product(range(len(starts)), repeat=len(rows)):
        shares = [[row for row, k in zip(rows, owner, strict=True) if k == robot] for robot in range(len(starts))]
        if loads is None or all(sum(loads[r] for r in s) <= m for s, m in zip(shares, most, strict=True)):
            parts = zip(costs, starts, shares, ends, strict=True)
            best = min(best, combine(cheapest(*part) for part in parts))
    return best


@pytest.mark.parametrize("objective", ["total", "makespan"])
@pytest.mark.parametrize("returns", [False, True])
def test_few_stops_are_shared_out_as_well_as_by_trying_all(objective, returns):
    rng = np.random.default_rng(1)
    for robots in (1, 2, 3):
        cost = spread(rng, robots + 5)
        costs = [cost * factor for factor in (1.0, 0.7, 2.0)[:robots]]
        starts = list(range(robots))
        loads, most = np.r_[np.zeros(robots), [1, 2, 1, 1, 2]], [5, 4, 4][:robots]
        for demands, capacities in ((None, None), (loads, most)):
            if demands is not None and robots == 1:
                continue
            found = assign_stops(
                costs,
                starts,
                return_to_start=returns,
                objective=objective,
                demands=demands,
                capacities=capacities,
            )
            ends = starts if returns else [None] * robots
            rows = range(robots, robots + 5)
            best = best_by_trying_all(costs, starts, ends, rows, objective, demands, capacities)
            assert_allclose(getattr(found, objective), best)
            assert found.is_optimal
            assert sorted(row for route in found.routes for row in route) == list(range(robots + 5))
            for k, (route, paid) in enumerate(zip(found.routes, found.costs, strict=True)):
                along = [*route, route[0]] if returns else route
                assert_allclose(paid, sum(costs[k][a, b] for a, b in itertools.pairwise(along)), atol=1e-12)


def test_a_row_that_a_robot_may_not_serve_goes_to_another():
    cost = spread(np.random.default_rng(2), 8)
    allowed = np.ones((2, 8), dtype=bool)
    allowed[0, 4:] = False
    for few in (True, False):
        big = cost if few else np.pad(cost, (0, 10), mode="reflect")
        may = allowed if few else np.pad(allowed, ((0, 0), (0, 10)), constant_values=False)
        may[1] = True
        np.fill_diagonal(big, 0.0)
        found = assign_stops(big, [0, 1], allowed=may, objective="makespan")
        assert set(found.routes[0]) <= {0, 2, 3}


def test_many_stops_are_shared_fairly_when_the_last_to_finish_counts():
    rng = np.random.default_rng(3)
    xy = np.vstack([[[0.5, 0.5]] * 3, rng.random((16, 2))])
    cost = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    together = assign_stops(cost, [0, 1, 2], return_to_start=True)
    fair = assign_stops(cost, [0, 1, 2], return_to_start=True, objective="makespan")
    assert fair.makespan < 0.7 * together.makespan
    assert fair.bound <= fair.makespan
    assert together.bound <= together.total <= fair.total + 1e-9
    assert sorted(row for route in fair.routes for row in route) == list(range(19))
    assert fair.routes == assign_stops(cost, [0, 1, 2], return_to_start=True, objective="makespan").routes


@pytest.mark.parametrize("count", [6, 20])
def test_stops_that_no_robot_can_take_are_refused(count):
    cost = spread(np.random.default_rng(4), count)
    with pytest.raises(NoPathError, match="capacity"):
        assign_stops(cost, [0, 1], demands=np.ones(count), capacities=[1, 1])
    with pytest.raises(NoPathError):
        assign_stops(cost, [0, 1], allowed=np.zeros((2, count), dtype=bool))


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"starts": []}, InputError),
        ({"starts": [9]}, ValueRangeError),
        ({"ends": [1, 2]}, InputError),
        ({"ends": [1], "return_to_start": True}, InputError),
        ({"demands": [0, 0, 1]}, InputError),
        ({"demands": [0, 0, 1], "capacities": [math.nan]}, ValueRangeError),
        ({"allowed": [[True]]}, InputError),
        ({"objective": "time"}, ValueRangeError),
    ],
)
def test_what_cannot_be_assigned_is_refused(options, error):
    with pytest.raises(error):
        assign_stops(np.ones((3, 3)), **{"starts": [0], **options})


def read_routing(name):
    """Whole costs, demands, capacity, number of vehicles and group of every row, from a published case."""
    section, coordinates, demands, groups, numbers = "", {}, {}, {}, {}
    for line in bench_file(f"vrp/{name}.vrp").read_text().splitlines():
        words = line.replace(":", " : ").split()
        if words and words[0].endswith("SECTION"):
            section = words[0]
        elif section == "NODE_COORD_SECTION":
            coordinates[int(words[0])] = tuple(map(float, words[1:]))
        elif section == "DEMAND_SECTION":
            demands[int(words[0])] = float(words[1])
        elif "GROUP" in section and len(words) > 1:
            groups |= {int(word): int(words[0]) for word in words[1:]}
        elif not section and words and words[0] in ("VEHICLES", "CAPACITY"):
            numbers[words[0]] = int(words[-1])
    xy = np.array([coordinates[k + 1] for k in range(len(coordinates))])
    cost = np.rint(np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1)))
    group = [groups.get(k + 1, 0) for k in range(len(xy))]
    return cost, [demands[k + 1] for k in range(len(xy))], numbers["CAPACITY"], numbers["VEHICLES"], group


@pytest.mark.parametrize(
    ("name", "best"), [("M-n101-k10-C34-V4", 458), ("M-n151-k12-C51-V4", 483), ("M-n200-k16-C67-V6", 605)]
)
def test_published_routes_with_groups_and_capacity_are_matched_within_one_percent(name, best):
    cost, demands, capacity, robots, groups = read_routing(name)
    found = assign_stops(
        cost,
        [0] * robots,
        return_to_start=True,
        groups=groups,
        demands=demands,
        capacities=[capacity] * robots,
    )
    assert best <= found.total <= 1.01 * best
    assert found.bound <= best
    visited = [groups[row] for route in found.routes for row in route[1:]]
    assert sorted(visited) == sorted(set(groups) - {0})
    assert all(sum(demands[row] for row in route[1:]) <= capacity for route in found.routes)


def stops_on(graph, cells, **asked):
    return [
        Stop(
            f"id-{k}",
            f"s{k}",
            Cell(*cell),
            graph.frame.center_of(Cell(*cell)),
            graph.frame.center_of(Cell(*cell)),
            **asked,
        )
        for k, cell in enumerate(cells)
    ]


FLOOR = NavGraph.from_mask(np.ones((10, 40), dtype=bool), cell_size=0.5)


def test_two_robots_at_both_ends_of_a_hall_serve_their_own_half():
    stops = stops_on(FLOOR, [(0, 5, col) for col in (2, 8, 14, 25, 31, 37)])
    plan = plan_tours(FLOOR, [Cell(0, 5, 0), Cell(0, 5, 39)], stops)
    assert [[s.name for s in tour.stops] for tour in plan.tours] == [["s0", "s1", "s2"], ["s5", "s4", "s3"]]
    assert [robot.name for robot in plan.robots] == ["R1", "R2"]
    assert plan.is_optimal
    assert plan.unreached == ()
    assert plan.length == sum(tour.length for tour in plan.tours)


def test_a_faster_robot_serves_more():
    stops = stops_on(FLOOR, [(0, 5, col) for col in range(2, 39, 4)])
    robots = [Robot("slow", speed=0.2), Robot("fast", speed=1.0)]
    plan = plan_tours(FLOOR, [Cell(0, 5, 0), Cell(0, 5, 39)], stops, robots=robots)
    slow, fast = (len(tour.stops) for tour in plan.tours)
    assert slow < fast
    assert slow + fast == 10


def test_a_stop_goes_to_the_robot_that_is_able_to_serve_it_or_is_listed():
    stops = stops_on(FLOOR, [(0, 5, 2), (0, 5, 37)])
    stops = [replace(stops[0], abilities=("lift",)), replace(stops[1], abilities=("weld",))]
    robots = [Robot("A"), Robot("B", abilities=("lift", "push"))]
    plan = plan_tours(FLOOR, [Cell(0, 5, 0), Cell(0, 5, 39)], stops, robots=robots)
    assert [[s.name for s in tour.stops] for tour in plan.tours] == [[], ["s0"]]
    assert [(lost.name, lost.reason) for lost in plan.unreached] == [("s1", "no robot has the abilities weld")]


def test_robots_that_cannot_meet_serve_what_each_can_reach():
    free = np.ones((5, 21), dtype=bool)
    free[:, 10] = False
    graph = NavGraph.from_mask(free)
    stops = stops_on(graph, [(0, 2, 3), (0, 2, 15), (0, 2, 10)])
    plan = plan_tours(graph, [Cell(0, 0, 0), Cell(0, 0, 20)], stops)
    assert [[s.name for s in tour.stops] for tour in plan.tours] == [["s0"], ["s1"]]
    assert [lost.name for lost in plan.unreached] == ["s2"]


def test_the_sample_apartment_is_cleaned_by_two_robots_without_leaving_a_spill():
    building = bn.read_ifc(bn.sample("apartment"))
    environment = bn.make_environment(building, bn.load_task("cleaning"))
    graph = bn.build_graph(environment, cell_size=0.1524)
    start = bn.find_start(graph)
    plan = plan_tours(graph, [start.cell, start.cell], start_points=[start.point] * 2)
    served = sorted(stop.global_id for tour in plan.tours for stop in tour.stops)
    assert served == sorted(target.global_id for target in environment.targets)
    assert all(bn.check_plan(tour).ok for tour in plan.tours)


def test_who_makes_haste_takes_the_fast_order_and_not_the_cheap_one():
    factor = np.ones((1, 9))
    factor[0, :3] = 5  # the way to the left is short and dear
    graph = NavGraph.from_mask(np.ones((1, 9), bool)).with_cost(factor)
    stops = [
        Stop(name, name, cell, graph.frame.center_of(cell), graph.frame.center_of(cell), service_time=0.0)
        for name, cell in (("left", Cell(0, 0, 0)), ("right", Cell(0, 0, 8)))
    ]
    plans = {how: plan_tours(graph, [Cell(0, 0, 3)], stops, objective=how) for how in ("makespan", "total")}
    assert [stop.name for stop in plans["makespan"].tours[0].stops] == ["left", "right"]
    assert [stop.name for stop in plans["total"].tours[0].stops] == ["right", "left"]
    for plan in plans.values():
        assert plan.is_optimal
    assert plans["makespan"].lower_bound == plans["makespan"].length / Robot().speed


def test_a_team_that_obeys_priorities_does_not_claim_the_optimum_without_them():
    graph = NavGraph.from_mask(np.ones((1, 9), bool))
    stops = [
        Stop(n, n, cell, graph.frame.center_of(cell), graph.frame.center_of(cell), service_time=0.0, priority=rank)
        for n, cell, rank in (("near", Cell(0, 0, 2), 0.0), ("far", Cell(0, 0, 8), 1.0))
    ]
    plan = plan_tours(graph, [Cell(0, 0, 0)], stops)
    assert [stop.name for stop in plan.tours[0].stops] == ["far", "near"]
    assert not plan.is_optimal


def test_alternatives_that_take_different_amounts_are_refused():
    matrix = [[0, 1, 5], [1, 0, 1], [5, 1, 0]]
    with pytest.raises(InputError, match="different amounts"):
        assign_stops(matrix, [0], groups=[0, 1, 1], demands=[0, 3, 1], capacities=[2])
    assert assign_stops(matrix, [0], groups=[0, 1, 1], demands=[0, 1, 1], capacities=[2]).routes == ((0, 1),)
