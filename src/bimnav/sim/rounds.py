"""Tours that nothing can disturb, done in one go."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import repeat
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bimnav.sim.driving import heading_behind
from bimnav.sim.errands import NEXT, Process
from bimnav.sim.log import new_event
from bimnav.sim.motion import Motion, stand
from bimnav.sim.routes import Legs
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent

__all__ = ["work_through"]


def work_through(agent: RobotAgent, legs: Legs) -> Process:
    """Do every stop of a tour that nothing can disturb: what `go` and `serve` do, without looking around."""
    world, clock, name = agent.world, agent.world.clock, agent.name
    write, pass_time, removable, keeps = world.write, world.pass_time, world.removable, world.keeps_history
    moving, working, idle = RobotStatus.MOVING, RobotStatus.WORKING, RobotStatus.IDLE
    begins, arrivals, ends = [], [], []
    (x, y, z), floor = agent.place, world.storeys[agent.storey]
    times = _times(agent, legs)
    ways = _driven(agent, legs) if times is None else _rushed(legs, times)
    for k, (stop, (length, duration, storey, motion)) in enumerate(zip(agent.stops, ways, strict=False)):
        target, called = stop.global_id, stop.name
        begin = clock.now
        write(new_event((begin, name, "depart", moving, floor, x, y, z, target, called, NEXT, 0.0, None, "")))
        yield pass_time(duration)
        now, (x, y, z), floor = clock.now, stop.end, world.storeys[storey]
        place = (floor, x, y, z, target, called)
        write(new_event((now, name, "arrive", idle, *place, stop.approach, length, None, world.asset_of(stop))))
        write(new_event((now, name, "begin_service", working, *place, "", length, None, "")))
        begins.append(begin)
        arrivals.append(now)
        if keeps and motion is not None:
            agent.recorder.add(float(begin), motion, moving, k)
            agent.recorder.add(float(now), stand((x, y, z), storey), working, k)
        yield pass_time(world.draw_seconds(agent, stop))
        now = clock.now
        write(new_event((now, name, "end_service", idle, *place, "", length, None, "")))
        ends.append(now)
        agent.served.append(target)
        if target in removable:
            removable.remove(target)
            write(new_event((now, name, "remove", idle, *place, "served", length, None, "")))
        agent.distance += length
    agent.place, agent.storey, agent.leg_distance = (x, y, z), storey, length
    agent.last = agent.since = now
    _settle(agent, begins, arrivals, ends)
    if keeps and times is not None:
        agent.recorder.add_rounds(legs, times, begins, arrivals)


_Way: TypeAlias = tuple[float, float, int, Motion | None]  # metres, seconds, storey at the end, how it is driven


def _times(agent: RobotAgent, legs: Legs) -> NDArray[np.float64] | None:
    """Return when a robot that starts, stops and turns at once is where on its leg; None for another."""
    robot = agent.robot
    is_agile = math.isinf(robot.acceleration) and math.isinf(robot.turn_rate)
    return legs.reached() / robot.speed if is_agile else None


def _rushed(legs: Legs, times: NDArray[np.float64]) -> Iterator[_Way]:
    last = legs.edges[1:] - 1
    return zip(legs.reached()[last].tolist(), times[last].tolist(), legs.storeys[last].tolist(), repeat(None))


def _driven(agent: RobotAgent, legs: Legs) -> Iterator[_Way]:
    """Yield legs of a robot that accelerates, or turns, each when it is departed for."""
    turns = math.isfinite(agent.robot.turn_rate)
    for k in range(len(legs)):
        line = legs.line(k)
        motion = agent.world.rehearsal.drive(line, agent.robot, agent.robot.speed, agent.heading)
        facing = heading_behind(motion.points) if turns else None
        agent.heading = agent.heading if facing is None else facing
        yield motion.length, motion.duration, int(line.storeys[-1]), motion


def _settle(agent: RobotAgent, begins: list[float], arrivals: list[float], ends: list[float]) -> None:
    """Count the time that a tour took, and draw what it takes."""
    moments = np.column_stack([begins, arrivals, ends])
    for moving, working in np.diff(moments, axis=1).tolist():
        for status, seconds in ((RobotStatus.MOVING, moving), (RobotStatus.WORKING, working)):
            agent.seconds[status] += seconds
            agent.battery.spend(status, seconds)
