"""What happened when plans were played."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._files import write_text
from bimnav.errors import InputError, MissingExtraError
from bimnav.robot import Robot
from bimnav.sim.clearance import (
    Encounter,
    clearance_to_people,
    clearance_to_robots,
    clearance_to_walls,
    encounters,
)
from bimnav.sim.log import EventLog, dataframe_of
from bimnav.sim.people import Person, Walker
from bimnav.sim.track import RobotState, RobotStatus, Track

if TYPE_CHECKING:
    from os import PathLike

    import pandas

    from bimnav.plan import Tour
    from bimnav.stops import Stop

__all__ = ["SimResult", "Tally"]

_FIELDS = [("t", np.float64), ("x", np.float64), ("y", np.float64), ("z", np.float64), ("heading", np.float64)]


@dataclass(frozen=True, slots=True)
class Tally:
    """What one robot did, in sums.

    Parameters
    ----------
    seconds
        In every status.
    distance
        Metres driven; rides in lifts do not count.
    charge_distance
        Of these, on ways to chargers.
    used, charged
        Joules drawn from the battery, and given by chargers.
    level
        Joules left; inf for a robot that never tires.
    served
        GlobalIds of the targets it served, in that order.
    """

    seconds: dict[RobotStatus, float]
    distance: float
    charge_distance: float
    used: float
    charged: float
    level: float
    served: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SimResult:
    """What happened when one tour, or several, were played.

    Parameters
    ----------
    robots
        The robots that drove.
    tours
        What each was told to do.
    log
        Every event.
    tracks
        Where each was, and what it did, at every moment; empty if no history was kept.
    tallies
        What each did, in sums.
    stops
        Of each, those of its tour and those it was given later.
    targets
        GlobalIds of all targets of the world, in tours or not.
    given_up
        GlobalIds of targets that a robot set out for, or had to do, and left undone.
    unreached
        GlobalIds of targets no robot could be sent to.
    storeys
        Names of the storeys, by index.
    span
        Seconds on the clock at the start and at the last event of a robot.
    people
        Who walked around.
    """

    robots: tuple[Robot, ...]
    tours: tuple[Tour, ...]
    log: EventLog
    tracks: tuple[Track, ...]
    tallies: tuple[Tally, ...]
    stops: tuple[tuple[Stop, ...], ...]
    targets: tuple[str, ...]
    given_up: tuple[str, ...]
    unreached: tuple[str, ...]
    storeys: tuple[str, ...]
    span: tuple[float, float]
    people: tuple[Person, ...] = ()
    _walkers: tuple[Walker, ...] = field(default=(), repr=False)

    def __repr__(self) -> str:
        names = repr(self.robots[0].name) if len(self.robots) == 1 else f"{len(self.robots)} robots"
        return (
            f"SimResult({names}: {len(self.served)} of {len(self.targets)} targets served, "
            f"{self.distance:.2f} m in {self.makespan:.1f} s, {len(self.log)} events)"
        )

    def _repr_html_(self) -> str:
        """Return a card for a notebook; `to_html` is the replay."""
        from bimnav._cards import card

        rows = [
            ("robots", ", ".join(robot.name for robot in self.robots[:9])),
            ("served", f"{len(self.served)} of {len(self.targets)} targets"),
            ("driven", f"{self.distance:.1f} m in {self.makespan:.1f} s"),
            ("energy", f"{self.energy / 3600:.1f} Wh" if self.energy else None),
            ("events", len(self.log)),
        ]
        return card("Simulation", rows)

    # --- one robot

    @property
    def robot(self) -> Robot:
        """The robot that drove, if it was one."""
        return self.robots[self._index(None)]

    @property
    def tour(self) -> Tour:
        """What the robot was told to do, if it was one."""
        return self.tours[self._index(None)]

    @property
    def track(self) -> Track:
        """Where the robot was, if it was one."""
        return self.track_of(None)

    def track_of(self, robot: str | None) -> Track:
        """Return where a robot was, and what it did, at every moment.

        Parameters
        ----------
        robot
            Its name; None if there is only one.
        """
        index = self._index(robot)
        if not self.tracks:
            raise InputError("no history was kept.", "Simulate with history=True.")
        return self.tracks[index]

    def _index(self, robot: str | None) -> int:
        names = [each.name for each in self.robots]
        if robot is None and len(names) == 1:
            return 0
        if robot not in names:
            said = "there are several robots" if robot is None else f"no robot is called {robot!r}"
            raise InputError(f"{said}.", f"Name one: {', '.join(map(repr, names[:9]))}.")
        return names.index(robot)

    # --- sums

    @property
    def makespan(self) -> float:
        """Seconds from the start to the last event of a robot."""
        return self.span[1] - self.span[0]

    @property
    def distance(self) -> float:
        """Metres driven by all robots."""
        return math.fsum(tally.distance for tally in self.tallies)

    @cached_property
    def served(self) -> tuple[str, ...]:
        """GlobalIds of the targets that were served, in that order."""
        if self.log.rows:
            return tuple(dict.fromkeys(row.target for row in self.log if row.event == "end_service"))
        return tuple(dict.fromkeys(target for tally in self.tallies for target in tally.served))

    @property
    def energy(self) -> float:
        """Joules drawn by all robots."""
        return math.fsum(tally.used for tally in self.tallies)

    @property
    def metrics(self) -> dict[str, float]:
        """What the simulation comes to, as numbers.

        `makespan` (s), `distance` (m), seconds in every status of all robots, `energy` (J), `charge_distance`
        (m driven to chargers), `utilisation` (share of the robots' time that they drove, worked or charged),
        numbers of targets `served`, `given_up` and `unreached`, and `coverage`: the share of targets served.
        If history was kept and there was anything to keep away from, `clearance`: the least metres from a robot's
        body to walls, people and other robots.
        """
        seconds = {s: math.fsum(tally.seconds[s] for tally in self.tallies) for s in RobotStatus}
        busy = seconds[RobotStatus.MOVING] + seconds[RobotStatus.WORKING] + seconds[RobotStatus.CHARGING]
        whole = self.makespan * len(self.robots)
        return {
            "makespan": self.makespan,
            "distance": self.distance,
            **{str(status): value for status, value in seconds.items()},
            "energy": self.energy,
            "charge_distance": math.fsum(tally.charge_distance for tally in self.tallies),
            "utilisation": busy / whole if whole > 0 else 0.0,
            "served": len(self.served),
            "given_up": len(self.given_up),
            "unreached": len(self.unreached),
            "coverage": len(self.served) / len(self.targets) if self.targets else 1.0,
            **{name: value for name, value in self._closest() if math.isfinite(value)},
        }

    @cached_property
    def encounters(self) -> tuple[Encounter, ...]:
        """Every spell in which bodies of two robots shared floor; a plan without conflicts has none."""
        self.track_of(self.robots[0].name)
        return encounters(self.robots, self.tracks)

    @cached_property
    def clearance(self) -> dict[str, float]:
        """The least distance, in metres, from a robot's body to `walls`, `people` and other `robots`.

        Walls are all obstacles of the model. inf where there is nothing to keep away from; below 0 as far as
        bodies overlapped.
        """
        self.track_of(self.robots[0].name)
        environment = self.tours[0].graph.environment
        return {
            "walls": clearance_to_walls(environment, self.robots, self.tracks),
            "people": clearance_to_people(self.robots, self.tracks, self._walkers),
            "robots": clearance_to_robots(self.robots, self.tracks),
        }

    def _closest(self) -> list[tuple[str, float]]:
        return [("clearance", min(self.clearance.values()))] if self.tracks else []

    # --- moments

    def state_at(self, time: float, robot: str | None = None) -> RobotState:
        """Return what a robot does at a time, and where.

        Before the start and after the end the robot stands where it started and ended. At the time of an
        event the state is the one after it.

        Parameters
        ----------
        time
            Seconds, on the clock of the log.
        robot
            Its name; None if there is only one.
        """
        time = _checks.number("time", time)
        index, track = self._index(robot), self.track_of(robot)
        row = int(track.rows_at(time))
        x, y, z = track.points_at(time).tolist()
        early = time < track.times[0]
        stop = -1 if early else int(track.stops[row])
        return RobotState(
            time,
            self.robots[index].name,
            RobotStatus.IDLE if early else RobotStatus(str(track.statuses[row])),
            x,
            y,
            z,
            float(track.headings_at(time)),
            self.storeys[track.storeys[row]],
            self.stops[index][stop].global_id if stop >= 0 else "",
        )

    def states_at(self, time: float) -> tuple[RobotState, ...]:
        """Return what every robot does at a time; see `state_at`."""
        return tuple(self.state_at(time, robot.name) for robot in self.robots)

    def people_at(self, time: float) -> dict[str, tuple[float, float, int]]:
        """Return where everybody is who walks around at a time: x, y in metres, and the index of the storey."""
        places = ((walker.person, walker.point_at(time)) for walker in self._walkers)
        return {person.name: (*place, person.storey) for person, place in places if place is not None}

    def present_targets(self, time: float) -> tuple[str, ...]:
        """Return the GlobalIds of the targets that are still there at a time; what was served is gone."""
        time = _checks.number("time", time)
        gone = {row.target for row in self.log if row.event == "remove" and row.time <= time}
        return tuple(target for target in self.targets if target not in gone)

    def to_html(self, path: str | PathLike[str] | None = None, *, title: str | None = None) -> str:
        """Return the replay, a page that shows building and robots in three dimensions, and write it to a file.

        The page is whole in itself: it opens from disk and asks nothing of a network.

        Parameters
        ----------
        path
            File to write; None for none.
        title
            The default is the task and the model.

        Raises
        ------
        InputError
            If no history was kept.
        OutputError
            If the file cannot be written.
        """
        from bimnav.viewer import replay_page

        page = replay_page(self, title=title)
        if path is not None:
            write_text(path, page)
        return page

    def show(self, *, height: int = 600) -> Any:
        """Return the replay as something that a notebook displays.

        The page is whole in the notebook; it can be as large as the building asks for, some megabytes.

        Parameters
        ----------
        height
            Of the frame, pixels.

        Returns
        -------
        display : IPython.display.HTML
            To be the last value of a cell.

        Raises
        ------
        MissingExtraError
            If IPython is not installed, outside of notebooks.
        InputError
            If no history was kept.
        """
        import html

        _checks.whole("height", height, 1)
        try:
            from IPython import display
        except ImportError as error:
            raise MissingExtraError("show needs IPython.", "Call it in a notebook, or write to_html.") from error
        page = html.escape(self.to_html(), quote=True)
        style = "width:100%;border:1px solid #ddd8cf;border-radius:6px"
        # the frame has an origin of its own: what is in the page cannot touch the notebook
        frame = (
            f'<iframe srcdoc="{page}" sandbox="allow-scripts" title="replay" height="{int(height)}" style="{style}">'
        )
        return display.HTML(f"<div>{frame}</iframe></div>")  # type: ignore[no-untyped-call]

    # --- tables

    def trajectory(self, step: float | None = None, robot: str | None = None) -> NDArray[Any]:
        """Return the motion of one robot as a table.

        Parameters
        ----------
        step
            Seconds between rows; None for a row wherever the motion changes.
        robot
            Its name; None if there is only one.

        Returns
        -------
        table : (n,) structured
            Fields `time` (s), `x`, `y`, `z` (m), `heading` (rad) and `status` (text); times rise, and the
            last row is the end.
        """
        if step is not None:
            _checks.number("step", step)
        return self.track_of(robot).trajectory(step)

    def trajectories(self, step: float | None = None) -> NDArray[Any]:
        """Return the motion of all robots as one table.

        Parameters
        ----------
        step
            Seconds between rows; None for a row wherever the motion of a robot changes.

        Returns
        -------
        table : (n,) structured
            Fields `id` (name), `t` (s), `x`, `y`, `z` (m), `heading` (rad) and `state` (text), robot by robot.
        """
        width = max(len(robot.name) for robot in self.robots)
        kind = np.dtype([("id", f"U{max(width, 1)}"), *_FIELDS, ("state", "U8")])
        parts = []
        for robot in self.robots:
            motion = self.trajectory(step, robot.name)
            table = np.empty(len(motion), dtype=kind)
            table["id"] = robot.name
            for name, source in (("t", "time"), ("state", "status"), *((axis, axis) for axis in "xyz")):
                table[name] = motion[source]
            table["heading"] = motion["heading"]
            parts.append(table)
        return np.concatenate(parts)

    def to_dataframe(self, step: float | None = None) -> pandas.DataFrame:
        """Return the motion of all robots as a pandas data frame; see `trajectories`.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        return dataframe_of(self.trajectories(step))

    def route_rows(self, robot: str | None = None) -> list[tuple[float, float, str, float]]:
        """Return `(x, y, storey, time)` wherever the motion of a robot changes, in execution order: m, name, s."""
        track = self.track_of(robot)
        kept = track.kept_rows()
        columns = track.points[kept, :2], track.storeys[kept], track.times[kept]
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return [(x, y, self.storeys[storey], time) for (x, y), storey, time in rows]
