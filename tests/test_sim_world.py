"""Doors, passages, lifts, chargers and people, in worlds that can be worked out by hand."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely

from bimnav.errors import InputError, ModelError, SimulationError, ValueRangeError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan import plan_tour
from bimnav.robot import Robot
from bimnav.sim import (
    Chance,
    Charger,
    DoorLocks,
    Lift,
    Passage,
    Person,
    RobotStatus,
    SimDoor,
    SimResult,
    SpeedLimit,
    find_passages,
    simulate,
)
from bimnav.stops import Stop
from bimnav.testing import grid_from_text
from tests.test_sim import HandMadeTour, stop_at, tour_along

HALL = NavGraph.from_mask(np.ones((10, 40), dtype=bool))  # 40 m by 10 m


def stop_in(graph: NavGraph, cell: Cell, name: str) -> Stop:
    point = graph.frame.center_of(cell)
    return Stop(name, name, cell, point, point)


def tour_in(graph: NavGraph, start: Cell, *goals: Cell, prefix: str = "s", **more):
    stops = [stop_in(graph, goal, f"{prefix}{k}") for k, goal in enumerate(goals)]
    return plan_tour(graph, start, stops, **more)


def rows(result: SimResult, *events: str, robot: str | None = None):
    return [row for row in result.log if row.event in events and (robot is None or row.robot == robot)]


def at(result: SimResult, *events: str) -> list[float]:
    return [row.time for row in rows(result, *events)]


STRAIGHT = tour_along([(0, 0, 0), (10, 0, 0)])
DOOR = SimDoor("door", "closed", 3.0, polygon=shapely.box(4, -1, 5, 1))
ONE = Robot("R1", speed=1.0)


# --- doors


def test_a_robot_waits_in_front_of_a_closed_door_while_it_opens():
    result = simulate(STRAIGHT, robot=ONE, doors=[DOOR])
    assert result.makespan == 13.0
    (opened,) = rows(result, "open_door")
    assert (opened.time, opened.x, opened.status, opened.cause) == (
        4.0,
        4.0,
        RobotStatus.WAITING,
        "door door is closed",
    )
    assert at(result, "resume") == [7.0]
    assert result.metrics["waiting"] == 3.0
    assert result.state_at(5.0).x == 4.0


@pytest.mark.parametrize(
    ("state", "robot", "makespan"),
    [
        ("open", ONE, 10.0),
        ("automatic", Robot("R1", speed=1.0, opens_doors=False), 13.0),
        ("locked", Robot("R1", speed=1.0, keys=["door"]), 13.0),
    ],
)
def test_doors_open_for_those_who_may(state, robot, makespan):
    door = SimDoor("door", state, 3.0, polygon=DOOR.polygon)
    assert simulate(STRAIGHT, robot=robot, doors=[door]).makespan == makespan


@pytest.mark.parametrize("robot", [ONE, Robot("R1", speed=1.0, keys=["another"])])
def test_before_a_locked_door_a_robot_without_its_key_gives_up_and_says_why(robot):
    graph = NavGraph.from_mask(np.ones((1, 10), dtype=bool))
    tour = tour_in(graph, Cell(0, 0, 0), Cell(0, 0, 9))
    door = SimDoor("door", "locked", 3.0, name="Front door", polygon=shapely.box(4, -1, 5, 2))
    result = simulate(tour, robot=robot, doors=[door], patience=60.0)
    (given_up,) = rows(result, "give_up")
    assert (given_up.time, given_up.target) == (60.0, "s0")
    assert given_up.cause == "door Front door closes the way for 60 s"
    assert result.given_up == ("s0",)
    assert result.metrics["coverage"] == 0.0
    assert result.metrics["blocked"] == 60.0


def test_two_robots_pass_a_door_one_after_the_other():
    tours = [STRAIGHT, tour_along([(0, 0.5, 0), (10, 0.5, 0)], stops=(stop_at((10, 0.5, 0), "other"),))]
    result = simulate(tours, robot=ONE, doors=[DOOR])
    assert [robot.name for robot in result.robots] == ["R1-1", "R1-2"]
    # the first waits 3 s and is through the metre of the doorway at 8 s; then the second opens it
    assert at(result, "open_door") == [4.0, 8.0]
    assert result.makespan == 17.0
    (waiting,) = rows(result, "wait")
    assert (waiting.robot, waiting.cause) == ("R1-2", "door door is in use")


def test_a_door_of_the_model_has_its_doorway():
    from bimnav.environment import make_environment
    from bimnav.graph import build_graph
    from bimnav.tasks import Task
    from bimnav.testing import two_rooms

    robot = Robot("R1", speed=1.0, radius=0.2)
    environment = make_environment(two_rooms(), Task("test"), robot)
    graph = build_graph(environment, cell_size=0.1)
    begin, goal = graph.frame.cell_at(1, 2), graph.frame.cell_at(7, 2)
    tour = tour_in(graph, begin, goal)
    result = simulate(tour, doors=[SimDoor("door", "closed", 5.0)])
    (opened,) = rows(result, "open_door")
    assert (opened.x, opened.cause) == (pytest.approx(3.8, abs=1e-6), "door Door is closed")
    assert result.makespan == pytest.approx(tour.length + 5.0)
    with pytest.raises(ModelError, match="door nowhere has no place"):
        simulate(tour, doors=[SimDoor("nowhere")])


@pytest.mark.parametrize("bad", [{"state": "ajar"}, {"opening_time": -1.0}, {"opening_time": math.inf}])
def test_a_door_that_is_none_is_refused(bad):
    with pytest.raises(ValueRangeError, match="door d"):
        SimDoor("d", **bad)


# --- passages

NARROW = Passage("corridor", shapely.box(3, -2, 7, 2))


def test_nobody_enters_a_narrow_passage_while_another_is_in_it():
    there = tour_along([(0, 0, 0), (10, 0, 0)], stops=(stop_at((10, 0, 0), "east"),))
    back = tour_along([(10, 0, 0), (0, 0, 0)], stops=(stop_at((0, 0, 0), "west"),))
    result = simulate([there, back], robots=[Robot("A", speed=1.0), Robot("B", speed=1.0)], passages=[NARROW])
    assert [(row.robot, row.time, row.x) for row in rows(result, "wait")] == [("B", 3.0, 7.0)]
    assert result.makespan == 14.0
    inside = [[state.robot for state in result.states_at(time) if 3 < state.x < 7] for time in np.arange(0.05, 14, 0.1)]
    assert max(map(len, inside)) == 1


SMOOTH = Robot("A", speed=1.0, acceleration=0.5)


@pytest.mark.parametrize("more", [{"passages": [NARROW]}, {"doors": [SimDoor("d", "open", 3.0, polygon=DOOR.polygon)]}])
def test_a_robot_drives_through_what_is_free_without_slowing_down(more):
    free, shared = simulate(STRAIGHT, robot=SMOOTH), simulate(STRAIGHT, robot=SMOOTH, **more)
    assert shared.makespan == free.makespan == 12.0  # 2 s and 1 m each to start and to stop
    assert shared.log.rows == free.log.rows
    moments = np.linspace(0, 12, 50)
    np.testing.assert_allclose(shared.track.points_at(moments), free.track.points_at(moments), atol=1e-9)


def test_a_robot_that_finds_a_passage_in_use_stops_in_front_of_it_and_another_enters_as_soon_as_it_is_left():
    there = tour_along([(0, 0, 0), (10, 0, 0)], stops=(stop_at((10, 0, 0), "east"),))
    back = tour_along([(10, 0, 0), (0, 0, 0)], stops=(stop_at((0, 0, 0), "west"),))
    result = simulate(
        [there, back],
        robots=[SMOOTH, Robot("B", speed=1.0, acceleration=0.5)],
        passages=[NARROW],
        start_time=[0.0, 1.0],
    )
    (wait,) = rows(result, "wait")
    # A is at 3 m after 4 s; B would begin to brake at 8 m, a metre before the passage, after 1 + 3 s
    assert (wait.robot, wait.time, wait.x) == ("B", pytest.approx(5.0 + 1.0, abs=1e-5), pytest.approx(7.0, abs=1e-5))
    (go,) = rows(result, "resume")
    assert go.time == pytest.approx(8.0, abs=1e-5)  # A has left at 7 m
    assert result.makespan == pytest.approx(8.0 + 7 + 2, abs=1e-5)


@pytest.mark.parametrize("seed", range(12))
def test_two_robots_that_start_and_brake_slowly_are_never_in_one_passage(seed):
    rng = np.random.default_rng(seed)
    parts = [Passage("w", shapely.box(8, -1, 14, 11)), Passage("m", shapely.box(14, -1, 17, 11)),
             Passage("e", shapely.box(25, -1, 26, 11))]  # fmt: skip
    goals = [[Cell(0, int(r), int(c)) for r, c in rng.integers((10, 40), size=(5, 2))] for _ in range(3)]
    tours = [tour_in(HALL, goals[k][0], *goals[k][1:], prefix=f"{k}-") for k in range(3)]
    fleet = [
        Robot(f"R{k}", speed=float(rng.uniform(0.5, 2)), acceleration=float(rng.uniform(0.2, 1)), turn_rate=1.0)
        for k in range(3)
    ]
    result = simulate(tours, robots=fleet, passages=parts, people=[Person("p")] * (seed % 2), service_time=2.0)
    moments = np.arange(result.span[0], result.span[1], 0.05)
    places = [shapely.points(track.points_at(moments)[:, :2]) for track in result.tracks]
    for part in parts:
        inside = sum(shapely.contains(part.polygon.buffer(-1e-5), place).astype(int) for place in places)
        started_inside = [part.polygon.contains(shapely.Point(tour.start_point)) for tour in tours]
        if not any(started_inside):
            assert inside.max() <= 1
    for track, robot in zip(result.tracks, fleet, strict=True):
        speeds = np.linalg.norm(np.diff(track.points_at(moments), axis=0), axis=1) / 0.05
        assert speeds.max() <= robot.speed + 1e-6
        assert np.abs(np.diff(speeds)).max() <= robot.acceleration * 0.05 * 2 + 1e-6


def test_a_robot_that_works_in_a_passage_keeps_it():
    works = tour_along([(0, 0, 0), (5, 0, 0)], [(5, 0, 0), (10, 0, 0)])
    other = tour_along([(10, 1, 0), (0, 1, 0)], stops=(stop_at((0, 1, 0), "west"),))
    result = simulate(
        [works, other],
        robots=[Robot("A", speed=1.0), Robot("B", speed=1.0)],
        passages=[NARROW],
        service_time=lambda robot, stop, rng: 20.0 if stop.global_id == "s0" else 0.0,
    )
    assert [row.time for row in rows(result, "resume", robot="B")] == [27.0]


def test_of_two_passages_that_overlap_a_robot_holds_none_while_it_waits_for_the_other():
    both = [Passage("west", shapely.box(2, -2, 5, 2)), Passage("east", shapely.box(5, -2, 8, 2))]
    there = tour_along([(0, 0, 0), (10, 0, 0)], stops=(stop_at((10, 0, 0), "east"),))
    back = tour_along([(10, 0, 0), (0, 0, 0)], stops=(stop_at((0, 0, 0), "west"),))
    result = simulate([there, back], robots=[Robot("A", speed=1.0), Robot("B", speed=1.0)], passages=both)
    assert result.metrics["served"] == 2
    assert result.makespan == 2 + 6 + 8


def test_who_waits_too_long_for_a_passage_gives_up_and_says_so():
    stays = tour_along([(2, 0, 0), (5, 0, 0)], stops=(stop_at((5, 0, 0), "in the way"),))
    graph = NavGraph.from_mask(np.ones((1, 10), dtype=bool))
    other = tour_in(graph, Cell(0, 0, 9), Cell(0, 0, 0))
    robots = [Robot("A", speed=1.0), Robot("B", speed=1.0)]
    result = simulate([stays, other], robots=robots, passages=[NARROW], patience=30.0)
    (given_up,) = rows(result, "give_up")
    assert (given_up.robot, given_up.time) == ("B", 9.5 - 7 + 30.0)
    assert given_up.cause == "corridor, in use closes the way for 30 s"


def test_narrow_passages_are_found_where_two_robots_do_not_fit():
    free = grid_from_text("""
        ........######........
        ........######........
        ......................
        ........######........
        ........######........
    """)
    graph = NavGraph.from_mask(free, cell_size=0.5)
    (passage,) = find_passages(graph, 0.4)
    assert passage.storey == 0
    assert passage.polygon.contains(shapely.box(4, 1, 7, 1.5))
    assert not passage.polygon.intersects(shapely.box(0, 0, 3, 2.5))
    assert find_passages(graph, 0.0) == ()
    wide = NavGraph.from_mask(np.ones((10, 10), dtype=bool), cell_size=0.5)
    assert find_passages(wide, 0.4) == ()


def test_a_passage_for_nobody_is_refused():
    with pytest.raises(ValueRangeError, match="takes 0 robots"):
        Passage("p", shapely.box(0, 0, 1, 1), capacity=0)


# --- lifts

UP = [(0, 0, 0), (2, 0, 0), (2, 0, 3), (4, 0, 3)]


def going_up(name: str, delay_y: float = 0.0) -> HandMadeTour:
    points = [(x, y + delay_y, z) for x, y, z in UP]
    return tour_along(points, stops=(stop_at(points[-1], name, storey=1),))


def test_a_lift_opens_travels_and_opens():
    # NIST TN 1822, Verif.2.7: kinematics and capacity; 2 s there, 4 s doors, 5 s up, 4 s doors, 2 s away
    result = simulate(going_up("s0"), robot=ONE, lifts=[Lift("lift", 2.0, 0.0)])
    assert result.makespan == 2 + 4 + 5 + 4 + 2
    assert [(row.event, row.time, row.storey) for row in rows(result, "call_lift", "board_lift", "leave_lift")] == [
        ("call_lift", 2.0, "0"),
        ("board_lift", 2.0, "0"),
        ("leave_lift", 15.0, "1"),
    ]
    assert result.distance == 4.0
    assert result.state_at(15.0).z == 3.0


def test_a_lift_that_is_elsewhere_comes_first():
    result = simulate(going_up("s0"), robot=ONE, lifts=[Lift("lift", 2.0, 0.0, storey=1)])
    assert at(result, "board_lift") == [7.0]


@pytest.mark.parametrize(("capacity", "left"), [(1, [15.0, 33.0]), (2, [15.0, 15.0])])
def test_no_more_robots_ride_than_fit(capacity, left):
    lifts = [Lift("lift", 2.0, 0.0, capacity=capacity)]
    result = simulate([going_up("s0"), going_up("s1", 0.1)], robot=ONE, lifts=lifts)
    assert at(result, "leave_lift") == left
    # the second waits for 4 + 5 + 4 s up, 5 s down, and then rides as long


def test_a_robot_without_a_lift_drives_what_rises():
    assert simulate(going_up("s0"), robot=ONE).makespan == 7.0
    stairs = Robot("R1", speed=1.0, uses_lifts=False)
    assert simulate(going_up("s0"), robot=stairs, lifts=[Lift("lift", 2.0, 0.0)]).makespan == 7.0


def test_a_lift_for_nobody_is_refused():
    with pytest.raises(ValueRangeError, match="capacity 0"):
        Lift("l", 0, 0, capacity=0)


def test_a_robot_waits_in_front_of_the_shaft_until_the_cabin_has_come():
    result = simulate(going_up("s0"), robot=ONE, lifts=[Lift("lift", 2.0, 0.0, storey=1, depth=0.5)])
    assert [(row.time, row.x) for row in rows(result, "call_lift", "board_lift")] == [(1.5, 1.5), (6.5, 1.5)]
    (left,) = rows(result, "leave_lift")
    assert (left.time, left.x) == (6.5 + 4.5 + 5 + 4.5, 2.5)  # half a second to get in and to get out
    assert result.distance == 4.0


# --- energy

CORRIDOR = NavGraph.from_mask(np.ones((1, 101), dtype=bool))  # cells from 0 to 100 m
DOCK = Charger("dock", Cell(0, 0, 0), CORRIDOR.frame.center_of(Cell(0, 0, 0)))
THIRSTY = Robot("R1", speed=1.0, battery_wh=200 / 3600, drive_power=1.0, work_power=2.0, charge_power=10.0)  # 200 J


def test_energy_is_power_by_time():
    tour = tour_in(CORRIDOR, Cell(0, 0, 0), Cell(0, 0, 20))
    result = simulate(tour, robot=THIRSTY, service_time=30.0, chargers=[])
    assert result.energy == 20 * 1.0 + 30 * 2.0
    assert result.tallies[0].level == pytest.approx(200 - 80)
    assert [row.battery for row in rows(result, "arrive", "end_service")] == pytest.approx([0.9, 0.6])
    assert result.log.to_csv().splitlines()[0].endswith(",battery")


def test_a_robot_charges_before_what_it_could_not_do_and_get_back_from():
    tour = tour_in(CORRIDOR, Cell(0, 0, 0), Cell(0, 0, 40), Cell(0, 0, 45), prefix="t")
    result = simulate(tour, robot=THIRSTY, service_time=25.0, chargers=[DOCK])
    # after 40 m and 25 s of work 110 J are left; 5 m, 25 s and the way back from 45 m take 5 + 50 + 45 * 1.25 J and 5 %
    (charge,) = rows(result, "charge")
    assert charge.time == 40 + 25 + 40
    assert charge.cause == "charger dock; 35% are left, 40.00 m to get there"
    (charged,) = rows(result, "charged")
    assert charged.time == pytest.approx(105 + (200 - 110 + 40) / 10)
    assert charged.battery == pytest.approx(1.0)
    assert result.metrics["charge_distance"] == 40.0
    assert result.metrics["charging"] == pytest.approx(13.0)
    assert result.metrics["served"] == 2


def test_battery_is_conserved():
    goals = [Cell(0, 0, col) for col in (60, 10, 50, 20)]
    result = simulate(tour_in(CORRIDOR, Cell(0, 0, 0), *goals), robot=THIRSTY, service_time=25.0, chargers=[DOCK])
    (tally,) = result.tallies
    assert tally.charged > 0
    assert 200 + tally.charged - tally.used == pytest.approx(tally.level)
    assert all(0 <= row.battery <= 1 for row in result.log)


def test_what_takes_more_than_a_battery_is_left_with_the_reason():
    tour = tour_in(CORRIDOR, Cell(0, 0, 0), Cell(0, 0, 100), Cell(0, 0, 10))
    result = simulate(tour, robot=THIRSTY, chargers=[DOCK])
    (given_up,) = rows(result, "give_up")
    assert (given_up.target, given_up.cause) == ("s0", "it takes 112% of a full battery")
    assert result.served == ("s1",)


def test_without_a_charger_a_robot_says_what_it_cannot_do_any_more():
    tour = tour_in(CORRIDOR, Cell(0, 0, 0), Cell(0, 0, 100), Cell(0, 0, 0))
    result = simulate(tour, robot=THIRSTY, service_time=40.0, chargers=[])
    assert rows(result, "give_up")[0].cause.endswith("no charger")
    assert result.metrics["failed"] == 0.0


def test_an_empty_battery_stops_a_robot_where_it_is():
    # an idle robot draws 10 W while it waits for a door, more than anybody reckoned with
    robot = Robot("R1", speed=1.0, battery_wh=200 / 3600, drive_power=1.0, idle_power=10.0)
    result = simulate(STRAIGHT, robot=robot, doors=[SimDoor("door", "closed", 60.0, polygon=DOOR.polygon)])
    (failed,) = rows(result, "fail")
    assert (failed.x, failed.cause, failed.battery) == (4.0, "the battery is empty", pytest.approx(0.0, abs=1e-9))
    assert failed.time == pytest.approx(4 + 196 / 10)
    assert result.given_up == ("s0",)


def test_a_robot_that_waits_too_long_for_a_charger_runs_down_where_it_is():
    slow = Robot("A", speed=1.0, battery_wh=200 / 3600, drive_power=1.0, charge_power=0.01)
    idle = Robot("B", speed=1.0, battery_wh=200 / 3600, drive_power=1.0, idle_power=0.5, charge_power=10.0)
    tours = [tour_in(CORRIDOR, Cell(0, 0, 0), *[Cell(0, 0, c) for c in (60, 20, 90)], prefix=p) for p in "ab"]
    result = simulate(tours, robots=[slow, idle], chargers=[DOCK], until=4000.0)
    (failed,) = rows(result, "fail")
    assert (failed.robot, failed.cause) == ("B", "the battery is empty")
    for tally in result.tallies:
        assert tally.level >= 0
        assert 200 + tally.charged - tally.used == pytest.approx(tally.level, abs=1e-6)


def test_two_robots_charge_one_after_the_other():
    tours = [tour_in(CORRIDOR, Cell(0, 0, 0), *[Cell(0, 0, c) for c in (40, 45)], prefix=p) for p in "ab"]
    result = simulate(tours, robot=THIRSTY, service_time=25.0, chargers=[DOCK])
    begin, end = at(result, "charge"), at(result, "charged")
    assert begin[1] >= end[0]
    assert "charger dock is in use" in [row.cause for row in result.log]


# --- people


def test_a_robot_stands_still_for_somebody_who_crosses_its_way():
    tour = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 30))
    walks = Person("Ada", ((15.5, 0.0), (15.5, 10.0)), speed=0.5, start=5.0)
    result = simulate(tour, robot=ONE, people=[walks])
    (wait,) = rows(result, "wait")
    assert wait.cause == "Ada crosses the way"
    assert result.clearance["people"] >= 0.3 - 1e-6
    assert result.metrics["waiting"] > 0
    assert result.served == ("s0",)
    assert simulate(tour, robot=ONE).makespan + result.metrics["waiting"] == pytest.approx(result.makespan)


def test_who_walks_elsewhere_or_another_time_stops_nobody():
    tour = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 30))
    others = [
        Person("behind", ((0.0, 2.0), (30.0, 2.0))),
        Person("late", ((15.5, 0.0), (15.5, 10.0)), start=60.0),
        Person("early", ((15.5, 0.0), (15.5, 10.0)), speed=2.0, start=-20.0),
    ]
    result = simulate(tour, robot=ONE, people=others)
    assert rows(result, "wait") == []
    assert set(result.people_at(5.0)) == {"behind"}


def test_a_robot_with_brakes_keeps_its_distance_too():
    slow = Robot("R1", speed=1.0, radius=0.3, acceleration=0.25)
    tour = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 30))
    walks = Person("Ada", ((20.5, 0.0), (20.5, 10.0)), speed=0.5, start=11.0)
    result = simulate(tour, robot=slow, people=[walks])
    assert rows(result, "wait")
    assert result.clearance["people"] >= 0.3 - 0.02


def test_a_cart_in_a_corridor_for_ever_makes_a_robot_give_up():
    tour = tour_in(CORRIDOR, Cell(0, 0, 0), Cell(0, 0, 30))
    cart = Person("cart", ((20.0, 0.5), (20.1, 0.5)), speed=0.01, back_and_forth=True)
    result = simulate(tour, robot=ONE, people=[cart], patience=20.0)
    (given_up,) = rows(result, "give_up")
    assert given_up.cause == "cart closes the way for 20 s"


def test_around_a_cart_in_a_hall_a_robot_finds_another_way():
    tour = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 30))
    cart = Person("cart", ((20.0, 5.5), (20.1, 5.5)), speed=0.01, back_and_forth=True)
    result = simulate(tour, robot=ONE, people=[cart], patience=20.0)
    (replan,) = rows(result, "replan")
    assert replan.cause.startswith("cart is in the way; the other way is +")
    assert result.served == ("s0",)
    assert result.clearance["people"] > 0


def test_random_walks_are_drawn_from_the_seed_and_stay_on_free_cells():
    free = np.ones((12, 12), dtype=bool)
    free[3:9, 5] = False
    graph = NavGraph.from_mask(free)
    tour = tour_in(graph, Cell(0, 0, 0), Cell(0, 11, 11))
    people = [Person("a"), Person("b", speed=0.7)]
    runs = [simulate(tour, people=people, rng=np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert runs[0].log.to_csv() == runs[1].log.to_csv()
    places = [run.people_at(20.0) for run in runs]
    assert places[0] == places[1] != places[2]
    for time in np.arange(0.0, 60.0, 0.7):
        for x, y, storey in runs[0].people_at(float(time)).values():
            assert graph.free[graph.frame.cell_at(x, y, storey=storey)]


@pytest.mark.parametrize("bad", [{"speed": 0.0}, {"radius": -1.0}, {"start": math.nan}])
def test_a_person_who_cannot_walk_is_refused(bad):
    with pytest.raises(ValueRangeError, match=r"walks at|start of Person"):
        Person("p", **bad)


# --- fleets


def test_several_robots_start_at_their_own_delays():
    # RiMEA 3.0, test 5: each of ten starts at its own delay
    delays = tuple(np.random.default_rng(3).uniform(10, 100, 10).tolist())
    tours = [tour_along([(0, y, 0), (5, y, 0)], stops=(stop_at((5, y, 0), f"s{y}"),)) for y in range(10)]
    result = simulate(tours, robot=ONE, start_time=delays)
    starts = {row.robot: row.time for row in rows(result, "start")}
    assert list(starts.values()) == sorted(delays)
    assert [starts[f"R1-{k + 1}"] for k in range(10)] == pytest.approx(delays)
    assert result.metrics["moving"] == pytest.approx(50.0)


def test_robots_turn_a_corner_and_nobody_enters_the_block_inside_it():
    # RiMEA 3.0, test 6: twenty agents around the corner of a corridor two metres wide
    free = np.zeros((24, 24), dtype=bool)
    free[:4, :] = free[:, -4:] = True
    graph = NavGraph.from_mask(free, cell_size=0.5)
    tours = [
        tour_in(graph, Cell(0, k % 4, k // 4), Cell(0, 23 - k // 4, 23 - k % 4), prefix=f"r{k}") for k in range(20)
    ]
    result = simulate(tours, robot=ONE)
    assert result.metrics["served"] == 20
    table = result.trajectories(0.25)
    assert set(table["id"]) == {f"R1-{k + 1}" for k in range(20)}
    assert not ((table["x"] < 10 - 1e-9) & (table["y"] > 2 + 1e-9)).any()


def test_bodies_that_share_floor_are_listed():
    tours = [
        tour_along([(0, 0, 0), (10, 0, 0)], stops=(stop_at((10, 0, 0), "a"),)),
        tour_along([(10, 0.5, 0), (0, 0.5, 0)], stops=(stop_at((0, 0.5, 0), "b"),)),
    ]
    fat = [Robot(name, speed=1.0, radius=0.3) for name in "AB"]
    result = simulate(tours, robots=fat)
    (meeting,) = result.encounters
    half = math.sqrt(0.6**2 - 0.5**2) / 2
    assert (meeting.robots, meeting.clearance) == (("A", "B"), pytest.approx(-0.1))
    assert (meeting.time, meeting.end) == (pytest.approx(5 - half), pytest.approx(5 + half))
    assert result.clearance["robots"] == pytest.approx(-0.1)
    assert result.metrics["clearance"] == pytest.approx(-0.1)
    thin = [Robot(name, speed=1.0, radius=0.2) for name in "AB"]
    assert simulate(tours, robots=thin).encounters == ()
    assert simulate(tours, robots=thin).clearance["robots"] == pytest.approx(0.1)


def test_every_robot_has_a_state_a_track_and_a_name_of_its_own():
    tours = [STRAIGHT, tour_along([(0, 5, 0), (3, 5, 0)], stops=(stop_at((3, 5, 0), "b"),))]
    result = simulate(tours, robots=[Robot("A", speed=1.0), Robot("B", speed=1.0)])
    assert result.state_at(2.0, "B").x == 2.0
    assert [state.robot for state in result.states_at(5.0)] == ["A", "B"]
    assert result.distance == 13.0
    table = result.trajectories()
    assert table.dtype.names == ("id", "t", "x", "y", "z", "heading", "state")
    with pytest.raises(InputError, match="there are several robots"):
        result.state_at(1.0)
    with pytest.raises(InputError, match="no robot is called 'C'"):
        result.track_of("C")
    with pytest.raises(InputError, match="each with a name of its own"):
        simulate(tours, robots=[Robot("A"), Robot("A")])


def test_work_ends_when_time_is_up_and_what_is_left_is_listed():
    tour = tour_along([(0, 0, 0), (10, 0, 0)], [(10, 0, 0), (20, 0, 0)])
    result = simulate(tour, robot=ONE, until=15.0, service_time=2.0)
    assert result.served == ("s0",)
    (left,) = rows(result, "give_up")
    assert (left.target, left.time, left.cause, left.x) == ("s1", 15.0, "time is up", 13.0)
    assert result.log.rows[-1].event == "end"


def test_without_history_the_sums_are_the_same():
    seen = []
    kept = simulate(STRAIGHT, robot=ONE, service_time=5.0)
    bare = simulate(STRAIGHT, robot=ONE, service_time=5.0, history=False, on_event=seen.append)
    assert bare.metrics == {name: value for name, value in kept.metrics.items() if name != "clearance"}
    assert tuple(seen) == kept.log.rows
    assert len(bare.log) == 0
    with pytest.raises(InputError, match="no history was kept"):
        bare.state_at(1.0)


# --- chance


def test_speed_and_service_are_drawn_with_their_units():
    tour = tour_along([(0, 0, 0), (10, 0, 0)])
    result = simulate(tour, speed=Chance("uniform", (1.8, 3.6), "km/h"), service_time=Chance("uniform", (1, 2), "min"))
    assert 10 <= result.metrics["moving"] <= 20
    assert 60 <= result.metrics["working"] <= 120


@pytest.mark.parametrize(
    ("chance", "mean", "spread"),
    [
        (Chance("normal", (30, 5), "s"), 30, 5),
        (Chance("lognormal", (0.5, 0.1), "min"), 30, 6),
        (Chance("triangular", (10, 20, 60), "s"), 30, math.sqrt(116.67)),
        (Chance("exponential", (30,), "s"), 30, 30),
        (Chance("uniform", (0, 60), "s"), 30, 60 / math.sqrt(12)),
    ],
)
def test_what_is_drawn_has_the_mean_and_the_spread_that_were_asked_for(chance, mean, spread):
    rng = np.random.default_rng(0)
    drawn = [chance.draw(rng) for _ in range(4000)]
    assert np.mean(drawn) == pytest.approx(mean, rel=0.05)
    assert np.std(drawn) == pytest.approx(spread, rel=0.1)
    assert min(drawn) >= 0


@pytest.mark.parametrize(
    "bad", [("uniform", (2, 1), "s"), ("normal", (1,), "s"), ("normal", (1, 1), "kg"), ("normal", (math.nan, 1), "s")]
)
def test_a_distribution_that_is_none_is_refused(bad):
    with pytest.raises(ValueRangeError):
        Chance(*bad)


@pytest.mark.parametrize("bad", [0.0, math.nan, -1.0, lambda robot, rng: math.inf])
def test_a_speed_that_is_none_is_refused(bad):
    with pytest.raises(SimulationError, match="the speed of robot 'R1'"):
        simulate(STRAIGHT, robot=ONE, speed=bad)


def test_the_time_of_every_robot_is_spent_once():
    goals = [Cell(0, row, col) for row, col in ((1, 5), (8, 30), (4, 12), (2, 38))]
    tours = [tour_in(HALL, Cell(0, k, 0), *goals, prefix=f"r{k}") for k in range(3)]
    walks = [Person("a"), Person("b")]
    result = simulate(tours, robot=ONE, people=walks, service_time=3.0, passages=[NARROW])
    for tally, track in zip(result.tallies, result.tracks, strict=True):
        spent = sum(tally.seconds.values())
        assert spent == pytest.approx(float(track.times[-1] - track.times[0]), abs=1e-6)
        for status in RobotStatus:
            assert tally.seconds[status] == pytest.approx(track.seconds_in(status), abs=1e-6)
        for a, b in pairwise(np.linspace(track.times[0], track.times[-1], 400)):
            moved = math.dist(track.points_at(a).tolist(), track.points_at(b).tolist())
            assert moved <= 1.0 * (b - a) + 1e-9


# --- nobody stands for ever


@pytest.mark.parametrize("seed", [1, 4, 8, 9])
def test_a_slow_robot_among_people_looks_again_later_and_not_at_the_same_instant(seed):
    moments: list[tuple[float, str]] = []

    def listen(row):
        moments.append((row.time, row.event))
        assert moments.count(moments[-1]) < 5, "time stands still"

    result = simulate(
        tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 30), Cell(0, 8, 3), Cell(0, 1, 20)),
        robot=Robot("R1", speed=1.5, acceleration=0.5),
        people=[Person(name) for name in "abc"],
        speed_limits=[SpeedLimit(shapely.box(-1, 0, 41, 10), 0.3)],
        rng=np.random.default_rng(seed),
        on_event=listen,
    )
    assert len(result.served) == 3


@pytest.mark.parametrize("deep", [0.1, 1.0])
def test_who_waits_in_vain_for_floor_that_is_thinner_than_a_cell_gives_up(deep):
    stays = tour_in(CORRIDOR, Cell(0, 0, 0), Cell(0, 0, 20), prefix="a")
    comes = tour_in(CORRIDOR, Cell(0, 0, 5), Cell(0, 0, 30), prefix="b")
    part = Passage("sill", shapely.box(20.5 - deep / 2, -1, 20.5 + deep / 2, 2))
    fleet = [Robot("A", speed=10.0, radius=0.3), Robot("B", speed=1.0, radius=0.3)]
    result = simulate([stays, comes], robots=fleet, passages=[part], patience=20.0, until=1000.0)
    (given_up,) = rows(result, "give_up", robot="B")
    assert given_up.cause == "sill, in use closes the way for 20 s"
    assert given_up.time < 60


def test_who_stands_beside_floor_in_use_and_wants_to_a_stop_just_inside_gives_up():
    parts = [Passage("west", shapely.box(8, -1, 14, 11)), Passage("middle", shapely.box(14, -1, 17, 11))]
    keeps = tour_in(HALL, Cell(0, 2, 0), Cell(0, 2, 8), prefix="a")
    comes = tour_in(HALL, Cell(0, 9, 30), Cell(0, 9, 15), Cell(0, 9, 13), prefix="b")
    fleet = [Robot("A", speed=5.0), Robot("B", speed=1.0)]
    result = simulate([keeps, comes], robots=fleet, passages=parts, patience=20.0, until=1000.0)
    (given_up,) = rows(result, "give_up", robot="B")
    assert (given_up.target, given_up.cause) == ("b1", "west, in use closes the way for 20 s")
    assert given_up.time < 100


def test_a_line_that_meets_an_area_only_by_a_rounding_does_not_cross_it():
    from bimnav.sim.areas import _inside

    a, b = np.array([0.0, 0.0]), np.array([1.0, 0.0])
    assert _inside(a, b, shapely.LineString()) == []


def test_a_door_that_comes_to_need_opening_is_waited_for_although_the_way_is_known():
    there, back = [(0, 0, 0), (10, 0, 0)], [(10, 0, 0), (0, 0, 0)]
    locks = DoorLocks(17.0, "door")
    robot = Robot("R1", speed=1.0, keys=("door",))
    door = SimDoor("door", "open", 3.0, polygon=shapely.box(4, -1, 5, 1))
    result = simulate(tour_along(there, back, there, back), robot=robot, doors=[door], events=[locks])
    assert at(result, "open_door") == pytest.approx([24.0, 38.0], abs=1e-5)
    assert len(result.served) == 4
