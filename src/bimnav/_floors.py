"""Where the floor is: walkable levels from spaces, slabs or walls, and the doorways between them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import shapely

from bimnav.building import Building, Element, Issue, Shape, Space, Storey
from bimnav.footprint import Footprint, footprints_of, merge_footprints, project
from bimnav.robot import Robot

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["NEAR", "Floor", "FloorSource", "find_floors", "outline"]

FloorSource: TypeAlias = Literal["space", "slab", "hull", "door", "passage"]
Piece: TypeAlias = "tuple[str, str, BaseGeometry, FloorSource]"  # GlobalId, name, polygon, source

NEAR = 0.35
"""A slab, wall or threshold this near to a level, in metres, belongs to it."""

_LEAST_FLOOR = 1.0  # square metres; slabs that add up to less are markers and plinths, not a floor
_DOOR_REACH = 0.15  # metres a door without an opening reaches through its curtain wall, to either side


def outline(shapes: Sequence[Shape]) -> BaseGeometry:
    """Return the plan view of shapes over their whole height."""
    return merge_footprints([project(shape) for shape in shapes]).polygon


def _parts_in(shapes: Sequence[Shape], low: float, high: float) -> list[Footprint]:
    return [footprint for footprint in footprints_of(shapes, low, high) if footprint is not None]


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """One walkable level: where it is, and what says that one can walk there."""

    storey: Storey
    level: float
    pieces: tuple[Piece, ...] = ()


def find_floors(building: Building, robot: Robot) -> tuple[tuple[Floor, ...], tuple[Issue, ...]]:
    """Find every storey's floor: from its spaces, else its slabs, else the hull of its walls."""
    layers = [
        _space_floors(building, index, robot) or _slab_floors(building, storey)
        for index, storey in enumerate(building.storeys)
    ]
    doorways = list(_doorways(building))
    guessed = []
    for index, storey in enumerate(building.storeys):
        has_door = any(abs(sill - storey.elevation) <= NEAR for _, sill in doorways)
        if not layers[index] and (has_door or not any(layers)):
            layers[index] = _hull_floors(building, storey)
            guessed += [storey.global_id for _ in layers[index]]
    floors = [
        floor
        for index, storey in enumerate(building.storeys)
        for floor in layers[index] or [Floor(storey, storey.elevation)]
    ]
    floors.sort(key=lambda floor: floor.level)
    for k, floor in enumerate(floors):
        lowest, highest = floor.level - NEAR, floor.level + robot.step_height
        own = tuple(piece for piece, sill in doorways if floor.pieces and lowest <= sill <= highest)
        floors[k] = replace(floor, pieces=floor.pieces + own)
    issues: tuple[Issue, ...] = ()
    if guessed:
        message = "storeys without spaces and floor slabs: their floor is guessed as the hull of their walls."
        issues = (Issue("floor-guessed", message, tuple(guessed), "warning", "Export spaces or floor slabs."),)
    return tuple(floors), issues


def _space_floors(building: Building, index: int, robot: Robot) -> list[Floor]:
    """Group the spaces of a storey by the height of their base; every group is a level."""
    storey = building.storeys[index]
    based: list[tuple[float, Space, BaseGeometry]] = []
    for space in building.spaces:
        bounds = space.bounds
        if bounds is not None and _storey_of(building, space, float(bounds[0, 2])) == index:
            base, top = float(bounds[0, 2]), float(bounds[1, 2])
            cut = min(base + 0.1, (base + top) / 2)
            polygon = merge_footprints(_parts_in(space.shapes, cut - 0.01, cut + 0.01)).polygon
            if polygon.area > 0:
                based.append((base, space, polygon))
    based.sort(key=lambda entry: (entry[0], entry[1].global_id))
    groups: list[list[tuple[float, Space, BaseGeometry]]] = []
    for entry in based:
        if not groups or entry[0] - groups[-1][-1][0] > robot.step_height:
            groups.append([])
        groups[-1].append(entry)
    floors = []
    main = max(groups, key=lambda group: sum(polygon.area for _, _, polygon in group), default=None)
    for group in groups:
        areas = np.array([polygon.area for _, _, polygon in group])
        level = group[int(np.searchsorted(areas.cumsum(), areas.sum() / 2))][0]
        named = storey
        if group is not main:
            named = replace(storey, name=f"{storey.name} ({level:+.2f} m)", elevation=level)
        pieces: tuple[Piece, ...] = tuple(
            (space.global_id, space.label, polygon, "space") for _, space, polygon in group
        )
        floors.append(Floor(named, level, pieces))
    return floors


def _storey_of(building: Building, space: Space, base: float) -> int:
    """Return the storey of a space: what the file says, else the highest below its base."""
    for index, storey in enumerate(building.storeys):
        if storey.global_id == space.storey:
            return index
    below = [i for i, storey in enumerate(building.storeys) if storey.elevation <= base + NEAR]
    return below[-1] if below else 0


def _slab_floors(building: Building, storey: Storey) -> list[Floor]:
    """Take the tops of slabs and floor coverings near the storey's elevation."""
    tops: list[tuple[float, Element, BaseGeometry]] = []
    for element in building.elements:
        bounds = element.bounds
        if bounds is None or not element.ifc_class.startswith(("IfcSlab", "IfcCovering")):
            continue
        top = float(bounds[1, 2])
        if element.predefined_type in ("ROOF", "CEILING", "CLADDING") or abs(top - storey.elevation) > NEAR:
            continue
        polygon = merge_footprints(_parts_in(element.shapes, max(top - 0.02, bounds[0, 2]), top)).polygon
        if polygon.area > 0:
            tops.append((top, element, polygon))
    if sum(polygon.area for _, _, polygon in tops) < _LEAST_FLOOR:
        return []
    heights = sorted({top for top, _, _ in tops})
    level = max(heights, key=lambda h: sum(polygon.area for top, _, polygon in tops if abs(top - h) <= 0.02))
    pieces: tuple[Piece, ...] = tuple(
        (element.global_id, element.name, polygon, "slab") for top, element, polygon in tops if top <= level + 0.02
    )
    return [Floor(storey, level, pieces)]


def _hull_floors(building: Building, storey: Storey) -> list[Floor]:
    """Take the hull of the walls that stand on a storey: a guess, and said to be one."""
    walls = []
    for element in building.elements:
        bounds = element.bounds
        if bounds is None or not element.ifc_class.startswith(("IfcWall", "IfcCurtainWall")):
            continue
        if abs(float(bounds[0, 2]) - storey.elevation) <= NEAR:
            walls.append(outline(element.shapes))
    hull = shapely.union_all(walls).convex_hull
    if hull.area == 0:
        return []
    return [Floor(storey, storey.elevation, ((storey.global_id, f"hull of {storey.name}", hull, "hull"),))]


def _doorways(building: Building) -> Iterable[tuple[Piece, float]]:
    """Yield the floor in doors and in unfilled openings of walls, with the height of its sill."""
    for door in building.doors:
        if door.opening is not None and door.opening.shapes:
            polygon = outline(door.opening.shapes)
            bounds = door.opening.bounds
        else:
            leaf = outline(door.element.shapes)
            polygon = shapely.buffer(leaf.minimum_rotated_rectangle, _DOOR_REACH, join_style="mitre")
            bounds = door.element.bounds
        if bounds is not None and polygon.area > 0:
            yield (door.global_id, door.name, polygon, "door"), float(bounds[0, 2])
    for opening in building.openings:
        bounds = opening.bounds
        if opening.fillings or bounds is None or opening.host is None or opening.host not in building:
            continue
        if building[opening.host].ifc_class.startswith("IfcWall"):
            polygon = outline(opening.shapes)
            yield (opening.global_id, "passage", polygon, "passage"), float(bounds[0, 2])
