"""Checks of what callers hand over: one clear error names the argument, the value and the remedy."""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Iterable, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bimnav.errors import InputError, ValueRangeError

__all__ = ["cell", "fields", "function", "many", "need", "number", "numbers", "path", "point", "tour", "whole"]

T = TypeVar("T")

_REMEDIES = {
    "Axes": "Give a matplotlib Axes, or None for a new figure.",
    "Building": "Make it with read_ifc.",
    "Charger": "Make it with Charger.",
    "Geometry": "Give a shapely polygon, in metres.",
    "Generator": "Make it with numpy.random.default_rng.",
    "GridFrame": "Take that of a graph, `graph.frame`, or make it with GridFrame.covering.",
    "IndoorEnvironment": "Make it with make_environment.",
    "NavGraph": "Make it with build_graph, or NavGraph.from_mask.",
    "Path": "Make it with find_path.",
    "Robot": "Make it with Robot or load_robot.",
    "SimResult": "Make it with simulate, and its history.",
    "Stop": "Take those of a graph: `graph.stops`.",
    "Study": "Make it with study.",
    "Task": "Make it with load_task.",
    "TeamPlan": "Make it with plan_tours.",
    "Tour": "Make it with plan_tour.",
    "str": "Give a text.",
}
_CELL = "Give a Cell; `graph.frame.cell_at(x, y)` finds the one at a point."
_FAR = sys.float_info.max


def need(name: str, value: object, kind: type | str, *, or_none: bool = False) -> None:
    """Refuse what is not of a kind: a class, or the name of one that the caller does not import."""
    if or_none and value is None:
        return
    if not (_is_called(value, kind) if isinstance(kind, str) else isinstance(value, kind)):
        known = kind if isinstance(kind, str) else kind.__name__
        article = "an" if known[0] in "AEIO" else "a"
        raise _refused(name, value, f"not {article} {known}", _REMEDIES.get(known, f"Give {article} {known}."))


def many(name: str, values: Iterable[T], kind: type | str = object) -> tuple[T, ...]:
    """Return several things of a kind; refuse what is no list of them."""
    if isinstance(values, (str, bytes, Mapping)) or not isinstance(values, Iterable):
        raise _refused(name, values, "not a list", "Put it into a list.")
    listed = tuple(values)
    for k, value in enumerate(listed):
        need(f"{name}[{k}]", value, kind)
    return listed


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """Return a number from a range; inf is a number, NaN is none."""
    is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not is_number or value != value:
        raise _refused(name, value, "not a number", _range(low, high), ValueRangeError)
    if not low <= value <= high:
        raise ValueRangeError(f"{name} is {value}.", _range(low, high), {name: value})
    return float(value)


def whole(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> int:
    """Return a whole number from a range."""
    number(name, value, low, high)
    try:
        return operator.index(value)
    except TypeError:
        raise _refused(name, value, "not a whole number", _range(low, high), ValueRangeError) from None


def numbers(name: str, values: Any) -> NDArray[np.float64]:
    """Return a private copy of an array of numbers, of any shape."""
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise _refused(name, values, "not an array of numbers", "Give numbers in rows of one length.") from None


def cell(name: str, value: Any) -> tuple[int, int, int]:
    """Return storey, row and column of what may be a cell."""
    try:
        storey, row, col = value
        return operator.index(storey), operator.index(row), operator.index(col)
    except (TypeError, ValueError):
        raise _refused(name, value, "which is no cell", _CELL) from None


def point(name: str, value: Iterable[float]) -> tuple[float, float, float]:
    """Return x, y and z of a point, metres."""
    try:
        x, y, z = value
    except (TypeError, ValueError):
        raise _refused(name, value, "which is no point", "Give (x, y, z) in metres.") from None
    return number(name, x, -_FAR, _FAR), number(name, y, -_FAR, _FAR), number(name, z, -_FAR, _FAR)


def tour(name: str, value: object) -> None:
    """Refuse what is no tour; any planner's will do that has a route."""
    if not hasattr(value, "route"):
        need(name, value, "Tour")


def path(name: str, value: str | PathLike[str]) -> Path:
    """Return the path of a file."""
    try:
        return Path(fspath(value))
    except TypeError:
        raise _refused(name, value, "not a path", "Give a text or a pathlib.Path.") from None


def function(name: str, value: object) -> None:
    """Refuse what cannot be called; None is no function to call."""
    if value is not None and not callable(value):
        raise _refused(name, value, "not a function", "Give a function, or None.")


def fields(value: Any, *, numbers: str = "", wholes: str = "", texts: str = "", shapes: str = "") -> None:
    """Refuse a value some of whose fields are of another kind; None will do where it is the default."""
    kinds = {kind: names.split() for kind, names in (("n", numbers), ("w", wholes), ("t", texts), ("s", shapes))}
    for kind, names in kinds.items():
        for field in names:
            given, name = getattr(value, field), f"{field} of {type(value).__name__}"
            if given is None and value.__dataclass_fields__[field].default is None:
                continue
            if kind in "nw":
                (number if kind == "n" else whole)(name, given)
            else:
                need(name, given, str if kind == "t" else "Geometry")


def _is_called(value: object, name: str) -> bool:
    return any(kind.__name__ == name for kind in type(value).__mro__)


def _range(low: float, high: float) -> str:
    if low == -math.inf and high == math.inf:
        return "Give a number."
    return f"Give a number of at least {low:g}." if high == math.inf else f"Give a number from {low:g} to {high:g}."


def _refused(name: str, value: object, why: str, hint: str, error: type[InputError] = InputError) -> InputError:
    return error(f"{name} is {value!r:.80}, {why}.", hint, {"argument": name})
