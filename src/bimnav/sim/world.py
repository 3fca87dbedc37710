"""What all robots of a simulation share: the clock, the log, the map, the doors, and what happens to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np
import shapely
import simpy
from numpy.typing import NDArray

from bimnav.environment import grown
from bimnav.errors import BimnavError, PlanningError, SimulationError
from bimnav.graph import NavGraph
from bimnav.grid import Cell, rasterize
from bimnav.plan import distance_field
from bimnav.robot import Robot
from bimnav.sim.agents import Errand, Order, RobotAgent
from bimnav.sim.areas import Passage, SpeedLimit
from bimnav.sim.changes import ObstacleAppears, Sensing
from bimnav.sim.claims import Claims
from bimnav.sim.doors import SimDoor
from bimnav.sim.knowledge import Closure, Knowledge
from bimnav.sim.lifts import Cabin, Lift
from bimnav.sim.log import Event, EventKind
from bimnav.sim.motion import Motion, drive
from bimnav.sim.people import Walker, first_meeting
from bimnav.sim.routes import JOINED, Line, cell_near, end_of, way_between
from bimnav.sim.stretches import Stretch, cut, joined
from bimnav.sim.track import RobotStatus
from bimnav.stops import Stop, Unreached

if TYPE_CHECKING:
    pass

__all__ = ["LATEST", "Charger", "Decision", "Incident", "Policy", "ServiceTime", "Setting", "Speed", "World"]

LATEST = 1e10  # seconds; later, float64 no longer holds two microseconds

_MARGIN = 0.3  # metres a robot keeps to people
_FORESIGHT = 10.0  # seconds of the way of people that robots foresee
_STEP = 0.25  # seconds between the moments at which a robot may begin to brake for people
_DETOUR = 1.25  # what the way to a charger may take beyond its length at cruising speed, for turns and doors
_RESERVE = 0.05  # of a full battery, left on arrival at a charger

Decision: TypeAlias = Literal["replan", "wait", "give up"]


class Policy(Protocol):
    """What a robot does when its way is closed."""

    def __call__(self, robot: Robot, stop: Stop | None, obstacle: str, /) -> Decision:
        """Return `replan`, `wait` or `give up` for a robot on its way to a stop, or home."""
        ...


class ServiceTime(Protocol):
    """How long, in seconds, a robot stays at a stop."""

    def __call__(self, robot: Robot, stop: Stop, rng: np.random.Generator, /) -> float:
        """Return seconds, finite and not below 0."""
        ...


class Speed(Protocol):
    """How fast, in metres per second, a robot drives its next leg."""

    def __call__(self, robot: Robot, rng: np.random.Generator, /) -> float:
        """Return metres per second, above 0."""
        ...


@dataclass(frozen=True, slots=True)
class Charger:
    """Where robots charge, one at a time.

    Parameters
    ----------
    name
        Its GlobalId, or how the log calls it.
    cell
        Where the search ends.
    end
        Where the robot comes to stand, world metres.
    """

    name: str
    cell: Cell
    end: tuple[float, float, float]


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


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What a simulation was given; see `simulate`."""

    service_time: ServiceTime | float
    speed: Speed | float | None
    sensing: Sensing
    policy: Decision | Policy
    patience: float
    start_times: Sequence[float]
    doors: Sequence[SimDoor]
    passages: Sequence[Passage]
    lifts: Sequence[Lift]
    limits: Sequence[SpeedLimit]
    chargers: Sequence[Charger]
    walkers: tuple[Walker, ...]
    is_eventful: bool
    keeps_history: bool


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
        self._looks: dict[int, tuple[Motion, dict[str, tuple[float, str]]]] = {}
        self._rngs: dict[int, np.random.Generator] = {}
        self._charger_field: tuple[NavGraph, NDArray[np.float64]] | None = None
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

    def speed_of(self, agent: RobotAgent) -> float:
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
        """Tell whether nothing can come between a robot and its tour, and it starts, stops and turns at once."""
        robot = agent.robot
        is_agile = math.isinf(robot.acceleration) and math.isinf(robot.turn_rate) and not agent.tires
        is_simple = all(stop.kind == "target" and stop.heading is None for stop in agent.stops)
        return is_agile and is_simple and self.is_plain and not self.is_eventful and self.setting.speed is None

    def asset_of(self, stop: Stop) -> str:
        """Return maker, model and the like of a target, if the model tells."""
        environment = self.agents[0].tour.graph.environment
        building = getattr(environment, "building", None)
        if building is None or stop.global_id not in building:
            return ""
        return str(building.asset(stop.global_id).summary)

    def stretches(self, agent: RobotAgent, line: Line) -> list[Stretch]:
        """Cut a way where it needs a door, a passage or a lift, and where it is slow."""
        if self.is_plain:
            return [Stretch(line.points, line.storeys)]
        doors, given = tuple(self.doors.values()), self.setting
        return cut(line, doors, given.passages, given.lifts if agent.robot.uses_lifts else (), given.limits)

    def passable(self, agent: RobotAgent, stretches: Sequence[Stretch]) -> int:
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

    def in_way(self, agent: RobotAgent, line: Line) -> Closure | None:
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

    # --- what comes in the way

    def next_incident(self, agent: RobotAgent, motion: Motion, begin: float, passed: float) -> Incident | None:
        """Return what will happen first to a robot in a motion, from some seconds into it."""
        found: list[Incident] = []
        agent.settle()
        empty = passed + agent.battery.lasts(RobotStatus.MOVING)
        if empty < motion.duration:
            found.append(Incident(empty, "battery"))
        for name, (seconds, kind) in self._looked(agent, motion).items():
            if name in self.hidden and passed <= seconds < motion.duration:
                found.append(Incident(seconds, "contact" if kind == "contact" else "sense", self.hidden[name]))
        on = set(motion.storeys.tolist()) if self.setting.walkers else ()
        for walker in self.setting.walkers:
            if walker.person.storey not in on:
                continue
            moment = self._stop_for(agent, motion, begin, passed, walker)
            if moment is not None:
                found.append(Incident(moment, "person", walker=walker))
        return min(found, key=lambda incident: incident.seconds, default=None)

    def _stop_for(self, agent: RobotAgent, motion: Motion, begin: float, passed: float, walker: Walker) -> float | None:
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
        places = shapely.points([motion.point_at(moment + braking / 2)[:2] for moment in moments.tolist()])
        way = walker.way(begin + passed, begin + meeting + _FORESIGHT)
        line = shapely.LineString(way) if len(way) > 1 else shapely.Point(way[0])
        safe = np.flatnonzero(shapely.distance(places, line) >= distance)
        return float(moments[safe[0]]) if len(safe) else latest

    def is_clear(self, agent: RobotAgent, line: Line, walker: Walker, seconds: float) -> bool:
        """Tell whether a robot that goes on now drives for some seconds before it has to stop for somebody."""
        line, limits = joined(self.stretches(agent, line)) if self.setting.limits else (line, None)
        motion = drive(line.points, line.storeys, agent.robot, speed=agent.cruise, heading=agent.heading, limits=limits)
        moment = self._stop_for(agent, motion, float(self.clock.now), 0.0, walker)
        return moment is None or moment > seconds

    def closure_around(self, walker: Walker) -> Closure | None:
        """Return the floor that somebody stands on."""
        point = walker.point_at(float(self.clock.now))
        if point is None:
            return None
        body = shapely.Point(point).buffer(walker.person.radius + _MARGIN)
        return Closure(walker.person.name, body, walker.person.storey)

    def _looked(self, agent: RobotAgent, motion: Motion) -> dict[str, tuple[float, str]]:
        """Return when a robot will find each hidden obstacle in a motion: seconds, and by sensing or contact."""
        known = self._looks.get(agent.index)
        if known is None or known[0] is not motion:
            known = self._looks[agent.index] = (motion, {})
        for name, obstacle in self.hidden.items():
            if name not in known[1]:
                known[1][name] = self._find(agent, motion, obstacle)
        return known[1]

    def _find(self, agent: RobotAgent, motion: Motion, obstacle: ObstacleAppears) -> tuple[float, str]:
        from bimnav.sim.areas import crossings

        body = grown(obstacle.polygon, agent.robot.radius)
        seen = obstacle.polygon.buffer(self.setting.sensing.range)
        areas = [(body, obstacle.storey), (seen, obstacle.storey)]
        found = crossings(motion.points, motion.storeys, areas)
        touch = min((motion.seconds_to(c.begin) for c in found if c.area == 0), default=math.inf)
        detected = math.inf
        for crossing in found:
            if crossing.area == 1 and self.setting.sensing.probability > 0 and detected == math.inf:
                first, last = motion.seconds_to(crossing.begin), motion.seconds_to(crossing.end)
                looks = int(self._rng_of(agent).geometric(self.setting.sensing.probability))
                moment = first + (looks - 1) * self.setting.sensing.period
                detected = moment if moment <= last else math.inf
        return (touch, "contact") if touch < detected else (detected, "sense")

    def _rng_of(self, agent: RobotAgent) -> np.random.Generator:
        if agent.index not in self._rngs:
            self._rngs[agent.index] = agent.rng.spawn(1)[0]
        return self._rngs[agent.index]

    # --- what happens to the world

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

    def reveal(self, agent: RobotAgent, incident: Incident) -> None:
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

    # --- who does what

    def assign(self, stop: Stop, *, besides: RobotAgent | None = None, cause: str = "") -> bool:
        """Give a stop to the robot that gets there with the shortest detour; answer whether one can.

        It comes behind what matters more and before what matters less, but for what a robot is on its way to.
        Of several equally short detours the first robot's, and its earliest, is taken.
        """
        best: tuple[float, int, int] | None = None
        for agent in self.agents:
            able = set(stop.abilities) <= set(agent.robot.abilities)
            if agent is besides or not able or agent.is_over or agent.status is RobotStatus.FAILED:
                continue
            graph = self.graph_of(agent)
            if not graph.free[stop.cell]:
                continue
            field = distance_field(graph, stop.cell)
            for position, detour in self._detours(agent, graph, field):
                if not _is_in_turn(agent, stop, position):
                    continue
                if math.isfinite(detour) and (best is None or detour < best[0] - JOINED):
                    best = detour, agent.index, position
        if best is None:
            return False
        agent = self.agents[best[1]]
        errand = Errand(stop, stop.cell, stop.end, len(agent.stops))
        agent.stops.append(stop)
        agent.agenda.insert(best[2], errand)
        if agent.home is None and (agent.tour.return_to_start or end_of(agent.tour)[0] != agent.tour.start):
            agent.home = agent.homeward()
        agent.note("assign", stop, cause or f"the detour is {best[0]:.2f} m")
        agent.disturb(Order("look", "something new to do"))
        return True

    def _detours(self, agent: RobotAgent, graph: NavGraph, field: NDArray[np.float64]) -> Iterable[tuple[int, float]]:
        """Yield the places in an agenda at which a stop can be put, and metres it adds there."""
        here = cell_near(graph, agent.here(), agent.storey)
        cells = [here, *(errand.cell for errand in agent.agenda)]
        first = 1 if agent.agenda and agent.status is not RobotStatus.IDLE else 0
        for position in range(first, len(cells)):
            reach = _reach(field, cells[position])
            if position + 1 < len(cells):
                after = agent.agenda[position]
                onward = _reach(field, after.cell)
                reach += onward - (after.leg.length if after.leg is not None else abs(reach - onward))
            yield position, reach

    def hand_over(self, agent: RobotAgent, cause: str) -> None:
        """Give what a robot has to do to others; what nobody can do stays with it, or undone."""
        for errand in tuple(agent.agenda):
            assert errand.stop is not None  # noqa: S101 - an agenda holds stops
            why = f"{agent.robot.name} failed: {cause}"
            if errand.stop.kind == "charger" or self.assign(errand.stop, besides=agent, cause=why):
                agent.agenda.remove(errand)
            elif agent.is_over:
                status = agent.status
                agent.give_up(errand, why)
                agent.become(status)

    # --- energy

    def energy_for(self, agent: RobotAgent, errand: Errand) -> float | None:
        """Return the joules that an errand takes, with the way to a charger after it; None without a way."""
        line = errand.leg if errand.leg is not None and self._begins_here(agent, errand.leg) else None
        if line is None:
            line = errand.leg = self.find_line(agent, errand)
        elif self.in_way(agent, line) is not None:
            line = self.find_line(agent, errand)
        if line is None:
            return None
        motion = drive(line.points, line.storeys, agent.robot, heading=agent.heading)
        powers = agent.battery.powers
        joules = motion.duration * powers[RobotStatus.MOVING]
        if errand.stop is not None and errand.stop.kind == "charger":
            return joules
        if errand.stop is not None:
            joules += self.seconds_at(agent, errand) * powers[RobotStatus.WORKING]
        if not self.chargers:
            return joules
        away = float(self._to_chargers(agent)[errand.cell])
        if math.isfinite(away):
            joules += away / agent.robot.speed * _DETOUR * powers[RobotStatus.MOVING]
        return joules + _RESERVE * agent.battery.capacity

    def _to_chargers(self, agent: RobotAgent) -> NDArray[np.float64]:
        """Return the metres from every cell to a charger that a robot can get to."""
        graph = self.knowledge.graph_for(agent.tour.graph, agent.robot)
        if self._charger_field is None or self._charger_field[0] is not graph:
            metric = graph if graph.objective == "distance" else replace(graph, objective="distance")
            cells = [charger.cell for charger in self.chargers.values() if graph.free[charger.cell]]
            field = distance_field(metric, cells) if cells else np.full(graph.frame.shape, np.inf)
            self._charger_field = graph, field
        return self._charger_field[1]

    def _begins_here(self, agent: RobotAgent, line: Line) -> bool:
        return math.dist(line.points[0], agent.place) <= JOINED

    def nearest_charger(self, agent: RobotAgent) -> Errand | None:
        """Return the way to a charger that is free, else to any, the nearest first; None without a way."""
        found = []
        for rank, charger in enumerate(self.chargers.values()):
            errand = Errand(None, charger.cell, charger.end, purpose="charge", charger=charger.name)
            errand.leg = self.find_line(agent, errand)
            if errand.leg is not None:
                found.append((self.claims.left[charger.name] <= 0, errand.leg.length, rank, errand))
        return min(found, key=lambda option: option[:3])[3] if found else None

    # --- getting out of the way

    def is_inside(self, agent: RobotAgent, zone: Closure) -> bool:
        """Tell whether a robot's body is on closed floor."""
        if zone.storey != agent.storey:
            return False
        body = zone.body(agent.robot).buffer(-JOINED)
        return bool(body.intersects(shapely.Point(agent.here()[:2])))

    def way_out(self, agent: RobotAgent, zones: Sequence[Closure]) -> Errand | None:
        """Return the shortest way out of zones that a robot is in; None if it is in none, or cannot."""
        if not any(self.is_inside(agent, zone) for zone in zones):
            return None
        names = {zone.name for zone in zones}
        rest = Knowledge({name: c for name, c in self.knowledge.closures.items() if name not in names})
        return self._way_to(agent, rest.graph_for(agent.tour.graph, agent.robot), self.graph_of(agent).free)

    def parking_for(self, agent: RobotAgent) -> Errand | None:
        """Return the way to the nearest cell where a robot is in nobody's way; None if it is there."""
        from bimnav.sim.egress import egress_cells, egress_distances

        assert self.kept_clear is not None  # noqa: S101 - set by the emergency
        graph = self.graph_of(agent)
        try:
            needed = egress_cells(graph, egress_distances(graph), self.kept_clear[1] + 2 * agent.robot.radius)
        except BimnavError:
            return None
        open_ = graph.free & ~needed
        for index, cell in self.parked.items():
            spread = agent.robot.radius + self.agents[index].robot.radius
            taken = shapely.Point(graph.frame.center_of(cell)[:2]).buffer(max(spread, graph.frame.cell_size / 2))
            open_[cell.storey] &= ~rasterize(graph.frame, taken)
        here = cell_near(graph, agent.place, agent.storey)
        if here is not None and open_[here]:
            self.parked[agent.index] = here
            return None
        errand = self._way_to(agent, graph, open_)
        if errand is not None:
            self.parked[agent.index] = errand.cell
        return errand

    def _way_to(self, agent: RobotAgent, graph: NavGraph, wanted: NDArray[np.bool_]) -> Errand | None:
        """Return the way to the nearest of some cells, by distance, then storey, row and column."""
        begin = cell_near(graph, agent.place, agent.storey)
        if begin is None:
            return None
        distance = np.where(wanted, distance_field(graph, begin), np.inf)
        nearest = int(distance.argmin())
        if not math.isfinite(distance.ravel()[nearest]):
            return None
        cell = Cell(*(int(k) for k in np.unravel_index(nearest, distance.shape)))
        end = graph.frame.center_of(cell)
        return Errand(None, cell, end, leg=way_between(graph, agent.place, begin, cell, end))


def _is_in_turn(agent: RobotAgent, stop: Stop, position: int) -> bool:
    """Tell whether a stop at some place of an agenda keeps the order of priorities."""
    first = 1 if agent.agenda and agent.status is not RobotStatus.IDLE else 0
    known = [(k, e.stop.priority) for k, e in enumerate(agent.agenda) if e.stop is not None and e.stop.kind == "target"]
    before = all(priority >= stop.priority for k, priority in known if first <= k < position)
    return before and all(priority <= stop.priority for k, priority in known if k >= position)


def _reach(field: NDArray[np.float64], cell: Cell | None) -> float:
    """Return the distance of a cell; of a closed one, that of the nearest around it."""
    if cell is None:
        return math.inf
    reach = float(field[cell])
    if math.isfinite(reach):
        return reach
    around = field[cell.storey, max(cell.row - 1, 0) : cell.row + 2, max(cell.col - 1, 0) : cell.col + 2]
    return float(around.min())


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
