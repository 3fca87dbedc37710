"""The robot refuses what no robot can be."""

import math

import pytest

from bimnav import Robot
from bimnav.errors import ValueRangeError


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("radius", -0.1),
        ("radius", math.nan),
        ("height", 0),
        ("speed", math.inf),
        ("step_height", 2),
        ("ground_clearance", -1),
        ("max_slope", -0.1),
        ("turn_rate", 0),
        ("battery_wh", 0),
        ("drive_power", math.inf),
        ("keys", "D1"),
        ("outline", [(0, 0), (1, 0)]),
        ("outline", [(0, 0), (1, 1), (1, 0), (0, 1)]),
        ("outline", [(1, 1), (2, 1), (2, 2)]),
        ("outline", [(0, 0), (1, math.nan), (0, 1)]),
    ],
)
def test_a_value_out_of_range_is_refused_by_name(field, value):
    with pytest.raises(ValueRangeError, match=field) as caught:
        Robot(**{field: value})
    assert caught.value.hint


def test_an_outline_gives_the_radius_of_the_circle_around_it():
    robot = Robot(outline=[(-0.3, -0.4), (-0.3, 0.4), (0.3, 0.4), (0.3, -0.4)])
    assert robot.radius == pytest.approx(0.5)
    assert robot.outline[0] == (0.3, -0.4)  # counter-clockwise
    with pytest.raises(ValueRangeError, match="radius"):
        Robot(radius=0.3, outline=robot.outline)


def test_what_blocks_begins_at_the_lower_of_step_and_underside():
    assert Robot().low == 0.05
    assert Robot(ground_clearance=0.03).low == 0.03
    assert Robot(ground_clearance=0.2).low == 0.05


def test_a_robot_can_be_used_as_a_key_and_pickled():
    import pickle

    robot = Robot(keys=["D1"], outline=[(-1, -1), (1, -1), (0, 1)])
    assert pickle.loads(pickle.dumps(robot)) == robot
    assert hash(robot) == hash(pickle.loads(pickle.dumps(robot)))


def test_the_values_of_a_robot_without_limits_are_json():
    import json

    values = json.loads(json.dumps(Robot(outline=[(-1, -1), (1, -1), (0, 1)]).to_dict(), allow_nan=False))
    assert values["turn_rate"] is None
    assert values["step_height"] == 0.05
    assert len(values["outline"]) == 3
