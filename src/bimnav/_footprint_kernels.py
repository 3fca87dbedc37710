"""Kernels that join the triangles of a mesh, and walk round what a height band leaves of them.

A mesh edge has one number, whichever faces share it. Where an edge passes a plane, the point is known
by that number and never by its coordinates, so that outlines close without a tolerance.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["COVER", "HIGH", "LOW", "join", "orient", "trace", "turns_back"]

LOW, HIGH, COVER = 0, 1, 2
"""What an outline bounds: the section at the lower or upper plane, or the plan view of faces between them."""

_CROWD = 8  # faces at one edge; beyond, they count as one part without a closer look
_FLAT = 1e-12  # square metres; a face that covers less is vertical
_NO_THICKNESS = 1e-7  # metres; volume over surface of a sheet

_kernel = numba.njit(cache=True, error_model="numpy", nogil=True)


@_kernel
def join(
    faces: NDArray[np.int32], vertex_count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Number the edges of a mesh.

    Parameters
    ----------
    faces : (m, 3) int32

    Returns
    -------
    edges : (k, 2) int32, lower vertex first
    edge_of : (m, 3) int32, the edge that leaves each corner of a face
    order : (3 * m,) int32, corners sorted by edge; `3 * face + i` is a corner
    begins : (k + 1,) int32, where each edge begins in `order`
    """
    corners = faces.size
    ends = np.empty((2, corners), np.int32)
    for corner in range(corners):
        a, b = faces[corner // 3, corner % 3], faces[corner // 3, (corner + 1) % 3]
        ends[0, corner], ends[1, corner] = min(a, b), max(a, b)
    order, into = np.arange(corners).astype(np.int32), np.empty(corners, np.int32)
    for end in (1, 0):  # a stable counting sort by each end
        places = np.zeros(vertex_count + 1, np.int32)
        for vertex in ends[end]:
            places[vertex + 1] += 1
        for vertex in range(vertex_count):
            places[vertex + 1] += places[vertex]
        for position in range(corners):
            vertex = ends[end, order[position]]
            into[places[vertex]] = order[position]
            places[vertex] += 1
        order, into = into, order
    edges, begins = np.empty((corners, 2), np.int32), np.empty(corners + 1, np.int32)
    edge_of = np.empty(faces.shape, np.int32)
    count = 0
    for position in range(corners):
        low, high = ends[:, order[position]]
        if count == 0 or edges[count - 1, 0] != low or edges[count - 1, 1] != high:
            edges[count, 0], edges[count, 1], begins[count] = low, high, position
            count += 1
        edge_of[order[position] // 3, order[position] % 3] = count - 1
    begins[count] = corners
    return edges[:count], edge_of, order, begins[: count + 1]


@_kernel
def _root(parent: NDArray[np.int32], turned: NDArray[np.bool_], face: int) -> tuple[int, bool]:
    """Return the face that stands for a part, and whether this face is turned against it."""
    root, turn = face, False
    while parent[root] != root:
        turn ^= turned[root]
        root = parent[root]
    rest = turn
    while parent[face] != root and face != root:  # shorten the way for the next question
        above, step = parent[face], turned[face]
        parent[face], turned[face] = root, rest
        rest ^= step
        face = above
    return root, turn


@_kernel
def _unite(parent: NDArray[np.int32], turned: NDArray[np.bool_], a: int, b: int, turn: bool) -> bool:
    """Make two faces one part; False if they are already, and turned otherwise."""
    root_a, turn_a = _root(parent, turned, a)
    root_b, turn_b = _root(parent, turned, b)
    turn ^= turn_a ^ turn_b
    if root_a == root_b:
        return not turn
    parent[max(root_a, root_b)] = min(root_a, root_b)
    turned[max(root_a, root_b)] = turn
    return True


@_kernel
def _is_balanced(
    parent: NDArray[np.int32], turned: NDArray[np.bool_], forward: NDArray[np.bool_], around: NDArray[np.int32]
) -> bool:
    """Tell whether each part at an edge runs along it as often forward as backward."""
    if len(around) > _CROWD:
        total = 0
        for corner in around:
            total += 1 if forward[corner] ^ _root(parent, turned, corner // 3)[1] else -1
        return total == 0
    for one in around:
        total, root = 0, _root(parent, turned, one // 3)[0]
        for corner in around:
            its_root, turn = _root(parent, turned, corner // 3)
            if its_root == root:
                total += 1 if forward[corner] ^ turn else -1
        if total != 0:
            return False
    return True


@_kernel
def orient(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    order: NDArray[np.int32],
    begins: NDArray[np.int32],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Split a mesh into connected parts, and find the faces that look inward.

    Parameters
    ----------
    vertices : (n, 3) float64, about the origin
    faces : (m, 3) int32
    order, begins
        From `join`.

    Returns
    -------
    inward : (m,) bool, the faces to reverse
    is_open : (m,) bool, the faces of parts that are not closed
    is_sheet : (m,) bool, the faces of parts that are not closed, or closed and without thickness
    """
    count, edges = len(faces), len(begins) - 1
    parent, turned = np.arange(count).astype(np.int32), np.zeros(count, np.bool_)
    forward = np.empty(faces.size, np.bool_)
    for corner in range(faces.size):
        forward[corner] = faces[corner // 3, corner % 3] < faces[corner // 3, (corner + 1) % 3]
    torn = np.zeros(count, np.bool_)
    for edge in range(edges):
        around = order[begins[edge] : begins[edge + 1]]
        if len(around) == 2:
            a, b = around
            if not _unite(parent, turned, a // 3, b // 3, forward[a] == forward[b]):
                torn[a // 3] = True
    for edge in range(edges):  # closed parts that share an edge stay apart
        around = order[begins[edge] : begins[edge + 1]]
        if len(around) > _CROWD or (len(around) > 2 and not _is_balanced(parent, turned, forward, around)):
            for corner in around[1:]:
                _unite(parent, turned, around[0] // 3, corner // 3, False)
    for edge in range(edges):
        around = order[begins[edge] : begins[edge + 1]]
        if len(around) != 2 and not _is_balanced(parent, turned, forward, around):
            for corner in around:
                torn[corner // 3] = True
    volume, surface = np.zeros(count), np.zeros(count)
    for face in range(count):
        root, turn = _root(parent, turned, face)
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        share = (nx * a[0] + ny * a[1] + nz * a[2]) / 6.0
        volume[root] += -share if turn else share
        surface[root] += math.sqrt(nx * nx + ny * ny + nz * nz) / 2.0
        if torn[face]:
            torn[root] = True
    inward, is_open, is_sheet = np.empty(count, np.bool_), np.empty(count, np.bool_), np.empty(count, np.bool_)
    for face in range(count):
        root, turn = _root(parent, turned, face)
        inward[face] = turn ^ (volume[root] < 0.0)
        is_open[face] = torn[root]
        is_sheet[face] = torn[root] or abs(volume[root]) <= _NO_THICKNESS * surface[root]
    return inward, is_open, is_sheet


@_kernel
def _passing(vertices: NDArray[np.float64], edges: NDArray[np.int32], edge: int, height: float) -> tuple[float, float]:
    """Return where an edge passes a height: the same point for all faces at the edge."""
    a, b = vertices[edges[edge, 0]], vertices[edges[edge, 1]]
    share = (height - a[2]) / (b[2] - a[2])
    return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share


@_kernel
def _loops(keys: NDArray[np.int32], key_count: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Put directed segments, (n, 2) keys, into closed loops; what stays open is left out.

    Returns the segments loop by loop, and where each loop begins.
    """
    count = len(keys)
    leaving, following = np.full(key_count, -1, np.int32), np.empty(count, np.int32)
    surplus = np.zeros(key_count, np.int32)  # segments that leave a point more than arrive there
    for segment in range(count - 1, -1, -1):
        start, end = keys[segment]
        following[segment], leaving[start] = leaving[start], segment
        surplus[start] += 1
        surplus[end] -= 1
    order, begins = np.empty(count, np.int32), np.empty(count + 1, np.int32)
    placed = loops = 0
    for looping in (False, True):  # first the chains that stay open; the rest falls into loops
        for segment in range(count):
            start = keys[segment, 0]
            while leaving[start] >= 0 and (looping or surplus[start] > 0):
                begins[loops] = placed
                surplus[start] -= 1
                at = start
                while True:
                    step = leaving[at]
                    leaving[at] = following[step]
                    order[placed] = step
                    at = keys[step, 1]
                    if looping:
                        placed += 1
                    if (looping and at == start) or (not looping and surplus[at] < 0):
                        break
                surplus[at] += 1
                if looping:
                    loops += 1
    begins[loops] = placed
    return order[:placed], begins[: loops + 1]


@_kernel
def _in_band(
    vertices: NDArray[np.float64],
    edges: NDArray[np.int32],
    edge: int,
    end: int,
    low: float,
    high: float,
) -> tuple[int, float, float]:
    """Return the key and plan view of one end of an edge, or of where the edge enters the band from there."""
    vertex = edges[edge, end]
    x, y, z = vertices[vertex]
    if z <= low:
        x, y = _passing(vertices, edges, edge, low)
        return len(vertices) + edge, x, y
    if z > high:
        x, y = _passing(vertices, edges, edge, high)
        return len(vertices) + len(edges) + edge, x, y
    return vertex, x, y


@_kernel
def trace(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    edges: NDArray[np.int32],
    edge_of: NDArray[np.int32],
    is_sheet: NDArray[np.bool_],
    low: float,
    high: float,
    thin: float,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int8], NDArray[np.float64], float, float]:
    """Walk round the sections of a mesh at two heights, and round the plan view of its faces between them.

    A vertex is above a plane when it lies higher, never when it lies on it. Of closed parts the faces
    that look down make the plan view, of sheets all faces.

    Parameters
    ----------
    vertices : (n, 3) float64, metres
    faces, edges, edge_of
        As for `join`.
    is_sheet : (m,) bool
    low, high
        The two heights; may be infinite.
    thin
        Metres; faces of sheets whose plan view is narrower are lines as well.

    Returns
    -------
    points : (k, 2) float64, corners of all outlines one after the other, none twice
    begins : (c + 1,) int32, where each outline begins in `points`
    bounds : (c,) int8, what each outline bounds
    lines : (l, 2, 2) float64, faces that are lines in plan view
    lowest, highest
        Heights between which the mesh occupies the band; inf and -inf if it does not reach it.
    """
    face_count, vertex_count, edge_count = len(faces), len(vertices), len(edges)
    room = (face_count, face_count, 5 * face_count)  # each face adds at most three sides and two cuts
    keys = (np.empty((room[0], 2), np.int32), np.empty((room[1], 2), np.int32), np.empty((room[2], 2), np.int32))
    starts = (np.empty((room[0], 2)), np.empty((room[1], 2)), np.empty((room[2], 2)))
    used = np.zeros(3, np.int64)
    net = np.zeros(edge_count, np.int32)  # how often the outline of the plan view runs along an edge
    lines, line_count = np.empty((face_count, 2, 2)), 0
    hull = np.empty((7, 2))
    lowest, highest = np.inf, -np.inf
    for face in range(face_count):
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        bottom, top = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        if top <= low or bottom > high:
            continue
        lowest, highest = min(lowest, max(bottom, low)), max(highest, min(top, high))
        twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        sense = -1 if twice < -_FLAT else 1 if twice > _FLAT and is_sheet[face] else 0
        for i in range(3):
            net[edge_of[face, i]] += sense if faces[face, i] < faces[face, (i + 1) % 3] else -sense
        corners = 0
        for vertex in faces[face]:
            if low < vertices[vertex, 2] <= high:
                hull[corners] = vertices[vertex, :2]
                corners += 1
        for plane in range(2):
            height = high if plane == HIGH else low
            if not bottom <= height < top:
                continue
            rising = falling = 0  # the edges at which the way round the face passes the plane
            for i in range(3):
                begin, end = vertices[faces[face, i], 2], vertices[faces[face, (i + 1) % 3], 2]
                if begin <= height < end:
                    rising = edge_of[face, i]
                elif end <= height < begin:
                    falling = edge_of[face, i]
            hull[corners] = _passing(vertices, edges, falling, height)
            hull[corners + 1] = _passing(vertices, edges, rising, height)
            keys[plane][used[plane], 0], keys[plane][used[plane], 1] = falling, rising
            starts[plane][used[plane]] = hull[corners]
            used[plane] += 1
            if sense != 0:
                along = (sense > 0) == (plane == LOW)
                at, shift = used[COVER], vertex_count + plane * edge_count
                keys[COVER][at, 0] = shift + (falling if along else rising)
                keys[COVER][at, 1] = shift + (rising if along else falling)
                starts[COVER][at] = hull[corners] if along else hull[corners + 1]
                used[COVER] += 1
            corners += 2
        if is_sheet[face]:
            p, q, length = 0, 0, 0.0
            for i in range(corners):
                for k in range(i):
                    apart = math.hypot(hull[i, 0] - hull[k, 0], hull[i, 1] - hull[k, 1])
                    if apart > length:
                        p, q, length = i, k, apart
            longest = max(
                math.hypot(b[0] - a[0], b[1] - a[1]),
                math.hypot(c[0] - b[0], c[1] - b[1]),
                math.hypot(a[0] - c[0], a[1] - c[1]),
            )
            if abs(twice) <= thin * longest:
                lines[line_count, 0], lines[line_count, 1] = hull[p], hull[q]
                line_count += 1
    for edge in range(edge_count):
        if net[edge] == 0:
            continue
        za, zb = vertices[edges[edge, 0], 2], vertices[edges[edge, 1], 2]
        if max(za, zb) <= low or min(za, zb) > high:
            continue
        first = 0 if net[edge] > 0 else 1
        start, x, y = _in_band(vertices, edges, edge, first, low, high)
        end = _in_band(vertices, edges, edge, 1 - first, low, high)[0]
        for _ in range(abs(net[edge])):
            keys[COVER][used[COVER], 0], keys[COVER][used[COVER], 1] = start, end
            starts[COVER][used[COVER], 0], starts[COVER][used[COVER], 1] = x, y
            used[COVER] += 1
    total = used.sum()
    points, begins, bounds = np.empty((total, 2)), np.empty(total + 1, np.int32), np.empty(total, np.int8)
    placed = outlines = 0
    for kind in range(3):
        key_count = vertex_count + 2 * edge_count if kind == COVER else edge_count
        order, firsts = _loops(keys[kind][: used[kind]], key_count)
        for first in firsts[:-1]:
            begins[outlines], bounds[outlines] = placed + first, kind
            outlines += 1
        for segment in order:
            points[placed] = starts[kind][segment]
            placed += 1
    begins[outlines] = placed
    return points[:placed], begins[: outlines + 1], bounds[:outlines], lines[:line_count], lowest, highest


@_kernel
def turns_back(ring: NDArray[np.float64], width: float) -> bool:
    """Tell whether a ring, (n, 2) corners, goes somewhere and returns the same way, less than a width apart."""
    at, direction, length = ring[0], np.zeros(2), 0.0
    for k in range(1, 2 * len(ring)):
        step = ring[k % len(ring)] - at
        reach = math.hypot(step[0], step[1])
        if reach <= width:
            continue
        step /= reach
        back = direction[0] * step[0] + direction[1] * step[1]
        aside = direction[0] * step[1] - direction[1] * step[0]
        if back < 0.0 and abs(aside) * min(length, reach) <= width:
            return True
        at, direction, length = ring[k % len(ring)], step, reach
    return False
