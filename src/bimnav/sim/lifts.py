"""Lifts: a cabin that is called, fetches who waits, and brings them where they want to go."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any

import simpy

from bimnav import _checks
from bimnav.errors import ValueRangeError

__all__ = ["Cabin", "Lift", "Rider"]


@dataclass(frozen=True, slots=True)
class Lift:
    """A lift.

    Parameters
    ----------
    name
        Its GlobalId, or how the log calls it.
    x, y
        Middle of the shaft, world metres.
    reach
        A route that rises more steeply than it goes forward, within this many metres of the middle, rides.
    travel_time
        Seconds from one storey to the next.
    door_time
        Seconds a stop takes: doors open, who leaves and enters does so, doors close.
    capacity
        How many robots fit.
    storey
        Where the cabin waits in the beginning.
    depth
        Metres of a route before and behind the middle of the cabin that belong to the ride: robots wait this far
        away until it has come, and go in and out while it stops.
    """

    name: str
    x: float
    y: float
    reach: float = 1.5
    travel_time: float = 5.0
    door_time: float = 4.0
    capacity: int = 1
    storey: int = 0
    depth: float = 0.0

    def __post_init__(self) -> None:
        _checks.fields(self, numbers="x y reach travel_time door_time depth", wholes="capacity storey", texts="name")
        times = (self.travel_time, self.door_time, self.reach, self.depth)
        if self.capacity < 1 or not all(0 <= value < math.inf for value in times):
            raise ValueRangeError(
                f"lift {self.name!r}: travel_time {self.travel_time}, door_time {self.door_time}, "
                f"reach {self.reach}, depth {self.depth}, capacity {self.capacity}.",
                "Give seconds and metres of 0 or more, and a capacity of at least 1.",
            )


@dataclass(slots=True, eq=False)
class Rider:
    """Somebody who waits for a lift, or rides in it.

    `seconds` is what they take to get in, and again to get out, beside what the doors take.
    """

    origin: int
    goal: int
    boarded: simpy.Event
    arrived: simpy.Event
    seconds: float = 0.0


@dataclass(slots=True)
class Cabin:
    """The moving part of a lift.

    It stops where a rider wants to leave, going on in its direction as long as there is one, and else goes to
    the one who has waited longest. At a stop those who waited longest board first, as many as fit.

    Parameters
    ----------
    lift
        What moves.
    clock
        The simulation's.
    """

    lift: Lift
    clock: simpy.Environment
    storey: int = field(init=False)
    waiting: list[Rider] = field(default_factory=list)
    riding: list[Rider] = field(default_factory=list)
    direction: int = 1
    called: simpy.Event = field(init=False)

    def __post_init__(self) -> None:
        self.storey = self.lift.storey
        self.called = self.clock.event()
        self.clock.process(self.run())

    def call(self, origin: int, goal: int, seconds: float = 0.0) -> Rider:
        """Ask for a ride between two storeys, which takes some seconds to get in and to get out."""
        rider = Rider(origin, goal, self.clock.event(), self.clock.event(), seconds)
        self.waiting.append(rider)
        if not self.called.triggered:
            self.called.succeed()
        return rider

    def withdraw(self, rider: Rider) -> None:
        """Stop waiting; who rides already cannot."""
        if rider in self.waiting:
            self.waiting.remove(rider)

    def run(self) -> Generator[simpy.Event, Any, None]:
        """Fetch and bring, for as long as somebody calls."""
        while True:
            goal = self._next()
            if goal is None:
                self.called = self.clock.event()
                yield self.called
                continue
            if goal != self.storey:
                self.direction = 1 if goal > self.storey else -1
                yield self.clock.timeout(abs(goal - self.storey) * self.lift.travel_time)
                self.storey = goal
            yield from self._stop()

    def _next(self) -> int | None:
        if self.riding:
            goals = [rider.goal for rider in self.riding]
            ahead = [goal for goal in goals if (goal - self.storey) * self.direction > 0]
            return min(ahead or goals, key=lambda goal: (abs(goal - self.storey), goal))
        return self.waiting[0].origin if self.waiting else None

    def _stop(self) -> Generator[simpy.Event, Any, None]:
        leaving = [rider for rider in self.riding if rider.goal == self.storey]
        self.riding = [rider for rider in self.riding if rider.goal != self.storey]
        room = self.lift.capacity - len(self.riding)
        boarding = [rider for rider in self.waiting if rider.origin == self.storey][:room]
        for rider in boarding:
            self.waiting.remove(rider)
            self.riding.append(rider)
            rider.boarded.succeed()
        moving = max((rider.seconds for rider in (*leaving, *boarding)), default=0.0)
        yield self.clock.timeout(self.lift.door_time + moving)
        for rider in leaving:
            rider.arrived.succeed()
