"""How a robot drives along a line: speed, acceleration, turning, and where that puts it at every moment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.robot import Robot

__all__ = ["Chords", "Motion", "drive", "rest", "stand"]

_SAME_POINT = 1e-9  # metres
_NOW, _EVEN = np.zeros(1), np.ones(1)
_PAIRWISE = 8  # so many numbers numpy adds one after the other
_CHORDS = 8  # straight pieces an accelerated row is cut into
_STRAIGHT = 1e-6  # radians; a smaller change of direction is rounding


class Chords(NamedTuple):
    """A motion in plan view as straight pieces at constant speed.

    Parameters
    ----------
    times : (n,) float64, seconds since it began
    points : (2, n) float64, metres
    reached : (n,) float64, metres driven
    low, high : (2,) float64, metres
        The box around it.
    """

    times: NDArray[np.float64]
    points: NDArray[np.float64]
    reached: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A stretch of driving from rest to rest, or of standing.

    Row k holds from `times[k]` until `times[k + 1]`; the columns are those of a `Track`.

    Parameters
    ----------
    times : (n,) float64, seconds since it began
    points : (n, 3) float64, world points in metres
    storeys : (n,) int32, indexes of storeys
    eases, turns : (n,) float64
        As in a track.
    length
        Metres driven.
    """

    times: NDArray[np.float64]
    points: NDArray[np.float64]
    storeys: NDArray[np.int32]
    eases: NDArray[np.float64]
    turns: NDArray[np.float64]
    length: float

    @cached_property
    def duration(self) -> float:
        """Seconds from begin to end."""
        return float(self.times[-1])

    def row_at(self, seconds: float) -> int:
        """Return the row that holds some seconds after the begin."""
        return max(int(np.searchsorted(self.times, seconds, side="right")) - 1, 0)

    @cached_property
    def reached(self) -> NDArray[np.float64]:
        """(n,) float64, metres driven at the begin of every row."""
        return np.append(0.0, np.linalg.norm(np.diff(self.points, axis=0), axis=1).cumsum())

    def seconds_to(self, metres: float) -> float:
        """Return when the robot has come some metres far, seconds since the begin."""
        reached = self.reached
        row = max(int(np.searchsorted(reached, metres, side="right")) - 1, 0)
        if row >= len(reached) - 1:
            return self.duration
        share = (float(metres) - float(reached[row])) / float(reached[row + 1] - reached[row])
        ease, span = float(self.eases[row]), float(self.times[row + 1] - self.times[row])
        if ease != 1:  # share = u (ease + (1 - ease) u), solved for u
            root = math.sqrt(max(ease * ease + 4 * (1 - ease) * share, 0.0))
            share = 2 * share / (ease + root) if ease + root > 0 else 0.0
        return float(self.times[row]) + share * span

    def last_chance(self, metres: float, acceleration: float) -> float:
        """Return the latest moment to begin to brake so as to stand within some metres, seconds since the begin.

        What is driven and what braking takes grow together: twice as fast as the way while the robot gains
        speed, like the way while it keeps it, and not at all while it brakes.
        """
        reached, spans = self.reached, np.diff(self.times)
        for row in np.flatnonzero((spans > 0) & (np.diff(reached) > 0)).tolist():
            mean = float(reached[row + 1] - reached[row]) / float(spans[row])
            ease = float(self.eases[row])
            first = ease * mean
            room = metres - float(reached[row]) - first * first / (2 * acceleration)
            way = room / 2 if ease < 1 else room
            if ease <= 1 and float(reached[row]) + way < float(reached[row + 1]):
                return self.seconds_to(max(float(reached[row]) + way, float(reached[row])))
        return self.duration

    def point_at(self, seconds: float) -> NDArray[np.float64]:
        """Return where the robot is some seconds after the begin, (3,) metres."""
        return self._inside(seconds)[1]

    def points_at(self, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the robot is at several times after the begin: (m,) to (m, 3) metres."""
        if len(self.times) == 1:
            return np.repeat(self.points, len(seconds), axis=0)
        rows = np.maximum(np.searchsorted(self.times, seconds, side="right") - 1, 0)
        over, rows = rows >= len(self.times) - 1, np.minimum(rows, len(self.times) - 2)
        begin, end = self.points[rows], self.points[rows + 1]
        spans = self.times[rows + 1] - self.times[rows]
        share = np.divide(seconds - self.times[rows], spans, out=np.zeros(len(rows)), where=spans > 0)
        ease = self.eases[rows]
        points: NDArray[np.float64] = begin + (share * (ease + (1 - ease) * share))[:, None] * (end - begin)
        points[over] = self.points[-1]
        return points

    @cached_property
    def floors(self) -> frozenset[int]:
        """Indexes of the storeys it touches."""
        return frozenset(self.storeys.tolist())

    @cached_property
    def chords(self) -> Chords:
        """The motion in plan view as straight pieces at constant speed."""
        times, points = _straight(self)
        steps = points[1:] - points[:-1]
        reached = np.append(0.0, np.linalg.norm(steps, axis=1).cumsum())
        return Chords(times, np.ascontiguousarray(points.T), reached, points.min(axis=0), points.max(axis=0))

    def _inside(self, seconds: float) -> tuple[int, NDArray[np.float64], float]:
        """Return row, point and speed at a time."""
        row = self.row_at(seconds)
        if row >= len(self.times) - 1:
            return row, self.points[-1], 0.0
        span = float(self.times[row + 1] - self.times[row])
        share = (seconds - float(self.times[row])) / span
        ease = float(self.eases[row])
        way = self.points[row + 1] - self.points[row]
        mean = math.sqrt(float(way @ way)) / span
        point: NDArray[np.float64] = self.points[row] + share * (ease + (1 - ease) * share) * way
        return row, point, mean * (ease + 2 * (1 - ease) * share)

    def halted(self, seconds: float, acceleration: float) -> Motion:
        """Return the motion of a robot that begins to brake after some seconds, if it still moves."""
        if seconds >= self.duration:
            return self
        row, point, speed = self._inside(seconds)
        turned = float(self.turns[row])
        if turned:
            turned *= (seconds - float(self.times[row])) / float(self.times[row + 1] - self.times[row])
        head = (self.times[: row + 1], self.points[: row + 1], self.storeys[: row + 1], self.eases[: row + 1])
        before = float(self.times[row])
        eases = head[3].copy()
        if seconds > before:
            way = self.points[row + 1] - self.points[row]
            mean = math.sqrt(float((point - self.points[row]) @ (point - self.points[row]))) / (seconds - before)
            first = float(eases[row]) * math.sqrt(float(way @ way)) / float(self.times[row + 1] - before)
            eases[row] = first / mean if mean > 0 else 1.0
        tail = _braking(np.vstack([point, self.points[row + 1 :]]), speed, acceleration)
        times = np.concatenate([head[0], seconds + tail[0]])
        points = np.concatenate([head[1], tail[1]])
        turns = np.concatenate([self.turns[:row], [turned], np.zeros(len(tail[0]))])
        storeys = np.concatenate([head[2], np.full(len(tail[0]), self.storeys[row], dtype=np.int32)])
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return Motion(times, points, storeys, np.concatenate([eases, tail[2]]), turns, length)


def _straight(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and points in plan view of a motion, accelerated rows cut into chords."""
    curved = np.flatnonzero(motion.eases[:-1] != 1)
    if not len(curved):
        return motion.times, motion.points[:, :2]
    share = np.arange(1, _CHORDS) / _CHORDS
    spans, ways = np.diff(motion.times), np.diff(motion.points[:, :2], axis=0)
    ease = motion.eases[curved, None]
    driven = share * (ease + (1 - ease) * share)
    times = (motion.times[curved, None] + share * spans[curved, None]).ravel()
    points = (motion.points[curved, None, :2] + driven[..., None] * ways[curved, None]).reshape(-1, 2)
    every, where = np.concatenate([motion.times, times]), np.concatenate([motion.points[:, :2], points])
    order = np.argsort(every, kind="stable")
    return every[order], where[order]


def _braking(
    points: NDArray[np.float64], speed: float, acceleration: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times, points and eases of a robot that brakes along a line until it stands."""
    distance = speed * speed / (2 * acceleration) if math.isfinite(acceleration) else 0.0
    if distance <= _SAME_POINT:
        return np.zeros(1), points[:1], np.ones(1)
    nodes, speeds, driven = [points[0]], [speed], 0.0
    for a, b in pairwise(points):
        length = float(np.linalg.norm(b - a))
        if length <= _SAME_POINT:
            continue
        left = distance - driven
        if length >= left:
            nodes.append(a + left / length * (b - a))
            speeds.append(0.0)
            break
        driven += length
        nodes.append(b)
        speeds.append(math.sqrt(max(speed * speed - 2 * acceleration * driven, 0.0)))
    speeds[-1] = 0.0
    return _timed(nodes, speeds)


def _timed(
    nodes: Sequence[NDArray[np.float64]], speeds: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times, points and eases of a line whose pieces are driven with constant acceleration."""
    spans, eases = [0.0], []
    for (a, b), (before, after) in zip(pairwise(nodes), pairwise(speeds), strict=True):
        spans.append(2 * float(np.linalg.norm(b - a)) / (before + after))
        eases.append(2 * before / (before + after))
    return np.fromiter(accumulate(spans), np.float64), np.array(nodes), np.array([*eases, 1.0])


def stand(point: ArrayLike, storey: int, turn: float = 0.0, seconds: float = 0.0) -> Motion:
    """Return a motion that goes nowhere, and may turn on the spot meanwhile.

    Parameters
    ----------
    point : (3,) metres
    storey
        Index of the storey.
    turn
        Radians counter-clockwise.
    seconds
        How long the turn takes.
    """
    if not turn:
        return Motion(_NOW, np.array([point]), np.array([storey], dtype=np.int32), _EVEN, _NOW, 0.0)
    return Motion(
        np.array([0.0, seconds]),
        np.tile(np.asarray(point, np.float64), (2, 1)),
        np.full(2, storey, dtype=np.int32),
        np.ones(2),
        np.array([turn, 0.0]),
        0.0,
    )


def rest(points: NDArray[np.float64], storeys: NDArray[np.int32], seconds: float) -> Motion:
    """Return the motion of something that is carried along a line in given seconds, as by a lift."""
    reached = np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum())
    times = reached / reached[-1] * seconds if reached[-1] > 0 else np.linspace(0.0, seconds, len(points))
    return Motion(times, points, storeys, np.ones(len(points)), np.zeros(len(points)), float(reached[-1]))


def drive(
    points: NDArray[np.float64],
    storeys: NDArray[np.int32],
    robot: Robot,
    *,
    speed: float | None = None,
    heading: float | None = None,
    limits: Sequence[float] | None = None,
) -> Motion:
    """Plan how a robot drives along a line, from rest to rest.

    The speed rises and falls with constant acceleration, so that it is a trapezoid over time on a straight
    line, and never above a limit. A robot with a turn rate halts wherever the line turns, and turns on the
    spot; one without rounds corners at speed.

    Parameters
    ----------
    points : (n, 3) float64, metres
    storeys : (n,) int32
    robot
        Gives speed, acceleration and turn rate.
    speed
        Cruising speed instead of the robot's, metres per second.
    heading
        Which way the robot faces before, radians; None if it already faces the right way.
    limits : (n - 1,) metres per second
        Highest speed on every piece of the line; None for no limit.
    """
    speed = robot.speed if speed is None else speed
    if math.isinf(robot.acceleration) and math.isinf(robot.turn_rate) and limits is None:
        reached = np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum())
        n = len(points)
        return Motion(reached / speed, points, storeys, np.ones(n), np.zeros(n), float(reached[-1]))
    places, floors = points.tolist(), storeys.tolist()
    tops = [speed] * (len(places) - 1) if limits is None else [min(speed, limit) for limit in limits]
    line, on, lengths, kept = [places[0]], [floors[0]], [], []
    for a, b, floor, top in zip(places, places[1:], floors[1:], tops, strict=False):
        dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length > _SAME_POINT:
            line.append(b)
            on.append(floor)
            lengths.append(length)
            kept.append(top)
    if len(line) == 1:
        return stand(line[0], on[0])
    turns = _turns(line, heading) if math.isfinite(robot.turn_rate) else [0.0] * len(lengths)
    return _driven(line, on, lengths, kept, turns, robot)


def _turns(line: Sequence[Sequence[float]], heading: float | None) -> list[float]:
    """Return how far to turn before every piece of a line, radians; a piece that only rises turns nothing."""
    turns = []
    facing = heading
    for a, b in pairwise(line):
        dx, dy = b[0] - a[0], b[1] - a[1]
        if math.hypot(dx, dy) <= _SAME_POINT:
            turns.append(0.0)
            continue
        ahead = math.atan2(dy, dx)
        turn = 0.0 if facing is None else math.remainder(ahead - facing, 2 * math.pi)
        turns.append(turn if abs(turn) > _STRAIGHT else 0.0)
        facing = ahead
    return turns


def _driven(
    line: Sequence[Sequence[float]],
    on: Sequence[int],
    lengths: Sequence[float],
    tops: Sequence[float],
    turns: Sequence[float],
    robot: Robot,
) -> Motion:
    """Put the pieces of a line together: turns, and the three phases of every piece."""
    speeds = _speeds_at(lengths, tops, turns, robot.acceleration)
    time, times, points, storeys = 0.0, [0.0], [line[0]], [on[0]]
    eases, turned = [], []
    for k, (a, b) in enumerate(pairwise(line)):
        if turns[k]:
            time += abs(turns[k]) / robot.turn_rate
            times.append(time)
            points.append(a)
            storeys.append(on[k])
            eases.append(1.0)
            turned.append(turns[k])
        for share, span, ease in _phases(lengths[k], speeds[k], tops[k], speeds[k + 1], robot.acceleration):
            time += span
            times.append(time)
            if share >= 1:
                points.append(b)
                storeys.append(on[k + 1])
            else:
                points.append([x + share * (y - x) for x, y in zip(a, b, strict=True)])
                storeys.append(on[k])
            eases.append(ease)
            turned.append(0.0)
    total = sum(lengths) if len(lengths) < _PAIRWISE else float(np.array(lengths).sum())
    return Motion(
        np.array(times),
        np.array(points),
        np.array(storeys, dtype=np.int32),
        np.array([*eases, 1.0]),
        np.array([*turned, 0.0]),
        total,
    )


def _speeds_at(
    lengths: Sequence[float], tops: Sequence[float], turns: Sequence[float], acceleration: float
) -> list[float]:
    """Return the speed at every point: what limits, turns, starting and braking allow."""
    n = len(lengths)
    speeds = [0.0, *map(min, tops, tops[1:]), 0.0]
    for k in range(1, n):
        if turns[k]:
            speeds[k] = 0.0
    if math.isinf(acceleration):
        return speeds
    for k in range(n):
        speeds[k + 1] = min(speeds[k + 1], math.sqrt(speeds[k] ** 2 + 2 * acceleration * lengths[k]))
    for k in reversed(range(n)):
        speeds[k] = min(speeds[k], math.sqrt(speeds[k + 1] ** 2 + 2 * acceleration * lengths[k]))
    return speeds


def _phases(
    length: float, before: float, top: float, after: float, acceleration: float
) -> list[tuple[float, float, float]]:
    """Return the phases of a piece: share of it done at their end, seconds, and ease."""
    if math.isinf(acceleration):
        return [(1.0, length / top, 1.0)]
    peak = min(top, math.sqrt(acceleration * length + (before * before + after * after) / 2))
    faster = (peak * peak - before * before) / (2 * acceleration)
    slower = (peak * peak - after * after) / (2 * acceleration)
    cruise = length - faster - slower
    phases, done = [], 0.0
    for way, begin, end in ((faster, before, peak), (cruise, peak, peak), (slower, peak, after)):
        if way > _SAME_POINT * length:
            done += way
            phases.append((done / length, 2 * way / (begin + end), 2 * begin / (begin + end)))
    share, span, ease = phases[-1]
    phases[-1] = (max(share, 1.0), span, ease)
    return phases
