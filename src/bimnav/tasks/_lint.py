"""What is wrong with the filters of a task, told before they are asked of any building."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from bimnav._toml import Key, Problem, Toml
from bimnav.building import Building, Issue
from bimnav.tasks._match import told
from bimnav.tasks._task import RULE_LISTS, Rule, Task

if TYPE_CHECKING:
    from bimnav.ifc._lint import Finding

__all__ = ["lint_filters", "lint_rule", "lint_rules"]


def lint_filters(toml: Toml) -> tuple[list[Problem], list[Problem]]:
    """Return mistakes in the filters of a file, and what may not do what is meant."""
    from bimnav.ifc._lint import lint

    mistakes: list[Problem] = []
    warnings: list[Problem] = []
    for key, query in _filters(toml):
        for finding in lint(query):
            problem = Problem(
                toml.line_of(key), f"{_dotted(key[:-1])}: {_told(query, finding)}", _dotted(key), repr(query)
            )
            (mistakes if finding.severity == "error" else warnings).append(problem)
    return mistakes, warnings


def lint_rules(task: Task, building: Building) -> tuple[Issue, ...]:
    """Return what the filters of a task are taken for in the schemas of a building, where those lack a class."""
    found = (note for kind in RULE_LISTS for rule in getattr(task, kind) for note in lint_rule(rule, building))
    return tuple(dict.fromkeys(found))


def lint_rule(rule: Rule, building: Building) -> tuple[Issue, ...]:
    """Return what a rule's filter is taken for in the schemas of a building, where those lack a class."""
    if not building.schema:
        return ()
    from bimnav.ifc._lint import lint

    found = {finding: None for schema in building.schema.split(", ") for finding in lint(rule.filter, schema)}
    return tuple(
        Issue("filter", f"{told(rule)}: {_told(rule.filter, f)}", (), "info" if f.severity == "info" else "warning")
        for f in found
        if f.schema
    )


def _filters(toml: Toml) -> Iterator[tuple[Key, str]]:
    """Yield every filter that is a text, wherever else something may be wrong."""
    tables = toml.document.get("tasks")
    for name, table in tables.items() if isinstance(tables, dict) else ():
        for kind in RULE_LISTS:
            rules = table.get(kind) if isinstance(table, dict) else None
            for k, rule in enumerate(rules if isinstance(rules, list) else ()):
                query = rule.get("filter") if isinstance(rule, dict) else None
                if isinstance(query, str) and query.strip():
                    yield ("tasks", name, kind, k, "filter"), query


def _told(query: str, finding: Finding) -> str:
    where = f" (column {finding.column})" if finding.column else ""
    return f"filter {query!r} {finding.message}{where}. {finding.hint}".strip()


def _dotted(key: Key) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")
