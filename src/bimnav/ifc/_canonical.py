"""One mesh for one solid: kernels number corners and divide flat faces otherwise in every run."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from bimnav.building import Mesh

__all__ = ["canonical"]

_FLAT = 1e-12  # one minus the cosine of the angle between two triangles of one flat face: about a microradian
_SAME = 1e-6  # radians; four corners this close to a circle lie on it
_TURNS = 50  # for each triangle; should rounding ever turn a diagonal to and fro, it ends

_kernel = numba.njit(cache=True, error_model="numpy", nogil=True)

Ints = NDArray[np.int64]


def canonical(mesh: Mesh) -> Mesh:
    """Sort vertices and faces, and divide flat faces the Delaunay way.

    Where four corners lie on a circle, the diagonal goes to the one that comes first. So meshes that differ
    only in numbering and in the diagonals of flat faces become equal.
    """
    order = np.lexsort(mesh.vertices.T)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    vertices, faces = mesh.vertices[order], place[mesh.faces]
    _settle(vertices, faces, _twins(faces, len(vertices)))
    turned = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, turned, axis=1)
    return Mesh(vertices, faces[np.lexsort(faces.T)].astype(np.int32), mesh.quality)


def _twins(faces: Ints, count: int) -> Ints:
    """Return for half-edge k of face f, at 3 f + k, the one that runs back; -1 unless there is exactly one."""
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(tails, heads) * count + np.maximum(tails, heads)
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    starts = starts[np.diff(starts, append=len(key)) == 2]
    one, other = order[starts], order[starts + 1]
    both_ways = tails[one] == heads[other]
    twins = np.full(len(key), -1)
    twins[one[both_ways]] = other[both_ways]
    twins[other[both_ways]] = one[both_ways]
    return twins


@_kernel
def _settle(vertices: NDArray[np.float64], faces: Ints, twins: Ints) -> None:
    """Turn the wrong diagonals of flat faces, in place; what lies around one is looked at again."""
    turns = _TURNS * len(faces)
    waiting = [half for half in range(len(twins)) if twins[half] > half]
    while waiting and turns > 0:
        half = waiting.pop()
        twin = twins[half]
        if twin < 0:
            continue
        left, right = half // 3, twin // 3
        i, j = half % 3, twin % 3
        a, b, c = faces[left, i], faces[left, (i + 1) % 3], faces[left, (i + 2) % 3]
        d = faces[right, (j + 2) % 3]
        bc, ca = twins[3 * left + (i + 1) % 3], twins[3 * left + (i + 2) % 3]
        ad, db = twins[3 * right + (j + 1) % 3], twins[3 * right + (j + 2) % 3]
        if bc // 3 == right or ca // 3 == right or not _is_wrong(vertices, a, b, c, d):
            continue
        turns -= 1
        faces[left, 0], faces[left, 1], faces[left, 2] = a, d, c
        faces[right, 0], faces[right, 1], faces[right, 2] = b, c, d
        around = ((3 * left, ad), (3 * left + 2, ca), (3 * right, bc), (3 * right + 2, db))
        for mine, outer in around:
            twins[mine] = outer
            if outer >= 0:
                twins[outer] = mine
                waiting.append(mine)
        twins[3 * left + 1], twins[3 * right + 1] = 3 * right + 1, 3 * left + 1


@_kernel
def _is_wrong(vertices: NDArray[np.float64], a: int, b: int, c: int, d: int) -> bool:
    """Tell whether the edge (a, b) between triangles (a, b, c) and (b, a, d) of a flat face should be (c, d)."""
    first, second = _corner(vertices, c, a, b), _corner(vertices, d, b, a)
    areas = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
    one = math.sqrt(first[0] ** 2 + first[1] ** 2 + first[2] ** 2)
    other = math.sqrt(second[0] ** 2 + second[1] ** 2 + second[2] ** 2)
    if areas <= 0.0 or areas < one * other * (1.0 - _FLAT):
        return False
    excess = math.atan2(one, first[3]) + math.atan2(other, second[3]) - math.pi
    return bool(excess > _SAME or (excess > -_SAME and min(c, d) < min(a, b)))


@_kernel
def _corner(vertices: NDArray[np.float64], at: int, one: int, other: int) -> tuple[float, float, float, float]:
    """Return the cross product of the two sides that meet at a corner, and their dot product."""
    x, y, z = vertices[at]
    p, q, r = vertices[one, 0] - x, vertices[one, 1] - y, vertices[one, 2] - z
    s, t, u = vertices[other, 0] - x, vertices[other, 1] - y, vertices[other, 2] - z
    return q * u - r * t, r * s - p * u, p * t - q * s, p * s + q * t + r * u
