"""Paths in plan view: a round robot against footprints, floors and zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.verify._verdict import Kind, Owner, Violation, refusal, who
from bimnav.verify._world import GAP, SAME, SLACK, World

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Leg", "Track", "check_floor", "check_footprints", "track_of"]

_FLOOR_GRID = 1e-6  # metres to which corners of the floor are rounded; floats hold it to 1e9 m

Leg: TypeAlias = tuple[int | None, NDArray[np.float64]]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """All of a route on one storey: unbroken stretches, and the straight pieces they are made of."""

    storey: int
    level: float
    legs: Sequence[int | None]  # of every stretch
    stretches: Sequence[BaseGeometry]
    stretch: NDArray[np.intp]  # of every piece
    pieces: NDArray[np.float64]  # (n, 2, 2) where each begins and ends
    lines: NDArray[np.object_]  # of every piece
    tree: shapely.STRtree  # of lines

    def leg_of(self, piece: int) -> int | None:
        return self.legs[int(self.stretch[piece])]

    def refusal(
        self, kind: Kind, text: str, xy: NDArray[np.float64], depth: float, leg: int | None, owner: Owner = ("", "")
    ) -> Violation:
        return refusal(kind, text, [*xy, self.level], depth, owner, self.storey, leg)


def track_of(storey: int, level: float, parts: Sequence[Leg]) -> Track:
    """Lay out the parts of the legs that lie on one storey, (n, 2) each."""
    stretches = [_drawn(points) for _, points in parts]
    runs = [xy if len(xy) > 1 else xy[[0, 0]] for xy in map(shapely.get_coordinates, stretches)]
    stretch = np.repeat(np.arange(len(runs)), [len(run) - 1 for run in runs])
    pieces = np.concatenate([np.stack([run[:-1], run[1:]], axis=1) for run in runs])
    stands = (pieces[:, 0] == pieces[:, 1]).all(axis=1)  # GEOS misses lines without length
    lines = np.where(stands, shapely.points(pieces[:, 0]), shapely.linestrings(pieces))
    return Track(storey, level, [leg for leg, _ in parts], stretches, stretch, pieces, lines, shapely.STRtree(lines))


def _drawn(points: NDArray[np.float64]) -> BaseGeometry:
    """Draw a line, or a point where the robot only stands; the line strays by less than the slack."""
    if not np.ptp(points, axis=0).any():
        return shapely.Point(points[0])
    return shapely.simplify(shapely.LineString(points), SLACK / 2, preserve_topology=False)


def check_footprints(track: Track, world: World, found: list[Violation]) -> float:
    """Refuse pieces closer to a footprint than the radius; return the clearance."""
    here = np.flatnonzero(world.storeys == track.storey)
    tree = shapely.STRtree(world.footprints[here])
    _, distances = tree.query_nearest(track.lines, return_distance=True, all_matches=False)
    clearance = float(distances.min(initial=np.inf)) - world.radius
    slack = SLACK + 4 * float(np.spacing(np.abs(track.pieces).max()))
    limit = max(world.radius - slack, slack)  # a round robot may touch, a point may not
    worst: dict[tuple[int | None, int], tuple[float, NDArray[np.float64]]] = {}
    for piece, index in tree.query(track.lines, predicate="dwithin", distance=limit).T:
        depth, place = _depth(track.lines[piece], world.footprints[here[index]], world.radius)
        key = track.leg_of(piece), int(here[index])
        if key not in worst or depth > worst[key][0]:
            worst[key] = depth, place
    for (leg, index), (depth, place) in worst.items():
        owner = world.owners[index]
        verb = f"reaches {depth:.4f} m into" if depth > slack else "touches"
        found.append(track.refusal("footprint", f"the robot {verb} {who(owner)}", place, depth, leg, owner))
        clearance = min(clearance, -depth)
    return clearance


def _depth(line: BaseGeometry, footprint: BaseGeometry, radius: float) -> tuple[float, NDArray[np.float64]]:
    """Return how deep a footprint reaches into the robot that drives along a line, and where."""
    distance = line.distance(footprint)
    within = shapely.segmentize(shapely.intersection(line, footprint), max(line.length / 1000, 0.01))
    rims = shapely.multilinestrings(shapely.get_rings(shapely.get_parts(footprint)))
    places = shapely.get_coordinates(within)
    if distance > 0 or rims.is_empty or not len(places):
        return radius - distance, shapely.get_coordinates(shapely.shortest_line(line, footprint))[0]
    sunk = shapely.distance(shapely.points(places), rims)
    return radius + float(sunk.max()), places[sunk.argmax()]


def check_floor(track: Track, world: World, found: list[Violation]) -> None:
    """Refuse stretches that leave the floor or enter a restricted zone.

    Small gaps count as floor, and so does a small overhang. Of a zone the robot's middle must stay out.
    """
    regions = [shapely.make_valid(region) for storey, region in world.floors if storey == track.storey]
    # on a grid: without one GEOS can lose polygons that differ from others by rounding alone
    floor = shapely.union_all(regions, grid_size=_FLOOR_GRID)
    grown = shapely.buffer(floor, GAP / 2, join_style="mitre")
    floor = shapely.buffer(grown, -GAP / 2, join_style="mitre")
    floor = shapely.buffer(floor, SAME - max(world.radius - GAP, 0.0))
    shapely.prepare(floor)
    for leg, line in zip(track.legs, track.stretches, strict=True):
        if not shapely.covers(floor, line):
            places = shapely.get_coordinates(shapely.difference(line, floor))
            off = np.nan_to_num(shapely.distance(shapely.points(places), floor))  # NaN without any floor
            k = off.argmax()
            found.append(track.refusal("off-floor", "the robot leaves the floor", places[k], float(off[k]), leg))
        for storey, zone, owner in world.restricted:
            inner = shapely.buffer(zone, -2 * SAME)
            if storey == track.storey and shapely.intersects(line, inner):
                place = shapely.get_coordinates(shapely.intersection(line, inner))[0]
                text = f"the robot enters the restricted zone {who(owner)}"
                found.append(track.refusal("restricted", text, place, 0.0, leg, owner))
