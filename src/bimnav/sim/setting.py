"""What a simulation is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

import numpy as np

from bimnav.grid import Cell
from bimnav.robot import Robot
from bimnav.sim.areas import Passage, SpeedLimit
from bimnav.sim.changes import Sensing
from bimnav.sim.doors import SimDoor
from bimnav.sim.lifts import Lift
from bimnav.sim.people import Walker
from bimnav.stops import Stop

__all__ = ["Charger", "Decision", "Policy", "ServiceTime", "Setting", "Speed"]

Decision: TypeAlias = Literal["replan", "wait", "give up"]


class Policy(Protocol):
    """What a robot does when its way is closed."""

    def __call__(self, robot: Robot, stop: Stop | None, obstacle: str, /) -> Decision:
        """Return `replan`, `wait` or `give up` for a robot on its way to a stop, or home."""
        ...


class ServiceTime(Protocol):
    """How long, in seconds, a robot stays at a stop."""

    def __call__(self, robot: Robot, stop: Stop, rng: np.random.Generator, /) -> float:
        """Return seconds, finite and not below 0."""
        ...


class Speed(Protocol):
    """How fast, in metres per second, a robot drives its next leg."""

    def __call__(self, robot: Robot, rng: np.random.Generator, /) -> float:
        """Return metres per second, above 0."""
        ...


@dataclass(frozen=True, slots=True)
class Charger:
    """Where robots charge, one at a time.

    Parameters
    ----------
    name
        Its GlobalId, or how the log calls it.
    cell
        Where the search ends.
    end
        Where the robot comes to stand, world metres.
    """

    name: str
    cell: Cell
    end: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What a simulation was given; see `simulate`."""

    service_time: ServiceTime | float
    speed: Speed | float | None
    sensing: Sensing
    policy: Decision | Policy
    patience: float
    start_times: Sequence[float]
    doors: Sequence[SimDoor]
    passages: Sequence[Passage]
    lifts: Sequence[Lift]
    limits: Sequence[SpeedLimit]
    chargers: Sequence[Charger]
    walkers: tuple[Walker, ...]
    is_eventful: bool
    keeps_history: bool
