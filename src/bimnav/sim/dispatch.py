"""Who does what: stops that come up, or are left by a robot that failed, go to the robot with the shortest detour."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bimnav.graph import NavGraph
from bimnav.grid import Cell
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
            fields[id(graph)] = distance_field(graph, stop.cell)
        turns = _turns_for(agent, stop)
        for position, detour in zip(turns, _detours(agent, graph, fields[id(graph)], turns), strict=True):
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


def _detours(agent: RobotAgent, graph: NavGraph, field: NDArray[np.float64], turns: range) -> list[float]:
    """Return the metres that a stop adds at places of an agenda; not finite where it cannot be put."""
    if not turns:
        return []
    agenda = list(agent.agenda)[: turns.stop]
    cells = [errand.cell for errand in agenda]
    here = [cell_near(graph, agent.here(), agent.storey)] if turns.start == 0 else []
    reaches = [_reach(field, cell) for cell in (*here, *cells[max(turns.start - 1, 0) :])]
    detours = []
    for k, reach in enumerate(reaches[: len(turns)]):
        detour = reach
        if turns.start + k < len(agenda):
            leg, onward = agenda[turns.start + k].leg, reaches[k + 1]
            detour += onward - (leg.length if leg is not None else abs(reach - onward))
        detours.append(detour)
    return detours


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


def _reach(field: NDArray[np.float64], cell: Cell | None) -> float:
    """Return the distance of a cell; of a closed one, that of the nearest around it."""
    if cell is None:
        return math.inf
    reach = float(field[cell])
    if math.isfinite(reach):
        return reach
    around = field[cell.storey, max(cell.row - 1, 0) : cell.row + 2, max(cell.col - 1, 0) : cell.col + 2]
    return float(around.min())
