# mypy: disable-error-code="no-any-return"
"""Free floor as convex faces that meet edge to edge: what `taut` searches."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import kernel, lean

__all__ = ["Mesh", "mesh_of_mask", "mesh_of_triangles"]

_WALL = -1
_REFLEX = np.pi + 1e-9


class Mesh(NamedTuple):
    """Convex faces.

    Attributes
    ----------
    points : (n, 2) float64
        Corners of faces, x and y.
    bends : (n,) bool
        Whether a shortest path may bend there: an obstacle's corner that juts out.
    first : (faces + 1,) int32
        Where the edges of each face begin in `corners`.
    corners : (edges,) int32
        Point at which each edge begins, counter-clockwise around its face.
    twins : (edges,) int32
        The same edge, seen from the face across; -1 at a wall.
    faces : (edges,) int32
        Face of each edge.
    """

    points: NDArray[np.float64]
    bends: NDArray[np.bool_]
    first: NDArray[np.int32]
    corners: NDArray[np.int32]
    twins: NDArray[np.int32]
    faces: NDArray[np.int32]


def mesh_of_mask(free: NDArray[np.bool_]) -> tuple[Mesh, NDArray[np.int32]]:
    """Cut free cells into rectangles: runs along a row, joined where they follow each other unchanged.

    Parameters
    ----------
    free : (rows, cols) bool

    Returns
    -------
    mesh
        In cells: cell (row, col) is the square from (col, row) to (col + 1, row + 1).
    face : (rows, cols) int32
        Face of each cell; -1 where blocked.
    """
    face = np.full(free.shape, _WALL, dtype=np.int32)
    boxes = _find_boxes(np.ascontiguousarray(free), face)
    lattice = np.full((free.shape[0] + 1, free.shape[1] + 1), -1, dtype=np.int32)
    mesh = Mesh(*_join_boxes(face, boxes, lattice))
    return mesh, face


@kernel
def _find_boxes(free: NDArray[np.bool_], face: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number the rectangles in `face`; return their first and last row, first column and column after the last."""
    rows, cols = free.shape
    room, count = 1024, 0
    boxes = np.empty((room, 4), dtype=np.int32)
    for row in range(rows):
        col = 0
        while col < cols:
            if not free[row, col]:
                col += 1
                continue
            begin = col
            while col < cols and free[row, col]:
                col += 1
            below = face[row - 1, begin] if row else -1
            if below >= 0 and boxes[below, 2] == begin and boxes[below, 3] == col:
                boxes[below, 1] = row
            else:
                if count == room:
                    room *= 2
                    larger = np.empty((room, 4), dtype=np.int32)
                    larger[:count] = boxes
                    boxes = larger
                below = count
                boxes[count, 0], boxes[count, 1], boxes[count, 2], boxes[count, 3] = row, row, begin, col
                count += 1
            face[row, begin:col] = below
    return boxes[:count].copy()


@lean
def _bends_at(face: NDArray[np.int32], row: int, col: int) -> bool:
    """Tell whether one of the four cells around a point of the lattice is blocked and three are free."""
    rows, cols = face.shape
    blocked = 0
    for r in (row - 1, row):
        for c in (col - 1, col):
            blocked += not (0 <= r < rows and 0 <= c < cols and face[r, c] >= 0)
    return blocked == 1


@kernel
def _join_boxes(
    face: NDArray[np.int32], boxes: NDArray[np.int32], lattice: NDArray[np.int32]
) -> tuple[
    NDArray[np.float64],
    NDArray[np.bool_],
    NDArray[np.int32],
    NDArray[np.int32],
    NDArray[np.int32],
    NDArray[np.int32],
]:
    rows, cols = face.shape
    most = 0
    for k in range(len(boxes)):
        most += 4
        for row in (boxes[k, 0] - 1, boxes[k, 1] + 1):
            if 0 <= row < rows:
                for col in range(boxes[k, 2] + 1, boxes[k, 3]):
                    most += face[row, col] != face[row, col - 1]
    points = np.empty((min(most, (rows + 1) * (cols + 1)), 2), dtype=np.float64)
    bends = np.empty(len(points), dtype=np.bool_)
    first = np.empty(len(boxes) + 1, dtype=np.int32)
    corners = np.empty(most, dtype=np.int32)
    twins = np.full(most, -1, dtype=np.int32)
    faces = np.empty(most, dtype=np.int32)
    upper = np.empty((rows + 1, cols), dtype=np.int32)  # edge of the face below that begins a stretch of a line
    known, edge = 0, 0
    for k in range(len(boxes)):
        low, high, left, right = boxes[k, 0], boxes[k, 1] + 1, boxes[k, 2], boxes[k, 3]
        first[k] = edge
        for side in range(2):
            line, beyond = (low, low - 1) if side == 0 else (high, high)
            col = left if side == 0 else right
            while True:
                # a corner, and the stretch of edge that begins there
                if lattice[line, col] < 0:
                    lattice[line, col] = known
                    points[known, 0], points[known, 1] = col, line
                    bends[known] = _bends_at(face, line, col)
                    known += 1
                corners[edge], faces[edge] = lattice[line, col], k
                if col == (right if side == 0 else left):  # what follows is a side wall
                    edge += 1
                    break
                begin = col
                cell = col if side == 0 else col - 1
                across = face[beyond, cell] if 0 <= beyond < rows else -1
                while col != (right if side == 0 else left):
                    cell = col if side == 0 else col - 1
                    if (face[beyond, cell] if 0 <= beyond < rows else -1) != across:
                        break
                    col += 1 if side == 0 else -1
                if across >= 0:
                    if side == 1:
                        upper[line, col] = edge
                    else:  # faces are numbered from below, so the one below is known
                        twins[edge] = upper[line, begin]
                        twins[upper[line, begin]] = edge
                edge += 1
    first[len(boxes)] = edge
    return points[:known].copy(), bends[:known].copy(), first, corners[:edge].copy(), twins[:edge].copy(), faces[:edge]


def mesh_of_triangles(triangles: NDArray[np.float64]) -> Mesh:
    """Join triangles that share whole edges.

    Parameters
    ----------
    triangles : (n, 3, 2) float64
        Corners; those that are one point are equal to the last bit.
    """
    a, b, c = triangles.transpose(1, 0, 2)
    turned = _cross(b - a, c - a) < 0
    triangles = np.where(turned[:, None, None], triangles[:, ::-1], triangles)
    points, corners = np.unique(triangles.reshape(-1, 2), axis=0, return_inverse=True)
    corners = corners.reshape(-1, 3)
    ends = np.roll(corners, -1, axis=1)
    low, high = np.minimum(corners, ends).ravel(), np.maximum(corners, ends).ravel()
    order = np.lexsort((high, low))
    same = np.flatnonzero((low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1]))
    twins = np.full(corners.size, -1, dtype=np.int32)
    twins[order[same]], twins[order[same + 1]] = order[same + 1], order[same]
    ahead, back = points[ends] - points[corners], points[np.roll(corners, 1, axis=1)] - points[corners]
    angle = np.arctan2(_cross(ahead, back), (ahead * back).sum(axis=-1))
    around = np.bincount(corners.ravel(), angle.ravel(), len(points))
    bends = np.zeros(len(points), dtype=np.bool_)
    bends[corners.ravel()[twins < 0]] = True
    bends &= around > _REFLEX
    count = len(corners)
    return Mesh(
        points,
        bends,
        np.arange(0, 3 * count + 1, 3, dtype=np.int32),
        corners.ravel().astype(np.int32),
        twins,
        np.repeat(np.arange(count, dtype=np.int32), 3),
    )


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
