"""Solids minus half-spaces, without a CAD kernel: the way exporters cut walls at roofs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.errors import GeometryError
from bimnav.footprint import subtract, whole
from bimnav.ifc._kernel import Entity, File, mesh_of, new_log, one_by_one

__all__ = ["Clipper"]

_UPRIGHT = 1e-6  # a plane this steep in its prism's frame cuts no cap
_SWELL = 1e-5  # metres
_SPIKE = 0.1  # a corner sharper than this is moved less than its sides
_BOX = np.array([(x, y, z) for z in (0.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])
_BOX_FACES = np.array(
    [
        *((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6)),  # below, above
        *((0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7)),  # front, back
        *((0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)),  # left, right
    ],
    dtype=np.int32,
)


class Clipper:
    """Evaluates differences of solids; all its meshes are in the coordinates of the items, in metres."""

    def __init__(self, file: File, settings: Any) -> None:
        self._file = file
        self._log = new_log()
        self._kernel = one_by_one(file, settings, self._log)

    def matrix(self, placement: Entity | None) -> NDArray[np.float64] | None:
        """Return a placement as a (4, 4) matrix; None if it cannot be had."""
        if placement is None:
            return np.eye(4)
        try:
            matrix = np.array(self._kernel.create_shape(placement).matrix).reshape(4, 4, order="F")
        except RuntimeError:
            return None
        return matrix if np.isfinite(matrix).all() else None

    def solid(self, item: Entity) -> Mesh | None:
        """Return the mesh of an item; None if it takes more than differences and half-spaces."""
        cutters = []
        while item.is_a("IfcBooleanResult"):
            if item.Operator != "DIFFERENCE":
                return None
            cutters.append(item.SecondOperand)
            item = item.FirstOperand
        host = self.plain(item)
        if host is None or not cutters:
            return host
        meshes = [self._cutter(cutter, host) for cutter in reversed(cutters)]
        if any(mesh is None for mesh in meshes):
            return None
        return subtract(host, [(mesh, np.eye(4)) for mesh in meshes if mesh is not None])

    def plain(self, item: Entity) -> Mesh | None:
        """Return the mesh of an item that is no difference; None if the fast kernel cannot make it."""
        try:
            mesh = mesh_of(self._kernel.create_shape(item))
        except (RuntimeError, GeometryError):
            mesh = None
        if self._log.log_messages():
            self._log.clear()
            return None
        return mesh and whole(mesh)

    def _cutter(self, item: Entity, host: Mesh) -> Mesh | None:
        if item.is_a("IfcHalfSpaceSolid"):
            if not item.BaseSurface.is_a("IfcPlane"):
                return None
            plane = self.matrix(item.BaseSurface.Position)
            if plane is None:
                return None
            if item.AgreementFlag:  # the normal points out of the material
                plane = plane @ np.diag((1.0, -1.0, -1.0, 1.0))
            if item.is_a("IfcPolygonalBoundedHalfSpace"):
                return self._prism(item, plane, host)
            return _half_space(plane, host)
        return self.solid(item)

    def _prism(self, item: Entity, plane: NDArray[np.float64], host: Mesh) -> Mesh | None:
        """Return the part of a polygonal half-space that can reach the host; z of `plane` points into it."""
        frame = self.matrix(item.Position)
        if frame is None or (prism := self.plain(self._extrusion(item.PolygonalBoundary))) is None:
            return None
        to_frame = np.linalg.inv(frame)
        normal = to_frame[:3, :3] @ plane[:3, 2]
        if abs(normal[2]) < _UPRIGHT:
            return None
        point = to_frame[:3, :3] @ plane[:3, 3] + to_frame[:3, 3]
        is_top = prism.vertices[:, 2] > prism.vertices[:, 2].mean()
        vertices = _swollen(prism, is_top)
        cut = point[2] - (vertices[:, :2] - point[:2]) @ normal[:2] / normal[2]
        reach = np.concatenate([cut, (host.vertices @ to_frame[:3, :3].T + to_frame[:3, 3])[:, 2]])
        far = reach.max() + 1.0 if normal[2] > 0 else reach.min() - 1.0
        vertices[:, 2] = np.where(is_top == (normal[2] > 0), far, cut)
        return Mesh(vertices @ frame[:3, :3].T + frame[:3, 3], prism.faces)

    def _extrusion(self, boundary: Entity) -> Entity:
        make = self._file.create_entity
        origin = make("IfcCartesianPoint", (0.0, 0.0, 0.0))
        return make(
            "IfcExtrudedAreaSolid",
            make("IfcArbitraryClosedProfileDef", "AREA", None, boundary),
            make("IfcAxis2Placement3D", origin, None, None),
            make("IfcDirection", (0.0, 0.0, 1.0)),
            100.0,  # any depth: the caps are moved
        )


def _swollen(prism: Mesh, is_top: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Move the sides of an upright prism outward, so that prisms that share a side leave no fin between them."""
    sides = prism.faces[is_top[prism.faces].any(axis=1) & ~is_top[prism.faces].all(axis=1)]
    corners = prism.vertices[sides]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, :2]
    normals /= np.maximum(np.hypot(*normals.T), np.finfo(float).tiny)[:, None]
    vertices = prism.vertices.copy()
    for corner in range(len(vertices)):
        beside = np.unique(np.round(normals[(sides == corner).any(axis=1)], 9), axis=0)
        if len(beside):
            bisector = beside.sum(axis=0)
            vertices[corner, :2] += _SWELL * len(beside) * bisector / max(bisector @ bisector, _SPIKE)
    return vertices


def _half_space(plane: NDArray[np.float64], host: Mesh) -> Mesh:
    """Return a box on a plane, on the side its z points to, that holds all of the host on that side."""
    local = (host.vertices - plane[:3, 3]) @ plane[:3, :3]
    low, high = local.min(axis=0), local.max(axis=0)
    middle = np.append((low[:2] + high[:2]) / 2, 0.0)
    size = np.append((high[:2] - low[:2]) / 2 + 1.0, max(high[2], 0.0) + 1.0)
    return Mesh((_BOX * size + middle) @ plane[:3, :3].T + plane[:3, 3], _BOX_FACES)
