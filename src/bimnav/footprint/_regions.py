"""Polygons of the plane: united, mended, and freed of what rounding leaves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import manifold3d
import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav._footprint_kernels import turns_back

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["has_fins", "polygon_of", "region_of", "unite", "valid", "widened", "without_fins"]

_ROUNDING = 1e-8  # metres to which manifold3d rounds in the plane
_MILLIMETRE = 1e-3  # the width of what has none
_COVERED = 1e-6  # metres; a line this close to a polygon is part of it
_FIN, _FIN_LENGTH, _FIN_AREA = 5e-5, 1e-3, 5e-7  # half the width, length and area of what booleans leave behind


def unite(polygons: Iterable[BaseGeometry]) -> BaseGeometry:
    """Unite polygons, which may overlap or touch, without losing any.

    Parameters
    ----------
    polygons
        Polygons and MultiPolygons anywhere in the world, metres. What is not a polygon is left out.

    Returns
    -------
    polygon
        Polygon or MultiPolygon, corners rounded to a hundredth of a micrometre; empty if all are.
    """
    parts = shapely.get_parts(shapely.get_parts(np.array(list(polygons), dtype=object)))
    parts = shapely.normalize(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])
    if not len(parts):
        return shapely.Polygon()
    left, bottom, right, top = shapely.total_bounds(parts)
    origin = np.array([left + right, bottom + top]) / 2
    rings = [shapely.get_coordinates(ring)[:-1] - origin for ring in shapely.get_rings(parts)]
    return valid(shapely.transform(polygon_of(region_of(rings)), lambda points: points + origin))


def region_of(rings: Sequence[NDArray[np.float64]]) -> manifold3d.CrossSection:
    """Return all that rings go round, either way round."""
    return manifold3d.CrossSection(rings, manifold3d.FillRule.NonZero)


def polygon_of(region: manifold3d.CrossSection) -> BaseGeometry:
    """Return a region as Polygon or MultiPolygon, which may touch itself."""
    region = region.simplify(_ROUNDING)
    parts = [region] if region.num_contour() < 2 else region.decompose()
    contours = [rings for part in parts if (rings := part.to_polygons())]
    polygons = [shapely.Polygon(shell, holes) for shell, *holes in contours]
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)


def valid(polygon: BaseGeometry) -> BaseGeometry:
    """Mend a polygon that touches itself, as rounding may leave it."""
    if shapely.is_valid(polygon):
        return polygon
    pieces = shapely.get_parts(shapely.make_valid(shapely.get_parts(polygon)))
    pieces = shapely.get_parts(pieces)  # collections inside collections
    pieces = pieces[shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON]
    finest = float(np.abs(polygon.bounds).max()) * 1e-15
    return shapely.union_all(pieces, grid_size=max(_ROUNDING / 10, finest))


def widened(lines: NDArray[np.float64], polygon: BaseGeometry) -> NDArray[np.float64]:
    """Give the lines that a polygon does not cover a width: (n, 2, 2) to (k, 4, 2) corners."""
    covered = polygon.buffer(_COVERED)
    shapely.prepare(covered)
    start, end = lines[~shapely.covers(covered, shapely.linestrings(lines))].swapaxes(0, 1)
    along = end - start
    length = np.hypot(along[:, :1], along[:, 1:])
    along = np.where(length > 0, along / np.where(length > 0, length, 1), [1.0, 0.0]) * _MILLIMETRE / 2
    aside = along[:, ::-1] * [-1, 1]
    return np.stack([start - along - aside, end + along - aside, end + along + aside, start - along + aside], axis=1)


def has_fins(region: manifold3d.CrossSection) -> bool:
    """Tell whether a ring turns back beside itself, as fins do."""
    return any(turns_back(ring, 2 * _FIN) for ring in region.to_polygons())


def without_fins(polygon: BaseGeometry) -> BaseGeometry:
    """Take off what sticks out far and holds next to no area; corners stay as they are."""
    opened = polygon.buffer(-_FIN, join_style="mitre", mitre_limit=1000)
    opened = opened.buffer(_FIN, join_style="mitre", mitre_limit=1000).intersection(polygon)
    if opened.is_empty or polygon.area - opened.area > _FIN_AREA:
        return polygon
    return opened if shapely.hausdorff_distance(polygon, opened) > _FIN_LENGTH else polygon
