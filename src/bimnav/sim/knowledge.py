"""The map as robots know it: what was planned on, and what was closed since."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.environment import grown
from bimnav.graph import NavGraph
from bimnav.grid import Cell, rasterize
from bimnav.robot import Robot
from bimnav.sim.areas import crossings

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.sim.doors import SimDoor

__all__ = ["Closure", "Knowledge"]

_TOUCH = 1e-6  # metres; a way along the edge of what is closed is open


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Floor that is closed to robots.

    Parameters
    ----------
    name
        How the log calls it.
    polygon
        Plan view, metres; not yet grown by a robot's radius.
    door
        The door that does not open, if it is one; robots for which it opens may pass.
    is_held
        Whether others use it: its polygon is where the middle of a robot cannot be, and one in front of it waits.
    """

    name: str
    polygon: BaseGeometry
    storey: int
    door: SimDoor | None = None
    is_held: bool = False

    def stops(self, robot: Robot) -> bool:
        """Tell whether it is closed to a robot."""
        return self.door is None or not self.door.opens_for(robot)

    def body(self, robot: Robot) -> BaseGeometry:
        """Return where the middle of a robot cannot be; a doorway was grown already."""
        return self.polygon if self.door is not None or self.is_held else grown(self.polygon, robot.radius)


@dataclass(slots=True)
class Knowledge:
    """What robots know of the world, all of them the same.

    Parameters
    ----------
    closures
        By name, in the order in which they became known.
    leeway
        How much farther than the shortest way out of closed floor a robot that stands on it may go, metres.
    """

    closures: dict[str, Closure] = field(default_factory=dict)
    leeway: float = 0.0
    _graphs: dict[tuple[int, tuple[int, ...]], NavGraph] = field(default_factory=dict)

    def add(self, closure: Closure) -> None:
        """Learn that floor is closed."""
        self.closures[closure.name] = closure
        self._graphs.clear()

    def remove(self, name: str) -> Closure | None:
        """Learn that floor is open again; return what was closed."""
        self._graphs.clear()
        return self.closures.pop(name, None)

    def in_way(
        self,
        robot: Robot,
        points: NDArray[np.float64],
        storeys: NDArray[np.int32],
        *,
        besides: Closure | None = None,
        held: Iterable[str] = (),
    ) -> Closure | None:
        """Return the first closure known that a line of a robot meets; None if its way is open.

        Parameters
        ----------
        besides
            A closure only this robot heeds.
        held
            Names of doors the robot stands in; it goes on through them.
        """
        every = [*self.closures.values(), *([besides] if besides else [])]
        for closure in every:
            if closure.name in held or not closure.stops(robot) or not (storeys == closure.storey).any():
                continue
            body = closure.body(robot).buffer(-_TOUCH)
            line = shapely.LineString(points[:, :2]) if len(points) > 1 else shapely.Point(points[0, :2])
            leeway = None if closure.is_held else self.leeway
            if shapely.intersects(line, body) and _stops_at(points, storeys, closure.storey, body, leeway):
                return closure
        return None

    def graph_for(self, graph: NavGraph, robot: Robot, besides: Closure | None = None) -> NavGraph:
        """Return the graph of a robot with everything closed that it knows of."""
        active = [closure for closure in self.closures.values() if closure.stops(robot)]
        if besides is not None:
            active.append(besides)
        if not active:
            return graph
        key = (id(graph), tuple(id(closure) for closure in active))
        if key not in self._graphs:
            closed = [
                Cell(closure.storey, row, col)
                for closure in active
                for row, col in np.argwhere(rasterize(graph.frame, closure.body(robot))).tolist()
            ]
            self._graphs[key] = graph.block(closed)
        return self._graphs[key]


def _stops_at(
    points: NDArray[np.float64], storeys: NDArray[np.int32], storey: int, body: BaseGeometry, leeway: float | None
) -> bool:
    """Tell whether a line meets a polygon on a storey, but for a short way out of it at the begin; None for no way."""
    found = crossings(points, storeys, [(body, storey)])
    here = shapely.Point(points[0, :2])
    if leeway is not None and found and found[0].begin == 0 and body.covers(here):
        way_out = float(body.boundary.distance(here))
        return len(found) > 1 or found[0].end > 2 * way_out + leeway
    return bool(found) or (len(points) == 1 and bool(body.covers(here)))
