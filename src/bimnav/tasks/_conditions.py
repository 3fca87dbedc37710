"""Conditions on properties, such as `Pset_DoorCommon.FireRating != ''`."""

from __future__ import annotations

import fnmatch
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

from bimnav._placeholders import is_placeholder
from bimnav.building import Facts
from bimnav.errors import TaskError

__all__ = ["Condition", "parse_condition"]

Value: TypeAlias = str | float | bool

_CONDITION = re.compile(
    r"""\s* (?: '(?P<quoted_set>[^']+)' | (?P<set>[^.=<>!']+?) ) \s* \. \s*
        (?: '(?P<quoted_name>[^']+)' | (?P<name>[^=<>!']+?) ) \s*
        (?P<sign> != | <= | >= | \*= | = | < | > ) \s*
        (?: '(?P<text>[^']*)' | "(?P<other_text>[^"]*)" | (?P<bare>[^\s'"=<>!][^'"=<>!]*?) ) \s*""",
    re.VERBOSE,
)
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_ORDERS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_HINT = (
    "Write a property set, a dot, a property, one of = != < <= > >= *=, and a value, as in "
    '"Pset_DoorCommon.FireRating != \'\'" or "*.Width >= 0.9".'
)


@dataclass(frozen=True, slots=True)
class Condition:
    """A property set and a property, in which `*` stands for anything, and what the value is compared with."""

    set_name: str
    name: str
    sign: str
    value: Value

    def met_by(self, facts: Facts) -> str:
        """Return what meets the condition, in words; empty if nothing does.

        The product's own properties count, and those of its type if it has none. A property that is not
        there, or holds a placeholder, is empty.
        """
        found = list(self._found(facts.properties)) or list(self._found(facts.type_properties))
        for told, value in found:
            if self._holds(value):
                return f"{told} is {value!r}"
        if self.sign == "!=" and not any(_equal(value, self.value) for _, value in found) and self.value != "":
            return f"no {self.set_name}.{self.name} is {self.value!r}"
        if self.sign == "=" and self.value == "" and not found:
            return f"no {self.set_name}.{self.name} is filled in"
        return ""

    def _found(self, sets: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Any]]:
        for set_name, properties in sets.items():
            if not _fits(self.set_name, set_name):
                continue
            for name, value in properties.items():
                if _fits(self.name, name) and value not in (None, "") and not is_placeholder(name, value):
                    yield f"{set_name.strip()}.{name}", value

    def _holds(self, value: Any) -> bool:
        if self.sign == "=":
            return _equal(value, self.value)
        if self.sign == "!=":
            return self.value == ""
        if self.sign == "*=":
            return str(self.value).casefold() in str(value).casefold()
        number = _number(value)
        return number is not None and _ORDERS[self.sign](number, float(self.value))


@lru_cache(maxsize=1 << 10)
def parse_condition(text: str) -> Condition:
    """Read a condition.

    Raises
    ------
    TaskError
        If it cannot be understood.
    """
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise TaskError(f"{text!r} is not a condition.", _HINT)
    sign, bare = found["sign"], found["bare"]
    value: Value = bare if bare is not None else next(t for t in (found["text"], found["other_text"]) if t is not None)
    if bare is not None and bare.lower() in ("true", "false"):
        value = bare.lower() == "true"
    elif bare is not None and _NUMBER.fullmatch(bare):
        value = float(bare)
    if sign in _ORDERS and not (isinstance(value, float)):
        raise TaskError(f"{text!r} compares with {value!r}, which is no number.", _HINT)
    set_name = found["quoted_set"] or found["set"]
    return Condition(set_name.strip(), (found["quoted_name"] or found["name"]).strip(), sign, value)


def _fits(pattern: str, name: str | None) -> bool:
    name = name or ""  # damaged files have sets and properties without one
    return fnmatch.fnmatchcase(name.strip().casefold(), pattern.casefold().replace("[", "[[]"))


def _number(value: Any) -> float | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        return float(value)
    return float(value) if isinstance(value, str) and _NUMBER.fullmatch(value.strip()) else None


def _equal(value: Any, wanted: Value) -> bool:
    """Compare with a text, a number or a truth; several values equal what any of them equals."""
    if isinstance(value, (list, tuple)):
        return any(_equal(each, wanted) for each in value)
    if isinstance(wanted, bool) or isinstance(value, bool):
        return value is wanted or (isinstance(value, bool) and str(value).casefold() == str(wanted).casefold())
    if isinstance(wanted, float):
        return _number(value) == wanted
    return str(value).strip().casefold() == wanted.strip().casefold()
