"""What is wrong with a filter, told before it is evaluated: the selector picks nothing without a word."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import lark
from ifcopenshell.util.selector import filter_elements_grammar

from bimnav.ifc._classes import attributes, entities_of, is_void, nearest, products, products_of, taken_for
from bimnav.ifc._prescan import SCHEMAS

__all__ = ["Finding", "lint", "parse"]


class Finding(NamedTuple):
    """Something about a filter.

    Parameters
    ----------
    severity
        `error`: it cannot be evaluated, or picks nothing for certain. `warning`: it may pick something
        else than is meant. `info`: worth knowing.
    message
        Goes on after the words of the filter.
    schema
        The schema it holds for; empty if for all.
    """

    severity: Literal["error", "warning", "info"]
    message: str
    hint: str = ""
    column: int | None = None
    schema: str = ""


@lru_cache
def parse(query: str) -> Any:
    """Return the tree of a query.

    Raises
    ------
    lark.exceptions.UnexpectedInput
        If it cannot be parsed.
    """
    return filter_elements_grammar.parse(query)


@lru_cache
def lint(query: str, schema: str = "") -> tuple[Finding, ...]:
    """Return what there is to say of a query, by column; for one schema, if one is given, else for any."""
    try:
        tree = parse(query)
    except lark.exceptions.UnexpectedInput as error:
        column = error.column if error.column > 0 else len(query) + 1
        hint = "A filter is a list of facets with one comma between, such as IfcDoor, Name=/D.*/."
        return (Finding("error", "cannot be parsed", hint, column),)
    found = [*_unquoted(tree), *_misnamed(tree), *_irregular(tree), *_disordered(tree), *_unknown(tree)]
    if schema:
        found += _elsewhere(tree, schema)
    return tuple(sorted(found, key=lambda finding: finding.column or 0))


def _unquoted(tree: Any) -> Iterator[Finding]:
    for facet in tree.find_data("property"):
        kind, *_ = facet.children[0].children
        if kind.data == "unquoted_string" and kind.children[0].startswith("query:"):
            token = kind.children[0]
            hint = f'Put all its keys in quotes: query:"{token.removeprefix("query:")}..."=...'
            yield Finding("error", "asks query: without quotes", hint, token.column)


def _misnamed(tree: Any) -> Iterator[Finding]:
    for facet in tree.find_data("attribute_name"):
        token = facet.children[0]
        if token not in attributes():
            yield Finding("error", f"names an unknown attribute {token}", nearest(token, attributes()), token.column)


def _irregular(tree: Any) -> Iterator[Finding]:
    for value in tree.find_data("regex_string"):
        token = value.children[0]
        try:
            re.compile(token)
        except re.error as error:
            told = f"cannot be evaluated: /{token}/ is no regular expression: {error}"
            yield Finding("error", told, "Check its regular expressions and values.", token.column)


def _disordered(tree: Any) -> Iterator[Finding]:
    """Tell of classes behind another facet: they are added to what it kept, and it does not hold for them."""
    for group in tree.find_data("facet_list"):
        kinds = [facet.children[0] for facet in group.children]
        narrowing = False
        for kind in kinds:
            adds = kind.data in ("entity", "instance") and kind.children[0].data != "not"
            if adds and narrowing:
                token = next(kind.scan_values(lambda _: True))
                hint = "Name all classes first; what narrows them comes behind."
                yield Finding("warning", f"adds all of {token} to what the facets before it kept", hint, token.column)
            narrowing |= not adds


def _unknown(tree: Any) -> Iterator[Finding]:
    for token in _classes_in(tree):
        name = str(token)
        if name not in products():
            if any(name in entities_of(schema) for schema in SCHEMAS):
                hint = "A filter picks elements and rooms: name their classes, such as IfcDoor."
                yield Finding("error", f"names {name}, which is no class of products", hint, token.column)
            else:
                hint = nearest(name, products())
                yield Finding("error", f"names an unknown class {name}", hint, token.column)
        elif is_void(name):
            hint = "Name what fills them, such as IfcDoor, or what they cut."
            yield Finding("warning", f"names {name}, and voids are no part of any answer", hint, token.column)


def _elsewhere(tree: Any, schema: str) -> Iterator[Finding]:
    """Tell of classes that a schema lacks, and what they are taken for there."""
    tokens = [token for token in _classes_in(tree) if token in products()]
    for token in tokens:
        if token in products_of(schema):
            continue
        name, by_type = taken_for(token, schema)
        if by_type:
            told = f"names {token}, which {schema} does not have; what has an {name} is taken for it"
            yield Finding("info", told, "", token.column, schema)
        elif name:
            told = f"names {token}, which {schema} does not have; {name} is taken for it"
            yield Finding("info", told, "", token.column, schema)
        elif len(tokens) > 1:
            told = f"names {token}, which {schema} does not have, and goes on without it"
            yield Finding("warning", told, "", token.column, schema)
        else:
            hint = "No element of this model can have it; name another class too, or match names."
            yield Finding("error", f"names {token}, which {schema} does not have", hint, token.column, schema)


def _classes_in(tree: Any) -> list[Any]:
    return [facet.children[0] for facet in tree.find_data("ifc_class")]
