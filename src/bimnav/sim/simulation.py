"""The simulation: a robot that drives its tour, and the world it changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
import simpy
from numpy.typing import NDArray

from bimnav.errors import SimulationError, ValueRangeError
from bimnav.robot import Robot
from bimnav.sim.log import Event, EventKind, EventLog
from bimnav.sim.track import RobotState, RobotStatus, Track, TrackRecorder

if TYPE_CHECKING:
    from bimnav.grid import GridFrame
    from bimnav.plan import Tour
    from bimnav.stops import Stop, Unreached

__all__ = ["ServiceTime", "SimResult", "simulate"]

Process: TypeAlias = Generator[simpy.Event, Any, None]

_LATEST = 1e10  # seconds; later, float64 no longer holds two microseconds
_JOINED = 1e-6  # metres between the end of one leg and the start of the next


class ServiceTime(Protocol):
    """How long, in seconds, a robot stays at a stop."""

    def __call__(self, robot: Robot, stop: Stop, rng: np.random.Generator, /) -> float:
        """Return seconds, finite and not below 0."""
        ...


@dataclass(frozen=True, eq=False)
class SimResult:
    """What happened when a tour was played.

    Parameters
    ----------
    robot
        The robot that drove.
    tour
        What it was told to do.
    log
        Every event.
    track
        Where it was, and what it did, at every moment.
    targets
        GlobalIds of all targets of the world, in tour or not.
    storeys
        Names of the storeys, by index.
    """

    robot: Robot
    tour: Tour
    log: EventLog
    track: Track
    targets: tuple[str, ...]
    storeys: tuple[str, ...]

    def __repr__(self) -> str:
        return (
            f"SimResult({self.robot.name!r}: {len(self.served)} of {len(self.targets)} targets served, "
            f"{self.distance:.2f} m in {self.makespan:.1f} s, {len(self.log)} events)"
        )

    @property
    def makespan(self) -> float:
        """Seconds from the start to the last event."""
        return float(self.track.times[-1] - self.track.times[0])

    @property
    def distance(self) -> float:
        """Metres driven."""
        return float(self.track.lengths.sum())

    @cached_property
    def served(self) -> tuple[str, ...]:
        """GlobalIds of the targets that were served, in that order."""
        return tuple(dict.fromkeys(row.target for row in self.log if row.event == "end_service"))

    @property
    def metrics(self) -> dict[str, float]:
        """Makespan and seconds in every status, metres driven, numbers of targets served and unreached."""
        return {
            "makespan": self.makespan,
            "distance": self.distance,
            **{str(status): self.track.seconds_in(status) for status in RobotStatus},
            "served": len(self.served),
            "unreached": len(self.tour.unreached),
        }

    def state_at(self, time: float) -> RobotState:
        """Return what the robot does at a time, and where.

        Before the start and after the end the robot stands where it started and ended. At the time of an
        event the state is the one after it.

        Parameters
        ----------
        time
            Seconds, on the clock of the log.
        """
        if math.isnan(time):
            raise ValueRangeError("the time is not a number.", "Give seconds.")
        track, row = self.track, int(self.track.rows_at(time))
        x, y, z = track.points_at(time).tolist()
        early = time < track.times[0]
        stop = -1 if early else int(track.stops[row])
        return RobotState(
            time,
            self.robot.name,
            RobotStatus.IDLE if early else RobotStatus(str(track.statuses[row])),
            x,
            y,
            z,
            float(track.headings[row]),
            self.storeys[track.storeys[row]],
            self.tour.stops[stop].global_id if stop >= 0 else "",
        )

    def present_targets(self, time: float) -> tuple[str, ...]:
        """Return the GlobalIds of the targets that are still there at a time; what was served is gone."""
        gone = {row.target for row in self.log if row.event == "remove" and row.time <= time}
        return tuple(target for target in self.targets if target not in gone)

    def trajectory(self, step: float | None = None) -> NDArray[Any]:
        """Return the motion as a table.

        Parameters
        ----------
        step
            Seconds between rows; None for a row wherever the motion changes.

        Returns
        -------
        table : (n,) structured
            Fields `time` (s), `x`, `y`, `z` (m), `heading` (rad) and `status` (text); times rise, and the
            last row is the end.
        """
        return self.track.trajectory(step)

    def route_rows(self) -> list[tuple[float, float, str, float]]:
        """Return `(x, y, storey, time)` wherever the motion changes, in execution order: m, name, s."""
        kept = self.track.kept_rows()
        columns = self.track.points[kept, :2], self.track.storeys[kept], self.track.times[kept]
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return [(x, y, self.storeys[storey], time) for (x, y), storey, time in rows]


def simulate(
    tour: Tour,
    *,
    robot: Robot | None = None,
    service_time: ServiceTime | float | None = None,
    rng: np.random.Generator | None = None,
    start_time: float = 0.0,
) -> SimResult:
    """Play a tour in simulated time.

    The robot drives every leg at its speed, along the exact route, and works at every stop. A target that
    was served is gone from the world.

    Parameters
    ----------
    tour
        What to do; `plan_tour` makes one.
    robot
        Who does it. The default is the robot the environment was made for.
    service_time
        Seconds at every stop, or a function of robot, stop and generator. The default is what the task
        says, else 0.
    rng
        Source of chance for `service_time`. The default is a fixed one, so that equal inputs give equal
        logs; pass your own to vary them.
    start_time
        Seconds on the clock when the robot starts.

    Raises
    ------
    SimulationError
        If a service time is no finite number of seconds from 0 on, or the route has gaps.
    ValueRangeError
        If the start time is not finite or too far from 0.
    """
    if not abs(start_time) <= _LATEST:
        raise ValueRangeError(
            f"start_time is {start_time}.",
            f"Give seconds from {-_LATEST:g} to {_LATEST:g}.",
            {"start_time": start_time},
        )
    environment = tour.graph.environment
    if robot is None:
        robot = Robot() if environment is None else environment.robot
    if service_time is None:
        service_time = environment.task.service_time if environment is not None else 0.0
    rng = rng or np.random.default_rng(0)

    targets = _targets_of(tour)
    removable = targets if environment is None or environment.task.removes_targets else ()
    world = _World(simpy.Environment(start_time), tour.graph.frame, _storey_names(tour), set(removable))
    agent = _RobotAgent(robot, world, tour.start_point, tour.start.storey)
    world.clock.process(agent.execute(tour, lambda stop: _seconds_at(stop, robot, service_time, rng)))
    world.clock.run()
    return SimResult(robot, tour, EventLog(tuple(world.log)), agent.recorder.finish(), targets, world.storeys)


@dataclass(slots=True)
class _World:
    """What all agents share: the clock, the targets that are still there, and the log."""

    clock: simpy.Environment
    frame: GridFrame
    storeys: tuple[str, ...]
    removable: set[str]  # targets still there that are taken away when served; asked and emptied, never iterated
    log: list[Event] = field(default_factory=list)

    def pass_time(self, seconds: float) -> simpy.Event:
        """Return the event that this many seconds have passed."""
        if not (seconds >= 0 and self.clock.now + seconds <= _LATEST):  # nan would corrupt simpy's queue
            raise SimulationError(
                f"the simulation would reach {self.clock.now + seconds:g} s.",
                f"It ends at {_LATEST:g} s; check the speed and the service times.",
            )
        return self.clock.timeout(seconds)


class _RobotAgent:
    """A robot at work: it drives, serves, and writes down what it does."""

    def __init__(self, robot: Robot, world: _World, point: tuple[float, float, float], storey: int) -> None:
        self.robot, self.world = robot, world
        self.status = RobotStatus.IDLE
        self.point = np.asarray(point, dtype=np.float64)
        self.storey = storey
        self.leg_distance = 0.0
        self.recorder = TrackRecorder()

    def note(self, event: EventKind, target: Stop | Unreached | None = None, cause: str = "") -> None:
        """Write an event in the log."""
        x, y, z = self.point.tolist()
        self.world.log.append(
            Event(
                time=float(self.world.clock.now),
                robot=self.robot.name,
                event=event,
                status=self.status,
                storey=self.world.storeys[self.storey],
                x=x,
                y=y,
                z=z,
                target=target.global_id if target else "",
                target_name=target.name if target else "",
                cause=cause,
                leg_distance=self.leg_distance,
            )
        )

    def execute(self, tour: Tour, seconds_at: Callable[[Stop], float]) -> Process:
        """Drive to every stop in turn and serve it, then back to the start if the tour says so."""
        self.note("start")
        for lost in tour.unreached:
            self.note("unreached", lost, lost.reason)
        for k, (leg, stop) in enumerate(zip_longest(_legs_of(tour), tour.stops)):
            if stop is None:
                yield from self.drive(leg, -1, None, tour.start.storey)
            else:
                yield from self.drive(leg, k, stop, stop.cell.storey)
                yield from self.serve(stop, k, seconds_at)
        self.note("finish", cause="back at the start" if tour.return_to_start else "no stop is left")
        self.record()

    def drive(self, leg: NDArray[np.float64], index: int, stop: Stop | None, storey: int) -> Process:
        """Drive along a leg at cruising speed; one event, however many points it has."""
        reached = np.append(0.0, np.linalg.norm(np.diff(leg, axis=0), axis=1).cumsum())
        passed = reached / self.robot.speed
        self.status, self.leg_distance = RobotStatus.MOVING, 0.0
        self.note("depart", stop, "next stop" if stop else "return to the start")
        storeys = _storeys_along(leg, self.world.frame, self.storey, storey)
        self.recorder.add(self.world.clock.now + passed, leg, self.status, storeys, index)
        yield self.world.pass_time(float(passed[-1]))
        self.status, self.leg_distance = RobotStatus.IDLE, float(reached[-1])
        self.point, self.storey = leg[-1], storey
        self.note("arrive", stop, stop.approach if stop else "")

    def serve(self, stop: Stop, index: int, seconds_at: Callable[[Stop], float]) -> Process:
        """Work at a stop; litter is gone when it was served."""
        self.status = RobotStatus.WORKING
        self.note("begin_service", stop)
        self.record(index)
        yield self.world.pass_time(seconds_at(stop))
        self.status = RobotStatus.IDLE
        self.note("end_service", stop)
        if stop.global_id in self.world.removable:
            self.world.removable.remove(stop.global_id)
            self.note("remove", stop, "served")

    def record(self, index: int = -1) -> None:
        """Begin a row of the track here and now."""
        self.recorder.add([self.world.clock.now], [self.point], self.status, [self.storey], index)


def _seconds_at(stop: Stop, robot: Robot, service_time: ServiceTime | float, rng: np.random.Generator) -> float:
    hint = "Give seconds from 0 on, or a function of robot, stop and generator that returns them."
    context = {"global_id": stop.global_id, "name": stop.name}
    try:
        seconds = float(service_time(robot, stop, rng) if callable(service_time) else service_time)
    except Exception as error:
        message = f"the service time of stop {stop.name!r} ({stop.global_id}) cannot be had: {error!r}."
        raise SimulationError(message, hint, context) from error
    if not (math.isfinite(seconds) and seconds >= 0):
        message = f"the service time of stop {stop.name!r} ({stop.global_id}) is {seconds}."
        raise SimulationError(message, hint, context)
    return seconds


def _targets_of(tour: Tour) -> tuple[str, ...]:
    """Return the GlobalIds of everything there is to visit, also of what the tour leaves out."""
    environment = tour.graph.environment
    known = [] if environment is None else [target.global_id for target in environment.targets]
    planned = [goal.global_id for goal in tour.stops] + [goal.global_id for goal in tour.unreached]
    return tuple(dict.fromkeys(known + planned))


def _storey_names(tour: Tour) -> tuple[str, ...]:
    environment = tour.graph.environment
    if environment is None:
        return tuple(str(index) for index in range(len(tour.graph.frame.elevations)))
    return tuple(storey.name or str(index) for index, storey in enumerate(environment.storeys))


def _legs_of(tour: Tour) -> list[NDArray[np.float64]]:
    """Return the route as arrays that begin where the last one ended and end where the stop says."""
    ends = [stop.end for stop in tour.stops]
    if tour.return_to_start and len(tour.route) > len(ends):
        ends.append(tour.start_point)
    if len(tour.route) != len(ends):
        raise SimulationError(f"a tour of {len(tour.stops)} stops has {len(tour.route)} legs.")
    legs, here = [], tour.start_point
    for k, (polyline, end) in enumerate(zip(tour.route, ends, strict=True)):
        leg = np.asarray(polyline, dtype=np.float64)
        if leg.ndim != 2 or leg.shape[1] != 3 or not len(leg) or not np.isfinite(leg).all():
            raise SimulationError(f"leg {k} of the tour is no polyline of finite points.", "", {"leg": k})
        gaps = math.dist(here, leg[0]), math.dist(leg[-1], end)
        if max(gaps) > _JOINED:
            raise SimulationError(
                f"leg {k} of the tour begins {gaps[0]:.6g} m from where the robot is "
                f"and ends {gaps[1]:.6g} m from where it should stop.",
                "A route is one unbroken line through the ends of its stops.",
                {"leg": k},
            )
        legs.append(leg)
        here = end
    return legs


def _storeys_along(leg: NDArray[np.float64], frame: GridFrame, before: int, after: int) -> NDArray[np.int32]:
    """Return the storey of every point: the one it comes from or goes to at their heights, else the one below."""
    heights, index = np.unique(leg[:, 2], return_inverse=True)
    storeys = np.array([frame.storey_at(z) for z in heights.tolist()], dtype=np.int32)
    for storey in (after, before):
        storeys[np.abs(heights - frame.elevations[storey]) <= _JOINED] = storey
    return storeys[index]
