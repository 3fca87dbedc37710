"""Tours played in time, in worlds that can be worked out by hand."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, dataclass, field
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from bimnav.errors import InputError, MissingExtraError, OutputError, SimulationError, ValueRangeError
from bimnav.graph import NavGraph
from bimnav.grid import Cell, GridFrame
from bimnav.robot import Robot
from bimnav.sim import Event, EventLog, RobotStatus, SimResult, simulate
from bimnav.sim.log import csv_text
from bimnav.stops import Stop, Unreached

TWO_STOREYS = NavGraph.from_mask(np.ones((2, 1, 1), dtype=bool))  # floors at 0 and 3 m
SLOW = Robot(name="R1", speed=0.5)


@dataclass(frozen=True)
class HandMadeTour:
    """What the simulator asks of a tour."""

    route: tuple[np.ndarray, ...]
    stops: tuple[Stop, ...]
    start_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    unreached: tuple[Unreached, ...] = ()
    return_to_start: bool = False
    graph: Any = TWO_STOREYS
    start: Cell = field(default=Cell(0, 0, 0))


def stop_at(point, global_id="spill", *, storey=0, **more) -> Stop:
    point = tuple(float(value) for value in point)
    return Stop(global_id, more.pop("name", f"the {global_id}"), Cell(storey, 0, 0), point, point, **more)


def tour_along(*legs, **more) -> HandMadeTour:
    """Make a tour with a stop named s0, s1, ... at the end of every leg, but for a leg that returns."""
    legs = [np.array(leg, dtype=float) for leg in legs]
    visits = legs[:-1] if more.get("return_to_start") else legs
    stops = more.pop("stops", tuple(stop_at(leg[-1], f"s{k}") for k, leg in enumerate(visits)))
    return HandMadeTour(tuple(legs), stops, tuple(legs[0][0].tolist()) if legs else (0.0, 0.0, 0.0), **more)


CORRIDOR = tour_along([(0, 0, 0), (4, 0, 0), (10, 0, 0)])


def in_environment(*, robot=SLOW, service_time=0.0, storeys=("Ground", "Upper"), targets=()) -> SimpleNamespace:
    environment = SimpleNamespace(
        robot=robot,
        task=SimpleNamespace(service_time=service_time, removes_targets=True),
        storeys=tuple(SimpleNamespace(name=name) for name in storeys),
        targets=tuple(SimpleNamespace(global_id=target) for target in targets),
    )
    return SimpleNamespace(frame=TWO_STOREYS.frame, environment=environment)


def events_of(result: SimResult) -> list[tuple[float, str]]:
    return [(row.time, row.event) for row in result.log]


def position(thing) -> tuple[float, float, float]:
    return thing.x, thing.y, thing.z


# --- worked out by hand


def test_ten_metres_at_half_a_metre_per_second_and_thirty_seconds_of_work_take_fifty_seconds():
    result = simulate(CORRIDOR, robot=SLOW, service_time=30.0)
    assert result.makespan == 50.0
    assert result.distance == 10.0
    assert events_of(result) == [
        (0.0, "start"),
        (0.0, "depart"),
        (20.0, "arrive"),
        (20.0, "begin_service"),
        (50.0, "end_service"),
        (50.0, "remove"),
        (50.0, "finish"),
    ]
    assert result.metrics == {
        "makespan": 50.0,
        "distance": 10.0,
        "idle": 0.0,
        "moving": 20.0,
        "working": 30.0,
        "waiting": 0.0,
        "charging": 0.0,
        "blocked": 0.0,
        "failed": 0.0,
        "energy": 0.0,
        "charge_distance": 0.0,
        "utilisation": 1.0,
        "served": 1,
        "given_up": 0,
        "unreached": 0,
        "coverage": 1.0,
    }
    assert repr(result) == "SimResult('R1': 1 of 1 targets served, 10.00 m in 50.0 s, 7 events)"


def test_the_log_says_who_did_what_where_to_which_target_and_why():
    arrive = simulate(CORRIDOR, robot=SLOW).log.rows[2]
    assert arrive == Event(
        time=20.0,
        robot="R1",
        event="arrive",
        status=RobotStatus.IDLE,
        storey="0",
        x=10.0,
        y=0.0,
        z=0.0,
        target="s0",
        target_name="the s0",
        cause="center",
        leg_distance=10.0,
    )


@pytest.mark.parametrize(
    ("time", "x", "status", "target"),
    [
        (-5.0, 0.0, "idle", ""),
        (0.0, 0.0, "moving", "s0"),
        (9.0, 4.5, "moving", "s0"),
        (20.0, 10.0, "working", "s0"),
        (49.9, 10.0, "working", "s0"),
        (50.0, 10.0, "idle", ""),
        (math.inf, 10.0, "idle", ""),
        (-math.inf, 0.0, "idle", ""),
    ],
)
def test_the_state_of_the_robot_is_known_at_any_time(time, x, status, target):
    state = simulate(CORRIDOR, robot=SLOW, service_time=30.0).state_at(time)
    assert (state.x, state.y, state.status, state.target, state.robot) == (x, 0.0, status, target, "R1")


def test_a_time_that_is_no_number_has_no_state():
    with pytest.raises(ValueRangeError, match="not a number"):
        simulate(CORRIDOR).state_at(math.nan)


def test_a_robot_faces_where_it_goes_and_keeps_facing_there_while_it_works():
    tour = tour_along([(0, 0, 0), (0, 2, 0)], [(0, 2, 0), (0, 2, 0), (-1, 2, 0)])
    result = simulate(tour, robot=Robot(speed=1.0), service_time=10.0)
    north, west = math.pi / 2, math.pi
    assert [result.state_at(t).heading for t in (-1, 0, 1, 5, 12.5, 15, 99)] == [
        *(north, north, north, north),
        *(west, west, west),
    ]


def test_a_robot_that_works_before_it_moves_faces_where_it_goes_first():
    tour = tour_along([(0, 0, 0)], [(0, 0, 0), (0, 1, 0), (1, 1, 0)])
    assert simulate(tour, service_time=5.0).state_at(1.0).heading == math.pi / 2


def test_a_robot_that_never_moves_has_a_heading_too():
    assert simulate(tour_along([(1, 1, 0)]), service_time=5.0).state_at(2.0).heading == 0.0


def test_two_stops_at_one_place_are_two_services():
    tour = tour_along([(0, 0, 0), (1, 0, 0)], [(1, 0, 0), (1, 0, 0)], [(1, 0, 0)])
    result = simulate(tour, robot=SLOW, service_time=7.0)
    assert result.makespan == 2.0 + 3 * 7.0
    assert result.served == ("s0", "s1", "s2")


def test_a_closed_tour_ends_where_it_began():
    tour = tour_along([(0, 0, 0), (3, 4, 0)], [(3, 4, 0), (0, 0, 0)], return_to_start=True)
    result = simulate(tour, robot=SLOW)
    assert result.makespan == 20.0
    assert [row.cause for row in result.log if row.event in ("depart", "finish")] == [
        "next stop",
        "return to the start",
        "back at the start",
    ]
    assert position(result.state_at(99.0)) == (0.0, 0.0, 0.0)


def test_a_tour_without_stops_starts_and_finishes():
    result = simulate(HandMadeTour((), ()))
    assert events_of(result) == [(0.0, "start"), (0.0, "finish")]
    assert (result.makespan, result.distance, result.served) == (0.0, 0.0, ())
    assert len(result.trajectory(1.0)) == 1


def test_the_clock_may_start_at_any_time_of_day():
    monday = 1_790_000_000.0
    result = simulate(CORRIDOR, robot=SLOW, service_time=30.0, start_time=monday)
    assert [row.time - monday for row in result.log] == [0, 0, 20, 20, 50, 50, 50]
    assert result.state_at(monday + 10).x == 5.0


# --- the world


def test_what_was_served_is_gone_from_the_world():
    lost = Unreached("far", "the far one", (9.0, 9.0, 0.0), "no way")
    tour = tour_along([(0, 0, 0), (1, 0, 0)], [(1, 0, 0), (2, 0, 0)], unreached=(lost,))
    result = simulate(tour, robot=SLOW, service_time=10.0)
    assert result.present_targets(0.0) == ("s0", "s1", "far")
    assert result.present_targets(11.9) == ("s0", "s1", "far")
    assert result.present_targets(12.0) == ("s1", "far")
    assert result.present_targets(99.0) == ("far",)
    unreached = next(row for row in result.log if row.event == "unreached")
    assert (unreached.target, unreached.target_name, unreached.cause) == ("far", "the far one", "no way")


def test_a_target_that_the_tour_leaves_out_stays_in_the_world():
    tour = tour_along([(0, 0, 0), (1, 0, 0)], graph=in_environment(targets=("other", "s0")))
    assert simulate(tour).present_targets(99.0) == ("other",)


def test_a_target_visited_twice_is_removed_once():
    tour = tour_along([(0, 0, 0)], [(0, 0, 0)], stops=(stop_at((0, 0, 0)), stop_at((0, 0, 0))))
    result = simulate(tour)
    assert [row.event for row in result.log].count("remove") == 1
    assert result.served == ("spill",)


def test_robot_service_time_and_storey_names_come_from_the_environment():
    tour = tour_along([(0, 0, 0), (1, 0, 0)], graph=in_environment(robot=Robot("Scrub", speed=0.1), service_time=60))
    result = simulate(tour)
    assert (result.robot.name, result.makespan) == ("Scrub", 70.0)
    assert {row.storey for row in result.log} == {"Ground"}


def test_a_robot_that_climbs_is_on_the_storey_below_until_it_arrives():
    climb = [(0, 0, 0), (2, 0, 0), (6, 0, 1.5), (10, 0, 3), (12, 0, 3)]
    tour = tour_along(climb, stops=(stop_at((12, 0, 3), storey=1),), graph=in_environment())
    result = simulate(tour, robot=SLOW)
    assert [row[2] for row in result.route_rows()] == ["Ground", "Ground", "Ground", "Upper", "Upper"]
    assert result.log.rows[2].storey == "Upper"
    assert result.state_at(8.0).z == pytest.approx(1.5 * 2 / math.hypot(4, 1.5))


def test_of_two_storeys_at_one_height_the_robot_is_on_the_one_it_drives_on():
    wings = SimpleNamespace(frame=GridFrame(1.0, elevations=(0.0, 0.0)), environment=None)
    tour = tour_along(
        [(0, 0, 0), (1, 0, 0), (2, 0, 0)],
        stops=(stop_at((2, 0, 0), storey=1),),
        start=Cell(1, 0, 0),
        graph=wings,
    )
    assert {row[2] for row in simulate(tour).route_rows()} == {"1"}


# --- service times and chance


def shaky(robot: Robot, stop: Stop, rng: np.random.Generator) -> float:
    return float(rng.uniform(10, 20))


def test_equal_seeds_give_equal_logs_and_other_seeds_others():
    logs = [simulate(CORRIDOR, service_time=shaky, rng=np.random.default_rng(seed)).log for seed in (1, 1, 2)]
    assert logs[0] == logs[1]
    assert logs[0].to_csv() == logs[1].to_csv() != logs[2].to_csv()


def test_without_a_generator_chance_is_fixed():
    assert simulate(CORRIDOR, service_time=shaky).log == simulate(CORRIDOR, service_time=shaky).log


def test_the_service_time_may_depend_on_the_stop():
    tour = tour_along([(0, 0, 0)], [(0, 0, 0)])
    result = simulate(tour, service_time=lambda robot, stop, rng: {"s0": 5, "s1": 7}[stop.global_id])
    assert result.makespan == 12.0


def forgetful(robot: Robot, stop: Stop, rng: np.random.Generator) -> float:
    raise KeyError("no such stop in the table")


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0, "soon", lambda *_: None, lambda *_: math.nan, forgetful])
def test_a_service_time_that_is_no_duration_is_refused_with_the_name_of_the_stop(bad):
    with pytest.raises(SimulationError, match=r"'the s0' \(s0\)") as caught:
        simulate(CORRIDOR, service_time=bad)
    assert caught.value.context == {"global_id": "s0", "name": "the s0"}


def test_a_simulation_that_outlasts_its_clock_is_refused():
    with pytest.raises(SimulationError, match="check the speed"):
        simulate(CORRIDOR, service_time=1e300)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e11])
def test_a_start_time_that_is_no_time_is_refused(bad):
    with pytest.raises(ValueRangeError, match="start_time"):
        simulate(CORRIDOR, start_time=bad)


@pytest.mark.parametrize(
    ("legs", "words"),
    [
        ([[(0, 0, 0), (1, 0, 0)], [(1.5, 0, 0), (2, 0, 0)]], "leg 1 of the tour begins 0.5 m from"),
        ([[(0, 0, 0), (math.nan, 0, 0), (1, 0, 0)]], "no polyline of finite points"),
        ([[(0, 0), (1, 0)]], "no polyline of finite points"),
    ],
)
def test_a_route_that_cannot_be_driven_is_refused(legs, words):
    with pytest.raises(SimulationError, match=words):
        simulate(HandMadeTour(tuple(np.array(leg) for leg in legs), tuple(stop_at((*leg[-1], 0)[:3]) for leg in legs)))


def test_a_route_that_ends_away_from_its_stop_is_refused():
    with pytest.raises(SimulationError, match="ends 2 m from where it should stop"):
        simulate(tour_along([(0, 0, 0), (1, 0, 0)], stops=(stop_at((3, 0, 0)),)))


def test_a_route_with_too_few_legs_is_refused():
    with pytest.raises(SimulationError, match="2 stops has 1 legs"):
        simulate(tour_along([(0, 0, 0)], stops=(stop_at((0, 0, 0)), stop_at((0, 0, 0)))))


# --- tables


def test_a_long_leg_is_two_events_however_many_cells_it_crosses():
    points = np.column_stack([np.linspace(0, 500, 10_001), np.zeros((10_001, 2))])
    result = simulate(tour_along(points), robot=SLOW)
    assert len(result.log) == 7
    assert result.makespan == pytest.approx(1000.0, abs=1e-9)
    assert len(result.route_rows()) == 10_001


def test_the_route_is_listed_in_execution_order_with_a_wait_wherever_the_robot_works():
    tour = tour_along([(0, 0, 0), (1, 0, 0)], [(1, 0, 0), (1, 1, 0)])
    assert simulate(tour, robot=SLOW, service_time=3.0).route_rows() == [
        (0.0, 0.0, "0", 0.0),
        (1.0, 0.0, "0", 2.0),
        (1.0, 0.0, "0", 5.0),
        (1.0, 1.0, "0", 7.0),
        (1.0, 1.0, "0", 10.0),
    ]


def test_a_trajectory_has_a_row_wherever_the_motion_changes_or_at_every_step():
    result = simulate(CORRIDOR, robot=SLOW, service_time=30.0)
    changes, steps = result.trajectory(), result.trajectory(12.0)
    assert changes.dtype.names == ("time", "x", "y", "z", "heading", "status")
    assert changes["time"].tolist() == [0.0, 8.0, 20.0, 50.0]
    assert changes["status"].tolist() == ["moving", "moving", "working", "idle"]
    assert steps["time"].tolist() == [0.0, 12.0, 24.0, 36.0, 48.0, 50.0]
    assert steps["x"].tolist() == [0.0, 6.0, 10.0, 10.0, 10.0, 10.0]


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, math.inf, 1e-9])
def test_a_step_that_is_none_or_far_too_small_is_refused(step):
    with pytest.raises(ValueRangeError, match="step"):
        simulate(CORRIDOR).trajectory(step)


def test_the_log_is_a_table_of_plain_values():
    log = simulate(CORRIDOR, robot=SLOW).log
    records = log.to_records()
    assert list(records[0]) == list(EventLog.columns)
    assert json.loads(json.dumps(records))[2]["status"] == "idle"
    assert log.to_csv().splitlines()[:2] == [
        "time,robot,event,status,storey,x,y,z,target,target_name,cause,leg_distance",
        "0.000000,R1,start,idle,0,0.000000,0.000000,0.000000,,,,0.000000",
    ]


NAUGHTY = '=HYPERLINK("http://x")\n99,R1,finish'


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=1+1", "'=1+1"),
        ("+1. floor", "'+1. floor"),
        ("-1", "'-1"),
        ("@here", "'@here"),
        ("\t=1", r"\t=1"),
        ("a\nb\r\u2028c", r"a\nb\r\u2028c"),
        ("bell\x07, \ud800", r"bell\x07, \ud800"),
        ("Küche, 2½ m²", "Küche, 2½ m²"),
        (NAUGHTY, "'" + NAUGHTY.replace("\n", r"\n")),
    ],
)
def test_a_name_can_neither_forge_a_row_nor_become_a_formula(text, cell):
    table = csv_text(["name", "x"], [(text, -0.0000001)])
    assert table.encode().count(b"\n") == 2
    assert list(csv.reader(io.StringIO(table)))[1] == [cell, "0.000000"]


def test_names_of_targets_reach_the_log_file_escaped(tmp_path):
    tour = tour_along([(0, 0, 0)], stops=(stop_at((0, 0, 0), name=NAUGHTY),))
    log = simulate(tour).log
    text = log.to_csv(tmp_path / "events.csv")
    assert (tmp_path / "events.csv").read_bytes() == text.encode()
    assert len(text.splitlines()) == len(log) + 1
    assert log.rows[2].target_name == NAUGHTY


def test_a_folder_is_no_log_file(tmp_path):
    with pytest.raises(OutputError, match="is a folder"):
        simulate(CORRIDOR).log.to_csv(tmp_path)


def test_without_pandas_a_data_frame_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'bimnav\[dataframe\]'"):
        simulate(CORRIDOR).log.to_dataframe()


def test_with_pandas_a_log_is_a_data_frame():
    pytest.importorskip("pandas", reason="pandas is not installed: pip install 'bimnav[dataframe]'")
    frame = simulate(CORRIDOR, robot=SLOW).log.to_dataframe()
    assert list(frame.columns) == list(EventLog.columns)
    assert frame.loc[2, "time"] == 20.0


def test_a_result_is_a_value():
    result = simulate(CORRIDOR, robot=SLOW, service_time=30.0)
    assert pickle.loads(pickle.dumps(result)).state_at(7.0) == result.state_at(7.0)
    with pytest.raises(FrozenInstanceError):
        result.robot = Robot()
    with pytest.raises(ValueError, match="read-only"):
        result.track.times[0] = 1.0


PLAYED_ELSEWHERE = """
import sys
from types import SimpleNamespace as N
import numpy as np
from bimnav.graph import NavGraph
from bimnav.stops import Stop
from bimnav.grid import Cell
from bimnav.sim import simulate
points = np.random.default_rng(5).uniform(0, 50, (40, 3)) * (1, 1, 0)
points = [tuple(point) for point in points.tolist()]
stops = tuple(Stop(f"id{k}", f"stop {k}", Cell(0, 0, 0), p, p) for k, p in enumerate(points[1:]))
route = tuple(np.array(pair) for pair in zip(points, points[1:]))
graph = NavGraph.from_mask(np.ones((1, 1), dtype=bool))
tour = N(graph=graph, route=route, stops=stops, start=Cell(0, 0, 0), start_point=points[0],
         unreached=(), return_to_start=False)
result = simulate(tour, service_time=lambda robot, stop, rng: rng.gamma(2, 15), rng=np.random.default_rng(7))
sys.stdout.buffer.write(result.log.to_csv().encode() + repr(result.present_targets(600.0)).encode())
"""


def test_equal_seeds_give_equal_bytes_in_every_process():
    outputs = {
        subprocess.run(
            [sys.executable, "-c", PLAYED_ELSEWHERE],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("0", "1", "4242")
    }
    assert len(outputs) == 1
    assert outputs.pop().count(b"end_service") == 39


# --- laws that hold on every tour

coordinates = st.floats(-50, 50).map(lambda value: round(value, 3)) | st.sampled_from([0.0, 1.0, 1e-12])
floor_points = st.tuples(coordinates, coordinates, st.just(0.0))


@st.composite
def played(draw) -> tuple[HandMadeTour, Robot, dict[str, float], SimResult]:
    """Draw a tour of random polylines, play it, and return it with its robot and service times."""
    here = draw(floor_points)
    start, legs = here, []
    for points in draw(st.lists(st.lists(floor_points, max_size=4), max_size=4)):
        legs.append([here, *points])
        here = legs[-1][-1]
    closed = bool(legs) and draw(st.booleans())
    if closed:
        legs.append([here, start])
    lost = tuple(Unreached(f"u{k}", "", (0, 0, 0), "no way") for k in range(draw(st.integers(0, 2))))
    tour = tour_along(*legs, return_to_start=closed, unreached=lost) if legs else HandMadeTour((), (), start, lost)
    robot = Robot(speed=draw(st.floats(0.01, 3)))
    seconds = {stop.global_id: draw(st.floats(0, 100)) for stop in tour.stops}
    begin = draw(st.sampled_from([0.0, -17.3, 86_400.1]))
    result = simulate(tour, robot=robot, service_time=lambda r, stop, g: seconds[stop.global_id], start_time=begin)
    return tour, robot, seconds, result


laws = settings(max_examples=60, deadline=None)


@laws
@given(played())
def test_every_target_has_exactly_one_outcome(case):
    tour, _, _, result = case
    served = [row.target for row in result.log if row.event == "end_service"]
    unreached = [row.target for row in result.log if row.event == "unreached"]
    assert sorted(served + unreached) == sorted(result.targets)
    assert result.served == tuple(stop.global_id for stop in tour.stops)
    assert result.present_targets(math.inf) == tuple(unreached)


@laws
@given(played())
def test_length_and_time_add_up(case):
    tour, robot, seconds, result = case
    length = math.fsum(math.dist(a, b) for leg in tour.route for a, b in pairwise(leg.tolist()))
    assert result.distance == pytest.approx(length, abs=1e-9)
    assert sum(row.leg_distance for row in result.log if row.event == "arrive") == pytest.approx(length, abs=1e-9)
    assert result.makespan == pytest.approx(length / robot.speed + sum(seconds.values()), abs=1e-6)
    metrics = result.metrics
    assert sum(metrics[status] for status in RobotStatus) == pytest.approx(result.makespan, abs=1e-6)
    assert metrics["working"] == pytest.approx(sum(seconds.values()), abs=1e-6)


@laws
@given(played())
def test_log_and_motion_tell_the_same_story(case):
    *_, result = case
    times = [row.time for row in result.log]
    assert times == sorted(times)
    assert (result.log.rows[0].event, result.log.rows[-1].event) == ("start", "finish")
    for row in result.log:
        assert position(result.state_at(row.time)) == pytest.approx(position(row), abs=1e-9)
    assert result.state_at(times[-1]).status == result.log.rows[-1].status


@laws
@given(played(), st.lists(st.floats(0, 1), min_size=2, max_size=20))
def test_a_robot_is_in_one_place_and_never_faster_than_its_speed(case, shares):
    _, robot, _, result = case
    begin = float(result.track.times[0])
    moments = sorted(begin + share * result.makespan for share in shares)
    for a, b in pairwise(result.state_at(moment) for moment in moments):
        assert math.dist(position(a), position(b)) <= robot.speed * (b.time - a.time) + 1e-9


@laws
@given(played())
def test_a_trajectory_moves_on_in_time_and_holds_the_whole_way(case):
    *_, result = case
    table = result.trajectory()
    for each in (table, result.trajectory(result.makespan / 7 or 1.0)):
        assert (np.diff(each["time"]) > 0).all()
        assert each["time"][-1] == result.log.rows[-1].time
    points = np.column_stack([table[axis] for axis in "xyz"])
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(result.distance, abs=1e-6)
    assert [(row[0], row[1], row[3]) for row in result.route_rows()] == [
        (row["x"], row["y"], row["time"]) for row in table
    ]


@laws
@given(played())
def test_a_tour_that_nothing_can_disturb_is_played_as_if_something_could(case):
    tour, robot, seconds, result = case
    begin = float(result.track.times[0])
    slowly = simulate(
        tour,
        robot=robot,
        service_time=lambda r, stop, g: seconds[stop.global_id],
        start_time=begin,
        speed=robot.speed,  # drawn for every leg, so that every leg is planned by itself
    )
    assert slowly.log.rows == result.log.rows
    assert slowly.tallies == result.tallies
    for name in ("times", "points", "statuses", "storeys", "stops", "eases", "turns"):
        np.testing.assert_array_equal(getattr(slowly.track, name), getattr(result.track, name))


def test_the_graph_and_the_robots_may_be_given_in_their_places():
    graph = NavGraph.from_mask(np.ones((3, 9), dtype=bool))
    from bimnav import plan_tour

    tour = plan_tour(graph, Cell(0, 1, 1), [])
    assert simulate(tour, graph, [Robot("A")]).robot.name == "A"
    with pytest.raises(InputError, match="another graph"):
        simulate(tour, NavGraph.from_mask(np.ones((3, 8), dtype=bool)))
