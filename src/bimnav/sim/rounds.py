"""Tours that nothing can disturb, done in one go."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bimnav.sim.errands import NEXT, Process
from bimnav.sim.log import new_event
from bimnav.sim.routes import Legs
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent

__all__ = ["work_through"]


def work_through(agent: RobotAgent, legs: Legs) -> Process:
    """Do every stop of a tour that nothing can disturb: what `go` and `serve` do, without looking around."""
    world, clock, name = agent.world, agent.world.clock, agent.name
    write, pass_time, removable = world.write, world.pass_time, world.removable
    moving, working, idle = RobotStatus.MOVING, RobotStatus.WORKING, RobotStatus.IDLE
    reached = legs.reached()
    times, last = reached / agent.robot.speed, legs.edges[1:] - 1
    lengths, durations, storeys = reached[last].tolist(), times[last].tolist(), legs.storeys[last].tolist()
    begins, arrivals, ends = [], [], []
    (x, y, z), floor = agent.place, world.storeys[agent.storey]
    for stop, length, duration, storey in zip(agent.stops, lengths, durations, storeys, strict=False):
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
    if world.keeps_history:
        agent.recorder.add_rounds(legs, times, begins, arrivals)


def _settle(agent: RobotAgent, begins: list[float], arrivals: list[float], ends: list[float]) -> None:
    """Count the time that a tour took, and draw what it takes."""
    moments = np.column_stack([begins, arrivals, ends])
    for moving, working in np.diff(moments, axis=1).tolist():
        for status, seconds in ((RobotStatus.MOVING, moving), (RobotStatus.WORKING, working)):
            agent.seconds[status] += seconds
            agent.battery.spend(status, seconds)
