"""What each rule of a task picks in one building, and what is to be said of it."""

from __future__ import annotations

from typing import Any, NamedTuple

from bimnav.building import Building, Issue
from bimnav.errors import SelectorError, TaskError
from bimnav.tasks._lint import lint_rule
from bimnav.tasks._match import Match, filtered, find, told
from bimnav.tasks._task import RULE_LISTS, Rule, Task

__all__ = ["RuleCheck", "check_rules"]

_EXAMPLES = 3


class RuleCheck(NamedTuple):
    """One rule in one building.

    Parameters
    ----------
    kind
        The list it stands in, such as `targets`.
    filtered
        How many elements and rooms its filter alone picks.
    found
        What it picks.
    notes
        What is to be said of it; an `error` keeps the task from being used in this building.
    """

    kind: str
    rule: Rule
    filtered: int
    found: tuple[Match, ...]
    notes: tuple[Issue, ...]

    def to_dict(self, *, whole: bool = False) -> dict[str, Any]:
        """Return plain values, with some examples of what it picks, or with all of it."""
        return {
            "kind": self.kind,
            "label": self.rule.label,
            "source": self.rule.source,
            "filter": self.rule.filter,
            "filtered": self.filtered,
            "found": len(self.found),
            "expect": self.rule.expect,
            "elements" if whole else "examples": [
                {
                    "global_id": product.global_id,
                    "ifc_class": product.ifc_class,
                    "name": product.name,
                    "why": why,
                }
                for product, why in (self.found if whole else self.found[:_EXAMPLES])
            ],
            "notes": [{"severity": n.severity, "message": n.message, "hint": n.hint} for n in self.notes],
        }


def check_rules(task: Task, building: Building) -> tuple[RuleCheck, ...]:
    """Return what each rule of a task picks in a building, in the order of its lists."""
    return tuple(_check(kind, rule, building) for kind in RULE_LISTS for rule in getattr(task, kind))


def _check(kind: str, rule: Rule, building: Building) -> RuleCheck:
    notes = lint_rule(rule, building)
    try:
        alone, found = len(filtered(rule, building)), find(rule, building)
    except (SelectorError, TaskError) as error:
        return RuleCheck(kind, rule, 0, (), (*notes, Issue("rule", error.message, (), "error", error.hint)))
    hint = f"Its filter {rule.filter!r} alone picks {alone}."
    if not rule.is_met(len(found)):
        what = f"{told(rule)} finds {len(found)} and expects {rule.expect}."
        notes += (Issue("expect", what, (), "error", hint),)
    elif not found:
        notes += (Issue("empty-rule", f"{told(rule)} picks nothing.", (), "warning", hint),)
    return RuleCheck(kind, rule, alone, found, notes)
