"""The layout of a task file, checked with pydantic; imported when a file is read."""

from __future__ import annotations

import difflib
import re
import reprlib
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from bimnav.tasks._task import EXPECT, RULE_LISTS, Destination, checked_words
from bimnav.tasks._toml import Key, Problem, Toml

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

__all__ = ["AvoidTable", "RuleTable", "TaskFile", "TaskTable", "check_tables"]

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


class RuleTable(_Table):
    """Picks elements, or rooms: what the filter picks, if a word stands in its names."""

    filter: str = Field("IfcElement", pattern=r"\S", description="Query in the selector language of IfcOpenShell.")
    words: Words = Field([], description="At least one stands, whole, in family, type name, ObjectType or name.")
    exclude_words: Words = Field([], description="None of them stands there.")
    label: str = Field("", description="What the rule is about, for explanations.")
    storeys: Words = Field([], description="Names or GlobalIds of the storeys it looks on.")
    spaces: Words = Field([], description="Names or GlobalIds of the rooms it looks in.")
    expect: Annotated[str, AfterValidator(_expected)] = Field(
        "", json_schema_extra={"pattern": f"{EXPECT}|^$"}, description="How many it must find, such as '>=1'."
    )


class AvoidTable(RuleTable):
    """A rule for floor that costs more to cross."""

    factor: float = Field(2.0, ge=1, allow_inf_nan=False, description="Cost of a metre of this floor, at least 1.")


class TaskTable(_Table):
    """A job, in words that hold in any building."""

    description: str = Field("", description="What the job is, in a line.")
    targets: list[RuleTable] = Field([], description="What the robot visits.")
    obstacles: list[RuleTable] = Field([], description="What blocks; without any, everything solid in its way.")
    ignore: list[RuleTable] = Field([], description="What does not block even so.")
    avoid: list[AvoidTable] = Field([], description="Floor that costs more to cross.")
    restricted: list[RuleTable] = Field([], description="Floor never to enter.")
    exits: list[RuleTable] = Field([], description="Ways out of the building.")
    docks: list[RuleTable] = Field([], description="Where the robot waits and charges.")
    service_time: Seconds = Field(0.0, description="Time at each target: seconds, or ISO 8601 such as 'PT30S'.")
    destination: Destination = Field("center", description="Drive onto a target's middle, or stand next to it.")
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
            Problem(toml.line_of(d["loc"]), _explained(d), _dotted(d["loc"]), _short.repr(d["input"]))
            for d in error.errors(include_url=False)
        ]


def _explained(detail: ErrorDetails) -> str:
    key, kind = detail["loc"], detail["type"]
    last, table = str(key[-1]), _dotted(key[:-1]) or "the file"
    if kind == "missing":
        return f"{last!r} is missing in {table}{'; begin with schema = 1.' if last == 'schema' else '.'}"
    if kind == "extra_forbidden":
        known = [field.alias or name for name, field in _layout(key).model_fields.items()]
        near = difflib.get_close_matches(last, known, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}."
        return f"unknown key {last!r} in {table}; {hint}"
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
    return f"{_dotted(key)} = {_short.repr(detail['input'])}: {wanted.rstrip('.')}."


def _layout(key: Key) -> type[BaseModel]:
    """Return the table that a key stands in."""
    if len(key) < 5:
        return TaskFile if len(key) == 1 else TaskTable
    return AvoidTable if key[2] == "avoid" else RuleTable


def _dotted(key: Key) -> str:
    """Write a key as in `tasks.cleaning.targets[0].filter`."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")
