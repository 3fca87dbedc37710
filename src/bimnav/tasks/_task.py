"""A task and its rules as values; files are read into them, and they can be written by hand."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, get_args

from bimnav import _checks
from bimnav.errors import TaskError
from bimnav.tasks._conditions import parse_condition
from bimnav.tasks._words import tokens

__all__ = [
    "EXPECT",
    "RULE_LISTS",
    "Destination",
    "DoorState",
    "Entourage",
    "Objective",
    "Place",
    "Rule",
    "Side",
    "Standoff",
    "Task",
    "checked_words",
]

Place: TypeAlias = Literal["center", "nearest_free", "standoff", "space"]
Side: TypeAlias = Literal["front", "back", "any"]
DoorState: TypeAlias = Literal["locked", "automatic", "closed", "open"]
Objective: TypeAlias = Literal["distance", "time", "energy"]
Entourage: TypeAlias = Literal["ignore", "block"]

_WORDS = (
    "words",
    "exclude_words",
    "storeys",
    "spaces",
    "use",
    "classification",
    "exclude_classification",
    "systems",
    "abilities",
)
RULE_LISTS = ("targets", "obstacles", "ignore", "avoid", "restricted", "exits", "docks", "doors")
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


def checked_conditions(conditions: Iterable[str]) -> tuple[str, ...]:
    """Return conditions on properties as a tuple; each must be one."""
    if isinstance(conditions, str):
        raise TaskError(f"{conditions!r} is one text.", f"Give a list: [{conditions!r}].")
    conditions = tuple(conditions)
    for condition in conditions:
        parse_condition(condition)
    return conditions


@dataclass(frozen=True, slots=True)
class Standoff:
    """Standing at a distance from a target.

    Parameters
    ----------
    distance
        From the robot's middle to the target's outline, metres.
    side
        Which side of the target, as the model turns it: `front` is its own negative y, `back` its
        positive y.
    facing
        Whether the robot turns to the target.

    Raises
    ------
    TaskError
        If a value cannot be used.
    """

    distance: float = 0.5
    side: Side = "any"
    facing: bool = True

    def __post_init__(self) -> None:
        _check_number("standoff: distance", self.distance, 0, "metres")
        _check_known("standoff: side", self.side, get_args(Side))


Destination: TypeAlias = Place | Standoff


@dataclass(frozen=True, slots=True)
class Rule:
    """Picks elements of a building, or rooms.

    What the filter picks is kept if all that the rule says besides holds, too. Words are found whole, in
    any case, with or without accents: `Müll` is found in `MULL:2` and not in `Mullion`. A word may be
    several: `banana peel`. A star in front of a word stands for the beginning of a compound, one behind it
    for an ending: `*ventil` is found in `Absperrventil`. Words in scripts that do not part them with spaces
    are found anywhere.

    Parameters
    ----------
    filter
        In the selector language of IfcOpenShell, such as `IfcFurniture, Name=/.*Table.*/`.
    words
        At least one of them stands in the family name, type name, ObjectType or name; none given, the filter
        decides.
    exclude_words
        None of them stands there.
    label
        What the rule is about, for explanations.
    storeys
        Names or GlobalIds; an element is on the storey it stands on, or without geometry where the file puts it.
    spaces
        Names or GlobalIds; an element is in the space that holds its middle, and where the file puts it.
    use
        Words in the names of rooms: the room itself, or one that the element is in, must have one of them.
    classification
        Beginnings of codes, of which one must fit: `23.40.20`, `OmniClass: 23-40 20`, or words of a title.
        Case, spaces, dots and dashes do not count; product and type do, and codes kept in properties.
    exclude_classification
        The same; none of them may fit.
    properties
        Conditions that all must hold, such as `Pset_DoorCommon.FireRating != ''`. `*` stands for anything.
        The product's own values go before its type's; placeholders count as empty.
    systems
        Words in the names of systems that the element, or a system it belongs to, is part of.
    leads_outside
        Whether to pick doors alone that lead outside: the model says so (`IsExternal`, `FireExit`), or says
        nothing and there is a room at one side only, near the ground.
    destination
        In `Task.targets`: where the robot goes for it; None is the task's.
    service_time
        In `Task.targets`: seconds the robot works there; None is the task's.
    priority
        In `Task.targets`: how much it matters, 0 or more; None is the task's.
    due
        In `Task.targets`: seconds from the beginning of the job within which it should be served; None is
        the task's.
    abilities
        In `Task.targets`: words for what a robot must be able to do there; none is the task's.
    factor
        In `Task.avoid`: what a metre of floor costs there, at least 1.
    margin
        In `Task.avoid` and `Task.restricted`: metres around the plan view of what is picked in which the rule
        holds, too, whatever stands between.
    state
        In `Task.doors`: `locked` doors open for robots with their key only, `closed` ones for robots that
        open doors, `automatic` and `open` ones for all.
    opening_time
        In `Task.doors`: seconds a robot waits until such a door is open.
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
    use: tuple[str, ...] = ()
    classification: tuple[str, ...] = ()
    exclude_classification: tuple[str, ...] = ()
    properties: tuple[str, ...] = ()
    systems: tuple[str, ...] = ()
    leads_outside: bool = False
    destination: Destination | None = None
    service_time: float | None = None
    priority: float | None = None
    due: float | None = None
    abilities: tuple[str, ...] = ()
    state: DoorState = "closed"
    opening_time: float = 0.0
    margin: float = 0.0
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in _WORDS:
            object.__setattr__(self, name, checked_words(getattr(self, name)))
        object.__setattr__(self, "properties", checked_conditions(self.properties))
        object.__setattr__(self, "destination", checked_destination("destination", self.destination))
        _checks.need("filter", self.filter, str)
        if not self.filter.strip():
            raise TaskError("a rule has an empty filter.", "IfcElement picks every element.")
        if not 1 <= self.factor < math.inf:
            raise TaskError(f"factor is {self.factor}.", "Give a finite number, at least 1; `restricted` closes floor.")
        if self.expect and not re.search(EXPECT, self.expect):
            raise TaskError(f"expect is {self.expect!r}.", "Write a comparison with a whole number, such as '>=1'.")
        for name, unit in (("service_time", "seconds"), ("priority", "a number"), ("due", "seconds")):
            if getattr(self, name) is not None:
                _check_number(name, getattr(self, name), 0, unit)
        _check_number("opening_time", self.opening_time, 0, "seconds")
        _check_number("margin", self.margin, 0, "metres")
        _check_known("state", self.state, get_args(DoorState))

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

    Of several rules in one list that pick an element, the first decides.

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
    doors
        How doors are, by the rule's `state`.
    service_time
        Seconds the robot works at each target.
    destination
        `center`: drive onto the target's middle if it is free, else stand next to it. `nearest_free`:
        stand next to it. `standoff`, or a `Standoff`: stand at a distance and face it. `space`: anywhere
        in the room that the target is.
    priority
        How much each target matters.
    due
        Seconds from the beginning of the job within which each target should be served; None for no limit.
    abilities
        Words for what a robot must be able to do at each target.
    objective
        What to keep small: `distance`, `time` or `energy`.
    entourage
        `ignore`: people, cars and trees that stand in the model for the picture do not block. `block`: they
        do.
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
    doors: tuple[Rule, ...] = ()
    priority: float = 1.0
    due: float | None = None
    abilities: tuple[str, ...] = ()
    objective: Objective = "distance"
    entourage: Entourage = "ignore"
    source: str = field(default="", compare=False)

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        from bimnav._cards import card

        lists = [(name, "; ".join(str(r.label or r.filter) for r in getattr(self, name))) for name in RULE_LISTS]
        return card(f"Task {self.name}", [("", self.description), *lists, ("source", self.source)])

    def __post_init__(self) -> None:
        for name in RULE_LISTS:
            object.__setattr__(self, name, _rules(name, getattr(self, name)))
        _checks.need("name", self.name, str)
        if not self.name.strip():
            raise TaskError("a task has no name.")
        told = f"task {self.name!r}: "
        object.__setattr__(self, "abilities", checked_words(self.abilities))
        _check_number(f"{told}service_time", self.service_time, 0, "seconds")
        _check_number(f"{told}priority", self.priority, 0, "a number")
        if self.due is not None:
            _check_number(f"{told}due", self.due, 0, "seconds")
        object.__setattr__(self, "destination", checked_destination(f"{told}destination", self.destination))
        _check_known(f"{told}objective", self.objective, get_args(Objective))
        _check_known(f"{told}entourage", self.entourage, get_args(Entourage))


def checked_destination(what: str, destination: Any) -> Any:
    """Return a destination, `standoff` as the one it stands for; it must be a known one."""
    if destination is not None and not isinstance(destination, Standoff):
        _check_known(what, destination, get_args(Place))
    return Standoff() if destination == "standoff" else destination


def _check_number(what: str, value: float, low: float, unit: str) -> None:
    if not low <= value < math.inf:
        raise TaskError(f"{what} is {value}.", f"Give {unit}, {low} or more.")


def _check_known(what: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise TaskError(f"{what} is {value!r}.", f"Known are {', '.join(map(repr, known))}.")


def _rules(name: str, rules: Any) -> tuple[Rule, ...]:
    listed: tuple[Any, ...] = tuple(rules) if isinstance(rules, Iterable) else (rules, None)
    if not all(isinstance(rule, Rule) for rule in listed):
        raise TaskError(f"{name} is {rules!r}.", f"Give a list of rules: {name}=[Rule(words=['spill'])].")
    return listed
