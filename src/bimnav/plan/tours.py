"""The order of stops, and the tour over them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._kept import Kept
from bimnav._why import why_unreachable
from bimnav.errors import InputError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan.charging import Charge, find_chargers, with_charging
from bimnav.plan.legs import legs_between, seconds_at
from bimnav.plan.orders import gap_of, order_stops
from bimnav.plan.paths import (
    Algorithm,
    Path,
    Smooth,
    check_smooth,
    distance_matrix,
    find_path,
    free_index,
    smooth_path,
)
from bimnav.robot import Robot
from bimnav.smooth import turns_of
from bimnav.stops import Stand, Stop, Unreached, given_up

__all__ = ["Tour", "find_chargers", "near_stands", "plan_tour", "tour_over", "why_unreached"]

Point: TypeAlias = tuple[float, float, float]

_SAME_POINT = 1e-9  # metres
_FARTHER = 0.5  # metres from its target that a place may be beyond the nearest, if it shortens the tour
_ROUNDING = 1e-9  # relative


@dataclass(frozen=True, eq=False)
class Tour(Kept):
    """Stops in the order of visiting, and the way from each to the next.

    Parameters
    ----------
    start
        Cell in which the tour begins.
    start_point
        World point at which it begins, metres.
    stops
        In the order of visiting.
    legs
        Leg k ends in the cell of stop k; one more leads back if the tour returns, or to its end.
    unreached
        What cannot be served, and why.
    is_optimal
        Whether no order of these stops that keeps priorities and deadlines costs less: proved, not hoped.
    lower_bound
        No such order costs less than this: metres, or seconds or joules if that is what the graph's
        paths make least. It is that of the paths over cells, also where legs were drawn straight.
    return_to_start
        Whether the tour ends where it begins.
    end
        Cell in which the tour ends, behind its last stop; None if it ends there, or at the start.
    end_at
        World point in that cell at which it ends, metres; None for the middle.
    charges
        Visits to chargers, which are among the stops, and what they cost.
    """

    graph: NavGraph
    start: Cell
    start_point: Point
    stops: tuple[Stop, ...]
    legs: tuple[Path, ...]
    unreached: tuple[Unreached, ...]
    is_optimal: bool
    lower_bound: float
    return_to_start: bool = False
    end: Cell | None = None
    end_at: Point | None = None
    charges: tuple[Charge, ...] = ()

    def __repr__(self) -> str:
        return f"Tour({len(self.stops)} stops, {len(self.unreached)} unreached, {self.length:.3f} m)"

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        from bimnav._cards import card, plan_svg

        environment, storey = self.graph.environment, self.start.storey
        areas: list[Any] = []
        if environment is not None:
            areas += [(region.polygon, "#e6e0d5") for region in environment.regions if region.storey == storey]
            areas += [(obstacle.footprint, "#6b6459") for obstacle in environment.obstacles_on(storey)]
        level = self.graph.frame.elevations[storey]
        lines = [(leg, "#0072b2") for leg in self.route if len(leg) > 1 and (abs(leg[:, 2] - level) < 1e-6).all()]
        best = {"distance": "shortest", "time": "fastest", "energy": "thriftiest"}[self.graph.objective]
        proved = f"proved {best}" if self.is_optimal else f"at most {self.gap:.1%} above the {best}"
        rows = [
            ("length", f"{self.length:.2f} m, {proved}"),
            ("stops", ", ".join(stop.name for stop in self.stops)),
            ("not reached", ", ".join(f"{lost.name}: {lost.reason}" for lost in self.unreached)),
            ("charging", ", ".join(f"{c.name}: {c.energy_wh:.1f} Wh" for c in self.charges)),
        ]
        return card(f"Tour of {len(self.stops)} stops", rows, plan_svg(areas, lines))

    @cached_property
    def length(self) -> float:
        """Of all legs, metres: along cells, or along straight legs where they were drawn."""
        return math.fsum(leg.length for leg in self.legs)

    @cached_property
    def cost(self) -> float:
        """Of all legs, what the graph's paths make least: metres, seconds or joules, times multipliers."""
        return math.fsum(leg.cost for leg in self.legs)

    @property
    def gap(self) -> float:
        """How much the tour costs beyond the lower bound, as a fraction of it, whatever the objective; 0 if proved."""
        return 0.0 if self.is_optimal else gap_of(self.cost, self.lower_bound)

    @property
    def end_point(self) -> Point:
        """World point at which the tour ends, metres."""
        if self.end is not None:
            return self.graph.frame.center_of(self.end) if self.end_at is None else self.end_at
        if self.return_to_start or not self.stops:
            return self.start_point
        return self.stops[-1].end

    @cached_property
    def route(self) -> tuple[NDArray[np.float64], ...]:
        """What the robot drives: for each leg an (n, 3) polyline in metres, from exact point to exact point.

        It passes the middles of the cells where it turns, or goes along straight legs. A cell that is
        reached although it is blocked is entered straight to its stop, and left likewise.
        """
        ends = [stop.end for stop in self.stops]
        blocked = [stop.approach == "reach" for stop in self.stops]
        if len(self.legs) > len(self.stops):
            ends.append(self.end_point)
            blocked.append(False)
        begins = [self.start_point, *ends]
        return tuple(
            _polyline(leg, begins[k], ends[k], skip_first=k > 0 and blocked[k - 1], skip_last=blocked[k])
            for k, leg in enumerate(self.legs)
        )


def plan_tour(
    graph: NavGraph,
    start: Cell,
    stops: Iterable[Stop] | None = None,
    *,
    algorithm: Algorithm = "auto",
    smooth: Smooth | None = None,
    return_to_start: bool = False,
    end: Cell | None = None,
    start_point: Point | None = None,
    end_point: Point | None = None,
    robot: Robot | None = None,
    chargers: Iterable[Stop] | None = None,
) -> Tour:
    """Plan a cheap tour over stops.

    Of a stop that can be served from several places the best for the tour is taken, none more than half a
    metre farther from its target than the nearest. Stops of higher priority are served first. Where stops
    are due, the order is one that takes little time, on the graph's cheapest paths and in service; those that
    cannot be done in time are left out, those of low priority first.

    Parameters
    ----------
    graph
        Graph to search.
    start
        Cell in which the robot is.
    stops
        What to visit; None for every target of the graph. Several may share a cell.
    algorithm
        As in `find_path`, for the legs.
    smooth
        `any_angle` draws the legs straight, from exact point to exact point; their order stays that of the
        paths over cells.
    return_to_start
        Whether to come back in the end.
    end
        Cell in which the tour ends; None for any.
    start_point, end_point
        World points at which the robot is, and at which the tour ends, in metres; the middles of their cells if
        not given.
    robot
        Its speed says what can be done when, its battery how far it gets. The default is the one the
        environment was made for.
    chargers
        Where it can fill its battery; None for the docks of the task. The battery is full at the start, and a
        tenth of it is kept in reserve.

    Returns
    -------
    tour
        All stops that can be reached; the others are in `tour.unreached`, with the reason.

    Raises
    ------
    OutsideMapError, StartBlockedError, GoalBlockedError
        If start or end lies outside the map or is blocked.
    NoPathError
        If no path leads from the start to the end.
    InputError
        If the tour should both end elsewhere and return, or has a point to end at and no cell.
    """
    return tour_over(
        graph,
        start,
        stops,
        algorithm=algorithm,
        smooth=smooth,
        return_to_start=return_to_start,
        end=end,
        start_point=start_point,
        end_point=end_point,
        robot=robot,
        chargers=chargers,
    )


def tour_over(
    graph: NavGraph,
    start: Cell,
    stops: Iterable[Stop] | None = None,
    *,
    algorithm: Algorithm = "auto",
    smooth: Smooth | None = None,
    return_to_start: bool = False,
    end: Cell | None = None,
    start_point: Point | None = None,
    end_point: Point | None = None,
    robot: Robot | None = None,
    chargers: Iterable[Stop] | None = None,
    is_timed: bool = False,
) -> Tour:
    """Plan a tour as `plan_tour` does.

    Parameters
    ----------
    is_timed
        Whether the order is to take little time although nothing is due.
    """
    _checks.need("graph", graph, NavGraph)
    _checks.need("robot", robot, Robot, or_none=True)
    stops = None if stops is None else _checks.many("stops", stops, Stop)
    chargers = None if chargers is None else _checks.many("chargers", chargers, Stop)
    check_smooth(smooth)
    free_index(graph, start, "start")
    start_point = None if start_point is None else _checks.point("start_point", start_point)
    end_point = None if end_point is None else _checks.point("end_point", end_point)
    if end is None and end_point is not None:
        raise InputError("a tour has an end_point and no end.", "Give its cell, too: graph.frame.cell_at(x, y).")
    start = Cell(*_checks.cell("start", start))
    if end is not None:
        end = Cell(*_checks.cell("end", end))
        if return_to_start and end != start:
            raise InputError("a tour cannot both end elsewhere and return.", "Give end or return_to_start, not both.")
        free_index(graph, end, "goal")
        if graph.components[end] != graph.components[start]:
            find_path(graph, start, end)  # says why there is no way
    robot = robot or (Robot() if graph.environment is None else graph.environment.robot)
    unreached: list[Unreached] = []
    if stops is None:
        stops, lost_targets = graph.stops_from(start)
        unreached += lost_targets
    found: dict[tuple[Any, ...], list[Stop]] = {}  # stops with the same places are visited together
    for stop in stops:
        places = tuple(stand for stand in near_stands(stop) if not why_unreached(graph, start, stand.cell))
        if not places:
            unreached.append(given_up(stop, why_unreached(graph, start, stop.cell)))
        else:
            cells = tuple(stand.cell for stand in places)
            due = math.inf if stop.due is None else stop.due
            found.setdefault((cells, stop.priority, due), []).append(stop)
    unreached = explained(graph, start, unreached)
    ordered = _ordered(graph, start, end, list(found.items()), robot, return_to_start, is_timed)
    for stop in ordered.late:
        reason = f"it cannot be done within {stop.due:g} s of the start"
        unreached.append(given_up(stop, reason))
    point = graph.frame.center_of(start) if start_point is None else start_point
    planned = Tour(
        graph,
        start,
        point,
        ordered.visits,
        (),
        tuple(unreached),
        ordered.is_optimal,
        ordered.bound,
        return_to_start,
        end,
        end_point,
    )
    return _driven(planned, robot, chargers, algorithm, smooth)


def _driven(
    tour: Tour, robot: Robot, chargers: Iterable[Stop] | None, algorithm: Algorithm, smooth: Smooth | None
) -> Tour:
    """Return a tour with visits to chargers where the battery needs them, and with its legs."""
    graph, start, visits = tour.graph, tour.start, tour.stops
    goal = start if tour.return_to_start else tour.end
    unreached, charges = list(tour.unreached), tour.charges
    if math.isfinite(robot.battery_wh):
        known = find_chargers(graph, start) if chargers is None else tuple(chargers)
        visits, charges, flat = with_charging(graph, start, goal, visits, robot, known)
        for stop in flat:
            reason = f"the battery of {robot.battery_wh:g} Wh does not last, and no charger is near enough"
            unreached.append(given_up(stop, reason))
    cells = [start, *(stop.cell for stop in visits)]
    if goal is not None and (visits or tour.end is not None):
        cells.append(goal)
    legs = tuple(find_path(graph, a, b, algorithm=algorithm) for a, b in pairwise(cells))
    if smooth:
        ends = [tour.start_point, *(None if stop.approach == "reach" else stop.end for stop in visits), tour.end_at]
        legs = tuple(smooth_path(leg, ends[k], ends[k + 1]) for k, leg in enumerate(legs))
    is_optimal = tour.is_optimal and not charges
    return replace(tour, stops=visits, legs=legs, unreached=tuple(unreached), is_optimal=is_optimal, charges=charges)


class _Ordered(NamedTuple):
    visits: tuple[Stop, ...]
    late: tuple[Stop, ...]
    bound: float
    is_optimal: bool


def near_stands(stop: Stop) -> list[Stand]:
    """Return the places from which a stop is served that are hardly farther from it than the nearest."""
    nearest = min(stand.distance for stand in stop.candidates)
    return [stand for stand in stop.candidates if stand.distance <= nearest + _FARTHER]


def _ordered(
    graph: NavGraph,
    start: Cell,
    end: Cell | None,
    found: Sequence[tuple[tuple[Any, ...], list[Stop]]],
    robot: Robot,
    return_to_start: bool,
    is_timed: bool,
) -> _Ordered:
    """Order stops, given by the cells they can be served from, their priority and when they are due.

    Parameters
    ----------
    is_timed
        Whether to make time least although nothing is due.
    """
    cells = [start] if end is None else [start, end]
    group = list(range(len(cells)))
    columns: list[tuple[float, float, float]] = [(0.0, math.inf, 0.0)] * len(cells)
    for number, ((places, priority, due), stops) in enumerate(found, len(cells)):
        cells += places
        group += [number] * len(places)
        columns += [(priority, due, sum(seconds_at(graph, stop) for stop in stops))] * len(places)
    priority, due, service = np.array(columns).T
    cost = distance_matrix(graph, cells)
    is_timed = is_timed or bool(np.isfinite(due).any())
    spent = legs_between(graph, cells, cost, robot).seconds if is_timed else cost
    order = order_stops(
        spent,
        end=None if end is None else 1,
        return_to_start=return_to_start,
        groups=group,
        priority=priority,
        due=due,
        service=service if is_timed else None,
    )
    first = 1 if end is None else 2
    visited = [row for row in order.order if row >= first]
    visits = []
    for row in visited:
        for stop in found[group[row] - first][1]:
            stand = next(stand for stand in stop.candidates if stand.cell == cells[row])
            visits.append(stop.at(stand))
    late = tuple(stop for row in order.left_out for stop in found[group[row] - first][1])
    if not is_timed:
        return _Ordered(tuple(visits), late, order.bound, order.is_optimal)
    apart = np.isfinite(spent) & (spent > 0)
    rate = (cost[apart] / spent[apart]).tolist() or [1.0]
    if max(rate) - min(rate) <= _ROUNDING * max(rate):  # what takes least time costs least
        bound = max(order.bound - math.fsum(service[visited]), 0.0) * min(rate)
        return _Ordered(tuple(visits), late, bound, order.is_optimal)
    done = {group[row] for row in visited}
    rows = [row for row in range(len(cells)) if row < first or group[row] in done]
    bound = order_stops(
        cost[np.ix_(rows, rows)],
        end=None if end is None else 1,
        return_to_start=return_to_start,
        groups=np.array(group)[rows],
    ).bound
    along = [*order.order, *([0] if return_to_start else [])]
    is_optimal = math.fsum(cost[along[:-1], along[1:]].tolist()) <= bound * (1 + _ROUNDING)
    return _Ordered(tuple(visits), late, bound, is_optimal)


def explained(graph: NavGraph, start: Cell, unreached: Iterable[Unreached]) -> list[Unreached]:
    """Add to what lies in another part of a building why no way leads there; asked once for each part."""
    known: dict[int, str] = {}
    found = []
    for lost in unreached:
        part = int(graph.components[lost.cell]) if lost.cell is not None and lost.cell in graph.frame else 0
        if lost.cell is not None and part not in (0, graph.components[start]) and graph.environment is not None:
            if part not in known:
                why = why_unreachable(graph, start, lost.cell)
                known[part] = f": {why.message}" if why else ""
            lost = replace(lost, reason=lost.reason + known[part])
        found.append(lost)
    return found


def why_unreached(graph: NavGraph, start: Cell, cell: Cell) -> str:
    """Say why a cell cannot be reached from a start; nothing if it can."""
    if cell not in graph.frame:
        return "its cell lies outside the map"
    if not graph.free[cell]:
        return "its cell is blocked"
    if graph.components[cell] != graph.components[start]:
        where = "on another storey" if cell.storey != start.storey else "in another part of the building"
        return f"no path from the start: it lies {where}"
    return ""


def _polyline(
    leg: Path,
    begin: Point,
    end: Point,
    *,
    skip_first: bool,
    skip_last: bool,
) -> NDArray[np.float64]:
    parts: list[NDArray[np.float64]] = [np.array([begin])]
    if leg.legs is not None:
        parts.append(leg.legs[skip_first : len(leg.legs) - skip_last])
    else:
        first, last = (int(skip_first), len(leg.indices) - skip_last) if len(leg.indices) > 1 else (0, 0)
        for k, link in leg.rides:
            parts.append(_turns(leg, first, k + 1))
            parts.append(link.points_from(Cell(*leg.indices[k].tolist()))[1:-1])
            first = k + 1
        parts.append(_turns(leg, first, last))
    points: NDArray[np.float64] = np.vstack([*parts, np.array([end])])
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > _SAME_POINT
    points = points[np.concatenate([[True], moved])]
    points[-1] = end
    points.flags.writeable = False
    return points


def _turns(leg: Path, first: int, last: int) -> NDArray[np.float64]:
    """Return the middles of the cells between two numbers where a leg begins, turns and ends, (n, 3) metres."""
    return leg.graph.frame.centers_of(turns_of(leg.indices[first:last]))
