"""The robot: a body that fits through doors, and how fast it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bimnav.errors import ValueRangeError

__all__ = ["Robot"]


@dataclass(frozen=True, slots=True)
class Robot:
    """A round robot.

    Parameters
    ----------
    name
        How reports and logs call it.
    radius
        Radius of the body in metres; 0 is the point of the paper.
    height
        Height of the body in metres. What hangs higher than this above the floor does not block.
    speed
        Cruising speed in metres per second.
    step_height
        What the robot drives over, in metres above the floor. Flat things such as rugs, thresholds
        and floor finishes below this height do not block.

    Raises
    ------
    ValueRangeError
        If a number is not finite or outside its range.
    """

    name: str = "R1"
    radius: float = 0.0
    height: float = 1.0
    speed: float = 0.5
    step_height: float = 0.05

    def __post_init__(self) -> None:
        for field, value, low, high in (
            ("radius", self.radius, 0.0, 10.0),
            ("height", self.height, 1e-3, 100.0),
            ("speed", self.speed, 1e-6, 100.0),
            ("step_height", self.step_height, 0.0, 1.0),
        ):
            if not (math.isfinite(value) and low <= value <= high):
                raise ValueRangeError(
                    f"robot {self.name!r}: {field} is {value}.",
                    f"Give a number from {low:g} to {high:g}.",
                    {"field": field, "value": value},
                )
        if self.step_height >= self.height:
            raise ValueRangeError(
                f"robot {self.name!r}: step_height {self.step_height} is not below its height {self.height}.",
                "Give a smaller step_height.",
                {"field": "step_height", "value": self.step_height},
            )
