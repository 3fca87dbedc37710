"""Where the floor is: walkable levels from rooms, slabs or walls, and the doorways between them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import shapely

from bimnav._doorways import Doorway, doorway_of
from bimnav._indoors import Shell, opened, part_in
from bimnav._levels import NEAR, Ground, Room
from bimnav._wording import counted
from bimnav.building import Building, Issue, Storey
from bimnav.footprint import unite
from bimnav.robot import Robot

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["FLOOR_SOURCES", "NEAR", "Floor", "FloorSource", "Piece", "find_floors"]

FloorSource: TypeAlias = Literal["space", "slab", "covering", "landing", "hull", "door", "passage", "outdoors"]

FLOOR_SOURCES: tuple[FloorSource, ...] = ("space", "slab", "covering", "landing", "hull", "door", "passage")
"""What may say that there is floor indoors."""

_LEAST_FLOOR = 2.0  # square metres; a slab with less is a marker, a plinth or a tread, not a level
_LEAST_VOID = 0.1  # square metres; a smaller hole under a room is where slabs meet badly
_NARROW = 0.2  # metres; a gap between slabs as narrow as this is a joint
_SEAM = 0.04  # metres; what rooms and walls leave over is no floor if it is no wider
_BARE = 0.95  # share of a room over no slab, above which it is not the slab that has a hole
_REACH = 0.5  # metres; a door is joined to floor this near to its opening
_PRESENT = 0.02  # square metres of floor before a door; less is a corner of something else
_DOOR_DEPTH = 0.15  # metres a door without an opening reaches through its curtain wall, to either side
_MARGIN = 2.0  # metres of ground around a building whose ground is not modelled


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A piece of floor, and what says that it is one."""

    global_id: str
    name: str
    polygon: BaseGeometry
    source: FloorSource


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """One walkable level."""

    storey: Storey
    level: float
    pieces: tuple[Piece, ...] = ()

    @property
    def plan(self) -> BaseGeometry:
        """All of its pieces."""
        return unite(piece.polygon for piece in self.pieces)

    def with_pieces(self, pieces: Iterable[Piece]) -> Floor:
        """Return the floor with pieces added; empty ones do not count."""
        return replace(self, pieces=(*self.pieces, *(piece for piece in pieces if piece.polygon.area > 0)))


def find_floors(
    building: Building,
    robot: Robot,
    *,
    sources: Collection[FloorSource] = FLOOR_SOURCES,
    outdoors: bool = False,
) -> tuple[tuple[Floor, ...], tuple[Issue, ...]]:
    """Find every level one can walk on, from the lowest to the highest, and what is doubtful about them.

    Rooms make levels. A slab that is as high as a level fills what the rooms leave out, inside the
    building only; one at another height makes a level of its own. Every storey is at least one level.
    """
    survey = _Survey(building, robot, sources)
    floors, issues = survey.room_floors()
    floors += survey.slab_floors(floors)
    guessed = survey.hull_floors(floors)
    floors += guessed
    have = {floor.storey.global_id for floor in floors}
    floors += [Floor(s, s.elevation) for s in building.storeys if s.global_id not in have]
    floors.sort(key=lambda floor: floor.level)
    if outdoors:
        floors = survey.with_outdoors(floors)
    if guessed:
        message = counted(
            "{n} [storey has|storeys have] neither rooms nor slabs; the floor is guessed from walls.", len(guessed)
        )
        ids = tuple(floor.storey.global_id for floor in guessed)
        issues.append(Issue("floor-guessed", message, ids, "warning", "Export spaces or floor slabs."))
    return tuple(_named(survey.with_doorways(floors))), tuple(issues)


class _Survey:
    """What a building, its ground and its shell tell about floor."""

    def __init__(self, building: Building, robot: Robot, sources: Collection[FloorSource]) -> None:
        self.building, self.sources, self.height = building, sources, robot.height
        self.ground = Ground(building, robot.step_height)
        self.shell = Shell(building)
        self.step = self.ground.step
        glazed = (o for o in building.openings if o.fillings and all(self._is_window(g) for g in o.fillings))
        self.windows = [way for opening in glazed if (way := doorway_of(opening, building)) is not None]
        over = ("IfcSlab", "IfcRoof", "IfcCovering")
        self.over = [shape for e in building.elements if e.ifc_class.startswith(over) for shape in e.shapes]

    def _is_window(self, global_id: str) -> bool:
        return global_id in self.building and self.building[global_id].ifc_class.startswith("IfcWindow")

    def room_floors(self) -> tuple[list[Floor], list[Issue]]:
        """Make a level of every height at which rooms of a storey begin, and lay slabs between the rooms."""
        floors: list[Floor] = []
        bare: list[str] = []
        voids = [room.space.global_id for room in self.ground.shafts]
        for group in self.ground.groups() if "space" in self.sources else ():
            level = self.ground.level_of(group)
            holes = self._holes(group, level)
            pieces = []
            for room in group:
                global_id, hole = room.space.global_id, holes.intersection(room.plan)
                if hole.area > _BARE * room.plan.area:
                    has_door = any(global_id in door.spaces for door in self.building.doors)
                    (bare if has_door else voids).append(global_id)
                    plan = room.plan if has_door else shapely.Polygon()
                else:
                    plan = room.plan.difference(hole) if hole.area >= _LEAST_VOID else room.plan
                pieces.append(Piece(global_id, room.space.label, plan, "space"))
            floors.append(Floor(self.building.storeys[group[0].storey], level).with_pieces(pieces))
        floors = [floor.with_pieces(self._laid(floor.level, self._built_on(floor.level, floors))) for floor in floors]
        issues = []
        if bare:
            message = counted(
                "{n} [room has a door but no slab|rooms have doors but no slabs], as others have; taken as floor.",
                len(bare),
            )
            hint = "Model their slabs, or name them as shafts or voids."
            issues.append(Issue("missing-slab", message, tuple(bare), "warning", hint))
        if voids:
            message = counted("{n} [room is a shaft or void|rooms are shafts or voids]; not floor.", len(voids))
            issues.append(Issue("shaft", message, tuple(voids), "info", "A slab at their base would make them floor."))
        return floors, issues

    def _holes(self, group: Sequence[Room], level: float) -> BaseGeometry:
        """Return where rooms hang over a hole in the slabs; nowhere if slabs are not modelled."""
        plan = unite(room.plan for room in group)
        if not self.ground.is_carried(plan, level):
            return shapely.Polygon()
        return opened(plan.difference(self.ground.carried(plan, level)), _NARROW)

    def slab_floors(self, floors: Sequence[Floor]) -> list[Floor]:
        """Make levels of the slabs that are at the height of no other, from the highest down."""
        found: list[Floor] = []
        if "slab" not in self.sources:
            return found
        taken = [floor.level for floor in floors]
        heights = [top.height for top in self.ground.tops if top.source == "slab"]
        heights = [z for z in heights if all(abs(z - level) > self.step for level in taken)]
        while heights:
            layer = [z for z in heights if max(heights) - z <= self.step]
            heights = [z for z in heights if max(heights) - z > self.step]
            level = self._widest(layer)
            floor = Floor(self.building.storeys[self.ground.storey_at(level)], level)
            floor = floor.with_pieces(self._laid(level, self._built_on(level, (*floors, *found))))
            low = part_in(self.over, level + self.step, level + max(self.height, 2 * self.step))
            if floor.plan.difference(low).area >= _LEAST_FLOOR:
                found.append(floor)
        return found

    def _widest(self, heights: Collection[float]) -> float:
        tops = self.ground.tops
        return max(sorted(set(heights)), key=lambda z: sum(top.plan.area for top in tops if top.height == z))

    @staticmethod
    def _built_on(level: float, floors: Iterable[Floor]) -> BaseGeometry:
        """Return the plan of the floors at a level, and of those so little above it that they are built on it."""
        return unite(floor.plan for floor in floors if level <= floor.level <= level + NEAR)

    def _laid(self, level: float, known: BaseGeometry) -> Iterable[Piece]:
        """Yield what slabs, coverings and landings add to a floor: indoors, between the walls, not at windows."""
        tops = [t for t in self.ground.tops if t.source in self.sources and abs(t.height - level) <= self.step]
        if not tops:
            return
        french = (w.rectangle() for w in self.windows if w.bottom <= level + self.step < w.top)
        known = unite([known, self.shell.walls(level), *french])
        inside = None if self.shell.is_bare else self.shell.inside(level)
        for top in sorted(tops, key=lambda top: -top.height):
            left = top.plan if inside is None else top.plan.intersection(inside)
            left = left if known.is_empty else opened(left.difference(known), _SEAM)
            known = unite([known, left])
            if top.source is not None:
                yield Piece(top.element.global_id, top.element.name, left, top.source)

    def hull_floors(self, floors: Sequence[Floor]) -> list[Floor]:
        """Guess the floor of storeys that have doors but neither rooms nor slabs; of all if there are no doors."""
        found = []
        bottoms = [way.bottom for _, way in self.ground.doors]
        for storey in self.building.storeys if "hull" in self.sources else ():
            level = storey.elevation
            known = any(abs(floor.level - level) <= NEAR for floor in floors)
            if known or (not any(abs(z - level) <= NEAR for z in bottoms) and (bottoms or floors)):
                continue
            hull = self.shell.inside(level)
            if hull.area > 0:
                found.append(Floor(storey, level, (Piece(storey.global_id, f"hull of {storey.name}", hull, "hull"),)))
        return found

    def with_outdoors(self, floors: Sequence[Floor]) -> list[Floor]:
        """Add the ground around the building: slabs and terrain, else a margin on the lowest level with a way out."""
        found = [floor.with_pieces(self._around(floor)) if floor.pieces else floor for floor in floors]
        for k, floor in enumerate(floors):
            inside = unite([self.shell.inside(floor.level), floor.plan])
            ways = [way for _, way in self.ground.doors if -NEAR <= way.bottom - floor.level <= self.step]
            fronts = [front for way in ways for side in (-1, 1) if (front := way.before(side, _REACH)).area > 0]
            fronts = [front for front in fronts if front.intersection(inside).area < _PRESENT]
            if floor.pieces and fronts:
                if any(found[k].plan.intersection(front).area < _PRESENT for front in fronts):
                    around = shapely.buffer(inside, _MARGIN, join_style="mitre")
                    margin = around.difference(unite([inside, found[k].plan]))
                    piece = Piece(floor.storey.global_id, f"around {floor.storey.name}", margin, "outdoors")
                    found[k] = found[k].with_pieces([piece])
                break
        return found

    def _around(self, floor: Floor) -> Iterable[Piece]:
        """Yield slabs and terrain as high as a floor outside of the building."""
        level = floor.level
        indoors = unite([self.shell.inside(level), self.shell.walls(level), floor.plan])
        for top in self.ground.tops:
            if top.source is not None and abs(top.height - level) <= self.step:
                around = opened(top.plan.difference(indoors), _NARROW)
                yield Piece(top.element.global_id, top.element.name, around, "outdoors")
        for site in self.building.terrain:
            high = part_in(site.shapes, level + self.step, level + self.step + self.height)
            ground = part_in(site.shapes, level - self.step, level + self.step).difference(high)
            yield Piece(site.global_id, site.name, ground.difference(indoors), "outdoors")

    def with_doorways(self, floors: Sequence[Floor]) -> list[Floor]:
        """Add doorways and passages to the levels they open to."""
        added: list[list[Piece]] = [[] for _ in floors]
        plans = [floor.plan for floor in floors]
        for plan in plans:
            shapely.prepare(plan)
        for piece, way in self._doorways():
            rise = np.array([way.bottom - floor.level for floor in floors])
            sides = [way.before(side, _REACH) for side in (-1, 1)]
            flush, sunk = np.abs(rise) <= self.step, (rise >= -NEAR) & (rise < -self.step)
            for near in (flush, sunk):
                gaps = {k: _gaps(sides, plans[k]) for k in np.flatnonzero(near).tolist()}
                for k, between in gaps.items():
                    if between:
                        whole = unite([piece.polygon, *between]).difference(self._shafts(floors[k].level))
                        added[k].append(replace(piece, polygon=whole))
                if any(gaps.values()):
                    break
        return [floor.with_pieces(pieces) for floor, pieces in zip(floors, added, strict=True)]

    def _shafts(self, level: float) -> BaseGeometry:
        return unite(room.plan for room in self.ground.shafts if room.base - NEAR <= level < room.top)

    def _doorways(self) -> Iterable[tuple[Piece, Doorway]]:
        """Yield the floor in doors, and in openings of walls that nothing fills."""
        for door, way in self.ground.doors if "door" in self.sources else ():
            has_opening = door.opening is not None and door.opening.shapes
            yield Piece(door.global_id, door.name, way.rectangle(0 if has_opening else _DOOR_DEPTH), "door"), way
        for opening in self.building.openings if "passage" in self.sources else ():
            host, passage = opening.host or "", doorway_of(opening, self.building)
            is_wall = host in self.building and self.building[host].ifc_class.startswith("IfcWall")
            if is_wall and not opening.fillings and passage is not None:
                yield Piece(opening.global_id, "passage", passage.rectangle(), "passage"), passage


def _gaps(sides: Iterable[BaseGeometry], plan: BaseGeometry) -> list[BaseGeometry]:
    """Return what lies between a door and the floor near to it, for every side with floor."""
    return [side.difference(plan) for side in sides if plan.intersection(side).area > _PRESENT]


def _named(floors: Sequence[Floor]) -> Iterable[Floor]:
    """Give the levels of a storey names of their own; the widest keeps the storey's."""
    area = [floor.plan.area for floor in floors]
    for k, floor in enumerate(floors):
        same = [i for i, other in enumerate(floors) if other.storey is floor.storey]
        if k == max(same, key=lambda i: area[i]):
            yield floor
        else:
            name = f"{floor.storey.name} ({floor.level:+.2f} m)"
            yield replace(floor, storey=replace(floor.storey, name=name, elevation=floor.level))
