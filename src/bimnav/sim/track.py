"""Where a robot was, and what it did, at every moment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.errors import SimulationError, ValueRangeError

if TYPE_CHECKING:
    from bimnav.sim.motion import Motion
    from bimnav.sim.routes import Legs

__all__ = ["RobotState", "RobotStatus", "Track", "TrackRecorder", "wrapped"]

_ROUNDING = 1e-6  # seconds
_STILL = 1e-9  # metres; a shorter move is rounding and turns no robot
_TRAJECTORY = np.dtype([*((name, np.float64) for name in ("time", "x", "y", "z", "heading")), ("status", "U8")])
_MOST_ROWS = 10_000_000  # of a trajectory cut into steps


class RobotStatus(StrEnum):
    """What a robot is doing."""

    IDLE = "idle"
    MOVING = "moving"
    WORKING = "working"
    WAITING = "waiting"
    CHARGING = "charging"
    BLOCKED = "blocked"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class RobotState:
    """A robot at one moment.

    Parameters
    ----------
    time
        Seconds.
    robot
        Its name.
    x, y, z
        World point in metres.
    heading
        Direction it faces, radians counter-clockwise from x.
    storey
        Name of the storey it is on.
    target
        GlobalId of the target it drives to or works at; empty if there is none.
    """

    time: float
    robot: str
    status: RobotStatus
    x: float
    y: float
    z: float
    heading: float
    storey: str
    target: str


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of one robot, exact at every moment.

    Row k holds from `times[k]` until `times[k + 1]`, the last row from then on. Between two rows the robot
    moves straight with constant acceleration, or turns on the spot at constant rate.

    Parameters
    ----------
    times : (n,) float64, seconds, never falling
    points : (n, 3) float64, world points in metres
    statuses : (n,) str of `RobotStatus`
    storeys : (n,) int32, indexes of storeys
    stops : (n,) int32, indexes into the robot's stops; -1 for none
    eases : (n,) float64
        Speed at the start of a row divided by its mean speed: 1 is constant, 0 from rest, 2 to rest.
    turns : (n,) float64
        How far the robot turns on the spot during a row, radians counter-clockwise.
    """

    times: NDArray[np.float64]
    points: NDArray[np.float64]
    statuses: NDArray[np.str_]
    storeys: NDArray[np.int32]
    stops: NDArray[np.int32]
    eases: NDArray[np.float64] = None  # type: ignore[assignment]  # ones
    turns: NDArray[np.float64] = None  # type: ignore[assignment]  # zeros

    def __post_init__(self) -> None:
        n = len(self.times)
        for name, fill in (("eases", np.ones), ("turns", np.zeros)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, fill(n))
        for name, dtype in (
            ("times", np.float64),
            ("points", np.float64),
            ("statuses", np.str_),
            ("storeys", np.int32),
            ("stops", np.int32),
            ("eases", np.float64),
            ("turns", np.float64),
        ):
            array = np.array(getattr(self, name), dtype=dtype)  # a private copy
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        columns = (self.statuses, self.storeys, self.stops, self.eases, self.turns)
        if not n or self.points.shape != (n, 3) or any(len(column) != n for column in columns):
            raise SimulationError(f"a track of {n} times and points of shape {self.points.shape} is none.")
        if not (np.isfinite(self.times).all() and np.isfinite(self.points).all() and (np.diff(self.times) >= 0).all()):
            raise SimulationError("a track has times or points that are not finite, or times that fall.")

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """(n - 1,) float64, metres from every row to the next."""
        lengths: NDArray[np.float64] = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return lengths

    @cached_property
    def headings(self) -> NDArray[np.float64]:
        """(n,) float64, radians, as each row begins.

        A robot that stands faces where it came from, or first goes to, and where it has turned since.
        """
        n = len(self.times)
        dx, dy = np.diff(self.points[:, :2], axis=0, append=self.points[-1:, :2]).T
        moves = np.flatnonzero(np.hypot(dx, dy) > _STILL)
        turned = np.append(0.0, self.turns.cumsum())[:n]
        if not len(moves):
            return turned
        last = np.searchsorted(moves, np.arange(n), side="right") - 1
        base = moves[np.maximum(last, 0)]
        since = np.where(last >= 0, turned - turned[base], 0.0)
        headings: NDArray[np.float64] = np.arctan2(dy, dx)[base]
        return np.where(since == 0, headings, wrapped(headings + since))

    def headings_at(self, times: ArrayLike) -> NDArray[np.float64]:
        """Return which way the robot faces at given seconds: (m,) to (m,) radians."""
        rows = self.rows_at(times)
        part = self.turns[rows] * self._share(rows, times)
        headings: NDArray[np.float64] = np.where(part == 0, self.headings[rows], wrapped(self.headings[rows] + part))
        return headings

    def rows_at(self, times: ArrayLike) -> NDArray[np.int64]:
        """Return which row holds at given seconds; before the first row, the first."""
        rows: NDArray[np.int64] = np.searchsorted(self.times, times, side="right") - 1
        return np.maximum(rows, 0)

    def points_at(self, times: ArrayLike) -> NDArray[np.float64]:
        """Return where the robot is at given seconds: (m,) to (m, 3) metres."""
        rows = self.rows_at(times)
        after = np.minimum(rows + 1, len(self.times) - 1)
        share, ease = self._share(rows, times), self.eases[rows]
        driven = (share * (ease + (1 - ease) * share))[..., None]
        points: NDArray[np.float64] = self.points[rows] + driven * (self.points[after] - self.points[rows])
        return points

    def _share(self, rows: NDArray[np.int64], times: ArrayLike) -> NDArray[np.float64]:
        """Return which part of its row has passed at each time, 0 to 1."""
        after = np.minimum(rows + 1, len(self.times) - 1)
        span = self.times[after] - self.times[rows]
        passed = np.clip(np.asarray(times) - self.times[rows], 0, span)
        share: NDArray[np.float64] = np.divide(passed, span, out=np.zeros_like(span), where=span > 0)
        return share

    def kept_rows(self) -> NDArray[np.int64]:
        """Return the rows that last: of several at one time, the last."""
        return np.flatnonzero(np.diff(self.times, append=np.inf) > 0)

    def seconds_in(self, status: RobotStatus) -> float:
        """Return how long the robot had a status, up to the last row."""
        return float(np.diff(self.times)[self.statuses[:-1] == status].sum())

    def trajectory(self, step: float | None = None) -> NDArray[Any]:
        """Return the motion as a table; see `SimResult.trajectory`."""
        times: NDArray[np.float64]
        if step is None:
            times = self.times[self.kept_rows()]
        else:
            start, end = float(self.times[0]), float(self.times[-1])
            if not (math.isfinite(step) and step > 0 and end - start <= step * _MOST_ROWS):
                raise ValueRangeError(
                    f"step is {step}.",
                    f"Give seconds above 0, at least {(end - start) / _MOST_ROWS:.3g}.",
                    {"step": step},
                )
            times = start + step * np.arange(math.ceil((end - start) / step), dtype=np.float64)
            times = np.append(times[times < end], end)
        rows = self.rows_at(times)
        table = np.empty(len(times), dtype=_TRAJECTORY)
        columns = (times, *self.points_at(times).T, self.headings_at(times), self.statuses[rows])
        for name, column in zip(table.dtype.names or (), columns, strict=True):
            table[name] = column
        return table


def wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles as the equal ones from -pi to pi, radians."""
    turned: NDArray[np.float64] = np.remainder(angle + math.pi, 2 * math.pi) - math.pi
    return turned


_Rows: TypeAlias = tuple[NDArray[Any], ...]  # the columns of a track, in the order of its fields


@dataclass(slots=True)
class TrackRecorder:
    """Collects the rows of a track, piece by piece."""

    pieces: list[tuple[float, Motion, str, int]] = field(default_factory=list)
    tables: list[_Rows] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether nothing was added yet."""
        return not (self.pieces or self.tables)

    def add(self, begin: float, motion: Motion, status: RobotStatus, stop: int) -> None:
        """Add the rows of a motion that began at a time, all with one status and one stop."""
        self.pieces.append((begin, motion, str(status), stop))

    def add_rounds(
        self, legs: Legs, times: NDArray[np.float64], begins: Sequence[float], arrivals: Sequence[float]
    ) -> None:
        """Add a tour that nothing disturbed: every leg, and the work at its stop.

        Parameters
        ----------
        times : (n,) seconds from the begin of its leg to every point
        begins, arrivals
            Seconds on the clock when each leg began, and when work at its stop did.
        """
        self._tabulate()
        edges = legs.edges[: len(begins) + 1]
        rows, behind = int(edges[-1]), edges[1:]
        indexes = np.arange(len(begins), dtype=np.int32)
        driven = np.repeat(np.asarray(begins, dtype=np.float64), np.diff(edges)) + times[:rows]
        statuses = np.insert(np.full(rows, str(RobotStatus.MOVING), "U8"), behind, str(RobotStatus.WORKING))
        self.tables.append(
            (
                np.insert(driven, behind, arrivals),
                np.insert(legs.points[:rows], behind, legs.points[behind - 1], axis=0),
                statuses,
                np.insert(legs.storeys[:rows], behind, legs.storeys[behind - 1]),
                np.insert(np.repeat(indexes, np.diff(edges)), behind, indexes),
                np.ones(len(statuses)),
                np.zeros(len(statuses)),
            )
        )

    def finish(self) -> Track:
        """Return everything that was added as one track."""
        self._tabulate()
        times, *columns = (np.concatenate(parts) for parts in zip(*self.tables, strict=True))
        level = np.maximum.accumulate(times)  # the clock adds up pieces of a motion, and rounds
        return Track(np.where(level - times <= _ROUNDING, level, times), *columns)

    def _tabulate(self) -> None:
        """Put the pieces so far in one table."""
        if not self.pieces:
            return
        begins, motions, statuses, stops = zip(*self.pieces, strict=True)
        self.pieces = []
        sizes = [len(motion.times) for motion in motions]
        self.tables.append(
            (
                np.concatenate([begin + motion.times for begin, motion in zip(begins, motions, strict=True)]),
                np.concatenate([motion.points for motion in motions]),
                np.repeat(np.array(statuses, "U8"), sizes),
                np.concatenate([motion.storeys for motion in motions]),
                np.repeat(stops, sizes),
                np.concatenate([motion.eases for motion in motions]),
                np.concatenate([motion.turns for motion in motions]),
            )
        )
