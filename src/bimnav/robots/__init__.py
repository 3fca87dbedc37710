"""Robots from files: profiles that ship with bimnav, and users' own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache
from importlib.resources import files
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from bimnav import _checks
from bimnav._table_files import Folders, TableFiles, is_path, parted
from bimnav._toml import Problem, Toml, read_toml
from bimnav._wording import meant, nearest
from bimnav.errors import RobotError, ValueRangeError
from bimnav.robot import Robot
from bimnav.robots._schema import robot_schema

__all__ = ["VARIABLE", "RobotInfo", "list_robots", "load_robot", "robot_named", "robot_schema"]

VARIABLE = "BIMNAV_ROBOTS"
"""The environment variable that holds users' own folders and files of robots."""

_FILES = TableFiles("robot", VARIABLE, RobotError)
_LIKE = {f.name: f.default for f in fields(Robot) if f.default is not MISSING and f.name != "name"}
_NUMBER, _FLAG, _WORDS, _CORNERS = (
    "a number",
    "true or false",
    "a list of texts",
    "a list of corners [x, y] in metres",
)


class RobotInfo(NamedTuple):
    """A robot that can be loaded by its name."""

    name: str
    description: str
    source: str


@dataclass(frozen=True, slots=True)
class _Profile:
    robot: Robot
    description: str
    source: str


def list_robots(*, robots_path: Folders = ()) -> tuple[RobotInfo, ...]:
    """Return the robots that are known by name: the built-in profiles, and those of users' own folders.

    Parameters
    ----------
    robots_path
        Folders of robot files, or robot files, besides those that the environment variable `BIMNAV_ROBOTS`
        lists.

    Raises
    ------
    RobotError
        If a file has mistakes, or two robots have one name.
    """
    return tuple(RobotInfo(name, p.description, p.source) for name, p in _known(robots_path).items())


def load_robot(robot: str | PathLike[str], name: str | None = None, *, robots_path: Folders = ()) -> Robot:
    """Load a robot.

    Parameters
    ----------
    robot
        Name of a profile, or path of a TOML file with tables `[robots.NAME]`: a `Path`, or a text with a
        folder in it or the suffix `.toml`. Its keys are those of `Robot`, with `description` and `extends`.
    name
        Which robot of the file; needed if it holds several. It may stand behind the path, too:
        `my.toml#scout`.
    robots_path
        Folders of robot files, or robot files, besides those that `BIMNAV_ROBOTS` lists.

    Raises
    ------
    RobotError
        If there is no such robot, or the file has mistakes; it names all of them, each as
        `file:line: what`, and `context["problems"]` holds them as plain values.
    FileMissingError, FileKindError, FileTooLargeError
        If the file cannot be read at all.

    Examples
    --------
    >>> load_robot("inspection").reach
    1.0
    """
    text = str(_checks.path("robot", robot)) if not isinstance(robot, str) else robot
    if isinstance(robot, str):
        if name is None:
            text, name = parted(text, "#")
        if not is_path(text):
            return _of(_known(robots_path), text, "the list of robots").robot
    path = Path(text)
    profiles = _profiles([(_FILES.text_of(path), str(path))], _known(robots_path))
    if name is None and len(profiles) > 1:
        raise RobotError(
            f"{path} holds {len(profiles)} robots.",
            f"Say which, as in {path}#{next(iter(profiles))}: {', '.join(profiles)}.",
            {"known": list(profiles)},
        )
    return _of(profiles, next(iter(profiles)) if name is None else name, str(path)).robot


def robot_named(robot: str, *, robots_path: Folders = ()) -> Robot:
    """Return the profile of this name, or of this file; else the default robot under this name."""
    if ".toml" in robot or "/" in robot or "\\" in robot or robot in _known(robots_path):
        return load_robot(robot, robots_path=robots_path)
    return Robot(robot)


def _of(profiles: Mapping[str, _Profile], name: str, where: str) -> _Profile:
    if name not in profiles:
        known = list(profiles)
        raise RobotError(
            f"there is no robot {name!r} in {where}.", nearest(name, known), {"name": name, "known": known}
        )
    return profiles[name]


@cache
def _library() -> Mapping[str, _Profile]:
    text = files("bimnav.robots").joinpath("library.toml").read_text(encoding="utf-8")
    return MappingProxyType(_profiles([(text, "built-in library.toml")], {}))


def _known(robots_path: Folders) -> Mapping[str, _Profile]:
    own = _profiles(_FILES.texts(robots_path), _library(), is_taken=True)
    return {**_library(), **own}


def _profiles(
    texts: Sequence[tuple[str, str]], outside: Mapping[str, _Profile], *, is_taken: bool = False
) -> dict[str, _Profile]:
    """Make the robots of files, or raise with all the mistakes of all of them.

    Parameters
    ----------
    outside
        Robots of other files, which these may extend.
    is_taken
        Whether the names of those are not free.
    """
    reader = _Reader([(source, read_toml(text)) for text, source in texts], outside, is_taken)
    found = reader.read()
    if reader.problems:
        raise _FILES.mistakes(reader.problems)
    return found


class _Reader:
    """Makes robots of tables, and collects all that is wrong with them."""

    def __init__(self, read: Sequence[tuple[str, Toml]], outside: Mapping[str, _Profile], is_taken: bool) -> None:
        self._read, self._outside, self._is_taken = read, outside, is_taken
        self._places: dict[str, tuple[str, Toml, dict[str, Any]]] = {}
        self._made: dict[str, _Profile | None] = {}
        self._values: dict[str, dict[str, Any]] = {}
        self.problems: list[tuple[str, Problem]] = []

    def read(self) -> dict[str, _Profile]:
        for source, toml in self._read:
            self.problems += [(source, problem) for problem in toml.problems]
            if not toml.problems:
                self._take_file(source, toml)
        made = {name: self._make(name, ()) for name in self._places}
        return {name: profile for name, profile in made.items() if profile is not None}

    def _refuse(self, source: str, toml: Toml, key: tuple[str | int, ...], what: str, value: Any = "") -> None:
        dotted = ".".join(map(str, key))
        self.problems.append((source, Problem(toml.line_of(key), what, dotted, repr(value))))

    def _take_file(self, source: str, toml: Toml) -> None:
        document = toml.document
        if document.get("schema") != 1:
            self._refuse(source, toml, ("schema",), "begin with schema = 1.", document.get("schema"))
        for other in sorted(document.keys() - {"schema", "robots"}):
            self._refuse(source, toml, (other,), f"unknown key {other!r} in the file; known are schema, robots.")
        tables = document.get("robots", {})
        if not isinstance(tables, dict) or not tables:
            self._refuse(source, toml, ("robots",), "a robot file holds tables such as [robots.scout].")
            return
        for name, table in tables.items():
            key = ("robots", name)
            if not name.strip() or not isinstance(table, dict):
                self._refuse(source, toml, key, f"robots.{name} should be a table with a name: [robots.scout].")
            elif name in self._places or (self._is_taken and name in self._outside):
                first = self._outside[name].source if name not in self._places else self._places[name][0]
                told = f"there is a robot {name!r} already, in {first}; give this one another name."
                self._refuse(source, toml, key, told, name)
            else:
                self._places[name] = source, toml, table

    def _make(self, name: str, pending: tuple[str, ...]) -> _Profile | None:
        if name not in self._made:
            self._made[name] = self._made_of(name, pending)
        return self._made[name]

    def _made_of(self, name: str, pending: tuple[str, ...]) -> _Profile | None:
        source, toml, table = self._places[name]
        before = len(self.problems)
        extended = table.get("extends", "")
        base = self._base(name, extended, (*pending, name)) if isinstance(extended, str) and extended else {}
        known = ["description", "extends", *_LIKE]
        values: dict[str, Any] = {}
        for field, value in table.items():
            key = ("robots", name, field)
            if field not in known:
                self._refuse(source, toml, key, f"unknown key {field!r} in robots.{name}; {meant(field, known)}", value)
            elif field in ("description", "extends"):
                if not isinstance(value, str):
                    self._refuse(source, toml, key, f"robots.{name}.{field} = {value!r}: should be a text.", value)
            elif wrong := _wrong(name, field, value):
                self._refuse(source, toml, key, f"robots.{name}.{field} = {value!r}: {wrong}", value)
            else:
                values[field] = tuple(map(tuple, value)) if field == "outline" else value
        if len(self.problems) > before or base is None:
            return None
        if "radius" in values:
            base = {key: value for key, value in base.items() if key != "outline"}
        if "outline" in values:
            base = {key: value for key, value in base.items() if key != "radius"}
        self._values[name] = base | values
        try:
            robot = Robot(name, **self._values[name])
        except ValueRangeError as error:
            self._refuse(source, toml, ("robots", name, error.context["field"]), str(error), error.context["value"])
            return None
        return _Profile(robot, table.get("description", ""), f"{source}:{toml.line_of(('robots', name))}")

    def _base(self, name: str, base: str, pending: tuple[str, ...]) -> dict[str, Any] | None:
        """Return what a robot takes over from another one; None if something is wrong."""
        source, toml, _ = self._places[name]
        key = ("robots", name, "extends")
        if base in self._places and base != name:
            if base in pending:
                told = " extends ".join(map(repr, [*pending[pending.index(base) :], base]))
                self._refuse(source, toml, key, f"robots.{name}.extends goes round: {told}.", base)
                return None
            return self._values.get(base) if self._make(base, pending) else None
        if base not in self._outside:
            known = [*(other for other in self._places if other != name), *self._outside]
            told = f"robots.{name}.extends = {base!r}: there is no such robot; {meant(base, known)}"
            self._refuse(source, toml, key, told, base)
            return None
        return dict(_said(self._outside[base].robot))


def _said(robot: Robot) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a robot that are not the default; of a body with an outline, not its radius."""
    for field, default in _LIKE.items():
        value = getattr(robot, field)
        if value != default and not (field == "radius" and robot.outline is not None):
            yield field, value


def _wrong(name: str, field: str, value: Any) -> str:
    """Say what is wrong with a value by itself; empty if nothing is."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    is_list = isinstance(value, list)
    like = _LIKE[field]
    if field == "outline":
        is_fit = is_list and all(
            isinstance(corner, list)
            and len(corner) == 2
            and all(isinstance(part, (int, float)) and not isinstance(part, bool) for part in corner)
            for corner in value
        )
        wanted = _CORNERS
    elif isinstance(like, bool):
        is_fit, wanted = isinstance(value, bool), _FLAG
    elif isinstance(like, tuple):
        is_fit, wanted = is_list and all(isinstance(word, str) and word.strip() for word in value), _WORDS
    else:
        is_fit, wanted = is_number, _NUMBER
    if not is_fit:
        return f"should be {wanted}."
    try:
        # by itself, beside a body that is as tall as can be, so that only this value is judged
        Robot(name, **({"height": 100.0} if field != "height" else {"step_height": 0.0}) | {field: value})
    except ValueRangeError as error:
        return error.hint
    return ""
