"""How long the ways between cells are, in metres and in seconds, whatever they make least; and the work at stops."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.plan.paths import Path, find_path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bimnav.graph import NavGraph
    from bimnav.grid import Cell
    from bimnav.robot import Robot
    from bimnav.stops import Stop

__all__ = ["Legs", "legs_between", "seconds_along", "seconds_at"]


class Legs(NamedTuple):
    """Of the cheapest paths between cells, from row to column: (n, n) metres, and (n, n) seconds; inf for none."""

    metres: NDArray[np.float64]
    seconds: NDArray[np.float64]


def legs_between(graph: NavGraph, cells: Sequence[Cell], cost: NDArray[np.float64], robot: Robot) -> Legs:
    """Measure the cheapest paths between cells.

    Where floor costs the same everywhere and no connector leads away, lengths follow from costs; else every
    path is looked at.

    Parameters
    ----------
    cost : (n, n)
        As `distance_matrix` returns it for these cells.
    robot
        Whose speed counts.
    """
    if not graph.connectors and not (graph.cost[graph.free] != 1).any():
        metres = cost / graph.unit_cost
        return Legs(metres, metres / robot.speed)
    metres, seconds = np.full(cost.shape, np.inf), np.full(cost.shape, np.inf)
    np.fill_diagonal(metres, 0.0)
    np.fill_diagonal(seconds, 0.0)
    for a, b in np.argwhere(np.isfinite(cost)).tolist():
        if a != b:
            path = find_path(graph, cells[a], cells[b])
            metres[a, b] = path.length
            seconds[a, b] = seconds_along(path, robot)
    return Legs(metres, seconds)


def seconds_along(path: Path, robot: Robot) -> float:
    """Return how long a robot is on a path at its speed, rides included."""
    on_links = sum(link.length for _, link in path.rides)
    rides = sum(path.graph.seconds_over(link, robot) for _, link in path.rides)
    return (path.length - on_links) / robot.speed + rides


def seconds_at(graph: NavGraph, stop: Stop) -> float:
    """Return how long a robot works at a stop: what the stop says, else the task."""
    if stop.service_time is not None:
        return stop.service_time
    return 0.0 if graph.environment is None else graph.environment.task.service_time
