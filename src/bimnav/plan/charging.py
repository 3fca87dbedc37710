"""Where on its tour a robot charges: its order of stops stays, visits to chargers come in between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bimnav.robot import Robot

__all__ = ["RESERVE", "Charge", "Charging", "plan_charging"]

RESERVE = 0.1  # of the battery, kept for what the plan does not know: turns, starts, waiting

_JOULES = 3600.0  # in a watt hour


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
