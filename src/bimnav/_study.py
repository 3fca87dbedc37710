"""Studies: one building, many scenarios, played in parallel. The only module that imports joblib.

Graphs are made here, once for every cell size and set of closed doors; workers get a graph without its
building, so that they neither read nor hold the model.
"""

from __future__ import annotations

import itertools
import json
import logging
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from bimnav import _checks
from bimnav._files import write_text
from bimnav._progress import Display, Progress
from bimnav.environment import IndoorEnvironment, Place
from bimnav.errors import BimnavError, InputError, MissingExtraError, ValueRangeError
from bimnav.graph import NavGraph, build_graph
from bimnav.grid import Cell
from bimnav.robot import Robot
from bimnav.sim.log import csv_text, dataframe_of
from bimnav.stops import Stop, Unreached

if TYPE_CHECKING:
    import pandas

__all__ = ["Study", "study"]

_LOG = logging.getLogger(__name__)

Row: TypeAlias = dict[str, Any]
Backend: TypeAlias = Literal["serial", "threads", "processes", "dask"]

_SETTINGS = ("start", "cell_size", "robots", "speed", "closed_doors", "seed")
_RESULTS = (
    "stops",
    "unreached",
    "conflicts",
    "length",
    "makespan",
    "distance",
    "waiting",
    "energy",
    "served",
    "coverage",
    "encounters",
    "error",
)
_JOBLIB = {"threads": "threading", "processes": "loky", "dask": "dask"}
_BATCHES = 4  # per worker; finished rows are kept after each


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """What came of every scenario.

    Parameters
    ----------
    rows
        One dictionary for every scenario, in the order of the grid: its settings (`start`, `cell_size`,
        `robots`, `speed`, `closed_doors`, `seed`), then `stops` and `unreached` targets of the plan, target
        cells in `conflicts` with obstacles, planned `length` (m), and of the simulation `makespan` (s),
        `distance` (m), `waiting` (s), `energy` (J), targets `served`, `coverage`, and `encounters`: spells in
        which bodies of robots shared floor. `error` says why a scenario could not be played; then results
        are None.
    """

    rows: tuple[Row, ...]

    columns = (*_SETTINGS, *_RESULTS)

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        errors = Counter(row["error"] for row in self.rows if row["error"])
        if self.is_in_vain:
            why, count = errors.most_common(1)[0]
            most = f"{count} times, " if count < len(self) else ""
            return f"Study(none of {len(self)} scenarios could be played: {most}{why})"
        return f"Study({len(self)} scenarios, {errors.total()} not played)"

    @property
    def is_in_vain(self) -> bool:
        """Whether not one scenario could be played."""
        return bool(self.rows) and all(row["error"] for row in self.rows)

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        from bimnav._cards import card, counted

        played = [row for row in self.rows if not row["error"]]
        rows: list[tuple[str, Any]] = [("played", f"{len(played)} of {len(self)}")]
        for name in _SETTINGS:
            values = list(dict.fromkeys(row[name] for row in self.rows))
            if len(values) > 1:
                more = f" and {len(values) - 6} others" if len(values) > 6 else ""
                rows.append((name.replace("_", " "), "; ".join(str(value) or "none" for value in values[:6]) + more))
        for name, unit in (("length", "m"), ("makespan", "s"), ("waiting", "s"), ("conflicts", "")):
            found = [row[name] for row in played]
            if found:
                rows.append((name, f"{min(found):.4g} to {max(found):.4g} {unit}".rstrip()))
        rows.append(("not played", counted(row["error"] for row in self.rows if row["error"])))
        return card(f"Study of {len(self)} scenarios", rows)

    def summary(self, result: str, by: Sequence[str] = _SETTINGS[:-1], *, confidence: float = 0.95) -> list[Row]:
        """Sum up one result over scenarios that share some settings, such as all seeds of each.

        Parameters
        ----------
        result
            Name of a column of results.
        by
            Settings that tell the groups apart.
        confidence
            Of the interval around the mean, by Student's distribution of the mean of independent runs.

        Returns
        -------
        groups
            The settings of each, `n`, `mean`, and `low` and `high`: the interval's ends, None for a single
            run. Scenarios that were not played are left out.
        """
        from scipy import stats

        by = _checks.many("by", by, str)
        if (
            result not in _RESULTS[:-1]
            or not set(by) <= set(_SETTINGS)
            or not 0 < _checks.number("confidence", confidence) < 1
        ):
            raise ValueRangeError(
                f"no summary of {result!r} by {tuple(by)} at {confidence}.",
                f"Results are {', '.join(_RESULTS[:-1])}; settings are {', '.join(_SETTINGS)}; 0 < confidence < 1.",
            )
        groups: dict[tuple[Any, ...], list[float]] = {}
        for row in self.rows:
            if not row["error"]:
                groups.setdefault(tuple(row[name] for name in by), []).append(float(row[result]))
        summed = []
        for key, values in groups.items():
            n, mean = len(values), math.fsum(values) / len(values)
            half = None
            if n > 1:
                spread = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (n - 1))
                half = float(stats.t.ppf((1 + confidence) / 2, n - 1)) * spread / math.sqrt(n)
            low, high = (None, None) if half is None else (mean - half, mean + half)
            summed.append(dict(zip(by, key, strict=True)) | {"n": n, "mean": mean, "low": low, "high": high})
        return summed

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """Write the rows as comma-separated values; see `EventLog.to_csv`."""
        text = csv_text(self.columns, ([row[name] for name in self.columns] for row in self.rows))
        if path is not None:
            write_text(path, text)
        return text

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the rows as a pandas data frame.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        return dataframe_of(list(self.rows), columns=list(self.columns))


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """What a worker gets: a graph without its building, where to start, and the scenarios played there."""

    graph: NavGraph
    start: Cell
    stops: tuple[Stop, ...]
    unreached: tuple[Unreached, ...]
    conflicts: int
    settings: tuple[Row, ...]
    robot: Robot
    connectivity: int
    options: Mapping[str, Any]


def study(
    environment: IndoorEnvironment,
    *,
    starts: Iterable[Place],
    cell_sizes: Iterable[float] = (0.3048,),
    robots: Iterable[int] = (1,),
    speeds: Iterable[float] | None = None,
    closed_doors: Iterable[Sequence[str]] = ((),),
    seeds: Iterable[int] = (0,),
    connectivity: Literal[4, 8] = 4,
    options: Mapping[str, Any] | None = None,
    backend: Backend = "serial",
    workers: int = 2,
    file: str | PathLike[str] | None = None,
    progress: bool | Progress | None = None,
) -> Study:
    """Plan and play every combination of settings in one building.

    Parameters
    ----------
    environment
        The building, for one task and one robot.
    starts
        Where robots begin: `(x, y)` or `(x, y, storey)`, metres.
    cell_sizes
        Edges of cells, metres.
    robots
        Numbers of robots; several share the stops, and begin in free cells around the start.
    speeds
        Of the robots, metres per second; the default is the robot's own.
    closed_doors
        Sets of doors, by GlobalId, that are closed for all.
    seeds
        For what is random in the simulation.
    connectivity
        Neighbors of a cell, 4 or 8.
    options
        More arguments of `simulate`, such as `service_time` or `people`. For processes and clusters they
        must be picklable.
    backend
        `serial`, `threads`, `processes`, or `dask`: the cluster of the `dask.distributed.Client` at hand.
    workers
        How many threads or processes; a cluster has its own.
    file
        Where finished rows are kept, one JSON object a line; a study that was cut short goes on from there.
        The file is always whole: it is written anew, then put in its place.
    progress
        As in `read_ifc`: whether to show how far the study is, or a function to call with scenarios done,
        their total, and a word.

    Returns
    -------
    study
        One row for every scenario, the same for every backend. That none could be played is logged as a warning.

    Raises
    ------
    InputError
        If a list of settings is empty, or the file is that of another study.
    MissingExtraError
        If dask is not installed.
    """
    _checks.need("environment", environment, IndoorEnvironment)
    _checks.need("options", options, Mapping, or_none=True)
    _checks.whole("workers", workers, 1)
    if connectivity not in (4, 8):
        raise ValueRangeError(f"connectivity is {connectivity!r:.80}.", "Give 4 or 8.")
    if backend not in ("serial", *_JOBLIB):
        known = ", ".join(map(repr, ("serial", *_JOBLIB)))
        raise ValueRangeError(f"backend is {backend!r}.", f"Give one of {known}.")
    own = [environment.robot.speed]
    lists: dict[str, list[Any]] = {
        "start": [_checks.many("a start", start) for start in _checks.many("starts", starts)],
        "cell_size": [_checks.number("a cell size", size) for size in _checks.many("cell_sizes", cell_sizes)],
        "robots": [_checks.whole("a number of robots", count, 1) for count in _checks.many("robots", robots)],
        "speed": [
            _checks.number("a speed", speed) for speed in _checks.many("speeds", own if speeds is None else speeds)
        ],
        "closed_doors": [
            _checks.many("a set of doors", doors, str) for doors in _checks.many("closed_doors", closed_doors)
        ],
        "seed": [_checks.whole("a seed", seed, 0) for seed in _checks.many("seeds", seeds)],
    }
    empty = [name for name, values in lists.items() if not values]
    if empty:
        raise InputError(f"there is no {', no '.join(empty)} to try.", "Give at least one of each setting.")
    grid = [
        dict(zip(lists, combination, strict=True)) | {"closed_doors": " ".join(combination[4])}
        for combination in itertools.product(*lists.values())
    ]
    for row in grid:
        row["start"] = " ".join(str(value) for value in row["start"])
    file = None if file is None else _checks.path("file", file)
    done = {} if file is None else _kept(file)
    places = {" ".join(str(value) for value in start): start for start in lists["start"]}
    doors = {" ".join(names): names for names in lists["closed_doors"]}
    missing = [row for row in grid if _key(row) not in done]
    with Display("study", progress) as report:
        report(len(grid) - len(missing), len(grid), "scenarios")
        for batch in _batches(missing, 1 if backend == "serial" else workers * _BATCHES):
            jobs = _jobs(environment, batch, places, doors, connectivity, dict(options or {}))
            for rows in _play_all([job for job in jobs if isinstance(job, _Job)], backend, workers):
                done |= {_key(row): row for row in rows}
            done |= {_key(row): row for row in jobs if isinstance(row, dict)}
            if file is not None:
                lines = [json.dumps(done[_key(row)], allow_nan=False) for row in grid if _key(row) in done]
                write_text(file, "".join(f"{line}\n" for line in lines))
            report(len(done), len(grid), "scenarios")
    found = Study(tuple(done[_key(row)] for row in grid))
    if found.is_in_vain:
        _LOG.warning("%r", found)
    return found


def _key(row: Mapping[str, Any]) -> str:
    return json.dumps([row[name] for name in _SETTINGS])


def _kept(file: Path) -> dict[str, Row]:
    """Read the rows of a study that was cut short."""
    if not file.exists():
        return {}
    try:
        rows = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
        if any(list(row) != list(Study.columns) for row in rows):
            raise InputError(f"{file} holds other columns.", "Name another file.", {"path": str(file)})
        return {_key(row): row for row in rows}
    except (ValueError, AttributeError, TypeError) as error:
        raise InputError(f"{file} holds no rows of a study: {error}", "Name another file.") from error


def _batches(rows: list[Row], size: int) -> Iterable[list[Row]]:
    """Yield rows that share graph and start together, some groups at a time."""
    groups = [list(group) for _, group in itertools.groupby(sorted(rows, key=_place), key=_place)]
    for k in range(0, len(groups), size):
        yield [row for group in groups[k : k + size] for row in group]


def _place(row: Row) -> tuple[Any, ...]:
    return row["cell_size"], row["closed_doors"], row["start"]


def _jobs(
    environment: IndoorEnvironment,
    rows: Sequence[Row],
    places: Mapping[str, Place],
    doors: Mapping[str, Sequence[str]],
    connectivity: Literal[4, 8],
    options: Mapping[str, Any],
) -> list[_Job | Row]:
    """Return one job for every graph and start; rows instead for those where no robot can begin."""
    jobs: list[_Job | Row] = []
    graphs: dict[tuple[float, str], NavGraph] = {}
    for _, group in itertools.groupby(rows, key=_place):
        scenarios = tuple(group)
        size, closed = scenarios[0]["cell_size"], scenarios[0]["closed_doors"]
        try:
            if (size, closed) not in graphs:
                graph = build_graph(environment, cell_size=size, connectivity=connectivity)
                for door in doors[closed]:
                    graph = graph.close_door(door)
                graphs[size, closed] = graph
            graph = graphs[size, closed]
            start = _start(graph, environment, places[scenarios[0]["start"]])
            stops, unreached = graph.stops_from(start)
        except BimnavError as error:
            jobs += [_not_played(row, error) for row in scenarios]
            continue
        bare = replace(graph, environment=None, targets=(), conflicts=())
        task = environment.task
        service = tuple(
            replace(stop, service_time=task.service_time if stop.service_time is None else stop.service_time)
            for stop in stops
        )
        found = len(graph.conflicts)
        jobs.append(_Job(bare, start, service, unreached, found, scenarios, environment.robot, connectivity, options))
    return jobs


def _start(graph: NavGraph, environment: IndoorEnvironment, place: Place) -> Cell:
    storey = environment.storeys_at(place)[0]
    cell = graph.frame.cell_at(float(place[0]), float(place[1]), storey=storey)
    if not graph.free[cell]:
        raise InputError(f"the start ({place[0]}, {place[1]}) is blocked: {cell}.")
    return cell


def _play_all(jobs: Sequence[_Job], backend: Backend, workers: int) -> Iterable[list[Row]]:
    if backend == "serial" or not jobs:
        return [_play(job) for job in jobs]
    import joblib

    if backend == "dask":
        try:
            from distributed import get_client
        except ImportError as error:
            raise MissingExtraError("the dask backend needs dask.", "pip install 'bimnav[cluster]'") from error
        try:
            get_client()
        except ValueError as error:
            raise InputError(
                "no cluster is at hand.", "Make one first: client = dask.distributed.Client(...)."
            ) from error
    with joblib.parallel_config(backend=_JOBLIB[backend]):
        count = None if backend == "dask" else workers
        rows: list[list[Row]] = joblib.Parallel(n_jobs=count)(joblib.delayed(_play)(job) for job in jobs)
    return rows


def _play(job: _Job) -> list[Row]:
    return [_played(job, row) for row in job.settings]


def _played(job: _Job, settings: Row) -> Row:
    """Plan and play one scenario."""
    from bimnav.plan import plan_tour, plan_tours
    from bimnav.sim import simulate
    from bimnav.sim.chance import seeded

    one = replace(job.robot, speed=settings["speed"])
    count = settings["robots"]
    try:
        plan: Any
        if count == 1:
            plan = plan_tour(job.graph, job.start, job.stops, robot=one, chargers=())
            length, fleet = plan.length, [one]
        else:
            fleet = [replace(one, name=f"{one.name}-{k + 1}") for k in range(count)]
            plan = plan_tours(job.graph, _around(job.graph, job.start, fleet), job.stops, robots=fleet, chargers=())
            length = plan.length
        lost = len(plan.unreached) + len(job.unreached)
        result = simulate(plan, robots=fleet, rng=seeded(settings["seed"]), **job.options)
    except BimnavError as error:
        return _not_played(settings, error)
    metrics = result.metrics
    found = {
        "stops": len(job.stops),
        "unreached": lost,
        "conflicts": job.conflicts,
        "length": float(length),
        "makespan": float(metrics["makespan"]),
        "distance": float(metrics["distance"]),
        "waiting": float(metrics["waiting"] + metrics["blocked"]),
        "energy": float(metrics["energy"]),
        "served": int(metrics["served"]),
        "coverage": metrics["served"] / max(len(job.stops) + len(job.unreached), 1),
        "encounters": len(result.encounters),
        "error": "",
    }
    return settings | found


def _around(graph: NavGraph, start: Cell, fleet: Sequence[Robot]) -> list[Cell]:
    """Return free cells around a start, nearest first, in which robots stand side by side."""
    apart = max(2 * fleet[0].radius, graph.frame.cell_size)
    cells = np.argwhere(graph.components == graph.components[start])
    cells = cells[cells[:, 0] == start.storey]
    away = np.round(np.hypot(cells[:, 1] - start.row, cells[:, 2] - start.col), 9)
    chosen: list[Cell] = []
    for k in np.lexsort((cells[:, 2], cells[:, 1], away)).tolist():
        cell = Cell(*(int(value) for value in cells[k]))
        point = graph.frame.center_of(cell)
        if all(math.dist(point, graph.frame.center_of(other)) >= apart - 1e-9 for other in chosen):
            chosen.append(cell)
            if len(chosen) == len(fleet):
                return chosen
    raise InputError(f"{len(fleet)} robots do not fit around the start.", "Use fewer, or start in a larger room.")


def _not_played(settings: Row, error: BimnavError) -> Row:
    return settings | dict.fromkeys(_RESULTS) | {"error": str(error)}
