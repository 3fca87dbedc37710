"""Tours of several robots that share the work."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from bimnav import _checks
from bimnav.errors import InputError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan.assignment import Objective, assign_stops
from bimnav.plan.legs import legs_between, seconds_along, seconds_at
from bimnav.plan.paths import Algorithm, distance_matrix, free_index
from bimnav.plan.tours import Tour, explained, near_stands, tour_over, why_unreached
from bimnav.robot import Robot
from bimnav.stops import Stand, Stop, Unreached, given_up

__all__ = ["TeamPlan", "plan_tours"]

_ROUNDING = 1e-9  # relative


@dataclass(frozen=True, slots=True, eq=False)
class TeamPlan:
    """What each of several robots does.

    The robots know nothing of each other on the way.

    Parameters
    ----------
    robots, tours
        One tour for each robot.
    objective
        What was made least: `total`, what the ways of all cost, or `makespan`, the seconds of the one that
        takes longest.
    lower_bound
        No assignment of these stops needs less: seconds for `makespan`; for `total` metres, or seconds or
        joules if that is what the graph's paths make least.
    is_optimal
        Whether no assignment needs less: proved, not hoped.
    unreached
        What no robot can serve, and why.
    """

    robots: tuple[Robot, ...]
    tours: tuple[Tour, ...]
    objective: Objective
    lower_bound: float
    is_optimal: bool
    unreached: tuple[Unreached, ...]

    def __repr__(self) -> str:
        counts = ", ".join(f"{r.name} {len(t.stops)}" for r, t in zip(self.robots, self.tours, strict=True))
        return f"TeamPlan({counts} stops, {len(self.unreached)} unreached, {self.length:.3f} m)"

    def _repr_html_(self) -> str:
        """Return a card for a notebook; the plan shows the storey on which the first robot starts."""
        from bimnav._cards import ROBOTS, card, plan_svg

        graph, storey = self.tours[0].graph, self.tours[0].start.storey
        environment, level = graph.environment, graph.frame.elevations[storey]
        areas: list[tuple[Any, str]] = []
        if environment is not None:
            areas += [(region.polygon, "#e6e0d5") for region in environment.regions if region.storey == storey]
            areas += [(obstacle.footprint, "#6b6459") for obstacle in environment.obstacles_on(storey)]
        lines = [
            (leg, ROBOTS[k % len(ROBOTS)])
            for k, tour in enumerate(self.tours)
            for leg in tour.route
            if len(leg) > 1 and (abs(leg[:, 2] - level) < 1e-6).all()
        ]
        proved = "proved best" if self.is_optimal else f"at least {self.lower_bound:.1f} is needed"
        rows = [
            (robot.name, f"{len(tour.stops)} stops, {tour.length:.2f} m")
            for robot, tour in zip(self.robots, self.tours, strict=True)
        ]
        rows += [
            ("objective", f"{self.objective}, {proved}"),
            ("not reached", ", ".join(f"{lost.name}: {lost.reason}" for lost in self.unreached)),
        ]
        return card(f"Plan of {len(self.robots)} robots", rows, plan_svg(areas, lines))

    @property
    def length(self) -> float:
        """Of all tours, metres."""
        return math.fsum(tour.length for tour in self.tours)


def plan_tours(
    graph: NavGraph,
    starts: Sequence[Cell],
    stops: Iterable[Stop] | None = None,
    *,
    robots: Sequence[Robot] | None = None,
    objective: Objective = "makespan",
    return_to_start: bool = False,
    start_points: Sequence[tuple[float, float, float]] | None = None,
    chargers: Iterable[Stop] | None = None,
    algorithm: Algorithm = "auto",
) -> TeamPlan:
    """Share stops out among robots and plan each one's tour.

    Up to 12 stops the shares are proved best; see `assign_stops`.

    Parameters
    ----------
    graph
        Graph to search. It was cut for one body; robots must not be larger.
    starts
        Cell in which each robot is.
    stops
        What to visit; None for every target of the graph.
    robots
        Their names, speeds, batteries and abilities; None for as many as the environment was made for, with
        numbered names. A stop is served by a robot that has all abilities it asks for.
    objective
        What to make least: `makespan`, the seconds until all are done, service included, or `total`, what
        the ways of all cost: metres, or seconds or joules if that is what the graph's paths make least.
    return_to_start, chargers, algorithm
        As in `plan_tour`.
    start_points
        World point of each robot, metres; the middle of its cell if not given.

    Raises
    ------
    OutsideMapError, StartBlockedError
        If a start lies outside the map or is blocked.
    """
    _checks.need("graph", graph, NavGraph)
    starts = _checks.many("starts", starts)
    stops = None if stops is None else _checks.many("stops", stops, Stop)
    chargers = None if chargers is None else _checks.many("chargers", chargers, Stop)
    for start in starts:
        free_index(graph, start, "start")
    starts = [Cell(*_checks.cell("start", start)) for start in starts]
    if robots is None:
        one = Robot() if graph.environment is None else graph.environment.robot
        robots = [replace(one, name=f"R{k + 1}") for k in range(len(starts))]
    robots = _checks.many("robots", robots, Robot)
    if len(robots) != len(starts):
        raise InputError(f"there are {len(robots)} robots and {len(starts)} starts.", "Give one start for each robot.")
    points = [None] * len(starts) if start_points is None else _checks.many("start_points", start_points)
    if len(points) != len(starts):
        raise InputError(
            f"there are {len(points)} start_points and {len(starts)} starts.", "Give one point for each start."
        )
    unreached: list[Unreached] = []
    if stops is None:
        stops, lost = _stops_from(graph, starts)
        unreached += lost
    work, lost = _work_of(graph, starts, stops, robots)
    unreached += lost
    cells = [*starts, *(stand.cell for _, stand in work.stands)]
    cost = distance_matrix(graph, cells)
    service = np.array([0.0] * len(starts) + [seconds_at(graph, stop) for stop, _ in work.stands])
    costs = [
        cost if objective == "total" else legs_between(graph, cells, cost, robot).seconds + service for robot in robots
    ]
    shares = assign_stops(
        costs,
        range(len(starts)),
        return_to_start=return_to_start,
        groups=work.groups,
        allowed=np.array(work.allowed),
        objective=objective,
    )
    tours = []
    for k, (robot, route) in enumerate(zip(robots, shares.routes, strict=True)):
        own = [work.stands[row - len(starts)][0] for row in route[1:]]
        tours.append(
            tour_over(
                graph,
                starts[k],
                own,
                algorithm=algorithm,
                return_to_start=return_to_start,
                start_point=points[k],
                robot=robot,
                chargers=chargers,
                is_timed=objective == "makespan",
            )
        )
    unreached += [lost for tour in tours for lost in tour.unreached]
    needed = [_needed(tour, robot, objective) for tour, robot in zip(tours, robots, strict=True)]
    reached = math.fsum(needed) if objective == "total" else max(needed)
    is_optimal = shares.is_optimal and reached <= shares.bound * (1 + _ROUNDING)  # priorities, dues, charging
    return TeamPlan(tuple(robots), tuple(tours), objective, shares.bound, is_optimal, tuple(unreached))


def _needed(tour: Tour, robot: Robot, objective: Objective) -> float:
    """Return what a tour costs, or for `makespan` how long it takes with service, seconds."""
    if objective == "total":
        return tour.cost
    driven = math.fsum(seconds_along(leg, robot) for leg in tour.legs)
    return driven + math.fsum(seconds_at(tour.graph, stop) for stop in tour.stops)


class _Work(NamedTuple):
    """Places to serve stops from, and who can; a row for each start goes before those of the places."""

    stands: list[tuple[Stop, Stand]]
    groups: list[int]  # of every row; places of one stop are alternatives
    allowed: list[list[bool]]  # for each robot and row


def _work_of(
    graph: NavGraph, starts: Sequence[Cell], stops: Iterable[Stop], robots: Sequence[Robot]
) -> tuple[_Work, list[Unreached]]:
    """Return which robots can serve each stop and where, and the stops that none of them can."""
    work = _Work([], [-1 - k for k in range(len(starts))], [[True] * len(starts) for _ in starts])
    unreached: list[Unreached] = []
    for number, stop in enumerate(stops):
        able = [set(stop.abilities) <= set(robot.abilities) for robot in robots]
        served = [
            (stand, [a and not why_unreached(graph, start, stand.cell) for a, start in zip(able, starts, strict=True)])
            for stand in near_stands(stop)
        ]
        served = [(stand, by) for stand, by in served if any(by)]
        if not served:
            lacking = f"no robot has the abilities {', '.join(stop.abilities)}"
            near = starts[able.index(True)] if any(able) else None
            reason = lacking if near is None else why_unreached(graph, near, stop.cell)
            left = given_up(stop, reason)
            unreached += [left] if near is None else explained(graph, near, [left])
        for stand, by in served:
            work.stands.append((stop, stand))
            work.groups.append(number)
            for k, may in enumerate(by):
                work.allowed[k].append(may)
    return work, unreached


def _stops_from(graph: NavGraph, starts: Sequence[Cell]) -> tuple[tuple[Stop, ...], list[Unreached]]:
    """Return where robots serve the targets, from whichever start they come, and what none of them can serve."""
    found: dict[str, Stop] = {}
    lost: dict[str, Unreached] = {}
    for start in {int(graph.components[start]): start for start in reversed(starts)}.values():
        stops, missing = graph.stops_from(start)
        for stop in stops:
            known = found.get(stop.global_id, stop)
            found[stop.global_id] = replace(known, candidates=tuple(dict.fromkeys(known.candidates + stop.candidates)))
        for left in explained(graph, start, missing):
            lost[left.global_id] = left
    order = [target.global_id for target, _ in graph.targets]
    return (
        tuple(found[global_id] for global_id in order if global_id in found),
        [lost[global_id] for global_id in order if global_id in lost and global_id not in found],
    )
