"""Who does what: stops that come up, or are left by a robot that failed, go to the robot with the shortest detour."""

from __future__ import annotations

import math
from collections.abc import Iterable
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
    for agent in world.agents:
        able = set(stop.abilities) <= set(agent.robot.abilities)
        if agent is besides or not able or agent.is_over or agent.status is RobotStatus.FAILED:
            continue
        graph = world.graph_of(agent)
        if not graph.free[stop.cell]:
            continue
        field = distance_field(graph, stop.cell)
        for position, detour in _detours(agent, graph, field):
            if not _is_in_turn(agent, stop, position):
                continue
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


def _detours(agent: RobotAgent, graph: NavGraph, field: NDArray[np.float64]) -> Iterable[tuple[int, float]]:
    """Yield the places in an agenda at which a stop can be put, and metres it adds there."""
    here = cell_near(graph, agent.here(), agent.storey)
    cells = [here, *(errand.cell for errand in agent.agenda)]
    first = 1 if agent.agenda and agent.status is not RobotStatus.IDLE else 0
    for position in range(first, len(cells)):
        reach = _reach(field, cells[position])
        if position + 1 < len(cells):
            after = agent.agenda[position]
            onward = _reach(field, after.cell)
            reach += onward - (after.leg.length if after.leg is not None else abs(reach - onward))
        yield position, reach


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


def _is_in_turn(agent: RobotAgent, stop: Stop, position: int) -> bool:
    """Tell whether a stop at some place of an agenda keeps the order of priorities."""
    first = 1 if agent.agenda and agent.status is not RobotStatus.IDLE else 0
    known = [(k, e.stop.priority) for k, e in enumerate(agent.agenda) if e.stop is not None and e.stop.kind == "target"]
    before = all(priority >= stop.priority for k, priority in known if first <= k < position)
    return before and all(priority <= stop.priority for k, priority in known if k >= position)


def _reach(field: NDArray[np.float64], cell: Cell | None) -> float:
    """Return the distance of a cell; of a closed one, that of the nearest around it."""
    if cell is None:
        return math.inf
    reach = float(field[cell])
    if math.isfinite(reach):
        return reach
    around = field[cell.storey, max(cell.row - 1, 0) : cell.row + 2, max(cell.col - 1, 0) : cell.col + 2]
    return float(around.min())
