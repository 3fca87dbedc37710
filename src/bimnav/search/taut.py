# mypy: disable-error-code="assignment, no-any-return, operator"
"""Shortest paths over a plane with obstacles, exact: straight legs that bend at corners of obstacles.

What a root sees through an interval of an edge is pushed from face to face; where a wall ends, its corner
becomes a root. Cui, Harabor and Grastien, Compromise-free pathfinding on a navigation mesh, IJCAI 2017.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import kernel, lean, pop_least, push
from bimnav.search.mesh import Mesh

__all__ = ["Taut", "find_taut", "pull"]

_NEAR = 1e-9  # points closer than this are one, in cells or metres
_NODE = np.dtype(
    [
        ("right_x", "f8"), ("right_y", "f8"), ("left_x", "f8"), ("left_y", "f8"),
        ("length", "f8"),
        ("root", "i4"), ("right", "i4"), ("left", "i4"), ("edge", "i4"), ("parent", "i4"),
    ]
)  # fmt: skip
_START, _NO_POINT, _GOAL = -1, -2, -1


class Taut(NamedTuple):
    """A shortest path: (n, 2) float64 points from start to goal, and its length."""

    points: NDArray[np.float64]
    length: float


def find_taut(
    mesh: Mesh, start: tuple[float, float], start_face: int, goal: tuple[float, float], goal_face: int
) -> Taut | None:
    """Find the shortest path between two points of faces; None if there is none.

    Parameters
    ----------
    start_face, goal_face
        Faces that hold the points.
    """
    length, bends = pull(*mesh, *start, start_face, *goal, goal_face)
    if length == math.inf:
        return None
    return Taut(np.vstack([start, mesh.points[bends], goal]), length)


@lean
def _cross(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return how far c lies left of the ray from a to b, times the length of ab."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@lean
def _beside(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return how far c lies left of the ray from a to b; 0 if it is on it for all we know."""
    found = _cross(ax, ay, bx, by, cx, cy) / math.hypot(bx - ax, by - ay)
    return 0.0 if abs(found) < _NEAR else found


@lean
def _through(
    x: float, y: float, right_x: float, right_y: float, left_x: float, left_y: float, goal_x: float, goal_y: float
) -> float:
    """Return the length of the shortest way from a root through an interval to the goal, walls aside."""
    here = _cross(right_x, right_y, left_x, left_y, x, y)
    there = _cross(right_x, right_y, left_x, left_y, goal_x, goal_y)
    dx, dy = left_x - right_x, left_y - right_y
    if abs(here) <= _NEAR * math.hypot(dx, dy):  # the root is on the interval
        return math.hypot(goal_x - x, goal_y - y)
    if here * there > 0:  # the goal is mirrored to the far side
        scale = 2 * there / (dx * dx + dy * dy)
        goal_x += dy * scale
        goal_y -= dx * scale
    if _cross(x, y, left_x, left_y, goal_x, goal_y) > 0:
        return math.hypot(left_x - x, left_y - y) + math.hypot(goal_x - left_x, goal_y - left_y)
    if _cross(x, y, right_x, right_y, goal_x, goal_y) < 0:
        return math.hypot(right_x - x, right_y - y) + math.hypot(goal_x - right_x, goal_y - right_y)
    return math.hypot(goal_x - x, goal_y - y)


@kernel
def pull(
    points: NDArray[np.float64],
    bends: NDArray[np.bool_],
    first: NDArray[np.int32],
    corners: NDArray[np.int32],
    twins: NDArray[np.int32],
    faces: NDArray[np.int32],
    start_x: float,
    start_y: float,
    start_face: int,
    goal_x: float,
    goal_y: float,
    goal_face: int,
) -> tuple[float, NDArray[np.int64]]:
    """Return the length of the shortest path, inf if there is none, and the points where it bends."""
    none = np.empty(0, dtype=np.int64)
    if start_face == goal_face:
        return math.hypot(goal_x - start_x, goal_y - start_y), none
    best = np.full(len(points), np.inf)
    room, count, size = 1024, 0, 0
    nodes = np.empty(room, dtype=_NODE)
    keys = np.full(room + 8, np.inf)
    items = np.empty(room + 8, dtype=np.int32)
    for edge in range(first[start_face], first[start_face + 1]):
        if twins[edge] < 0:
            continue
        after = edge + 1 if edge + 1 < first[start_face + 1] else first[start_face]
        if count + 8 >= room:
            nodes, keys, items, room = _grown(nodes, keys, items, room)
        size, count = _note(
            nodes, keys, items, size, count, points, bends, best, _START, start_x, start_y, 0.0, -1,
            points[corners[edge], 0], points[corners[edge], 1], corners[edge],
            points[corners[after], 0], points[corners[after], 1], corners[after],
            twins[edge], goal_x, goal_y,
        )  # fmt: skip
    while size:
        at = np.int64(items[0])
        key = keys[0]
        size = pop_least(keys, items, size, np.inf)
        root, length = nodes[at].root, nodes[at].length
        if nodes[at].edge == _GOAL:
            bent = 0
            last, back = _START, at
            while back >= 0:
                if nodes[back].root != last and nodes[back].root != _START:
                    bent += 1
                last = nodes[back].root
                back = np.int64(nodes[back].parent)
            path = np.empty(bent, dtype=np.int64)
            last, back = _START, at
            while back >= 0:
                if nodes[back].root != last and nodes[back].root != _START:
                    bent -= 1
                    path[bent] = nodes[back].root
                last = nodes[back].root
                back = np.int64(nodes[back].parent)
            return key, path
        if root >= 0 and length > best[root] + _NEAR:
            continue
        x, y = (start_x, start_y) if root == _START else (points[root, 0], points[root, 1])
        right_x, right_y, right = nodes[at].right_x, nodes[at].right_y, np.int64(nodes[at].right)
        left_x, left_y, left = nodes[at].left_x, nodes[at].left_y, np.int64(nodes[at].left)
        entry = np.int64(nodes[at].edge)
        face = np.int64(faces[entry])
        begin, end = np.int64(first[face]), np.int64(first[face + 1])
        while count + 6 * (end - begin) + 8 >= room:
            nodes, keys, items, room = _grown(nodes, keys, items, room)
        wide = math.hypot(left_x - right_x, left_y - right_y)
        # on the edge it comes through, a root sees all of a convex face
        sees_all = abs(_cross(right_x, right_y, left_x, left_y, x, y)) <= _NEAR * wide
        turns_right = right >= 0 and bends[right]
        turns_left = left >= 0 and bends[left]
        past_right = length + math.hypot(right_x - x, right_y - y)
        past_left = length + math.hypot(left_x - x, left_y - y)
        if face == goal_face:
            in_right = 1.0 if sees_all else _beside(x, y, right_x, right_y, goal_x, goal_y)
            in_left = 1.0 if sees_all else -_beside(x, y, left_x, left_y, goal_x, goal_y)
            if in_right >= 0 and in_left >= 0:
                whole = length + math.hypot(goal_x - x, goal_y - y)
                size, count = _arrive(nodes, keys, items, size, count, root, length, at, whole)
            elif in_right < 0 and turns_right and past_right <= best[right] + _NEAR:
                whole = past_right + math.hypot(goal_x - right_x, goal_y - right_y)
                size, count = _arrive(nodes, keys, items, size, count, right, past_right, at, whole)
            elif in_left < 0 and turns_left and past_left <= best[left] + _NEAR:
                whole = past_left + math.hypot(goal_x - left_x, goal_y - left_y)
                size, count = _arrive(nodes, keys, items, size, count, left, past_left, at, whole)
            continue
        # the other edges, from right to left, each in up to three parts: behind the right end, in sight,
        # behind the left end
        edge = entry
        for _ in range(end - begin - 1):
            edge = edge + 1 if edge + 1 < end else begin
            if twins[edge] < 0:
                continue
            after = edge + 1 if edge + 1 < end else begin
            a, b = np.int64(corners[edge]), np.int64(corners[after])
            ax, ay, bx, by = points[a, 0], points[a, 1], points[b, 0], points[b, 1]
            split_right, split_left = 0.0, 1.0
            if not sees_all:
                of_a, of_b = _beside(x, y, right_x, right_y, ax, ay), _beside(x, y, right_x, right_y, bx, by)
                if of_b <= 0:
                    split_right = 1.0
                elif of_a < 0:
                    split_right = of_a / (of_a - of_b)
                of_a, of_b = -_beside(x, y, left_x, left_y, ax, ay), -_beside(x, y, left_x, left_y, bx, by)
                if of_a <= 0:
                    split_left = 0.0
                elif of_b < 0:
                    split_left = of_a / (of_a - of_b)
            sx, sy = ax + split_right * (bx - ax), ay + split_right * (by - ay)
            tx, ty = ax + split_left * (bx - ax), ay + split_left * (by - ay)
            s = a if split_right == 0 else b if split_right == 1 else np.int64(_NO_POINT)
            t = a if split_left == 0 else b if split_left == 1 else np.int64(_NO_POINT)
            if split_right > 0 and turns_right:
                size, count = _note(
                    nodes, keys, items, size, count, points, bends, best, right, right_x, right_y, past_right, at,
                    ax, ay, a, sx, sy, s, twins[edge], goal_x, goal_y,
                )  # fmt: skip
            if split_right < split_left:
                size, count = _note(
                    nodes, keys, items, size, count, points, bends, best, root, x, y, length, at,
                    sx, sy, s, tx, ty, t, twins[edge], goal_x, goal_y,
                )  # fmt: skip
            if split_left < 1 and turns_left:
                size, count = _note(
                    nodes, keys, items, size, count, points, bends, best, left, left_x, left_y, past_left, at,
                    tx, ty, t, bx, by, b, twins[edge], goal_x, goal_y,
                )  # fmt: skip
    return np.inf, none


@kernel
def _grown(
    nodes: NDArray[np.void], keys: NDArray[np.float64], items: NDArray[np.int32], room: int
) -> tuple[NDArray[np.void], NDArray[np.float64], NDArray[np.int32], int]:
    """Return memory for four times as many nodes."""
    room *= 4
    more_nodes, more_keys = np.empty(room, dtype=_NODE), np.full(room + 8, np.inf)
    more_items = np.empty(room + 8, dtype=np.int32)
    more_nodes[: len(nodes)] = nodes
    more_keys[: len(keys)] = keys
    more_items[: len(items)] = items
    return more_nodes, more_keys, more_items, room


@lean
def _arrive(
    nodes: NDArray[np.void],
    keys: NDArray[np.float64],
    items: NDArray[np.int32],
    size: int,
    count: int,
    root: int,
    length: float,
    parent: int,
    whole: float,
) -> tuple[int, int]:
    node = nodes[count]
    node.root, node.length, node.parent, node.edge = root, length, parent, _GOAL
    return push(keys, items, size, whole, count), count + 1


@lean
def _note(
    nodes: NDArray[np.void],
    keys: NDArray[np.float64],
    items: NDArray[np.int32],
    size: int,
    count: int,
    points: NDArray[np.float64],
    bends: NDArray[np.bool_],
    best: NDArray[np.float64],
    root: int,
    x: float,
    y: float,
    length: float,
    parent: int,
    right_x: float,
    right_y: float,
    right: int,
    left_x: float,
    left_y: float,
    left: int,
    edge: int,
    goal_x: float,
    goal_y: float,
) -> tuple[int, int]:
    """Note that a root sees an interval, to be pushed over an edge; return the sizes of heap and list."""
    wide = math.hypot(left_x - right_x, left_y - right_y)
    if wide < _NEAR:
        return size, count
    if abs(_cross(right_x, right_y, left_x, left_y, x, y)) <= _NEAR * wide:
        # the root lies on the line of the interval: it must go to its nearer end before it can turn
        along = ((x - right_x) * (left_x - right_x) + (y - right_y) * (left_y - right_y)) / (wide * wide)
        if along < 0 or along > 1:
            away = -along * wide if along < 0 else (along - 1) * wide
            if away > _NEAR:
                near = right if along < 0 else left
                if near < 0 or not bends[near]:
                    return size, count
                if root >= 0:  # a node of its own, for the way back from the goal
                    nodes[count].root, nodes[count].length, nodes[count].parent = root, length, parent
                    parent = count
                    count += 1
                x, y, root, length = points[near, 0], points[near, 1], near, length + away
    if root >= 0:
        if length > best[root] + _NEAR:
            return size, count
        best[root] = min(best[root], length)
    node = nodes[count]
    node.right_x, node.right_y, node.right = right_x, right_y, right
    node.left_x, node.left_y, node.left = left_x, left_y, left
    node.root, node.length, node.edge, node.parent = root, length, edge, parent
    key = length + _through(x, y, right_x, right_y, left_x, left_y, goal_x, goal_y)
    return push(keys, items, size, key, count), count + 1
