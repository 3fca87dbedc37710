"""The environment of one building for one task and one robot, in continuous space."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

from bimnav import _checks
from bimnav._door_access import door_access
from bimnav._floors import FLOOR_SOURCES, FloorSource, find_floors
from bimnav._meaning import what_blocks
from bimnav.building import Building, Issue
from bimnav.environment._obstacles import closed_doors, obstacles_of, zones_of
from bimnav.environment._targets import embodied, target_at, target_of
from bimnav.environment._values import (
    IndoorEnvironment,
    Obstacle,
    Region,
    Target,
    Zone,
    grown as grown,
)
from bimnav.errors import ValueRangeError
from bimnav.robot import Robot

if TYPE_CHECKING:
    from bimnav.tasks import Choice, Overruled, Task

__all__ = ["IndoorEnvironment", "Obstacle", "Place", "Region", "Target", "Zone", "make_environment", "rules_overruled"]

Place: TypeAlias = Sequence[Any]
"""`(x, y)` or `(x, y, storey)`: metres, and the name, GlobalId or index of a storey."""


def make_environment(
    building: Building,
    task: Task,
    robot: Robot | None = None,
    *,
    start: Place | None = None,
    floor_from: Collection[FloorSource] = FLOOR_SOURCES,
    outdoors: bool = False,
) -> IndoorEnvironment:
    """Work out where a robot can go in a building, what blocks it, and what a task wants visited.

    Floor comes from spaces, from slabs, coverings and landings between them and on levels of their own,
    else from what the storey's walls enclose, and from doorways and passages. Holes in slabs, shafts and
    voids are no floor, and neither is the outside. Everything solid in the robot's height band blocks, from
    just above the floor (`robot.step_height`) to the robot's height, unless it is a door or the task says
    otherwise.

    Parameters
    ----------
    building
        As read, or written by hand.
    task
        Says what to visit; finding nothing is no error here.
    robot
        Its height and radius decide what blocks. The default is the paper's point, 1 m tall.
    start
        Where the job begins, `(x, y)` or `(x, y, storey)`: detections that name no storey lie on its
        storey. Without it they lie on the lowest floor at their point.
    floor_from
        What may say that there is floor: any of `space, slab, covering, landing, hull, door, passage`.
    outdoors
        Whether the ground around the building is floor too: slabs and terrain as high as a level, else a
        margin of two metres around the lowest level with a door to the outside.
    """
    from bimnav.tasks import Task, choose, lint_rules

    robot = robot or Robot()
    _checks.need("building", building, Building)
    _checks.need("task", task, Task)
    _checks.need("robot", robot, Robot)
    unknown = [source for source in _checks.many("floor_from", floor_from, str) if source not in FLOOR_SOURCES]
    if unknown:
        raise ValueRangeError(f"floor_from has {unknown[0]!r}.", f"Known are {', '.join(FLOOR_SOURCES)}.")
    floors, issues = find_floors(building, robot, sources=floor_from, outdoors=outdoors)
    issues += lint_rules(task, building)
    levels = tuple(floor.level for floor in floors)
    regions = tuple(
        Region(piece.global_id, piece.name, storey, piece.polygon, piece.source)
        for storey, floor in enumerate(floors)
        for piece in floor.pieces
    )
    walkable = sorted({region.storey for region in regions})

    visited, overruled = choose(task, "targets", building)
    blocks = what_blocks(task, building, visited)
    visited, of_parts = embodied(visited, building)
    access, doors_overruled = door_access(task, building, robot)
    obstacles = (
        *obstacles_of(blocks.candidates, robot, levels, walkable),
        *closed_doors(access, building, robot, levels, walkable),
    )
    zones, zones_overruled = zones_of(task, building, levels)
    blocking = {obstacle.global_id for obstacle in obstacles}

    environment = IndoorEnvironment(
        building,
        task,
        robot,
        tuple(floor.storey for floor in floors),
        levels,
        regions,
        obstacles,
        targets=(),
        zones=zones,
        left_out=tuple(sorted((g, why) for g, why in blocks.left_out.items() if g not in blocking)),
        outside_bands=tuple(e.global_id for e, _ in blocks.candidates if e.global_id not in blocking),
        issues=issues,
        doors=access,
        overruled=(*overruled, *of_parts, *blocks.overruled, *doors_overruled, *zones_overruled),
    )
    targets, lost = _targets(environment, visited, start)
    if lost:
        message = f"{len(lost)} targets of task {task.name!r} have no geometry, so no place to go to."
        issues += (Issue("target-without-shape", message, lost, "error", "Ask for an export with bodies."),)
    exits = (target_of(choice, environment) for choice in choose(task, "exits", building)[0].values())
    return replace(environment, targets=targets, exits=tuple(way for way in exits if way is not None), issues=issues)


def _targets(
    environment: IndoorEnvironment, visited: Mapping[str, Choice], start: Place | None
) -> tuple[tuple[Target, ...], tuple[str, ...]]:
    """Return the targets, and the GlobalIds of those that have no place."""
    found = {global_id: target_of(choice, environment) for global_id, choice in visited.items()}
    home = None if start is None else environment.storeys_at(start)[0]
    placed = [target_at(detection, environment, home) for detection in environment.building.detections]
    known = [target for target in found.values() if target is not None]
    return (*known, *placed), tuple(global_id for global_id, target in found.items() if target is None)


def rules_overruled(task: Task, building: Building, robot: Robot | None = None) -> tuple[Overruled, ...]:
    """Return the rules of a task that pick an element of a building and do not decide, because others go before."""
    from bimnav.tasks import choose

    visited, overruled = choose(task, "targets", building)
    doors = door_access(task, building, robot or Robot())[1]
    return (*overruled, *what_blocks(task, building, visited).overruled, *doors, *zones_of(task, building, ())[1])
