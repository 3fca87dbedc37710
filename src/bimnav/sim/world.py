"""What all robots of a simulation share: the clock, the log, the map, the doors, and what happens to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
import simpy
from numpy.typing import NDArray

from bimnav.errors import PlanningError, SimulationError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.robot import Robot
from bimnav.sim.changes import ObstacleAppears
from bimnav.sim.claims import Claims
from bimnav.sim.doors import SimDoor
from bimnav.sim.errands import Errand, Order
from bimnav.sim.incidents import Incident, Lookout
from bimnav.sim.knowledge import Closure, Knowledge
from bimnav.sim.lifts import Cabin
from bimnav.sim.log import Event, EventKind
from bimnav.sim.rehearsal import Rehearsal
from bimnav.sim.routes import JOINED, Line, cell_near, way_between
from bimnav.sim.setting import Decision, ServiceTime, Setting
from bimnav.sim.stretches import Stretch
from bimnav.sim.track import RobotStatus
from bimnav.stops import Stop, Unreached

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent
    from bimnav.sim.driving import Driver

__all__ = ["LATEST", "World"]

LATEST = 1e10  # seconds; later, float64 no longer holds two microseconds


class World:
    """One simulation while it runs."""

    def __init__(
        self,
        clock: simpy.Environment,
        storeys: tuple[str, ...],
        setting: Setting,
        *,
        cell_size: float,
        targets: list[str],
        removable: set[str],
        write: Callable[[Event], None],
    ) -> None:
        self.clock, self.storeys, self.setting = clock, storeys, setting
        self.targets, self.removable, self.write = targets, removable, write
        self.keeps_history, self.is_eventful, self.patience = (
            setting.keeps_history,
            setting.is_eventful,
            setting.patience,
        )
        self.doors = {door.global_id: door for door in setting.doors}
        self.chargers = {charger.name: charger for charger in setting.chargers}
        self.cabins = {lift.name: Cabin(lift, clock) for lift in setting.lifts}
        self.is_plain = not (setting.doors or setting.passages or setting.lifts or setting.limits)
        self.claims = Claims(clock)
        self.knowledge = Knowledge(leeway=1.5 * cell_size)
        self.hidden: dict[str, ObstacleAppears] = {}
        self.agents: list[RobotAgent] = []
        self.given_up: list[str] = []
        self.unreached: list[Unreached] = []
        self.parked: dict[int, Cell] = {}
        self.kept_clear: tuple[str, float] | None = None
        self.lookout = Lookout(self)
        self.rehearsal = Rehearsal(setting, self.doors.values())
        self.charger_field: tuple[NavGraph, NDArray[np.float64]] | None = None
        ones = [*self.doors, *self.chargers]
        self.claims.left = {passage.name: passage.capacity for passage in setting.passages} | dict.fromkeys(ones, 1)
        for door in setting.doors:
            self.knowledge.add(_closed(door))

    def pass_time(self, seconds: float) -> simpy.Event:
        """Return the event that this many seconds have passed; never, for inf."""
        if seconds == math.inf:
            return self.clock.event()
        clock = self.clock
        if seconds >= 0 and clock.now + seconds <= LATEST:  # nan would corrupt simpy's queue
            return clock.timeout(seconds)
        raise SimulationError(
            f"the simulation would reach {clock.now + seconds:g} s.",
            f"It ends at {LATEST:g} s; check the speed and the service times.",
        )

    def note(
        self,
        event: EventKind,
        cause: str,
        *,
        place: tuple[float, float, int] | None = None,
        target: str = "",
        target_name: str = "",
        elevation: float = 0.0,
    ) -> None:
        """Write in the log what happened to the world."""
        x, y, storey = place or (0.0, 0.0, 0)
        now = float(self.clock.now)
        self.write(Event(now, "", event, "", self.storeys[storey], x, y, elevation, target, target_name, cause))

    # --- what robots ask

    def delay_of(self, index: int) -> float:
        """Return the seconds after which a robot starts."""
        return self.setting.start_times[index] - float(self.clock.now)

    def speed_of(self, agent: Driver) -> float:
        """Return the cruising speed on the next leg, metres per second."""
        given = self.setting.speed
        if given is None:
            return agent.robot.speed
        found = given(agent.robot, agent.rng) if callable(given) else given
        speed = float(found) if isinstance(found, (int, float, np.integer, np.floating)) else math.nan
        if not 0 < speed < math.inf:
            raise SimulationError(
                f"the speed of robot {agent.robot.name!r} is {found!r:.80}.",
                "Give metres per second above 0, or a function of robot and generator that returns them.",
                {"robot": agent.robot.name},
            )
        return speed

    def seconds_at(self, agent: RobotAgent, errand: Errand) -> float:
        """Return the seconds of service at a stop, drawn once."""
        if errand.seconds is None:
            assert errand.stop is not None  # noqa: S101 - only stops are served
            errand.seconds = self.draw_seconds(agent, errand.stop)
        return errand.seconds

    def draw_seconds(self, agent: RobotAgent, stop: Stop) -> float:
        """Draw the seconds of service at a stop."""
        return _service_seconds(stop, agent.robot, self.setting.service_time, agent.rng)

    def label_of(self, name: str) -> str:
        """Return what the log calls a resource."""
        return self.doors[name].label if name in self.doors else f"charger {name}" if name in self.chargers else name

    def is_undisturbed(self, agent: RobotAgent) -> bool:
        """Tell whether nothing can come between a robot and its tour."""
        is_simple = all(stop.kind == "target" and stop.heading is None for stop in agent.stops)
        return not agent.tires and is_simple and self.is_plain and not self.is_eventful and self.setting.speed is None

    def asset_of(self, stop: Stop) -> str:
        """Return maker, model and the like of a target, if the model tells."""
        environment = self.agents[0].tour.graph.environment
        building = getattr(environment, "building", None)
        if building is None or stop.global_id not in building:
            return ""
        return str(building.asset(stop.global_id).summary)

    def stretches(self, agent: Driver, line: Line) -> list[Stretch]:
        """Cut a way where it needs a door, a passage or a lift, and where it is slow."""
        if self.is_plain:
            return [Stretch(line.points, line.storeys)]
        return self.rehearsal.cut(line, uses_lifts=agent.robot.uses_lifts)

    def passable(self, agent: Driver, stretches: Sequence[Stretch]) -> int:
        """Return how many stretches a robot drives in one go if what they need is free.

        One that stops at once loses no time by it; a lift, and a door that takes time to open, stop everybody.
        """
        if math.isinf(agent.robot.acceleration):
            return 1
        for k, stretch in enumerate(stretches[1:], 1):
            if stretch.lift is not None or any(door.state != "open" and door.opening_time for door in stretch.doors):
                return k
        return len(stretches)

    def decide(self, agent: RobotAgent, errand: Errand, obstacle: Closure) -> Decision:
        """Ask the policy what to do about a closed way."""
        policy = self.setting.policy
        decision = policy if isinstance(policy, str) else policy(agent.robot, errand.stop, obstacle.name)
        if decision not in ("replan", "wait", "give up"):
            raise SimulationError(
                f"the policy says {decision!r}.", "It returns 'replan', 'wait' or 'give up'.", {"policy": decision}
            )
        return decision

    # --- ways

    def in_way(self, agent: Driver, line: Line) -> Closure | None:
        """Return the first thing known that closes a way to a robot."""
        if not self.knowledge.closures and agent.avoided is None:
            return None
        return self.knowledge.in_way(
            agent.robot, line.points, line.storeys, besides=agent.avoided, held=frozenset(agent.held)
        )

    def closure_of(self, agent: RobotAgent, errand: Errand) -> Closure | None:
        """Return what is known to close the place where an errand is."""
        end, storey = np.array([errand.end]), np.array([errand.cell.storey])
        return self.knowledge.in_way(agent.robot, end, storey, besides=agent.avoided)

    def graph_of(self, agent: RobotAgent) -> NavGraph:
        """Return the map of a robot, with everything closed that it knows of."""
        return self.knowledge.graph_for(agent.tour.graph, agent.robot, agent.avoided)

    def find_line(self, agent: RobotAgent, errand: Errand) -> Line | None:
        """Find a way to where an errand is; None if none is known."""
        lead = self._lead(agent, errand)
        place, storey = agent.place, agent.storey
        if lead is not None:
            x, y, z = lead.points[-1].tolist()
            place, storey = (x, y, z), int(lead.storeys[-1])
        graph = self.graph_of(agent)
        reach = errand.stop is not None and errand.stop.approach == "reach"
        options = [(errand.cell, errand.end)]
        options += [(stand.cell, stand.end) for stand in (errand.stop.candidates if errand.stop else ())]
        begin = cell_near(graph, place, storey)
        if begin is None:
            return None
        for cell, end in options:
            if graph.free[cell]:
                try:
                    line = way_between(graph, place, begin, cell, end, straight_in=reach)
                except PlanningError:
                    continue
                if errand.stop is not None and errand.end != end:
                    stand = next(stand for stand in errand.stop.candidates if stand.end == end)
                    errand.stop = errand.stop.at(stand)
                errand.cell, errand.end = cell, end
                return line if lead is None else _appended(lead, line)
        return None

    def _lead(self, agent: RobotAgent, errand: Errand) -> Line | None:
        """Return the rest of a stair or ramp a robot is on: it goes on to where the floor is level."""
        levels = agent.tour.graph.frame.elevations
        leg = errand.leg
        if leg is None or abs(agent.place[2] - levels[agent.storey]) <= JOINED:
            return None
        for k in range(1, len(leg.points)):
            if abs(float(leg.points[k, 2]) - levels[int(leg.storeys[k])]) <= JOINED:
                return Line(leg.points[: k + 1], leg.storeys[: k + 1])
        return None

    # --- what happens to the world

    def set_door(self, door: SimDoor) -> None:
        """Put a door in another state."""
        self.doors[door.global_id] = door
        self.rehearsal.change(self.doors.values())

    def close(self, closure: Closure) -> None:
        """Let everybody know that floor is closed."""
        self.knowledge.add(closure)
        self.look_again(closure.name)

    def open_up(self, name: str, cause: str) -> None:
        """Let everybody know that floor is open again."""
        if name and self.knowledge.remove(name) is not None:
            self.look_again(cause)

    def look_again(self, cause: str) -> None:
        """Let robots on their way, and those that wait for one, look whether it is open."""
        for agent in self.agents:
            if agent.status in (RobotStatus.MOVING, RobotStatus.BLOCKED, RobotStatus.WAITING):
                agent.disturb(Order("look", cause))

    def reveal(self, agent: Driver, incident: Incident) -> None:
        """Let everybody know what one robot found."""
        obstacle = incident.reveals
        assert obstacle is not None  # noqa: S101 - only such incidents reveal
        del self.hidden[obstacle.name]
        agent.note("contact" if incident.kind == "contact" else "sense", None, obstacle.name)
        self.knowledge.add(Closure(obstacle.name, obstacle.polygon, obstacle.storey))
        for other in self.agents:
            if other is not agent and other.status in (RobotStatus.MOVING, RobotStatus.BLOCKED, RobotStatus.WAITING):
                other.disturb(Order("look", f"{agent.robot.name} found {obstacle.name}"))

    def stranded(self, agent: RobotAgent) -> str:
        """Close the floor under a robot that stands still; return its name in the map."""
        if not agent.robot.radius:
            return ""
        name = f"robot {agent.robot.name}"
        self.close(Closure(name, shapely.Point(agent.place[:2]).buffer(agent.robot.radius), agent.storey))
        return name


def _closed(door: SimDoor) -> Closure:
    """Return a door as something that is closed to whom it does not open for."""
    assert door.polygon is not None  # noqa: S101 - doors in a world have a place
    return Closure(door.label, door.polygon, door.storey, door)


def _appended(lead: Line, line: Line) -> Line:
    return Line(np.concatenate([lead.points, line.points[1:]]), np.concatenate([lead.storeys, line.storeys[1:]]))


def _service_seconds(stop: Stop, robot: Robot, service_time: ServiceTime | float, rng: np.random.Generator) -> float:
    hint = "Give seconds from 0 on, or a function of robot, stop and generator that returns them."
    context = {"global_id": stop.global_id, "name": stop.name}
    try:
        seconds = float(service_time(robot, stop, rng) if callable(service_time) else service_time)
    except Exception as error:
        message = f"the service time of stop {stop.name!r} ({stop.global_id}) cannot be had: {error!r}."
        raise SimulationError(message, hint, context) from error
    if not (math.isfinite(seconds) and seconds >= 0):
        message = f"the service time of stop {stop.name!r} ({stop.global_id}) is {seconds}."
        raise SimulationError(message, hint, context)
    return seconds
