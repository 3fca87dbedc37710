"""People and carts: they walk where they want, and robots make way."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks
from bimnav.errors import InputError, ValueRangeError
from bimnav.grid import Cell
from bimnav.plan import find_path
from bimnav.sim._meeting import meeting
from bimnav.sim.motion import Motion

if TYPE_CHECKING:
    from bimnav.graph import NavGraph

__all__ = ["Person", "Walker", "first_meeting"]


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody, or something, that moves through the building and heeds no robot.

    Parameters
    ----------
    name
        How the log calls them; people of one simulation have different names.
    route
        World points (x, y) they walk along, metres; None for a random walk from free cell to free cell.
    storey
        Index of the storey; nobody changes it.
    speed
        Metres per second; 1.2 is the free speed of IMO MSC.1/Circ.1533 in corridors.
    radius
        Of the circle around them, metres.
    start
        Seconds on the clock when they begin to walk a route; before, and after its end, they are not there.
    back_and_forth
        Whether they turn at the end of a route, for ever.
    """

    name: str
    route: tuple[tuple[float, float], ...] | None = None
    storey: int = 0
    speed: float = 1.2
    radius: float = 0.25
    start: float = 0.0
    back_and_forth: bool = False

    def __post_init__(self) -> None:
        _checks.fields(self, numbers="speed radius start", wholes="storey", texts="name")
        if not (0 < self.speed < math.inf and 0 <= self.radius < math.inf and math.isfinite(self.start)):
            raise ValueRangeError(
                f"{self.name!r} walks at {self.speed} m/s with radius {self.radius} m from {self.start} s.",
                "Give a speed above 0, a radius of 0 or more, and a finite start.",
            )
        if self.route is not None:
            line = _checks.numbers(f"the route of {self.name!r}", self.route)
            if line.ndim != 2 or line.shape[1] != 2 or len(line) < 2 or not np.isfinite(line).all():
                raise InputError(f"the route of {self.name!r} is no line.", "Give two points or more, in metres.")
            object.__setattr__(self, "route", tuple((x, y) for x, y in line.tolist()))


@dataclass(slots=True)
class Walker:
    """A person in one simulation: where they are is worked out as far as somebody asks.

    Parameters
    ----------
    person
        Who walks.
    graph
        Where a random walk leads.
    rng
        Draws its goals.
    """

    person: Person
    graph: NavGraph
    rng: np.random.Generator
    begin: float
    times: list[float] = field(default_factory=list)
    points: list[tuple[float, float]] = field(default_factory=list)
    is_over: bool = False

    def __post_init__(self) -> None:
        if self.person.route is not None:
            self.times, self.points = [self.person.start], [self.person.route[0]]
            self._walk(self.person.route[1:])
            self.is_over = not self.person.back_and_forth
        else:
            storey = self.person.storey
            if not self.graph.free[storey].any():
                raise InputError(f"{self.person.name!r} has no free cell to walk on, on storey {storey}.")
            self.times, self.points = [self.begin], [self._center(self._draw())]

    def between(self, begin: float, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the times (n,) and points (n, 2) of their way from before one time to after another."""
        while not self.is_over and self.times[-1] < end:
            if self.person.route is not None:
                ways = (self.person.route, self.person.route[::-1])
                self._walk(ways[self.points[-1] == self.person.route[-1]][1:])
            else:
                self._wander()
        first = max(bisect_right(self.times, begin) - 1, 0)
        last = bisect_left(self.times, end) + 1
        first = min(first, len(self.times) - 1)
        return np.array(self.times[first:last]), np.array(self.points[first:last])

    def way(self, begin: float, end: float) -> NDArray[np.float64]:
        """Return the line (n, 2) they walk between two times, as far as they are there."""
        times, points = self.between(begin, end)
        low, high = np.clip([begin, end], times[0], times[-1])
        moments = np.concatenate([[low], times[(times > low) & (times < high)], [high]])
        return _at(moments, times, points)

    def point_at(self, time: float) -> tuple[float, float] | None:
        """Return where they are; None if they are not there."""
        times, points = self.between(time, time)
        if not times[0] <= time <= times[-1]:
            return None
        return float(np.interp(time, times, points[:, 0])), float(np.interp(time, times, points[:, 1]))

    def _walk(self, points: Sequence[tuple[float, float]]) -> None:
        for point in points:
            span = math.dist(self.points[-1], point) / self.person.speed
            if span > 0:
                self.times.append(self.times[-1] + span)
                self.points.append(point)

    def _wander(self) -> None:
        x, y = self.points[-1]
        here = self.graph.frame.cell_at(x, y, storey=self.person.storey)
        goal = self._draw(int(self.graph.components[here]))
        before = self.times[-1]
        self._walk([(x, y) for x, y, _ in find_path(self.graph, here, goal).points.tolist()])
        if self.times[-1] == before:  # drawn where they stand: they stay a second
            self.times.append(before + 1.0)
            self.points.append(self.points[-1])

    def _draw(self, component: int | None = None) -> Cell:
        storey = self.person.storey
        free = self.graph.free[storey]
        if component is not None:
            free = free & (self.graph.components[storey] == component)
        cells = np.argwhere(free)
        row, col = cells[int(self.rng.integers(len(cells)))].tolist()
        return Cell(storey, row, col)

    def _center(self, cell: Cell) -> tuple[float, float]:
        return self.graph.frame.center_of(cell)[:2]


def first_meeting(motion: Motion, begin: float, walker: Walker, distance: float) -> float | None:
    """Find when a robot and a person come closer than a distance while the robot moves.

    Parameters
    ----------
    motion
        Of the robot; accelerated rows count as eight straight ones.
    begin
        Seconds on the clock when the motion begins.
    distance
        Metres between their middles.

    Returns
    -------
    seconds
        Since the begin of the motion; None if they never do, or only move apart.
    """
    if walker.person.storey not in motion.floors:
        return None
    own = motion.chords
    times, points = walker.between(begin, begin + motion.duration)
    times = times - begin
    apart = np.maximum(own.low - points.max(axis=0), points.min(axis=0) - own.high)
    if (apart > distance).any():
        return None
    found = meeting(own.times, own.points, own.reached, times, np.ascontiguousarray(points.T), distance**2)
    return None if math.isnan(found) else found


def _at(moments: NDArray[np.float64], times: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([np.interp(moments, times, points[:, axis]) for axis in (0, 1)])
