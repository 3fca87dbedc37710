"""A robot at work: it does one errand after the other, finds another way, serves, and gives up."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from bimnav.robot import Robot
from bimnav.sim.charging import charge, charge_before, recharge
from bimnav.sim.driving import Driver
from bimnav.sim.errands import Errand, Process, Step
from bimnav.sim.knowledge import Closure
from bimnav.sim.orders import obey
from bimnav.sim.rounds import work_through
from bimnav.sim.routes import JOINED, Legs, Line, end_of, legs_of
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    from bimnav.plan import Tour
    from bimnav.sim.world import World
    from bimnav.stops import Stop

__all__ = ["RobotAgent"]

_RETRY = 10.0  # seconds after which a robot whose way is closed looks for another


class RobotAgent(Driver):
    """One robot in one simulation, with a tour to do."""

    def __init__(self, world: World, index: int, robot: Robot, tour: Tour, rng: np.random.Generator) -> None:
        x, y, z = map(float, tour.start_point)
        super().__init__(world, index, robot, rng, (x, y, z), tour.start.storey)
        self.tour = tour
        self.stops: list[Stop] = list(tour.stops)
        self.served: list[str] = []
        self.agenda: deque[Errand] = deque()
        self.home: Errand | None = None
        self.undisturbed: Legs | None = None  # what is done in one go
        self._take(tour)
        self.process = world.clock.process(self.execute())

    def _take(self, tour: Tour) -> None:
        legs = legs_of(tour)
        if self.stops and self.world.is_undisturbed(self):
            self.undisturbed = legs
        else:
            for k, stop in enumerate(tour.stops):
                self.agenda.append(Errand(stop, stop.cell, stop.end, k, legs.line(k)))
        if len(legs) > len(tour.stops):
            self.home = self.homeward(legs.line(len(legs) - 1))

    def homeward(self, leg: Line | None = None) -> Errand:
        """Return the way to where the tour ends behind its last stop."""
        purpose = "return to the start" if self.tour.return_to_start else "to the end of the tour"
        return Errand(None, *end_of(self.tour), -1, leg, purpose)

    def execute(self) -> Process:
        """Do one errand after the other, and whatever is ordered."""
        delay = self.world.delay_of(self.index)
        if delay > 0:
            self.record()
            yield self.world.pass_time(delay)
            self.settle()
        self.note("start")
        for lost in self.tour.unreached:
            self.note("unreached", lost, lost.reason)
        if self.undisturbed is not None:
            yield from work_through(self, self.undisturbed)
        while not self.is_over:
            if self.orders:
                yield from obey(self)
                continue
            errand = self.choose()
            if errand is None:
                self.note("finish", cause="back at the start" if self.tour.return_to_start else "no stop is left")
                self.record()
                yield from self.pause(self.world.clock.event())  # until something new is to be done
            elif errand.purpose == "charge":
                yield from charge(self, errand)
            elif (yield from self.go(errand)):
                if errand.stop is None:
                    self.home = None
                elif errand.stop.kind == "charger":
                    yield from recharge(self, errand)
                else:
                    yield from self.serve(errand)

    def choose(self) -> Errand | None:
        """Return what to do next: the next errand, or to charge before it."""
        while self.agenda:
            errand = self.agenda[0]
            if not self.tires:
                return errand
            charging = charge_before(self, errand)
            if charging is None:
                return errand
            if isinstance(charging, Errand):
                return charging
            self.give_up(errand, charging)
        return self.home

    # --- going somewhere

    def go(self, errand: Errand) -> Step:
        """Go where an errand is; answer whether the robot arrived."""
        while not self.orders:
            if errand.leg is not None and math.dist(errand.leg.points[0].tolist(), self.place) > JOINED:
                errand.leg = None
            obstacle = self.world.in_way(self, errand.leg) if errand.leg is not None else None
            if errand.leg is None or obstacle is not None:
                if not (yield from self.find_way(errand, obstacle)):
                    return False
            elif (yield from self.follow(errand, errand.leg)):
                return True
        return False

    def find_way(self, errand: Errand, obstacle: Closure | None) -> Step:
        """Find another way, wait, or give the errand up, as the policy says; answer whether to go on."""
        decision = "replan" if obstacle is None else self.world.decide(self, errand, obstacle)
        if decision == "replan":
            line = self.world.find_line(self, errand)
            if line is not None and self.world.in_way(self, line) is None:
                if obstacle is not None and errand.leg is not None:
                    change = line.length - errand.leg.length
                    self.note("replan", errand.stop, f"{obstacle.name} is in the way; the other way is {change:+.2f} m")
                errand.leg = line
                return True
            obstacle = obstacle or self.world.closure_of(self, errand)
            others = [other for other in self.agenda if other is not errand and not other.is_late]
            if errand.stop is not None and others and not errand.is_late:
                errand.is_late = True
                self.agenda.remove(errand)
                self.agenda.append(errand)
                self.avoided = None
                self.note("replan", errand.stop, f"{self._closed_by(obstacle)}; it comes last")
                return False
        cause, now = self._closed_by(obstacle), float(self.world.clock.now)
        self.stuck_since = now if self.stuck_since is None else self.stuck_since
        left = self.stuck_since + self.world.patience - now
        if decision == "give up" or left <= 0:
            self.give_up(errand, cause if decision == "give up" else f"{cause} for {self.world.patience:g} s")
            return False
        if self.status is not RobotStatus.BLOCKED:
            self.become(RobotStatus.BLOCKED)
            self.note("block", errand.stop, f"{cause}; waits")
            self.record(errand.index)
        self.avoided = None
        spell = min(left, _RETRY, self.battery.lasts(RobotStatus.BLOCKED))
        disturbed = yield from self.pause(self.world.pass_time(spell))
        self.run_down()
        if disturbed and all(order.kind == "look" for order in self.orders):
            self.orders.clear()
        return not self.orders

    def _closed_by(self, obstacle: Closure | None) -> str:
        return f"{obstacle.name} closes the way" if obstacle is not None else "no way leads there"

    # --- at a stop

    def serve(self, errand: Errand) -> Process:
        """Work at a stop; litter is gone when it was served."""
        stop = errand.stop
        assert stop is not None  # noqa: S101 - only errands with a stop are served
        self.become(RobotStatus.WORKING)
        self.note("begin_service", stop)
        self.record(errand.index)
        seconds = self.world.seconds_at(self, errand)
        short = self.battery.lasts(RobotStatus.WORKING) < seconds
        wait = self.battery.lasts(RobotStatus.WORKING) if short else seconds
        done = not (yield from self.pause(self.world.pass_time(wait))) and not short
        if not (done or short):
            done = float(self.world.clock.now) - self.since >= seconds
        self.become(RobotStatus.IDLE)
        self.run_down()
        if not done:
            return
        self.agenda.remove(errand)
        self.served.append(stop.global_id)
        self.note("end_service", stop)
        if stop.global_id in self.world.removable:
            self.world.removable.remove(stop.global_id)
            self.note("remove", stop, "served")

    def give_up(self, errand: Errand, cause: str) -> None:
        """Leave something undone, and say why."""
        if errand in self.agenda:
            self.agenda.remove(errand)
        elif errand is self.home:
            self.home = None
        self.avoided = None
        self.become(RobotStatus.IDLE)
        self.note("give_up", errand.stop, cause)
        if errand.stop is not None and errand.stop.kind == "target":
            self.world.given_up.append(errand.stop.global_id)
