"""How far a product reaches at most, by the numbers in the file alone: for products whose geometry was lost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from ifcopenshell.util.placement import get_axis2placement, get_local_placement, get_mappeditem_transformation
from numpy.typing import NDArray

__all__ = ["extent_of"]

_DEEPEST = 50
_MOST = 10_000  # items, counted as often as they are used: a tree of unions of itself has a million
_FARTHEST = 1e8  # metres; what claims to reach farther says nothing
_BROKEN = (AssertionError, AttributeError, IndexError, RecursionError, RuntimeError, TypeError, ValueError)

Points = NDArray[np.float64]


def extent_of(product: Any, unit_scale: float) -> list[list[float]] | None:
    """Return lowest and highest world coordinates, (2, 3) metres, that hold a product; None if nothing says so.

    The box may be larger than the product: curves count with their control points, revolved solids with
    the ball they turn in, and nothing is cut off.
    """
    try:
        world = get_local_placement(product.ObjectPlacement)
        items = [item for shape in product.Representation.Representations for item in shape.Items]
        budget = iter(range(_MOST))
        clouds = [cloud for item in items for cloud in _clouds(item, world, 0, budget)]
    except _BROKEN:
        return None
    if not clouds:
        return None
    points = np.concatenate(clouds) * unit_scale
    if not np.isfinite(points).all() or np.abs(points).max() > _FARTHEST:
        return None
    return [points.min(axis=0).tolist(), points.max(axis=0).tolist()]


def _clouds(item: Any, world: Points, depth: int, budget: Iterator[int]) -> Iterator[Points]:
    """Yield points, in world coordinates and file units, whose box holds an item."""
    if depth > _DEEPEST or next(budget, None) is None:
        raise RecursionError
    if item.is_a("IfcBooleanResult"):
        yield from _clouds(item.FirstOperand, world, depth + 1, budget)
        if item.Operator != "DIFFERENCE":
            yield from _clouds(item.SecondOperand, world, depth + 1, budget)
    elif item.is_a("IfcMappedItem"):
        moved = world @ get_mappeditem_transformation(item)
        for part in item.MappingSource.MappedRepresentation.Items:
            yield from _clouds(part, moved, depth + 1, budget)
    elif item.is_a("IfcSweptAreaSolid"):
        placed = world @ _frame(item.Position) if item.Position else world
        yield _moved(_swept(item), placed)
    else:
        points = _points_in(item)
        if len(points):
            thickness = getattr(item, "Radius", None) or 0.0  # of a disk swept along a line
            yield _moved(np.concatenate([points - thickness, points + thickness]), world)


def _frame(position: Any) -> Points:
    """Return a placement as a matrix with right angles, also where the file's directions have none."""
    matrix: Points = get_axis2placement(position)
    z = matrix[:3, 2]
    x = matrix[:3, 0] - (matrix[:3, 0] @ z) * z
    matrix[:3, 0] = x / np.linalg.norm(x)
    matrix[:3, 1] = np.cross(z, matrix[:3, 0])
    return matrix


def _swept(solid: Any) -> Points:
    """Return points whose box holds a swept solid, in the solid's own coordinates."""
    profile = _profile(solid.SweptArea)
    if solid.is_a("IfcExtrudedAreaSolid"):
        along = np.array(solid.ExtrudedDirection.DirectionRatios) * solid.Depth
        return np.concatenate([_corners(profile), _corners(profile) + along])
    axis = float(np.abs(_points_in(solid)).max(initial=0.0))
    return _cube(2 * (float(np.linalg.norm(profile, axis=1).max()) + axis))


def _profile(area: Any) -> Points:
    if not area.is_a("IfcParameterizedProfileDef"):
        return _points_in(area)
    sizes = area.get_info().items()  # a radius counts from the middle, a width from side to side
    reach = max(v if "Radius" in k or "SemiAxis" in k else v / 2 for k, v in sizes if isinstance(v, float))
    square = _cube(reach * 2**0.5) * (1, 1, 0)  # at any angle
    return square if area.Position is None else square + np.append(area.Position.Location.Coordinates, 0.0)


def _cube(reach: float) -> Points:
    return np.array([[-reach] * 3, [reach] * 3])


def _corners(points: Points) -> Points:
    """Return the eight corners of the box of points, so that a rotation of them holds the points."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def _moved(points: Points, matrix: Points) -> Points:
    corners = _corners(points)
    moved: Points = corners @ matrix[:3, :3].T + matrix[:3, 3]
    return moved


def _points_in(item: Any) -> Points:
    """Return all points an item refers to and the ends of its circles, (n, 3); a third coordinate is 0."""
    found: list[tuple[float, ...]] = []
    bulge = 0.0
    for part in item.file.traverse(item):
        if part.is_a("IfcCartesianPoint"):
            found.append(part.Coordinates)
        elif part.is_a("IfcCartesianPointList"):
            found.extend(part.CoordList)
        elif part.is_a("IfcConic"):
            bulge = max(
                bulge, getattr(part, "Radius", 0.0), getattr(part, "SemiAxis1", 0.0), getattr(part, "SemiAxis2", 0.0)
            )
        elif part.is_a("IfcArcIndex"):
            bulge = max(bulge, _half_diagonal(found))
    points = np.array([(*point, 0.0, 0.0)[:3] for point in found], dtype=np.float64).reshape(-1, 3)
    flat = np.array([bulge, bulge, bulge if np.any(points[:, 2:]) else 0.0])
    return np.concatenate([points - flat, points + flat])


def _half_diagonal(points: list[tuple[float, ...]]) -> float:
    array = np.array([(*point, 0.0)[:3] for point in points])
    return float(np.linalg.norm(np.ptp(array, axis=0))) / 2 if len(array) else 0.0
