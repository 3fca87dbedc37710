"""Solids made whole: orientation, welding, openings cut out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import manifold3d
import numpy as np
from numpy.typing import NDArray

from bimnav._footprint_kernels import join, orient
from bimnav.building import Mesh

__all__ = ["Fabric", "subtract", "triangulate", "whole", "worst", "woven_of"]

_INFLATION = 2e-7  # metres; where faces of host and opening are flush, a skin would stay
_WELDS = (1e-6, 1e-5)  # metres within which corners are taken for one
_QUALITIES = ("exact", "repaired", "surface", "hull")  # from best to worst


class Fabric(NamedTuple):
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


def woven_of(mesh: Mesh) -> Fabric:
    """Weave a mesh as it is, else with its corners welded."""
    quality = "exact" if mesh.quality == "surface" else mesh.quality
    fabric = _weave(mesh.vertices, _proper(mesh.faces), quality)
    if fabric.is_closed and (len(fabric.faces) or not len(mesh.faces)):
        return fabric
    for tolerance in _WELDS:
        grid = np.round(fabric.vertices / tolerance).astype(np.int64)
        _, first, same = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        points, welded = mesh.vertices[first], same.reshape(-1).astype(np.int32)[mesh.faces]
        repaired = _weave(points, _proper(welded), worst(("repaired", quality)))
        if repaired.is_closed and len(repaired.faces):
            return repaired
    return _weave(points, welded, "surface")  # with the faces that are no more than lines


def _proper(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Leave out faces that use a corner twice; their sides cancel, so that nothing opens."""
    a, b, c = faces.T
    proper: NDArray[np.int32] = faces[(a != b) & (b != c) & (c != a)]
    return proper


def _weave(points: NDArray[np.float64], faces: NDArray[np.int32], quality: str) -> Fabric:
    origin = (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else np.zeros(3)
    vertices = points - origin
    edges, edge_of, order, begins = join(faces, len(vertices))
    inward, is_open, is_sheet = orient(vertices, faces, order, begins)
    if inward.any():
        faces, edge_of = faces.copy(), edge_of.copy()
        faces[inward] = faces[inward][:, ::-1]
        edge_of[inward] = edge_of[inward][:, [1, 0, 2]]
    return Fabric(points, vertices, origin, faces, edges, edge_of, is_sheet, not is_open.any(), quality)


def worst(qualities: Iterable[str]) -> str:
    """Return the worst of some qualities."""
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
    fabric = woven_of(mesh)
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
    fabric = woven_of(host)
    bounds = np.array([fabric.vertices.min(axis=0), fabric.vertices.max(axis=0)]) if len(fabric.faces) else None
    tools = []
    for mesh, placement in cutters:
        if bounds is None or not len(mesh.faces):
            continue
        linear, shift = placement[:3, :3], placement[:3, 3] - fabric.origin
        tool = woven_of(mesh)
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
    quality = worst([fabric.quality, *(tool.quality for tool in tools)])
    return Mesh(result.vert_properties[:, :3] + fabric.origin, result.tri_verts.astype(np.int32), quality)


def _solid(fabric: Fabric) -> manifold3d.Manifold:
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
