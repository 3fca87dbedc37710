"""Lines that robots drive: the legs of a tour, and ways found while the simulation runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.errors import SimulationError
from bimnav.grid import Cell, GridFrame
from bimnav.plan import find_path

if TYPE_CHECKING:
    from bimnav.graph import NavGraph
    from bimnav.plan import Tour

__all__ = ["JOINED", "Legs", "Line", "cell_near", "end_of", "legs_of", "way_between"]

JOINED = 1e-6  # metres between the end of one leg and the start of the next


@dataclass(frozen=True, eq=False)
class Line:
    """A line to drive.

    Parameters
    ----------
    points : (n, 3) float64, metres
    storeys : (n,) int32, indexes of storeys
    """

    points: NDArray[np.float64]
    storeys: NDArray[np.int32]

    @cached_property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """The legs of a tour, one after another in one table.

    Parameters
    ----------
    points : (n, 3) float64, metres
    storeys : (n,) int32, indexes of storeys
    edges : (legs + 1,) int64
        Rows at which legs begin, and n.
    """

    points: NDArray[np.float64]
    storeys: NDArray[np.int32]
    edges: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.edges) - 1

    def line(self, index: int) -> Line:
        """Return one leg as a line."""
        rows = slice(int(self.edges[index]), int(self.edges[index + 1]))
        return Line(self.points[rows], self.storeys[rows])

    def reached(self) -> NDArray[np.float64]:
        """Return how far every point is from the begin of its leg, (n,) metres."""
        reached = np.zeros(len(self.points))
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        sizes = np.diff(self.edges)
        for size in np.unique(sizes).tolist():
            rows = self.edges[:-1][sizes == size, None] + np.arange(size - 1)
            reached[rows + 1] = steps[rows].cumsum(axis=1)
        return reached


def legs_of(tour: Tour) -> Legs:
    """Return the route as legs that begin where the last one ended and end where the stop says.

    Raises
    ------
    SimulationError
        If they do not.
    """
    ends = [stop.end for stop in tour.stops]
    storeys = [stop.cell.storey for stop in tour.stops]
    if len(tour.route) > len(ends):
        ends.append(end_of(tour)[1])
        storeys.append(end_of(tour)[0].storey)
    if len(tour.route) != len(ends):
        raise SimulationError(f"a tour of {len(tour.stops)} stops has {len(tour.route)} legs.")
    lines = [np.asarray(polyline, dtype=np.float64) for polyline in tour.route]
    for k, leg in enumerate(lines):
        if leg.ndim != 2 or leg.shape[1] != 3 or not len(leg):
            raise SimulationError(f"leg {k} of the tour is no polyline of finite points.", "", {"leg": k})
    if not lines:
        return Legs(np.empty((0, 3)), np.empty(0, dtype=np.int32), np.zeros(1, dtype=np.int64))
    edges = np.cumsum([0, *map(len, lines)])
    every = np.concatenate(lines)
    wrong = np.flatnonzero(~np.isfinite(every).all(axis=1))
    if len(wrong):
        k = int(np.searchsorted(edges, wrong[0], side="right")) - 1
        raise SimulationError(f"leg {k} of the tour is no polyline of finite points.", "", {"leg": k})
    _check_gaps(every[edges[:-1]], every[edges[1:] - 1], np.array([tour.start_point, *ends], dtype=np.float64))
    floor = tour.start.storey
    if set(storeys) == {floor} and (np.abs(every[:, 2] - tour.graph.frame.elevations[floor]) <= JOINED).all():
        return Legs(every, np.full(len(every), floor, dtype=np.int32), edges)
    on = [
        _storeys_along(leg, tour.graph.frame, before, after)
        for leg, (before, after) in zip(lines, pairwise([floor, *storeys]), strict=True)
    ]
    return Legs(every, np.concatenate(on), edges)


def _check_gaps(begins: NDArray[np.float64], ends: NDArray[np.float64], places: NDArray[np.float64]) -> None:
    """Refuse legs that do not lead from each place to the next."""
    before, after = (np.linalg.norm(gap, axis=1) for gap in (begins - places[:-1], ends - places[1:]))
    for k in np.flatnonzero(~(np.maximum(before, after) <= JOINED))[:1].tolist():
        raise SimulationError(
            f"leg {k} of the tour begins {before[k]:.6g} m from where the robot is "
            f"and ends {after[k]:.6g} m from where it should stop.",
            "A route is one unbroken line through the ends of its stops.",
            {"leg": k},
        )


def end_of(tour: Tour) -> tuple[Cell, tuple[float, float, float]]:
    """Return the cell and the world point to which a tour leads behind its last stop."""
    end = getattr(tour, "end", None)
    if end is None:
        return tour.start, tour.start_point
    at = getattr(tour, "end_at", None)
    return end, tour.graph.frame.center_of(end) if at is None else at


def _storeys_along(leg: NDArray[np.float64], frame: GridFrame, before: int, after: int) -> NDArray[np.int32]:
    """Return the storey of every point: the one it comes from or goes to at their heights, else the one below."""
    height = leg[:, 2]
    if before == after and (np.abs(height - frame.elevations[before]) <= JOINED).all():
        return np.full(len(leg), before, dtype=np.int32)
    heights, index = np.unique(height, return_inverse=True)
    storeys = np.array([frame.storey_at(z) for z in heights.tolist()], dtype=np.int32)
    for storey in (after, before):
        storeys[np.abs(heights - frame.elevations[storey]) <= JOINED] = storey
    return storeys[index]


def cell_near(graph: NavGraph, point: tuple[float, float, float], storey: int) -> Cell | None:
    """Return a free cell whose middle a robot reaches straight from a point: its own, else the nearest around."""
    own = graph.frame.cell_at(point[0], point[1], storey=storey)
    if graph.free[own]:
        return own
    around = [Cell(storey, own.row + i, own.col + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    free = [cell for cell in around if cell in graph.frame and graph.free[cell]]
    environment = graph.environment
    for cell in sorted(free, key=lambda cell: (math.dist(graph.frame.center_of(cell)[:2], point[:2]), cell)):
        if environment is None or environment.is_clear(storey, point, graph.frame.center_of(cell)):
            return cell
    return None


def way_between(
    graph: NavGraph,
    point: tuple[float, float, float],
    begin: Cell,
    goal: Cell,
    end: tuple[float, float, float],
    *,
    straight_in: bool = False,
) -> Line:
    """Find a way from an exact point in or beside a cell to an exact point in another.

    Parameters
    ----------
    straight_in
        Whether the goal's own middle is left out, because the cell is blocked.

    Raises
    ------
    NoPathError
        If there is none.
    """
    path = find_path(graph, begin, goal)
    middles = path.waypoints
    if straight_in and len(path.indices) > 1:
        middles = np.vstack([middles[:-1], graph.frame.centers_of(path.indices[-2])])
    points = np.vstack([point, middles, end])
    storeys = _storeys_along(points, graph.frame, begin.storey, goal.storey)
    if begin == goal and math.dist(point, end) <= graph.frame.cell_size * 1.5 and _sees(graph, begin, point, end):
        points, storeys = points[[0, -1]], storeys[[0, -1]]
    moved = np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > JOINED)
    moved[-1] = True
    return Line(points[moved], storeys[moved])


def _sees(graph: NavGraph, cell: Cell, *points: tuple[float, float, float]) -> bool:
    """Tell whether points lie in one cell, so that a straight line between them stays in it."""
    x0, y0, x1, y1 = graph.frame.box_of(cell)
    box = shapely.box(x0 - JOINED, y0 - JOINED, x1 + JOINED, y1 + JOINED)
    return all(box.covers(shapely.Point(point[:2])) for point in points)
