"""The parts of a floor that a robot cannot leave: what they cover, and what keeps them apart."""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav._connectors import Ascent
from bimnav._gates import DoorCheck, Gates, listed
from bimnav._why import FIXED
from bimnav.building import Door, Element
from bimnav.footprint import unite
from bimnav.graph import NavGraph
from bimnav.grid import GridFrame, rasterize

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Obstruction", "Reach"]

Mask: TypeAlias = NDArray[np.bool_]
Window: TypeAlias = tuple[slice, slice]

_LEAST_PART = 0.5  # square metres of standing room; less is a pocket between furniture
_NEAR_ENTRY = 1.0  # metres from the entry of a stair to the floor it leads from
_SAME_LEVEL = 0.35  # metres between the height of that entry and of that floor


class Obstruction(NamedTuple):
    """Why a robot does not get somewhere: a word, a sentence, advice, and the GlobalIds of what stops it."""

    reason: str
    detail: str
    hint: str
    culprits: tuple[str, ...] = ()


class RoomCells(NamedTuple):
    """A room on the grid: the parts of the floor in it, and how much of it is usable and covered, square metres."""

    storey: int
    parts: frozenset[int]
    area: float
    covered: float


_HINTS = {
    "narrow": "Use a smaller robot, or widen the door.",
    "low": "Use a lower robot.",
    "sill": "Use a robot that climbs higher, or a threshold ramp.",
    "step": "Use a robot that climbs higher, or a ramp.",
    "blocked": "Move what stands in the doorway, or have the task ignore it.",
    "cells": "Use smaller cells.",
    "no-floor": "Model the floor on both sides of the door.",
    "furniture": "Move it, or have the task ignore it.",
    "outside": "Allow outdoors=True, or start the robot in this part.",
    "stairs": "Start the robot on this level, or use a lift.",
    "no-door": "Model the door or the opening that leads there; if it is a shaft, name it so.",
    "apart": "Look at the model there: a wall may miss its opening.",
    "full": "Use a smaller robot, or have the task ignore what stands there.",
    "small": "Use a smaller robot.",
}


def obstruction(reason: str, detail: str, culprits: Iterable[str] = ()) -> Obstruction:
    """Return an obstruction with the advice that goes with its reason."""
    return Obstruction(reason, detail, _HINTS.get(reason, ""), tuple(dict.fromkeys(culprits)))


def _widened(frame: GridFrame, margin: int) -> GridFrame:
    return replace(
        frame,
        first_row=frame.first_row - margin,
        first_col=frame.first_col - margin,
        rows=frame.rows + 2 * margin,
        cols=frame.cols + 2 * margin,
    )


class Reach:
    """What a robot reaches on every level, coming from the largest part of each.

    Its cells are those of the graph, with a margin where the middle of the robot cannot be but its body can.

    Parameters
    ----------
    graph
        The cells of an environment.
    gates, checks
        Its doorways, and what came of trying its doors.
    connectors
        What leads to other levels.
    """

    def __init__(
        self, graph: NavGraph, gates: Gates, checks: Sequence[DoorCheck], connectors: Sequence[Ascent]
    ) -> None:
        self.environment = gates.environment
        margin = math.ceil(self.environment.robot.radius / graph.frame.cell_size) + 1
        self.frame = _widened(graph.frame, margin)
        self.parts = np.pad(graph.parts, ((0, 0), (margin, margin), (margin, margin)))
        self._floor = np.pad(graph.floor, ((0, 0), (margin, margin), (margin, margin)))
        self.sizes = np.bincount(self.parts.ravel())
        self.sizes[0] = 0
        self.main = [int(level.flat[self.sizes[level].argmax()]) for level in self.parts]
        self._gates, self._checks, self._connectors = gates, checks, connectors

    @cached_property
    def usable(self) -> tuple[Mask, ...]:
        """(rows, cols) bool for each level: floor that nothing stands on, however large the robot is."""
        frame, environment = self.frame, self.environment
        everywhere = shapely.box(*frame.bounds)
        masks = []
        for storey in range(len(environment.levels)):
            floor = unite(region.polygon for region in environment.regions if region.storey == storey)
            solid = [obstacle.footprint for obstacle in environment.obstacles_on(storey)]
            masks.append(~rasterize(frame, [everywhere.difference(floor), *solid]))
        return tuple(masks)

    @cached_property
    def covered(self) -> tuple[Mask, ...]:
        """(rows, cols) bool for each level: usable floor that the robot's body gets to."""
        from scipy import ndimage

        reach = self.environment.robot.radius / self.frame.cell_size + 0.5
        masks = []
        for level, main, usable in zip(self.parts, self.main, self.usable, strict=True):
            near = ndimage.distance_transform_edt(level != main) <= reach if main else np.zeros_like(usable)
            masks.append(near & usable)
        return tuple(masks)

    def area(self, cells: Mask) -> float:
        """Return the area of cells, square metres."""
        return float(np.count_nonzero(cells) * self.frame.cell_size**2)

    def cells_in(self, polygon: BaseGeometry) -> tuple[Window, Mask]:
        """Return the cells whose middle lies in a polygon: a window of rows and columns, and a mask of it."""
        frame = self.frame
        x0, y0, x1, y1 = np.array(polygon.bounds) / frame.cell_size
        cols = slice(max(int(x0) - frame.first_col - 1, 0), max(int(x1) - frame.first_col + 2, 0))
        rows = slice(max(int(y0) - frame.first_row - 1, 0), max(int(y1) - frame.first_row + 2, 0))
        x = (np.arange(frame.cols)[cols] + frame.first_col + 0.5) * frame.cell_size
        y = (np.arange(frame.rows)[rows] + frame.first_row + 0.5) * frame.cell_size
        shapely.prepare(polygon)
        return (rows, cols), shapely.contains_xy(polygon, *np.meshgrid(x, y))

    def parts_in(self, storey: int, polygon: BaseGeometry) -> set[int]:
        """Return the numbers of the parts that reach into a polygon."""
        window, inside = self.cells_in(polygon)
        return set(np.unique(self.parts[storey][window][inside]).tolist()) - {0}

    @cached_property
    def rooms(self) -> dict[str, RoomCells]:
        """Every room that is floor, by its GlobalId."""
        rooms = {}
        for region in self.environment.regions:
            if region.source == "space":
                window, inside = self.cells_in(region.polygon)
                parts = frozenset(np.unique(self.parts[region.storey][window][inside]).tolist()) - {0}
                masks = (self.usable[region.storey], self.covered[region.storey])
                rooms[region.global_id] = RoomCells(
                    region.storey, parts, *(self.area(mask[window] & inside) for mask in masks)
                )
        return rooms

    def parts_on(self, storey: int) -> list[int]:
        """Return the numbers of the parts of a level, the largest first; pockets between furniture do not count."""
        present = np.unique(self.parts[storey])
        wide = present[self.sizes[present] * self.frame.cell_size**2 >= _LEAST_PART]
        parts: list[int] = wide[np.argsort(-self.sizes[wide], kind="stable")].tolist()
        return parts

    def why_not(self, storey: int, parts: Collection[int], polygon: BaseGeometry) -> Obstruction:
        """Return what keeps the robot, coming from the main part of a level, out of a room and the parts in it."""
        if not parts:
            return self._no_place(storey, polygon)
        parts = set(parts)
        for find in (self._closed_door, self._furniture, self._way_outside, self._way_over_stairs):
            found = find(storey, parts)
            if found is not None:
                return found
        if any(not parts.isdisjoint(back | front) for _, back, front in self._ways):
            return obstruction("apart", "it has doors, but no way leads through them to the rest of the storey")
        return obstruction("no-door", "no door or passage leads into it")

    def _no_place(self, storey: int, polygon: BaseGeometry) -> Obstruction:
        """Say why the robot cannot stand anywhere in a room."""
        radius = self.environment.robot.radius
        if shapely.buffer(polygon, -radius).is_empty:
            return obstruction("small", f"it is narrower than the robot, {2 * radius:.2f} m")
        taken = {o: o.footprint.intersection(polygon).area for o in self.environment.obstacles_on(storey)}
        within = sorted((o for o, area in taken.items() if area > 0), key=lambda o: -taken[o])
        names = listed(o.name or o.ifc_class for o in within)
        return obstruction("full", f"{names} leave no room to stand", (o.global_id for o in within))

    @cached_property
    def _ways(self) -> list[tuple[DoorCheck, set[int], set[int]]]:
        """Doors and passages, with the parts in front of either side."""
        building = self.environment.building
        openings = {opening.global_id: opening for opening in building.openings}
        passages = (openings[g] for g in self._gates.on if g in openings)
        gaps = [Door(Element(opening.global_id, "IfcOpeningElement", "passage"), opening) for opening in passages]
        tried = [*zip(building.doors, self._checks, strict=True), *((gap, self._gates.check(gap)) for gap in gaps)]
        return [(check, *self._gates.parts_beside(door)) for door, check in tried]

    @cached_property
    def _closed(self) -> dict[int, list[tuple[int, DoorCheck]]]:
        """What part is kept from what other part by which closed door or passage."""
        beyond: dict[int, list[tuple[int, DoorCheck]]] = defaultdict(list)
        for check, back, front in self._ways:
            if not check.connects and check.leads == "inside":
                for a, b in ((a, b) for a in sorted(back) for b in sorted(front) if a != b):
                    beyond[a].append((b, check))
                    beyond[b].append((a, check))
        return beyond

    def _closed_door(self, storey: int, parts: set[int]) -> Obstruction | None:
        """Find the first door that stops the robot on the way that meets the fewest of them."""
        queue = deque([self.main[storey], *self.main])  # a step may lead to another level
        seen: dict[int, tuple[DoorCheck, int] | None] = dict.fromkeys(queue)
        while queue:
            part = queue.popleft()
            if part in parts:
                return self._at_door(part, seen)
            for other, check in self._closed.get(part, ()):
                if other not in seen:
                    seen[other] = (check, part)
                    queue.append(other)
        return None

    @staticmethod
    def _at_door(part: int, came: dict[int, tuple[DoorCheck, int] | None]) -> Obstruction:
        doors: list[DoorCheck] = []
        while (step := came[part]) is not None:
            doors.append(step[0])
            part = step[1]
        first = doors[-1]
        more = f"; {len(doors) - 1} more on the way" if len(doors) > 1 else ""
        detail = f"door {first.name or first.global_id}: {first.detail}{more}"
        return obstruction(
            first.reason, detail, [g for door in reversed(doors) for g in (door.global_id, *door.obstacles)]
        )

    def _furniture(self, storey: int, parts: set[int]) -> Obstruction | None:
        """Find the things that can be moved and without which the robot would get through."""
        cells = np.isin(self.parts[storey], list(parts))
        if not (self._without_furniture[storey] & cells).any():
            return None
        rows, cols = np.nonzero(cells)
        d, (x0, y0) = self.frame.cell_size, self.frame.origin
        tree = shapely.STRtree(shapely.points(x0 + (cols + 0.5) * d, y0 + (rows + 0.5) * d))
        movable = ((o, body) for o, body in self.environment.bodies_on(storey) if not o.ifc_class.startswith(FIXED))
        near = [o for o, body in movable if len(tree.query(body, predicate="dwithin", distance=2 * d))]
        names = listed(o.name or o.ifc_class for o in near)
        return obstruction("furniture", f"{names} stand in the way", (o.global_id for o in near))

    @cached_property
    def _without_furniture(self) -> tuple[Mask, ...]:
        """(rows, cols) bool for each level: what the robot would reach if all that can be moved were gone."""
        from scipy import ndimage

        masks = []
        for storey, main in enumerate(self.main):
            fixed = [b for o, b in self.environment.bodies_on(storey) if o.ifc_class.startswith(FIXED)]
            labels = ndimage.label(self._floor[storey] & ~rasterize(self.frame, fixed))[0]
            masks.append((labels == labels[self.parts[storey] == main][0]) & bool(main))
        return tuple(masks)

    def _way_outside(self, _storey: int, parts: set[int]) -> Obstruction | None:
        ways = [
            check
            for check, back, front in self._ways
            if check.leads == "outside" and check.connects and not parts.isdisjoint(back | front)
        ]
        if not ways:
            return None
        names = listed(check.name or check.global_id for check in ways)
        return obstruction("outside", f"the only way leads outside, through {names}", (c.global_id for c in ways))

    def _way_over_stairs(self, storey: int, parts: set[int]) -> Obstruction | None:
        ways = [c for c in self._connectors if any(self._is_entry(storey, parts, entry) for entry in c.entries)]
        if not ways:
            return None
        names = listed(f"{way.kind} {way.name}".strip() for way in ways)
        return obstruction("stairs", f"the only way leads over {names}", (way.global_id for way in ways))

    def _is_entry(self, storey: int, parts: set[int], entry: Sequence[float]) -> bool:
        """Tell whether an entry of a connector lies at parts of a level."""
        x, y, z = entry
        if abs(z - self.environment.levels[storey]) > _SAME_LEVEL:
            return False
        around = shapely.box(x - _NEAR_ENTRY, y - _NEAR_ENTRY, x + _NEAR_ENTRY, y + _NEAR_ENTRY)
        return not parts.isdisjoint(self.parts_in(storey, around))

    def connectors_on(self, storey: int) -> tuple[str, ...]:
        """Return the GlobalIds of the stairs, ramps and lifts that end on a level."""
        level = self.environment.levels[storey]
        return tuple(c.global_id for c in self._connectors if any(abs(z - level) <= _SAME_LEVEL for z in c.levels))
