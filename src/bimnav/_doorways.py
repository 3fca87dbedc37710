"""Doors measured: how wide they are, which way they lead, what lies at their two sides, and how high their sill is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.building import Building, Door, Element, Opening, Shape, Space

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    Plan: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]

__all__ = ["Doorway", "doorway_of", "measured"]

_SIDESTEPS = (0.05, 0.25, 0.5)  # metres from the wall at which a room is looked for, the nearest first
_BELOW = 1.0  # metres; a floor farther below a door is not the one it opens to
_ABOVE = 0.35  # metres; a floor finish may lie this much above the bottom of an opening
_SLIVER, _EDGE = 1e-9, 1e-9  # metres or square metres in plan view; share of a side
_SHEET = 1e-3  # metres
_FLIGHT = 1.5  # metres; a room may lie a few steps above or below a door, and the ground outside as well
_BEYOND = np.arange(1.0, 4.1, 0.5)  # metres behind a door; a stairwell without a room of its own is no deeper
_PLATE = 1.5  # a plan view this many times longer than wide shows which way a leaf lies


@dataclass(frozen=True, slots=True, eq=False)
class Doorway:
    """The rectangle of a door or opening in plan view, and its heights.

    Parameters
    ----------
    center : (2,) float64
        World point, metres.
    along, across : (2,) float64
        Unit vectors: in the plane of the wall, and through it.
    width, depth
        Along and across, metres.
    bottom, top
        World heights, metres.
    """

    center: NDArray[np.float64]
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    width: float
    depth: float
    bottom: float
    top: float

    def rectangle(self, reach: float = 0.0) -> BaseGeometry:
        """Return the plan view, `reach` metres deeper to both sides."""
        return self._band(-self.depth / 2 - reach, self.depth / 2 + reach)

    def before(self, side: int, reach: float) -> BaseGeometry:
        """Return the rectangle in front of the side -1 or 1, `reach` metres deep."""
        return self._band(side * self.depth / 2, side * (self.depth / 2 + reach))

    def _band(self, back: float, front: float) -> BaseGeometry:
        half, ends = self.width / 2 * self.along, (back * self.across, front * self.across)
        corners = (ends[0] - half, ends[0] + half, ends[1] + half, ends[1] - half)
        return shapely.Polygon([self.center + corner for corner in corners])


def doorway_of(door: Door | Opening, building: Building | None = None) -> Doorway | None:
    """Find the rectangle of a door: of the opening it fills, else of its leaf; None without geometry.

    An opening may be deeper than wide, and far deeper than its wall. Which side is its width is told by
    the leaf, by the wall, or by the width that the file states; else it is the longer one.

    Parameters
    ----------
    building
        Holds the wall that an opening cuts; without it an opening is as deep as it is drawn.
    """
    opening, leaf = (door.opening, _plan_of(door.element)) if isinstance(door, Door) else (door, None)
    void = _plan_of(opening) if opening else None
    plan, wall, points = void or leaf, None, None
    bounds = opening.bounds if void and opening else door.element.bounds if isinstance(door, Door) else None
    if plan is None or bounds is None:
        return None
    if building and void and opening and opening.host in building:
        host = building[opening.host or ""]
        wall, points = _plan_of(host), _points_of(host)
    center, sides, lengths = plan
    first = int(lengths.argmax())
    told = [other for other in (leaf, wall) if other and other[2].max() > _PLATE * other[2].min()]
    if told:
        _, directions, sizes = told[0]
        first = int(np.abs(sides @ directions[sizes.argmax()]).argmax())
    elif isinstance(door, Door) and door.width:
        first = int(np.abs(lengths - door.width).argmin())
    along, across = sides[[first, 1 - first]]
    width, depth = lengths[[first, 1 - first]].tolist()
    if wall and points is not None:
        reach = (points - center) @ across
        back, front = max(-depth / 2, float(reach.min())), min(depth / 2, float(reach.max()))
        if front > back:
            center, depth = center + (back + front) / 2 * across, front - back
    return Doorway(center, along, across, width, depth, *bounds[:, 2].tolist())


def _points_of(product: Element | Opening) -> NDArray[np.float64]:
    """Return the corners of a product in plan view, (n, 2) metres."""
    return np.concatenate([np.empty((0, 2)), *(shape.world_vertices()[:, :2] for shape in product.shapes)])


def _plan_of(product: Element | Opening) -> Plan | None:
    """Return center, (2, 2) directions and (2,) lengths of the smallest rectangle around a product in plan view.

    A sheet on edge has the width of its millimetre.
    """
    points = _points_of(product)
    if not len(points):
        return None
    origin = points.mean(axis=0)
    rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shapely.multipoints(points - origin)))
    if len(rectangle) == 2:  # a line
        aside = (rectangle[1] - rectangle[0])[::-1] * (-1, 1)
        rectangle = np.array(
            [rectangle[0], rectangle[1], rectangle[1] + aside / max(np.hypot(*aside), _SLIVER) * _SHEET]
        )
    if len(rectangle) < 3:
        return None
    a, b, c = rectangle[:3]
    sides = np.array([a - b, c - b])
    lengths = np.hypot(*sides.T)
    if not (lengths > _SLIVER).all():
        return None
    return (a + c) / 2 + origin, sides / lengths[:, None], lengths


def measured(building: Building) -> tuple[Door, ...]:
    """Return the doors of a building with what geometry tells of them."""
    rooms = _Ground(building.spaces)
    slabs = _Ground([e for e in building.elements if e.ifc_class.startswith("IfcSlab") and e.predefined_type != "ROOF"])
    elevations = np.array([storey.elevation for storey in building.storeys])
    ways = [doorway_of(door, building) for door in building.doors]
    doors = [_measured(door, way, rooms, slabs, elevations) for door, way in zip(building.doors, ways, strict=True)]
    outer = {
        door.global_id: way.bottom
        for door, way in zip(doors, ways, strict=True)
        if way is not None and len(door.spaces) == 1 and rooms.is_open(way)
    }
    ground = min(outer.values(), default=0.0) + _FLIGHT
    return tuple(replace(door, to_outside=outer.get(door.global_id, math.inf) <= ground) for door in doors)


def _measured(door: Door, way: Doorway | None, rooms: _Ground, slabs: _Ground, elevations: NDArray[np.float64]) -> Door:
    if way is None:
        return replace(door, clear_width=door.width)
    beside: list[str] = []
    floors: list[float] = []
    for side in (-1, 1):
        room, floor = rooms.beside(way, side, lowest=True)
        beside += [room] if room else []
        if floor is None:
            floor = slabs.beside(way, side, lowest=False)[1]
        floors += [] if floor is None else [floor]
    if not floors:
        nearest = float(elevations[np.abs(elevations - way.bottom).argmin()])
        floors += [nearest] if abs(nearest - way.bottom) <= _BELOW else []
    sill = max((max(way.bottom - floor, 0.0) for floor in floors), default=None)
    return replace(door, clear_width=way.width, sill=sill, spaces=tuple(beside))


class _Ground:
    """Rooms or slabs, and what lies under a point beside a door."""

    def __init__(self, products: Sequence[Space | Element]) -> None:
        placed = [(product, bounds) for product in products if (bounds := product.bounds) is not None]
        self._products = [product for product, _ in placed]
        self._bounds = np.array([bounds for _, bounds in placed]).reshape(-1, 2, 3)

    def is_open(self, way: Doorway) -> bool:
        """Tell whether no room lies straight ahead at one side of a door, nor a few steps up or down from it."""
        low, high = self._bounds[:, 0], self._bounds[:, 1]
        near = np.flatnonzero((low[:, 2] <= way.bottom + _FLIGHT) & (high[:, 2] >= way.bottom - _FLIGHT)).tolist()
        for side in (-1, 1):
            points = [way.center + side * (way.depth / 2 + step) * way.across for step in (*_SIDESTEPS, *_BEYOND)]
            over = [k for k in near for p in points if (low[k, :2] <= p).all() and (p <= high[k, :2]).all()]
            if not any(
                _heights_at(s, p) for k in dict.fromkeys(over) for s in self._products[k].shapes for p in points
            ):
                return True
        return False

    def beside(self, way: Doorway, side: int, *, lowest: bool) -> tuple[str | None, float | None]:
        """Return what a door opens to at a side, and its floor: the lowest or the highest surface at that point.

        The floor is None where it lies farther below than a step, such as in a stairwell.
        """
        low, high = self._bounds[:, 0], self._bounds[:, 1]
        for sidestep in _SIDESTEPS:
            point = way.center + side * (way.depth / 2 + sidestep) * way.across
            reach = (low[:, 2] <= way.bottom + _ABOVE) & (high[:, 2] >= way.bottom - _BELOW)
            over = ((low[:, :2] <= point) & (point <= high[:, :2])).all(axis=1)
            found = []
            for k in np.flatnonzero(reach & over).tolist():
                heights = [z for shape in self._products[k].shapes for z in _heights_at(shape, point)]
                heights = [z for z in heights if z <= way.bottom + _ABOVE]
                if heights:
                    found.append((min(heights) if lowest else max(heights), self._products[k].global_id))
            if found:
                floor, global_id = max(found)
                return global_id, floor if way.bottom - floor <= _BELOW else None
        return None, None


def _heights_at(shape: Shape, point: NDArray[np.float64]) -> list[float]:
    """Return the heights at which a vertical line meets a shape, metres."""
    a, b, c = shape.world_vertices()[shape.mesh.faces].swapaxes(0, 1)
    u, v, w = b - a, c - a, point - a[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    level = np.abs(area) > _SLIVER
    area, u, v, w, a = area[level], u[level], v[level], w[level], a[level]
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / area
    t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / area
    inside = (s >= -_EDGE) & (t >= -_EDGE) & (s + t <= 1 + _EDGE)
    heights: list[float] = (a[:, 2] + s * u[:, 2] + t * v[:, 2])[inside].tolist()
    return heights
