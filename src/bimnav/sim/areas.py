"""Where routes cross areas of a storey: doorways, narrow passages, stretches with a speed limit."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks
from bimnav.errors import ValueRangeError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Areas", "Crossing", "Passage", "SpeedLimit", "crossings", "cut_at"]

_TOUCH = 1e-6  # metres; a route that only touches an area does not cross it
_JOIN = 1e-6  # metres between two crossings that are one


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """Floor that few robots may be on at a time: a narrow corridor, a doorway, a lift lobby.

    Parameters
    ----------
    name
        How the log calls it.
    polygon
        Plan view in world coordinates, metres: where the middle of a robot uses it.
    storey
        Index of the storey.
    capacity
        How many robots may be on it at a time.
    """

    name: str
    polygon: BaseGeometry
    storey: int = 0
    capacity: int = 1

    def __post_init__(self) -> None:
        _checks.fields(self, wholes="storey capacity", texts="name", shapes="polygon")
        if self.capacity < 1 or self.polygon.is_empty:
            raise ValueRangeError(
                f"passage {self.name!r} takes {self.capacity} robots on {self.polygon.area:g} m².",
                "Give a polygon with area, and a capacity of at least 1.",
            )


@dataclass(frozen=True, slots=True, eq=False)
class SpeedLimit:
    """Floor on which robots drive no faster than a speed.

    Parameters
    ----------
    polygon
        Plan view in world coordinates, metres.
    speed
        Metres per second.
    storey
        Index of the storey; what rises from it, such as a stair or a ramp, belongs to it.
    """

    polygon: BaseGeometry
    speed: float
    storey: int = 0

    def __post_init__(self) -> None:
        _checks.fields(self, numbers="speed", wholes="storey", shapes="polygon")
        if not 0 < self.speed < math.inf:
            raise ValueRangeError(f"a speed limit of {self.speed} m/s is none.", "Give a speed above 0.")


@dataclass(frozen=True, slots=True)
class Crossing:
    """A part of a line inside an area: metres along the line, and the index of the area."""

    begin: float
    end: float
    area: int


class Areas:
    """Areas of storeys, and the boxes around them.

    Parameters
    ----------
    areas
        Polygon and storey of each.
    """

    def __init__(self, areas: Sequence[tuple[BaseGeometry, int]]) -> None:
        self.polygons = [polygon for polygon, _ in areas]
        self.storeys = np.array([storey for _, storey in areas], dtype=np.int32)
        bounds = shapely.bounds(self.polygons).reshape(-1, 4)
        self.low, self.high = bounds[:, :2], bounds[:, 2:]

    def near(self, points: NDArray[np.float64], storeys: NDArray[np.int32]) -> list[int]:
        """Return those whose boxes meet that of a line, on one of its storeys; never an empty polygon."""
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        found = np.flatnonzero(((self.low <= high) & (self.high >= low)).all(axis=1)).tolist()
        on = set(storeys.tolist())
        return [index for index in found if self.storeys.item(index) in on]


def crossings(
    points: NDArray[np.float64], storeys: NDArray[np.int32], areas: Areas | Sequence[tuple[BaseGeometry, int]]
) -> list[Crossing]:
    """Find where a line lies inside areas of its storeys.

    Parameters
    ----------
    points : (n, 3) float64, metres
    storeys : (n,) int32, of every point; a piece between two storeys belongs to that of its first point
    areas
        Polygon and storey of each.

    Returns
    -------
    crossings
        By begin, then area; touching pieces of one area are one crossing.
    """
    if len(points) < 2:
        return []
    areas = areas if isinstance(areas, Areas) else Areas(areas)
    around = areas.near(points, storeys)
    if not around:
        return []
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    reached = np.append(0.0, steps.cumsum())
    lines = shapely.linestrings(np.stack([points[:-1, :2], points[1:, :2]], axis=1))
    merged = []
    for index in around:
        polygon, parts = areas.polygons[index], []
        near = np.flatnonzero((storeys[:-1] == areas.storeys[index]) & shapely.intersects(lines, polygon))
        for k in near.tolist():
            for begin, end in _inside(points[k, :2], points[k + 1, :2], shapely.intersection(lines[k], polygon)):
                parts.append((reached[k] + begin * steps[k], reached[k] + end * steps[k]))
        merged += [Crossing(float(begin), float(end), index) for begin, end in _joined(parts) if end - begin > _TOUCH]
    return sorted(merged, key=lambda crossing: (crossing.begin, crossing.area))


def _inside(a: NDArray[np.float64], b: NDArray[np.float64], part: BaseGeometry) -> list[tuple[float, float]]:
    """Return the shares of a piece from a to b that an intersection with it covers."""
    way = b - a
    square = float(way @ way)
    if square == 0 or part.is_empty:  # lines and polygons that meet by a rounding share nothing
        return []
    shares = []
    for piece in shapely.get_parts(part).tolist():
        along = ((shapely.get_coordinates(piece) - a) @ way / square).clip(0, 1)
        shares.append((float(along.min()), float(along.max())))
    return sorted(shares)


def _joined(parts: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    joined: list[tuple[float, float]] = []
    for begin, end in sorted(parts):
        if joined and begin - joined[-1][1] <= _JOIN:
            joined[-1] = (joined[-1][0], max(joined[-1][1], end))
        else:
            joined.append((begin, end))
    return joined


def cut_at(
    points: NDArray[np.float64], storeys: NDArray[np.int32], places: Sequence[float]
) -> list[tuple[NDArray[np.float64], NDArray[np.int32]]]:
    """Cut a line at metres along it; pieces without length fall away.

    Returns
    -------
    pieces
        Points and storeys, in order; each begins where the one before ended.
    """
    rows, floors = points.tolist(), storeys.tolist()
    reached = [0.0]
    for (x, y, z), (u, v, w) in pairwise(rows):
        dx, dy, dz = u - x, v - y, w - z
        reached.append(reached[-1] + math.sqrt(dx * dx + dy * dy + dz * dz))
    total = reached[-1]
    inner = sorted({place for place in places if _JOIN < place < total - _JOIN})
    pieces = []
    for begin, end in zip([0.0, *inner], [*inner, total], strict=True):
        first, last = bisect_right(reached, begin), bisect_left(reached, end)
        line = [_point_at(rows, reached, begin), *rows[first:last], _point_at(rows, reached, end)]
        behind = floors[last] if end == total or last == first else floors[last - 1]
        on = [floors[max(first - 1, 0)], *floors[first:last], behind]
        pieces.append((np.array(line), np.array(on, dtype=np.int32)))
    return pieces


def _point_at(rows: Sequence[Sequence[float]], reached: Sequence[float], place: float) -> Sequence[float]:
    if not 0 < place < reached[-1]:
        return rows[0] if place <= 0 else rows[-1]
    k = bisect_right(reached, place) - 1
    share = (place - reached[k]) / (reached[k + 1] - reached[k])
    return [a + share * (b - a) for a, b in zip(rows[k], rows[k + 1], strict=True)]
