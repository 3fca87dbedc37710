"""A robot that drives: along a line, through doors and lifts, and to a stand for what comes in the way."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np
import simpy
from numpy.typing import NDArray

from bimnav.robot import Robot
from bimnav.sim.areas import cut_at
from bimnav.sim.body import Body
from bimnav.sim.errands import Errand, Order, Process, Step
from bimnav.sim.incidents import closure_around
from bimnav.sim.knowledge import Closure
from bimnav.sim.log import EventKind
from bimnav.sim.motion import Motion, rest, stand
from bimnav.sim.people import Walker
from bimnav.sim.routes import JOINED, Line
from bimnav.sim.stretches import Gate, Stretch, gates_of, joined
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    from bimnav.sim.world import World

__all__ = ["Driver", "heading_behind"]

_GLANCE = 1.0  # seconds after which a robot that makes way looks again
_AHEAD = 1.0  # seconds of free way ahead with which it goes on
_PROGRESS = 1.0  # metres driven in one go, after which a robot is no longer held up by the same thing


class Driver(Body):
    """A robot that follows lines, from stretch to stretch."""

    def __init__(
        self,
        world: World,
        index: int,
        robot: Robot,
        rng: np.random.Generator,
        place: tuple[float, float, float],
        storey: int,
    ) -> None:
        super().__init__(world, robot, place, storey)
        self.index, self.rng = index, rng
        self.distance = self.charge_distance = 0.0
        self.driven = 0.0  # metres in the last motion
        self.cruise = robot.speed
        self.held: set[str] = set()
        self.avoided: Closure | None = None
        self.line: Line | None = None  # what is left of the way, as it was when the last stretch began
        self.stuck_since: float | None = None

    def follow(self, errand: Errand, leg: Line) -> Step:
        """Drive along a line, stretch by stretch; answer whether the end was reached."""
        before = self.status
        if before is not RobotStatus.MOVING:
            self.become(RobotStatus.MOVING)
        if not errand.is_begun:
            errand.is_begun, self.leg_distance = True, 0.0
            self.cruise = self.world.speed_of(self)
            self.note("depart", errand.stop, errand.purpose)
        elif before is not RobotStatus.MOVING:
            self.note("resume", errand.stop)
        stretches = self.world.stretches(self, leg)
        while stretches:
            if len(stretches) > 1 or self.held or stretches[0].needs:
                entered = yield from self.enter(stretches[0], errand)
                if not entered:
                    errand.leg = joined(stretches)[0]
                    return False
            ahead = 1 if stretches[0].lift is not None else self.world.passable(self, stretches)
            group, stretches = stretches[:ahead], stretches[ahead:]
            if group[0].lift is not None:
                yield from self.ride(group[0], errand)
                done = True
            else:
                done = yield from self.move(group, stretches, errand)
            if not done or (self.orders and stretches):
                errand.leg = joined(stretches)[0] if done else self.line
                return False
        self.avoided = None
        errand.leg = None
        self.place = errand.end
        self.storey = int(leg.storeys[-1])
        yield from self.turn_to(errand)
        self.become(RobotStatus.IDLE)
        asset = self.world.asset_of(errand.stop) if errand.stop else ""
        self.note("arrive", errand.stop, errand.stop.approach if errand.stop else "", asset)
        return True

    def turn_to(self, errand: Errand) -> Process:
        """Face the way a stop asks for, before the work begins; a robot without a turn rate does so at once."""
        wanted = None if errand.stop is None else errand.stop.heading
        takes_time = math.isfinite(self.robot.turn_rate)
        if wanted is None or not (self.world.keeps_history or takes_time):
            return
        pieces = self.recorder.pieces
        along = heading_behind(pieces[-1][1].points) if pieces and not takes_time else None
        facing = self.heading if along is None else along
        if facing is None:  # one that turns slowly and has not moved faces the right way
            facing = wanted if takes_time else 0.0
        turn = math.remainder(wanted - facing, 2 * math.pi)
        seconds = abs(turn) / self.robot.turn_rate
        if turn and self.world.keeps_history:
            motion = stand(self.place, self.storey, turn, seconds)
            self.recorder.add(float(self.world.clock.now), motion, self.status, errand.index)
        if turn and takes_time:
            yield from self.rest(seconds)
        self.heading = wanted

    # --- what others use, too

    def enter(self, stretch: Stretch, errand: Errand) -> Step:
        """Get hold of what a stretch needs, and let go of what it does not; answer whether it may be entered."""
        claims = self.world.claims
        self.keep(stretch.needs)
        wanted = sorted(stretch.needs - self.held)
        if not wanted:
            return True
        granted = claims.request(wanted)
        if granted is not None:
            names = ", ".join(self.world.label_of(name) for name in wanted)
            self.halt(RobotStatus.WAITING, "wait", errand, f"{names} is in use")
            if not (yield from self.wait_for(granted, stretch, names)):
                return False
            self.resume(errand)
        self.held.update(wanted)
        for door in stretch.doors:
            if door.global_id in wanted and door.state != "open" and door.opening_time > 0:
                self.halt(RobotStatus.WAITING, "open_door", errand, f"{door.label} is {door.state}")
                yield from self.rest(door.opening_time)
                self.resume(errand)
        return not self.orders

    def keep(self, needs: frozenset[str]) -> None:
        """Let go of what is held, but for what is needed still."""
        left, self.held = sorted(self.held - needs), self.held & needs
        if left:
            self.world.claims.release(left)

    def wait_for(self, granted: simpy.Event, stretch: Stretch, names: str) -> Step:
        """Wait for resources as long as patience lasts."""
        patience = min(self.world.patience, self.battery.lasts(RobotStatus.WAITING))
        if math.isfinite(patience):
            event: simpy.Event = granted | self.world.pass_time(patience)
        else:
            event = granted
        disturbed = yield from self.pause(event)
        if not disturbed and granted.triggered:
            return True
        self.world.claims.withdraw(granted)
        self.run_down()
        if not disturbed and not self.orders:
            self.stuck_since = float(self.world.clock.now) - patience
            self.avoided = Closure(f"{names}, in use", stretch.area, stretch.storey, is_held=True)
        return False

    def halt(self, status: RobotStatus, event: EventKind, errand: Errand, cause: str) -> None:
        """Stand on the way to an errand, and say why."""
        self.become(status)
        self.note(event, errand.stop, cause)
        self.record(errand.index)

    def resume(self, errand: Errand) -> None:
        """Go on."""
        self.become(RobotStatus.MOVING)
        self.note("resume", errand.stop)

    # --- in motion

    def move(self, group: list[Stretch], after: list[Stretch], errand: Errand) -> Step:
        """Drive stretches in one go, and stop for what comes in the way; answer whether their end was reached."""
        line, limits = joined(group)
        motion = self.world.rehearsal.drive(line, self.robot, self.cruise, self.heading, limits)
        gates = deque(gates_of(group, motion, self.robot.acceleration))
        begin, passed = float(self.world.clock.now), 0.0
        self.under_way = begin, motion
        self.line = joined([*group, *after])[0] if gates or self.world.is_eventful else None
        is_looking = True
        while True:
            if is_looking:
                incident = (
                    self.world.lookout.next_incident(self, motion, begin, passed) if self.world.is_eventful else None
                )
            until = motion.duration if incident is None else incident.seconds
            at_gate = bool(gates) and gates[0].seconds < until
            until = gates[0].seconds if at_gate else until
            disturbed = yield from self.pause(self.world.pass_time(max(until - passed, 0.0)))
            passed = min(float(self.world.clock.now) - begin, motion.duration) if disturbed else until
            is_looking = not at_gate or disturbed
            if at_gate and not disturbed:
                if self.go_through(gates.popleft()):
                    continue
                done = yield from self.brake(begin, motion, passed, errand, sudden=False)
                self.keep(_held_at(group, self.driven))
                return done
            if not disturbed and incident is None:
                self.arrive(begin, motion, errand)
                return True
            if disturbed and all(order.kind == "look" for order in self.orders):
                self.orders.clear()
                if self.world.in_way(self, self.remainder(motion, passed)) is None:
                    continue
            elif not disturbed and incident is not None and incident.reveals is not None:
                self.world.reveal(self, incident)
                if incident.kind == "sense" and self.world.in_way(self, self.remainder(motion, passed)) is None:
                    continue
            sudden = incident is not None and not disturbed and incident.kind in ("contact", "battery")
            done = yield from self.brake(begin, motion, passed, errand, sudden=sudden)
            if len(group) > 1:
                self.keep(_held_at(group, self.driven))
            if not disturbed and incident is not None:
                if incident.kind == "battery":
                    self.settle()
                    self.orders.insert(0, Order("fail", "the battery is empty"))
                elif incident.walker is not None and not done:
                    yield from self.make_way(incident.walker, errand)
            return done

    def go_through(self, gate: Gate) -> bool:
        """Claim what lies ahead if it is free, or let go of what lies behind; answer whether to go on."""
        if gate.is_exit:
            self.keep(gate.needs)
            return True
        wanted = sorted(gate.needs - self.held)
        if not self.world.claims.take(wanted):
            return False
        self.held.update(wanted)
        return True

    def arrive(self, begin: float, motion: Motion, errand: Errand) -> None:
        """Be where a motion ended."""
        self.under_way = None
        self.driven = motion.length
        if self.world.keeps_history:
            self.recorder.add(begin, motion, self.status, errand.index)
        if motion.length > _PROGRESS:
            self.stuck_since = None
        self.distance += motion.length
        self.leg_distance += motion.length
        if errand.purpose == "charge" or (errand.stop is not None and errand.stop.kind == "charger"):
            self.charge_distance += motion.length
        x, y, z = motion.points[-1].tolist()
        self.place, self.storey = (x, y, z), motion.storeys.item(-1)
        if not math.isinf(self.robot.turn_rate):
            facing = heading_behind(motion.points)
            self.heading = self.heading if facing is None else facing

    def brake(self, begin: float, motion: Motion, passed: float, errand: Errand, *, sudden: bool) -> Step:
        """Come to a stand from some seconds into a motion; answer whether that was its end anyway."""
        executed = motion.halted(passed, math.inf if sudden else self.robot.acceleration)
        line = self.line
        self.arrive(begin, executed, errand)
        if executed.duration > passed:
            self.under_way = begin, executed
            yield from self.rest(executed.duration - passed)
            self.under_way = None
        if line is not None:
            pieces = cut_at(line.points, line.storeys, [executed.length])
            self.line = Line(*pieces[-1]) if executed.length > JOINED else line
        return motion.length - executed.length <= JOINED

    def remainder(self, motion: Motion, passed: float) -> Line:
        """Return what is left of the way some seconds into a motion."""
        assert self.line is not None  # noqa: S101 - kept whenever something may come in the way
        driven = motion.halted(passed, math.inf).length
        return Line(*cut_at(self.line.points, self.line.storeys, [driven])[-1]) if driven > JOINED else self.line

    def make_way(self, walker: Walker, errand: Errand) -> Process:
        """Stand until somebody has passed, or patience is over."""
        name, begun = walker.person.name, float(self.world.clock.now)
        self.halt(RobotStatus.WAITING, "wait", errand, f"{name} crosses the way")
        line, is_stuck = self.line, self.driven <= JOINED  # one that could not set off looks again a little later
        while line is not None and (is_stuck or not self.world.lookout.is_clear(self, line, walker, _AHEAD)):
            is_stuck = False
            if (yield from self.pause(self.world.pass_time(min(_GLANCE, self.battery.lasts(self.status))))):
                return
            self.run_down()
            if float(self.world.clock.now) - begun >= self.world.patience:
                self.avoided = closure_around(walker, float(self.world.clock.now))
                return
        self.resume(errand)

    def ride(self, stretch: Stretch, errand: Errand) -> Process:
        """Take a lift from one storey to another."""
        cabin = self.world.cabins[stretch.lift or ""]
        goal = int(stretch.storeys[-1])
        self.halt(RobotStatus.WAITING, "call_lift", errand, cabin.lift.name)
        level = float(np.linalg.norm(np.diff(stretch.points[:, :2], axis=0), axis=1).sum())  # into the cabin and out
        rider = cabin.call(self.storey, goal, level / 2 / self.cruise)
        yield rider.boarded
        begin = float(self.world.clock.now)
        self.note("board_lift", errand.stop, cabin.lift.name)
        yield rider.arrived
        if self.world.keeps_history:
            carried = rest(stretch.points, stretch.storeys, float(self.world.clock.now) - begin)
            self.recorder.add(begin, carried, self.status, errand.index)
        x, y, z = stretch.points[-1].tolist()
        self.place, self.storey = (x, y, z), goal
        self.distance += level
        self.leg_distance += level
        self.become(RobotStatus.MOVING)
        self.note("leave_lift", errand.stop, cabin.lift.name)
        self.run_down()


def heading_behind(points: NDArray[np.float64]) -> float | None:
    """Return the direction of the last piece of a line in plan view, radians; None if it has none."""
    for dx, dy in np.diff(points[:, :2], axis=0)[::-1].tolist():
        if math.hypot(dx, dy) > JOINED:
            return math.atan2(dy, dx)
    return None


def _held_at(group: list[Stretch], driven: float) -> frozenset[str]:
    """Return what is needed where a robot stands that has driven some metres into stretches."""
    done = 0.0
    for stretch in group:
        done += stretch.length
        if driven <= done + JOINED:
            return stretch.needs
    return group[-1].needs
