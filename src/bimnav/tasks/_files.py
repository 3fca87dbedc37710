"""Tasks from files: the built-in library, and users' own."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from bimnav.errors import FileKindError, FileMissingError, FileTooLargeError, InputError, TaskError
from bimnav.tasks._task import RULE_LISTS, Rule, Standoff, Task
from bimnav.tasks._toml import Problem, Toml, read_toml

if TYPE_CHECKING:
    from bimnav.tasks._schema import RuleTable, TaskTable

__all__ = ["TaskInfo", "list_tasks", "load_task", "task_schema"]

_LARGEST = 1_000_000  # bytes; the built-in library is a hundredth of it
_MOST = 50  # mistakes, or names, told in one message


class TaskInfo(NamedTuple):
    """A task that can be loaded by its name."""

    name: str
    description: str
    source: str


def list_tasks() -> tuple[TaskInfo, ...]:
    """Return the built-in tasks, by name."""
    return tuple(TaskInfo(task.name, task.description, task.source) for task in _library().values())


def load_task(task: str | Path, name: str | None = None) -> Task:
    """Load a task.

    Parameters
    ----------
    task
        Name of a built-in task, or path of a task file: a `Path`, or a text with a folder in it or the
        suffix `.toml`.
    name
        Which task of the file; needed if it holds several. It may stand behind the path, too:
        `my.toml:kitchen`.

    Raises
    ------
    TaskError
        If there is no such task, or the file has mistakes; it names all of them, each as
        `file:line: what`, and `context["problems"]` holds them as plain values.
    FileMissingError, FileKindError, FileTooLargeError
        If the file cannot be read at all.
    """
    if isinstance(task, str):
        known = _library()
        if name is None and task in known:
            return known[task]
        before, parted, behind = task.rpartition(".toml:")
        if parted and name is None:
            task, name = f"{before}.toml", behind
        if not task.endswith(".toml") and "/" not in task and "\\" not in task:
            raise TaskError(
                f"there is no task {task!r}.",
                f"{_nearest(task, known)} For a task of your own give the path of a .toml file.",
                {"name": task, "known": list(known)},
            )
    path = Path(task)
    return _chosen(_tasks(_text_of(path), str(path)), name, str(path))


def task_schema() -> dict[str, Any]:
    """Return the JSON Schema of task files; editors complete and check with it."""
    from bimnav.tasks._schema import TaskFile

    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | TaskFile.model_json_schema()


@cache
def _library() -> Mapping[str, Task]:
    tasks: dict[str, Task] = {}
    for entry in files("bimnav.tasks").joinpath("library").iterdir():
        if entry.name.endswith(".toml"):
            tasks |= _tasks(entry.read_text(encoding="utf-8"), f"built-in {entry.name}")
    return MappingProxyType({name: tasks[name] for name in sorted(tasks)})


def _chosen(tasks: Mapping[str, Task], name: str | None, source: str) -> Task:
    if name is None and len(tasks) == 1:
        return next(iter(tasks.values()))
    if name is None:
        raise TaskError(
            f"{source} holds {len(tasks)} tasks.",
            f"{_nearest('', tasks)} Say which, as in {source}:{next(iter(tasks))}.",
            {"known": list(tasks)},
        )
    if name not in tasks:
        raise TaskError(f"{source} has no task {name!r}.", _nearest(name, tasks), {"name": name, "known": list(tasks)})
    return tasks[name]


def _nearest(name: str, known: Iterable[str]) -> str:
    known = list(known)
    near = difflib.get_close_matches(name, known, 1)
    listed = f"Known are {', '.join(known[:_MOST])}{', ...' if len(known) > _MOST else '.'}"
    return f"Did you mean {near[0]!r}? {listed}" if near else listed


def _text_of(path: Path) -> str:
    context = {"path": str(path)}
    try:
        if not path.exists():
            raise FileMissingError(f"{path} does not exist.", "Check the path of the task file.", context)
        if not path.is_file():
            raise FileKindError(f"{path} is not a file.", "Give a TOML file of tasks.", context)
        with path.open("rb") as file:
            data = file.read(_LARGEST + 1)
    except OSError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read: {error.strerror}.", "Check path and permissions.", context) from error
    if len(data) > _LARGEST:
        raise FileTooLargeError(f"{path} has more than {_LARGEST} bytes.", "Task files are small texts.", context)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise TaskError(f"{path}:{line}: this is not UTF-8 text.", "Save the file as UTF-8.", context) from error


def _tasks(text: str, source: str) -> dict[str, Task]:
    """Read all tasks of a text, or raise with all its mistakes."""
    from bimnav.tasks._schema import check_tables

    toml = read_toml(text)
    tables, problems = ({}, toml.problems) if toml.problems else check_tables(toml)
    if problems:
        raise _mistakes(source, problems)
    return {name: _task(name, table, source, toml) for name, table in tables.items()}


def _task(name: str, table: TaskTable, source: str, toml: Toml) -> Task:
    def rules(kind: str) -> tuple[Rule, ...]:
        tables: list[RuleTable] = getattr(table, kind)
        return tuple(
            Rule(**_values(rule, ()), source=f"{source}:{toml.line_of(('tasks', name, kind, k))}")
            for k, rule in enumerate(tables)
        )

    values = _values(table, (*RULE_LISTS, "extends")) | {kind: rules(kind) for kind in RULE_LISTS}
    return Task(name, **values, source=f"{source}:{toml.line_of(('tasks', name))}")


def _values(table: TaskTable | RuleTable, but: Iterable[str]) -> dict[str, Any]:
    """Return what a table says, for the value it becomes."""
    values = table.model_dump(exclude=set(but))
    if isinstance(values.get("destination"), dict):
        values["destination"] = Standoff(**values["destination"])
    return values


def _mistakes(source: str, problems: Iterable[Problem]) -> TaskError:
    problems = sorted(problems, key=lambda problem: problem.line)
    lines = [f"{source}:{problem.line}: {problem.message}" for problem in problems[:_MOST]]
    more = f"There are {len(problems) - _MOST} more mistakes." if len(problems) > _MOST else ""
    return TaskError("\n".join(lines), more, {"file": source, "problems": [asdict(problem) for problem in problems]})
