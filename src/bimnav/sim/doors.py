"""Doors as things that open: for whom, and how long it takes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

from bimnav import _checks
from bimnav._doorways import doorway_of
from bimnav.errors import ModelError, ValueRangeError
from bimnav.robot import Robot

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment

__all__ = ["DoorState", "SimDoor", "doors_in"]

DoorState: TypeAlias = Literal["open", "closed", "automatic", "locked"]


@dataclass(frozen=True, slots=True, eq=False)
class SimDoor:
    """A door in a simulation: one robot passes at a time.

    Parameters
    ----------
    global_id, name
        Of the door in the model; robots' keys name either.
    state
        `open`: stands open. `automatic`: opens for every robot. `closed`: opens for robots that open doors.
        `locked`: opens for robots with its key.
    opening_time
        Seconds a robot waits in front of it while it opens; a door that stands open takes none.
    polygon
        Plan view of the doorway in world coordinates, metres; None takes it from the model.
    storey
        Index of the storey.
    """

    global_id: str
    state: DoorState = "closed"
    opening_time: float = 0.0
    name: str = ""
    polygon: BaseGeometry | None = None
    storey: int = 0

    def __post_init__(self) -> None:
        _checks.fields(self, numbers="opening_time", wholes="storey", texts="global_id name", shapes="polygon")
        if self.state not in get_args(DoorState):
            known = ", ".join(map(repr, get_args(DoorState)))
            raise ValueRangeError(f"door {self.global_id}: state is {self.state!r}.", f"Known are {known}.")
        if not 0 <= self.opening_time < math.inf:
            raise ValueRangeError(
                f"door {self.global_id}: opening_time is {self.opening_time}.", "Give seconds, 0 or more."
            )

    @property
    def label(self) -> str:
        """What the log calls it."""
        return f"door {self.name or self.global_id}"

    def opens_for(self, robot: Robot) -> bool:
        """Tell whether a robot gets through."""
        if self.state == "locked":
            return bool({self.global_id, self.name} & set(robot.keys))
        return self.state in ("open", "automatic") or robot.opens_doors


def doors_in(environment: IndoorEnvironment | None, doors: Iterable[SimDoor]) -> tuple[SimDoor, ...]:
    """Return doors with their names, doorways and storeys from the model.

    A doorway is as deep as its wall and as the robot is on both sides, so that who is in it is alone in it.

    Raises
    ------
    ModelError
        If a door without a polygon is not in the model, or has no geometry there.
    """
    return tuple(door if door.polygon is not None else _placed(environment, door) for door in doors)


def _placed(environment: IndoorEnvironment | None, door: SimDoor) -> SimDoor:
    building = None if environment is None else environment.building
    found = [known for known in building.doors if known.global_id == door.global_id] if building else []
    way = doorway_of(found[0], building) if found else None
    if environment is None or way is None:
        raise ModelError(
            f"door {door.global_id} has no place.",
            "Name a door of the model by its GlobalId, or give the polygon of its doorway.",
            {"global_id": door.global_id},
        )
    on = [region.storey for region in environment.regions if region.global_id == door.global_id]
    levels = environment.levels
    nearest = min(range(len(levels)), key=lambda k: abs(levels[k] - way.bottom))
    polygon = way.rectangle(environment.robot.radius)
    return SimDoor(door.global_id, door.state, door.opening_time, found[0].name, polygon, on[0] if on else nearest)
