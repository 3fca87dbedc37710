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

_MOST = 64  # graphs remembered; what one robot alone avoids makes new ones
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
    _graphs: dict[tuple[int, tuple[int, ...]], tuple[tuple[Closure, ...], NavGraph]] = field(default_factory=dict)
    _heeded: dict[int, tuple[Robot, tuple[Closure, ...]]] = field(default_factory=dict)
    _bodies: dict[tuple[str, float], BaseGeometry] = field(default_factory=dict)

    def add(self, closure: Closure) -> None:
        """Learn that floor is closed."""
        self._forget()
        self.closures[closure.name] = closure

    def remove(self, name: str) -> Closure | None:
        """Learn that floor is open again; return what was closed."""
        self._forget()
        return self.closures.pop(name, None)

    def _forget(self) -> None:
        self._graphs.clear()
        self._heeded.clear()
        self._bodies.clear()

    def heeded_by(self, robot: Robot) -> tuple[Closure, ...]:
        """Return the closures that stop a robot."""
        if id(robot) not in self._heeded:
            stopping = tuple(closure for closure in self.closures.values() if closure.stops(robot))
            self._heeded[id(robot)] = robot, stopping
        return self._heeded[id(robot)][1]

    def _body(self, closure: Closure, robot: Robot) -> BaseGeometry:
        """Return where the middle of a robot cannot be, but for its edge."""
        key = (closure.name, robot.radius)
        if self.closures.get(closure.name) is not closure:
            return closure.body(robot).buffer(-_TOUCH)
        if key not in self._bodies:
            self._bodies[key] = closure.body(robot).buffer(-_TOUCH)
        return self._bodies[key]

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
        every = self.heeded_by(robot)
        if besides is not None and besides.stops(robot):
            every = (*every, besides)
        on = set(storeys.tolist())
        for closure in every:
            if closure.name in held or closure.storey not in on:
                continue
            body = self._body(closure, robot)
            line = shapely.LineString(points[:, :2]) if len(points) > 1 else shapely.Point(points[0, :2])
            leeway = None if closure.is_held else self.leeway
            if shapely.intersects(line, body) and _stops_at(points, storeys, closure.storey, body, leeway):
                return closure
        return None

    def graph_for(self, graph: NavGraph, robot: Robot, besides: Closure | None = None) -> NavGraph:
        """Return the graph of a robot with everything closed that it knows of."""
        active = self.heeded_by(robot)
        if besides is not None:
            active = (*active, besides)
        if not active:
            return graph
        key = (id(graph), tuple(id(closure) for closure in active))
        if key not in self._graphs:
            closed = [
                Cell(closure.storey, row, col)
                for closure in active
                for row, col in np.argwhere(rasterize(graph.frame, closure.body(robot))).tolist()
            ]
            if len(self._graphs) >= _MOST:
                self._graphs.clear()
            self._graphs[key] = active, graph.block(closed)  # who is told apart by identity has to live on
        return self._graphs[key][1]


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
