"""Solids made whole, and what they cover of the floor in a height band.

The only package that imports manifold3d. Meshes and shapes come in; meshes and polygons go out.

A footprint is found without cutting the solid. On every vertical line that meets the solid inside the
band, the lowest point lies on the band's lower plane or on a face that looks down; so the section at the
lower plane and the plan view of the faces that look down cover all of it. The section at the upper
plane is added for solids that intersect themselves, where a line may enter through a face that looks up.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from bimnav._footprint_kernels import COVER, HIGH, LOW, trace
from bimnav.building import Shape
from bimnav.errors import ValueRangeError
from bimnav.footprint._regions import has_fins, polygon_of, region_of, unite, valid, widened, without_fins
from bimnav.footprint._solids import Fabric, subtract, triangulate, whole, worst, woven_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = [
    "Footprint",
    "footprint",
    "footprints_of",
    "merge_footprints",
    "outline",
    "project",
    "subtract",
    "triangulate",
    "unite",
    "whole",
]

_TOUCH = 1e-4  # metres taken off both ends of a band: touching is not overlap
_SLACK = 1e-8  # metres within which a height is the end of the band
_TILT = 1e-12  # radians that move no point of any model
_THIN, _ANY_WIDTH = 2e-6, 1e9  # metres of plan view below which a face is a line
_SPECK = 1e-9  # square metres below which there is no area


@dataclass(frozen=True, slots=True, eq=False)
class Footprint:
    """What a shape covers of the floor plane.

    Parameters
    ----------
    polygon
        Polygon or MultiPolygon in world coordinates, metres. Empty outside the band, never inside.
    low, high
        World heights of the part that lies in the band, metres; nan where the polygon is empty.
    quality
        `exact`, `repaired`, `surface` or `hull`, as for a mesh.
    """

    polygon: BaseGeometry
    low: float
    high: float
    quality: str


def footprint(shape: Shape, low: float, high: float) -> Footprint:
    """Find what a shape covers of the floor between two world heights.

    The band is a tenth of a millimetre smaller at either end, so that a shape that touches it is outside.
    Exact for closed meshes. Of open ones all faces count and so does every section that closes; what has
    no area, a sheet on edge or a line, is given a millimetre, so that nothing vanishes.

    Parameters
    ----------
    shape
        A mesh in its place.
    low, high
        World heights in metres; may be infinite.

    Returns
    -------
    footprint
        With an empty polygon if the shape lies outside the band.

    Raises
    ------
    ValueRangeError
        If `low` is not below `high`.
    """
    (found,) = footprints_of([shape], low, high)
    return found or Footprint(shapely.Polygon(), np.nan, np.nan, woven_of(shape.mesh).quality)


def project(shape: Shape) -> Footprint:
    """Project a whole shape on the floor plane, whatever its height."""
    return footprint(shape, -np.inf, np.inf)


def footprints_of(shapes: Sequence[Shape], low: ArrayLike, high: ArrayLike) -> list[Footprint | None]:
    """Find the footprints of many shapes; a mesh that is repeated at one height is worked on once.

    Parameters
    ----------
    shapes
        n meshes in their places.
    low, high : float or (n,) float64
        World heights in metres, the same for all or one for each shape.

    Returns
    -------
    footprints
        One for each shape as from `footprint`; None for a shape outside its band.

    Raises
    ------
    ValueRangeError
        If a `low` is not below its `high`.
    """
    asked = np.empty((len(shapes), 2))
    asked[:, 0], asked[:, 1] = low, high
    if not (asked[:, 0] < asked[:, 1]).all():
        raise ValueRangeError("a height band is empty or not a number.", "Give a low below a high, in metres.")
    touch = np.minimum(_TOUCH, (asked[:, 1] - asked[:, 0]) / 4)
    bands = asked + np.stack([touch, -touch], axis=1)
    extents = np.array([shape.bounds[:, 2] for shape in shapes]).reshape(-1, 2)
    near = np.flatnonzero((extents[:, 1] > bands[:, 0]) & (extents[:, 0] <= bands[:, 1])).tolist()
    fabrics = {id(mesh): woven_of(mesh) for mesh in {id(shapes[i].mesh): shapes[i].mesh for i in near}.values()}
    woven = [fabrics[id(shapes[i].mesh)] for i in near]
    frames = _frames_of([shapes[i] for i in near], woven)
    local = np.sort(np.round((bands[near] - frames.shift[:, 2:]) / frames.scale, 9), axis=1)

    covers: dict[tuple[object, ...], _Cover | None] = {}
    tasks = []
    for fabric, turn, upright, (bottom, top) in zip(woven, frames.turn, frames.is_upright, local.tolist(), strict=True):
        tasks.append((id(fabric), bottom, top, turn.tobytes()))
        if tasks[-1] not in covers:
            turned = fabric if upright else fabric._replace(vertices=fabric.vertices @ turn.T)
            covers[tasks[-1]] = _cover(turned, bottom, top)
    inside = [(n, cover) for n, task in enumerate(tasks) if (cover := covers[task]) is not None]
    which, chosen = [n for n, _ in inside], [near[n] for n, _ in inside]
    heights = np.array([(cover.low, cover.high) for _, cover in inside]).reshape(-1, 2)
    heights = np.sort(heights * frames.scale[which] + frames.shift[which, 2:], axis=1)
    heights = np.where(np.abs(heights - bands[chosen]) <= _SLACK, asked[chosen], heights)
    polygons = _placed([cover.polygon for _, cover in inside], frames.plan[which], frames.shift[which, :2])
    found: list[Footprint | None] = [None] * len(shapes)
    for i, n, polygon, (bottom, top) in zip(chosen, which, polygons, heights.tolist(), strict=True):
        found[i] = Footprint(polygon, bottom, top, woven[n].quality)
    return found


class _Frames(NamedTuple):
    """How n fabrics lie in the world: turned, cut, then laid out in plan view."""

    is_upright: NDArray[np.bool_]  # (n,) no turn is needed, so that all copies are cut alike
    turn: NDArray[np.float64]  # (n, 3, 3)
    plan: NDArray[np.float64]  # (n, 2, 2)
    scale: NDArray[np.float64]  # (n, 1) of heights
    shift: NDArray[np.float64]  # (n, 3) world point of the origin


def _frames_of(shapes: Sequence[Shape], fabrics: Sequence[Fabric]) -> _Frames:
    placements = np.array([shape.placement for shape in shapes]).reshape(-1, 4, 4)
    origins = np.array([fabric.origin for fabric in fabrics]).reshape(-1, 3)
    linear = placements[:, :3, :3]
    tilt = np.abs(np.concatenate([linear[:, 2, :2], linear[:, :2, 2]], axis=1)).max(axis=1)
    upright = (tilt <= _TILT) & (np.abs(linear[:, 2, 2]) > _TILT)
    return _Frames(
        upright,
        np.where(upright[:, None, None], np.eye(3), linear),
        np.where(upright[:, None, None], linear[:, :2, :2], np.eye(2)),
        np.where(upright, linear[:, 2, 2], 1.0)[:, None],
        placements[:, :3, 3] + np.einsum("nij,nj->ni", linear, origins),
    )


class _Cover(NamedTuple):
    """The part of a fabric in a band: its plan view, and the heights between which it lies."""

    polygon: BaseGeometry
    low: float
    high: float


def _cover(fabric: Fabric, low: float, high: float) -> _Cover | None:
    """Cut a fabric between two heights of its own frame; None if nothing of it lies there."""
    net, is_sheet = (fabric.vertices, fabric.faces, fabric.edges, fabric.edge_of), fabric.is_sheet
    points, begins, bounds, lines, lowest, highest = trace(*net, is_sheet, low, high, _THIN)
    if lowest > highest:
        return None
    region = region_of([])
    outlines = list(zip(pairwise(begins.tolist()), bounds.tolist(), strict=True))
    for kind in (LOW, HIGH, COVER):
        if rings := [points[first:last] for (first, last), bound in outlines if bound == kind]:
            region += region_of(rings)
    if region.area() < _SPECK:
        lines = trace(*net, np.ones_like(is_sheet), low, high, _ANY_WIDTH)[3]
    polygon = polygon_of(region)
    if len(lines) and len(bare := widened(lines, valid(polygon))):
        polygon = polygon_of(region + region_of(list(bare)))
    elif not is_sheet.any() and has_fins(region):
        polygon = without_fins(valid(polygon))
    return _Cover(polygon, lowest, highest)


def _placed(
    polygons: Sequence[BaseGeometry], plan: NDArray[np.float64], shift: NDArray[np.float64]
) -> list[BaseGeometry]:
    """Put n polygons in their places, (n, 2, 2) and (n, 2), and make them valid."""
    placed = np.array(polygons, dtype=object)
    points, owner = shapely.get_coordinates(placed, return_index=True)
    shapely.set_coordinates(placed, np.einsum("nij,nj->ni", plan[owner], points) + shift[owner])
    for n in np.flatnonzero(~shapely.is_valid(placed)):
        placed[n] = valid(placed[n])
    return list(placed)


def outline(shapes: Iterable[Shape]) -> BaseGeometry:
    """Return the plan view of shapes over their whole height, Polygon or MultiPolygon in world metres."""
    return unite(project(shape).polygon for shape in shapes)


def merge_footprints(footprints: Sequence[Footprint]) -> Footprint:
    """Unite the footprints of the shapes of one element.

    Parameters
    ----------
    footprints
        Any number; one with an empty polygon adds nothing but its quality.

    Returns
    -------
    footprint
        From the lowest to the highest point, with the worst quality; empty if all are.
    """
    if len(footprints) == 1:
        return footprints[0]
    solid = [footprint for footprint in footprints if not footprint.polygon.is_empty]
    return Footprint(
        unite(footprint.polygon for footprint in solid),
        min((footprint.low for footprint in solid), default=np.nan),
        max((footprint.high for footprint in solid), default=np.nan),
        worst([footprint.quality for footprint in footprints] or ["exact"]),
    )
