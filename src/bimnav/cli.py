"""The command line: `bimnav run`, `inspect`, `tasks`, `cache` and `doctor`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import bimnav as bn
from bimnav.detections import parse_length, parse_place, parse_target, read_targets
from bimnav.errors import BimnavError, UnsafePlanError

__all__ = ["main"]

_DONE, _BUG, _BAD_INPUT, _INCOMPLETE, _INTERRUPTED = 0, 1, 2, 3, 130
_SIGNED = (
    "--start",
    "--target",
    "--cell",
    "--radius",
    "--height",
    "--speed",
)  # their values may begin with a minus

_RUN_EXAMPLES = """\
examples:
  bimnav run apartment.ifc --task cleaning --cell 0.5ft --out out
  bimnav run house.ifc --target "spill@2.5,1" --target "peel@4,2,Level 2" --cell 0.1 --json
  bimnav run house.ifc --targets detections.csv --robot R2 --radius 0.25 --start -1,1

lengths are metres; write 1ft, 30cm, 12in or 5mm for other units. exit code 0: done, 2: bad input,
3: some targets are not served (the rest of the job is done).
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(_BAD_INPUT, f"{self.prog}: {message} (try {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options = _parser().parse_args(_joined(sys.argv[1:] if arguments is None else list(arguments)))
    try:
        command: Callable[[argparse.Namespace], int] = options.command
        return command(options)
    except BimnavError as error:
        print(f"bimnav: {error.code} {error}", file=sys.stderr)  # noqa: T201
        return _BUG if isinstance(error, UnsafePlanError) else _BAD_INPUT
    except KeyboardInterrupt:
        print("bimnav: stopped", file=sys.stderr)  # noqa: T201
        return _INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone, as in `bimnav ... | head`
        sys.stderr.close()
        return _DONE


def _joined(arguments: list[str]) -> list[str]:
    """Join options to values that begin with a minus, which argparse would take for options."""
    joined: list[str] = []
    for argument in arguments:
        if (
            joined
            and joined[-1] in _SIGNED
            and argument[:1] == "-"
            and argument[1:2].isdigit() | (argument[1:2] == ".")
        ):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="bimnav", description="From IFC building models to robot tasks, routes and simulation.")
    parser.add_argument("--version", action="version", version=f"bimnav {bn.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser(
        "run",
        help="do a job in a building: plan, check, simulate, write",
        epilog=_RUN_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument("models", nargs="+", metavar="MODEL.ifc", help="one file, or several of one building")
    run.add_argument("--task", default="cleaning", help="built-in task or path of a task file (default: cleaning)")
    run.add_argument("--cell", type=_length, default=0.3048, metavar="SIZE", help="edge of a cell (default: 1ft)")
    run.add_argument("--connectivity", type=int, choices=(4, 8), default=4, help="neighbors of a cell (default: 4)")
    run.add_argument("--start", type=_place, metavar="X,Y[,STOREY]", help="default: the charging dock, if there is one")
    run.add_argument("--robot", default="R1", metavar="NAME", help="name in the report and the log (default: R1)")
    run.add_argument("--radius", type=_length, default=0.0, help="of the robot (default: 0, the paper's point)")
    run.add_argument("--height", type=_length, default=1.0, help="of the robot (default: 1)")
    run.add_argument("--speed", type=_length, default=0.5, help="metres per second (default: 0.5)")
    run.add_argument("--target", type=_target, action="append", default=[], metavar="NAME@X,Y[,STOREY]")
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
    run.add_argument("--seed", type=int, default=0, help="for what is random (default: 0)")
    run.add_argument("--out", metavar="DIR", help="write figures, tables and the report here")
    run.add_argument("--json", action="store_true", help="print the whole report as JSON")
    run.set_defaults(command=_run)

    inspect = commands.add_parser("inspect", help="say what a model holds, and what is wrong with it")
    inspect.add_argument("models", nargs="+", metavar="MODEL.ifc", help="one file, or several of one building")
    inspect.add_argument("--readiness", action="store_true", help="say which rooms and doors a robot reaches")
    inspect.add_argument("--html", metavar="FILE", help="write the readiness report as a page")
    inspect.add_argument("--radius", type=_length, default=0.25, help="of that robot (default: 0.25)")
    inspect.add_argument("--height", type=_length, default=1.0, help="of that robot (default: 1)")
    inspect.add_argument("--json", action="store_true")
    inspect.set_defaults(command=_inspect)

    tasks = commands.add_parser("tasks", help="list the tasks there are")
    tasks.add_argument("action", nargs="?", choices=("list", "schema"), default="list")
    tasks.add_argument("--json", action="store_true")
    tasks.set_defaults(command=_tasks)

    cache = commands.add_parser("cache", help="show or clear what reading has kept")
    cache.add_argument("action", nargs="?", choices=("show", "clear"), default="show")
    cache.add_argument("--json", action="store_true")
    cache.set_defaults(command=_cache)

    doctor = commands.add_parser("doctor", help="print versions and test the installation")
    doctor.add_argument("--json", action="store_true")
    doctor.set_defaults(command=_doctor)
    return parser


def _argument(read: Callable[[str], Any], name: str) -> Callable[[str], Any]:
    def convert(text: str) -> Any:
        try:
            return read(text)
        except BimnavError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    convert.__name__ = name
    return convert


_length = _argument(parse_length, "length")
_place = _argument(parse_place, "place")
_target = _argument(parse_target, "target")


def _print(text: str) -> None:
    print(text)  # noqa: T201


def _print_json(value: Any) -> None:
    _print(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


def _run(options: argparse.Namespace) -> int:
    placed = list(options.target)
    for path in options.targets:
        placed += read_targets(path)
    mission = bn.run(
        options.models,
        task=options.task,
        cell_size=options.cell,
        connectivity=options.connectivity,
        robot=bn.Robot(options.robot, options.radius, options.height, options.speed),
        start=options.start,
        targets=placed,
        refine=options.refine,
        on_conflict=options.on_conflict,
        return_to_start=options.return_to_start,
        lost=options.lost,
        outdoors=options.outdoors,
        seed=options.seed,
        out=options.out,
    )
    report = mission.report()
    if options.json:
        _print_json(report)
    else:
        _print(_summary(report, is_point=options.radius == 0))
    return _DONE if mission.is_complete else _INCOMPLETE


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
        lines.append(f"           {target['name']} at ({x:.3f}, {y:.3f}){aside}")
    proved = "proved shortest" if tour["is_optimal"] else f"at least {tour['lower_bound']:.2f} m is needed"
    lines.append(f"  tour     {tour['length']:.2f} m along the cells, {proved}")
    lines.append(f"  time     {report['simulation']['makespan']:.1f} s, {tour['duration']:.1f} s of it on the move")
    clearance = report["check"]["clearance"]
    lines.append(
        "  check    the path touches no obstacle"
        + ("" if clearance is None else f"; nearest is {clearance:.3f} m away")
    )
    for conflict in report["conflicts"]:
        names = ", ".join(o["name"] for o in conflict["obstacles"])
        lines.append(f"  conflict {conflict['name']} shares cell {tuple(conflict['cell'])} with {names}")
    lines += [f"  not served: {t['name']}: {t['reason']}" for t in report["targets"] if not t["reached"]]
    grave = [issue for issue in report["issues"] if issue["severity"] != "info"]
    lines += [f"  {issue['severity']}: {issue['message']}" for issue in grave]
    if is_point:
        lines.append("  robot    a point, as in the paper; --radius and --height give it a body")
    lines += [f"  wrote    {path}" for path in report["files"]]
    return "\n".join(lines)


def _inspect(options: argparse.Namespace) -> int:
    building = bn.read_ifc(options.models)
    if options.readiness or options.html:
        return _readiness(building, options)
    report = bn.inspect(building)
    if options.json:
        _print_json(report)
        return _DONE
    ledger = report["ledger"]
    lines = [f"{report['name']}: {report['schema']}, length unit {report['unit']}"]
    lines += [
        f"  {storey['name']:<24} floor at {storey['elevation']:8.3f} m  {storey['floor_area']:9.1f} m2  "
        f"{storey['spaces']:3d} spaces  {storey['doors']:3d} doors"
        for storey in report["storeys"]
    ]
    lines.append("  elements " + ", ".join(f"{count} {name}" for name, count in report["classes"].items()))
    lines.append("  ledger   " + ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in ledger.items()))
    for issue in report["issues"]:
        some = ", ".join(issue["global_ids"][:3]) + (" ..." if len(issue["global_ids"]) > 3 else "")
        lines.append(
            f"  {issue['severity']}: {issue['message']} {issue['hint']} {f'[{some}]' if some else ''}".rstrip()
        )
    _print("\n".join(lines))
    return _DONE


def _readiness(building: bn.Building, options: argparse.Namespace) -> int:
    from bimnav._files import write_text

    ready = building.readiness(bn.Robot(radius=options.radius, height=options.height))
    if options.html:
        write_text(options.html, ready.to_html())
    if options.json:
        _print_json(ready.to_dict())
    else:
        _print(_readiness_summary(ready))
        if options.html:
            _print(f"  wrote    {options.html}")
    return _DONE


def _readiness_summary(ready: bn.Readiness) -> str:
    lines = [f"{ready.building}, for a robot of radius {ready.robot.radius:g} m and height {ready.robot.height:g} m"]
    lines += [
        f"  {storey.name:<24} {storey.rooms_reached:3d} of {storey.rooms:3d} rooms  "
        f"{storey.reached_area:8.1f} of {storey.floor_area:8.1f} m2  "
        f"{storey.doors_connecting:3d} of {storey.doors:3d} doors"
        for storey in ready.storeys
        if storey.floor_area
    ]
    lines += [f"  not reached: {room.name} ({room.global_id}): {room.detail} {room.hint}" for room in ready.unreached]
    return "\n".join(lines)


def _tasks(options: argparse.Namespace) -> int:
    from bimnav.tasks import list_tasks, task_schema

    if options.action == "schema":
        _print_json(task_schema())
        return _DONE
    known = list_tasks()
    if options.json:
        _print_json([{"name": t.name, "description": t.description, "source": t.source} for t in known])
    else:
        _print("\n".join(f"{task.name:<20} {task.description}" for task in known))
    return _DONE


def _cache(options: argparse.Namespace) -> int:
    from bimnav.ifc import cache_info, clear_cache

    if options.action == "clear":
        count = clear_cache()
        _print_json({"removed": count}) if options.json else _print(f"removed {count} models")
        return _DONE
    info = cache_info()
    if options.json:
        _print_json({"folder": str(info.folder), "models": info.models, "bytes": info.size})
    else:
        _print(f"{info.models} models, {info.size / 1e6:.1f} MB in {info.folder}")
    return _DONE


def _doctor(options: argparse.Namespace) -> int:
    from bimnav.doctor import examine

    report = examine()
    if options.json:
        _print_json(report)
    else:
        lines = [f"{name:<14} {version}" for name, version in report["versions"].items()]
        lines += [f"{'ok' if row['ok'] else 'FAILED':<14} {row['test']}{row['why']}" for row in report["tests"]]
        _print("\n".join(lines))
    return _DONE if report["ok"] else _BUG


if __name__ == "__main__":
    sys.exit(main())
