"""A way cut into stretches: what a robot must have before it enters each, and how fast it may be there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.sim.areas import Areas, Crossing, Passage, SpeedLimit, crossings, cut_at
from bimnav.sim.doors import SimDoor
from bimnav.sim.lifts import Lift
from bimnav.sim.motion import Motion
from bimnav.sim.routes import JOINED, Line

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Cutter", "Gate", "Stretch", "cut", "gates_of", "joined"]


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a way on which the same resources are needed, or that is ridden.

    Parameters
    ----------
    points, storeys
        As in a line.
    needs
        Names of the resources that are held on it.
    doors
        Those among them that are doors.
    lift
        Name of the lift that carries the robot; None if it drives.
    limits : (n - 1,) metres per second
        Highest speed on every piece; None for no limit.
    area
        Floor of the resources, metres.
    storey
        Of that floor.
    """

    points: NDArray[np.float64]
    storeys: NDArray[np.int32]
    needs: frozenset[str] = frozenset()
    doors: tuple[SimDoor, ...] = ()
    lift: str | None = None
    limits: tuple[float, ...] | None = None
    area: BaseGeometry | None = None
    storey: int = 0

    @cached_property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True)
class Gate:
    """A moment in a motion at which resources are claimed, or left behind.

    Parameters
    ----------
    seconds
        Since the begin of the motion.
    needs
        What is to be held from then on.
    is_exit
        Whether everything else is let go.
    """

    seconds: float
    needs: frozenset[str]
    is_exit: bool


def gates_of(group: Sequence[Stretch], motion: Motion, acceleration: float) -> list[Gate]:
    """Return what a robot that drives stretches in one go claims and leaves, and when.

    It claims as late as it can still stop in front, and leaves where a stretch ends.
    """
    gates, done = [], 0.0
    for stretch, after in pairwise(group):
        done += stretch.length
        if after.needs - stretch.needs:
            gates.append(Gate(motion.last_chance(done - JOINED / 2, acceleration), after.needs, is_exit=False))
        if stretch.needs - after.needs:
            gates.append(Gate(motion.seconds_to(done), after.needs, is_exit=True))
    return sorted(gates, key=lambda gate: gate.seconds)


def cut(
    line: Line,
    doors: Sequence[SimDoor],
    passages: Sequence[Passage],
    lifts: Sequence[Lift],
    limits: Sequence[SpeedLimit],
) -> list[Stretch]:
    """Cut a line where it enters and leaves doorways, passages and lifts; see `Cutter`."""
    return Cutter(doors, passages, lifts, limits).cut(line)


class Cutter:
    """Cuts lines where they enter and leave doorways, passages and lifts.

    Resources whose floor overlaps along the way are needed together, from where the first begins to where
    the last ends, so that nobody waits for one while standing in another.
    """

    def __init__(
        self,
        doors: Sequence[SimDoor],
        passages: Sequence[Passage],
        lifts: Sequence[Lift],
        limits: Sequence[SpeedLimit],
    ) -> None:
        self.lifts, self.limits = lifts, limits
        self.shared: list[SimDoor | Passage] = [*doors, *passages]
        self.areas = Areas([(_polygon(area), area.storey) for area in self.shared])
        self.slow = Areas([(limit.polygon, limit.storey) for limit in limits])

    def cut(self, line: Line) -> list[Stretch]:
        """Return a line as stretches, in order."""
        if not (self.shared or self.lifts or self.limits):
            return [Stretch(line.points, line.storeys)]
        sections = _sections(crossings(line.points, line.storeys, self.areas))
        rides = _rides(line, self.lifts)
        places = [place for begin, end, *_ in (*sections, *rides) for place in (begin, end)]
        stretches, done = [], 0.0
        for points, storeys in cut_at(line.points, line.storeys, places):
            length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
            middle = done + length / 2
            done += length
            lift = next((lift for begin, end, lift in rides if begin <= middle <= end), None)
            used = next((used for begin, end, used in sections if begin <= middle <= end), ())
            stretches.append(self._stretch(points, storeys, [self.shared[k] for k in sorted(used)], lift))
        return stretches

    def _stretch(
        self,
        points: NDArray[np.float64],
        storeys: NDArray[np.int32],
        areas: Sequence[SimDoor | Passage],
        lift: str | None,
    ) -> Stretch:
        capped = (points, storeys, None) if lift or not self.limits else self._limited(points, storeys)
        return Stretch(
            *capped[:2],
            frozenset(name_of(area) for area in areas),
            tuple(area for area in areas if isinstance(area, SimDoor)),
            lift,
            capped[2],
            shapely.union_all([_polygon(area) for area in areas]) if areas else None,
            areas[0].storey if areas else 0,
        )

    def _limited(
        self, points: NDArray[np.float64], storeys: NDArray[np.int32]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32], tuple[float, ...] | None]:
        """Put points where speed limits begin and end; return the limit of every piece, too."""
        slow = crossings(points, storeys, self.slow)
        if not slow:
            return points, storeys, None
        pieces = cut_at(points, storeys, [place for crossing in slow for place in (crossing.begin, crossing.end)])
        speeds: list[float] = []
        done = 0.0
        for part, _ in pieces:
            length = float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum())
            middle = done + length / 2
            done += length
            here = [self.limits[crossing.area].speed for crossing in slow if crossing.begin <= middle <= crossing.end]
            speeds += [min(here, default=np.inf)] * (len(part) - 1)
        line = np.concatenate([pieces[0][0], *(part[1:] for part, _ in pieces[1:])])
        on = np.concatenate([pieces[0][1], *(floor[1:] for _, floor in pieces[1:])])
        return line, on, tuple(speeds)


def joined(stretches: Sequence[Stretch]) -> tuple[Line, tuple[float, ...] | None]:
    """Put stretches together again; return the speed limit of every piece, too, None if none has one."""
    if len(stretches) == 1:
        return Line(stretches[0].points, stretches[0].storeys), stretches[0].limits
    points = [stretches[0].points, *(stretch.points[1:] for stretch in stretches[1:])]
    storeys = [stretches[0].storeys, *(stretch.storeys[1:] for stretch in stretches[1:])]
    line = Line(np.concatenate(points), np.concatenate(storeys))
    if all(stretch.limits is None for stretch in stretches):
        return line, None
    parts = [stretch.limits or (math.inf,) * (len(stretch.points) - 1) for stretch in stretches]
    return line, tuple(limit for part in parts for limit in part)


def name_of(area: SimDoor | Passage) -> str:
    """Return the name by which a resource is claimed."""
    return area.global_id if isinstance(area, SimDoor) else area.name


def _polygon(area: SimDoor | Passage) -> BaseGeometry:
    return shapely.Polygon() if area.polygon is None else area.polygon


def _sections(found: Sequence[Crossing]) -> list[tuple[float, float, set[int]]]:
    """Join crossings that overlap along the way."""
    sections: list[tuple[float, float, set[int]]] = []
    for crossing in found:
        if sections and crossing.begin <= sections[-1][1] + JOINED:
            begin, end, used = sections[-1]
            sections[-1] = (begin, max(end, crossing.end), used | {crossing.area})
        else:
            sections.append((crossing.begin, crossing.end, {crossing.area}))
    return sections


def _rides(line: Line, lifts: Sequence[Lift]) -> list[tuple[float, float, str]]:
    """Return begin, end and lift of the parts of a line that rise more steeply than they go forward."""
    steps = np.diff(line.points, axis=0)
    run, rise = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    reached = np.append(0.0, np.linalg.norm(steps, axis=1).cumsum())
    rides: list[tuple[float, float, str]] = []
    for k in np.flatnonzero((rise > run) & (rise > JOINED)).tolist():
        x, y, _ = line.points[k].tolist()
        lift = next((lift for lift in lifts if (lift.x - x) ** 2 + (lift.y - y) ** 2 <= lift.reach**2), None)
        if lift is None:
            continue
        begin = max(float(reached[k]) - lift.depth, 0.0)
        end = min(float(reached[k + 1]) + lift.depth, float(reached[-1]))
        if rides and rides[-1][2] == lift.name and begin - rides[-1][1] <= JOINED:
            rides[-1] = (rides[-1][0], end, lift.name)
        else:
            rides.append((begin, end, lift.name))
    return rides
