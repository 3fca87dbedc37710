"""Where a robot was, and what it did, at every moment."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.errors import SimulationError, ValueRangeError

__all__ = ["RobotState", "RobotStatus", "Track", "TrackRecorder"]

_STILL = 1e-9  # metres; a shorter move is rounding and turns no robot
_TRAJECTORY = np.dtype([*((name, np.float64) for name in ("time", "x", "y", "z", "heading")), ("status", "U8")])
_MOST_ROWS = 10_000_000  # of a trajectory cut into steps


class RobotStatus(StrEnum):
    """What a robot is doing."""

    IDLE = "idle"
    MOVING = "moving"
    WORKING = "working"
    CHARGING = "charging"
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
    moves straight at constant speed.

    Parameters
    ----------
    times : (n,) float64, seconds, never falling
    points : (n, 3) float64, world points in metres
    statuses : (n,) str of `RobotStatus`
    storeys : (n,) int32, indexes of storeys
    stops : (n,) int32, indexes into the tour's stops; -1 for none
    """

    times: NDArray[np.float64]
    points: NDArray[np.float64]
    statuses: NDArray[np.str_]
    storeys: NDArray[np.int32]
    stops: NDArray[np.int32]

    def __post_init__(self) -> None:
        for name, dtype in (
            ("times", np.float64),
            ("points", np.float64),
            ("statuses", np.str_),
            ("storeys", np.int32),
            ("stops", np.int32),
        ):
            array = np.array(getattr(self, name), dtype=dtype)  # a private copy
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        n = len(self.times)
        if not n or self.points.shape != (n, 3) or not len(self.statuses) == len(self.storeys) == len(self.stops) == n:
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
        """(n,) float64, radians; a robot that stands faces where it came from, or first goes to."""
        dx, dy = np.diff(self.points[:, :2], axis=0, append=self.points[-1:, :2]).T
        turns = np.flatnonzero(np.hypot(dx, dy) > _STILL)
        if not len(turns):
            return np.zeros(len(self.times))
        last = np.searchsorted(turns, np.arange(len(self.times)), side="right") - 1
        headings: NDArray[np.float64] = np.arctan2(dy, dx)[turns[np.maximum(last, 0)]]
        return headings

    def rows_at(self, times: ArrayLike) -> NDArray[np.int64]:
        """Return which row holds at given seconds; before the first row, the first."""
        rows: NDArray[np.int64] = np.searchsorted(self.times, times, side="right") - 1
        return np.maximum(rows, 0)

    def points_at(self, times: ArrayLike) -> NDArray[np.float64]:
        """Return where the robot is at given seconds: (m,) to (m, 3) metres."""
        rows = self.rows_at(times)
        after = np.minimum(rows + 1, len(self.times) - 1)
        span = self.times[after] - self.times[rows]
        passed = np.clip(np.asarray(times) - self.times[rows], 0, span)
        share = np.divide(passed, span, out=np.zeros_like(span), where=span > 0)[..., None]
        points: NDArray[np.float64] = self.points[rows] + share * (self.points[after] - self.points[rows])
        return points

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
        columns = (times, *self.points_at(times).T, self.headings[rows], self.statuses[rows])
        for name, column in zip(table.dtype.names or (), columns, strict=True):
            table[name] = column
        return table


@dataclass(slots=True)
class TrackRecorder:
    """Collects the rows of a track, piece by piece."""

    pieces: list[tuple[NDArray[np.float64], NDArray[np.float64], RobotStatus, NDArray[np.int32], int]] = field(
        default_factory=list
    )

    def add(self, times: ArrayLike, points: ArrayLike, status: RobotStatus, storeys: ArrayLike, stop: int) -> None:
        """Add rows: (m,) seconds, (m, 3) metres and (m,) storeys, all with one status and one stop."""
        self.pieces.append(
            (np.asarray(times, np.float64), np.asarray(points, np.float64), status, np.asarray(storeys, np.int32), stop)
        )

    def finish(self) -> Track:
        """Return everything that was added as one track."""
        times, points, statuses, storeys, stops = zip(*self.pieces, strict=True)
        sizes = [len(piece) for piece in times]
        return Track(
            np.concatenate(times),
            np.concatenate(points),
            np.repeat([str(status) for status in statuses], sizes),
            np.concatenate(storeys),
            np.repeat(stops, sizes),
        )
