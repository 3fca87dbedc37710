"""How doors are, and which of them a robot may pass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bimnav.building import Building, Door
from bimnav.robot import Robot

if TYPE_CHECKING:
    from bimnav.tasks import Overruled, Task

__all__ = ["DoorAccess", "door_access"]


@dataclass(frozen=True, slots=True)
class DoorAccess:
    """How a door is, and whether the robot may pass it.

    Parameters
    ----------
    state
        `locked`, `closed`, `automatic` or `open`; `closed` where the task says nothing.
    opening_time
        Seconds a robot waits until it is open.
    is_passable
        Whether this robot may pass: it opens closed doors, and has the keys of locked ones. Width and height are
        no matter here.
    rule
        Why, in words.
    """

    global_id: str
    name: str
    state: str
    opening_time: float
    is_passable: bool
    rule: str


def door_access(task: Task, building: Building, robot: Robot) -> tuple[tuple[DoorAccess, ...], tuple[Overruled, ...]]:
    """Return how every door of a building is for a robot, and the rules that others go before."""
    from bimnav.tasks import choose

    chosen, overruled = choose(task, "doors", building)
    found = []
    for door in building.doors:
        choice = chosen.get(door.global_id)
        state = choice.rule.state if choice else "closed"
        why = choice.why if choice else "no door rule of the task matches"
        is_passable, reason = _passes(door, state, robot)
        found.append(
            DoorAccess(
                door.global_id,
                door.name,
                state,
                choice.rule.opening_time if choice else 0.0,
                is_passable,
                f"the door is {state}{reason}: {why}",
            )
        )
    return tuple(found), tuple(overruled)


def _passes(door: Door, state: str, robot: Robot) -> tuple[bool, str]:
    if state == "locked":
        has_key = bool({door.global_id, door.name} & set(robot.keys))
        return has_key, "" if has_key else f" and robot {robot.name!r} has no key"
    if state == "closed" and not robot.opens_doors:
        return False, f" and robot {robot.name!r} opens no doors"
    return True, ""
