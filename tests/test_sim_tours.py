"""Planned tours played: chargers, ends, lifts, teams, work, priorities and headings, against sums by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import bimnav as bn
from bimnav import Cell, NavGraph, Robot, Stop, plan_tour, plan_tours, simulate
from bimnav.links import Link
from bimnav.plan.charging import RESERVE
from bimnav.sim import TargetReported
from bimnav.testing import two_storeys

HALL = NavGraph.from_mask(np.ones((3, 101), dtype=bool), cell_size=1.0)
START = Cell(0, 1, 0)
ONE = Robot("R1", speed=1.0)


def stop_at(col, name=None, graph=HALL, storey=0, row=1, **asked):
    cell = Cell(storey, row, col)
    point = graph.frame.center_of(cell)
    return Stop(f"id-{name or col}", name or f"s{col}", cell, point, point, **asked)


def served(result):
    return sorted(row.target for row in result.log if row.event == "end_service")


def at(result, event, robot=None):
    return [row.time for row in result.log if row.event == event and robot in (None, row.robot)]


def test_a_tour_with_a_charger_takes_the_way_and_the_charging():
    robot = Robot("R1", speed=1.0, drive_power=3600.0, battery_wh=70 / (1 - RESERVE), charge_power=3600.0)
    dock = stop_at(58, "dock", kind="charger")
    tour = plan_tour(HALL, START, [stop_at(c) for c in (20, 60, 90)], robot=robot, chargers=[dock])
    result = simulate(tour, robot=robot)
    assert at(result, "arrive") == pytest.approx([20, 58, 58 + 58 + 2, 58 + 58 + 32])
    assert (at(result, "charge"), at(result, "charged")) == (pytest.approx([58]), pytest.approx([116]))
    assert result.makespan == pytest.approx(90 + tour.charges[0].seconds)
    assert served(result) == ["id-20", "id-60", "id-90"]
    assert result.log.rows[-1].battery == pytest.approx(1 - 32 / (70 / (1 - RESERVE)))


def test_a_tour_that_ends_elsewhere_goes_there_behind_its_last_stop():
    tour = plan_tour(HALL, START, [stop_at(40), stop_at(20)], end=Cell(0, 1, 70), robot=ONE)
    result = simulate(tour, robot=ONE, service_time=5.0)
    assert at(result, "arrive") == pytest.approx([20, 45, 80])
    assert result.makespan == pytest.approx(80)
    assert result.state_at(80).x == pytest.approx(HALL.frame.center_of(Cell(0, 1, 70))[0])
    back = simulate(plan_tour(HALL, START, [stop_at(40)], return_to_start=True, robot=ONE), robot=ONE)
    assert back.makespan == pytest.approx(80)


@pytest.mark.parametrize(("seconds", "length"), [(40.0, 3.0), (40.0, 13.0), (2.0, 3.0), (None, 3.0)])
def test_a_ride_takes_as_long_as_its_link_says(seconds, length):
    points = [(5.5, 0.5, 0.0), (5.5 + (length - 3) / 2, 0.5, 0.0), (5.5 + (length - 3) / 2, 0.5, 3.0), (5.5, 0.5, 3.0)]
    link = Link(Cell(0, 0, 5), Cell(1, 0, 5), length, seconds, "lift", "lift", points=points if length > 3 else [])
    graph = NavGraph.from_mask(np.ones((2, 1, 11), dtype=bool), connectors=[link])
    tour = plan_tour(graph, Cell(0, 0, 0), [stop_at(10, graph=graph, storey=1, row=0)])
    result = simulate(tour)
    speed = 0.5  # of the robot that a mask is made for
    assert result.makespan == pytest.approx(5 / speed + (length / speed if seconds is None else seconds) + 5 / speed)
    assert len(at(result, "board_lift")) == 1
    due = result.makespan + 1e-6
    kept = plan_tour(graph, Cell(0, 0, 0), [replace(tour.stops[0], due=due)])
    late = plan_tour(graph, Cell(0, 0, 0), [replace(tour.stops[0], due=due - 0.1)])
    assert (len(kept.stops), len(late.stops)) == (1, 0)


def test_a_ride_in_a_building_takes_what_the_plan_reckons_with():
    robot = Robot(radius=0.25, uses_lifts=True)
    environment = bn.make_environment(two_storeys("lift"), bn.Task("task"), robot)
    graph = bn.build_graph(environment, cell_size=0.2, connectivity=8, objective="time")
    lower, upper = (graph.frame.cell_at(1.0, 3.0, storey=storey) for storey in (0, 1))
    point = graph.frame.center_of(upper)
    tour = plan_tour(graph, lower, [Stop("up", "up", upper, point, point)])
    assert [link.kind for _, link in tour.legs[0].rides] == ["lift"]
    assert simulate(tour).makespan == pytest.approx(tour.cost)


def test_the_plan_of_a_team_is_played_as_it_is():
    robots = [Robot("slow", speed=0.5), Robot("fast", speed=2.0)]
    stops = [stop_at(10, service_time=3.0), stop_at(90, service_time=7.0), stop_at(50)]
    plan = plan_tours(HALL, [START, Cell(0, 1, 100)], stops, robots=robots)
    result = simulate(plan)
    assert [[s.name for s in tour.stops] for tour in plan.tours] == [["s10"], ["s90", "s50"]]
    assert result.makespan == pytest.approx(plan.lower_bound) == pytest.approx(10 / 2 + 7 + 40 / 2)
    assert at(result, "end_service", "slow") == pytest.approx([10 / 0.5 + 3])
    assert served(result) == ["id-10", "id-50", "id-90"]


def test_work_takes_as_long_as_stops_say_and_what_matters_more_comes_first():
    stops = [stop_at(10, service_time=2.0), stop_at(60, priority=2.0, service_time=4.0), stop_at(30)]
    result = simulate(plan_tour(HALL, START, stops, robot=ONE), robot=ONE)
    served = [(row.target_name, row.time) for row in result.log if row.event == "end_service"]
    assert served == [("s60", 64.0), ("s30", 94.0), ("s10", 116.0)]


@pytest.mark.parametrize(
    ("priority", "order"),
    [
        (3.0, ["s60", "new", "s90", "s99"]),
        (1.5, ["s60", "s90", "new", "s99"]),
        (1.0, ["s60", "s90", "s99", "new"]),
    ],
)
def test_what_is_reported_meanwhile_takes_its_turn(priority, order):
    stops = [stop_at(60, priority=2.0), stop_at(90, priority=2.0), stop_at(99)]
    report = TargetReported(5.0, "new", 40.5, 1.5, priority=priority)
    result = simulate(plan_tour(HALL, START, stops, robot=ONE), robot=ONE, events=[report])
    assert [row.target_name for row in result.log if row.event == "end_service"] == order


@pytest.mark.parametrize("history", [True, False])
def test_a_robot_that_turns_slowly_faces_its_work_before_it_begins(history):
    robot = Robot("R1", speed=1.0, turn_rate=math.pi / 8)
    stops = [stop_at(10, heading=math.pi / 2, service_time=1.0), stop_at(20, heading=0.0)]
    result = simulate(plan_tour(HALL, START, stops, robot=robot), robot=robot, history=history)
    # 10 m, a quarter turn of 4 s, 1 s of work, a quarter turn back, 10 m
    assert result.makespan == pytest.approx(10 + 4 + 1 + 4 + 10)
    if history:
        assert at(result, "begin_service") == pytest.approx([14, 29])
        assert result.state_at(12).heading == pytest.approx(math.pi / 4)
        assert result.state_at(14.5).heading == pytest.approx(math.pi / 2)


def test_a_robot_that_turns_at_once_faces_every_stop_as_it_asks():
    stops = [stop_at(10, heading=math.pi / 2, service_time=1.0), stop_at(20, heading=math.pi / 4, service_time=1.0)]
    result = simulate(plan_tour(HALL, START, stops, robot=ONE), robot=ONE)
    assert result.makespan == pytest.approx(22)
    assert result.state_at(10.5).heading == pytest.approx(math.pi / 2)
    assert result.state_at(15).heading == pytest.approx(0.0)
    assert result.state_at(21.5).heading == pytest.approx(math.pi / 4)


def test_the_log_holds_the_card_of_what_a_robot_arrives_at():
    building = bn.read_ifc(bn.sample("office"))
    environment = bn.make_environment(building, bn.load_task("inspection_mep"), Robot(radius=0.2))
    graph = bn.build_graph(environment, cell_size=0.2)
    tour = plan_tour(graph, bn.find_start(graph).cell)
    result = simulate(tour)
    arrivals = [row for row in result.log if row.event == "arrive" and row.target]
    assert arrivals
    assert [row.asset for row in arrivals] == [building.asset(row.target).summary for row in arrivals]
    assert any(row.asset for row in arrivals)
