"""Who does what: stops that come up, or are left by a robot that failed, go to the robot with the shortest detour."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bimnav.graph import NavGraph
from bimnav.plan import distance_field
from bimnav.sim.errands import Errand, Order
from bimnav.sim.routes import JOINED, cell_near, end_of
from bimnav.sim.track import RobotStatus
from bimnav.stops import Stop

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent
    from bimnav.sim.world import World

__all__ = ["assign", "hand_over"]


def assign(world: World, stop: Stop, *, besides: RobotAgent | None = None, cause: str = "") -> bool:
    """Give a stop to the robot that gets there with the shortest detour; answer whether one can.

    It comes behind what matters more and before what matters less, but for what a robot is on its way to.
    Of several equally short detours the first robot's, and its earliest, is taken.
    """
    best: tuple[float, int, int] | None = None
    fields: dict[int, NDArray[np.float64]] = {}  # robots share maps
    for agent in world.agents:
        able = set(stop.abilities) <= set(agent.robot.abilities)
        if agent is besides or not able or agent.is_over or agent.status is RobotStatus.FAILED:
            continue
        graph = world.graph_of(agent)
        if not graph.free[stop.cell]:
            continue
        if id(graph) not in fields:
            fields[id(graph)] = _reaches(distance_field(graph, stop.cell))
        for position, detour in _detours(agent, graph, fields[id(graph)], stop):
            if math.isfinite(detour) and (best is None or detour < best[0] - JOINED):
                best = detour, agent.index, position
    if best is None:
        return False
    agent = world.agents[best[1]]
    errand = Errand(stop, stop.cell, stop.end, len(agent.stops))
    agent.stops.append(stop)
    agent.agenda.insert(best[2], errand)
    if agent.home is None and (agent.tour.return_to_start or end_of(agent.tour)[0] != agent.tour.start):
        agent.home = agent.homeward()
    agent.note("assign", stop, cause or f"the detour is {best[0]:.2f} m")
    agent.disturb(Order("look", "something new to do"))
    return True


def _detours(
    agent: RobotAgent, graph: NavGraph, reaches: NDArray[np.float64], stop: Stop
) -> Iterable[tuple[int, float]]:
    """Yield the places in an agenda at which a stop can be put, and metres it adds there."""
    here = cell_near(graph, agent.here(), agent.storey)
    ways = [math.inf if here is None else reaches.item(here), *(reaches.item(each.cell) for each in agent.agenda)]
    if min(ways) == math.inf:
        return
    agenda = list(agent.agenda)
    for position in _turns_for(agent, stop):
        way = ways[position]
        if position < len(agenda):
            leg, onward = agenda[position].leg, ways[position + 1]
            yield position, way + (onward - (leg.length if leg is not None else abs(way - onward)))
        else:
            yield position, way


def hand_over(agent: RobotAgent, cause: str) -> None:
    """Give what a robot has to do to others; what nobody can do stays with it, or undone."""
    for errand in tuple(agent.agenda):
        assert errand.stop is not None  # noqa: S101 - an agenda holds stops
        why = f"{agent.robot.name} failed: {cause}"
        if errand.stop.kind == "charger" or assign(agent.world, errand.stop, besides=agent, cause=why):
            agent.agenda.remove(errand)
        elif agent.is_over:
            status = agent.status
            agent.give_up(errand, why)
            agent.become(status)


def _turns_for(agent: RobotAgent, stop: Stop) -> range:
    """Return the places of an agenda at which a stop keeps the order of priorities."""
    first = 1 if agent.agenda and agent.status is not RobotStatus.IDLE else 0
    begin, end = first, len(agent.agenda)
    for k, errand in enumerate(agent.agenda):
        if errand.stop is None or errand.stop.kind != "target":
            continue
        if errand.stop.priority > stop.priority:
            begin = max(begin, k + 1)
        elif errand.stop.priority < stop.priority and k >= first:
            end = min(end, k)
    return range(begin, end + 1)


def _reaches(field: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a field in which a closed cell is as far as the nearest around it."""
    from scipy import ndimage

    reaches = field.astype(np.float64)
    for storey in np.flatnonzero(np.isfinite(field).any(axis=(1, 2))).tolist():
        around = ndimage.minimum_filter(field[storey], size=3, mode="nearest")
        reaches[storey] = np.where(np.isfinite(field[storey]), field[storey], around)
    return reaches
