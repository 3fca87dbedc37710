"""What a robot can reach in a building, and why not the rest."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bimnav import _checks
from bimnav._connectors import Ascent
from bimnav._findings import findings
from bimnav._gates import DoorCheck, Gates, doors_of
from bimnav._reach import Reach
from bimnav.building import Building, Issue
from bimnav.environment import IndoorEnvironment, make_environment
from bimnav.errors import GridTooLargeError, NothingWalkableError
from bimnav.footprint import unite
from bimnav.graph import build_graph
from bimnav.robot import Robot
from bimnav.tasks import Task

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["DoorCheck", "Readiness", "RoomCheck", "StoreyCheck", "doors_of", "readiness"]

PARTITIONS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcMember", "IfcWindow", "IfcColumn")
_NO_FLOOR = {
    "shaft": ("shaft", "it is a shaft or void", "If it is floor, model a slab or a door at its base."),
    "no-shape": ("no-shape", "it has no geometry that could be floor", "Export the rooms with their bodies."),
}


@dataclass(frozen=True, slots=True)
class RoomCheck:
    """Whether a robot gets into a room.

    Parameters
    ----------
    storey
        Index into `Readiness.storeys`; None for a room that is no floor.
    area, reached_area
        Floor that nothing stands on, and the part of it that the robot's body can cover, square metres.
    reached
        Whether the robot can be in it, coming from the largest part of the storey.
    reason
        Why not: that of a door (see `DoorCheck`), `no-door`, `outside` (doors to the outside alone), `stairs`
        (a stair, ramp or lift alone), `furniture`, `full` (no place to stand), `small`, `shaft` or `no-shape`.
    detail, hint
        The same in words, and what to do about it.
    culprits
        GlobalIds of the doors or elements that keep the robot out.
    """

    global_id: str
    name: str
    storey: int | None
    area: float
    reached_area: float
    reached: bool
    reason: str = ""
    detail: str = ""
    hint: str = ""
    culprits: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StoreyCheck:
    """How much of one level a robot reaches, coming from its largest part.

    Parameters
    ----------
    floor_area, reached_area
        Floor that nothing stands on, and the part of it that the robot's body can cover, square metres.
    doors, doors_connecting
        Doors on this level, and those that let the robot through.
    parts
        Number of parts that the robot cannot leave, of half a square metre and more.
    connectors
        GlobalIds of the stairs, ramps and lifts that lead to other levels.
    """

    name: str
    global_id: str
    level: float
    rooms: int
    rooms_reached: int
    floor_area: float
    reached_area: float
    doors: int
    doors_connecting: int
    parts: int
    connectors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Readiness:
    """What a robot reaches in a building, storey by storey.

    Parameters
    ----------
    cell_size
        Edge of the cells it was found with, metres.
    storeys, rooms, doors, connectors
        What was looked at, in the building's order; `storeys` are the levels of the environment.
    issues
        What is wrong or doubtful in the model, with GlobalIds and a hint how to repair it.
    """

    building: str
    robot: Robot
    cell_size: float
    storeys: tuple[StoreyCheck, ...]
    rooms: tuple[RoomCheck, ...]
    doors: tuple[DoorCheck, ...]
    connectors: tuple[Ascent, ...]
    issues: tuple[Issue, ...]
    plans: tuple[Plan, ...] = field(default=(), repr=False)

    @property
    def unreached(self) -> tuple[RoomCheck, ...]:
        """The rooms that the robot does not reach."""
        return tuple(room for room in self.rooms if not room.reached)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain values, ready for JSON."""
        rooms = [room for room in self.rooms if room.reason != "shaft"]
        return {
            "building": self.building,
            "robot": self.robot.to_dict(),
            "cell_size": self.cell_size,
            "share": {
                "rooms": _share(sum(room.reached for room in rooms), len(rooms)),
                "floor": _share(sum(s.reached_area for s in self.storeys), sum(s.floor_area for s in self.storeys)),
                "doors": _share(sum(door.connects for door in self.doors), len(self.doors)),
            },
            "storeys": [dataclasses.asdict(storey) for storey in self.storeys],
            "rooms": [dataclasses.asdict(room) for room in self.rooms],
            "doors": [dataclasses.asdict(door) for door in self.doors],
            "connectors": [dataclasses.asdict(connector) for connector in self.connectors],
            "issues": [dataclasses.asdict(issue) for issue in self.issues],
        }

    def to_html(self) -> str:
        """Return the report as one page that needs nothing else: no script, no network."""
        from bimnav._readiness_page import page

        return page(self)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The drawing of one level: rooms with whether they are reached, other floor, walls, furniture, doors."""

    rooms: tuple[tuple[str, BaseGeometry, bool], ...]
    floor: BaseGeometry
    walls: BaseGeometry
    furniture: BaseGeometry
    doors: tuple[tuple[str, BaseGeometry, bool], ...]


def _share(part: float, whole: float) -> float | None:
    return min(part / whole, 1.0) if whole else None


def readiness(building: Building, robot: Robot | None = None, *, cell_size: float = 0.05) -> Readiness:
    """Say which rooms, doors and floor a robot reaches, and why not the rest.

    On every storey the robot starts in the largest part of the floor that it can move in. It takes no
    stairs, ramps or lifts; rooms that only these lead to are said to be.

    Parameters
    ----------
    robot
        Its radius, height and step height decide. The default is 0.5 m wide.
    cell_size
        Edge of a cell in metres; larger cells are taken where the grid would be too large.
    """
    _checks.need("robot", robot, Robot, or_none=True)
    robot = robot or Robot(radius=0.25)
    environment = make_environment(building, Task("readiness", "where a robot can go"), robot)
    connectors = building.ascents
    reach, doors = _tried(environment, cell_size, connectors)
    rooms = tuple(_rooms(environment, reach))
    return Readiness(
        building.name,
        robot,
        cell_size if reach is None else reach.frame.cell_size,
        tuple(_storeys(environment, reach, rooms, doors)),
        rooms,
        doors,
        connectors,
        (*building.issues, *environment.issues, *findings(environment, reach, rooms, doors)),
        tuple(_plans(environment, rooms, doors)),
    )


def _tried(
    environment: IndoorEnvironment, cell_size: float, connectors: Sequence[Ascent]
) -> tuple[Reach | None, tuple[DoorCheck, ...]]:
    """Cut the environment into cells, larger ones if they would be too many, and try its doors."""
    try:
        graph = build_graph(environment, cell_size=cell_size)
        gates = Gates(environment, graph)
        doors = tuple(gates.check(door) for door in environment.building.doors)
        return Reach(graph, gates, doors, connectors), doors
    except NothingWalkableError:
        return None, doors_of(environment)
    except GridTooLargeError as error:
        return _tried(environment, 1.05 * error.context["fits"], connectors)  # a little more, for the margin of `Reach`


def _rooms(environment: IndoorEnvironment, reach: Reach | None) -> Iterable[RoomCheck]:
    at = {region.global_id: region for region in environment.regions if region.source == "space"}
    shafts = {g for issue in environment.issues if issue.code == "shaft" for g in issue.global_ids}
    for space in environment.building.spaces:
        known = (space.global_id, space.label)
        region = at.get(space.global_id)
        if region is None or reach is None:
            reason, detail, hint = _NO_FLOOR["shaft" if space.global_id in shafts else "no-shape"]
            yield RoomCheck(*known, None, 0.0, 0.0, False, reason, detail, hint)
            continue
        storey, parts, area, covered = reach.rooms[space.global_id]
        if reach.main[storey] in parts:
            yield RoomCheck(*known, storey, area, covered, True)
        else:
            why = reach.why_not(storey, parts, region.polygon)
            yield RoomCheck(*known, storey, area, covered, False, why.reason, why.detail, why.hint, why.culprits)


def _storeys(
    environment: IndoorEnvironment, reach: Reach | None, rooms: Sequence[RoomCheck], doors: Sequence[DoorCheck]
) -> Iterable[StoreyCheck]:
    for k, (storey, level) in enumerate(zip(environment.storeys, environment.levels, strict=True)):
        inside, there = [room for room in rooms if room.storey == k], [door for door in doors if door.storey == k]
        yield StoreyCheck(
            storey.name,
            storey.global_id,
            level,
            len(inside),
            sum(room.reached for room in inside),
            reach.area(reach.usable[k]) if reach else 0.0,
            reach.area(reach.covered[k]) if reach else 0.0,
            len(there),
            sum(door.connects for door in there),
            len(reach.parts_on(k)) if reach else 0,
            reach.connectors_on(k) if reach else (),
        )


def _plans(environment: IndoorEnvironment, rooms: Sequence[RoomCheck], doors: Sequence[DoorCheck]) -> Iterable[Plan]:
    reached = {room.global_id: room.reached for room in rooms}
    connects = {door.global_id: door.connects for door in doors}
    for k in range(len(environment.levels)):
        regions = [region for region in environment.regions if region.storey == k]
        solid = environment.obstacles_on(k)
        yield Plan(
            tuple((r.name, r.polygon, reached.get(r.global_id, False)) for r in regions if r.source == "space"),
            unite(r.polygon for r in regions if r.source not in ("space", "door")),
            unite(o.footprint for o in solid if o.ifc_class.startswith(PARTITIONS)),
            unite(o.footprint for o in solid if not o.ifc_class.startswith(PARTITIONS)),
            tuple((r.name, r.polygon, connects.get(r.global_id, False)) for r in regions if r.source == "door"),
        )
