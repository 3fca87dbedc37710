"""What robots do again and again, worked out once: how a way is cut, and how it is driven."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypeAlias

from bimnav.sim.doors import SimDoor
from bimnav.sim.motion import Motion, drive
from bimnav.sim.stretches import Cutter, Stretch

if TYPE_CHECKING:
    from bimnav.robot import Robot
    from bimnav.sim.routes import Line
    from bimnav.sim.setting import Setting

__all__ = ["Rehearsal"]

_MOST = 4096  # ways remembered of each kind, so that memory stays flat; a shift of rounds needs fewer

_Key: TypeAlias = tuple[object, ...]


class Rehearsal:
    """Remembers ways of one simulation; equal lines give the same answer, the very object."""

    def __init__(self, setting: Setting, doors: Iterable[SimDoor]) -> None:
        self.setting = setting
        self._motions: dict[_Key, Motion] = {}
        self.change(doors)

    def change(self, doors: Iterable[SimDoor]) -> None:
        """Forget how ways were cut, because a door changed."""
        given, doors = self.setting, tuple(doors)
        self._cutters = [Cutter(doors, given.passages, lifts, given.limits) for lifts in ((), given.lifts)]
        self._cuts: dict[_Key, list[Stretch]] = {}

    def cut(self, line: Line, *, uses_lifts: bool) -> list[Stretch]:
        """Cut a way where it needs a door, a passage or a lift, and where it is slow."""
        key = (line.points.tobytes(), line.storeys.tobytes(), uses_lifts)
        found = self._cuts.get(key)
        if found is None:
            if len(self._cuts) >= _MOST:
                self._cuts.clear()
            found = self._cuts[key] = self._cutters[uses_lifts].cut(line)
        return found

    def drive(
        self, line: Line, robot: Robot, speed: float, heading: float | None, limits: Sequence[float] | None = None
    ) -> Motion:
        """Plan how a robot drives along a line; see `drive`."""
        limited = None if limits is None else tuple(limits)
        points, storeys = line.points.tobytes(), line.storeys.tobytes()
        key = (points, storeys, robot.acceleration, robot.turn_rate, speed, heading, limited)
        found = self._motions.get(key)
        if found is None:
            if len(self._motions) >= _MOST:
                self._motions.clear()
            found = drive(line.points, line.storeys, robot, speed=speed, heading=heading, limits=limits)
            self._motions[key] = found
        return found
