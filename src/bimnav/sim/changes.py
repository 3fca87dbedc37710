"""What may happen to the world while a simulation runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from bimnav import _checks
from bimnav.errors import ValueRangeError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = [
    "Change",
    "DoorLocks",
    "DoorUnlocks",
    "Emergency",
    "ObstacleAppears",
    "ObstacleRemoved",
    "RobotFails",
    "Sensing",
    "TargetReported",
    "ZoneHazardous",
]

_KINDS = {
    "numbers": "time until x y priority repair_time width",
    "wholes": "storey",
    "texts": "name global_id robot",
    "shapes": "polygon",
}


class _Checked:
    """Checks the fields of a change."""

    __slots__ = ()

    def __post_init__(self) -> None:
        has = type(self).__dataclass_fields__  # type: ignore[attr-defined]
        known = {kind: " ".join(name for name in names.split() if name in has) for kind, names in _KINDS.items()}
        _checks.fields(self, **known)
        _checks.number("width of Emergency", getattr(self, "width", 0.0), 0)


@dataclass(frozen=True, slots=True, eq=False)
class ObstacleAppears(_Checked):
    """Something stands where there was floor.

    Parameters
    ----------
    time
        Seconds, on the clock of the log.
    polygon
        Plan view in world coordinates, metres.
    storey
        Index of the storey.
    name
        What the log calls it, and what `ObstacleRemoved` names.
    known
        Whether robots are told. Else the first that senses or touches it tells the others.
    """

    time: float
    polygon: BaseGeometry
    storey: int = 0
    name: str = "obstacle"
    known: bool = True


@dataclass(frozen=True, slots=True)
class ObstacleRemoved(_Checked):
    """An obstacle that appeared is gone, and everybody knows."""

    time: float
    name: str = "obstacle"


@dataclass(frozen=True, slots=True)
class DoorLocks(_Checked):
    """A door is locked; only robots with its key open it."""

    time: float
    global_id: str


@dataclass(frozen=True, slots=True)
class DoorUnlocks(_Checked):
    """A door is no longer locked: it is closed, and opens for robots that open doors."""

    time: float
    global_id: str


@dataclass(frozen=True, slots=True)
class TargetReported(_Checked):
    """There is something more to do; the robot that gets there with the shortest detour does it.

    Parameters
    ----------
    time
        Seconds, on the clock of the log.
    name
        What the log calls it.
    x, y
        World point, metres.
    storey
        Index of the storey.
    global_id
        Its identity; the name if it has none.
    priority
        What matters more is done before it, and what matters less behind it.
    """

    time: float
    name: str
    x: float
    y: float
    storey: int = 0
    global_id: str = ""
    priority: float = 1.0


@dataclass(frozen=True, slots=True)
class RobotFails(_Checked):
    """A robot stands still; others take over what it had to do, and drive around it.

    Parameters
    ----------
    time
        Seconds, on the clock of the log.
    robot
        Its name.
    repair_time
        Seconds until it works again; inf for never.
    """

    time: float
    robot: str
    repair_time: float = math.inf


@dataclass(frozen=True, slots=True, eq=False)
class ZoneHazardous(_Checked):
    """Floor that no robot may enter; who is on it leaves by the shortest way.

    Parameters
    ----------
    time, until
        Seconds, on the clock of the log; inf for ever.
    polygon
        Plan view in world coordinates, metres.
    storey
        Index of the storey.
    name
        What the log calls it.
    """

    time: float
    polygon: BaseGeometry
    storey: int = 0
    name: str = "hazard"
    until: float = math.inf


@dataclass(frozen=True, slots=True)
class Emergency(_Checked):
    """People leave the building: robots clear the way out, and stay where they are in nobody's way.

    Parameters
    ----------
    time
        Seconds, on the clock of the log.
    name
        What the log calls it.
    width
        What is kept clear for people along the ways out, metres.
    """

    time: float
    name: str = "emergency"
    width: float = 1.2


Change: TypeAlias = (
    ObstacleAppears
    | ObstacleRemoved
    | DoorLocks
    | DoorUnlocks
    | TargetReported
    | RobotFails
    | ZoneHazardous
    | Emergency
)


@dataclass(frozen=True, slots=True)
class Sensing:
    """How robots find obstacles that nobody told them of.

    Parameters
    ----------
    range
        How far a robot sees, metres from its middle, through whatever stands between.
    probability
        Of finding an obstacle within range at one look.
    period
        Seconds between looks.
    """

    range: float = 3.0
    probability: float = 1.0
    period: float = 1.0

    def __post_init__(self) -> None:
        _checks.fields(self, numbers="range probability period")
        if not (0 <= self.range < math.inf and 0 <= self.probability <= 1 and 0 < self.period < math.inf):
            raise ValueRangeError(
                f"sensing has range {self.range}, probability {self.probability}, period {self.period}.",
                "Give metres from 0, a probability from 0 to 1, and seconds above 0.",
            )
