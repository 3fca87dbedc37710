"""Routes of several robots, and of one under deadlines, by the metaheuristic of PyVRP; its only door.

Wouda, Lan and Kool, PyVRP: a high-performance VRP solver package, INFORMS Journal on Computing, 2024.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyvrp

    from bimnav.plan.orders import Groups

__all__ = ["Robots", "Routing", "route"]

_ITERATIONS = 2000  # a second for a hundred rows; on published cases with groups more gained nothing
_SCALE = 1e6  # of the greatest cost, as whole numbers
_SEED = 0
_MOST_WORTH = 1e6  # of a stop, in longest routes


class Robots(NamedTuple):
    """Who drives.

    Parameters
    ----------
    costs
        For each robot (n, n), from row to column; inf where it has no way.
    starts
        The first row of each.
    ends
        The last row of each; None for any.
    capacities
        How much each can take; None for any amount.
    allowed : (robots, n) bool
        Which rows each can serve; None for all.
    """

    costs: list[NDArray[np.float64]]
    starts: list[int]
    ends: list[int | None]
    capacities: NDArray[np.float64] | None = None
    allowed: NDArray[np.bool_] | None = None


class Routing(NamedTuple):
    """The rows each robot visits, in order, without its start and end; and whether time cut the search short."""

    routes: list[NDArray[np.intp]]
    is_cut_short: bool
    is_feasible: bool


def route(
    robots: Robots,
    ways: Groups,
    *,
    due: NDArray[np.float64] | None = None,
    weight: NDArray[np.float64] | None = None,
    demands: NDArray[np.float64] | None = None,
    longest: float = math.inf,
    iterations: int = _ITERATIONS,
    time_limit: float | None = None,
) -> Routing:
    """Find routes of a low total cost that visit one row of every group.

    Parameters
    ----------
    ways
        Rows of every group.
    due : (groups,)
        The most a route may have cost when it has served a group. With dues, groups may be left out.
    weight : (groups,)
        What serving each is worth, more than any route costs.
    demands : (n,)
        What each row takes of a capacity.
    longest
        The most a route may cost.
    iterations
        Amount of work.
    """
    import pyvrp
    from pyvrp.exceptions import PenaltyBoundWarning
    from pyvrp.stop import MaxIterations, MaxRuntime, MultipleCriteria

    whole = _Whole(robots.costs)
    clients, groups = _clients(ways, whole, due, weight, demands)
    depots, types, matrices = _fleet(robots, whole, longest)
    places = [pyvrp.Location(0, 0) for _ in range(len(matrices[0]))]
    data = pyvrp.ProblemData(places, clients, depots, types, matrices, matrices, groups)
    stop = MaxIterations(iterations)
    limit = MaxRuntime(max(time_limit, 1e-3)) if time_limit is not None else None
    criteria = stop if limit is None else MultipleCriteria([stop, limit])
    with warnings.catch_warnings():  # that limits are hard to keep shows in the result
        warnings.simplefilter("ignore", PenaltyBoundWarning)
        found = pyvrp.solve(data, criteria, seed=_SEED, collect_stats=False, display=False)
    routes = [np.zeros(0, dtype=np.intp) for _ in robots.starts]
    for trip in found.best.routes():
        routes[trip.vehicle_type()] = np.array([clients[a.idx].location for a in trip if a.is_client()], dtype=np.intp)
    return Routing(
        routes, found.num_iterations < iterations, found.is_feasible() and found.best.distance() < whole.never
    )


def _clients(
    ways: Groups,
    whole: _Whole,
    due: NDArray[np.float64] | None,
    weight: NDArray[np.float64] | None,
    demands: NDArray[np.float64] | None,
) -> tuple[list[pyvrp.Client], list[pyvrp.ClientGroup]]:
    """Make a client of every row, and a group of the rows of which one is enough."""
    import pyvrp

    is_optional = due is not None
    prize = np.ones(len(ways)) if weight is None else weight
    clients: list[pyvrp.Client] = []
    groups: list[pyvrp.ClientGroup] = []
    for g, way in enumerate(ways):
        members = range(len(clients), len(clients) + len(way))
        alternatives = len(way) > 1
        for row in way.tolist():
            options: dict[str, Any] = {"required": not (alternatives or is_optional)}
            if alternatives:
                options["group"] = len(groups)
            if due is not None:
                options["prize"] = int(min(prize[g], _MOST_WORTH)) * whole.never
                if math.isfinite(due[g]):
                    options["tw_late"] = max(whole.floor(due[g]), 0)
            if demands is not None:
                options["delivery"] = [round(demands[row] * _SCALE)]
            clients.append(pyvrp.Client(row, **options))
        if alternatives:
            groups.append(pyvrp.ClientGroup(list(members), required=not is_optional))
    return clients, groups


def _fleet(
    robots: Robots, whole: _Whole, longest: float
) -> tuple[list[pyvrp.Depot], list[pyvrp.VehicleType], list[Any]]:
    """Make of every robot its two depots, its kind of vehicle, and its costs with a last row for any end."""
    import pyvrp

    n = len(robots.costs[0])
    depots: list[pyvrp.Depot] = []
    types: list[pyvrp.VehicleType] = []
    matrices: list[Any] = []
    for k, (start, end) in enumerate(zip(robots.starts, robots.ends, strict=True)):
        matrix = np.zeros((n + 1, n + 1), dtype=np.int64)  # to the last row it costs nothing: any end
        matrix[:n, :n] = whole.ceil(robots.costs[k])
        if robots.allowed is not None:
            matrix[:n, :n][:, ~robots.allowed[k] & (np.arange(n) != start)] = whole.never
        np.fill_diagonal(matrix, 0)
        matrices.append(matrix)
        depots += [pyvrp.Depot(start), pyvrp.Depot(n if end is None else end)]
        limits: dict[str, Any] = {}
        if robots.capacities is not None:
            limits["capacity"] = [math.floor(robots.capacities[k] * _SCALE)]
        if math.isfinite(longest):
            limits["shift_duration"] = whole.floor(longest)
        types.append(pyvrp.VehicleType(1, start_depot=2 * k, end_depot=2 * k + 1, profile=k, **limits))
    return depots, types, matrices


class _Whole:
    """Costs as whole numbers: as they are if they are whole, else as parts of the greatest."""

    def __init__(self, costs: list[NDArray[np.float64]]) -> None:
        known = np.concatenate([cost[np.isfinite(cost)] for cost in costs])
        most = float(known.max(initial=0.0)) or 1.0
        self.unit = 1.0 if (known == np.rint(known)).all() and most <= _SCALE else most / _SCALE
        self.never = int(4 * len(costs[0]) * math.ceil(most / self.unit))  # more than any route

    def ceil(self, cost: NDArray[np.float64]) -> NDArray[np.int64]:
        finite = np.isfinite(cost)
        rounded = np.ceil(np.where(finite, cost, 0.0) / self.unit - 1e-6)
        return np.where(finite, rounded, self.never).astype(np.int64)

    def floor(self, value: float) -> int:
        return math.floor(value / self.unit + 1e-6)
