"""Files of named tables that users write by hand: found in folders, read as text, told with all their mistakes."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import TypeAlias

from bimnav import _checks
from bimnav._toml import Problem
from bimnav.errors import FileKindError, FileMissingError, FileTooLargeError, InputError

__all__ = ["Folders", "TableFiles", "is_path", "parted"]

_MOST = 50  # mistakes told in one message
_LARGEST = 1_000_000  # bytes; what ships with bimnav is a hundredth of it

Folders: TypeAlias = Iterable[str | PathLike[str]]


def is_path(text: str) -> bool:
    """Tell a path from a name: it has a folder in it, or the suffix `.toml`."""
    return text.endswith(".toml") or "/" in text or "\\" in text


def parted(text: str, mark: str) -> tuple[str, str | None]:
    """Part a path from the name behind it, as in `my.toml#scout`; None without a name.

    >>> parted("my.toml#scout", "#"), parted("my.toml", "#")
    (('my.toml', 'scout'), ('my.toml', None))
    """
    before, found, name = text.rpartition(f".toml{mark}")
    return (f"{before}.toml", name) if found else (text, None)


@dataclass(frozen=True, slots=True)
class TableFiles:
    """All files of one kind.

    Parameters
    ----------
    kind
        What their tables describe: `task` or `robot`.
    variable
        The environment variable that lists users' own folders and files.
    error
        Raised for what is wrong inside of a file.
    """

    kind: str
    variable: str
    error: type[InputError]

    def texts(self, folders: Folders) -> list[tuple[str, str]]:
        """Return text and source of every file in these folders and in those of the environment variable.

        Raises
        ------
        FileMissingError, FileKindError, FileTooLargeError
            If a folder or file cannot be read.
        """
        name = f"{self.kind}s_path"
        wanted = [_checks.path(name, entry) for entry in _checks.many(name, folders)]
        wanted += [Path(entry) for entry in os.environ.get(self.variable, "").split(os.pathsep) if entry]
        paths = dict.fromkeys(path for entry in wanted for path in self._files_at(entry))
        return [(self.text_of(path), str(path)) for path in paths]

    def _files_at(self, entry: Path) -> list[Path]:
        if entry.is_file():
            return [entry]
        if not entry.is_dir():
            hint = f"{self.kind}s_path and {self.variable} list folders of {self.kind} files."
            raise FileMissingError(f"{entry} does not exist.", hint, {"path": str(entry)})
        return sorted(entry.glob("*.toml"))

    def text_of(self, path: Path) -> str:
        """Return what a file says.

        Raises
        ------
        FileMissingError, FileKindError, FileTooLargeError
            If it cannot be read at all.
        """
        kind, context = self.kind, {"path": str(path)}
        try:
            if not path.exists():
                raise FileMissingError(f"{path} does not exist.", f"Check the path of the {kind} file.", context)
            if not path.is_file():
                raise FileKindError(f"{path} is not a file.", f"Give a TOML file of {kind}s.", context)
            with path.open("rb") as file:
                data = file.read(_LARGEST + 1)
        except InputError:
            raise
        except OSError as error:
            told = f"{path} cannot be read: {error.strerror}."
            raise InputError(told, "Check path and permissions.", context) from error
        if len(data) > _LARGEST:
            hint = f"{kind.capitalize()} files are small texts."
            raise FileTooLargeError(f"{path} has more than {_LARGEST} bytes.", hint, context)
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            raise self.error(f"{path}:{line}: this is not UTF-8 text.", "Save the file as UTF-8.", context) from error

    def mistakes(self, problems: Iterable[tuple[str, Problem]]) -> InputError:
        """Return an error that tells what is wrong in files, each problem with its source."""
        ordered = sorted(problems, key=lambda each: (each[0], each[1].line))
        lines = [f"{source}:{problem.line}: {problem.message}" for source, problem in ordered[:_MOST]]
        more = f"There are {len(ordered) - _MOST} more mistakes." if len(ordered) > _MOST else ""
        told = [{"file": source, **asdict(problem)} for source, problem in ordered]
        return self.error("\n".join(lines), more, {"file": ordered[0][0], "problems": told})
