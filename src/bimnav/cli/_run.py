"""`bimnav run`: the whole job."""

from __future__ import annotations

import argparse
import difflib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bimnav as bn
from bimnav._wording import printable
from bimnav.cli._shared import DONE, INCOMPLETE, length, place, show, show_json, target, warn
from bimnav.detections import read_targets

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands

_LISTED = 5  # conflicts; the report lists them all
_NAMED = 3  # of the targets that share a reason; the report lists them all
_EXAMPLES = """\
examples:
  bimnav run apartment.ifc --task cleaning --cell 0.5ft --out out
  bimnav run house.ifc --target "spill@2.5,1" --target "peel@4,2,Level 2" --cell 0.1 --json
  bimnav run house.ifc --targets detections.csv --robot R2 --radius 0.25 --start -1,1
  bimnav run house.ifc --robot inspection --objective time --smooth --clearance 30cm --end 2,3

lengths are metres; write 1ft, 30cm, 12in or 5mm for other units. exit code 0: done, 2: bad input,
3: some targets are not served (the rest of the job is done).
"""


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    run = commands.add_parser(
        "run",
        help="do a job in a building: plan, check, simulate, write",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument("models", nargs="+", metavar="MODEL.ifc", help="one file, or several of one building")
    run.add_argument("--task", default="cleaning", help="built-in task or path of a task file (default: cleaning)")
    run.add_argument("--cell", type=length, default=0.3048, metavar="SIZE", help="edge of a cell (default: 1ft)")
    run.add_argument("--connectivity", type=int, choices=(4, 8), default=4, help="neighbors of a cell (default: 4)")
    run.add_argument("--start", type=place, metavar="X,Y[,STOREY]", help="default: the charging dock, if there is one")
    run.add_argument(
        "--robot",
        default="R1",
        metavar="NAME|FILE#NAME",
        help="a profile: see `bimnav robots`; any other name is that of the paper's point robot (default: R1)",
    )
    run.add_argument("--radius", type=length, help="of the robot (default: the profile's; 0, the paper's point)")
    run.add_argument("--height", type=length, help="of the robot (default: the profile's; 1)")
    run.add_argument("--speed", type=length, help="metres per second (default: the profile's; 0.5)")
    run.add_argument(
        "--target", type=target, action="append", default=[], metavar="NAME@X,Y[,STOREY]", help="may be repeated"
    )
    run.add_argument("--targets", action="append", default=[], metavar="FILE", help="CSV or JSON of detected objects")
    run.add_argument("--refine", choices=("auto",), help="halve the cells until no target lies on an obstacle cell")
    run.add_argument(
        "--on-conflict",
        choices=("approach", "reach"),
        default="approach",
        help="a target on an obstacle cell: go next to it, or on it as in the paper (default: approach)",
    )
    run.add_argument(
        "--lost",
        choices=("abort", "box", "ignore"),
        default="abort",
        help="elements whose geometry was lost: refuse a way through their place, take their box as an obstacle, "
        "or leave them out (default: abort)",
    )
    run.add_argument("--outdoors", action="store_true", help="floor outside the walls counts, too")
    run.add_argument("--return", dest="return_to_start", action="store_true", help="go back to the start in the end")
    run.add_argument("--end", type=place, metavar="X,Y[,STOREY]", help="where to go behind the last stop")
    run.add_argument(
        "--objective",
        choices=("distance", "time", "energy"),
        help="what paths make least (default: what the task says)",
    )
    run.add_argument(
        "--clearance", type=length, default=0.0, metavar="SIZE", help="distance from obstacles that paths prefer"
    )
    run.add_argument(
        "--smooth", action="store_const", const="any_angle", help="draw the way straight, at any angle, past obstacles"
    )
    run.add_argument("--seed", type=int, default=0, help="for what is random (default: 0)")
    run.add_argument("--out", metavar="DIR", help="write figures, tables and the report here")
    run.add_argument("--json", action="store_true", help="print the whole report as JSON")
    run.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    placed = list(options.target)
    for path in options.targets:
        placed += read_targets(path)
    mission = bn.run(
        options.models,
        task=options.task,
        cell_size=options.cell,
        connectivity=options.connectivity,
        robot=_robot(options),
        start=options.start,
        targets=placed,
        refine=options.refine,
        on_conflict=options.on_conflict,
        return_to_start=options.return_to_start,
        end=options.end,
        objective=options.objective,
        clearance=options.clearance,
        smooth=options.smooth,
        lost=options.lost,
        outdoors=options.outdoors,
        seed=options.seed,
        out=options.out,
    )
    report = mission.report()
    if options.json:
        show_json(report)
    else:
        show(_summary(report, is_point=mission.environment.robot.radius == 0))
    return DONE if mission.is_complete else INCOMPLETE


def _robot(options: argparse.Namespace) -> bn.Robot:
    """Return the profile that is named, with what else was said of the robot."""
    from bimnav.robots import list_robots, robot_named

    known = [profile.name for profile in list_robots()]
    near = difflib.get_close_matches(options.robot, known, 1)
    if near and options.robot not in known:
        warn(f"robot {options.robot!r} is no profile, and so a plain robot of that name; did you mean {near[0]!r}?")
    said = {name: getattr(options, name) for name in ("radius", "height", "speed")}
    said = {name: value for name, value in said.items() if value is not None}
    if "radius" in said:
        said["outline"] = None  # a radius makes a round body
    return replace(robot_named(options.robot), **said)


def _summary(report: dict[str, Any], *, is_point: bool) -> str:
    served = [target for target in report["targets"] if target["reached"]]
    tour, nodes = report["tour"], report["nodes"]
    lines = [
        f"{report['task']} in {report['model']} ({report['schema']})",
        f"  grid     {report['cell_size']:g} m cells: {nodes['regular']} regular, {nodes['obstacle']} obstacle, "
        f"{nodes['target']} target",
        f"  start    ({report['start']['point'][0]:.3f}, {report['start']['point'][1]:.3f}), "
        f"{report['start']['source']}",
        f"  served   {len(served)} of {len(report['targets'])} targets, in this order:",
    ]
    by_id = {target["global_id"]: target for target in report["targets"]}
    for global_id in tour["order"]:
        target = by_id[global_id]
        aside = f", from {target['distance']:.2f} m away" if target["approach"] == "standing" else ""
        x, y, _ = target["destination"]
        lines.append(f"           {printable(target['name'])} at ({x:.3f}, {y:.3f}){aside}")
    best, unit = {"distance": ("shortest", "m"), "time": ("fastest", "s"), "energy": ("thriftiest", "J")}[
        tour["objective"]
    ]
    proved = f"proved {best}" if tour["is_optimal"] else f"at least {tour['lower_bound']:.2f} {unit} is needed"
    along = "straight legs" if tour["is_smooth"] else "the cells"
    lines.append(f"  tour     {tour['length']:.2f} m along {along}, {proved}")
    if tour["end"]:
        lines.append(f"  end      ({tour['end'][0]:.3f}, {tour['end'][1]:.3f})")
    lines += [
        f"  charges  {c['energy_wh']:.1f} Wh at {printable(c['name'])}, {c['detour']:.2f} m aside"
        for c in tour["charges"]
    ]
    lines.append(f"  time     {report['simulation']['makespan']:.1f} s, {tour['duration']:.1f} s of it on the move")
    clearance = report["check"]["clearance"]
    lines.append(
        "  check    the path touches no obstacle"
        + ("" if clearance is None else f"; nearest is {clearance:.3f} m away")
    )
    for conflict in report["conflicts"][:_LISTED]:
        names = ", ".join(printable(o["name"]) for o in conflict["obstacles"])
        lines.append(f"  conflict {printable(conflict['name'])} shares cell {tuple(conflict['cell'])} with {names}")
    if len(report["conflicts"]) > _LISTED:
        lines.append(f"  conflict ... and {len(report['conflicts']) - _LISTED} more targets on obstacle cells")
    lines += [f"  not served: {names}: {reason}" for reason, names in _not_served(report).items()]
    grave = [issue for issue in report["issues"] if issue["severity"] != "info"]
    lines += [f"  {issue['severity']}: {issue['message']}" for issue in grave]
    if is_point:
        lines.append("  robot    a point, as in the paper; --radius and --height give it a body")
    lines += [f"  wrote    {path}" for path in report["files"]]
    return "\n".join(lines)


def _not_served(report: dict[str, Any]) -> dict[str, str]:
    """Return who shares a reason for not being served: a few by name, and how many more."""
    names: dict[str, list[str]] = {}
    for one in report["targets"]:
        if not one["reached"]:
            names.setdefault(one["reason"], []).append(printable(one["name"]))
    return {
        reason: ", ".join(shared[:_NAMED]) + (f" and {len(shared) - _NAMED} more" if len(shared) > _NAMED else "")
        for reason, shared in names.items()
    }
