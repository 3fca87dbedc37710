"""The layout of a task file, checked with pydantic; imported when a file is read."""

from __future__ import annotations

import difflib
import re
import reprlib
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
)

from bimnav._toml import Key, Problem, Toml
from bimnav._wording import meant
from bimnav.tasks._task import (
    EXPECT,
    RULE_LISTS,
    DoorState,
    Entourage,
    Objective,
    Place,
    Side,
    checked_conditions,
    checked_words,
)

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

__all__ = ["RuleTable", "StandoffTable", "TaskFile", "TaskTable", "check_tables"]

_DURATION = re.compile(r"P(?=.)(?:(N)D)?(?:T(?=.)(?:(N)H)?(?:(N)M)?(?:(N)S)?)?".replace("N", r"\d+(?:[.,]\d+)?"))

_short = reprlib.Repr()
_short.maxstring = _short.maxother = 60


def _seconds(value: Any) -> Any:
    """Return seconds for an ISO 8601 duration, and any other value as it is."""
    if not isinstance(value, str):
        return value
    duration = _DURATION.fullmatch(value)
    if duration is None:
        raise ValueError("should be a number of seconds or an ISO 8601 duration such as 'PT1M30S'")
    units = zip(duration.groups("0"), (86400, 3600, 60, 1), strict=True)
    return float(sum(float(count.replace(",", ".")) * unit for count, unit in units))


def _expected(value: str) -> str:
    if value and not re.search(EXPECT, value):
        raise ValueError("should be a comparison with a whole number, such as '>=1'")
    return value


def _known(version: int) -> int:
    if version != 1:
        raise ValueError("should be 1")
    return version


def _words(values: list[str]) -> list[str]:
    checked_words(values)
    return values


def _conditions(values: list[str]) -> list[str]:
    checked_conditions(values)
    return values


Words = Annotated[list[Annotated[str, Field(min_length=1)]], AfterValidator(_words)]
Seconds = Annotated[
    float,
    Field(ge=0, allow_inf_nan=False),
    BeforeValidator(
        _seconds,
        json_schema_input_type=Annotated[float, Field(ge=0)] | Annotated[str, Field(pattern=r"^P[0-9DTHMS.,]+$")],
    ),
]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class StandoffTable(_Table):
    """Standing at a distance from a target."""

    distance: float = Field(0.5, ge=0, allow_inf_nan=False, description="From robot to outline, metres.")
    side: Side = Field("any", description="Which side of the target, as the model turns it.")
    facing: bool = Field(True, description="Whether the robot turns to the target.")


_TAGS = ("word", "table")  # pydantic names the branch of a union in its errors
DestinationOf = Annotated[
    Annotated[Place, Tag("word")] | Annotated[StandoffTable, Tag("table")],
    Discriminator(lambda value: _TAGS[isinstance(value, (dict, StandoffTable))]),
]
Priority = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class RuleTable(_Table):
    """Picks elements, or rooms: what the filter picks, if a word stands in its names."""

    filter: str = Field("IfcElement", pattern=r"\S", description="Query in the selector language of IfcOpenShell.")
    words: Words = Field([], description="At least one stands, whole, in family, type name, ObjectType or name.")
    exclude_words: Words = Field([], description="None of them stands there.")
    label: str = Field("", description="What the rule is about, for explanations.")
    storeys: Words = Field([], description="Names or GlobalIds of the storeys it looks on.")
    spaces: Words = Field([], description="Names or GlobalIds of the rooms it looks in.")
    use: Words = Field([], description="Words in the name of the room, or of the room that the element is in.")
    classification: Words = Field([], description="Beginnings of codes, such as 'OmniClass: 23.40', or titles.")
    exclude_classification: Words = Field([], description="None of these fits.")
    properties: Annotated[list[Annotated[str, Field(min_length=1)]], AfterValidator(_conditions)] = Field(
        [], description="Conditions that all hold, such as \"Pset_DoorCommon.FireRating != ''\"."
    )
    leads_outside: bool = Field(False, description="Only doors that lead outside, as the model or geometry tells.")
    systems: Words = Field([], description="Words in the names of the systems it is part of.")
    expect: Annotated[str, AfterValidator(_expected)] = Field(
        "", json_schema_extra={"pattern": f"{EXPECT}|^$"}, description="How many it must find, such as '>=1'."
    )


class TargetTable(RuleTable):
    """A rule for what the robot visits."""

    destination: DestinationOf | None = Field(None, description="Where the robot goes for it.")
    service_time: Seconds | None = Field(None, description="Time there: seconds, or ISO 8601 such as 'PT30S'.")
    priority: Priority | None = Field(None, description="How much it matters, 0 or more.")
    due: Seconds | None = Field(None, description="Time from the beginning within which it should be served.")
    abilities: Words = Field([], description="What a robot must be able to do there.")


class DoorTable(RuleTable):
    """A rule for how doors are."""

    filter: str = Field("IfcDoor", pattern=r"\S", description="Query in the selector language of IfcOpenShell.")
    state: DoorState = Field("closed", description="How the doors are: 'locked', 'automatic', 'closed' or 'open'.")
    opening_time: Seconds = Field(0.0, description="Time until such a door is open.")


Margin = Annotated[float, Field(ge=0, allow_inf_nan=False, description="How far around it the rule holds, metres.")]


class RestrictedTable(RuleTable):
    """A rule for floor never to enter."""

    margin: Margin = 0.0


class AvoidTable(RuleTable):
    """A rule for floor that costs more to cross."""

    margin: Margin = 0.0

    factor: float = Field(2.0, ge=1, allow_inf_nan=False, description="Cost of a metre of this floor, at least 1.")


class TaskTable(_Table):
    """A job, in words that hold in any building."""

    description: str = Field("", description="What the job is, in a line.")
    extends: str = Field("", description="Name of the task that this one builds on; its own rules go before.")
    targets: list[TargetTable] = Field([], description="What the robot visits.")
    obstacles: list[RuleTable] = Field([], description="What blocks; without any, everything solid in its way.")
    ignore: list[RuleTable] = Field([], description="What does not block even so.")
    avoid: list[AvoidTable] = Field([], description="Floor that costs more to cross.")
    restricted: list[RestrictedTable] = Field([], description="Floor never to enter.")
    exits: list[RuleTable] = Field([], description="Ways out of the building.")
    docks: list[RuleTable] = Field([], description="Where the robot waits and charges.")
    doors: list[DoorTable] = Field([], description="How doors are; the first rule that picks one holds.")
    service_time: Seconds = Field(0.0, description="Time at each target: seconds, or ISO 8601 such as 'PT30S'.")
    destination: DestinationOf = Field("center", description="Drive onto a target, or where to stand for it.")
    priority: Priority = Field(1.0, description="How much each target matters, 0 or more.")
    due: Seconds | None = Field(None, description="Time from the beginning within which to serve each target.")
    abilities: Words = Field([], description="What a robot must be able to do at each target.")
    objective: Objective = Field("distance", description="What to keep small: 'distance', 'time' or 'energy'.")
    entourage: Entourage = Field("ignore", description="Whether people, cars and trees of the picture 'block'.")
    removes_targets: bool = Field(False, description="Whether targets do not block and are gone once served.")


class TaskFile(_Table):
    """A file of tasks for bimnav."""

    schema_: Annotated[int, AfterValidator(_known)] = Field(
        alias="schema", json_schema_extra={"const": 1}, description="Version of this layout."
    )
    tasks: dict[Annotated[str, Field(pattern=r"\S")], TaskTable] = Field(
        min_length=1, description="One table for each task, by its name."
    )


def check_tables(toml: Toml) -> tuple[dict[str, TaskTable], list[Problem]]:
    """Return the tables of a file, or all that is wrong with them."""
    try:
        return TaskFile.model_validate(toml.document).tasks, []
    except ValidationError as error:
        return {}, [
            Problem(toml.line_of(key), _explained(d, key), _dotted(key), _short.repr(d["input"]))
            for d in error.errors(include_url=False)
            for key in [_key_of(d)]
        ]


def _key_of(detail: ErrorDetails) -> Key:
    """Return where an error stands, without the branches of unions."""
    key = detail["loc"]
    return tuple(part for k, part in enumerate(key) if k == 0 or key[k - 1] != "destination" or part not in _TAGS)


def _explained(detail: ErrorDetails, key: Key) -> str:
    kind = detail["type"]
    last, table = str(key[-1]), _dotted(key[:-1]) or "the file"
    if kind == "missing":
        return f"{last!r} is missing in {table}{'; begin with schema = 1.' if last == 'schema' else '.'}"
    if kind == "extra_forbidden":
        known = [field.alias or name for name, field in _layout(key).model_fields.items()]
        return f"unknown key {last!r} in {table}; {meant(last, known)}"
    wanted = {
        "dict_type": "should be a table",
        "list_type": f"should be a list: [[{_dotted(key)}]]" if last in RULE_LISTS else "should be a list",
        "model_type": "should be a table",
        "string_pattern_mismatch": "should not be empty",
        "string_too_short": "should not be empty",
        "too_short": "should hold at least one task",
        "string_type": "should be a text in quotes",
        "value_error": str(detail.get("ctx", {}).get("error")),
    }.get(kind) or detail["msg"].removeprefix("Input ")
    if kind == "literal_error":
        near = difflib.get_close_matches(str(detail["input"]), re.findall(r"'(\w+)'", wanted), 1)
        wanted += f"; did you mean {near[0]!r}?" if near else ""
    return f"{_dotted(key)} = {_short.repr(detail['input'])}: {wanted.rstrip('.')}{'' if wanted[-1] == '?' else '.'}"


def _layout(key: Key) -> type[BaseModel]:
    """Return the table that a key stands in."""
    if key[-2:-1] == ("destination",):
        return StandoffTable
    if len(key) < 5:
        return TaskFile if len(key) == 1 else TaskTable
    tables: dict[object, type[RuleTable]] = {
        "avoid": AvoidTable,
        "doors": DoorTable,
        "restricted": RestrictedTable,
        "targets": TargetTable,
    }
    return tables.get(key[2], RuleTable)


def _dotted(key: Key) -> str:
    """Write a key as in `tasks.cleaning.targets[0].filter`."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")
