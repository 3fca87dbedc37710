"""Stairs, ramps and lifts described: which levels they join, how steep and how wide they are, where one gets on."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav._doorways import Doorway, doorway_of
from bimnav._levels import NEAR, Ground
from bimnav.building import Building, Connector, Door, Shape
from bimnav.footprint import outline, unite, whole

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Ascent", "describe_connectors"]

_TREAD = 0.05  # square metres; a smaller level face is a nosing or a handrail
_LEAST_RISE, _MOST_RISE = 0.06, 0.30  # metres from tread to tread
_STRAY = 0.05  # metres that a straight way may stray to its sides
_CLEAR = 0.05  # metres that a robot keeps from the first tread when it gets on
_BEFORE = 0.4  # metres from the first tread, ramp edge or lift door at which one gets on
_PLATE = 0.12  # metres; a tread is no thicker
_STEEP = 0.7  # least z of the normal of a face that a ramp is walked on
_FLAT = 0.9999  # and the greatest: less than a degree
_EDGE = 0.02  # metres of height within which a tread is flush with a floor, or corners are the end of a ramp
_LIFT_DOOR = 0.6  # metres from a lift within which its doors are
_HEADROOM = 1.5  # metres above its highest stop that a lift reaches at least
_DOOR = re.compile(r"door|t[uü]r\b|porte\b|puerta", re.IGNORECASE)
_TROD = ("IfcStairFlight", "IfcRampFlight", "IfcSlab")
_NOT_TROD = ("IfcRailing", "IfcMember", "IfcPlate", "IfcBeam", "IfcColumn")


Point: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Ascent:
    """What geometry tells of a connector. Lengths are metres; None is unknown, or has no meaning for its kind.

    Parameters
    ----------
    levels
        World heights of the floors it joins, from the lowest up.
    storeys
        Index of the building's storey for each of them.
    entries : tuple of (x, y, z)
        World point for each level, where one gets on and off.
    rise
        From the lowest to the highest level.
    run, length
        Of the way over treads or ramps: in plan view, and in space.
    width
        The least on the way.
    slope
        Rise divided by run; of a ramp, that of its steepest flight.
    steps, riser
        Number and height of the risers of a stair.
    way : tuple of (x, y, z)
        The way over it in world coordinates, from the lowest level to the highest: over the middles of its
        treads, along the middle of its slopes; of a lift, the middle of its car at each level. Empty if
        geometry shows none.
    doors
        GlobalIds of the doors of a lift.
    outward : tuple of (x, y)
        For each level, the direction of length 1 in which one gets off.
    """

    global_id: str
    name: str
    kind: Literal["stair", "ramp", "lift"]
    levels: tuple[float, ...]
    storeys: tuple[int, ...]
    entries: tuple[Point, ...]
    rise: float
    run: float | None = None
    length: float | None = None
    width: float | None = None
    slope: float | None = None
    steps: int | None = None
    riser: float | None = None
    way: tuple[Point, ...] = ()
    doors: tuple[str, ...] = ()
    outward: tuple[tuple[float, float], ...] = ()

    @property
    def is_straight(self) -> bool:
        """Whether one does not turn on the way, in plan view."""
        way = np.array(self.way)[:, :2]
        ahead = _unit(way[-1] - way[0])
        return bool((np.abs((way - way[0]) @ (-ahead[1], ahead[0])) <= _STRAY).all())

    def line(self, first: int = 0, last: int = -1, *, radius: float = 0.0) -> NDArray[np.float64]:
        """Return the way over it, (n, 3), with where one gets on and off; of a lift, between two of its levels.

        Parameters
        ----------
        radius
            Of a robot, metres; a large one gets on farther away, where it is clear of the first tread.
        """
        inner = [self.way[first], self.way[last]] if self.kind == "lift" else self.way
        line = np.array([self.entries[first], *inner, self.entries[last]])
        farther = max(radius + _CLEAR - _BEFORE, 0.0)
        line[[0, -1], :2] += farther * np.array([self.outward[first], self.outward[last]])
        return line


def describe_connectors(building: Building) -> tuple[Ascent, ...]:
    """Describe the stairs, ramps and lifts of a building, in its order.

    It does not matter how they are written: in flights and landings, as one body, or as a piece of
    equipment. One whose geometry shows neither treads nor a slope is described by its box alone.
    """
    if not building.connectors:
        return ()
    survey = _Survey(building)
    return tuple(survey.describe(connector) for connector in building.connectors)


class _Survey:
    """The floors of a building, and what joins them."""

    def __init__(self, building: Building) -> None:
        self.building = building
        self.ground = Ground(building, 0.0)
        heights = {top.height for top in self.ground.tops if top.source == "slab"}
        heights |= {room.base for room in self.ground.rooms}
        self.levels = np.array(sorted(heights | set(self.ground.elevations.tolist())))

    def describe(self, connector: Connector) -> Ascent:
        """Describe one connector by its treads, slope or doors, else by its box."""
        parts = [self.building[part] for part in connector.parts if part in self.building]
        trod = [part for part in parts if part.ifc_class.startswith(_TROD)]
        trod = trod or [part for part in parts if not part.ifc_class.startswith(_NOT_TROD)] or parts
        shapes = [shape for part in trod for shape in part.shapes]
        describe = {"stair": self._stair, "ramp": self._ramp, "lift": self._lift}[connector.kind]
        return describe(connector, shapes) or self._boxed(connector, shapes)

    def _stair(self, connector: Connector, shapes: Sequence[Shape]) -> Ascent | None:
        treads = _treads(shapes)
        rises = np.diff([height for height, _ in treads])
        if not len(rises):
            return None
        riser = float(np.median(rises))
        (first, lowest), (last, highest) = treads[0], treads[-1]
        low = self._floor_near(first - 1.5 * riser, first - riser / 4, first - riser)
        flush = self._floor_near(last - _EDGE, last + _EDGE, np.nan)
        high = self._floor_near(last, last + 1.5 * riser, last + riser) if np.isnan(flush) else flush
        centers = np.array([shapely.get_coordinates(plan.centroid)[0] for _, plan in treads])
        ahead, onward = _unit(centers[1] - centers[0]), _unit(centers[-1] - centers[-2])
        foot = centers[0] - ahead * _extent(lowest, ahead) / 2
        head = centers[-1] + onward * _extent(highest, onward) / 2
        heights = [low, *(height for height, _ in treads), high]
        way = np.column_stack([np.vstack([foot, centers, head]), heights])
        middling = 2.5 * np.median([plan.area for _, plan in treads])  # a landing is larger
        widths = [_longest(plan) for _, plan in treads if plan.area <= middling]
        steps = len(treads) + (high - last > _EDGE)
        return self._ascent(connector, way, (-ahead, onward), width=min(widths, default=None), steps=steps, riser=riser)

    def _ramp(self, connector: Connector, shapes: Sequence[Shape]) -> Ascent | None:
        flights = sorted((f for shape in shapes if (f := _flight(shape))), key=lambda flight: flight[0][2])
        if not flights:
            return None
        way = np.array([point for low, high, _ in flights for point in (low, high)])
        slopes = [(high[2] - low[2]) / np.hypot(*(high - low)[:2]) for low, high, _ in flights]
        ahead, onward = _unit((way[1] - way[0])[:2]), _unit((way[-1] - way[-2])[:2])
        for k in (0, -1):
            way[k, 2] = self._floor_near(way[k, 2] - NEAR, way[k, 2] + NEAR, way[k, 2])
        return self._ascent(
            connector, way, (-ahead, onward), width=min(width for *_, width in flights), slope=float(max(slopes))
        )

    def _lift(self, connector: Connector, shapes: Sequence[Shape]) -> Ascent | None:
        plan = unite(outline([shape]) for shape in shapes)
        stops: dict[float, tuple[NDArray[np.float64], float, NDArray[np.float64]]] = {}
        doors = []
        for global_id, way in self._ways_near(plan):
            if connector.low - NEAR <= way.bottom <= connector.high - _HEADROOM:
                away = way.across * (1 if (way.center - plan.centroid.coords[0]) @ way.across > 0 else -1)
                level = self._floor_near(way.bottom - NEAR, way.bottom + NEAR, way.bottom)
                stops[level] = way.center + (way.depth / 2 + _BEFORE) * away, way.width, away
                doors.append(global_id)
        if not stops:
            return None
        levels = sorted(stops)
        x, y = shapely.get_coordinates(plan.centroid)[0].tolist()
        return Ascent(
            connector.global_id,
            connector.name,
            connector.kind,
            tuple(levels),
            tuple(self.ground.storey_at(level) for level in levels),
            tuple((*stops[level][0].tolist(), level) for level in levels),
            levels[-1] - levels[0],
            width=min(width for _, width, _ in stops.values()),
            way=tuple((x, y, level) for level in levels),
            doors=tuple(doors),
            outward=tuple((float(x), float(y)) for x, y in (stops[level][2] for level in levels)),
        )

    def _ways_near(self, plan: BaseGeometry) -> Iterable[tuple[str, Doorway]]:
        """Yield the doors of a lift, also those that are written as equipment, each with its GlobalId."""
        doors = {door.global_id for door in self.building.doors}
        called = [e for e in self.building.elements if e.global_id not in doors and _DOOR.search(e.name)]
        ways = [(door.global_id, way) for door, way in self.ground.doors]
        ways += [(element.global_id, way) for element in called if (way := doorway_of(Door(element))) is not None]
        yield from (w for w in ways if 0 < plan.distance(shapely.Point(w[1].center)) <= _LIFT_DOOR)

    def _boxed(self, connector: Connector, shapes: Sequence[Shape]) -> Ascent:
        """Describe a connector by its ends: it joins the floors nearest to them, in the middle of its plan."""
        middle = shapely.get_coordinates(outline(shapes).centroid)
        top = connector.high - (_HEADROOM if connector.kind == "lift" else 0)
        within = self.ground.elevations
        within = within[(within >= connector.low - NEAR) & (within <= max(top, connector.low) + NEAR)].tolist()
        levels = within if connector.kind == "lift" and within else [connector.low, connector.high]
        return Ascent(
            connector.global_id,
            connector.name,
            connector.kind,
            tuple(levels),
            tuple(self.ground.storey_at(level) for level in levels),
            tuple((float(x), float(y), level) for level in levels for x, y in middle),
            levels[-1] - levels[0],
        )

    def _floor_near(self, low: float, high: float, wanted: float) -> float:
        """Return the floor between two heights that is nearest to a wanted one; the wanted one if there is none."""
        near = self.levels[(self.levels >= low) & (self.levels <= high)]
        if not len(near):
            return wanted
        return float(near[0 if np.isnan(wanted) else np.abs(near - wanted).argmin()])

    def _ascent(
        self, connector: Connector, way: NDArray[np.float64], outward: Iterable[NDArray[np.float64]], **known: Any
    ) -> Ascent:
        """Describe a connector by the way over it, (n, 3), and the directions in which one gets off at its ends."""
        away = [(float(x), float(y)) for x, y in outward]
        ends = [way[k, :2] + _BEFORE * np.array(away[k]) for k in (0, -1)]
        low, high = way[[0, -1], 2].tolist()
        legs = np.diff(way, axis=0)
        run = float(np.hypot(*legs[:, :2].T).sum())
        points = tuple((x, y, z) for x, y, z in way.tolist())
        slope = (high - low) / run if run > 0 else None
        found: dict[str, Any] = {"slope": slope, "way": points, "outward": tuple(away)}
        return Ascent(
            connector.global_id,
            connector.name,
            connector.kind,
            (low, high),
            (self.ground.storey_at(low), self.ground.storey_at(high)),
            tuple((*end.tolist(), level) for end, level in zip(ends, (low, high), strict=True)),
            high - low,
            run=run,
            length=float(np.linalg.norm(legs, axis=1).sum()),
            **(found | known),
        )


def _treads(shapes: Sequence[Shape]) -> list[tuple[float, BaseGeometry]]:
    """Return height and plan of the longest run of treads, from the lowest up."""
    found = sorted((tread for shape in shapes for tread in _level_faces(shape)), key=lambda tread: tread[0])
    runs: list[list[tuple[float, BaseGeometry]]] = []
    for height, plan in found:
        if runs and height - runs[-1][-1][0] < _LEAST_RISE:
            runs[-1][-1] = (height, unite([plan, runs[-1][-1][1]]))
        elif runs and height - runs[-1][-1][0] <= _MOST_RISE:
            runs[-1].append((height, plan))
        else:
            runs.append([(height, plan)])
    return max(runs, key=len, default=[])


def _level_faces(shape: Shape) -> Iterable[tuple[float, BaseGeometry]]:
    """Yield height and plan of the level faces that look up; of an open mesh, of those that are no underside."""
    corners, upward, _, quality = _faces(shape)
    level = upward >= _FLAT if quality != "surface" else np.abs(upward) >= _FLAT
    heights, index = np.unique(corners[level].mean(axis=1)[:, 2].round(4), return_inverse=True)
    plans = [unite(shapely.polygons(corners[level][index == k, :, :2])) for k in range(len(heights))]
    for k, (height, plan) in enumerate(zip(heights.tolist(), plans, strict=True)):
        above = [plans[i] for i in range(k + 1, len(plans)) if heights[i] - height <= _PLATE]
        is_underside = quality == "surface" and unite(above).intersection(plan).area > plan.area / 2
        if plan.area >= _TREAD and not is_underside:
            yield height, plan


def _flight(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | None:
    """Return the middle of the lower and of the upper edge of a ramp, (3,), and its width, metres."""
    corners, upward, areas, _ = _faces(shape)
    sloped = (upward > _STEEP) & (upward < _FLAT)
    if not sloped.any():
        return None
    points = np.unique(corners[sloped].reshape(-1, 3).round(6), axis=0)
    low = points[points[:, 2] <= points[:, 2].min() + _EDGE].mean(axis=0)
    high = points[points[:, 2] >= points[:, 2].max() - _EDGE].mean(axis=0)
    run = float(np.hypot(*(high - low)[:2]))
    return (low, high, float((areas * upward)[sloped].sum()) / run) if run > 0 else None


def _faces(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], str]:
    """Return the faces of a shape, (n, 3, 3), the z of their outward normals, their areas, and its quality."""
    solid = whole(shape.mesh)
    corners = Shape(solid, shape.placement).world_vertices()[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    return corners, normals[:, 2] / np.maximum(lengths, 1e-12), lengths / 2, solid.quality


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    length = float(np.hypot(*vector))
    return vector / length if length > 0 else np.array([1.0, 0.0])


def _longest(plan: BaseGeometry) -> float:
    """Return the longer side of the smallest rectangle around a tread, metres."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(plan))
    return float(np.hypot(*np.diff(corners, axis=0).T).max())


def _extent(plan: BaseGeometry, direction: NDArray[np.float64]) -> float:
    """Return how far a polygon reaches in a direction, metres."""
    along = shapely.get_coordinates(plan) @ direction
    return float(along.max() - along.min())
