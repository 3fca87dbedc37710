"""The robot: a body that fits through doors, how it moves, and what it can do."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

from bimnav import _checks
from bimnav.errors import ValueRangeError

__all__ = ["RANGES", "Robot"]

Outline: TypeAlias = tuple[tuple[float, float], ...]

RANGES = {
    "radius": (0.0, 10.0),
    "height": (1e-3, 100.0),
    "speed": (1e-6, 100.0),
    "step_height": (0.0, 1.0),
    "ground_clearance": (0.0, 10.0),
    "max_slope": (0.0, 10.0),
    "max_riser": (0.0, 1.0),
    "reach": (0.0, 100.0),
    "reach_height": (0.0, math.inf),
    "acceleration": (1e-6, math.inf),
    "turn_rate": (1e-6, math.inf),
    "battery_wh": (1e-6, math.inf),
    "drive_power": (0.0, 1e6),
    "idle_power": (0.0, 1e6),
    "work_power": (0.0, 1e6),
    "charge_power": (0.0, 1e6),
}
"""The least and the greatest value of every number of a robot."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot. The default is the point of the paper: it turns and starts at once, and never tires.

    Parameters
    ----------
    name
        How reports and logs call it.
    radius
        Radius of the body in metres; 0 is the point of the paper. With an outline, that of the circle
        around it; then it need not be given.
    height
        Height of the body in metres. What hangs higher than this above the floor does not block.
    speed
        Cruising speed in metres per second.
    step_height
        What the robot drives over, in metres above the floor. Flat things such as rugs, thresholds
        and floor finishes below this height do not block.
    ground_clearance
        Height of the underside of the body in metres; what is higher blocks even if the wheels could climb it.
        None is the step height.
    outline
        Corners (x, y) of the body in metres, x ahead, around the point it turns on; None for a round body.
    max_slope
        Steepest ramp it drives: rise divided by run.
    max_riser
        Highest riser of a stair it climbs, in metres; 0 for a robot that climbs none.
    uses_lifts
        Whether it rides in lifts.
    opens_doors
        Whether it passes doors that are closed and not locked. Automatic doors open for every robot.
    keys
        Names or GlobalIds of the locked doors it may open.
    reach
        How far from its middle, in plan view, it serves a target that it does not drive onto, metres.
    reach_height
        How high above its floor it serves a target, metres.
    acceleration
        When starting and braking, metres per second squared.
    turn_rate
        When turning on the spot, radians per second.
    battery_wh
        What a full battery holds, watt hours.
    drive_power, work_power, idle_power
        What it draws while it drives, works at a stop, and stands, watts.
    charge_power
        What a charger gives it, watts.
    abilities
        Words for what it can do; a stop that needs one is served by robots that have it.

    Raises
    ------
    ValueRangeError
        If a number is outside its range, or an outline is no polygon.
    """

    name: str = "R1"
    radius: float = 0.0
    height: float = 1.0
    speed: float = 0.5
    step_height: float = 0.05
    ground_clearance: float | None = None
    outline: Outline | None = None
    max_slope: float = 0.1
    max_riser: float = 0.0
    uses_lifts: bool = True
    opens_doors: bool = True
    keys: tuple[str, ...] = ()
    reach: float = 3.0
    reach_height: float = math.inf
    acceleration: float = math.inf
    turn_rate: float = math.inf
    battery_wh: float = math.inf
    drive_power: float = 0.0
    work_power: float = 0.0
    idle_power: float = 0.0
    charge_power: float = 0.0
    abilities: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _is_text(self.name):
            self._refuse("name", self.name, "Give a text.")
        for field, (low, high) in RANGES.items():
            value = getattr(self, field)
            is_left_out = value is None and field == "ground_clearance"
            if not is_left_out and not _is_within(value, low, high):
                self._refuse(field, value, f"Give a number from {low:g} to {high:g}.")
        if self.step_height >= self.height:
            raise ValueRangeError(
                f"robot {self.name!r}: step_height {self.step_height} is not below its height {self.height}.",
                "Give a smaller step_height.",
                {"field": "step_height", "value": self.step_height},
            )
        for field in ("keys", "abilities"):
            words = getattr(self, field)
            if isinstance(words, str):
                self._refuse(field, words, f"Give a list: [{words!r}].")
            object.__setattr__(self, field, _checks.many(field, words, str))
        if self.outline is not None:
            self._take_outline(self.outline)

    @property
    def half_width(self) -> float:
        """Half of what the body takes to the sides when it drives straight ahead, metres."""
        return self.radius if self.outline is None else max(abs(y) for _, y in self.outline)

    @property
    def low(self) -> float:
        """Height above the floor from which on things block, metres."""
        return self.step_height if self.ground_clearance is None else min(self.step_height, self.ground_clearance)

    def to_dict(self) -> dict[str, Any]:
        """Return its values by name, ready for JSON; what has no limit is None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: None if value == math.inf else value for name, value in values.items()}

    def _refuse(self, field: str, value: Any, hint: str) -> None:
        raise ValueRangeError(f"robot {self.name!r}: {field} is {value!r}.", hint, {"field": field, "value": value})

    def _take_outline(self, corners: Iterable[Iterable[float]]) -> None:
        """Check the outline, turn it counter-clockwise, and find the circle around it."""
        given = _checks.numbers("outline", corners)
        outline = tuple(map(tuple, given.tolist() if given.ndim == 2 else ()))
        hint = (
            "Give three corners (x, y) or more, in metres, of a polygon that holds (0, 0) and crosses itself nowhere."
        )
        if len(outline) < 3 or not all(len(c) == 2 and all(map(math.isfinite, c)) for c in outline):
            self._refuse("outline", corners, hint)
        import shapely

        polygon = shapely.Polygon(outline)
        if not polygon.is_valid or polygon.area <= 0 or not polygon.covers(shapely.Point(0, 0)):
            self._refuse("outline", corners, hint)
        reach = max(math.hypot(*corner) for corner in outline)
        if reach > RANGES["radius"][1] or 0 < self.radius < reach:
            self._refuse("radius", self.radius, f"The outline reaches {reach:g} m from the point the robot turns on.")
        object.__setattr__(self, "outline", outline if polygon.exterior.is_ccw else outline[::-1])
        object.__setattr__(self, "radius", max(self.radius, reach))


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_within(value: Any, low: float, high: float) -> bool:
    try:
        return bool(low <= value <= high)
    except (TypeError, ValueError):  # not a number
        return False
