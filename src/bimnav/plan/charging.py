"""Where on its tour a robot charges: its order of stops stays, visits to chargers come in between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.graph import NavGraph
from bimnav.grid import Cell, nearest_cell
from bimnav.plan.legs import legs_between, seconds_at
from bimnav.plan.paths import distance_matrix
from bimnav.robot import Robot
from bimnav.stops import Stop

__all__ = ["RESERVE", "Charge", "Charging", "find_chargers", "plan_charging", "with_charging"]

RESERVE = 0.1  # of the battery, kept for what the plan does not know: turns, starts, waiting

_JOULES = 3600.0  # in a watt hour
_DOCK = 3.0  # metres from a dock at which a robot charges


@dataclass(frozen=True, slots=True)
class Charge:
    """A visit to a charger, and what it costs.

    Parameters
    ----------
    stop
        Its number among the stops of the tour.
    detour
        Metres the visit adds to the tour.
    energy_wh
        What the battery takes, watt hours.
    seconds
        How long that takes.
    """

    global_id: str
    name: str
    stop: int
    detour: float
    energy_wh: float
    seconds: float


class Charging(NamedTuple):
    """Chargers to visit, by the number of stops done before; and how many stops can be done at all."""

    visits: tuple[tuple[int, int], ...]
    charges: tuple[tuple[float, float, float], ...]  # detour, energy in watt hours, seconds; for each visit
    done: int


def plan_charging(
    robot: Robot,
    way: NDArray[np.float64],
    service: Sequence[float],
    there: NDArray[np.float64],
    back: NDArray[np.float64],
) -> Charging:
    """Find the visits to chargers that delay a tour least, its order given.

    A shortest path over the places at which the battery is full: the start, and each charger after each
    stop. Robots charge until full.

    Parameters
    ----------
    way : (n,)
        Metres to each stop from the one before; the last may be a mere end.
    service : (n,)
        Seconds of work at each.
    there : (chargers, n + 1)
        Metres to each charger from the start and from each stop.
    back : (chargers, n + 1)
        Metres from each charger to each stop, the last column unused.

    Returns
    -------
    charging
        `done` is n if all can be done, else the most stops that can.
    """
    n, chargers = len(way), len(there)
    usable = robot.battery_wh * _JOULES * (1 - RESERVE)
    metre = robot.drive_power / robot.speed
    work = np.asarray(service, dtype=np.float64) * robot.work_power
    spent = np.concatenate([[0.0], np.cumsum(way * metre + work)])  # when stop k is done, without any detour
    best = {(0, -1): 0.0}  # (stops done, charger): seconds of detours and charging so far
    came: dict[tuple[int, int], tuple[int, int]] = {}
    finish: tuple[float, tuple[int, int]] | None = None
    furthest = (0, (0, -1))
    rate = robot.charge_power if robot.charge_power > 0 else math.nan

    def out(place: tuple[int, int], stops: int) -> float:
        """Return the joules from a full battery at a place until so many stops are done."""
        done, charger = place
        if stops == done:
            return 0.0
        first = way[done] if charger < 0 else back[charger, done]
        return float(spent[stops] - spent[done] + (first - way[done]) * metre)

    for done in range(n + 1):
        for charger in range(-1, chargers):
            place = (done, charger)
            if place not in best:
                continue
            for stops in range(done, n + 1):
                need = out(place, stops)
                if need > usable:
                    break
                furthest = max(furthest, (stops, place))
                if stops == n:
                    if finish is None or best[place] < finish[0]:
                        finish = (best[place], place)
                    continue
                for other in range(chargers):
                    full = need + (there[other, stops] if stops > done or charger < 0 else math.inf) * metre
                    if not (0 < full <= usable and math.isfinite(back[other, stops])) or math.isnan(rate):
                        continue
                    detour = there[other, stops] + back[other, stops] - way[stops]
                    total = best[place] + detour / robot.speed + full / rate
                    if total < best.get((stops, other), math.inf):
                        best[stops, other] = total
                        came[stops, other] = place
    end, place = (n, finish[1]) if finish else furthest
    visits: list[tuple[int, int]] = []
    charges: list[tuple[float, float, float]] = []
    while place in came:
        stops, charger = place
        place = came[place]
        energy = out(place, stops) + there[charger, stops] * metre
        visits.append((stops, charger))
        charges.append(
            (float(there[charger, stops] + back[charger, stops] - way[stops]), energy / _JOULES, energy / rate)
        )
    return Charging(tuple(visits[::-1]), tuple(charges[::-1]), end)


def find_chargers(graph: NavGraph, start: Cell) -> tuple[Stop, ...]:
    """Return the docks of the task that can be reached from a start, each as a stop on the nearest free cell."""
    environment = graph.environment
    if environment is None:
        return ()
    from bimnav.tasks import match

    reachable = graph.components == graph.components[start]
    chargers = []
    for rule in environment.task.docks:
        for dock, _ in match(rule, environment.building):
            if dock.bounds is None:
                continue
            x, y = dock.bounds[:, :2].mean(axis=0).tolist()
            storey = graph.frame.storey_at(float(dock.bounds[0, 2]))
            near = nearest_cell(graph.frame, reachable[storey], storey, x, y)
            if near is None or near[1] > _DOCK:
                continue
            cell, away = near
            point = graph.frame.center_of(cell)
            destination = (x, y, point[2])
            chargers.append(Stop(dock.global_id, dock.name, cell, destination, point, "standing", away, kind="charger"))
    return tuple(chargers)


def with_charging(
    graph: NavGraph,
    start: Cell,
    goal: Cell | None,
    visits: tuple[Stop, ...],
    robot: Robot,
    chargers: tuple[Stop, ...],
) -> tuple[tuple[Stop, ...], tuple[Charge, ...], tuple[Stop, ...]]:
    """Return the stops with visits to chargers in between, what those cost, and the stops that cannot be done."""
    for count in range(len(visits), -1, -1):  # the most stops after which it still gets where it should end
        cells = [start, *(stop.cell for stop in visits[:count]), *([] if goal is None else [goal])]
        n = len(cells)
        places = [*cells, *(charger.cell for charger in chargers)]
        metres = legs_between(graph, places, distance_matrix(graph, places), robot).metres
        service = [seconds_at(graph, stop) for stop in visits[:count]] + [0.0] * (n - 1 - count)
        back = np.roll(metres[n:, :n], -1, axis=1)  # column k leads to stop k
        found = plan_charging(robot, np.diagonal(metres, 1)[: n - 1], service, metres[:n, n:].T, back)
        if found.done == n - 1:
            break
    along: list[Stop] = []
    charges = []
    planned = dict(zip(found.visits, found.charges, strict=True))
    for done in range(count + 1):
        for (after, which), (detour, energy, seconds) in planned.items():
            if after == done:
                charger = chargers[which]
                charges.append(Charge(charger.global_id, charger.name, len(along), detour, energy, seconds))
                along.append(replace(charger, service_time=seconds))
        if done < count:
            along.append(visits[done])
    return tuple(along), tuple(charges), visits[count:]
