"""What a rule picks in a building, and why."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from bimnav.building import Building, Element, Space
from bimnav.errors import ModelError, SelectorError, TaskError
from bimnav.tasks._task import Rule
from bimnav.tasks._words import folded, haystack, needle

__all__ = ["Match", "match"]

Product: TypeAlias = Element | Space

_SLACK = 0.35  # metres; finish floors and sunken placements lie this far from their storey's height

_picked: WeakKeyDictionary[Building, dict[str, tuple[Product, ...]]] = WeakKeyDictionary()


class Match(NamedTuple):
    """An element or room that a rule picked, and why in words."""

    element: Product
    why: str


def match(rule: Rule, building: Building) -> tuple[Match, ...]:
    """Return what a rule picks, in model order; each filter is asked once per building.

    Raises
    ------
    SelectorError
        If the filter cannot be evaluated.
    TaskError
        If a storey or space of the rule does not exist, or fewer or more are found than it expects.
    """
    words = [(word, needle(word)) for word in rule.words]
    excluded = [needle(word) for word in rule.exclude_words]
    is_placed = _placed(rule, building)
    found = []
    for product in _filtered(rule, building):
        why = _why(product, rule, words, excluded)
        if why and is_placed(product):
            found.append(Match(product, why))
    if not rule.is_met(len(found)):
        raise TaskError(
            f"{_told(rule)} finds {len(found)} in {building.name!r} and expects {rule.expect}.",
            f"Its filter {rule.filter!r} alone picks {len(_filtered(rule, building))}.",
            {"rule": rule.label, "source": rule.source, "found": len(found), "expect": rule.expect},
        )
    return tuple(found)


def _filtered(rule: Rule, building: Building) -> tuple[Product, ...]:
    known = _picked.setdefault(building, {})
    if rule.filter not in known:
        try:
            known[rule.filter] = building.select(rule.filter)
        except SelectorError as error:
            raise SelectorError(f"{_told(rule)}: {error.message}", error.hint, error.context) from error
    return known[rule.filter]


def _told(rule: Rule) -> str:
    label = f"rule {rule.label!r}" if rule.label else f"rule {rule.filter!r}"
    return f"{label} ({rule.source})" if rule.source else label


def _names(product: Product) -> Iterator[tuple[str, str]]:
    yield ("room name" if isinstance(product, Space) else "family"), product.family
    yield "type name", product.type_name
    yield "object type", product.object_type
    yield "name", product.name


def _why(product: Product, rule: Rule, words: list[tuple[str, str]], excluded: list[str]) -> str:
    """Say why a product that passed the filter is picked; empty if it is not."""
    names = [(field, name, haystack(name)) for field, name in _names(product) if name]
    hits = (
        f"{field} {name!r} has the word {word!r}"
        for field, name, text in names
        for word, sought in words
        if sought in text
    )
    hit = next(hits, "") if words else f"{product.ifc_class} passes the filter {rule.filter!r}"
    if not hit or any(sought in text for _, _, text in names for sought in excluded):
        return ""
    return f"{_told(rule)}: {hit}"


def _placed(rule: Rule, building: Building) -> Callable[[Product], bool]:
    """Return the test whether a product stands where the rule wants it."""
    storeys = {_storey(name, rule, building) for name in rule.storeys}
    spaces = [space for name in rule.spaces for space in _spaces(name, rule, building)]
    inside = {space.global_id for space in spaces}

    def is_placed(product: Product) -> bool:
        if storeys and _standing_on(product, building) not in storeys:
            return False
        if not spaces or product.global_id in inside or (isinstance(product, Element) and product.space in inside):
            return True
        return any(_holds(space, product) for space in spaces)

    return is_placed


def _storey(name: str, rule: Rule, building: Building) -> str:
    try:
        return building.storeys[building.storey_index(name)].global_id
    except ModelError as error:
        raise TaskError(f"{_told(rule)}: {error.message}", error.hint, error.context) from error


def _spaces(name: str, rule: Rule, building: Building) -> list[Space]:
    def names_of(space: Space) -> set[str]:
        return {folded(known) for known in (space.name, space.long_name, space.label) if known}

    spaces = [space for space in building.spaces if name == space.global_id or folded(name) in names_of(space)]
    if not spaces:
        known = [space.label for space in building.spaces]
        near = difflib.get_close_matches(name, known, 3) or known[:5]
        listed = ", ".join(map(repr, near))
        hint = f"Among its {len(known)} spaces are {listed}." if near else "It has no spaces at all."
        raise TaskError(f"{_told(rule)}: {building.name!r} has no space {name!r}.", hint, {"space": name})
    return spaces


def _standing_on(product: Product, building: Building) -> str | None:
    if product.bounds is None:
        return product.storey
    low = float(product.bounds[0, 2])
    under = [storey for storey in building.storeys if storey.elevation <= low + _SLACK]
    return (under or building.storeys)[-1 if under else 0].global_id


def _holds(space: Space, product: Product) -> bool:
    """Tell whether the middle of a product lies in a space: above its floor plan and within its height."""
    if space.bounds is None or product.bounds is None:
        return False
    middle = product.bounds.mean(axis=0)
    if not (space.bounds[0] - [0, 0, _SLACK] <= middle).all() or not (middle <= space.bounds[1]).all():
        return False
    for shape in space.shapes:
        corners = shape.world_vertices()[shape.mesh.faces][:, :, :2] - middle[:2]  # (m, 3, 2)
        following = np.roll(corners, -1, axis=1)
        turn = corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]
        is_flat = np.abs(turn.sum(axis=1)) < 1e-12  # a wall of the space, seen from above
        if (~is_flat & ((turn >= 0).all(axis=1) | (turn <= 0).all(axis=1))).any():
            return True
    return False
