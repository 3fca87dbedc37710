"""When a robot charges, and how: what errands take, which charger is near, and the wait in front of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import simpy
from numpy.typing import NDArray

from bimnav.plan import distance_field
from bimnav.sim.errands import Errand, Process, Step
from bimnav.sim.routes import JOINED, Line
from bimnav.sim.track import RobotStatus
from bimnav.stops import Stop

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent

__all__ = ["charge", "charge_before", "recharge"]

_DETOUR = 1.25  # what the way to a charger may take beyond its length at cruising speed, for turns and doors
_RESERVE = 0.05  # of a full battery, left on arrival at a charger


def charge_before(agent: RobotAgent, errand: Errand) -> Errand | str | None:
    """Return the way to a charger if it is needed before an errand, the reason if the errand cannot be done."""
    agent.settle()
    needed = _energy_for(agent, errand)
    if needed is None:
        return None  # no way leads there now; the way is looked for when it is needed
    capacity = agent.battery.capacity
    if needed <= agent.battery.level:
        return None
    if needed > capacity * (1 - 1e-9):
        return f"it takes {needed / capacity:.0%} of a full battery"
    if agent.battery.level >= capacity * (1 - 1e-9):
        return None
    charging = _nearest_charger(agent)
    if charging is None:
        return f"it takes {needed / capacity:.0%} of a full battery, {agent.battery.share:.0%} are left, no charger"
    charging.purpose = "charge"
    return charging


def charge(agent: RobotAgent, errand: Errand) -> Process:
    """Go to a charger, wait for it if it is in use, and fill the battery."""
    name = errand.charger
    granted = agent.world.claims.request([name])
    if granted is not None:
        agent.halt(RobotStatus.WAITING, "wait", errand, f"{agent.world.label_of(name)} is in use")
        turned = yield from _take_turn(agent, granted)
        agent.become(RobotStatus.IDLE)
        if not turned:
            return
    if (yield from agent.go(errand)):
        yield from _fill(agent, name, None)
    agent.world.claims.release([name])


def recharge(agent: RobotAgent, errand: Errand) -> Process:
    """Fill the battery at a charger that the tour visits."""
    stop = errand.stop
    assert stop is not None  # noqa: S101 - a visit is a stop
    granted = agent.world.claims.request([stop.global_id])
    if granted is not None:
        agent.halt(RobotStatus.WAITING, "wait", errand, f"{agent.world.label_of(stop.global_id)} is in use")
        if not (yield from _take_turn(agent, granted)):
            return
    yield from _fill(agent, stop.global_id, stop)
    agent.world.claims.release([stop.global_id])
    if not agent.orders:
        agent.agenda.remove(errand)


def _take_turn(agent: RobotAgent, granted: simpy.Event) -> Step:
    """Wait for a charger as long as the battery lasts; answer whether it is free now."""
    lasting = agent.battery.lasts(agent.status)
    event = granted if math.isinf(lasting) else granted | agent.world.pass_time(lasting)
    disturbed = yield from agent.pause(event)
    agent.run_down()
    if not disturbed and granted.triggered and not agent.orders:
        return True
    agent.world.claims.withdraw(granted)
    return False


def _fill(agent: RobotAgent, name: str, stop: Stop | None) -> Process:
    """Charge until the battery is full, or something is ordered."""
    agent.settle()
    seconds, share = agent.battery.seconds_to_full(), agent.battery.share or 0.0
    agent.become(RobotStatus.CHARGING)
    agent.note(
        "charge", stop, f"{agent.world.label_of(name)}; {share:.0%} are left, {agent.leg_distance:.2f} m to get there"
    )
    agent.record()
    yield from agent.pause(agent.world.pass_time(seconds))
    agent.become(RobotStatus.IDLE)
    agent.note("charged", stop, f"{seconds:.0f} s")


def _energy_for(agent: RobotAgent, errand: Errand) -> float | None:
    """Return the joules that an errand takes, with the way to a charger after it; None without a way."""
    world = agent.world
    line = errand.leg if errand.leg is not None and _begins_here(agent, errand.leg) else None
    if line is None:
        line = errand.leg = world.find_line(agent, errand)
    elif world.in_way(agent, line) is not None:
        line = world.find_line(agent, errand)
    if line is None:
        return None
    motion = world.rehearsal.drive(line, agent.robot, agent.robot.speed, agent.heading)
    powers = agent.battery.powers
    joules = motion.duration * powers[RobotStatus.MOVING]
    if errand.stop is not None and errand.stop.kind == "charger":
        return joules
    if errand.stop is not None:
        joules += world.seconds_at(agent, errand) * powers[RobotStatus.WORKING]
    if not world.chargers:
        return joules
    away = float(_to_chargers(agent)[errand.cell])
    if math.isfinite(away):
        joules += away / agent.robot.speed * _DETOUR * powers[RobotStatus.MOVING]
    return joules + _RESERVE * agent.battery.capacity


def _to_chargers(agent: RobotAgent) -> NDArray[np.float64]:
    """Return the metres from every cell to a charger that a robot can get to."""
    world = agent.world
    graph = world.knowledge.graph_for(agent.tour.graph, agent.robot)
    if world.charger_field is None or world.charger_field[0] is not graph:
        metric = graph if graph.objective == "distance" else replace(graph, objective="distance")
        cells = [charger.cell for charger in world.chargers.values() if graph.free[charger.cell]]
        field = distance_field(metric, cells) if cells else np.full(graph.frame.shape, np.inf)
        world.charger_field = graph, field
    return world.charger_field[1]


def _begins_here(agent: RobotAgent, line: Line) -> bool:
    return math.dist(line.points[0], agent.place) <= JOINED


def _nearest_charger(agent: RobotAgent) -> Errand | None:
    """Return the way to a charger that is free, else to any, the nearest first; None without a way."""
    world = agent.world
    found = []
    for rank, charger in enumerate(world.chargers.values()):
        errand = Errand(None, charger.cell, charger.end, purpose="charge", charger=charger.name)
        errand.leg = world.find_line(agent, errand)
        if errand.leg is not None:
            found.append((world.claims.left[charger.name] <= 0, errand.leg.length, rank, errand))
    return min(found, key=lambda option: option[:3])[3] if found else None
