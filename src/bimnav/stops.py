"""Where a robot goes for a target: onto its point, or to the nearest cell beside it that will do."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import shapely

from bimnav.grid import Cell

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import Target
    from bimnav.graph import NavGraph

__all__ = ["Stand", "Stop", "Unreached", "standing_at", "stop_at", "why_not_served"]

Approach = Literal["center", "standing", "reach"]

_REACH = 3.0  # metres; a robot that stands farther away does not serve its target
_PARTITIONS = (
    "IfcWall",
    "IfcWallStandardCase",
    "IfcWallElementedCase",
    "IfcCurtainWall",
    "IfcPlate",
    "IfcWindow",
)


class Stand(NamedTuple):
    """One place from which a target is served.

    Parameters
    ----------
    cell
        Where the search ends.
    end
        Where the robot comes to stand, metres.
    distance
        From `end` to the target's destination, metres.
    heading
        Which way the robot faces there, radians counter-clockwise from x; None where it does not matter.
    """

    cell: Cell
    end: tuple[float, float, float]
    distance: float = 0.0
    heading: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """One goal of a tour.

    Parameters
    ----------
    cell
        Where the search ends.
    destination
        The target's own exact point, metres.
    end
        Where the robot comes to stand: the destination, or the middle of the cell for `standing`.
    approach
        `center`: on the destination. `standing`: next to it, because its cell is blocked.
        `reach`: on it although its cell is blocked, as in the paper.
    distance
        From `end` to `destination`, metres.
    heading
        Which way the robot faces, radians counter-clockwise from x; None where it does not matter.
    candidates
        Every place from which the target may be served, best first; the stop's own among them. A planner
        may choose any, by `at`.
    service_time
        Seconds the robot works there; None for the task's.
    priority
        Stops of a higher priority are served before those of a lower one.
    due
        Seconds from the start of the tour by which the work is to be done; None for any time.
    abilities
        What a robot must be able to do there.
    kind
        `target`, or `charger`, where the robot fills its battery.
    """

    global_id: str
    name: str
    cell: Cell
    destination: tuple[float, float, float]
    end: tuple[float, float, float]
    approach: Approach = "center"
    distance: float = 0.0
    source: Literal["model", "user"] = "model"
    heading: float | None = None
    candidates: tuple[Stand, ...] = ()
    service_time: float | None = None
    priority: float = 1.0
    due: float | None = None
    abilities: tuple[str, ...] = ()
    kind: Literal["target", "charger"] = "target"

    def __post_init__(self) -> None:
        own = Stand(self.cell, self.end, self.distance, self.heading)
        object.__setattr__(self, "candidates", tuple(self.candidates) or (own,))

    def at(self, stand: Stand) -> Stop:
        """Return the stop served from another of its candidates."""
        return replace(self, cell=stand.cell, end=stand.end, distance=stand.distance, heading=stand.heading)


@dataclass(frozen=True, slots=True, eq=False)
class Unreached:
    """A target that is not served, and why."""

    global_id: str
    name: str
    destination: tuple[float, float, float]
    reason: str
    cell: Cell | None = None


def stop_at(graph: NavGraph, target: Target, cell: Cell) -> Stop | None:
    """Return the stop on the target's own point, or in its cell, if the robot can be there."""
    if not graph.free[cell]:
        return None
    reach = bool(graph.obstacle[cell])
    clear = graph.environment is None or graph.environment.is_clear(target.storey, target.destination)
    if clear or reach:
        return Stop(
            target.global_id,
            target.name,
            cell,
            target.destination,
            target.destination,
            "reach" if reach else "center",
            **_asked(target),
        )
    return _standing_stop(graph, target, cell)


def _standing_stop(graph: NavGraph, target: Target, cell: Cell) -> Stop:
    end = graph.frame.center_of(cell)
    distance = math.dist(end, target.destination)
    return Stop(target.global_id, target.name, cell, target.destination, end, "standing", distance, **_asked(target))


def _asked(target: Target) -> dict[str, Any]:
    """Return what is asked of a robot at a target, for its stop."""
    return {name: getattr(target, name) for name in ("source", "service_time", "priority", "due", "abilities")}


def standing_at(graph: NavGraph, target: Target, component: int | None) -> Stop | None:
    """Return the stop on the nearest safe cell within reach that sees the target."""
    frame, storey = graph.frame, target.storey
    x, y, _ = target.destination
    free = graph.free[storey]
    if component is not None:
        free = free & (graph.components[storey] == component)
    rows, cols = np.nonzero(free)
    centers = frame.centers_of(np.column_stack([np.full_like(rows, storey), rows, cols]))
    distance = np.hypot(centers[:, 0] - x, centers[:, 1] - y)
    near = np.flatnonzero(distance <= _REACH)
    # equally near cells go by row and column; nanometres of difference are rounding
    near = near[np.lexsort((cols[near], rows[near], np.round(distance[near], 9)))]
    walls = _walls_near(graph, target)
    for k in near.tolist():
        sight = shapely.LineString([(x, y), centers[k, :2]])
        if not any(wall.intersects(sight) for wall in walls):
            return _standing_stop(graph, target, Cell(storey, int(rows[k]), int(cols[k])))
    return None


def _walls_near(graph: NavGraph, target: Target) -> list[BaseGeometry]:
    """Return what a robot cannot work through, but for what holds the target itself."""
    if graph.environment is None:
        return []
    point = shapely.Point(target.destination[:2])
    return [
        obstacle.footprint
        for obstacle in graph.environment.obstacles_on(target.storey)
        if obstacle.ifc_class in _PARTITIONS and 0 < obstacle.footprint.distance(point) <= _REACH
    ]


def why_not_served(graph: NavGraph, target: Target, cell: Cell) -> str:
    """Say why a target has no stop."""
    if not graph.obstacle[cell]:
        return f"it lies on no floor, and no standing cell is within {_REACH:g} m"
    by = [c for c in graph.conflicts if c.global_id == target.global_id]
    blocking = by[0].obstacles if by else ()
    building = graph.environment.building if graph.environment else None
    names = ", ".join(f"{building[g].name} ({g})" if building and g in building else g for g in blocking)
    return f"its cell is blocked by {names}, and no reachable standing cell within {_REACH:g} m sees it"
