"""Climbs over stairs, ramps and lifts: found in a leg, and judged."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bimnav.verify._bodies import Body, check_bodies
from bimnav.verify._plan_view import track_of
from bimnav.verify._verdict import Violation, refusal, who
from bimnav.verify._world import SAME, Way, World

if TYPE_CHECKING:
    from bimnav.building import Element

__all__ = ["check_climb", "find_climbs"]

_SLICE = 0.05  # metres of height in which the body on a stair is judged


def find_climbs(
    points: NDArray[np.float64], world: World
) -> tuple[list[NDArray[np.float64]], list[tuple[Way, NDArray[np.float64]]]]:
    """Part a leg into stretches between connectors and climbs over them; what follows none stays in a stretch."""
    flat, climbs, done = [], [], 0
    for k in np.flatnonzero(np.abs(np.diff(points[:, 2])) > SAME).tolist():
        if k < done:
            continue
        for way in world.ways:
            found = next(
                filter(None, (_along(points, k, way, line, world) for line in (way.points, way.points[::-1]))), None
            )
            if found is not None:
                first, last = found
                flat.append(points[done : first + 1])
                climbs.append((way, points[first : last + 1]))
                done = last
                break
    return [*flat, points[done:]], climbs


def _along(
    points: NDArray[np.float64], k: int, way: Way, line: NDArray[np.float64], world: World
) -> tuple[int, int] | None:
    """Return the points, first and last, that follow a line of a connector around piece k of a leg.

    They pass all of its points from one floor to another. Only its ends may lie a step beside these floors.
    """
    with np.errstate(invalid="ignore"):
        same = np.all(np.abs(points[k : k + 2, None, :2] - line[:, :2]) <= SAME, axis=2)
        level = np.any(np.abs(points[:, 2:] - world.levels) <= SAME, axis=1)
    for j in np.flatnonzero(same[0, :-1] & same[1, 1:]).tolist():
        first, last, shift = k, k + 1, j - k
        while first > 0 and first + shift > 0 and _is_at(points[first - 1], line[first + shift - 1]):
            first -= 1
        while (
            last + 1 < len(points) and last + shift + 1 < len(line) and _is_at(points[last + 1], line[last + shift + 1])
        ):
            last += 1
        on = np.flatnonzero(level[first : last + 1]) + first
        if not (len(on) and on[0] <= k < on[-1]):
            continue
        first, last = int(on[0]), int(on[-1])
        climb, due = points[first : last + 1, 2], line[first + shift : last + shift + 1, 2].copy()
        for end in (0, -1):
            if abs(climb[end] - due[end]) <= way.step:
                due[np.abs(due - due[end]) <= SAME] = climb[end]
        if (np.abs(climb - due) <= SAME).all():
            return first, last
    return None


def _is_at(point: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return bool((np.abs(point[:2] - other[:2]) <= SAME).all())


def check_climb(
    way: Way,
    climb: NDArray[np.float64],
    leg: int | None,
    world: World,
    body_of: Callable[[Element], Body | None] | None,
    found: list[Violation],
) -> float:
    """Refuse a climb that the robot cannot make, or on which its body meets something; return the clearance.

    The body is judged in slices of height, in each as high as in all of it.
    """
    if way.unfit:
        text = f"the robot cannot use {who(way.owner)}: {way.unfit},"
        found.append(refusal("climb", text, climb[0], 0.0, way.owner, None, leg))
    clearance, hits = math.inf, list[Violation]()
    solids = [element for element in world.solids if element.global_id not in way.own]
    if body_of is None or not solids:
        return clearance
    bounds = np.array([element.bounds for element in solids])
    for a, b in pairwise(climb):
        rise = abs(float(b[2] - a[2]))
        if way.is_lift and rise > 0:
            continue  # inside the car
        count = max(math.ceil(rise / _SLICE), 1)
        ends = np.linspace(a, b, count + 1)
        for begin, end in pairwise(ends):
            low, high = sorted((float(begin[2]), float(end[2])))
            track = track_of(-1, high, [(leg, np.array([begin[:2], end[:2]]))])
            band = way.foot, world.band[1] - (high - low)
            slice_ = replace(world, elements=solids, bounds=bounds, band=band, radius=way.radius)
            clearance = min(clearance, check_bodies(track, slice_, body_of, hits))
    worst = {(hit.kind, hit.global_id): hit for hit in sorted(hits, key=lambda hit: hit.depth)}
    found += [replace(hit, storey=None) for hit in worst.values()]
    return clearance
