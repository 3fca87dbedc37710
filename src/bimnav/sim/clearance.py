"""How near robots came to each other, to people, and to what stands around."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.robot import Robot
from bimnav.sim.people import Walker
from bimnav.sim.track import Track

if TYPE_CHECKING:
    from bimnav.environment import IndoorEnvironment

__all__ = ["Encounter", "clearance_to_people", "clearance_to_robots", "clearance_to_walls", "encounters"]

_WINDOW = 30.0  # seconds over which the places of a robot are put in one box
_CHORDS = 4  # straight pieces an accelerated row is cut into


@dataclass(frozen=True, slots=True)
class Encounter:
    """Two robots whose bodies shared floor.

    Parameters
    ----------
    time, end
        Seconds on the clock of the log, from when to when.
    robots
        Their names.
    clearance
        The least distance between their bodies, metres; below 0, as far as they overlapped.
    """

    time: float
    end: float
    robots: tuple[str, str]
    clearance: float


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """A track as straight pieces at constant speed."""

    times: NDArray[np.float64]
    points: NDArray[np.float64]
    storeys: NDArray[np.int32]


def _way_of(track: Track) -> _Way:
    times = track.times
    curved = np.flatnonzero((track.eases[:-1] != 1) & (np.diff(times) > 0))
    if len(curved):
        share = np.arange(1, _CHORDS) / _CHORDS
        inner = times[curved, None] + share * np.diff(times)[curved, None]
        times = np.unique(np.concatenate([times, inner.ravel()]))
    else:
        times = np.unique(times)
    return _Way(times, track.points_at(times)[:, :2], track.storeys[track.rows_at(times)])


def encounters(robots: Sequence[Robot], tracks: Sequence[Track]) -> tuple[Encounter, ...]:
    """Find when bodies of robots shared floor; points never do.

    Returns
    -------
    encounters
        By time, then names; one for every spell of every two robots.
    """
    found: list[Encounter] = []
    ways = [_way_of(track) for track in tracks]
    boxes = [_boxes(way) for way in ways]
    for i in range(len(ways)):
        for j in range(i + 1, len(ways)):
            spread = robots[i].radius + robots[j].radius
            if spread > 0:
                names = robots[i].name, robots[j].name
                for begin, end in _windows(boxes[i], boxes[j], spread):
                    found += _spells(ways[i], ways[j], begin, end, spread, names)
    return tuple(_merged(sorted(found, key=lambda e: (e.robots, e.time))))


def _merged(found: Sequence[Encounter]) -> list[Encounter]:
    """Join spells that a window cut; sort by time."""
    merged: list[Encounter] = []
    for spell in found:
        last = merged[-1] if merged else None
        if last and last.robots == spell.robots and spell.time <= last.end + 1e-9:
            merged[-1] = Encounter(last.time, spell.end, last.robots, min(last.clearance, spell.clearance))
        else:
            merged.append(spell)
    return sorted(merged, key=lambda e: (e.time, e.robots))


def clearance_to_robots(robots: Sequence[Robot], tracks: Sequence[Track]) -> float:
    """Return the least distance between the bodies of two robots on one storey, metres; inf for a lone robot."""
    ways = [_way_of(track) for track in tracks]
    boxes = [_boxes(way) for way in ways]
    best = math.inf
    for i in range(len(ways)):
        for j in range(i + 1, len(ways)):
            spread = robots[i].radius + robots[j].radius
            for begin, end in _windows(boxes[i], boxes[j], best + spread):
                distance = _gaps(ways[i], ways[j], begin, end)[1]
                best = min(best, float(distance.min(initial=math.inf)) - spread)
    return best


def clearance_to_people(robots: Sequence[Robot], tracks: Sequence[Track], walkers: Sequence[Walker]) -> float:
    """Return the least distance between the bodies of a robot and a person on one storey, metres."""
    best = math.inf
    for robot, track in zip(robots, tracks, strict=True):
        way = _way_of(track)
        for walker in walkers:
            times, points = walker.between(float(way.times[0]), float(way.times[-1]))
            other = _Way(times, points, np.full(len(times), walker.person.storey, dtype=np.int32))
            begin, end = max(way.times[0], times[0]), min(way.times[-1], times[-1])
            if begin <= end:
                distance = _gaps(way, other, float(begin), float(end))[1]
                best = min(best, float(distance.min(initial=math.inf)) - robot.radius - walker.person.radius)
    return best


def clearance_to_walls(
    environment: IndoorEnvironment | None, robots: Sequence[Robot], tracks: Sequence[Track]
) -> float:
    """Return the least distance between a robot's body and an obstacle of the model, metres; inf without a model.

    A target that is reached although its cell is blocked counts like any other place.
    """
    best = math.inf
    if environment is None or not hasattr(environment, "obstacles_on"):
        return best
    for robot, track in zip(robots, tracks, strict=True):
        for storey in np.unique(track.storeys).tolist():
            bodies = [obstacle.footprint for obstacle in environment.obstacles_on(storey)]
            on = np.flatnonzero((track.storeys[:-1] == storey) & (track.storeys[1:] == storey))
            if not bodies or not len(on):
                continue
            pieces = np.unique(np.stack([track.points[on, :2], track.points[on + 1, :2]], axis=1), axis=0)
            tree = shapely.STRtree(bodies)
            _, distance = tree.query_nearest(shapely.linestrings(pieces), return_distance=True, all_matches=False)
            best = min(best, float(distance.min(initial=math.inf)) - robot.radius)
    return best


_Boxes: TypeAlias = tuple[float, NDArray[np.float64], NDArray[np.int64]]


def _boxes(way: _Way) -> _Boxes:
    """Return the begin, and for every window the box (x0, y0, x1, y1) around the way and a bit for every storey."""
    begin = float(way.times[0])
    edges = np.arange(begin, float(way.times[-1]) + _WINDOW, _WINDOW)
    boxes, storeys = np.empty((len(edges), 4)), np.empty(len(edges), dtype=np.int64)
    bits = np.int64(1) << (way.storeys.astype(np.int64) % 63)  # high buildings share bits, and are looked at closer
    for k, edge in enumerate(edges.tolist()):
        first = max(int(np.searchsorted(way.times, edge, side="right")) - 1, 0)
        last = int(np.searchsorted(way.times, edge + _WINDOW, side="left")) + 1
        points = way.points[first:last]
        boxes[k] = (*points.min(axis=0), *points.max(axis=0))
        storeys[k] = np.bitwise_or.reduce(bits[first:last])
    return begin, boxes, storeys


def _windows(a: _Boxes, b: _Boxes, distance: float) -> list[tuple[float, float]]:
    """Return the spans of time in which two ways may come nearer than a distance.

    Before its begin and after its end a robot stands; its first and last boxes hold then, too.
    """
    begin = min(a[0], b[0])
    end = max(a[0] + len(a[1]) * _WINDOW, b[0] + len(b[1]) * _WINDOW)
    edges = np.arange(begin, end, _WINDOW)
    near = np.ones(len(edges), dtype=np.bool_)
    rows, floors = [], []
    for start, boxes, storeys in (a, b):
        low = np.clip(np.floor((edges - start) / _WINDOW).astype(int), 0, len(boxes) - 1)
        high = np.clip(np.floor((edges + _WINDOW - start) / _WINDOW).astype(int), 0, len(boxes) - 1)
        rows.append(
            np.column_stack([np.minimum(boxes[low], boxes[high])[:, :2], np.maximum(boxes[low], boxes[high])[:, 2:]])
        )
        floors.append(storeys[low] | storeys[high])
    near &= (floors[0] & floors[1]) != 0
    for axis in (0, 1):
        gap = np.maximum(rows[0][:, axis] - rows[1][:, axis + 2], rows[1][:, axis] - rows[0][:, axis + 2])
        near &= gap < distance
    return [(float(edge), float(edge) + _WINDOW) for edge in edges[near]]


def _gaps(a: _Way, b: _Way, begin: float, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return moments, and the least distance between two ways from each to the next; inf on different storeys."""
    inner = [
        way.times[np.searchsorted(way.times, begin, side="right") : np.searchsorted(way.times, end, side="left")]
        for way in (a, b)
    ]
    moments = np.unique(np.concatenate([[begin, end], *inner]))
    gap = _at(a, moments) - _at(b, moments)
    if len(moments) == 1:
        return moments, np.hypot(*gap.T)
    step = np.diff(gap, axis=0)
    square = (step**2).sum(axis=1)
    share = np.divide(-(gap[:-1] * step).sum(axis=1), square, out=np.zeros(len(step)), where=square > 0).clip(0, 1)
    distance: NDArray[np.float64] = np.hypot(*(gap[:-1] + share[:, None] * step).T)
    same = _storey_at(a, moments[:-1]) == _storey_at(b, moments[:-1])
    return moments, np.where(same, distance, math.inf)


def _storey_at(way: _Way, moments: NDArray[np.float64]) -> NDArray[np.int32]:
    rows = np.searchsorted(way.times, moments, side="right") - 1
    found: NDArray[np.int32] = way.storeys[np.clip(rows, 0, len(way.times) - 1)]
    return found


def _spells(a: _Way, b: _Way, begin: float, end: float, spread: float, names: tuple[str, str]) -> list[Encounter]:
    moments, distance = _gaps(a, b, begin, end)
    spells = []
    for k in np.flatnonzero(distance < spread - 1e-9).tolist():
        if k + 1 < len(moments):
            low, high = _within(a, b, float(moments[k]), float(moments[k + 1]), spread)
            spells.append(Encounter(low, high, names, float(distance[k]) - spread))
    return spells


def _within(a: _Way, b: _Way, begin: float, end: float, spread: float) -> tuple[float, float]:
    """Return when two ways that are straight between two moments are nearer than a distance."""
    ends = np.array([begin, end])
    first, last = (_at(a, ends) - _at(b, ends)).tolist()
    gap, step = np.array(first), np.array(last) - np.array(first)
    square, along, rest = float(step @ step), float(gap @ step), float(gap @ gap) - spread**2
    if square == 0:
        return begin, end
    root = math.sqrt(max(along**2 - square * rest, 0.0))
    low, high = ((-along + sign * root) / square for sign in (-1, 1))
    return begin + max(low, 0.0) * (end - begin), begin + min(high, 1.0) * (end - begin)


def _at(way: _Way, moments: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([np.interp(moments, way.times, way.points[:, k]) for k in (0, 1)])
