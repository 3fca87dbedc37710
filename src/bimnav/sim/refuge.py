"""Where robots get out of the way: out of a zone, off the ways out of the building."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.errors import BimnavError
from bimnav.graph import NavGraph
from bimnav.grid import Cell, rasterize
from bimnav.plan import distance_field
from bimnav.sim.egress import egress_cells, egress_distances
from bimnav.sim.errands import Errand
from bimnav.sim.knowledge import Closure, Knowledge
from bimnav.sim.routes import JOINED, cell_near, way_between

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent

__all__ = ["is_inside", "parking_for", "way_out"]


def is_inside(agent: RobotAgent, zone: Closure) -> bool:
    """Tell whether a robot's body is on closed floor."""
    if zone.storey != agent.storey:
        return False
    body = zone.body(agent.robot).buffer(-JOINED)
    return bool(body.intersects(shapely.Point(agent.here()[:2])))


def way_out(agent: RobotAgent, zones: Sequence[Closure]) -> Errand | None:
    """Return the shortest way out of zones that a robot is in; None if it is in none, or cannot."""
    if not any(is_inside(agent, zone) for zone in zones):
        return None
    names = {zone.name for zone in zones}
    rest = Knowledge({name: c for name, c in agent.world.knowledge.closures.items() if name not in names})
    return _way_to(agent, rest.graph_for(agent.tour.graph, agent.robot), agent.world.graph_of(agent).free)


def parking_for(agent: RobotAgent) -> Errand | None:
    """Return the way to the nearest cell where a robot is in nobody's way; None if it is there."""
    world = agent.world
    assert world.kept_clear is not None  # noqa: S101 - set by the emergency
    graph = world.graph_of(agent)
    try:
        needed = egress_cells(graph, egress_distances(graph), world.kept_clear[1] + 2 * agent.robot.radius)
    except BimnavError:
        return None
    open_ = graph.free & ~needed
    for index, cell in world.parked.items():
        spread = agent.robot.radius + world.agents[index].robot.radius
        taken = shapely.Point(graph.frame.center_of(cell)[:2]).buffer(max(spread, graph.frame.cell_size / 2))
        open_[cell.storey] &= ~rasterize(graph.frame, taken)
    here = cell_near(graph, agent.place, agent.storey)
    if here is not None and open_[here]:
        world.parked[agent.index] = here
        return None
    errand = _way_to(agent, graph, open_)
    if errand is not None:
        world.parked[agent.index] = errand.cell
    return errand


def _way_to(agent: RobotAgent, graph: NavGraph, wanted: NDArray[np.bool_]) -> Errand | None:
    """Return the way to the nearest of some cells, by distance, then storey, row and column."""
    begin = cell_near(graph, agent.place, agent.storey)
    if begin is None:
        return None
    distance = np.where(wanted, distance_field(graph, begin), np.inf)
    nearest = int(distance.argmin())
    if not math.isfinite(distance.ravel()[nearest]):
        return None
    cell = Cell(*(int(k) for k in np.unravel_index(nearest, distance.shape)))
    end = graph.frame.center_of(cell)
    return Errand(None, cell, end, leg=way_between(graph, agent.place, begin, cell, end))
