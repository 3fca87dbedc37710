"""Lines of sight in space: what stands between two points, against the meshes of walls, slabs and big things."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numba
import numpy as np
from numpy.typing import NDArray

from bimnav.building import Building, Element, Shape

__all__ = ["LIFTED", "UNDER", "Scene", "Sight", "points_on", "sight_of"]

UNDER = 0.6
"""Metres; so deep one reaches under a floor: into raised floors and pits."""
LIFTED = 0.1
"""Metres; floor panels and finishes thinner than this are lifted to reach below them."""


_BIG = 0.6  # metres; what has two sides this long hides things, and what is thinner one looks past
_WALLS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcWindow", "IfcSlab", "IfcRoof", "IfcColumn")  # of any size
_SKIN = 0.005  # metres; a line ends this far before its point, which may lie on a surface
_SAME = 1e-6  # metres
_ON = 0.2 * math.pi  # half of the solid angle a surface fills: 2 pi inside, pi on a face, pi / 4 on a corner
_MOST_POINTS = 600  # of a shape, from which a few are chosen
_SEE_THROUGH = frozenset(["IfcSite", "IfcVirtualElement", "IfcAnnotation"])

_known: WeakKeyDictionary[Building, Sight] = WeakKeyDictionary()


def sight_of(building: Building) -> Sight:
    """Return what hides what in a building; it is worked out once."""
    if building not in _known:
        _known[building] = Sight(building.elements)
    return _known[building]


class Sight:
    """The things of a building that one cannot look or reach through: walls, slabs, cupboards, closed doors.

    Parameters
    ----------
    elements
        All of the building.
    """

    def __init__(self, elements: Iterable[Element]) -> None:
        self._elements: list[Element] = []
        boxes = []
        for element in elements:
            box = None if element.ifc_class in _SEE_THROUGH else element.bounds
            is_wall = element.ifc_class.startswith(_WALLS)
            if box is not None and (is_wall or np.sort(box[1] - box[0])[1] >= _BIG):
                self._elements.append(element)
                boxes.append(box)
        self._boxes = np.array(boxes, dtype=np.float64).reshape(-1, 2, 3)
        self._triangles: dict[int, NDArray[np.float64]] = {}

    def within(self, box: NDArray[np.float64], without: Collection[str] = ()) -> Scene:
        """Return what reaches into a box, (2, 3) metres, but for the elements with some GlobalIds."""
        near = (self._boxes[:, 0] <= box[1]).all(axis=1) & (self._boxes[:, 1] >= box[0]).all(axis=1)
        chosen = [k for k in np.flatnonzero(near).tolist() if self._elements[k].global_id not in without]
        parts = [self._clipped(k, box) for k in chosen]
        offsets = np.cumsum([0, *map(len, parts)])
        triangles = np.concatenate(parts) if parts else np.empty((0, 3, 3))
        return Scene(tuple(self._elements[k] for k in chosen), triangles, offsets, self._boxes[chosen])

    def _clipped(self, k: int, box: NDArray[np.float64]) -> NDArray[np.float64]:
        if k not in self._triangles:
            shapes = self._elements[k].shapes
            self._triangles[k] = np.concatenate([shape.world_vertices()[shape.mesh.faces] for shape in shapes])
        triangles = self._triangles[k]
        is_near = (triangles.min(axis=1) <= box[1]).all(axis=1) & (triangles.max(axis=1) >= box[0]).all(axis=1)
        clipped: NDArray[np.float64] = triangles[is_near]
        return clipped


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What may hide things in one place.

    Parameters
    ----------
    elements
        What hides.
    triangles : (n, 3, 3) float64, metres
        Their surfaces, one element after the other.
    offsets : (elements + 1,) int
        Where the triangles of each begin.
    boxes : (elements, 2, 3) float64, metres
    """

    elements: tuple[Element, ...]
    triangles: NDArray[np.float64]
    offsets: NDArray[np.int64]
    boxes: NDArray[np.float64]

    def hits(
        self, begins: NDArray[np.float64], ends: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Follow straight lines to the first surface on each.

        Parameters
        ----------
        begins, ends : (n, 3) float64, metres

        Returns
        -------
        first : (n,) int64, index in `elements`; -1 where nothing is in the way
        left : (n,) float64, metres from there to the end of the line
        """
        begins, ends = (np.ascontiguousarray(points, dtype=np.float64) for points in (begins, ends))
        first = np.full(len(begins), -1, dtype=np.int64)
        left = np.zeros(len(begins))
        _first_hits(begins, ends, self.triangles, self.offsets.astype(np.int64), self.boxes, _SKIN, first, left)
        return first, left

    def holding(self, points: NDArray[np.float64]) -> tuple[int, ...]:
        """Return the indexes of the elements that have all of some points, (n, 3) metres, inside or on them."""
        low, high = points.min(axis=0), points.max(axis=0)
        return tuple(
            k
            for k, box in enumerate(self.boxes)
            if (box[0] <= low + _SAME).all()
            and (high - _SAME <= box[1]).all()
            and all(self._surrounds(k, point) for point in points)
        )

    def only(self, indexes: Sequence[int]) -> Scene:
        """Return a scene of some of the elements."""
        parts = [self.triangles[self.offsets[k] : self.offsets[k + 1]] for k in indexes]
        offsets = np.cumsum([0, *map(len, parts)])
        triangles = np.concatenate(parts) if parts else np.empty((0, 3, 3))
        return Scene(tuple(self.elements[k] for k in indexes), triangles, offsets, self.boxes[list(indexes)])

    def _surrounds(self, k: int, point: NDArray[np.float64]) -> bool:
        """Tell whether a point is in or on a surface: by the solid angles of van Oosterom and Strackee (1983)."""
        triangles = self.triangles[self.offsets[k] : self.offsets[k + 1]]
        a, b, c = (triangles - point).transpose(1, 0, 2)
        to_a, to_b, to_c = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
        ab, bc, ca = (a * b).sum(axis=1), (b * c).sum(axis=1), (c * a).sum(axis=1)
        volume = (a * np.cross(b, c)).sum(axis=1)
        half_angles = np.arctan2(volume, to_a * to_b * to_c + ab * to_c + bc * to_a + ca * to_b)
        return abs(float(half_angles.sum())) > _ON


def points_on(shapes: Iterable[Shape], count: int = 12) -> NDArray[np.float64]:
    """Choose points on shapes that lie far from each other, the one nearest to the middle first.

    Returns
    -------
    points : (n, 3) float64, metres; n is at most `count`, and 0 without shapes
    """
    parts = []
    for shape in shapes:
        corners = shape.world_vertices()
        every = np.concatenate([corners, corners[shape.mesh.faces].mean(axis=1)]) if len(shape.mesh.faces) else corners
        parts.append(every[:: max(1, len(every) // _MOST_POINTS)])
    points = np.concatenate(parts) if parts else np.empty((0, 3))
    if not len(points):
        return points
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    chosen = [int(np.linalg.norm(points - middle, axis=1).round(9).argmin())]
    away = np.full(len(points), np.inf)
    for _ in range(min(count, len(points)) - 1):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        farthest = int(away.round(9).argmax())
        if away[farthest] < _SKIN:
            break
        chosen.append(farthest)
    return points[chosen]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _first_hits(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    begins, ends, triangles, offsets, boxes, skin, first, left
):
    """Fill in the first element that each line meets: the test of Möller and Trumbore (1997) on its triangles."""
    for n in range(len(begins)):
        ox, oy, oz = begins[n]
        dx, dy, dz = ends[n] - begins[n]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length <= skin:
            continue
        best = 1.0 - skin / length
        for k in range(len(boxes)):
            near, far = 0.0, best
            for axis in range(3):
                begin, step = begins[n, axis], ends[n, axis] - begins[n, axis]
                low, high = boxes[k, 0, axis] - 1e-9, boxes[k, 1, axis] + 1e-9
                if step == 0.0:
                    if begin < low or begin > high:
                        far = -1.0
                    continue
                a, b = (low - begin) / step, (high - begin) / step
                near, far = max(near, min(a, b)), min(far, max(a, b))
            if near > far:
                continue
            for m in range(offsets[k], offsets[k + 1]):
                ax, ay, az = triangles[m, 0]
                ux, uy, uz = triangles[m, 1] - triangles[m, 0]
                vx, vy, vz = triangles[m, 2] - triangles[m, 0]
                px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
                det = ux * px + uy * py + uz * pz
                if det == 0.0:
                    continue
                tx, ty, tz = ox - ax, oy - ay, oz - az
                u = (tx * px + ty * py + tz * pz) / det
                if u < -1e-12 or u > 1 + 1e-12:
                    continue
                qx, qy, qz = ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux
                v = (dx * qx + dy * qy + dz * qz) / det
                if v < -1e-12 or u + v > 1 + 1e-12:
                    continue
                t = (vx * qx + vy * qy + vz * qz) / det
                if 0.0 <= t < best:
                    best = t
                    first[n] = k
        left[n] = (1.0 - best) * length
