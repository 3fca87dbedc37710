"""A robot at work: it drives, waits, serves, charges, finds another way, and writes down what it does."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import simpy
from numpy.typing import NDArray

from bimnav.grid import Cell
from bimnav.robot import Robot
from bimnav.sim.areas import cut_at
from bimnav.sim.energy import Battery
from bimnav.sim.knowledge import Closure
from bimnav.sim.log import EventKind, new_event
from bimnav.sim.motion import Motion, drive, rest, stand
from bimnav.sim.routes import JOINED, Legs, Line, end_of, legs_of
from bimnav.sim.stretches import Gate, Stretch, gates_of, joined
from bimnav.sim.track import RobotStatus, TrackRecorder

if TYPE_CHECKING:
    from bimnav.plan import Tour
    from bimnav.sim.world import World
    from bimnav.stops import Stop, Unreached

__all__ = ["Errand", "Order", "RobotAgent"]

Process: TypeAlias = Generator[simpy.Event, Any, None]
Step: TypeAlias = Generator[simpy.Event, Any, bool]

_NEXT = "next stop"  # why robots depart, if for nothing else
_RESERVE = 0.1  # of a full battery; a robot that would have less left on arrival at a charger charges first
_GLANCE = 1.0  # seconds after which a robot that makes way looks again
_AHEAD = 1.0  # seconds of free way ahead with which it goes on
_PROGRESS = 1.0  # metres driven in one go, after which a robot is no longer held up by the same thing
_RETRY = 10.0  # seconds after which a robot whose way is closed looks for another


@dataclass(slots=True, eq=False)
class Errand:
    """Something a robot has to do: go somewhere, and serve what is there.

    Parameters
    ----------
    stop
        What to serve; None for a way home, to a charger or out of the way.
    cell, end
        Where to go: the cell, and the exact world point.
    index
        Of the stop among those of the robot; -1 for none.
    leg
        The way there, if it is known.
    purpose
        What the log says on departure.
    """

    stop: Stop | None
    cell: Cell
    end: tuple[float, float, float]
    index: int = -1
    leg: Line | None = None
    purpose: str = _NEXT
    seconds: float | None = None  # of service, once drawn
    is_late: bool = False  # put last because its way was closed
    is_begun: bool = False  # departed for
    charger: str = ""


@dataclass(frozen=True, slots=True)
class Order:
    """Something that a robot heeds as soon as it can."""

    kind: Literal["look", "fail", "leave", "park", "end"]
    cause: str = ""
    seconds: float = math.inf
    closure: Closure | None = None


class RobotAgent:
    """One robot in one simulation."""

    def __init__(self, world: World, index: int, robot: Robot, tour: Tour, rng: np.random.Generator) -> None:
        self.world, self.index, self.robot, self.tour, self.rng = world, index, robot, tour, rng
        self.status = RobotStatus.IDLE
        self.since = float(world.clock.now)
        self.seconds = dict.fromkeys(RobotStatus, 0.0)
        self.place: tuple[float, float, float] = tuple(map(float, tour.start_point))  # type: ignore[assignment]
        self.storey = tour.start.storey
        self.heading: float | None = None
        self.leg_distance = self.distance = self.charge_distance = 0.0
        self.driven = 0.0  # metres in the last motion
        self.battery = Battery(robot)
        self.name, self.tires = robot.name, math.isfinite(robot.battery_wh)
        self.recorder = TrackRecorder()
        self.stops: list[Stop] = list(tour.stops)
        self.served: list[str] = []
        self.agenda: deque[Errand] = deque()
        self.home: Errand | None = None
        self.held: set[str] = set()
        self.orders: list[Order] = []
        self.avoided: Closure | None = None
        self.is_alert = self.is_over = False
        self.cruise = robot.speed
        self.last = float(world.clock.now)
        self.line: Line | None = None  # what is left of the way, as it was when the last stretch began
        self.stuck_since: float | None = None
        self.under_way: tuple[float, Motion] | None = None
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

    # --- the work

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
            yield from self.work_through(self.undisturbed)
        while not self.is_over:
            if self.orders:
                yield from self.obey()
                continue
            errand = self.choose()
            if errand is None:
                self.note("finish", cause="back at the start" if self.tour.return_to_start else "no stop is left")
                self.record()
                yield from self.pause(self.world.clock.event())  # until something new is to be done
            elif errand.purpose == "charge":
                yield from self.charge(errand)
            elif (yield from self.go(errand)):
                if errand.stop is None:
                    self.home = None
                elif errand.stop.kind == "charger":
                    yield from self.recharge(errand)
                else:
                    yield from self.serve(errand)

    def work_through(self, legs: Legs) -> Process:
        """Do every stop of a tour that nothing can disturb: what `go` and `serve` do, without looking around."""
        world, clock, name = self.world, self.world.clock, self.name
        write, pass_time, removable = world.write, world.pass_time, world.removable
        moving, working, idle = RobotStatus.MOVING, RobotStatus.WORKING, RobotStatus.IDLE
        reached = legs.reached()
        times, last = reached / self.robot.speed, legs.edges[1:] - 1
        lengths, durations, storeys = reached[last].tolist(), times[last].tolist(), legs.storeys[last].tolist()
        begins, arrivals, ends = [], [], []
        (x, y, z), floor = self.place, world.storeys[self.storey]
        for stop, length, duration, storey in zip(self.stops, lengths, durations, storeys, strict=False):
            target, called = stop.global_id, stop.name
            begin = clock.now
            write(new_event((begin, name, "depart", moving, floor, x, y, z, target, called, _NEXT, 0.0, None, "")))
            yield pass_time(duration)
            now, (x, y, z), floor = clock.now, stop.end, world.storeys[storey]
            place = (floor, x, y, z, target, called)
            write(new_event((now, name, "arrive", idle, *place, stop.approach, length, None, world.asset_of(stop))))
            write(new_event((now, name, "begin_service", working, *place, "", length, None, "")))
            begins.append(begin)
            arrivals.append(now)
            yield pass_time(world.draw_seconds(self, stop))
            now = clock.now
            write(new_event((now, name, "end_service", idle, *place, "", length, None, "")))
            ends.append(now)
            self.served.append(target)
            if target in removable:
                removable.remove(target)
                write(new_event((now, name, "remove", idle, *place, "served", length, None, "")))
            self.distance += length
        self.place, self.storey, self.leg_distance = (x, y, z), storey, length
        self.last = self.since = now
        self._settle_rounds(begins, arrivals, ends)
        if world.keeps_history:
            self.recorder.add_rounds(legs, times, begins, arrivals)

    def _settle_rounds(self, begins: list[float], arrivals: list[float], ends: list[float]) -> None:
        """Count the time that a tour took, and draw what it takes."""
        moments = np.column_stack([begins, arrivals, ends])
        for moving, working in np.diff(moments, axis=1).tolist():
            for status, seconds in ((RobotStatus.MOVING, moving), (RobotStatus.WORKING, working)):
                self.seconds[status] += seconds
                self.battery.spend(status, seconds)

    def choose(self) -> Errand | None:
        """Return what to do next: the next errand, or to charge before it."""
        while self.agenda:
            errand = self.agenda[0]
            if not self.tires:
                return errand
            charging = self.charge_before(errand)
            if charging is None:
                return errand
            if isinstance(charging, Errand):
                return charging
            self.give_up(errand, charging)
        return self.home

    def obey(self) -> Process:
        """Heed the orders that came, in the order in which they came."""
        orders, self.orders = self.orders, []
        for order in orders:
            if self.is_over:
                return
            if order.kind == "fail":
                yield from self.fail(order.cause, order.seconds)
            elif order.kind == "leave" and order.closure is not None:
                yield from self.leave(order.closure)
            elif order.kind == "park":
                yield from self.park(order.cause)
            elif order.kind == "end":
                self.stop_work(order.cause)

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
        along = _heading(pieces[-1][1].points) if pieces and not takes_time else None
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

    def move(self, group: list[Stretch], after: list[Stretch], errand: Errand) -> Step:
        """Drive stretches in one go, and stop for what comes in the way; answer whether their end was reached."""
        line, limits = joined(group)
        motion = drive(
            line.points,
            line.storeys,
            self.robot,
            speed=self.cruise,
            heading=self.heading,
            limits=limits,
        )
        gates = deque(gates_of(group, motion, self.robot.acceleration))
        begin, passed = float(self.world.clock.now), 0.0
        self.under_way = begin, motion
        self.line = joined([*group, *after])[0] if gates or self.world.is_eventful else None
        is_looking = True
        while True:
            if is_looking:
                incident = self.world.next_incident(self, motion, begin, passed) if self.world.is_eventful else None
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
            facing = _heading(motion.points)
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

    def make_way(self, walker: Any, errand: Errand) -> Process:
        """Stand until somebody has passed, or patience is over."""
        name, begun = walker.person.name, float(self.world.clock.now)
        self.halt(RobotStatus.WAITING, "wait", errand, f"{name} crosses the way")
        line, is_stuck = self.line, self.driven <= JOINED  # one that could not set off looks again a little later
        while line is not None and (is_stuck or not self.world.is_clear(self, line, walker, _AHEAD)):
            is_stuck = False
            if (yield from self.pause(self.world.pass_time(min(_GLANCE, self.battery.lasts(self.status))))):
                return
            self.run_down()
            if float(self.world.clock.now) - begun >= self.world.patience:
                self.avoided = self.world.closure_around(walker)
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

    # --- the battery

    def charge_before(self, errand: Errand) -> Errand | str | None:
        """Return the way to a charger if it is needed before an errand, the reason if the errand cannot be done."""
        self.settle()
        needed = self.world.energy_for(self, errand)
        if needed is None:
            return None  # no way leads there now; the way is looked for when it is needed
        capacity = self.battery.capacity
        if needed <= self.battery.level:
            return None
        if needed > capacity * (1 - 1e-9):
            return f"it takes {needed / capacity:.0%} of a full battery"
        if self.battery.level >= capacity * (1 - 1e-9):
            return None
        charging = self.world.nearest_charger(self)
        if charging is None:
            return f"it takes {needed / capacity:.0%} of a full battery, {self.battery.share:.0%} are left, no charger"
        charging.purpose = "charge"
        return charging

    def charge(self, errand: Errand) -> Process:
        """Go to a charger, wait for it if it is in use, and fill the battery."""
        name = errand.charger
        granted = self.world.claims.request([name])
        if granted is not None:
            self.halt(RobotStatus.WAITING, "wait", errand, f"{self.world.label_of(name)} is in use")
            turned = yield from self.take_turn(granted)
            self.become(RobotStatus.IDLE)
            if not turned:
                return
        if (yield from self.go(errand)):
            yield from self.fill(name, None)
        self.world.claims.release([name])

    def recharge(self, errand: Errand) -> Process:
        """Fill the battery at a charger that the tour visits."""
        stop = errand.stop
        assert stop is not None  # noqa: S101 - a visit is a stop
        granted = self.world.claims.request([stop.global_id])
        if granted is not None:
            self.halt(RobotStatus.WAITING, "wait", errand, f"{self.world.label_of(stop.global_id)} is in use")
            if not (yield from self.take_turn(granted)):
                return
        yield from self.fill(stop.global_id, stop)
        self.world.claims.release([stop.global_id])
        if not self.orders:
            self.agenda.remove(errand)

    def take_turn(self, granted: simpy.Event) -> Step:
        """Wait for a charger as long as the battery lasts; answer whether it is free now."""
        lasting = self.battery.lasts(self.status)
        event = granted if math.isinf(lasting) else granted | self.world.pass_time(lasting)
        disturbed = yield from self.pause(event)
        self.run_down()
        if not disturbed and granted.triggered and not self.orders:
            return True
        self.world.claims.withdraw(granted)
        return False

    def fill(self, name: str, stop: Stop | None) -> Process:
        """Charge until the battery is full, or something is ordered."""
        self.settle()
        seconds, share = self.battery.seconds_to_full(), self.battery.share or 0.0
        self.become(RobotStatus.CHARGING)
        self.note(
            "charge", stop, f"{self.world.label_of(name)}; {share:.0%} are left, {self.leg_distance:.2f} m to get there"
        )
        self.record()
        yield from self.pause(self.world.pass_time(seconds))
        self.become(RobotStatus.IDLE)
        self.note("charged", stop, f"{seconds:.0f} s")

    # --- trouble

    def fail(self, cause: str, repair: float) -> Process:
        """Stand still; hand over what is left, and go on after a repair."""
        self.become(RobotStatus.FAILED)
        self.note("fail", self.agenda[0].stop if self.agenda else None, cause)
        self.record()
        body = self.world.stranded(self)
        if math.isinf(repair):
            self.is_over = True
        self.world.hand_over(self, cause)
        if self.is_over:
            return
        yield self.world.pass_time(repair)
        self.battery.level = max(self.battery.level, 0.0)
        self.become(RobotStatus.IDLE)
        self.note("recover", None, f"repaired after {repair:g} s")
        self.world.open_up(body, f"{self.robot.name} works again")

    def leave(self, zone: Closure) -> Process:
        """Get out of a zone by the shortest way."""
        errand = self.world.way_out(self, [zone])
        if errand is None:
            return
        errand.purpose = f"leaves {zone.name}"
        yield from self.follow_freely(errand)

    def park(self, cause: str) -> Process:
        """Give everything up, and stand where nobody wants to pass."""
        for errand in tuple(self.agenda):
            self.give_up(errand, cause)
        self.home = None
        self.become(RobotStatus.IDLE)
        aside = self.world.parking_for(self)
        if aside is None:
            self.note("park", None, f"{cause}: in nobody's way")
            self.record()
            return
        aside.purpose = cause
        arrived = yield from self.follow_freely(aside)
        self.note("park", None, f"{cause}: off the way out" if arrived else f"{cause}: stopped on the way")
        self.record()

    def follow_freely(self, errand: Errand) -> Step:
        """Follow a line although it leads over closed floor."""
        assert errand.leg is not None  # noqa: S101 - made with a way
        errand.is_begun = False
        while errand.leg is not None and not any(order.kind in ("fail", "end") for order in self.orders):
            later, self.orders = [order for order in self.orders if order.kind != "look"], []
            arrived = yield from self.follow(errand, errand.leg)
            self.orders = later + self.orders
            if arrived:
                return True
        return False

    def stop_work(self, cause: str) -> None:
        """Leave everything that is left undone; nothing more happens."""
        for errand in tuple(self.agenda):
            self.give_up(errand, cause)
        if self.status is not RobotStatus.FAILED:
            self.become(RobotStatus.IDLE)
        self.note("end", None, cause)
        self.record()
        self.is_over = True


def _heading(points: NDArray[np.float64]) -> float | None:
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
