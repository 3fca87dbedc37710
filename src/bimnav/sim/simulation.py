"""The simulation: robots that do their tours, and the world that changes meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol, cast, get_args, runtime_checkable

import numpy as np
import simpy

from bimnav import _checks
from bimnav.errors import InputError, ValueRangeError
from bimnav.plan.charging import find_chargers
from bimnav.robot import Robot
from bimnav.sim.agents import RobotAgent
from bimnav.sim.areas import Passage, SpeedLimit
from bimnav.sim.changes import Change, Sensing
from bimnav.sim.doors import DoorState, SimDoor, doors_in
from bimnav.sim.errands import Order
from bimnav.sim.happenings import doors_named, plan_changes
from bimnav.sim.lifts import Lift
from bimnav.sim.log import Event, EventLog
from bimnav.sim.people import Person, Walker
from bimnav.sim.result import SimResult, Tally
from bimnav.sim.setting import Charger, Decision, Policy, ServiceTime, Setting, Speed
from bimnav.sim.world import LATEST, World

if TYPE_CHECKING:
    from collections.abc import Callable

    from bimnav.environment import IndoorEnvironment
    from bimnav.graph import NavGraph
    from bimnav.plan import Tour

__all__ = ["ServiceTime", "simulate"]

_LIFT_SPEED = 1.0  # metres per second, as for links


@runtime_checkable
class Plan(Protocol):
    """Tours of several robots, as any planner of fleets gives them."""

    @property
    def tours(self) -> Sequence[Tour]:
        """One for every robot."""
        ...


def simulate(
    plan: Tour | Sequence[Tour] | Plan,
    graph: NavGraph | None = None,
    robots: Sequence[Robot] | None = None,
    *,
    robot: Robot | None = None,
    events: Iterable[Change] = (),
    people: Iterable[Person] = (),
    doors: Iterable[SimDoor] = (),
    lifts: Iterable[Lift] | None = None,
    chargers: Iterable[Charger] | None = None,
    passages: Iterable[Passage] = (),
    speed_limits: Iterable[SpeedLimit] = (),
    service_time: ServiceTime | float | None = None,
    speed: Speed | float | None = None,
    sensing: Sensing | None = None,
    policy: Decision | Policy = "replan",
    patience: float = 120.0,
    rng: np.random.Generator | None = None,
    start_time: float | Sequence[float] = 0.0,
    until: float = math.inf,
    on_event: Callable[[Event], None] | None = None,
    history: bool = True,
) -> SimResult:
    """Play tours in simulated time.

    Every robot drives its legs along the exact route and works at every stop. A target that was served is
    gone from the world, if the task says so. At one instant, changes of the world come first, in the order
    given; then robots go on in the order in which they began to wait for that instant, at the start in the
    order of the plan. What robots know of the world, all of them know.

    Parameters
    ----------
    plan
        A tour, several, or a plan with `tours`; `plan_tour` makes a tour.
    graph
        What the plan was made on. The plan knows it; one that is given must be the same.
    robot, robots
        Who does it. The default is the robot of the plan, else the one the environment was made for; several
        are then called after it, with numbers. Names differ.
    events
        What happens to the world: `ObstacleAppears`, `DoorLocks`, `TargetReported`, `RobotFails`,
        `ZoneHazardous`, `Emergency` and the like.
    people
        Who walks around; robots stand still for them.
    doors
        Doors that have to be opened, or are locked; other doors stand open.
    lifts
        Lifts; the default is those of the graph. Without any, a robot drives what rises steeply, too.
    chargers
        Where robots charge; the default is what the task names as docks.
    passages
        Floor that few robots may be on at a time; `find_passages` finds what is too narrow for two.
    speed_limits
        Floor on which robots drive more slowly.
    service_time
        Seconds at every stop, a `Chance`, or a function of robot, stop and generator. The default is what the
        stop, else the task, says, else 0.
    speed
        Cruising speed on a leg in metres per second, a `Chance`, or a function of robot and generator,
        instead of the robot's.
    sensing
        How robots find obstacles that nobody told them of.
    policy
        What a robot does when its way is closed: `replan` finds another, else puts the target last, else
        waits; `wait` waits; `give up` leaves the target. Or a function of robot, stop and the obstacle's name.
    patience
        Seconds a robot waits for a way, a door or a passage, before it gives the target up.
    rng
        Source of chance; every robot and every random walk has a stream of its own. The default is a fixed
        one, so that equal inputs give equal logs; pass your own to vary them.
    start_time
        Seconds on the clock when robots start; one number, or one for every robot.
    until
        Seconds on the clock when work ends; what is left then stays undone.
    on_event
        Called with every event as it happens.
    history
        Whether to keep log and tracks; without, memory stays flat however long the simulation is.

    Raises
    ------
    SimulationError
        If a service time or a speed is no finite number, or a route has gaps.
    ValueRangeError
        If a time is not finite or too far from 0.
    InputError
        If robots, or people, share a name, or their number is not that of the tours.
    """
    tours = _tours_of(plan)
    _checks.need("graph", graph, "NavGraph", or_none=True)
    if graph is not None and any(tour.graph.frame != graph.frame for tour in tours):
        raise InputError("the plan was made on another graph.", "Give the graph it was made on, or none.")
    starts = _starts(start_time, len(tours))
    fleet = _fleet(plan, tours, robot, robots)
    events, people = _changes(events), _checks.many("people", people, Person)
    passages, limits = (
        _checks.many("passages", passages, Passage),
        _checks.many("speed_limits", speed_limits, SpeedLimit),
    )
    lifts = _lifts_in(tours[0].graph) if lifts is None else _checks.many("lifts", lifts, Lift)
    for thing in (*events, *people, *passages, *limits, *lifts):
        storey = getattr(thing, "storey", 0)
        _checks.whole(f"storey of {type(thing).__name__}", storey, 0, len(tours[0].graph.frame.elevations) - 1)
    _check_choices(sensing, policy, rng, on_event)
    environment = tours[0].graph.environment
    task = None if environment is None else environment.task
    begin = min(starts)
    until, patience = _checks.number("until", until, begin), _checks.number("patience", patience, 0)
    streams = _streams(rng or np.random.default_rng(0), len(tours), people)
    walkers = _walkers(people, tours[0].graph, streams[len(tours) :], begin)
    named = [SimDoor(global_id, "open") for global_id in doors_named(events)]
    doors = _checks.many("doors", doors, SimDoor)
    given = {door.global_id: door for door in (*named, *_slow_doors(environment), *doors)}
    setting = Setting(
        service_time=_default_service(task) if service_time is None else service_time,
        speed=speed,
        sensing=sensing or Sensing(),
        policy=policy,
        patience=patience,
        start_times=starts,
        doors=doors_in(environment, given.values()),
        passages=passages,
        lifts=lifts,
        limits=limits,
        chargers=_chargers_in(
            tours, _docks_of(tours[0], fleet) if chargers is None else _checks.many("chargers", chargers, Charger)
        ),
        walkers=walkers,
        is_eventful=bool(events or people or math.isfinite(until) or any(math.isfinite(r.battery_wh) for r in fleet)),
        keeps_history=history,
    )
    targets = _targets_of(tours)
    log: list[Event] = []
    world = World(
        simpy.Environment(begin),
        _storey_names(tours[0]),
        setting,
        cell_size=tours[0].graph.frame.cell_size,
        targets=list(targets),
        removable=set(targets) if task is None or task.removes_targets else set(),
        write=_writer(log if history else None, on_event),
    )
    plan_changes(world, events)
    if math.isfinite(until):
        _end_at(world, until)
    for index, (each, tour, stream) in enumerate(zip(fleet, tours, streams, strict=False)):
        world.agents.append(RobotAgent(world, index, each, tour, stream))
    world.clock.run()
    return _result(world, fleet, tours, EventLog(tuple(log)), people, begin)


def _result(
    world: World, fleet: Sequence[Robot], tours: Sequence[Tour], log: EventLog, people: Sequence[Person], begin: float
) -> SimResult:
    for agent in world.agents:
        agent.close_books()
    unreached = [lost.global_id for tour in tours for lost in tour.unreached]
    return SimResult(
        tuple(fleet),
        tuple(tours),
        log,
        tuple(agent.recorder.finish() for agent in world.agents) if world.setting.keeps_history else (),
        tuple(
            Tally(
                agent.seconds,
                agent.distance,
                agent.charge_distance,
                agent.battery.used,
                agent.battery.charged,
                agent.battery.level,
                tuple(agent.served),
            )
            for agent in world.agents
        ),
        tuple(tuple(agent.stops) for agent in world.agents),
        tuple(dict.fromkeys(world.targets)),
        tuple(world.given_up),
        (*unreached, *(lost.global_id for lost in world.unreached)),
        world.storeys,
        (begin, max(agent.last for agent in world.agents)),
        tuple(people),
        world.setting.walkers,
    )


def _tours_of(plan: Tour | Sequence[Tour] | Plan) -> tuple[Tour, ...]:
    listed: Any = getattr(plan, "tours", None)
    given: Any = listed if listed is not None else plan
    tours: tuple[Any, ...] = tuple(given) if isinstance(given, Sequence) and not isinstance(given, str) else (given,)
    if not tours:
        raise InputError("there is no tour to play.", "Give at least one.")
    for tour in tours:
        _checks.tour("plan", tour)
    return tours


def _changes(events: Iterable[Change]) -> tuple[Change, ...]:
    changes = _checks.many("events", events)
    for change in changes:
        if not isinstance(change, get_args(Change)):
            raise ValueRangeError(f"{change!r:.80} is no change of the world.", "Give values such as ObstacleAppears.")
    return changes


def _check_choices(sensing: object, policy: object, rng: object, on_event: object) -> None:
    _checks.need("sensing", sensing, Sensing, or_none=True)
    _checks.need("rng", rng, np.random.Generator, or_none=True)
    _checks.function("on_event", on_event)
    if policy not in get_args(Decision) and not callable(policy):
        known = ", ".join(map(repr, get_args(Decision)))
        raise ValueRangeError(f"policy is {policy!r:.80}.", f"Give {known}, or a function.")


def _starts(start_time: float | Sequence[float], count: int) -> tuple[float, ...]:
    starts = tuple(start_time) if isinstance(start_time, Sequence) else (start_time,) * count
    starts = tuple(_checks.number("start_time", start, -LATEST, LATEST) for start in starts)
    if len(starts) != count:
        raise ValueRangeError(
            f"start_time is {start_time}.",
            f"Give seconds from {-LATEST:g} to {LATEST:g}, one number or one for every robot.",
            {"start_time": start_time},
        )
    return starts


def _fleet(
    plan: object, tours: Sequence[Tour], robot: Robot | None, robots: Sequence[Robot] | None
) -> tuple[Robot, ...]:
    if robot is not None and robots is not None:
        raise InputError("both robot and robots are given.", "Give one of them.")
    if robots is None and robot is None:
        robots = getattr(plan, "robots", None) or None
    _checks.need("robot", robot, Robot, or_none=True)
    if robots is not None:
        fleet = _checks.many("robots", robots, Robot)
    else:
        environment = tours[0].graph.environment
        robot = robot or (Robot() if environment is None else environment.robot)
        own = [getattr(tour, "robot", None) or robot for tour in tours]
        names = [each.name for each in own]
        if len(set(names)) < len(names):
            own = [replace(each, name=f"{each.name}-{k + 1}") for k, each in enumerate(own)]
        fleet = tuple(own)
    names = [each.name for each in fleet]
    if len(fleet) != len(tours) or len(set(names)) < len(names):
        raise InputError(
            f"{len(fleet)} robots called {', '.join(map(repr, names[:9]))} do {len(tours)} tours.",
            "Give one robot for every tour, each with a name of its own.",
        )
    return fleet


def _streams(rng: np.random.Generator, robots: int, people: Sequence[Person]) -> list[np.random.Generator]:
    """Return a source of chance for every robot and person; a robot alone takes the given one."""
    if robots == 1 and not people:
        return [rng]
    return list(rng.spawn(robots + len(people)))


def _walkers(
    people: Sequence[Person], graph: NavGraph, streams: Sequence[np.random.Generator], begin: float
) -> tuple[Walker, ...]:
    if len({person.name for person in people}) < len(people):
        raise InputError("two people share a name.", "Give each a name of their own.")
    return tuple(Walker(person, graph, stream, begin) for person, stream in zip(people, streams, strict=True))


def _default_service(task: Any) -> ServiceTime | float:
    """Return what stops, else the task, say about service times."""
    usual = 0.0 if task is None else float(task.service_time)

    def seconds(_: Robot, stop: Any, __: np.random.Generator, /) -> float:
        own = getattr(stop, "service_time", None)
        return usual if own is None else float(own)

    return seconds


def _slow_doors(environment: IndoorEnvironment | None) -> list[SimDoor]:
    """Return the doors for which robots wait, as the task says."""
    known = () if environment is None else getattr(environment, "doors", ())
    return [
        SimDoor(door.global_id, cast(DoorState, door.state), door.opening_time) for door in known if door.opening_time
    ]


def _lifts_in(graph: NavGraph) -> tuple[Lift, ...]:
    """Return the lifts of a graph, as fast as it reckons with; each waits on the lowest storey it serves.

    What a link takes beside the way into the cabin and out of it is the cabin's: travel, and a stop at both ends.
    Who waits does so in front.
    """
    found: dict[str, Lift] = {}
    for link in sorted(getattr(graph, "connectors", ()), key=lambda link: min(link.begin, link.end)):
        name = link.global_id or link.name or f"lift at {tuple(link.begin)}"
        if link.kind != "lift" or name in found:
            continue
        ends = np.array([graph.frame.center_of(link.begin), graph.frame.center_of(link.end)])
        points = link.points if len(link.points) else ends
        rising = int(np.abs(np.diff(points[:, 2])).argmax())
        x, y, _ = points[rising].tolist()
        reached = np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum())
        climb, storeys = abs(float(ends[1, 2] - ends[0, 2])), abs(link.end.storey - link.begin.storey)
        seconds = max(graph.seconds_over(link) - graph.seconds_beside(link), 0.0)
        travel = min(climb / _LIFT_SPEED, seconds)
        found[name] = Lift(
            name,
            x,
            y,
            travel_time=travel / storeys,
            door_time=(seconds - travel) / 2,
            storey=min(link.begin.storey, link.end.storey),
            depth=float(max(reached[rising], reached[-1] - reached[rising + 1])),
        )
    return tuple(found.values())


def _chargers_in(tours: Sequence[Tour], chargers: Sequence[Charger]) -> tuple[Charger, ...]:
    """Return chargers, and those that tours visit besides, each once."""
    visits = [Charger(s.global_id, s.cell, s.end) for tour in tours for s in tour.stops if s.kind == "charger"]
    return tuple({charger.name: charger for charger in (*visits, *chargers)}.values())


def _docks_of(tour: Tour, fleet: Sequence[Robot]) -> tuple[Charger, ...]:
    """Return the chargers that the task names, for robots that tire."""
    if not any(math.isfinite(robot.battery_wh) for robot in fleet):
        return ()
    return tuple(Charger(dock.global_id, dock.cell, dock.end) for dock in find_chargers(tour.graph, tour.start))


def _writer(log: list[Event] | None, on_event: Callable[[Event], None] | None) -> Callable[[Event], None]:
    if on_event is None:
        return (lambda _: None) if log is None else log.append
    told = on_event

    def write(event: Event) -> None:
        if log is not None:
            log.append(event)
        told(event)

    return write


def _end_at(world: World, until: float) -> None:
    moment = world.pass_time(until - float(world.clock.now))
    assert moment.callbacks is not None  # noqa: S101 - it lies ahead

    def end(_: simpy.Event) -> None:
        for agent in world.agents:
            agent.disturb(Order("end", "time is up"))

    moment.callbacks.append(end)


def _targets_of(tours: Sequence[Tour]) -> tuple[str, ...]:
    """Return the GlobalIds of everything there is to visit, also of what the tours leave out."""
    environment = tours[0].graph.environment
    known = [] if environment is None else [target.global_id for target in environment.targets]
    planned = [stop.global_id for tour in tours for stop in tour.stops if stop.kind == "target"]
    lost = [target.global_id for tour in tours for target in tour.unreached]
    return tuple(dict.fromkeys(known + planned + lost))


def _storey_names(tour: Tour) -> tuple[str, ...]:
    environment = tour.graph.environment
    if environment is None:
        return tuple(str(index) for index in range(len(tour.graph.frame.elevations)))
    return tuple(storey.name or str(index) for index, storey in enumerate(environment.storeys))
