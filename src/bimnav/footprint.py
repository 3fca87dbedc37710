"""Solids made whole, and what they cover of the floor in a height band.

The only module that imports manifold3d. Meshes and shapes come in; meshes and polygons go out.

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

import manifold3d
import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from bimnav._footprint_kernels import COVER, HIGH, LOW, join, orient, trace, turns_back
from bimnav.building import Mesh, Shape
from bimnav.errors import ValueRangeError

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
_INFLATION = 2e-7  # metres; where faces of host and opening are flush, a skin would stay
_WELDS = (1e-6, 1e-5)  # metres within which corners are taken for one
_TILT = 1e-12  # radians that move no point of any model
_ROUNDING = 1e-8  # metres to which manifold3d rounds in the plane
_MILLIMETRE = 1e-3  # the width of what has none
_THIN, _ANY_WIDTH = 2e-6, 1e9  # metres of plan view below which a face is a line
_COVERED = 1e-6  # metres; a line this close to a polygon is part of it
_SPECK = 1e-9  # square metres below which there is no area
_FIN, _FIN_LENGTH, _FIN_AREA = 5e-5, 1e-3, 5e-7  # half the width, length and area of what booleans leave behind
_QUALITIES = ("exact", "repaired", "surface", "hull")  # from best to worst


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


class _Fabric(NamedTuple):
    """A mesh whose faces know their neighbours; all closed parts face outward."""

    points: NDArray[np.float64]  # the vertices as given
    vertices: NDArray[np.float64]  # the vertices relative to `origin`
    origin: NDArray[np.float64]  # the middle of their box
    faces: NDArray[np.int32]
    edges: NDArray[np.int32]
    edge_of: NDArray[np.int32]
    is_sheet: NDArray[np.bool_]
    is_closed: bool
    quality: str


def _woven(mesh: Mesh) -> _Fabric:
    """Weave a mesh as it is, else with its corners welded."""
    quality = "exact" if mesh.quality == "surface" else mesh.quality
    fabric = _weave(mesh.vertices, _proper(mesh.faces), quality)
    if fabric.is_closed and (len(fabric.faces) or not len(mesh.faces)):
        return fabric
    for tolerance in _WELDS:
        grid = np.round(fabric.vertices / tolerance).astype(np.int64)
        _, first, same = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        points, welded = mesh.vertices[first], same.reshape(-1).astype(np.int32)[mesh.faces]
        repaired = _weave(points, _proper(welded), _worst(("repaired", quality)))
        if repaired.is_closed and len(repaired.faces):
            return repaired
    return _weave(points, welded, "surface")  # with the faces that are no more than lines


def _proper(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Leave out faces that use a corner twice; their sides cancel, so that nothing opens."""
    a, b, c = faces.T
    proper: NDArray[np.int32] = faces[(a != b) & (b != c) & (c != a)]
    return proper


def _weave(points: NDArray[np.float64], faces: NDArray[np.int32], quality: str) -> _Fabric:
    origin = (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else np.zeros(3)
    vertices = points - origin
    edges, edge_of, order, begins = join(faces, len(vertices))
    inward, is_open, is_sheet = orient(vertices, faces, order, begins)
    if inward.any():
        faces, edge_of = faces.copy(), edge_of.copy()
        faces[inward] = faces[inward][:, ::-1]
        edge_of[inward] = edge_of[inward][:, [1, 0, 2]]
    return _Fabric(points, vertices, origin, faces, edges, edge_of, is_sheet, not is_open.any(), quality)


def _worst(qualities: Iterable[str]) -> str:
    return max(qualities, key=_QUALITIES.index)


def whole(mesh: Mesh) -> Mesh:
    """Close a mesh if welding closes it, and turn all its faces outward.

    Connected parts are oriented one by one, so inside-out solids and mixed ones come out right; the
    inside of a cavity becomes solid. Faces that use a corner twice are left out.

    Parameters
    ----------
    mesh
        Any triangles; `hull` stays the label of a hull.

    Returns
    -------
    mesh
        With quality `exact` if it was closed as given, `repaired` if welding closed it, `surface` if it
        stays open. The mesh itself if there is nothing to do.
    """
    fabric = _woven(mesh)
    if fabric.quality == mesh.quality and np.array_equal(fabric.faces, mesh.faces):
        return mesh
    return Mesh(fabric.points, fabric.faces, fabric.quality)


def subtract(host: Mesh, cutters: Sequence[tuple[Mesh, NDArray[np.float64]]]) -> Mesh | None:
    """Cut openings out of a host.

    Parameters
    ----------
    host
        A solid.
    cutters
        Each with its (4, 4) placement in the coordinates of the host. They are made a fifth
        of a micrometre larger on every side, so that no skin stays where faces are flush. One that lies beside
        the host is skipped.

    Returns
    -------
    mesh
        What is left, in the coordinates of the host, without faces if nothing is; None if the host or
        a cutter is open, or the cut failed: use another kernel.
    """
    fabric = _woven(host)
    bounds = np.array([fabric.vertices.min(axis=0), fabric.vertices.max(axis=0)]) if len(fabric.faces) else None
    tools = []
    for mesh, placement in cutters:
        if bounds is None or not len(mesh.faces):
            continue
        linear, shift = placement[:3, :3], placement[:3, 3] - fabric.origin
        tool = _woven(mesh)
        half = np.abs(tool.vertices).max(axis=0)
        grown = tool.vertices * (1 + _INFLATION / np.maximum(half, _INFLATION))
        vertices = grown @ linear.T + (linear @ tool.origin + shift)
        if (vertices.max(axis=0) < bounds[0]).any() or (vertices.min(axis=0) > bounds[1]).any():
            continue
        if np.linalg.det(linear) < 0:
            tool = tool._replace(faces=tool.faces[:, ::-1])
        tools.append(tool._replace(vertices=vertices))
    if not fabric.is_closed or not all(tool.is_closed for tool in tools):
        return None
    if not tools:
        return whole(host)
    solids = [_solid(part) for part in (fabric, *tools)]
    cut = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Subtract)
    if any(part.status() != manifold3d.Error.NoError for part in (*solids, cut)):
        return None
    result = cut.to_mesh64()
    quality = _worst([fabric.quality, *(tool.quality for tool in tools)])
    return Mesh(result.vert_properties[:, :3] + fabric.origin, result.tri_verts.astype(np.int32), quality)


def _solid(fabric: _Fabric) -> manifold3d.Manifold:
    """Hand a closed fabric to manifold3d, which may crash on an open one and takes no read-only array."""
    vertices, faces = np.array(fabric.vertices), np.array(fabric.faces, dtype=np.uint64)
    return manifold3d.Manifold(manifold3d.Mesh64(vertices, faces))


def triangulate(rings: Sequence[NDArray[np.float64]]) -> NDArray[np.int64]:
    """Divide a polygon into triangles whose corners are those of its rings.

    Parameters
    ----------
    rings
        Each (n, 2), open; the outer one runs counter-clockwise, holes run clockwise. Rings that cross
        themselves are divided all the same; then triangles overlap.

    Returns
    -------
    triangles : (m, 3) int64, indexes into the corners of all rings one after the other
    """
    triangles: NDArray[np.int64] = manifold3d.triangulate([np.ascontiguousarray(ring) for ring in rings])
    return triangles.reshape(-1, 3).astype(np.int64)


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
    return found or Footprint(shapely.Polygon(), np.nan, np.nan, _woven(shape.mesh).quality)


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
    fabrics = {id(mesh): _woven(mesh) for mesh in {id(shapes[i].mesh): shapes[i].mesh for i in near}.values()}
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


def _frames_of(shapes: Sequence[Shape], fabrics: Sequence[_Fabric]) -> _Frames:
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


def _cover(fabric: _Fabric, low: float, high: float) -> _Cover | None:
    net, is_sheet = (fabric.vertices, fabric.faces, fabric.edges, fabric.edge_of), fabric.is_sheet
    points, begins, bounds, lines, lowest, highest = trace(*net, is_sheet, low, high, _THIN)
    if lowest > highest:
        return None
    region = manifold3d.CrossSection()
    outlines = list(zip(pairwise(begins.tolist()), bounds.tolist(), strict=True))
    for kind in (LOW, HIGH, COVER):
        if rings := [points[first:last] for (first, last), bound in outlines if bound == kind]:
            region += _region_of(rings)
    if region.area() < _SPECK:
        lines = trace(*net, np.ones_like(is_sheet), low, high, _ANY_WIDTH)[3]
    polygon = _polygon_of(region)
    if len(lines) and len(bare := _bare(lines, _valid(polygon))):
        polygon = _polygon_of(region + _region_of(list(bare)))
    elif not is_sheet.any() and any(turns_back(ring, 2 * _FIN) for ring in region.to_polygons()):
        polygon = _without_fins(_valid(polygon))
    return _Cover(polygon, lowest, highest)


def _region_of(rings: Sequence[NDArray[np.float64]]) -> manifold3d.CrossSection:
    """Return all that rings go round, either way round."""
    return manifold3d.CrossSection(rings, manifold3d.FillRule.NonZero)


def _polygon_of(region: manifold3d.CrossSection) -> BaseGeometry:
    """Return a region as Polygon or MultiPolygon, which may touch itself."""
    region = region.simplify(_ROUNDING)
    parts = [region] if region.num_contour() < 2 else region.decompose()
    contours = [rings for part in parts if (rings := part.to_polygons())]
    polygons = [shapely.Polygon(shell, holes) for shell, *holes in contours]
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)


def _valid(polygon: BaseGeometry) -> BaseGeometry:
    """Mend a polygon that touches itself, as rounding may leave it."""
    if shapely.is_valid(polygon):
        return polygon
    pieces = shapely.get_parts(shapely.make_valid(shapely.get_parts(polygon)))
    pieces = shapely.get_parts(pieces)  # collections inside collections
    pieces = pieces[shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON]
    finest = float(np.abs(polygon.bounds).max()) * 1e-15
    return shapely.union_all(pieces, grid_size=max(_ROUNDING / 10, finest))


def _bare(lines: NDArray[np.float64], polygon: BaseGeometry) -> NDArray[np.float64]:
    """Give the lines that a polygon does not cover a width: (n, 2, 2) to (k, 4, 2) corners."""
    covered = polygon.buffer(_COVERED)
    shapely.prepare(covered)
    start, end = lines[~shapely.covers(covered, shapely.linestrings(lines))].swapaxes(0, 1)
    along = end - start
    length = np.hypot(along[:, :1], along[:, 1:])
    along = np.where(length > 0, along / np.where(length > 0, length, 1), [1.0, 0.0]) * _MILLIMETRE / 2
    aside = along[:, ::-1] * [-1, 1]
    return np.stack([start - along - aside, end + along - aside, end + along + aside, start - along + aside], axis=1)


def _without_fins(polygon: BaseGeometry) -> BaseGeometry:
    """Take off what sticks out far and holds next to no area; corners stay as they are."""
    opened = polygon.buffer(-_FIN, join_style="mitre", mitre_limit=1000)
    opened = opened.buffer(_FIN, join_style="mitre", mitre_limit=1000).intersection(polygon)
    if opened.is_empty or polygon.area - opened.area > _FIN_AREA:
        return polygon
    return opened if shapely.hausdorff_distance(polygon, opened) > _FIN_LENGTH else polygon


def _placed(
    polygons: Sequence[BaseGeometry], plan: NDArray[np.float64], shift: NDArray[np.float64]
) -> list[BaseGeometry]:
    """Put n polygons in their places, (n, 2, 2) and (n, 2), and make them valid."""
    placed = np.array(polygons, dtype=object)
    points, owner = shapely.get_coordinates(placed, return_index=True)
    shapely.set_coordinates(placed, np.einsum("nij,nj->ni", plan[owner], points) + shift[owner])
    for n in np.flatnonzero(~shapely.is_valid(placed)):
        placed[n] = _valid(placed[n])
    return list(placed)


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
    return _valid(shapely.transform(_polygon_of(_region_of(rings)), lambda points: points + origin))


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
        _worst([footprint.quality for footprint in footprints] or ["exact"]),
    )
