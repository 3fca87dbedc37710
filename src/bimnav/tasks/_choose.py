"""Which rule decides where several pick one element."""

from __future__ import annotations

from typing import Any, NamedTuple

from bimnav.building import Building
from bimnav.tasks._match import Product, match
from bimnav.tasks._task import Rule, Task

__all__ = ["Choice", "Overruled", "choose"]

_SAYS = {  # what a rule of each list says beside that it picks an element
    "targets": ("label", "destination", "service_time", "priority", "due", "abilities"),
    "avoid": ("factor",),
    "doors": ("state", "opening_time"),
}


class Choice(NamedTuple):
    """An element or room, the rule that decides about it, and why in words."""

    element: Product
    rule: Rule
    why: str


class Overruled(NamedTuple):
    """A rule that does not decide, though it picks an element and says something else.

    Parameters
    ----------
    global_id
        Of the element.
    rule
        What would have held, in words.
    by
        What holds instead.
    """

    global_id: str
    rule: str
    by: str


def choose(task: Task, kind: str, building: Building) -> tuple[dict[str, Choice], list[Overruled]]:
    """Return what the rules of one list pick, by GlobalId, and the rules that others go before.

    Of several rules that pick an element, the first in the list decides.

    Parameters
    ----------
    kind
        Name of the list, such as `targets`.
    """
    chosen: dict[str, Choice] = {}
    overruled = []
    for rule in getattr(task, kind):
        for product, why in match(rule, building):
            first = chosen.setdefault(product.global_id, Choice(product, rule, why))
            if _said(rule, kind) != _said(first.rule, kind):
                overruled.append(Overruled(product.global_id, why, first.why))
    return chosen, overruled


def _said(rule: Rule, kind: str) -> tuple[Any, ...]:
    return tuple(getattr(rule, name) for name in _SAYS.get(kind, ()))
