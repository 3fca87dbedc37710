"""Targets from outside the model: what users, cameras and digital twins have seen, and files of it."""

from __future__ import annotations

import csv
import difflib
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bimnav import _checks
from bimnav._identity import global_id_of
from bimnav.errors import FileKindError, FileMissingError, InputError, ValueRangeError

__all__ = ["Detection", "parse_length", "parse_place", "parse_target", "read_targets"]

_FARTHEST = 1e8  # metres from the origin; beyond it float64 no longer holds a tenth of a micrometre
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_LENGTH = re.compile(rf"\s*({_NUMBER})\s*(m|cm|mm|ft|in)?\s*")
_COLUMNS = ("name", "x", "y", "storey", "z", "size", "class")


@dataclass(frozen=True, slots=True)
class Detection:
    """A target placed by the user, a camera or a digital twin.

    Parameters
    ----------
    name
        As given.
    x, y
        World point in metres.
    storey
        Name, GlobalId or index of a storey; None if `z` tells, or the job does.
    z
        World height in metres, or None.
    size
        Width and depth in metres, or None if unknown.
    ifc_class
        What was seen, as an IFC class.
    """

    name: str
    x: float
    y: float
    storey: str | int | None = None
    z: float | None = None
    size: tuple[float, float] | None = None
    ifc_class: str = "IfcBuildingElementProxy"

    def __post_init__(self) -> None:
        try:
            self.name.encode()
            object.__setattr__(self, "x", float(self.x))
            object.__setattr__(self, "y", float(self.y))
        except (AttributeError, TypeError, ValueError) as error:  # of what is no text, in no encoding, no number
            raise ValueRangeError(
                f"target {self.name!r:.80} at ({self.x!r:.40}, {self.y!r:.40}) cannot be read.",
                "Give a name in UTF-8, then x and y in metres.",
            ) from error
        _checks.fields(self, numbers="z")
        numbers = {"x": self.x, "y": self.y}
        if self.z is not None:
            numbers["z"] = self.z
        for what, value in numbers.items():
            if not math.isfinite(value) or abs(value) > _FARTHEST:
                raise ValueRangeError(
                    f"target {self.name!r}: {what} is {value}.",
                    "Give world coordinates of the model in metres.",
                    {"name": self.name, what: value},
                )
        size = np.zeros(2) if self.size is None else _checks.numbers("size", self.size)
        if size.shape != (2,) or not ((size >= 0) & (size <= 1e3)).all():
            raise ValueRangeError(f"target {self.name!r}: size is {self.size}.", "Give two lengths from 0 to 1000 m.")

    @property
    def global_id(self) -> str:
        """A GlobalId derived from name and position: the same target has the same id in every run."""
        text = f"{self.name}\0{self.x!r}\0{self.y!r}\0{self.storey!r}\0{self.z!r}"
        return global_id_of(text)


def parse_length(text: str) -> float:
    """Return metres; a bare number is metres, `1ft`, `30cm`, `12in` and `5mm` say their unit.

    >>> parse_length("0.5ft")
    0.1524
    """
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise InputError(f"{text!r} is not a length.", "Write metres, or a number with m, cm, mm, ft or in.")
    return float(match[1]) * _METRES[match[2] or "m"]


def parse_place(text: str) -> tuple[float, float, str | None]:
    """Read `X,Y[,STOREY]`; a storey's name may hold commas and spaces.

    >>> parse_place("-1,1ft,Level 1, east")
    (-1.0, 0.3048, 'Level 1, east')
    """
    parts = text.split(",", 2)
    if len(parts) < 2:
        raise InputError(f"{text!r} is not a place.", "Write X,Y or X,Y,STOREY in metres, such as 2.5,1 or 8ft,3ft.")
    storey = parts[2].strip() if len(parts) == 3 else None
    return parse_length(parts[0]), parse_length(parts[1]), storey or None


def parse_target(text: str) -> Detection:
    """Read `NAME@X,Y[,STOREY]`.

    >>> parse_target("spill@1.5,2").y
    2.0
    """
    match = re.fullmatch(rf"(.*)@(\s*{_NUMBER}\s*(?:m|cm|mm|ft|in)?\s*,.*)", text, re.DOTALL)
    name = match[1].strip() if match else ""
    if match is None or not name:
        raise InputError(f"{text!r} is not a target.", "Write NAME@X,Y or NAME@X,Y,STOREY, such as spill@2.5,1.")
    x, y, storey = parse_place(match[2])
    return Detection(name, x, y, storey)


def read_targets(path: str | Path) -> tuple[Detection, ...]:
    """Read detections from a CSV or JSON file.

    A CSV file has a header; a JSON file holds a list of objects. Columns and keys are `name`, `x`, `y`
    (metres), and if known `storey` (name or index), `z` (metres), `size` (metres, one number or
    `width x depth`) and `class` (an IFC class).

    Raises
    ------
    FileMissingError, FileKindError
        If there is no such file, or it is a folder or neither CSV nor JSON.
    InputError
        If an entry cannot be understood; the message names file, entry and column.
    """
    path = _checks.path("path", path)
    if not path.exists():
        raise FileMissingError(f"{path} does not exist.", "Check the path of the targets file.", {"path": str(path)})
    if not path.is_file():
        raise FileKindError(f"{path} is not a file.", "Give a CSV or JSON file of targets.", {"path": str(path)})
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileKindError(f"{path} is not UTF-8 text.", "Save it as UTF-8 CSV or JSON.") from error
    entries = _from_json(path, text) if path.suffix.lower() == ".json" else _from_csv(path, text)
    return tuple(_detection(f"{path}, {place}", entry) for place, entry in entries)


def _from_json(path: Path, text: str) -> list[tuple[str, Mapping[str, Any]]]:
    try:
        values = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise FileKindError(f"{path} is not JSON: {error}.", "It should hold a list of targets.") from error
    if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
        raise FileKindError(f"{path} does not hold a list of objects.", 'Write [{"name": "spill", "x": 1, "y": 2}].')
    return [(f"target {k}", value) for k, value in enumerate(values, 1)]


def _from_csv(path: Path, text: str) -> list[tuple[str, Mapping[str, Any]]]:
    reader = csv.DictReader(text.splitlines(), skipinitialspace=True)
    if not reader.fieldnames or "name" not in reader.fieldnames:
        raise FileKindError(f"{path} has no header with a column 'name'.", f"Begin with {','.join(_COLUMNS)}.")
    entries: list[tuple[str, Mapping[str, Any]]] = []
    for row in reader:
        if None in row or None in row.values():
            raise InputError(f"{path}, line {reader.line_num} has {len(row)} columns, not {len(reader.fieldnames)}.")
        entries.append((f"line {reader.line_num}", {k: v for k, v in row.items() if v.strip()}))
    return entries


def _detection(place: str, entry: Mapping[str, Any]) -> Detection:
    for key in entry:
        if key not in _COLUMNS:
            near = difflib.get_close_matches(str(key), _COLUMNS, 1)
            hint = f"Did you mean {near[0]!r}?" if near else f"Known are {', '.join(_COLUMNS)}."
            raise InputError(f"{place}: unknown column {key!r}.", hint)
    missing = [key for key in ("name", "x", "y") if key not in entry]
    if missing:
        raise InputError(f"{place}: {', '.join(missing)} is missing.", "Every target needs a name, x and y.")
    return Detection(
        str(entry["name"]),
        _metres(place, "x", entry["x"]),
        _metres(place, "y", entry["y"]),
        entry.get("storey"),
        _metres(place, "z", entry["z"]) if "z" in entry else None,
        _size(place, entry["size"]) if "size" in entry else None,
        str(entry.get("class", "IfcBuildingElementProxy")),
    )


def _metres(place: str, column: str, value: Any) -> float:
    try:
        metres = parse_length(value) if isinstance(value, str) else float(value)
    except (InputError, TypeError, ValueError) as error:
        raise InputError(f"{place}: {column} is {value!r}, not a length.", "Give metres.") from error
    if not math.isfinite(metres):
        raise InputError(f"{place}: {column} is {value!r}.", "Give finite metres.")
    return metres


def _size(place: str, value: Any) -> tuple[float, float]:
    sides = re.split(r"\s*[x×]\s*", value) if isinstance(value, str) else value
    sides = list(sides) if isinstance(sides, (list, tuple)) else [sides]
    if len(sides) not in (1, 2):
        raise InputError(f"{place}: size is {value!r}.", "Give one number, or width x depth, in metres.")
    width = _metres(place, "size", sides[0])
    return width, _metres(place, "size", sides[-1])
