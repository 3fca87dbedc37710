"""What a change does to the world, at the moment it happens."""

from __future__ import annotations

import math
from functools import singledispatch
from typing import TYPE_CHECKING

import simpy

from bimnav._approach import stop_for
from bimnav.environment import Target
from bimnav.errors import BimnavError, ModelError, ValueRangeError
from bimnav.sim.changes import (
    Change,
    DoorLocks,
    DoorUnlocks,
    Emergency,
    ObstacleAppears,
    ObstacleRemoved,
    RobotFails,
    TargetReported,
    ZoneHazardous,
)
from bimnav.sim.dispatch import assign
from bimnav.sim.doors import DoorState, SimDoor
from bimnav.sim.errands import Order
from bimnav.sim.knowledge import Closure
from bimnav.sim.refuge import is_inside
from bimnav.sim.track import RobotStatus
from bimnav.stops import Stop, Unreached

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from bimnav.sim.world import World

__all__ = ["doors_named", "plan_changes"]


def plan_changes(world: World, changes: Iterable[Change]) -> None:
    """Put changes on the clock, before anything else is.

    So a change comes before whatever robots do at the same instant, and of several at one instant the one
    that was given first.

    Raises
    ------
    ValueRangeError
        If a change has no time, or one before the start.
    """
    moments: dict[float, list[Change]] = {}
    for change in changes:
        moments.setdefault(change.time, []).append(change)
        if isinstance(change, ZoneHazardous) and math.isfinite(change.until):
            moments.setdefault(change.until, []).append(ObstacleRemoved(change.until, change.name))
    for time, together in moments.items():
        delay = time - float(world.clock.now)
        if not 0 <= delay < math.inf:
            raise ValueRangeError(
                f"{type(together[0]).__name__} at {time} s comes before the start, or never.",
                "Give seconds on the clock of the log.",
                {"time": time},
            )
        _at(world, delay, together)


def _at(world: World, delay: float, changes: Sequence[Change]) -> None:
    def happen(_: simpy.Event) -> None:
        for change in changes:
            _happen(change, world)

    moment = world.pass_time(delay)
    assert moment.callbacks is not None  # noqa: S101 - it lies ahead
    moment.callbacks.append(happen)


@singledispatch
def _happen(change: object, _: World) -> None:
    raise ValueRangeError(f"{change!r} is no change of the world.", "Give values such as ObstacleAppears.")


@_happen.register(ObstacleAppears)
def _(change: ObstacleAppears, world: World) -> None:
    place = (*_middle(change), change.storey)
    world.note("change", f"{change.name} appears{'' if change.known else ', unseen'}", place=place)
    if change.known:
        world.close(Closure(change.name, change.polygon, change.storey))
    else:
        world.hidden[change.name] = change
        world.look_again(change.name)


@_happen.register(ObstacleRemoved)
def _(change: ObstacleRemoved, world: World) -> None:
    hidden = world.hidden.pop(change.name, None)
    closure = world.knowledge.closures.get(change.name)
    if hidden is None and closure is None:
        world.note("change", f"there is no {change.name} to remove")
        return
    world.note("change", f"{change.name} is removed")
    world.open_up(change.name, f"{change.name} is removed")


@_happen.register(DoorLocks)
def _(change: DoorLocks, world: World) -> None:
    _set_door(world, change.global_id, "locked")


@_happen.register(DoorUnlocks)
def _(change: DoorUnlocks, world: World) -> None:
    _set_door(world, change.global_id, "closed")


def _set_door(world: World, global_id: str, state: DoorState) -> None:
    before = world.doors.get(global_id)
    if before is None:
        raise ModelError(f"door {global_id} is not in the simulation.", "", {"global_id": global_id})
    door = SimDoor(global_id, state, before.opening_time, before.name, before.polygon, before.storey)
    world.set_door(door)
    world.note("change", f"{door.label} is {'locked' if state == 'locked' else 'unlocked'}")
    assert door.polygon is not None  # noqa: S101 - doors in a world have a place
    world.close(Closure(door.label, door.polygon, door.storey, door))


@_happen.register(TargetReported)
def _(change: TargetReported, world: World) -> None:
    global_id = change.global_id or change.name
    named = {"target": global_id, "target_name": change.name, "place": (change.x, change.y, change.storey)}
    world.targets.append(global_id)
    world.note("change", "a new target is reported", **named)  # type: ignore[arg-type]
    stop, reason = _stop_for(change, global_id, world)
    if stop is None or not assign(world, stop):
        reason = reason or "no robot that works can get there"
        world.note("unreached", reason, **named)  # type: ignore[arg-type]
        world.unreached.append(Unreached(global_id, change.name, (change.x, change.y, 0.0), reason))


def _stop_for(change: TargetReported, global_id: str, world: World) -> tuple[Stop | None, str]:
    """Return where to go for a target, or why there is nowhere."""
    graph = world.agents[0].tour.graph
    try:
        cell = graph.frame.cell_at(change.x, change.y, storey=change.storey)
    except BimnavError as error:
        return None, error.message
    point = (change.x, change.y, graph.frame.elevations[change.storey])
    target = Target(global_id, change.name, change.storey, point, None, "user", "reported", priority=change.priority)
    found = stop_for(graph, target, cell, None)
    return (found, "") if isinstance(found, Stop) else (None, found.reason)


@_happen.register(RobotFails)
def _(change: RobotFails, world: World) -> None:
    found = [agent for agent in world.agents if agent.robot.name == change.robot]
    if not found:
        raise ValueRangeError(f"no robot is called {change.robot!r}.", "", {"robot": change.robot})
    found[0].disturb(Order("fail", "breaks down", change.repair_time))


@_happen.register(ZoneHazardous)
def _(change: ZoneHazardous, world: World) -> None:
    zone = Closure(change.name, change.polygon, change.storey)
    world.note("change", f"{change.name} begins", place=(*_middle(change), change.storey))
    world.close(zone)
    for agent in world.agents:
        if agent.status is not RobotStatus.FAILED and is_inside(agent, zone):
            agent.disturb(Order("leave", change.name, closure=zone))


@_happen.register(Emergency)
def _(change: Emergency, world: World) -> None:
    world.note("emergency", change.name)
    world.kept_clear = (change.name, change.width)
    for agent in world.agents:
        if agent.status is not RobotStatus.FAILED:
            agent.disturb(Order("park", change.name))


def _middle(change: ObstacleAppears | ZoneHazardous) -> tuple[float, float]:
    point = change.polygon.centroid
    return float(point.x), float(point.y)


def doors_named(changes: Iterable[Change]) -> list[str]:
    """Return the GlobalIds of all doors that changes lock or unlock, each once."""
    return list(dict.fromkeys(c.global_id for c in changes if isinstance(c, (DoorLocks, DoorUnlocks))))
