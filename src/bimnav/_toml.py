"""Where in a TOML file each key stands; tomllib does not tell."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

__all__ = ["Key", "Problem", "Toml", "read_toml"]

Key: TypeAlias = tuple[str | int, ...]

_DEEPEST = 32  # tomllib needs memory with the square of the depth of dotted keys, and the stack for brackets
_PIECE = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"{3,5}|\Z)'
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|"(?:[^"\\\n]|\\[^\n])*"?'
    r"|'[^'\n]*'?"
    r"""|\#[^\n]*|[\[\]{}\n]|[^"'\#\[\]{}\n]+""",
    re.DOTALL,
)
_POSITION = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


@dataclass(frozen=True, slots=True)
class Problem:
    """A mistake in a file: where, and what."""

    line: int
    message: str
    key: str = ""
    value: str = ""


@dataclass(frozen=True, slots=True)
class Toml:
    """What a file holds, and the line on which each key first stands; or what is wrong with it."""

    document: dict[str, Any] = field(default_factory=dict)
    lines: dict[Key, int] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()

    def line_of(self, key: Key) -> int:
        """Return the line of a key, or of the table that should hold it."""
        return next((self.lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in self.lines), 1)


def read_toml(text: str) -> Toml:
    """Read TOML; mistakes are returned, all of them."""
    text = text.replace("\r\n", "\n")
    too_deep = _too_deep(text)
    if too_deep:
        return Toml(problems=(Problem(too_deep, f"tables and lists are nested deeper than {_DEEPEST}."),))
    lines, problems = _places(text)
    try:
        return Toml(tomllib.loads(text), lines)
    except ValueError as error:  # TOMLDecodeError, or a number of more digits than Python reads
        return Toml(lines=lines, problems=tuple(problems) or (_problem(error, 1, text),))


def _too_deep(text: str) -> int:
    """Return the first line that is nested too deeply; 0 if none is."""
    depth = dots = 0
    line = 1
    for piece in _PIECE.findall(text):
        depth = max(0, depth + (piece in "[{") - (piece in "]}"))
        dots = 0 if piece == "\n" else dots + (piece[0] not in "\"'#") * piece.count(".")
        if depth > _DEEPEST or dots > _DEEPEST:
            return line
        line += piece.count("\n")
    return 0


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Yield each header and each key with its value, and the line it begins on; each is TOML by itself."""
    pieces: list[str] = []
    depth, line, start = 0, 1, 1
    for piece in _PIECE.findall(text + "\n"):
        if piece == "\n" and depth == 0:
            yield start, "".join(pieces)
            pieces, start = [], line + 1
        else:
            depth = max(0, depth + (piece in "[{") - (piece in "]}"))
            pieces.append(piece)
        line += piece.count("\n")
    yield start, "".join(pieces)


def _places(text: str) -> tuple[dict[Key, int], list[Problem]]:
    """Return the line of each key, and what does not parse or is said twice."""
    lines: dict[Key, int] = {}
    said: dict[Key, int] = {}
    problems: list[Problem] = []
    counts: Counter[Key] = Counter()
    table: Key = ()
    for line, statement in _statements(text):
        try:
            key = _key(tomllib.loads(statement))
        except ValueError as error:
            problems.append(_problem(error, line, statement))
            continue
        if statement.lstrip().startswith("[["):
            counts[key] += 1
            key = table = (*key, counts[key] - 1)
        elif statement.lstrip().startswith("["):
            table = key
        elif key:
            key = (*table, *key)
        if key in said:
            told = ".".join(map(str, key))
            problems.append(Problem(line, f"{key[-1]!r} is said again; it was said on line {said[key]}.", told))
        if key:
            said[key] = line
        for n in range(1, len(key) + 1):
            lines.setdefault(key[:n], line)
    return lines, problems


def _key(document: Any) -> Key:
    """Return the one key of a statement."""
    key: Key = ()
    while isinstance(document, dict) and len(document) == 1:
        (name, document), *_ = document.items()
        key = (*key, name)
    return key


def _problem(error: ValueError, line: int, statement: str) -> Problem:
    """Say what does not parse, and where; what never ends is told where it begins."""
    position = _POSITION.search(str(error))
    within, column = (position[1], position[2]) if position else (None, None)
    row = int(within or 1) - 1
    place = f"column {column}: " if column else "at the end: " if position else ""
    shown = statement.split("\n")[row].strip()[:80]
    return Problem(line + row, f"{place}{_POSITION.sub('', str(error))} in {shown!r}.")
