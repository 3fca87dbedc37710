"""A robot as the log knows it: where it is, what it does, what is left in its battery, and what disturbs it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import simpy

from bimnav.robot import Robot
from bimnav.sim.energy import Battery
from bimnav.sim.errands import Order, Process, Step
from bimnav.sim.log import EventKind, new_event
from bimnav.sim.motion import Motion, stand
from bimnav.sim.track import RobotStatus, TrackRecorder

if TYPE_CHECKING:
    from bimnav.sim.world import World
    from bimnav.stops import Stop, Unreached

__all__ = ["Body"]


class Body:
    """What every robot of a simulation has and writes down; it goes nowhere by itself."""

    def __init__(self, world: World, robot: Robot, place: tuple[float, float, float], storey: int) -> None:
        self.world, self.robot, self.name = world, robot, robot.name
        self.place, self.storey = place, storey
        self.heading: float | None = None
        self.status = RobotStatus.IDLE
        self.since = self.last = float(world.clock.now)
        self.seconds = dict.fromkeys(RobotStatus, 0.0)
        self.leg_distance = 0.0
        self.under_way: tuple[float, Motion] | None = None
        self.battery = Battery(robot)
        self.tires = math.isfinite(robot.battery_wh)
        self.recorder = TrackRecorder()
        self.orders: list[Order] = []
        self.is_alert = self.is_over = False
        self.process: simpy.Process

    # --- writing down

    def note(self, event: EventKind, target: Stop | Unreached | None = None, cause: str = "", asset: str = "") -> None:
        """Write an event in the log."""
        world, share = self.world, None
        x, y, z = self.place if self.under_way is None else self.here()
        self.last = now = world.clock.now
        if self.tires:
            self.settle()
            share = self.battery.share
        of, called = ("", "") if target is None else (target.global_id, target.name)
        storey = world.storeys[self.storey]
        row = (now, self.name, event, self.status, storey, x, y, z, of, called, cause, self.leg_distance, share, asset)
        world.write(new_event(row))

    def settle(self) -> None:
        """Draw what the time since the last change of status took from the battery."""
        now = self.world.clock.now
        passed = now - self.since
        if passed:
            self.seconds[self.status] += passed
            self.battery.spend(self.status, passed)
            self.since = now

    def become(self, status: RobotStatus) -> None:
        """Change the status, here and now."""
        self.settle()
        self.status = status

    def record(self, index: int = -1) -> None:
        """Begin a row of the track here and now."""
        if self.world.keeps_history:
            self.recorder.add(float(self.world.clock.now), stand(self.place, self.storey), self.status, index)

    def here(self) -> tuple[float, float, float]:
        """Return where the robot is now, also while it drives."""
        if self.under_way is None:
            return self.place
        begin, motion = self.under_way
        x, y, z = motion.point_at(float(self.world.clock.now) - begin).tolist()
        return x, y, z

    def close_books(self) -> None:
        """Count nothing after the last event."""
        if self.recorder.is_empty and self.world.keeps_history:
            self.record()

    # --- being disturbed

    def disturb(self, order: Order) -> None:
        """Give an order; a robot that can heeds it now, else when what it does is over."""
        if self.is_over:
            return
        self.orders.append(order)
        if self.is_alert:
            self.is_alert = False
            self.process.interrupt()

    def pause(self, event: simpy.Event) -> Step:
        """Wait for an event; answer whether an order came first."""
        if self.orders:
            return True
        self.is_alert = True
        try:
            yield event
        except simpy.Interrupt:
            return True
        self.is_alert = False
        return False

    def rest(self, seconds: float) -> Process:
        """Let time pass, whatever is ordered meanwhile; a battery may run down."""
        lasting = min(seconds, self.battery.lasts(self.status))
        yield self.world.pass_time(lasting)
        self.run_down()

    def run_down(self) -> None:
        """Fail if the battery is empty."""
        if not self.tires:
            return
        self.settle()
        if self.battery.level <= self.battery.capacity * 1e-12 and not any(o.kind == "fail" for o in self.orders):
            self.orders.insert(0, Order("fail", "the battery is empty"))
