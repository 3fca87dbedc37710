"""Where a robot begins."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from bimnav import _checks
from bimnav.building import Element, Space
from bimnav.environment import IndoorEnvironment, Place, Region
from bimnav.errors import GoalBlockedError, NothingWalkableError, OutsideMapError, StartBlockedError
from bimnav.graph import NavGraph
from bimnav.grid import Cell, nearest_cell

__all__ = ["Start", "find_end", "find_start"]


@dataclass(frozen=True, slots=True)
class Start:
    """Where a job begins, or ends: cell, exact point in metres, and why there."""

    cell: Cell
    point: tuple[float, float, float]
    source: str


def find_start(graph: NavGraph, place: Place | None = None) -> Start:
    """Choose where a robot begins.

    Parameters
    ----------
    graph
        Made from an environment.
    place
        `(x, y)` or `(x, y, storey)` in metres; None for the charging dock, else the middle of the
        largest region of the lowest walkable storey, or the nearest point to it in the largest part of that
        storey that the robot can move in: not between a sofa and a table.

    Raises
    ------
    OutsideMapError
        If the place lies on no floor.
    StartBlockedError
        If the robot would touch an obstacle there; the message names it and a free point near by.
    """
    _checks.need("graph", graph, NavGraph)
    environment = _environment_of(graph)
    if not graph.free.any():
        raise NothingWalkableError(
            f"no cell of {environment.building.name!r} is free for robot {environment.robot.name!r}.",
            "Use smaller cells or a smaller robot.",
        )
    if place is not None:
        return _place_at(graph, place, "start")
    for dock, _ in _docks(environment):
        bounds = dock.bounds
        if bounds is None:
            continue
        storey = graph.frame.storey_at(float(bounds[0, 2]))
        x, y = (bounds[0, :2] + bounds[1, :2]) / 2
        near = _nearest_free(graph, storey, float(x), float(y))
        if near is not None and math.dist(near[1][:2], (x, y)) <= 3:
            return Start(*near, f"charging dock {dock.name} ({dock.global_id})")
    storeys = (graph.frame.ground, *range(graph.frame.shape[0]))
    storey = next(s for s in storeys if graph.free[s].any())
    regions = [r for r in environment.regions if r.storey == storey]
    parts = graph.components[storey]
    roomiest = int(np.bincount(parts[parts > 0]).argmax())
    regions.sort(key=lambda region: -region.polygon.area)
    inside = (start for region in regions if (start := _middle_of(graph, region, roomiest)) is not None)
    rows, cols = np.nonzero(parts == roomiest)
    anywhere = Cell(storey, int(rows[0]), int(cols[0]))
    return next(inside, Start(anywhere, graph.frame.center_of(anywhere), f"on {environment.storeys[storey].name}"))


def find_end(graph: NavGraph, place: Place) -> Start:
    """Return the cell and the exact point of a place at which a job ends.

    Raises
    ------
    OutsideMapError, GoalBlockedError
        As for a start.
    """
    return _place_at(graph, place, "end")


def _middle_of(graph: NavGraph, region: Region, part: int) -> Start | None:
    """Return the place in a part of the map nearest to the middle of a region; None if it lies outside the region."""
    middle = region.polygon.centroid
    found = _nearest_free(graph, region.storey, middle.x, middle.y, part)
    if found is None or not region.polygon.intersects(shapely.Point(found[1][:2])):
        return None
    return Start(*found, f"near the middle of {region.name}")


def _environment_of(graph: NavGraph) -> IndoorEnvironment:
    if graph.environment is None:
        raise NothingWalkableError("the graph was made from a mask; it has no building to start in.")
    return graph.environment


def _docks(environment: IndoorEnvironment) -> Iterable[tuple[Element | Space, str]]:
    from bimnav.tasks import match

    for rule in environment.task.docks:
        yield from match(rule, environment.building)


def _nearest_free(
    graph: NavGraph, storey: int, x: float, y: float, part: int | None = None
) -> tuple[Cell, tuple[float, float, float]] | None:
    """Return the free cell of a part nearest to a point, and the point itself if the robot can stand on it."""
    frame = graph.frame
    free = graph.free[storey] if part is None else graph.components[storey] == part
    x0, y0, x1, y1 = frame.bounds
    if x0 <= x < x1 and y0 <= y < y1:
        own = frame.cell_at(x, y, storey=storey)
        if free[own[1:]] and _environment_of(graph).is_clear(storey, (x, y)):
            return own, (x, y, frame.elevations[storey])
    found = nearest_cell(frame, free, storey, x, y)
    return found and (found[0], frame.center_of(found[0]))


def _place_at(graph: NavGraph, place: Place, role: Literal["start", "end"]) -> Start:
    environment = _environment_of(graph)
    storey = environment.storeys_at(place)[0]
    x, y = float(place[0]), float(place[1])
    named = place[2] if len(place) > 2 else None
    point = shapely.Point(x, y)
    on_floor = environment.floor(storey).intersects(point)
    blocked = any(body.intersects(point) for _, body in environment.bodies_on(storey))
    where = f"{role} ({x:g}, {y:g})" + (f" on {named}" if named is not None else "")
    if not on_floor and not blocked:
        x_min, y_min, x_max, y_max = graph.frame.bounds
        raise OutsideMapError(
            f"{where} lies on no floor.",
            f"The map reaches from x {x_min:.2f} to {x_max:.2f} m and y {y_min:.2f} to {y_max:.2f} m; "
            "give a point inside a room.",
            {"x": x, "y": y, "storey": named},
        )
    cell = graph.frame.cell_at(x, y, storey=storey)
    near = _nearest_free(graph, storey, x, y)
    if near is not None and environment.is_clear(storey, (x, y), near[1]):
        return Start(near[0], (x, y, environment.levels[storey]), "given")
    box = shapely.box(*graph.frame.box_of(cell))
    touched = [o for o, body in environment.bodies_on(storey) if body.intersects(box)]
    names = ", ".join(f"{o.name or o.ifc_class} ({o.global_id})" for o in touched) or "the edge of the floor"
    hint = f"The nearest free point is ({near[1][0]:.3f}, {near[1][1]:.3f})." if near else "Use smaller cells."
    error = StartBlockedError if role == "start" else GoalBlockedError
    raise error(
        f"{where} is blocked: its cell touches {names}.",
        hint,
        {"x": x, "y": y, "obstacles": [o.global_id for o in touched]},
    )
