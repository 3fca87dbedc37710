"""Doors tried one by one: does a robot get through, and why not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._doorways import Doorway, doorway_of
from bimnav._levels import FLUSH, ROUNDING
from bimnav.building import Door
from bimnav.environment import IndoorEnvironment
from bimnav.graph import NavGraph, build_graph

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["DoorCheck", "Gates", "doors_of", "listed"]

Obstruction: TypeAlias = Literal["", "narrow", "low", "sill", "step", "blocked", "cells", "no-floor", "no-shape"]

_SIDE = 0.5  # metres from a door within which there is floor if it leads anywhere
_AROUND = 1.0  # metres to either side of a doorway in which a robot may turn
_OTHER_LEVEL = 1.0  # metres; a floor farther above or below a door is not what it leads to
_TOUCH = 1e-6  # square metres
_PRESENT = 0.02  # square metres of floor beside a door; less is a corner of something else


@dataclass(frozen=True, slots=True)
class DoorCheck:
    """Whether a door lets a robot through.

    Parameters
    ----------
    storey
        Index into the environment's storeys of the level it stands on; None if it stands on none.
    spaces
        GlobalIds of the rooms it opens to.
    leads
        `inside`: floor at both sides. `outside`: at one. `nowhere`: at none.
    width, sill
        Clear width, and height of the sill above the lower floor, metres; None if unknown.
    connects
        Whether the robot passes; at a door to the outside, whether it can stand in the doorway.
    reason
        Why not: `narrow`, `low`, a `sill` or a `step` too high, `blocked` by something, `cells` too large to
        show the way, `no-floor` at its height, `no-shape`. Empty if it connects.
    detail
        The same in words, with numbers.
    obstacles
        GlobalIds of what stands in the way.
    """

    global_id: str
    name: str
    storey: int | None
    spaces: tuple[str, ...]
    leads: Literal["inside", "outside", "nowhere"]
    width: float | None
    sill: float | None
    connects: bool
    reason: Obstruction = ""
    detail: str = ""
    obstacles: tuple[str, ...] = ()


def doors_of(
    environment: IndoorEnvironment, graph: NavGraph | None = None, *, cell_size: float = 0.05
) -> tuple[DoorCheck, ...]:
    """Tell for every door of a building whether it connects its two sides for the environment's robot.

    Only the doorway and the floor in front of it count: another way round does not help, and furniture
    farther away does not hurt.

    Parameters
    ----------
    environment
        Of the building and the robot.
    graph
        The environment's cells; made if not given.
    cell_size
        Edge of the cells to make, metres.

    Returns
    -------
    checks
        One for every door, in the building's order.
    """
    _checks.need("environment", environment, IndoorEnvironment)
    _checks.need("graph", graph, NavGraph, or_none=True)
    if graph is None and any(not environment.floor(k).is_empty for k in range(len(environment.levels))):
        graph = build_graph(environment, cell_size=cell_size)
    gates = Gates(environment, graph)
    return tuple(gates.check(door) for door in environment.building.doors)


class Gates:
    """The doorways of an environment."""

    def __init__(self, environment: IndoorEnvironment, graph: NavGraph | None) -> None:
        self.environment, self.graph, self.robot = environment, graph, environment.robot
        self.step = max(self.robot.step_height, FLUSH) + ROUNDING
        self.floors: list[list[BaseGeometry]] = [[] for _ in environment.levels]
        self.on: dict[str, list[int]] = {}
        for region in environment.regions:
            if region.source in ("door", "passage"):
                self.on.setdefault(region.global_id, []).append(region.storey)
            else:
                self.floors[region.storey].append(region.polygon)
        self.trees = [shapely.STRtree(floor) for floor in self.floors]

    def check(self, door: Door) -> DoorCheck:
        """Try one door."""
        way = doorway_of(door, self.environment.building)
        if way is None:
            found = (door.global_id, door.name, None, door.spaces)
            return DoorCheck(*found, "nowhere", door.width, None, False, "no-shape", "it has no geometry")
        tried = [self._on_level(k, door, way) for k in self.on.get(door.global_id, ())]
        tried.sort(key=lambda check: (not check.connects, check.leads != "inside"))
        return tried[0] if tried else self._off_levels(door, way)

    def parts_beside(self, door: Door) -> tuple[set[int], set[int]]:
        """Return the parts of the graph, as numbered in its parts, in front of either side of a door."""
        way = doorway_of(door, self.environment.building)
        parts: tuple[set[int], set[int]] = (set(), set())
        if way is None or self.graph is None:
            return parts
        for storey in self._storeys_near(way):
            u, v, window = self._cells_around(storey, way)
            labels = np.where(np.abs(u) <= way.width / 2 + self.robot.radius, self.graph.parts[window], 0)
            for part, side in zip(parts, (-1, 1), strict=True):
                if self._has_floor(storey, way, side):
                    part |= set(labels[side * v > way.depth / 2].tolist()) - {0}
        return parts

    def _off_levels(self, door: Door, way: Doorway) -> DoorCheck:
        """Describe a door whose bottom is at no level: its sill is too high for the robot, or there is no floor."""
        beside = self._levels_beside(way)
        above = [way.bottom - level for level in beside if way.bottom - level > self.step]
        found = (door.global_id, door.name, None, door.spaces)
        if not above:
            return DoorCheck(*found, "nowhere", way.width, None, False, "no-floor", "no floor lies at its height")
        leads: Literal["inside", "outside"] = "inside" if len(door.spaces) > 1 else "outside"
        sill = min(above)
        detail = f"its sill is {sill:.2f} m above the floor; the robot climbs {self.robot.step_height:.2f} m"
        return DoorCheck(*found, leads, way.width, sill, False, "sill", detail)

    def _levels_beside(self, way: Doorway, sides: Sequence[int] = (-1, 1)) -> list[float]:
        """Return the heights of the floors beside a door that are at most a metre above or below it."""
        near = self._storeys_near(way)
        return [self.environment.levels[k] for k in near if any(self._has_floor(k, way, side) for side in sides)]

    def _storeys_near(self, way: Doorway) -> list[int]:
        levels = enumerate(self.environment.levels)
        return [k for k, level in levels if abs(level - way.bottom) <= _OTHER_LEVEL]

    def _has_floor(self, storey: int, way: Doorway, side: int) -> bool:
        """Tell whether there is floor on one side of a door, other than doorways."""
        front = way.before(side, _SIDE)
        near = [self.floors[storey][k] for k in self.trees[storey].query(front, predicate="intersects").tolist()]
        return bool(sum(polygon.intersection(front).area for polygon in near) > _PRESENT)

    def _on_level(self, storey: int, door: Door, way: Doorway) -> DoorCheck:
        level = self.environment.levels[storey]
        sides = [side for side in (-1, 1) if self._has_floor(storey, way, side)]
        found = (door.global_id, door.name, storey, door.spaces)
        sill = max(way.bottom - level, 0.0)
        if not sides:
            return DoorCheck(*found, "nowhere", way.width, sill, False, "no-floor", "no floor lies at its sides")
        others = self._levels_beside(way, [-sides[0]]) if len(sides) == 1 else []
        if others:
            beyond = min(others, key=lambda other: abs(other - level)) - level
            detail = f"the floor behind it lies {abs(beyond):.2f} m {'higher' if beyond > 0 else 'lower'}"
            sill = max(sill, way.bottom - level - beyond)
            return DoorCheck(*found, "inside", way.width, sill, False, "step", detail)
        leads: Literal["inside", "outside"] = "inside" if len(sides) == 2 else "outside"
        if way.width >= 2 * self.robot.radius and self._passes(storey, way, sides):
            return DoorCheck(*found, leads, way.width, sill, True)
        reason, detail, obstacles = self._why_not(storey, way)
        return DoorCheck(*found, leads, way.width, sill, False, reason, detail, obstacles)

    def _passes(self, storey: int, way: Doorway, sides: Sequence[int]) -> bool:
        """Tell whether the robot gets from side to side, or from its one side into the doorway."""
        if self.graph is None:
            return False
        from scipy import ndimage

        u, v, window = self._cells_around(storey, way)
        half, d = max(way.depth / 2, self.graph.frame.cell_size / 2), self.graph.frame.cell_size
        is_near = np.abs(u) <= np.where(np.abs(v) > half, way.width / 2 + _AROUND, way.width / 2)
        labels = ndimage.label(self.graph.free[window] & is_near)[0]
        if len(sides) == 2:
            ends = [side * v > half for side in sides]
        else:
            within = (np.abs(u) <= way.width / 2) & (sides[0] * v < half + self.robot.radius - d / 5)
            ends = [sides[0] * v > half, within]
        first, second = (set(labels[cells].tolist()) - {0} for cells in ends)
        return not first.isdisjoint(second)

    def _cells_around(
        self, storey: int, way: Doorway
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, slice, slice]]:
        """Return how far cells around a doorway lie along and across it, metres, and which cells they are."""
        assert self.graph is not None  # noqa: S101 - callers have seen to it
        frame = self.graph.frame
        reach = np.hypot(way.width / 2 + _AROUND, way.depth / 2 + 2 * self.robot.radius + _SIDE)
        first = np.array([frame.first_col, frame.first_row])
        corners = [np.floor((way.center - reach) / frame.cell_size), np.ceil((way.center + reach) / frame.cell_size)]
        (col, row), (cols, rows) = np.clip(np.array(corners, dtype=int) - first, 0, (frame.cols, frame.rows)).tolist()
        xy = np.stack(np.meshgrid(np.arange(col, cols), np.arange(row, rows)), axis=-1) + first + 0.5
        u, v = ((xy * frame.cell_size - way.center) @ axis for axis in (way.along, way.across))
        return u, v, (storey, slice(row, rows), slice(col, cols))

    def _why_not(self, storey: int, way: Doorway) -> tuple[Obstruction, str, tuple[str, ...]]:
        robot, level = self.robot, self.environment.levels[storey]
        if way.width < 2 * robot.radius:
            short = 2 * robot.radius - way.width
            return "narrow", f"it is {way.width:.2f} m wide, {100 * short:.0f} cm too narrow for the robot", ()
        if way.top - level < robot.height:
            return "low", f"it is {way.top - level:.2f} m high; the robot is {robot.height:.2f} m", ()
        corridor = way.rectangle(2 * robot.radius)
        taken = {o: o.footprint.intersection(corridor).area for o in self.environment.obstacles_on(storey)}
        within = sorted((o for o, area in taken.items() if area > _TOUCH), key=lambda o: -taken[o])
        if within:
            names = listed(o.name or o.ifc_class for o in within)
            return "blocked", f"blocked by {names}", tuple(o.global_id for o in within)
        spare = 100 * (way.width - 2 * robot.radius)
        cell = f" of {self.graph.frame.cell_size:g} m" if self.graph else ""
        return "cells", f"it leaves {spare:.0f} cm beside the robot; cells{cell} are too large to show the way", ()


def listed(names: Iterable[str], most: int = 3) -> str:
    """Return some names in a row, each once, and how many more there are."""
    known = list(dict.fromkeys(names))
    more = f" and {len(known) - most} more" if len(known) > most else ""
    return ", ".join(known[:most]) + more
