"""A world that changes while robots work, worked out by hand and by law."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from bimnav.errors import InputError, ModelError, SimulationError, ValueRangeError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.robot import Robot
from bimnav.sim import (
    Chance,
    DoorLocks,
    DoorUnlocks,
    Emergency,
    ObstacleAppears,
    ObstacleRemoved,
    Person,
    RobotFails,
    RobotStatus,
    Sensing,
    SimDoor,
    SimResult,
    TargetReported,
    ZoneHazardous,
    egress_cells,
    egress_distances,
    simulate,
)
from tests.test_sim import tour_along
from tests.test_sim_world import ONE, STRAIGHT, at, rows, tour_in

HALL = NavGraph.from_mask(np.ones((10, 40), dtype=bool))  # 40 m by 10 m, cells of 1 m
ALLEY = NavGraph.from_mask(np.ones((1, 40), dtype=bool))
BOX = shapely.box(20, 4, 22, 7)
THERE = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 39))  # 39 m straight ahead
IN_ALLEY = tour_in(ALLEY, Cell(0, 0, 0), Cell(0, 0, 39))
ALLEY_BOX = shapely.box(20, 0, 22, 1)


def test_a_robot_drives_around_what_appears_on_its_way():
    result = simulate(THERE, robot=ONE, events=[ObstacleAppears(5.0, BOX, name="chair")])
    (change,) = rows(result, "change")
    assert (change.time, change.robot, change.cause, change.x) == (5.0, "", "chair appears", 21.0)
    (replan,) = rows(result, "replan")
    assert (replan.time, replan.x) == (5.0, 5.5)
    longer = float(replan.cause.split("is ")[-1].split(" m")[0])
    assert replan.cause.startswith("chair is in the way; the other way is +")
    assert result.distance == pytest.approx(39 + longer, abs=0.01)
    table = result.trajectory(0.1)
    inside = shapely.contains_xy(BOX, table["x"], table["y"])
    assert not inside.any()
    assert result.served == ("s0",)


def test_what_appears_elsewhere_or_behind_disturbs_nobody():
    plain = simulate(THERE, robot=ONE)
    for box, time in ((shapely.box(20, 0, 22, 2), 5.0), (BOX, 30.0), (shapely.box(0, 0, 1, 2), 60.0)):
        result = simulate(THERE, robot=ONE, events=[ObstacleAppears(time, box)])
        assert [row for row in result.log if row.event != "change"] == list(plain.log)


def test_a_robot_with_brakes_needs_them_before_it_turns_away():
    robot = Robot("R1", speed=1.0, acceleration=0.5)
    result = simulate(THERE, robot=robot, events=[ObstacleAppears(10.0, BOX, name="chair")])
    (replan,) = rows(result, "replan")
    assert (replan.time, replan.x) == (12.0, 0.5 + 9.0 + 1.0)


@pytest.mark.parametrize(("removed", "time"), [(30.0, 39 + 14.5), (100.0, None)])
def test_where_there_is_no_other_way_a_robot_waits_until_it_opens_or_patience_ends(removed, time):
    changes = [ObstacleAppears(15.5, ALLEY_BOX, name="crate"), ObstacleRemoved(removed, "crate")]
    result = simulate(IN_ALLEY, robot=ONE, events=changes, patience=60.0)
    (block,) = rows(result, "block")
    assert (block.time, block.cause) == (15.5, "crate closes the way; waits")
    if time is None:
        (given_up,) = rows(result, "give_up")
        assert (given_up.time, given_up.cause) == (75.5, "crate closes the way for 60 s")
        assert result.given_up == ("s0",)
    else:
        assert result.makespan == time
        assert result.metrics["blocked"] == 14.5


def test_a_target_whose_way_is_closed_comes_last():
    tour = tour_along([(0.5, 5.5, 0), (5.5, 5.5, 0)], [(5.5, 5.5, 0), (0.5, 0.5, 0)])
    alcove = np.ones((10, 10), dtype=bool)
    graph = NavGraph.from_mask(alcove)
    tour = tour_in(graph, Cell(0, 5, 0), Cell(0, 5, 3), Cell(0, 5, 9))
    closed = ObstacleAppears(0.0, shapely.box(3, 5, 4, 6), name="crate")
    result = simulate(tour, robot=ONE, events=[closed], patience=10.0)
    assert result.served == ("s1",)
    assert [row.cause for row in rows(result, "replan")] == ["crate closes the way; it comes last"]
    assert result.given_up == ("s0",)


@pytest.mark.parametrize(
    ("policy", "events"),
    [
        ("wait", ["block", "give_up"]),
        ("give up", ["give_up"]),
        ("replan", ["replan"]),
        (lambda robot, stop, obstacle: "give up" if obstacle == "chair" else "wait", ["give_up"]),
    ],
)
def test_the_policy_says_what_a_robot_does(policy, events):
    appears = ObstacleAppears(5.0, BOX, name="chair")
    result = simulate(THERE, robot=ONE, events=[appears], policy=policy, patience=10.0)
    assert [row.event for row in rows(result, "block", "give_up", "replan")] == events


def test_a_policy_that_says_something_else_is_refused():
    with pytest.raises(SimulationError, match="the policy says 'panic'"):
        simulate(THERE, robot=ONE, events=[ObstacleAppears(5.0, BOX)], policy=lambda *_: "panic")


# --- sensing


def test_a_hidden_obstacle_is_found_at_the_range_of_the_sensor():
    hidden = ObstacleAppears(5.0, BOX, name="chair", known=False)
    result = simulate(THERE, robot=ONE, events=[hidden], sensing=Sensing(range=3.0))
    (sensed,) = rows(result, "sense")
    assert (sensed.cause, sensed.x) == ("chair", pytest.approx(17.0))
    assert len(rows(result, "replan")) == 1
    assert result.served == ("s0",)


def test_a_robot_that_senses_nothing_stops_when_it_touches():
    robot = Robot("R1", speed=1.0, radius=0.3)
    hidden = ObstacleAppears(5.0, BOX, name="chair", known=False)
    result = simulate(THERE, robot=robot, events=[hidden], sensing=Sensing(probability=0.0))
    (touched,) = rows(result, "contact")
    assert touched.x == pytest.approx(20 - 0.3, abs=1e-3)


def test_the_first_that_finds_something_tells_the_others():
    second = tour_in(HALL, Cell(0, 6, 0), Cell(0, 6, 39), prefix="r")
    robots = [Robot("A", speed=1.0), Robot("B", speed=0.5)]
    hidden = ObstacleAppears(5.0, BOX, name="chair", known=False)
    result = simulate([THERE, second], robots=robots, events=[hidden])
    assert [row.robot for row in rows(result, "sense")] == ["A"]
    replans = rows(result, "replan")
    assert [row.robot for row in replans] == ["A", "B"]
    assert replans[1].time == replans[0].time


def test_looks_that_fail_are_drawn_from_the_seed():
    hidden = ObstacleAppears(0.0, shapely.box(38, 0, 39, 2), name="chair", known=False)
    found = []
    for seed in range(60):
        sensing = Sensing(range=30.0, probability=0.25, period=1.0)
        result = simulate(THERE, robot=ONE, events=[hidden], sensing=sensing, rng=np.random.default_rng(seed))
        found += [row.time for row in rows(result, "sense")]
    looks = np.array(found) - min(found)
    assert len(found) > 50
    assert np.mean(looks) == pytest.approx(
        3.0, abs=1.2
    )  # geometric: (1 - p) / p looks fail before the first that does not
    assert looks == pytest.approx(np.round(looks), abs=1e-9)


# --- doors, targets, failures


def test_a_door_that_locks_is_driven_around_and_one_that_unlocks_is_waited_for():
    door = SimDoor("door", "closed", 2.0, name="Door", polygon=shapely.box(20, 0, 21, 1))
    changes = [DoorLocks(5.0, "door"), DoorUnlocks(40.0, "door")]
    result = simulate(IN_ALLEY, robot=ONE, events=changes, doors=[door])
    assert [row.cause for row in rows(result, "change")] == ["door Door is locked", "door Door is unlocked"]
    assert at(result, "block") == [5.0]
    # 5 m driven, then 34 m from 40 s on, and 2 s for the door
    assert result.makespan == 40 + 34 + 2
    around = simulate(THERE, robot=ONE, events=[DoorLocks(5.0, "d")], doors=[SimDoor("d", "open", polygon=BOX)])
    assert rows(around, "replan")[0].cause.startswith("door d is in the way")
    with pytest.raises(ModelError, match="door nowhere has no place"):
        simulate(THERE, events=[DoorLocks(5.0, "nowhere")])


def test_a_new_target_goes_to_the_robot_with_the_shortest_detour():
    tours = [THERE, tour_in(HALL, Cell(0, 0, 0), Cell(0, 0, 39), prefix="r")]
    robots = [Robot("A", speed=1.0), Robot("B", speed=1.0)]
    spill = TargetReported(10.0, "spill", 25.5, 1.5)
    result = simulate(tours, robots=robots, events=[spill])
    (assigned,) = rows(result, "assign")
    assert (assigned.robot, assigned.target, assigned.time) == ("B", "spill", 10.0)
    assert set(result.served) == {"s0", "r0", "spill"}
    assert result.state_at(result.span[1], "B").y == 1.5


def test_a_robot_that_had_finished_takes_a_new_target_and_goes_home_again():
    tour = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 10), return_to_start=True)
    result = simulate(tour, robot=ONE, events=[TargetReported(100.0, "spill", 5.5, 5.5)])
    assert at(result, "finish") == [20.0, 110.0]
    assert result.served == ("s0", "spill")
    assert result.state_at(110.0).x == 0.5


def test_a_new_target_nobody_can_reach_is_listed_with_the_reason():
    result = simulate(IN_ALLEY, robot=ONE, events=[TargetReported(1.0, "far", 99.0, 0.5)])
    (lost,) = rows(result, "unreached")
    assert "lies outside the map" in lost.cause
    assert result.unreached == ("far",)
    assert result.metrics["coverage"] == 0.5


def test_others_take_over_from_a_robot_that_fails_and_drive_around_it():
    goals = [Cell(0, 5, 20), Cell(0, 5, 30)]
    tours = [tour_in(HALL, Cell(0, 5, 0), *goals), tour_in(HALL, Cell(0, 5, 2), Cell(0, 5, 6), prefix="r")]
    robots = [Robot(name, speed=1.0, radius=0.4) for name in "AB"]
    result = simulate(tours, robots=robots, events=[RobotFails(10.0, "A")])
    (failed,) = rows(result, "fail")
    assert (failed.robot, failed.cause, failed.status) == ("A", "breaks down", RobotStatus.FAILED)
    assert [row.robot for row in rows(result, "assign")] == ["B", "B"]
    assert set(result.served) == {"r0", "s0", "s1"}
    assert result.state_at(60.0, "A").status == RobotStatus.FAILED
    assert not [e for e in result.encounters if e.end > 12]


def test_a_robot_alone_goes_on_after_its_repair():
    result = simulate(STRAIGHT, robot=ONE, events=[RobotFails(4.0, "R1", repair_time=50.0)])
    assert result.makespan == 60.0
    assert at(result, "recover") == [54.0]
    assert result.metrics["failed"] == 50.0


def test_what_a_robot_leaves_when_it_fails_for_good_is_listed():
    result = simulate(STRAIGHT, robot=ONE, events=[RobotFails(4.0, "R1")])
    assert result.given_up == ("s0",)
    assert rows(result, "give_up")[0].cause == "R1 failed: breaks down"
    with pytest.raises(ValueRangeError, match="no robot is called 'R2'"):
        simulate(STRAIGHT, robot=ONE, events=[RobotFails(4.0, "R2")])


def test_a_robot_leaves_a_hazardous_zone_and_comes_back_when_it_is_over():
    zone = ZoneHazardous(10.0, shapely.box(8, 0, 14, 10), name="gas", until=50.0)
    tour = tour_in(HALL, Cell(0, 5, 0), Cell(0, 5, 12))
    result = simulate(tour, robot=ONE, events=[zone])
    assert result.state_at(20.0).x < 8
    assert result.served == ("s0",)
    assert at(result, "arrive")[-1] > 50.0
    assert "gas closes the way; waits" in [row.cause for row in rows(result, "block")]


# --- emergencies


ROOMS = NavGraph.from_mask(
    np.array([[c == "." for c in line] for line in ["........", "##.#####", "........", "........"]])
)


def test_the_way_out_is_as_long_as_a_walk_to_the_nearest_exit():
    exits = [Cell(0, 0, 0), Cell(0, 0, 7)]
    distance = egress_distances(ROOMS, exits)
    assert distance[0, 0, 3] == 3.0
    assert distance[0, 3, 2] == pytest.approx(2 + 3)
    assert np.isinf(distance[0, 1, 0])
    with pytest.raises(InputError, match="has no exit"):
        egress_distances(ROOMS)


def test_robots_clear_the_ways_out_and_say_so():
    from bimnav.environment import make_environment
    from bimnav.graph import build_graph
    from bimnav.tasks import Rule, Task
    from bimnav.testing import two_rooms

    robot = Robot("R1", speed=0.5, radius=0.2)
    task = Task("test", exits=[Rule("IfcDoor")])
    graph = build_graph(make_environment(two_rooms(), task, robot), cell_size=0.2)
    begin, goal = graph.frame.cell_at(1, 2), graph.frame.cell_at(7, 2)
    tour = tour_in(graph, begin, goal)
    result = simulate(tour, events=[Emergency(5.0, "fire")])
    (parked,) = rows(result, "park")
    needed = egress_cells(graph, egress_distances(graph), 1.2)
    assert needed[graph.frame.cell_at(3.4, 2)]
    assert not needed[graph.frame.cell_at(parked.x, parked.y)]
    assert parked.cause == "fire: off the way out"
    assert result.given_up == ("s0",)
    assert rows(result, "give_up")[0].cause == "fire"
    aside = tour_in(graph, graph.frame.cell_at(0.5, 3.5), graph.frame.cell_at(0.5, 3.3))
    stays = simulate(aside, events=[Emergency(0.0, "fire")], service_time=10.0)
    assert rows(stays, "park")[0].cause in ("fire: in nobody's way", "fire: off the way out")


# --- the same instant


def test_what_changes_at_the_instant_a_robot_arrives_comes_first_and_the_robot_has_arrived():
    arrival = 39.0
    changes = [
        ObstacleAppears(arrival, shapely.box(39, 5, 40, 6), name="crate"),
        TargetReported(arrival, "spill", 30.5, 5.5),
    ]
    result = simulate(THERE, robot=ONE, events=changes, service_time=5.0)
    here = [(row.event, row.robot) for row in result.log if row.time == arrival]
    assert here[:3] == [("change", ""), ("change", ""), ("assign", "R1")]
    assert here[3:] == [("arrive", "R1"), ("begin_service", "R1")]
    assert "s0" in result.served


def test_of_changes_at_one_instant_the_first_given_comes_first():
    names = ["b", "a", "c"]
    changes = [ObstacleAppears(5.0, shapely.box(30 + k, 0, 31 + k, 1), name=name) for k, name in enumerate(names)]
    result = simulate(THERE, robot=ONE, events=changes)
    assert [row.cause for row in rows(result, "change")] == [f"{name} appears" for name in names]


def test_a_robot_that_fails_at_the_instant_it_is_done_has_done_it():
    result = simulate(STRAIGHT, robot=ONE, service_time=5.0, events=[RobotFails(15.0, "R1")])
    assert result.served == ("s0",)


@pytest.mark.parametrize("time", [-1.0, math.nan, math.inf])
def test_a_change_before_the_start_or_never_is_refused(time):
    with pytest.raises(ValueRangeError, match="ObstacleAppears"):
        simulate(THERE, events=[ObstacleAppears(time, BOX)])


# --- laws


def troubled(seed: int) -> SimResult:
    """Play tours in a hall where all sorts of things happen."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    goals = [[Cell(0, int(r), int(c)) for r, c in rng.integers((10, 40), size=(3, 2))] for _ in range(count)]
    tours = [
        tour_in(HALL, Cell(0, 2 * k, 0), *goals[k], prefix=f"r{k}-", return_to_start=bool(rng.integers(2)))
        for k in range(count)
    ]
    robots = [
        Robot(
            f"R{k}",
            speed=float(rng.uniform(0.5, 2)),
            radius=0.3,
            acceleration=float(rng.choice([0.5, math.inf])),
            turn_rate=float(rng.choice([1.0, math.inf])),
        )
        for k in range(count)
    ]

    def box():
        x, y = rng.uniform(2, 36), rng.uniform(0, 8)
        return shapely.box(x, y, x + 2, y + 2)

    changes = []
    for time in sorted(rng.uniform(0, 80, int(rng.integers(0, 6))).round(1).tolist()):
        kind = int(rng.integers(6))
        changes.append(
            [
                lambda t: ObstacleAppears(t, box(), name=f"o{t}"),
                lambda t: ObstacleAppears(t, box(), name=f"h{t}", known=False),
                lambda t: TargetReported(t, f"new{t}", float(rng.uniform(0, 40)), float(rng.uniform(0, 10))),
                lambda t: RobotFails(t, f"R{rng.integers(count)}", float(rng.choice([10.0, math.inf]))),
                lambda t: ZoneHazardous(t, box(), name=f"z{t}", until=t + 20.0),
                lambda t: Emergency(t, f"e{t}"),
            ][kind](time)
        )
    people = [Person(f"p{k}") for k in range(int(rng.integers(0, 3)))]
    return simulate(
        tours,
        robots=robots,
        events=changes,
        people=people,
        service_time=Chance("uniform", (1, 20), "s"),
        patience=30.0,
        rng=np.random.default_rng(1),
        until=float(rng.choice([40.0, 1000.0])),
    )


laws = settings(max_examples=40, deadline=None)


@laws
@given(st.integers(0, 10_000))
def test_whatever_happens_every_target_has_exactly_one_outcome(seed):
    result = troubled(seed)
    assert sorted([*result.served, *result.given_up, *result.unreached]) == sorted(result.targets)
    assert [row.event for row in result.log].count("end_service") == len(result.served)


@laws
@given(st.integers(0, 10_000))
def test_whatever_happens_log_and_motion_tell_the_same_story(seed):
    result = troubled(seed)
    times = [row.time for row in result.log]
    assert times == sorted(times)
    for row in result.log:
        if row.robot:
            state = result.state_at(row.time, row.robot)
            assert (state.x, state.y) == pytest.approx((row.x, row.y), abs=1e-6)
    for robot, track, tally in zip(result.robots, result.tracks, result.tallies, strict=True):
        moments = np.linspace(track.times[0], track.times[-1], 300)
        points = track.points_at(moments)
        moved = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert (moved <= robot.speed * np.diff(moments) + 1e-6).all()
        assert float(track.lengths.sum()) == pytest.approx(tally.distance, abs=1e-6)


PLAYED_ELSEWHERE = """
import json, sys
import numpy as np, shapely
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan import plan_tour
from bimnav.robot import Robot
from bimnav.sim import *
from bimnav.stops import Stop
hall = NavGraph.from_mask(np.ones((10, 40), dtype=bool))
def stop(cell, name):
    point = hall.frame.center_of(cell)
    return Stop(name, name, cell, point, point)
tours = [plan_tour(hall, Cell(0, 2 * k, 0), [stop(Cell(0, 9 - k, 5 + 9 * k + j), f"{k}{j}") for j in range(4)])
         for k in range(3)]
box = shapely.box(20, 3, 22, 8)
events = [ObstacleAppears(9, box, name="chair", known=False), TargetReported(12, "spill", 30.5, 2.5),
          RobotFails(25, "R-2", 200), ZoneHazardous(30, shapely.box(30, 0, 36, 5), until=60), Emergency(600, "fire")]
result = simulate(tours, robots=[Robot(f"R-{k}", radius=0.3, acceleration=0.5, turn_rate=1, battery_wh=1.0,
                                       drive_power=20, work_power=8, idle_power=1, charge_power=50) for k in range(3)],
                  events=events, people=[Person("a"), Person("b")], passages=[Passage("p", shapely.box(10, 0, 12, 10))],
                  doors=[SimDoor("d", "automatic", 2.0, polygon=shapely.box(25, 0, 26, 10))],
                  chargers=[Charger("dock", Cell(0, 9, 0), hall.frame.center_of(Cell(0, 9, 0)))],
                  sensing=Sensing(4.0, 0.3, 0.5), speed=Chance("normal", (1.0, 0.1), "m/s", 0.2),
                  service_time=Chance("lognormal", (0.5, 0.2), "min"), rng=np.random.default_rng(11))
sys.stdout.buffer.write(result.log.to_csv().encode())
sys.stdout.buffer.write(result.trajectories(1.0).tobytes())
sys.stdout.buffer.write(json.dumps(result.metrics).encode())
"""


def test_equal_seeds_give_equal_bytes_in_every_process_ten_of_them_if_full(full):
    seeds = [str(seed) for seed in ((0, 1, 2, 3, 5, 8, 13, 21, 34, 4242) if full else (1, 4242))]
    outputs = set()
    for batch in (seeds[:5], seeds[5:]):
        processes = [
            subprocess.Popen(
                [sys.executable, "-c", PLAYED_ELSEWHERE],
                env={**os.environ, "PYTHONHASHSEED": seed},
                stdout=subprocess.PIPE,
            )
            for seed in batch
        ]
        for process in processes:
            outputs.add(process.communicate()[0])
            assert process.returncode == 0
    assert len(outputs) == 1
    text = outputs.pop()
    for word in (b"sense", b"assign", b"recover", b"charged", b"open_door", b"park", b"hazard"):
        assert word in text
    assert json.loads(text[text.rindex(b"{") :])["makespan"] >= 600


def test_a_million_events_leave_memory_flat(full):
    import tracemalloc

    count = 200_000 if full else 2_000
    ends = [(10.5, 0.5, 0.0), (0.5, 0.5, 0.0)]
    ways = [np.array(ends[::-1]), np.array(ends)]

    def peak(stops: int) -> tuple[int, float]:
        from tests.test_sim import HandMadeTour, stop_at

        visits = tuple(stop_at(ends[k % 2], "s") for k in range(stops))
        tour = HandMadeTour(tuple(ways[k % 2] for k in range(stops)), visits, ends[1])
        seen = [0]

        def count_one(_):
            seen[0] += 1

        tracemalloc.start()
        simulate(tour, robot=ONE, service_time=1.0, history=False, on_event=count_one)
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return seen[0], used / stops

    few, many = peak(count // 10), peak(count)
    assert many[0] >= 4 * count
    assert many[1] <= 1.2 * few[1]  # what is kept is the plan, not what happens
