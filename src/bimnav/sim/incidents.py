"""What will come in the way of a robot in motion: people, things nobody told it of, an empty battery."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely

from bimnav.environment import grown
from bimnav.sim.areas import crossings
from bimnav.sim.changes import ObstacleAppears
from bimnav.sim.knowledge import Closure
from bimnav.sim.motion import Motion
from bimnav.sim.people import Walker, first_meeting
from bimnav.sim.routes import Line
from bimnav.sim.stretches import joined
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    from bimnav.sim.driving import Driver
    from bimnav.sim.world import World

__all__ = ["Incident", "Lookout", "closure_around"]

_MARGIN = 0.3  # metres a robot keeps to people
_FORESIGHT = 10.0  # seconds of the way of people that robots foresee
_STEP = 0.25  # seconds between the moments at which a robot may begin to brake for people


@dataclass(frozen=True, slots=True, eq=False)
class Incident:
    """Something that will happen to a robot during a motion.

    Parameters
    ----------
    seconds
        Since the begin of the motion.
    reveals
        The obstacle that it will find.
    walker
        The person that it will meet.
    """

    seconds: float
    kind: Literal["battery", "sense", "contact", "person"]
    reveals: ObstacleAppears | None = None
    walker: Walker | None = None


class Lookout:
    """Foresees what will come in the way of the robots of one simulation."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._looks: dict[int, tuple[object, dict[str, tuple[float, str]]]] = {}
        self._rngs: dict[int, np.random.Generator] = {}

    def next_incident(self, agent: Driver, motion: Motion, begin: float, passed: float) -> Incident | None:
        """Return what will happen first to a robot in a motion, from some seconds into it."""
        found: list[Incident] = []
        agent.settle()
        empty = passed + agent.battery.lasts(RobotStatus.MOVING)
        if empty < motion.duration:
            found.append(Incident(empty, "battery"))
        for name, (seconds, kind) in self._looked(agent, motion).items():
            if name in self.world.hidden and passed <= seconds < motion.duration:
                found.append(Incident(seconds, "contact" if kind == "contact" else "sense", self.world.hidden[name]))
        for walker in self.world.setting.walkers:
            if walker.person.storey not in motion.floors:
                continue
            moment = self._stop_for(agent, motion, begin, passed, walker)
            if moment is not None:
                found.append(Incident(moment, "person", walker=walker))
        return min(found, key=lambda incident: incident.seconds, default=None)

    def _stop_for(self, agent: Driver, motion: Motion, begin: float, passed: float, walker: Walker) -> float | None:
        """Return when a robot begins to brake for somebody, seconds into a motion; None if it need not.

        It stops as late as it can where they will not come near it in the next seconds; if they come all the
        way along its own, just in front of them.
        """
        distance = agent.robot.radius + walker.person.radius + _MARGIN
        meeting = first_meeting(motion, begin, walker, distance)
        if meeting is None or meeting < passed:
            return None
        braking = agent.cruise / agent.robot.acceleration
        latest = max(meeting - braking, passed)
        moments = latest - np.arange(math.floor((latest - passed) / _STEP) + 1) * _STEP
        places = shapely.points(motion.points_at(np.asarray(moments + braking / 2))[:, :2])
        way = walker.way(begin + passed, begin + meeting + _FORESIGHT)
        line = shapely.LineString(way) if len(way) > 1 else shapely.Point(way[0])
        safe = np.flatnonzero(shapely.distance(places, line) >= distance)
        return float(moments[safe[0]]) if len(safe) else latest

    def is_clear(self, agent: Driver, line: Line, walker: Walker, seconds: float) -> bool:
        """Tell whether a robot that goes on now drives for some seconds before it has to stop for somebody."""
        line, limits = joined(self.world.stretches(agent, line)) if self.world.setting.limits else (line, None)
        motion = self.world.rehearsal.drive(line, agent.robot, agent.cruise, agent.heading, limits)
        moment = self._stop_for(agent, motion, float(self.world.clock.now), 0.0, walker)
        return moment is None or moment > seconds

    def _looked(self, agent: Driver, motion: Motion) -> dict[str, tuple[float, str]]:
        """Return when a robot will find each hidden obstacle in a motion: seconds, and by sensing or contact."""
        known = self._looks.get(agent.index)
        if known is None or known[0] is not agent.under_way:  # equal motions are one object
            known = self._looks[agent.index] = (agent.under_way, {})
        for name, obstacle in self.world.hidden.items():
            if name not in known[1]:
                known[1][name] = self._find(agent, motion, obstacle)
        return known[1]

    def _find(self, agent: Driver, motion: Motion, obstacle: ObstacleAppears) -> tuple[float, str]:
        body = grown(obstacle.polygon, agent.robot.radius)
        seen = obstacle.polygon.buffer(self.world.setting.sensing.range)
        areas = [(body, obstacle.storey), (seen, obstacle.storey)]
        found = crossings(motion.points, motion.storeys, areas)
        touch = min((motion.seconds_to(c.begin) for c in found if c.area == 0), default=math.inf)
        detected = math.inf
        for crossing in found:
            if crossing.area == 1 and self.world.setting.sensing.probability > 0 and detected == math.inf:
                first, last = motion.seconds_to(crossing.begin), motion.seconds_to(crossing.end)
                looks = int(self._rng_of(agent).geometric(self.world.setting.sensing.probability))
                moment = first + (looks - 1) * self.world.setting.sensing.period
                detected = moment if moment <= last else math.inf
        return (touch, "contact") if touch < detected else (detected, "sense")

    def _rng_of(self, agent: Driver) -> np.random.Generator:
        if agent.index not in self._rngs:
            self._rngs[agent.index] = agent.rng.spawn(1)[0]
        return self._rngs[agent.index]


def closure_around(walker: Walker, time: float) -> Closure | None:
    """Return the floor that somebody stands on at a time; None if they are not there."""
    point = walker.point_at(time)
    if point is None:
        return None
    body = shapely.Point(point).buffer(walker.person.radius + _MARGIN)
    return Closure(walker.person.name, body, walker.person.storey)
