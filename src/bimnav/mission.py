"""The whole job in one call: read, plan, check, simulate, write."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import shapely

from bimnav._lost import Lost, refuse_lost, with_boxes
from bimnav._report import report_of, write_mission
from bimnav._start import Start, find_end, find_start
from bimnav.building import Building, Detection
from bimnav.environment import IndoorEnvironment, Place, make_environment
from bimnav.errors import (
    NoTargetError,
    OutputError,
    OutsideMapError,
)
from bimnav.graph import NavGraph, Objective, build_graph
from bimnav.robot import Robot

if TYPE_CHECKING:
    from bimnav._progress import Progress
    from bimnav.plan import Tour
    from bimnav.plan.paths import Smooth
    from bimnav.sim import SimResult
    from bimnav.tasks import Task
    from bimnav.verify import Check

__all__ = ["Mission", "run"]


@dataclass(frozen=True, slots=True, eq=False)
class Mission:
    """A job done: every stage's value, and the files written."""

    building: Building
    task: Task
    environment: IndoorEnvironment
    graph: NavGraph
    start: Start
    tour: Tour
    check: Check
    result: SimResult
    files: tuple[Path, ...] = ()

    @property
    def is_complete(self) -> bool:
        """Whether every target is served."""
        return not self.tour.unreached

    def report(self) -> dict[str, Any]:
        """Return the whole job as plain values, the object `bimnav run --json` prints."""
        return report_of(self)


def run(
    model: str | Path | Building | Sequence[str | Path],
    *,
    task: str | Task = "cleaning",
    cell_size: float = 0.3048,
    connectivity: Literal[4, 8] = 4,
    robot: Robot | None = None,
    start: Place | None = None,
    targets: Iterable[Detection | Mapping[str, Any] | Sequence[Any]] = (),
    refine: Literal["auto"] | None = None,
    on_conflict: Literal["approach", "reach"] = "approach",
    return_to_start: bool = False,
    end: Place | None = None,
    objective: Objective | None = None,
    clearance: float = 0.0,
    smooth: Smooth | None = None,
    outdoors: bool = False,
    lost: Lost | Mapping[str, Lost] = "abort",
    seed: int = 0,
    out: str | Path | None = None,
    progress: bool | Progress | None = None,
) -> Mission:
    """Do the whole job: find targets and obstacles, plan a tour, check it, play it, write it out.

    Parameters
    ----------
    model
        Path of an IFC file, paths of several files of one building, or a building.
    task
        Name of a built-in task, path of a task file, or a task.
    cell_size
        Edge of a cell in metres; the default is the paper's foot.
    connectivity
        Neighbors of a cell, 4 or 8.
    robot
        The default is the paper's point robot.
    start
        `(x, y)` or `(x, y, storey)` in metres. Without it: the charging dock if the model has one, else
        near the middle of the largest region of the lowest walkable storey.
    targets
        Targets placed by the user, added to what the task finds.
    refine, on_conflict
        As for `build_graph`.
    return_to_start
        Whether the robot goes back in the end.
    end
        `(x, y)` or `(x, y, storey)` in metres: where the robot goes behind its last stop; None for
        nowhere.
    objective
        What paths make least, `distance`, `time` or `energy`; None for what the task says.
    clearance
        Distance from obstacles that paths prefer, metres, beyond the robot's radius; see
        `NavGraph.with_clearance`.
    smooth
        `any_angle` draws the legs straight; None leaves them on the cells.
    outdoors
        Whether floor outside the walls counts, too.
    lost
        What becomes of elements whose geometry was lost: `abort` refuses a way through their place, `box`
        takes the box they lie in as an obstacle, `ignore` leaves them out. Or a treatment by GlobalId.
    seed
        For what is random in the simulation.
    out
        Folder for figures, tables and the report; without it nothing is written.
    progress
        As for `read_ifc`.

    Raises
    ------
    NoTargetError
        If there is nothing to do.
    IncompleteModelError
        If the way leads through a place where an obstacle was lost.
    UnsafePlanError
        If the independent check refuses the path; it is not returned.
    BimnavError
        Other leaves for input that cannot be used.
    """
    from bimnav.ifc import read_ifc
    from bimnav.plan import plan_tour
    from bimnav.sim import simulate
    from bimnav.sim.chance import seeded
    from bimnav.tasks import load_task

    rng = seeded(seed)
    if out is not None and not str(out):
        raise OutputError("out names no folder.", "Name one, or leave it out to write nothing.", {"out": ""})
    loaded = load_task(str(task)) if isinstance(task, (str, Path)) else task
    building = model if isinstance(model, Building) else read_ifc(model, progress=progress)
    building = with_boxes(building.with_targets(targets), lost)
    environment = make_environment(building, loaded, robot, start=start, outdoors=outdoors)
    if not environment.targets:
        raise NoTargetError(
            f"task {loaded.name!r} finds no target in {building.name!r}.",
            "Place one with --target NAME@X,Y or targets=[...], or choose another task: `bimnav tasks list`.",
            {"task": loaded.name, "model": building.name},
        )
    graph = build_graph(
        environment,
        cell_size=cell_size,
        connectivity=connectivity,
        refine=refine,
        on_conflict=on_conflict,
        objective=loaded.objective if objective is None else objective,
        clearance=clearance,
    )
    _refuse_targets_outside(graph, environment)
    begin = find_start(graph, start)
    last = None if end is None else find_end(graph, end)
    tour = plan_tour(
        graph,
        begin.cell,
        start_point=begin.point,
        return_to_start=return_to_start,
        end=None if last is None else last.cell,
        end_point=None if last is None else last.point,
        smooth=smooth,
    )
    refuse_lost(tour, lost)
    tour, check = _checked(tour, smooth)
    result = simulate(tour, rng=rng)
    mission = Mission(building, loaded, environment, tour.graph, begin, tour, check, result)
    return mission if out is None else write_mission(mission, Path(out))


def _refuse_targets_outside(graph: NavGraph, environment: IndoorEnvironment) -> None:
    """Refuse a target that the user placed where there is neither floor nor an obstacle."""
    for target, cell in graph.targets:
        if cell is None or target.source != "user" or graph.free[cell] or graph.obstacle[cell]:
            continue
        x, y, _ = target.destination
        if not environment.floor(target.storey).intersects(shapely.Point(x, y)):
            raise OutsideMapError(
                f"target {target.name!r} at ({x:g}, {y:g}) on {environment.storeys[target.storey].name!r} "
                "lies on no floor.",
                "Give a point inside a room, and the storey if it is not the lowest one there.",
                {"name": target.name, "x": x, "y": y, "storey": environment.storeys[target.storey].name},
            )


def _checked(tour: Tour, smooth: Smooth | None) -> tuple[Tour, Check]:
    """Judge a tour; where the paper's rule led into an obstacle, stand next to it instead."""
    from bimnav.plan import plan_tour
    from bimnav.verify import check_plan

    check = check_plan(tour)
    reached = [stop.cell for stop in tour.stops if stop.approach == "reach"]
    if not check.ok and reached:
        tour = plan_tour(
            tour.graph.block(reached),
            tour.start,
            start_point=tour.start_point,
            return_to_start=tour.return_to_start,
            end=tour.end,
            end_point=tour.end_at,
            smooth=smooth,
        )
        check = check_plan(tour)
    check.raise_if_unsafe()
    return tour, check
