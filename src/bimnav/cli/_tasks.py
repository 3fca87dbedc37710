"""`bimnav tasks`: the tasks there are, whether a file of them is right, and what their rules pick in a model."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bimnav.cli._shared import BAD_INPUT, DONE, show, show_json

if TYPE_CHECKING:
    from bimnav.building import Building, Issue
    from bimnav.cli._shared import Commands
    from bimnav.tasks import FileCheck, Rule, RuleCheck, Task

_EXAMPLES = """\
examples:
  bimnav tasks
  bimnav tasks schema > bimnav.schema.json
  bimnav tasks check my.toml
  bimnav tasks check my.toml house.ifc
  bimnav tasks show inspection_fire house.ifc

tasks of your own are known by name if BIMNAV_TASKS, or --tasks-path, lists their folder.
exit code 0: nothing wrong, 2: mistakes in a file, or a rule that expects more than there is.
"""


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    tasks = commands.add_parser(
        "tasks",
        help="list the tasks there are, check a file of them, show what they pick in a model",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_options(tasks)
    tasks.set_defaults(command=_list)
    actions = tasks.add_subparsers(metavar="ACTION")

    listing = actions.add_parser("list", help="list the tasks that are known by name")
    listing.set_defaults(command=_list)
    schema = actions.add_parser("schema", help="print the JSON Schema of task files, for editors")
    schema.set_defaults(command=_schema)
    check = actions.add_parser("check", help="say what is wrong with a task file, and what its rules pick in a model")
    check.add_argument("file", metavar="FILE.toml")
    check.add_argument("models", nargs="*", metavar="MODEL.ifc", help="one file, or several of one building")
    check.set_defaults(command=_check)
    shows = actions.add_parser("show", help="show what every rule of a task picks in a model, and why")
    shows.add_argument("task", metavar="TASK", help="name of a task, or path of a task file")
    shows.add_argument("models", nargs="+", metavar="MODEL.ifc", help="one file, or several of one building")
    shows.set_defaults(command=_show)
    for action in (listing, schema, check, shows):
        _add_options(action, default=argparse.SUPPRESS)


def _add_options(parser: argparse.ArgumentParser, **more: Any) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON for machines", **more)
    parser.add_argument(
        "--tasks-path",
        action="append",
        metavar="DIR",
        help="a folder of task files, or one, whose tasks are known by name",
        **({"default": []} | more),
    )


def _list(options: argparse.Namespace) -> int:
    from bimnav.tasks import list_tasks

    known = list_tasks(tasks_path=options.tasks_path)
    if options.json:
        show_json([{"name": t.name, "description": t.description, "source": t.source} for t in known])
    else:
        show("\n".join(f"{task.name:<20} {task.description}" for task in known))
    return DONE


def _schema(_: argparse.Namespace) -> int:
    from bimnav.tasks import task_schema

    show_json(task_schema())
    return DONE


def _check(options: argparse.Namespace) -> int:
    from bimnav.ifc import read_ifc
    from bimnav.tasks import check_file

    path, parted, name = options.file.rpartition(".toml:")
    file, wanted = (f"{path}.toml", name) if parted else (options.file, "")
    report = check_file(file, tasks_path=options.tasks_path)
    tasks = _wanted(report, file, wanted)
    building = read_ifc(options.models) if options.models and not report.problems else None
    checks = {task.name: _checks(task, building) for task in tasks} if building else {}
    wrong = bool(report.problems) or any(_is_wrong(check) for found in checks.values() for check in found)
    if options.json:
        show_json(_as_values(file, report, building, checks))
    else:
        show("\n".join(_lines(file, report, building, checks)))
    return BAD_INPUT if wrong else DONE


def _wanted(report: FileCheck, file: str, name: str) -> list[Task]:
    from bimnav.tasks import load_task

    if name and not report.problems:
        return [load_task(Path(file), name)]
    return list(report.tasks.values())


def _checks(task: Task, building: Building) -> tuple[RuleCheck, ...]:
    from bimnav.tasks import check_rules

    return check_rules(task, building)


def _is_wrong(check: RuleCheck) -> bool:
    return any(note.severity == "error" for note in check.notes)


def _as_values(
    file: str, report: FileCheck, building: Building | None, checks: dict[str, tuple[RuleCheck, ...]]
) -> dict[str, Any]:
    told = [("error", problem) for problem in report.problems] + [("warning", problem) for problem in report.warnings]
    return {
        "file": file,
        "tasks": list(report.tasks),
        "problems": [
            {"severity": severity, "line": p.line, "key": p.key, "value": p.value, "message": p.message}
            for severity, p in told
        ],
        "model": building.name if building else None,
        "rules": {name: [check.to_dict() for check in found] for name, found in checks.items()},
    }


def _lines(
    file: str, report: FileCheck, building: Building | None, checks: dict[str, tuple[RuleCheck, ...]]
) -> Iterable[str]:
    for severity, problems in (("error", report.problems), ("warning", report.warnings)):
        for problem in sorted(problems, key=lambda problem: problem.line):
            yield f"{file}:{problem.line}: {severity}: {problem.message}"
    if report.problems:
        yield f"{file}: {len(report.problems)} mistakes"
        return
    yield f"{file}: {', '.join(report.tasks)}: no mistakes"
    for name, found in checks.items():
        yield f"{name} in {building.name if building else ''}"
        for check in found:
            yield from _told(check, 3)


def _told(check: RuleCheck, most: int) -> Iterable[str]:
    rule = check.rule
    place = f"  {rule.source}" if rule.source else ""
    yield f"  {check.kind:<10} {rule.label or rule.filter:<24} {len(check.found):5d} of {check.filtered}{place}"
    for product, why in check.found[:most]:
        yield f"      {product.ifc_class:<24} {product.global_id}  {product.name[:40]:<40}  {_reason(why)}"
    if len(check.found) > most:
        yield f"      and {len(check.found) - most} more"
    for note in check.notes:
        if note.code == "empty-rule":
            yield f"    {note.severity}: nothing; its filter alone picks {check.filtered}"
        else:
            yield f"    {note.severity}: {_said(note, rule)} {note.hint}".rstrip()


def _said(note: Issue, rule: Rule) -> str:
    """Return what a note says of a rule, without rule and filter, which stand above."""
    from bimnav.tasks import told

    return note.message.removeprefix(f"{told(rule)}: ").removeprefix(f"filter {rule.filter!r} ")


def _reason(why: str) -> str:
    """Return why a rule picks something, without the rule, which stands above."""
    return why.partition(": ")[2] or why


def _show(options: argparse.Namespace) -> int:
    from bimnav.ifc import read_ifc
    from bimnav.tasks import load_task

    task = load_task(options.task, tasks_path=options.tasks_path)
    building = read_ifc(options.models)
    checks = _checks(task, building)
    overruled = _overruled(task, building) if not any(map(_is_wrong, checks)) else ()
    if options.json:
        rules = [check.to_dict(whole=True) for check in checks]
        lost = [each._asdict() for each in overruled]
        show_json({"task": task.name, "model": building.name, "rules": rules, "overruled": lost})
    else:
        lines = [f"{task.name} in {building.name}: {task.description}".rstrip(": ")]
        lines += [line for check in checks for line in _told(check, sys.maxsize)]
        lines += ["  rules that others go before", *_losers(overruled)] if overruled else []
        show("\n".join(lines))
    return BAD_INPUT if any(map(_is_wrong, checks)) else DONE


def _overruled(task: Task, building: Building) -> Sequence[Any]:
    from bimnav.environment import rules_overruled

    return rules_overruled(task, building)


def _losers(overruled: Iterable[Any]) -> Iterable[str]:
    for each in overruled:
        yield f"      {each.global_id}  {each.rule}"
        yield f"      {'':<22}  gives way to {each.by}"
