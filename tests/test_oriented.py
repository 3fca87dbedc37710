"""Robots that are not round, heading for heading."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav.errors import BimnavError, GoalBlockedError, InputError, NoPathError, StartBlockedError, ValueRangeError
from bimnav.tasks import Task
from bimnav.testing import box, prism, room

TROLLEY = bn.Robot(outline=((-0.5, -0.2), (0.5, -0.2), (0.5, 0.2), (-0.5, 0.2)))


def graph_of(building, robot=TROLLEY, cell_size=0.1):
    environment = bn.make_environment(building, Task("nothing"), robot)
    return bn.build_graph(environment, cell_size=cell_size, connectivity=8)


def with_corridor(width):
    low, high = 2 - width / 2, 2 + width / 2
    return room(8, 4, elements=[box("south", 3, 0, 0, 5, low, 2), box("north", 3, high, 0, 5, 4, 2)])


def test_a_trolley_passes_a_corridor_lengthwise_that_its_circle_does_not_pass():
    graph = graph_of(with_corridor(0.7))
    start, goal = (1.5, 1.95), (6.5, 1.95)
    with pytest.raises(BimnavError):
        bn.find_path(graph, graph.frame.cell_at(*start), graph.frame.cell_at(*goal))
    motion = bn.find_poses(graph, start, goal, heading=math.pi / 2, goal_heading=math.pi / 2)
    check = bn.check_poses(motion.poses, graph.environment)
    check.raise_if_unsafe()
    assert 0 < check.clearance < 0.2
    assert motion.length == pytest.approx(5.0)
    assert motion.turned == pytest.approx(math.pi)
    assert check.checked_length == pytest.approx(motion.length)
    inside = (motion.poses[:, 0] > 2.5) & (motion.poses[:, 0] < 5.5)
    assert not np.sin(motion.poses[inside, 3]).any()


def test_a_corridor_that_is_too_narrow_is_no_way():
    graph = graph_of(with_corridor(0.39))
    with pytest.raises(NoPathError, match="outline"):
        bn.find_poses(graph, (1.5, 2), (6.5, 2))


def test_a_body_that_does_not_fit_is_told_so():
    graph = graph_of(with_corridor(0.7))
    with pytest.raises(StartBlockedError, match="does not fit"):
        bn.find_poses(graph, (4, 2), (6.5, 2), heading=math.pi / 2)
    with pytest.raises(GoalBlockedError):
        bn.find_poses(graph, (1.5, 2), (4, 2), goal_heading=math.pi / 2)
    assert bn.find_poses(graph, (4, 2), (6.5, 2)).length > 2
    with pytest.raises(InputError, match="mask"):
        bn.find_poses(bn.NavGraph.from_mask(np.ones((3, 3))), (0, 0), (1, 1))
    with pytest.raises(ValueRangeError):
        bn.find_poses(graph, (1.5, 2), (4, 2), turn_cost=0)


def test_it_turns_rather_than_drive_backwards_for_long_and_never_if_it_must_not():
    graph = graph_of(room(8, 4))
    back = bn.find_poses(graph, (4, 2), (3.5, 2), heading=0, goal_heading=0)
    assert (back.turned, back.length) == (0, pytest.approx(0.5))
    ahead = bn.find_poses(graph, (4, 2), (3.5, 2), heading=0, goal_heading=0, reverse=math.inf)
    assert ahead.turned == pytest.approx(2 * math.pi)
    for a, b in pairwise(ahead.poses):
        moved = b[:2] - a[:2]
        assert moved @ (math.cos(a[3]), math.sin(a[3])) >= -1e-9


def test_a_closed_cell_is_closed_to_the_middle():
    graph = graph_of(with_corridor(1.6))
    plain = bn.find_poses(graph, (1.5, 2.05), (6.5, 2.05))
    middle = graph.frame.cell_at(4.05, 2.05)
    assert graph.free[middle]
    around = bn.find_poses(graph.block([middle]), (1.5, 2.05), (6.5, 2.05))
    box_ = shapely.box(*graph.frame.box_of(middle)).buffer(-1e-9)
    assert shapely.LineString(plain.poses[:, :2]).intersects(box_)
    assert not shapely.LineString(around.poses[:, :2]).intersects(box_)


def test_the_judge_refuses_what_a_turning_corner_sweeps():
    environment = graph_of(room(8, 4, elements=[box("post", 2.35, 2.35, 0, 2.5, 2.5, 2)])).environment
    straight = [[2.0, 2.0, 0, 0], [2.0, 2.0, 0, 0]]
    turn = [[2.0, 2.0, 0, 0], [2.0, 2.0, 0, math.pi / 2]]
    assert bn.check_poses(straight, environment).ok
    check = bn.check_poses(turn, environment)
    assert [v.kind for v in check.violations] == ["footprint"]
    assert 0 < check.violations[0].depth < 0.2
    assert "teleport" in {v.kind for v in bn.check_poses([[1, 1, 0, 0], [3, 1, 0, 1]], environment).violations}
    assert {v.kind for v in bn.check_poses([[0.3, 2, 0, 0]], environment).violations} >= {"footprint"}
    assert not bn.check_poses(np.empty((0, 4)), environment).ok
    assert not bn.check_poses([[math.nan, 1, 0, 0]], environment).ok


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=12, deadline=None)
def test_no_motion_touches_anything_in_random_worlds(seed):
    rng = np.random.default_rng(seed)
    things = []
    for k in range(rng.integers(1, 6)):
        thing = shapely.box(-rng.uniform(0.01, 0.6), -rng.uniform(0.01, 0.3), 0.1, 0.2)
        thing = shapely.affinity.rotate(thing, rng.uniform(0, 360), origin=(0, 0))
        things.append(prism(f"thing{k}", shapely.affinity.translate(thing, *rng.uniform(0.5, 4.5, 2)), 0, 1))
    corners = [(0.5, -0.15), (0.3, 0.25), (-0.35, 0.2), (-0.3, -0.25)]
    graph = graph_of(room(5, 5, elements=things), bn.Robot(outline=corners))
    for _ in range(3):
        start, goal = rng.uniform(0.6, 4.4, (2, 2)).tolist()
        try:
            motion = bn.find_poses(graph, tuple(start), tuple(goal))
        except (StartBlockedError, GoalBlockedError, NoPathError):
            continue
        bn.check_poses(motion.poses, graph.environment).raise_if_unsafe()
