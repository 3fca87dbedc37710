"""Tours of robots whose battery ends, and tours with an end, a deadline or a choice of places."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bimnav import Cell, NavGraph, Robot, Stop, plan_tour
from bimnav.errors import GoalBlockedError, InputError, NoPathError
from bimnav.plan.charging import RESERVE, plan_charging
from bimnav.stops import Stand

HALL = NavGraph.from_mask(np.ones((3, 101), dtype=bool), cell_size=1.0)
START = Cell(0, 1, 0)


def stop_at(col, name=None, **asked):
    cell = Cell(0, 1, col)
    point = HALL.frame.center_of(cell)
    return Stop(f"id-{col}", name or f"s{col}", cell, point, point, **asked)


def robot_with(metres, **asked):
    """A robot whose full battery, less the reserve, lasts so many metres; it draws 3600 W at 1 m/s."""
    return Robot(speed=1.0, drive_power=3600.0, battery_wh=metres / (1 - RESERVE), charge_power=3600.0, **asked)


def test_a_battery_that_lasts_changes_nothing():
    stops = [stop_at(col) for col in (20, 50, 90)]
    tour = plan_tour(HALL, START, stops, robot=robot_with(90))
    assert [stop.name for stop in tour.stops] == ["s20", "s50", "s90"]
    assert tour.charges == ()


def test_a_robot_charges_where_the_detour_is_shortest_and_says_what_it_cost():
    stops = [stop_at(col) for col in (20, 60, 90)]
    chargers = [stop_at(58, "near", kind="charger"), stop_at(5, "far", kind="charger")]
    tour = plan_tour(HALL, START, stops, robot=robot_with(70), chargers=chargers)
    assert [stop.name for stop in tour.stops] == ["s20", "near", "s60", "s90"]
    charge = tour.charges[0]
    assert (charge.name, charge.stop) == ("near", 1)
    assert_allclose([charge.detour, charge.energy_wh, charge.seconds], [0.0, 58.0, 58.0], atol=1e-9)
    assert tour.stops[1].service_time == pytest.approx(58.0)
    assert_allclose(tour.length, 90.0)


def test_what_the_battery_does_not_reach_is_listed():
    tour = plan_tour(HALL, START, [stop_at(col) for col in (20, 60, 90)], robot=robot_with(70))
    assert [stop.name for stop in tour.stops] == ["s20", "s60"]
    assert [lost.name for lost in tour.unreached] == ["s90"]
    assert "battery" in tour.unreached[0].reason


def test_a_robot_that_returns_keeps_enough_to_come_home():
    stops, dock = [stop_at(30)], [stop_at(0, "dock", kind="charger")]
    there_and_back = plan_tour(HALL, START, stops, robot=robot_with(60), return_to_start=True)
    assert [stop.name for stop in there_and_back.stops] == ["s30"]
    too_far = plan_tour(HALL, START, stops, robot=robot_with(59), return_to_start=True, chargers=dock)
    assert (too_far.stops, too_far.charges) == ((), ())
    assert [lost.name for lost in too_far.unreached] == ["s30"]
    assert too_far.length == 0


def test_charging_is_planned_as_well_as_by_trying_all_visits():
    rng = np.random.default_rng(1)
    for _ in range(60):
        n, chargers = 4, 2
        xy = rng.random((n + 1 + chargers, 2)) * 10
        metres = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
        way, service = np.diagonal(metres, 1)[:n], rng.random(n)
        robot = Robot(speed=0.5, drive_power=100, work_power=30, charge_power=400, battery_wh=rng.uniform(0.5, 1.2))
        there, back = metres[: n + 1, n + 1 :].T, np.roll(metres[n + 1 :, : n + 1], -1, axis=1)
        best = math.inf
        for visits in itertools.product([-1, *range(chargers)], repeat=n):  # a charger before each stop, or none
            left = full = robot.battery_wh * 3600 * (1 - RESERVE)
            seconds = 0.0
            for k, charger in enumerate(visits):
                legs = [way[k]] if charger < 0 else [there[charger, k], back[charger, k]]
                for j, leg in enumerate(legs):
                    left -= leg * 200
                    seconds += leg / 0.5 if charger >= 0 else 0.0
                    if left < 0:
                        seconds = math.inf
                    if charger >= 0 and j == 0:
                        seconds += (full - left) / 400
                        left = full
                seconds -= way[k] / 0.5 if charger >= 0 else 0.0
                left -= service[k] * 30
                if left < 0:
                    seconds = math.inf
            best = min(best, seconds)
        found = plan_charging(robot, way, service, there, back)
        if best == math.inf:
            assert found.done < n
        else:
            assert found.done == n
            spent = sum(detour / 0.5 + seconds for detour, _, seconds in found.charges)
            assert_allclose(spent, best, atol=1e-9)


def test_a_tour_ends_where_it_is_told_to():
    stops = [stop_at(col) for col in (90, 20, 50)]
    tour = plan_tour(HALL, Cell(0, 1, 100), stops, end=START)
    assert [stop.name for stop in tour.stops] == ["s90", "s50", "s20"]
    assert len(tour.legs) == 4
    assert_allclose(tour.route[-1][-1], HALL.frame.center_of(START))
    assert tour.end_point == HALL.frame.center_of(START)
    with pytest.raises(InputError):
        plan_tour(HALL, Cell(0, 1, 100), stops, end=START, return_to_start=True)


def test_an_end_that_cannot_be_reached_is_refused():
    free = np.ones((3, 9), dtype=bool)
    free[:, 4] = False
    graph = NavGraph.from_mask(free)
    with pytest.raises(GoalBlockedError):
        plan_tour(graph, Cell(0, 1, 0), [], end=Cell(0, 1, 4))
    with pytest.raises(NoPathError):
        plan_tour(graph, Cell(0, 1, 0), [], end=Cell(0, 1, 8))


def test_the_place_to_serve_a_stop_from_is_the_one_that_suits_the_tour():
    west, east = Cell(0, 1, 49), Cell(0, 1, 51)
    stands = tuple(Stand(cell, HALL.frame.center_of(cell), 1.0) for cell in (west, east))
    target = HALL.frame.center_of(Cell(0, 1, 50))
    stop = Stop("id", "tank", west, target, stands[0].end, "standing", 1.0, candidates=stands)
    assert plan_tour(HALL, START, [stop]).stops[0].cell == west
    assert plan_tour(HALL, Cell(0, 1, 100), [stop]).stops[0].cell == east
    far = replace(stop, candidates=(stands[0], stands[1]._replace(distance=2.0)))
    assert plan_tour(HALL, Cell(0, 1, 100), [far]).stops[0].cell == west


def test_what_is_due_first_is_served_first_and_what_is_too_late_is_listed():
    stops = [stop_at(10), stop_at(60, due=60.0), stop_at(99, due=20.0)]
    tour = plan_tour(HALL, Cell(0, 1, 20), stops, robot=Robot(speed=1.0))
    assert [stop.name for stop in tour.stops] == ["s10", "s60"]  # there at second 60; the other way around takes 90
    assert [(lost.name, lost.reason) for lost in tour.unreached] == [
        ("s99", "it cannot be done within 20 s of the start")
    ]
    assert tour.length == pytest.approx(60.0)


def test_a_stop_of_higher_priority_is_served_first_although_it_lies_behind():
    stops = [stop_at(10), stop_at(60, priority=2.0)]
    assert [stop.name for stop in plan_tour(HALL, START, stops).stops] == ["s60", "s10"]
