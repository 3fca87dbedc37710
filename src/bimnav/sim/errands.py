"""What a robot has to do, and what it is told meanwhile."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import simpy

from bimnav.grid import Cell
from bimnav.sim.knowledge import Closure
from bimnav.sim.routes import Line
from bimnav.stops import Stop

__all__ = ["NEXT", "Errand", "Order", "Process", "Step"]

Process: TypeAlias = Generator[simpy.Event, Any, None]
Step: TypeAlias = Generator[simpy.Event, Any, bool]

NEXT = "next stop"  # why robots depart, if for nothing else


@dataclass(slots=True, eq=False)
class Errand:
    """Something a robot has to do: go somewhere, and serve what is there.

    Parameters
    ----------
    stop
        What to serve; None for a way home, to a charger or out of the way.
    cell, end
        Where to go: the cell, and the exact world point.
    index
        Of the stop among those of the robot; -1 for none.
    leg
        The way there, if it is known.
    purpose
        What the log says on departure.
    """

    stop: Stop | None
    cell: Cell
    end: tuple[float, float, float]
    index: int = -1
    leg: Line | None = None
    purpose: str = NEXT
    seconds: float | None = None  # of service, once drawn
    is_late: bool = False  # put last because its way was closed
    is_begun: bool = False  # departed for
    charger: str = ""


@dataclass(frozen=True, slots=True)
class Order:
    """Something that a robot heeds as soon as it can."""

    kind: Literal["look", "fail", "leave", "park", "end"]
    cause: str = ""
    seconds: float = math.inf
    closure: Closure | None = None
