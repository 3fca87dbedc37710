"""What a robot has in its battery, and where it went."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from bimnav.robot import Robot
from bimnav.sim.track import RobotStatus

__all__ = ["JOULES_PER_WH", "Battery"]

JOULES_PER_WH = 3600.0


@dataclass(slots=True)
class Battery:
    """The battery of one robot in one simulation; joules inside.

    Parameters
    ----------
    robot
        Gives the capacity and what it draws.
    level
        Joules left.
    used, charged
        Joules drawn and given so far.
    """

    robot: Robot
    level: float = math.inf
    used: float = 0.0
    charged: float = 0.0
    powers: dict[RobotStatus, float] = field(init=False)

    def __post_init__(self) -> None:
        self.level = min(self.level, self.capacity)
        idle = self.robot.idle_power
        self.powers = dict.fromkeys(RobotStatus, idle) | {
            RobotStatus.MOVING: self.robot.drive_power,
            RobotStatus.WORKING: self.robot.work_power,
            RobotStatus.CHARGING: 0.0,
            RobotStatus.FAILED: 0.0,
        }

    @property
    def capacity(self) -> float:
        """Joules in a full battery."""
        return self.robot.battery_wh * JOULES_PER_WH

    @property
    def share(self) -> float | None:
        """What is left, 0 to 1; None for a robot that never tires."""
        return None if math.isinf(self.capacity) else max(self.level, 0.0) / self.capacity

    def lasts(self, status: RobotStatus) -> float:
        """Return how many seconds it lasts in a status."""
        power = self.powers[status]
        return max(self.level, 0.0) / power if power > 0 else math.inf

    def spend(self, status: RobotStatus, seconds: float) -> None:
        """Draw what some seconds in a status take."""
        joules = self.powers[status] * seconds
        if status is RobotStatus.CHARGING:
            given = min(self.robot.charge_power * seconds, self.capacity - self.level)
            self.level += given
            self.charged += given
        elif joules:
            joules = min(joules, self.level)  # an empty battery gives nothing
            self.level -= joules
            self.used += joules

    def seconds_to_full(self) -> float:
        """Return how long charging takes; inf for a charger that gives nothing."""
        missing = self.capacity - self.level
        if missing <= 0:
            return 0.0
        return missing / self.robot.charge_power if self.robot.charge_power > 0 else math.inf
