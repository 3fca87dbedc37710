"""What floors are made of: rooms with their bases, the upper sides of slabs, and which rooms are shafts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bimnav._doorways import doorway_of
from bimnav._indoors import part_in
from bimnav.building import Building, Element, Shape, Space
from bimnav.footprint import unite

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["FLUSH", "NEAR", "ROUNDING", "Ground", "Room", "Top"]

NEAR = 0.35
"""A slab, wall or threshold this near to a level, in metres, belongs to it."""

FLUSH = 0.01
"""Floor finishes differ by this many metres without a step."""

ROUNDING = 1e-6
"""Heights that differ by fewer metres are equal."""

_LEAST_TOP = 0.05  # square metres
_SKIN = 0.02  # metres above and below its top at which a slab is cut
_LEVEL = 0.9999  # of the normal of a face one can walk on: less than a degree
_CARRIED = 0.5  # share of a plan that slabs carry; with less they are not modelled, or not there
_AGREE = 0.8  # share of the doors on a level that must stand equally high to tell its height
_STOREY = 1.0  # metres; a room that reaches this far into another storey goes through it
_NOT_TROD = ("ROOF", "CEILING", "CLADDING", "ROOFING", "INSULATION", "MEMBRANE", "SLEEVING", "WRAPPING", "MOLDING")
_SHAFT = re.compile(
    r"\b(elev|elevators?|lifts?|shafts?|hoistway|voids?|open to below|risers?|chute|\w*schacht|\w*aufzug|luftraum"
    r"|ascenseur|gaine|vide|trémie|ascensor|hueco|vano|cavedio|liftkoker|шахта|лифт)\b",
    re.IGNORECASE,
)
_BESIDE_SHAFT = re.compile(
    r"\b(eq|equip\w*|mach\w*|mech\w*|rm|rooms?|lobb\w*|hall|vestibule|foyer|landing|control|\w*raum|\w*flur|palier)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A space with a plan; `base`, where one walks, and `top` are world heights in metres, `storey` an index."""

    space: Space
    storey: int
    base: float
    top: float
    plan: BaseGeometry


@dataclass(frozen=True, slots=True, eq=False)
class Top:
    """The level upper side of a slab, floor covering or landing, at a world height in metres."""

    element: Element
    height: float
    plan: BaseGeometry
    source: Literal["slab", "covering", "landing"] | None  # None: it carries, but nobody walks on it


class Ground:
    """What a building offers to walk on, before anything is said about levels.

    Parameters
    ----------
    step
        What counts as one height, metres.
    """

    def __init__(self, building: Building, step: float) -> None:
        self.building = building
        self.step = max(step, FLUSH) + ROUNDING
        self.elevations = np.array([storey.elevation for storey in building.storeys])
        self.doors = [(door, way) for door in building.doors if (way := doorway_of(door, building)) is not None]
        self.tops = list(_tops(building))
        rooms = sorted(self._rooms(), key=lambda room: (room.base, room.space.global_id))
        self.shafts = [room for room in rooms if self._is_shaft(room)]
        self.rooms = [room for room in rooms if room not in self.shafts]

    def storey_at(self, height: float) -> int:
        """Return the index of the storey nearest to a height if one is near, else of the highest below it."""
        nearest = int(np.abs(self.elevations - height).argmin())
        if abs(self.elevations[nearest] - height) <= NEAR:
            return nearest
        return max(int(np.searchsorted(self.elevations, height)) - 1, 0)

    def carried(self, plan: BaseGeometry, level: float) -> BaseGeometry:
        """Return the part of a plan that slabs carry.

        Their tops are as high as the level; or a little lower, under a finish that is not modelled, if
        those at the level carry next to nothing.
        """
        over = [
            top for top in self.tops if level - NEAR <= top.height <= level + self.step and top.plan.intersects(plan)
        ]
        flush = unite(top.plan for top in over if level - top.height <= self.step).intersection(plan)
        if flush.area >= _CARRIED * plan.area:
            return flush
        return unite(top.plan for top in over).intersection(plan)

    def is_carried(self, plan: BaseGeometry, level: float) -> bool:
        """Tell whether slabs carry a plan."""
        return bool(self.carried(plan, level).area >= _CARRIED * plan.area)

    def groups(self) -> Iterable[list[Room]]:
        """Group the rooms of every storey that lie at one height."""
        for storey in range(len(self.elevations)):
            group: list[Room] = []
            for room in (room for room in self.rooms if room.storey == storey):
                if group and room.base - group[-1].base > self.step:
                    yield group
                    group = []
                group.append(room)
            if group:
                yield group

    def level_of(self, group: Sequence[Room]) -> float:
        """Return the height one walks on: the base of most of the rooms, else that of the doors on it.

        Some exporters begin a room at the underside of a slab that is not modelled; its doors then all
        stand equally high above it.
        """
        areas = np.array([room.plan.area for room in group])
        base = group[int(np.searchsorted(areas.cumsum(), areas.sum() / 2))].base
        ids = {room.space.global_id for room in group}
        bottoms = np.array([way.bottom for door, way in self.doors if ids.intersection(door.spaces)])
        if len(bottoms) > 1:
            middle = float(np.median(bottoms))
            agree = (np.abs(bottoms - middle) <= 2 * FLUSH).mean()
            if agree >= _AGREE and self.step < middle - base <= NEAR:
                return middle
        return base

    def _rooms(self) -> Iterable[Room]:
        storeys = {storey.global_id: k for k, storey in enumerate(self.building.storeys)}
        for space in self.building.spaces:
            bounds = space.bounds
            if bounds is None:
                continue
            base, top = bounds[:, 2].tolist()
            cut = min(base + 0.1, (base + top) / 2)
            plan = part_in(space.shapes, cut - 0.01, cut + 0.01)
            if plan.area > 0:
                storey = storeys.get(space.storey or "", self.storey_at(base))
                yield Room(space, storey, self._laid_on(plan, base), top, plan)

    def _laid_on(self, plan: BaseGeometry, base: float) -> float:
        """Return the height of the floor in a room: of the slab or finish laid in it if its base is below that."""
        within = [top for top in self.tops if self.step < top.height - base <= NEAR and top.plan.intersects(plan)]
        for height in sorted({top.height for top in within}):
            laid = unite(top.plan for top in within if abs(top.height - height) <= FLUSH)
            if laid.intersection(plan).area >= _CARRIED * plan.area:
                return height
        return base

    def _is_shaft(self, room: Room) -> bool:
        """Tell a shaft: nothing to stand on, and either a name that says so or several storeys without a door."""
        if self.is_carried(room.plan, room.base):
            return False
        label = room.space.label
        if _SHAFT.search(label) and not _BESIDE_SHAFT.search(label):
            return True
        at_base = (door for door, way in self.doors if abs(way.bottom - room.base) <= NEAR)
        if any(room.space.global_id in door.spaces for door in at_base):
            return False
        passed = (room.base + NEAR < self.elevations) & (self.elevations < room.top - _STOREY)
        return bool(passed.any())


def _tops(building: Building) -> Iterable[Top]:
    for element in building.elements:
        if not element.ifc_class.startswith(("IfcSlab", "IfcCovering")):
            continue
        is_trod = element.predefined_type.upper() not in _NOT_TROD
        if element.ifc_class.startswith("IfcCovering") and not is_trod:
            continue
        source: Literal["slab", "covering", "landing"] = "slab"
        if element.ifc_class.startswith("IfcCovering"):
            source = "covering"
        if element.predefined_type == "LANDING" or _is_part_of_stair(element, building):
            source = "landing"
        for shape in element.shapes:
            for height in _level_heights(shape):
                below, above = part_in([shape], height - _SKIN, height), part_in([shape], height, height + _SKIN)
                plan = below.difference(above)
                if plan.area >= _LEAST_TOP:
                    yield Top(element, height, plan, source if is_trod else None)


def _is_part_of_stair(element: Element, building: Building) -> bool:
    whole = element.parent or ""
    return whole in building and building[whole].ifc_class.startswith(("IfcStair", "IfcRamp"))


def _level_heights(shape: Shape) -> list[float]:
    """Return the heights at which a shape has level faces, metres, whichever way they look."""
    corners = shape.world_vertices()[shape.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    is_level = (np.abs(normals[:, 2]) > _LEVEL * length) & (length > 0)
    heights, index = np.unique(np.round(corners[is_level].mean(axis=1)[:, 2], 4), return_inverse=True)
    areas = np.bincount(index, length[is_level] / 2, len(heights))
    wide: list[float] = heights[areas >= _LEAST_TOP].tolist()
    return wide
