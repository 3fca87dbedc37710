"""Tasks from files: the built-in library, and users' own."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from bimnav import _checks
from bimnav._table_files import Folders, TableFiles, is_path, parted
from bimnav._toml import Problem, Toml, read_toml
from bimnav._wording import nearest
from bimnav.errors import TaskError
from bimnav.tasks._task import RULE_LISTS, Rule, Standoff, Task

if TYPE_CHECKING:
    from bimnav.tasks._schema import RuleTable, TaskTable

__all__ = ["VARIABLE", "FileCheck", "TaskInfo", "check_file", "entourage", "list_tasks", "load_task", "task_schema"]

_LOG = logging.getLogger(__name__)

VARIABLE = "BIMNAV_TASKS"
"""The environment variable that holds users' own folders and files of tasks."""

_FILES = TableFiles("task", VARIABLE, TaskError)

Known: TypeAlias = Callable[[], Mapping[str, Task]]


class TaskInfo(NamedTuple):
    """A task that can be loaded by its name."""

    name: str
    description: str
    source: str


class FileCheck(NamedTuple):
    """What a task file holds and what is wrong with it.

    Parameters
    ----------
    tasks
        By name; empty if there is any problem.
    problems
        Mistakes, each with its line.
    warnings
        What may not do what is meant.
    """

    tasks: Mapping[str, Task]
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]


@dataclass(frozen=True, slots=True)
class _File:
    """The tables of one text, checked one by one."""

    source: str
    toml: Toml
    tables: Mapping[str, TaskTable]
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...] = ()


def list_tasks(*, tasks_path: Folders = ()) -> tuple[TaskInfo, ...]:
    """Return the tasks that are known by name: the built-in ones, and those of users' own folders.

    Parameters
    ----------
    tasks_path
        Folders of task files, or task files, besides those that the environment variable `BIMNAV_TASKS`
        lists.

    Raises
    ------
    TaskError
        If a file has mistakes, or two tasks have one name.
    """
    return tuple(TaskInfo(task.name, task.description, task.source) for task in _known(tasks_path).values())


def load_task(task: str | Path, name: str | None = None, *, tasks_path: Folders = ()) -> Task:
    """Load a task.

    Parameters
    ----------
    task
        Name of a task, or path of a task file: a `Path`, or a text with a folder in it or the suffix
        `.toml`.
    name
        Which task of the file; needed if it holds several. It may stand behind the path, too:
        `my.toml:kitchen`.
    tasks_path
        Folders of task files, or task files, where names are sought besides the built-in ones and those
        that the environment variable `BIMNAV_TASKS` lists.

    Raises
    ------
    TaskError
        If there is no such task, or the file has mistakes; it names all of them, each as
        `file:line: what`, and `context["problems"]` holds them as plain values.
    FileMissingError, FileKindError, FileTooLargeError
        If the file cannot be read at all.
    """
    if isinstance(task, str):
        if name is None:
            task, name = parted(task, ":")
        if not is_path(task):
            return _named(task, name, _library() if task in _library() else _known(tasks_path))
    path = _checks.path("task", task)
    tasks = _tasks([_read(_FILES.text_of(path), str(path))], lambda: _known(tasks_path))
    return _chosen(tasks, name, str(path))


def check_file(path: str | PathLike[str], *, tasks_path: Folders = ()) -> FileCheck:
    """Return what a task file holds and what is wrong with it.

    Raises
    ------
    FileMissingError, FileKindError, FileTooLargeError
        If the file cannot be read at all.
    """
    file = _read(_FILES.text_of(Path(path)), str(path))
    tasks, problems = _resolved([file], lambda: _known(tasks_path), {})
    found = tuple(problem for _, problem in problems)
    return FileCheck({} if found else tasks, found, file.warnings)


@cache
def entourage() -> Task:
    """Return the task whose `ignore` says what stands in a model for the picture alone."""
    name = "meaning.toml"
    text = files("bimnav.tasks").joinpath(name).read_text(encoding="utf-8")
    (task,) = _tasks([_read(text, f"built-in {name}", is_linted=True)], dict).values()
    return task


def task_schema() -> dict[str, Any]:
    """Return the JSON Schema of task files; editors complete and check with it."""
    from bimnav.tasks._schema import TaskFile

    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | TaskFile.model_json_schema()


@cache
def _library() -> Mapping[str, Task]:
    entries = sorted(files("bimnav.tasks").joinpath("library").iterdir(), key=lambda entry: entry.name)
    read = [
        _read(entry.read_text(encoding="utf-8"), f"built-in {entry.name}", is_linted=True)
        for entry in entries
        if entry.name.endswith(".toml")
    ]
    return _sorted(_tasks(read, dict))


def _known(tasks_path: Folders) -> Mapping[str, Task]:
    """Return the built-in tasks and those of users' own folders."""
    read = [_read(text, source) for text, source in _FILES.texts(tasks_path)]
    return _sorted({**_library(), **_tasks(read, _library, _library())})


def _sorted(tasks: Mapping[str, Task]) -> Mapping[str, Task]:
    return MappingProxyType({name: tasks[name] for name in sorted(tasks)})


def _named(task: str, name: str | None, known: Mapping[str, Task]) -> Task:
    if name is not None or task not in known:
        told = task if name is None else f"{task}:{name}"
        raise TaskError(
            f"there is no task {told!r}.",
            f"{nearest(task, known)} For a task of your own give the path of a .toml file.",
            {"name": task, "known": list(known)},
        )
    return known[task]


def _chosen(tasks: Mapping[str, Task], name: str | None, source: str) -> Task:
    if name is None and len(tasks) == 1:
        return next(iter(tasks.values()))
    if name is None:
        raise TaskError(
            f"{source} holds {len(tasks)} tasks.",
            f"{nearest('', tasks)} Say which, as in {source}:{next(iter(tasks))}.",
            {"known": list(tasks)},
        )
    if name not in tasks:
        raise TaskError(f"{source} has no task {name!r}.", nearest(name, tasks), {"name": name, "known": list(tasks)})
    return tasks[name]


def _read(text: str, source: str, *, is_linted: bool = False) -> _File:
    """Read the tables of a text, each by itself, with all that is wrong with them."""
    from bimnav.tasks._schema import check_tables

    toml = read_toml(text)
    if toml.problems:
        return _File(source, toml, {}, toml.problems)
    tables, problems = check_tables(toml)
    warnings: list[Problem] = []
    if not is_linted:
        from bimnav.tasks._lint import lint_filters

        mistakes, warnings = lint_filters(toml)
        problems += mistakes
    return _File(source, toml, tables, tuple(problems), tuple(warnings))


def _tasks(read: Iterable[_File], outside: Known, taken: Mapping[str, Task] = MappingProxyType({})) -> dict[str, Task]:
    """Make the tasks of files, or raise with all the mistakes of all of them."""
    read = list(read)
    tasks, problems = _resolved(read, outside, taken)
    if problems:
        raise _FILES.mistakes(problems)
    for file in read:
        for warning in file.warnings:
            _LOG.warning("%s:%d: %s", file.source, warning.line, warning.message)
    return tasks


def _resolved(
    read: Iterable[_File], outside: Known, taken: Mapping[str, Task]
) -> tuple[dict[str, Task], list[tuple[str, Problem]]]:
    """Build tasks on those that they extend; return them and what is wrong, by source.

    Parameters
    ----------
    outside
        Returns the tasks of other files.
    taken
        Tasks whose names are not free.
    """
    read = list(read)
    problems = [(file.source, problem) for file in read for problem in file.problems]
    places: dict[str, tuple[_File, str]] = {}
    for file in read:
        for name, base in _names_in(file):
            first = taken[name].source if name in taken else _place(places[name][0], name) if name in places else ""
            if first:
                told = f"there is a task {name!r} already, at {first}; give this one another name."
                problems.append((file.source, _problem_at(file, ("tasks", name), told, name)))
            places.setdefault(name, (file, base))
    resolver = _Resolver(places, outside)
    for name in places:
        resolver.task(name)
    return resolver.tasks, problems + resolver.problems


def _names_in(file: _File) -> Iterator[tuple[str, str]]:
    """Yield each task of a file and what it extends, also where something else is wrong."""
    tables = file.toml.document.get("tasks")
    for name, table in tables.items() if isinstance(tables, dict) else ():
        base = table.get("extends") if isinstance(table, dict) else None
        yield name, base if isinstance(base, str) else ""


class _Resolver:
    """Builds tasks on other tasks: those of the same files, then those known by name."""

    def __init__(self, places: Mapping[str, tuple[_File, str]], outside: Known) -> None:
        self._places, self._outside = places, outside
        self.tasks: dict[str, Task] = {}
        self.problems: list[tuple[str, Problem]] = []
        self._pending: list[str] = []
        self._failed: set[str] = set()

    def task(self, name: str) -> Task | None:
        """Return a task of the files with all it is built on; None if something is wrong."""
        if name in self.tasks or name in self._failed:
            return self.tasks.get(name)
        file, base = self._places[name]
        self._pending.append(name)
        below = self._base(file, name, base) if base else None
        self._pending.pop()
        if name not in file.tables or (base and below is None):
            self._failed.add(name)
            return None
        self.tasks[name] = _task(name, file, below)
        return self.tasks[name]

    def _base(self, file: _File, name: str, base: str) -> Task | None:
        key = ("tasks", name, "extends")
        if base in self._pending and base != name:
            circle = [*self._pending[self._pending.index(base) :], base]
            self._refuse(file, key, base, f"goes round: {' extends '.join(map(repr, circle))}.")
            return None
        if base in self._places and base != name:
            return self.task(base)
        known = {other: task for other, task in self._outside().items() if task.source != _place(file, name)}
        if base not in known:
            self._refuse(file, key, base, f"there is no such task. {nearest(base, [*self._places, *known])}")
        return known.get(base)

    def _refuse(self, file: _File, key: tuple[str, ...], value: str, what: str) -> None:
        told = f"{'.'.join(key)} = {value!r}: {what}"
        self.problems.append((file.source, _problem_at(file, key, told, repr(value))))


def _place(file: _File, name: str) -> str:
    return f"{file.source}:{file.toml.line_of(('tasks', name))}"


def _problem_at(file: _File, key: tuple[str, ...], message: str, value: str) -> Problem:
    return Problem(file.toml.line_of(key), message, ".".join(key), value)


def _task(name: str, file: _File, base: Task | None) -> Task:
    table = file.tables[name]

    def rules(kind: str) -> tuple[Rule, ...]:
        tables: list[RuleTable] = getattr(table, kind)
        return tuple(
            Rule(**_values(rule), source=f"{file.source}:{file.toml.line_of(('tasks', name, kind, k))}")
            for k, rule in enumerate(tables)
        )

    base = base or Task(name)
    values = _values(table, said=True) | {kind: rules(kind) + getattr(base, kind) for kind in RULE_LISTS}
    return replace(base, name=name, **values, source=_place(file, name))


def _values(table: TaskTable | RuleTable, *, said: bool = False) -> dict[str, Any]:
    """Return what a table says, or what it and its defaults say, for the value it becomes."""
    values = table.model_dump(exclude={*RULE_LISTS, "extends"}, exclude_unset=said)
    if isinstance(values.get("destination"), dict):
        values["destination"] = Standoff(**values["destination"])
    return values
