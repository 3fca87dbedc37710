"""A task and its rules as values; files are read into them, and they can be written by hand."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, get_args

from bimnav.errors import TaskError
from bimnav.tasks._words import tokens

__all__ = ["EXPECT", "RULE_LISTS", "Destination", "Rule", "Task", "checked_words"]

Destination: TypeAlias = Literal["center", "nearest_free"]

RULE_LISTS = ("targets", "obstacles", "ignore", "avoid", "restricted", "exits", "docks")
EXPECT = r"^\s*(>=|<=|==|>|<|=)?\s*(\d{1,9})\s*$"


def checked_words(words: Iterable[str]) -> tuple[str, ...]:
    """Return words as a tuple; each must be a text with a letter or a digit in it."""
    if isinstance(words, str):
        raise TaskError(f"{words!r} is one text.", f"Give a list: [{words!r}].")
    words = tuple(words)
    for word in words:
        if not isinstance(word, str) or not tokens(word):
            raise TaskError(f"{word!r} is not a word.", "A word has letters or digits.")
    return words


@dataclass(frozen=True, slots=True)
class Rule:
    """Picks elements of a building, or rooms.

    What the filter picks is kept if one of the words stands in its family name, type name, ObjectType or
    name, and none of the excluded words does. Words are found whole, in any case, with or without accents:
    `Müll` is found in `MULL:2` and not in `Mullion`. A word may be several: `banana peel`. Words in scripts
    that do not part them with spaces are found anywhere.

    Parameters
    ----------
    filter
        In the selector language of IfcOpenShell, such as `IfcFurniture, Name=/.*Table.*/`.
    words
        At least one of them must be found; none given, the filter decides alone.
    exclude_words
        None of them may be found.
    label
        What the rule is about, for explanations.
    storeys
        Names or GlobalIds; an element is on the storey it stands on, or without geometry where the file puts it.
    spaces
        Names or GlobalIds; an element is in the space that holds its middle, and where the file puts it.
    factor
        In `Task.avoid`: what a metre of floor costs there, at least 1.
    expect
        How many elements it must find, such as `>=1`; empty for any number.
    source
        Where it was written, as `file:line`; equality ignores it.

    Raises
    ------
    TaskError
        If a value cannot be used.
    """

    filter: str = "IfcElement"
    words: tuple[str, ...] = ()
    exclude_words: tuple[str, ...] = ()
    label: str = ""
    storeys: tuple[str, ...] = ()
    spaces: tuple[str, ...] = ()
    factor: float = 2.0
    expect: str = ""
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in ("words", "exclude_words", "storeys", "spaces"):
            object.__setattr__(self, name, checked_words(getattr(self, name)))
        if not self.filter.strip():
            raise TaskError("a rule has an empty filter.", "IfcElement picks every element.")
        if not 1 <= self.factor < math.inf:
            raise TaskError(f"factor is {self.factor}.", "Give a finite number, at least 1; `restricted` closes floor.")
        if self.expect and not re.search(EXPECT, self.expect):
            raise TaskError(f"expect is {self.expect!r}.", "Write a comparison with a whole number, such as '>=1'.")

    def is_met(self, count: int) -> bool:
        """Tell whether that many elements are as many as expected."""
        found = re.search(EXPECT, self.expect)
        if found is None:
            return True
        wanted = int(found[2])
        return {
            ">=": count >= wanted,
            "<=": count <= wanted,
            ">": count > wanted,
            "<": count < wanted,
        }.get(found[1] or "==", count == wanted)


@dataclass(frozen=True, slots=True)
class Task:
    """A job, in words that hold in any building.

    Parameters
    ----------
    name, description
        What users call it, and what it does.
    targets
        What the robot visits.
    obstacles
        What blocks. Empty means by meaning: everything solid in the robot's height band that is not floor,
        door, opening, space or annotation.
    ignore
        What does not block even so.
    avoid
        Floor that costs more to cross, by the rule's `factor`.
    restricted
        Floor never to enter.
    exits
        Ways out of the building.
    docks
        Where the robot waits and charges; a job begins there if nothing else is said.
    service_time
        Seconds the robot works at each target.
    destination
        `center`: drive onto the target's middle if it is free, else stand next to it. `nearest_free`:
        stand next to it.
    removes_targets
        Whether the robot takes targets away, as litter: they do not block, and once served they are gone.
    source
        Where it was written, as `file:line`; equality ignores it.

    Raises
    ------
    TaskError
        If a value cannot be used.
    """

    name: str
    description: str = ""
    targets: tuple[Rule, ...] = ()
    obstacles: tuple[Rule, ...] = ()
    ignore: tuple[Rule, ...] = ()
    avoid: tuple[Rule, ...] = ()
    restricted: tuple[Rule, ...] = ()
    exits: tuple[Rule, ...] = ()
    docks: tuple[Rule, ...] = ()
    service_time: float = 0.0
    destination: Destination = "center"
    removes_targets: bool = False
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in RULE_LISTS:
            object.__setattr__(self, name, _rules(name, getattr(self, name)))
        if not self.name.strip():
            raise TaskError("a task has no name.")
        if not 0 <= self.service_time < math.inf:
            raise TaskError(f"task {self.name!r}: service_time is {self.service_time}.", "Give seconds, 0 or more.")
        if self.destination not in get_args(Destination):
            known = ", ".join(map(repr, get_args(Destination)))
            raise TaskError(f"task {self.name!r}: destination is {self.destination!r}.", f"Known are {known}.")


def _rules(name: str, rules: Any) -> tuple[Rule, ...]:
    listed: tuple[Any, ...] = tuple(rules) if isinstance(rules, Iterable) else (rules, None)
    if not all(isinstance(rule, Rule) for rule in listed):
        raise TaskError(f"{name} is {rules!r}.", f"Give a list of rules: {name}=[Rule(words=['spill'])].")
    return listed
