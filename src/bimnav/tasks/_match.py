"""What a rule picks in a building, and why."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from bimnav._classification import classifications_of, is_below
from bimnav.building import Building, Element, Facts, Space
from bimnav.errors import ModelError, SelectorError, TaskError
from bimnav.tasks._conditions import parse_condition
from bimnav.tasks._task import RULE_LISTS, Rule, Task
from bimnav.tasks._words import folded, haystack, needle

__all__ = ["Match", "filtered", "find", "match", "rules_for", "told"]

Product: TypeAlias = Element | Space
Test: TypeAlias = Callable[[Product], "str | None"]  # None: fails; else why it holds, or nothing to say

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
    found = find(rule, building)
    if not rule.is_met(len(found)):
        raise TaskError(
            f"{told(rule)} finds {len(found)} in {building.name!r} and expects {rule.expect}.",
            f"Its filter {rule.filter!r} alone picks {len(filtered(rule, building))}.",
            {"rule": rule.label, "source": rule.source, "found": len(found), "expect": rule.expect},
        )
    return found


def find(rule: Rule, building: Building) -> tuple[Match, ...]:
    """Return what a rule picks, however many it expects."""
    tests = [make(rule, building) for make in _TESTS]
    found = []
    for product in filtered(rule, building):
        reasons = _reasons(product, tests)
        if reasons is not None:
            found.append(Match(product, f"{told(rule)}: {_joined(reasons, product, rule)}"))
    return tuple(found)


def rules_for(task: Task, product: Product, building: Building) -> Iterator[tuple[str, Rule, str]]:
    """Yield every rule of a task that picks a product: the list it stands in, the rule, and what makes it."""
    for kind in RULE_LISTS:
        for rule in getattr(task, kind):
            if product in filtered(rule, building):
                reasons = _reasons(product, [make(rule, building) for make in _TESTS])
                if reasons is not None:
                    yield kind, rule, _joined(reasons, product, rule)


def _joined(reasons: Iterable[str], product: Product, rule: Rule) -> str:
    return ", ".join(filter(None, reasons)) or f"{product.ifc_class} passes the filter {rule.filter!r}"


def _reasons(product: Product, tests: Iterable[Test]) -> list[str] | None:
    """Return what each test has to say for a product, or None if one fails."""
    reasons = []
    for test in tests:
        reason = test(product)
        if reason is None:
            return None
        reasons.append(reason)
    return reasons


def filtered(rule: Rule, building: Building) -> tuple[Product, ...]:
    """Return what the filter of a rule picks by itself.

    Raises
    ------
    SelectorError
        If it cannot be evaluated.
    """
    known = _picked.setdefault(building, {})
    if rule.filter not in known:
        try:
            known[rule.filter] = building.select(rule.filter)
        except SelectorError as error:
            if error.context.get("schema"):  # no product of this building can be of that class
                known[rule.filter] = ()
                return ()
            raise SelectorError(f"{told(rule)}: {error.message}", error.hint, error.context) from error
    return known[rule.filter]


def told(rule: Rule) -> str:
    """Return how messages call a rule."""
    label = f"rule {rule.label!r}" if rule.label else f"rule {rule.filter!r}"
    return f"{label} ({rule.source})" if rule.source else label


def _names(product: Product) -> Iterator[tuple[str, str]]:
    yield ("room name" if isinstance(product, Space) else "family"), product.family
    yield "type name", product.type_name
    yield "object type", product.object_type
    yield "name", product.name


def _by_name(rule: Rule, _: Building) -> Test:
    """Test for words in the names of a product, and for excluded ones."""
    words = [(word, needle(word)) for word in rule.words]
    excluded = [needle(word) for word in rule.exclude_words]

    def test(product: Product) -> str | None:
        names = [(field, name, haystack(name)) for field, name in _names(product) if name]
        if any(sought in text for _field, _name, text in names for sought in excluded):
            return None
        if not words:
            return ""
        hits = (f"{field} {name!r} {_hit(text, words)}" for field, name, text in names if _hit(text, words))
        return next(hits, None)

    return test


def _hit(text: str, words: list[tuple[str, str]]) -> str:
    return next((f"has the word {word!r}" for word, sought in words if sought in text), "")


def _by_place(rule: Rule, building: Building) -> Test:
    """Test whether a product stands where the rule wants it."""
    storeys = {_storey(name, rule, building) for name in rule.storeys}
    spaces = [space for name in rule.spaces for space in _spaces(name, rule, building)]

    def test(product: Product) -> str | None:
        if storeys and _standing_on(product, building) not in storeys:
            return None
        if spaces and _room_of(product, spaces) is None:
            return None
        return ""

    return test


def _by_use(rule: Rule, building: Building) -> Test:
    """Test whether a product is, or lies in, a room with one of the words in its names."""
    words = [(word, needle(word)) for word in rule.use]
    hits = {space.global_id: _use_of(space, words) for space in building.spaces} if words else {}
    spaces = [space for space in building.spaces if hits.get(space.global_id)]

    def test(product: Product) -> str | None:
        if not words:
            return ""
        room = _room_of(product, spaces)
        return None if room is None else f"room {room.label!r} {hits[room.global_id]}"

    return test


def _use_of(space: Space, words: list[tuple[str, str]]) -> str:
    return next((hit for _, name in _names(space) if name and (hit := _hit(haystack(name), words))), "")


def _by_facts(rule: Rule, building: Building) -> Test:
    """Test classification, properties and systems; what the rule does not ask for is not read."""
    conditions = [parse_condition(text) for text in rule.properties]
    systems = [(word, needle(word)) for word in rule.systems]
    asks = bool(conditions or systems or rule.classification or rule.exclude_classification)

    def test(product: Product) -> str | None:
        if not asks:
            return ""
        facts = building.facts(product.global_id)
        if _classified(facts, rule.exclude_classification):
            return None
        reasons = [condition.met_by(facts) for condition in conditions]
        if rule.classification:
            reasons.append(_classified(facts, rule.classification))
        if systems:
            reasons.append(next((f"system {n!r} {h}" for n in facts.systems if (h := _hit(haystack(n), systems))), ""))
        return ", ".join(reasons) if all(reasons) else None

    return test


def _by_door(rule: Rule, building: Building) -> Test:
    """Test whether a door leads outside: what the model says goes before what geometry tells."""
    doors = {door.global_id: door for door in building.doors} if rule.leads_outside else {}
    said = [parse_condition(text) for text in ("*.FireExit = true", "*.IsExternal = true")]
    denied = parse_condition("*.IsExternal = false")

    def test(product: Product) -> str | None:
        if not rule.leads_outside:
            return ""
        door = doors.get(product.global_id)
        if door is None or len(set(door.spaces)) > 1:
            return None
        facts = building.facts(product.global_id)
        told = next(filter(None, (condition.met_by(facts) for condition in said)), "")
        if told or denied.met_by(facts):
            return told or None
        return "a room lies at one side of it only, near the ground" if door.to_outside else None

    return test


def _classified(facts: Facts, wanted: Iterable[str]) -> str:
    for classification, place in classifications_of(facts):
        for sought in wanted:
            if is_below(classification, sought):
                told = " ".join(filter(None, (classification.system, classification.code, classification.title)))
                return f"{place} {told!r} is in {sought!r}"
    return ""


_TESTS = (_by_name, _by_place, _by_use, _by_door, _by_facts)  # cheapest first


def _room_of(product: Product, spaces: Sequence[Space]) -> Space | None:
    """Return the first of some rooms that a product is, or that the file or the geometry puts it in."""
    placed = product.global_id if isinstance(product, Space) else product.space
    stated = next((space for space in spaces if space.global_id in (product.global_id, placed)), None)
    return stated or next((space for space in spaces if _holds(space, product)), None)


def _storey(name: str, rule: Rule, building: Building) -> str:
    try:
        return building.storeys[building.storey_index(name)].global_id
    except ModelError as error:
        raise TaskError(f"{told(rule)}: {error.message}", error.hint, error.context) from error


def _spaces(name: str, rule: Rule, building: Building) -> list[Space]:
    def names_of(space: Space) -> set[str]:
        return {folded(known) for known in (space.name, space.long_name, space.label) if known}

    spaces = [space for space in building.spaces if name == space.global_id or folded(name) in names_of(space)]
    if not spaces:
        known = [space.label for space in building.spaces]
        near = difflib.get_close_matches(name, known, 3) or known[:5]
        listed = ", ".join(map(repr, near))
        hint = f"Among its {len(known)} spaces are {listed}." if near else "It has no spaces at all."
        raise TaskError(f"{told(rule)}: {building.name!r} has no space {name!r}.", hint, {"space": name})
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
