"""Speed, acceleration and turning, worked out by hand and by law."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from bimnav.graph import NavGraph
from bimnav.robot import Robot
from bimnav.sim import SpeedLimit
from bimnav.sim.areas import crossings, cut_at
from bimnav.sim.motion import Motion, drive
from bimnav.sim.people import Person, Walker, first_meeting
from bimnav.sim.routes import Line
from bimnav.sim.stretches import cut
from bimnav.sim.track import RobotStatus, TrackRecorder


def line(*points: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    array = np.array([(*point, 0.0)[:3] for point in points], dtype=float)
    return array, np.zeros(len(array), dtype=np.int32)


def track_of(motion: Motion):
    recorder = TrackRecorder()
    recorder.add(0.0, motion, RobotStatus.MOVING, -1)
    return recorder.finish()


def test_a_robot_that_starts_at_once_drives_forty_metres_at_one_metre_per_second_in_forty_seconds():
    # IMO MSC.1/Circ.1533, test 1: a corridor 40 m long at 1 m/s takes 40 s
    assert drive(*line((0, 0), (40, 0)), Robot(speed=1.0)).duration == 40.0


def test_a_walk_of_forty_metres_at_1_33_metres_per_second_takes_26_to_34_seconds():
    # RiMEA 3.0, test 1; here with a pedestrian's acceleration
    assert 26 <= drive(*line((0, 0), (40, 0)), Robot(speed=1.33, acceleration=1.0)).duration <= 34


@pytest.mark.parametrize("points", [[(0, 0, 0), (8, 0, 6)], [(8, 0, 6), (0, 0, 0)]])
def test_a_stair_of_ten_metres_takes_its_slope_length_by_its_speed(points):
    # RiMEA 3.0, tests 2 and 3: within five percent, up and down
    stair = SpeedLimit(shapely.box(-1, -1, 9, 1), 0.5)
    (stretch,) = cut(Line(*line(*points)), (), (), (), (stair,))
    motion = drive(stretch.points, stretch.storeys, Robot(speed=1.33), limits=stretch.limits)
    assert motion.duration == pytest.approx(10 / 0.5, rel=0.05)


def test_speed_over_time_is_a_trapezoid():
    # 0.5 m/s² up to 1 m/s: 2 s and 1 m to start, the same to brake, 8 m at 1 m/s between
    motion = drive(*line((0, 0), (10, 0)), Robot(speed=1.0, acceleration=0.5))
    assert motion.times.tolist() == [0, 2, 10, 12]
    assert motion.points[:, 0].tolist() == [0, 1, 9, 10]
    track = track_of(motion)
    assert track.points_at([1.0, 2.0, 6.0, 11.0])[:, 0] == pytest.approx([0.25, 1.0, 5.0, 9.75])


def test_on_a_short_way_the_trapezoid_is_a_triangle():
    # 1 m at 1 m/s²: half a metre up to 1 m/s, half a metre down, one second each
    motion = drive(*line((0, 0), (1, 0)), Robot(speed=2.0, acceleration=1.0))
    assert motion.times.tolist() == [0, 1, 2]
    assert motion.points[:, 0].tolist() == [0, 0.5, 1]


def test_a_robot_that_turns_on_the_spot_halts_at_corners():
    # two metres: 2 s each at 1 m/s with 1 m/s²... 1 s up, 1 s cruise, 1 s down = 3 s; a quarter turn at pi/4 per s: 2 s
    robot = Robot(speed=1.0, acceleration=1.0, turn_rate=math.pi / 4)
    motion = drive(*line((0, 0), (2, 0), (2, 2)), robot)
    assert motion.duration == pytest.approx(3 + 2 + 3)
    track = track_of(motion)
    assert track.points_at(4.0).tolist() == [2, 0, 0]
    assert float(track.headings_at(4.0)) == pytest.approx(math.pi / 4)
    assert track.headings_at([0.0, 5.0, 8.0]) == pytest.approx([0.0, math.pi / 2, math.pi / 2])


def test_a_robot_turns_first_if_it_faces_another_way_and_the_shorter_way_around():
    robot = Robot(speed=1.0, turn_rate=1.0)
    assert drive(*line((0, 0), (1, 0)), robot, heading=math.pi / 2).duration == pytest.approx(1 + math.pi / 2)
    assert drive(*line((0, 0), (-1, 0)), robot, heading=-3.0).turns[0] == pytest.approx(3.0 - math.pi)


def test_before_a_speed_limit_a_robot_brakes_and_after_it_speeds_up():
    # 1 m/s, 0.5 m/s²; 0.5 m/s from 4 to 6 m: braking takes (1 - 0.25) / 1 = 0.75 m and 1 s
    limit = SpeedLimit(shapely.box(4, -1, 6, 1), 0.5)
    (stretch,) = cut(Line(*line((0, 0), (10, 0))), (), (), (), (limit,))
    motion = drive(stretch.points, stretch.storeys, Robot(speed=1.0, acceleration=0.5), limits=stretch.limits)
    start, brake, slow = 2.0, 1.0, 4.0
    cruise = 4 - 1 - 0.75
    assert motion.duration == pytest.approx(start + cruise + brake + slow + brake + cruise + start)
    moments = np.linspace(0, motion.duration, 2001)
    xs = track_of(motion).points_at(moments)[:, 0]
    speeds = np.diff(xs) / np.diff(moments)
    inside = (xs[:-1] > 4) & (xs[1:] < 6)
    assert speeds[inside].max() <= 0.5 + 1e-9
    assert np.abs(np.diff(speeds)).max() <= 0.5 * (moments[1] - moments[0]) * 1.01


def test_a_robot_that_is_stopped_brakes_along_its_way():
    robot = Robot(speed=1.0, acceleration=0.5)
    motion = drive(*line((0, 0), (10, 0), (10, 5)), robot).halted(9.5, 0.5)
    # at 9.5 s it has driven 8.5 m and drives 1 m/s; it stands after 1 m and 2 s more
    assert motion.duration == pytest.approx(11.5)
    assert motion.points[-1] == pytest.approx([9.5, 0, 0])
    around = drive(*line((0, 0), (10, 0), (10, 5)), robot).halted(10.5, 0.5)
    assert around.points[-1] == pytest.approx([10, 0.5, 0])


# --- laws

coordinates = st.floats(-20, 20).map(lambda value: round(value, 2))


@st.composite
def driven(draw) -> tuple[Motion, Robot, np.ndarray]:
    points = draw(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=6))
    robot = Robot(
        speed=draw(st.floats(0.1, 3)),
        acceleration=draw(st.sampled_from([0.2, 1.0, math.inf])),
        turn_rate=draw(st.sampled_from([0.5, math.inf])),
    )
    points, storeys = line(*points)
    return drive(points, storeys, robot), robot, points


laws = settings(max_examples=80, deadline=None)


@laws
@given(driven())
def test_the_whole_line_is_driven_and_no_limit_broken(case):
    motion, robot, points = case
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    assert motion.length == pytest.approx(length, abs=1e-6)
    assert motion.points[-1] == pytest.approx(points[-1], abs=1e-8)
    assert (np.diff(motion.times) >= 0).all()
    assert motion.duration >= length / robot.speed - 1e-6
    spans = np.diff(motion.times)
    means = np.divide(
        np.linalg.norm(np.diff(motion.points, axis=0), axis=1), spans, out=np.zeros_like(spans), where=spans > 1e-9
    )
    begins, ends = means * motion.eases[:-1], means * (2 - motion.eases[:-1])
    assert max(begins.max(initial=0), ends.max(initial=0)) <= robot.speed * (1 + 1e-6)
    if math.isfinite(robot.acceleration):
        moving = spans > 1e-6
        assert (np.abs(ends - begins)[moving] <= robot.acceleration * spans[moving] * (1 + 1e-6) + 1e-6).all()
        assert begins[:1].max(initial=0) == pytest.approx(0, abs=1e-6)
        assert ends[-1:].max(initial=0) == pytest.approx(0, abs=1e-6)


@laws
@given(driven(), st.floats(0, 1))
def test_a_stop_keeps_what_was_driven_and_needs_the_braking_distance(case, share):
    motion, robot, _ = case
    moment = share * motion.duration
    stopped = motion.halted(moment, robot.acceleration)
    assert stopped.point_at(moment) == pytest.approx(motion.point_at(moment), abs=1e-6)
    assert (np.diff(stopped.times) >= -1e-12).all()
    assert stopped.length <= motion.length + 1e-6
    before = np.linspace(0, moment, 7)
    assert track_of(stopped).points_at(before) == pytest.approx(track_of(motion).points_at(before), abs=1e-6)
    if math.isfinite(robot.acceleration):
        at = float(np.linalg.norm(np.diff(motion.halted(moment, math.inf).points, axis=0), axis=1).sum())
        assert stopped.length - at <= robot.speed**2 / (2 * robot.acceleration) + 1e-6


@laws
@given(driven(), st.lists(st.floats(0, 1), max_size=4))
def test_a_line_cut_in_pieces_is_the_line(case, shares):
    *_, points = case
    storeys = np.zeros(len(points), dtype=np.int32)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    pieces = cut_at(points, storeys, [share * length for share in shares])
    assert pieces[0][0][0] == pytest.approx(points[0])
    assert pieces[-1][0][-1] == pytest.approx(points[-1])
    total = sum(float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum()) for part, _ in pieces)
    assert total == pytest.approx(length, abs=1e-6)
    for (a, _), (b, _) in pairwise(pieces):
        assert a[-1] == pytest.approx(b[0], abs=1e-9)


def test_a_line_through_a_square_is_inside_it_from_edge_to_edge():
    points, storeys = line((0, 0), (10, 0), (10, 10))
    (found,) = crossings(points, storeys, [(shapely.box(8, -1, 12, 4), 0)])
    assert (found.begin, found.end) == pytest.approx((8, 14))
    assert crossings(points, storeys, [(shapely.box(8, -1, 12, 4), 1)]) == []
    assert crossings(points, storeys, [(shapely.box(0, 0, 10, -5), 0)])[0].end == pytest.approx(10)


@given(st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_robot_and_a_person_meet_when_they_first_come_near_and_not_before(seed):
    rng = np.random.default_rng(seed)
    points, storeys = line(*rng.uniform(0, 10, (int(rng.integers(2, 6)), 2)))
    robot = Robot("R", speed=float(rng.uniform(0.5, 2)), acceleration=float(rng.choice([0.5, math.inf])), turn_rate=1.0)
    motion = drive(points, storeys, robot)
    route = tuple(map(tuple, rng.uniform(0, 10, (3, 2)).tolist()))
    person = Person("p", route, speed=float(rng.uniform(0.3, 2)), start=float(rng.uniform(-5, 5)), back_and_forth=True)
    walker = Walker(person, NavGraph.from_mask(np.ones((1, 1), dtype=bool)), rng, 0.0)
    meeting, near = first_meeting(motion, 0.0, walker, 0.8), 0.8
    moments = np.arange(max(person.start, 0.0), motion.duration, 0.01)
    gaps = np.array([math.dist(walker.point_at(t) or (99, 99), motion.point_at(t)[:2]) for t in moments.tolist()])
    if meeting is None:
        closing = (gaps[1:] < near - 0.05) & (np.diff(gaps) < -1e-4) & (gaps[:-1] >= near)
        assert not closing.any()
    else:
        at = math.dist(walker.point_at(meeting) or (99, 99), motion.point_at(meeting)[:2])
        assert at <= near + 0.05
        entering = (gaps[1:] < near - 0.05) & (gaps[:-1] >= near) & (moments[1:] < meeting - 0.02)
        assert not entering.any()
