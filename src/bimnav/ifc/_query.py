"""The selector language is IfcOpenShell's, with its silences broken.

A class or attribute that does not exist, or a `query:` without quotes, picks nothing there without a word;
here it is an error. Types and voids, which it picks as well, are no part of any answer.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn

import lark
from ifcopenshell.util.element import get_psets, get_type
from ifcopenshell.util.selector import FacetTransformer

from bimnav.errors import SelectorError
from bimnav.ifc._classes import is_a, taken_for
from bimnav.ifc._lint import lint, parse

__all__ = ["checked", "evaluate", "of_classes", "plain", "properties_of"]

_LOG = logging.getLogger(__name__)
_LEVELS = {"info": logging.INFO, "warning": logging.WARNING}
_type_of: Any = get_type


def evaluate(file: Any, ids: Mapping[int, str], query: str) -> tuple[str, ...]:
    """Return the GlobalIds of what a query picks among the products in `ids`, step id to GlobalId.

    Raises
    ------
    SelectorError
        If the query cannot be parsed or evaluated, or names what does not exist.
    """
    tree = checked(query, file.schema_identifier)
    facets = _Facets(file, ids)
    try:
        facets.transform(tree)
    except lark.exceptions.VisitError as error:
        _refuse(query, f"cannot be evaluated: {error.orig_exc}", "Check its regular expressions and values.")
    chosen = {entity.id() for entity in facets.get_results()}
    return tuple(global_id for step_id, global_id in ids.items() if step_id in chosen)


def checked(query: str, schema: str) -> Any:
    """Return the tree of a query that is fit for a schema.

    Raises
    ------
    SelectorError
        If it cannot be parsed, or names what does not exist.
    """
    for finding in lint(query, schema):
        if finding.severity == "error":
            context = {"schema": finding.schema} if finding.schema else {}
            _refuse(query, finding.message, finding.hint, finding.column, **context)
        if finding.schema:
            _LOG.log(_LEVELS[finding.severity], "filter %r %s", query, finding.message)
    return parse(query)


def of_classes(tree: Any, classes: Mapping[str, tuple[str, str]], schema: str) -> tuple[str, ...] | None:
    """Answer a query that asks for classes alone; None if it asks for anything else.

    Parameters
    ----------
    classes
        GlobalIds of all products to their classes and those of their types.
    """
    chosen: set[str] = set()
    for group in tree.find_data("facet_list"):
        part: set[str] | None = None
        for facet in group.children:
            if facet.children[0].data != "entity":
                return None
            *signs, name = facet.children[0].children
            wanted, by_type = taken_for(str(name.children[0]), schema)
            found = {g for g, known in classes.items() if wanted and is_a(known[by_type], wanted, schema)}
            part = (set(classes) if part is None else part) - found if signs else (part or set()) | found
        chosen |= part or set()
    return tuple(global_id for global_id in classes if global_id in chosen)


def properties_of(entity: Any) -> dict[str, dict[str, Any]]:
    """Return the property sets of a product, those of its type included, as plain values."""
    sets: dict[str, dict[str, Any]] = plain(get_psets(entity))
    return sets


class _Facets(FacetTransformer):
    """The evaluation of a query on known products only: no types, no voids."""

    def __init__(self, file: Any, ids: Mapping[int, str]) -> None:
        super().__init__(file)
        self._products = {global_id: file.by_id(step_id) for step_id, global_id in ids.items()}

    def add_default_elements(self) -> None:
        if not self.has_additive_facet_in_current_list:
            self.has_additive_facet_in_current_list = True
            self.elements.update(self._products.values())

    def entity(self, args: list[Any]) -> None:
        self._take(args, self._of_class(args[-1].children[0]))

    def instance(self, args: list[Any]) -> None:
        product = self._products.get(args[-1].children[0].value)
        self._take(args, [] if product is None else [product])

    def _take(self, args: list[Any], found: Iterable[Any]) -> None:
        if args[0].data == "not":
            self.add_default_elements()  # `! IfcWall` alone is everything but walls
            self.elements.difference_update(found)
        else:
            self.has_additive_facet_in_current_list = True
            self.elements.update(found)

    def _of_class(self, token: Any) -> list[Any]:
        name, by_type = taken_for(str(token), self.file.schema_identifier)
        if not by_type:
            return list(self.file.by_type(name)) if name else []
        kinds = ((product, _type_of(product)) for product in self._products.values())
        return [product for product, kind in kinds if kind is not None and kind.is_a(name)]


def _refuse(query: str, what: str, hint: str, column: int | None = None, **context: str) -> NoReturn:
    where = f" (column {column})" if column else ""
    raise SelectorError(f"filter {query!r} {what}{where}.", hint, {"query": query, "column": column, **context})


def plain(value: Any) -> Any:
    """Return properties as plain values, without the step ids that the kernel adds to every set."""
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items() if key != "id"}
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)
