"""The selector language is IfcOpenShell's, with its silences broken.

A class or attribute that does not exist, or a `query:` without quotes, picks nothing there without a word;
here it is an error. Types and voids, which it picks as well, are no part of any answer.
"""

from __future__ import annotations

import difflib
import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, NoReturn

import ifcopenshell
import lark
from ifcopenshell.util.element import get_psets, get_type
from ifcopenshell.util.selector import FacetTransformer, filter_elements_grammar

from bimnav.errors import SelectorError
from bimnav.ifc._prescan import SCHEMAS

__all__ = ["evaluate", "plain", "properties_of"]

_LOG = logging.getLogger(__name__)
_RENAMED = {  # a class to what holds its elements where the schema lacks it
    "IfcBuildingElement": ("IfcBuiltElement",),
    "IfcBuiltElement": ("IfcBuildingElement",),
    "IfcDistributionBoard": ("IfcElectricDistributionBoard", "IfcElectricDistributionPoint"),
    "IfcElectricDistributionBoard": ("IfcDistributionBoard", "IfcElectricDistributionPoint"),
    "IfcElectricDistributionPoint": ("IfcElectricDistributionBoard", "IfcDistributionBoard"),
    "IfcFurniture": ("IfcFurnishingElement",),
    "IfcSpatialElement": ("IfcSpatialStructureElement",),
    "IfcTransportationDevice": ("IfcTransportElement",),
}
_CLASS = re.compile(r"\bIfc\w+")
_CASE = re.compile(r"(Standard|Elemented)Case$")
_kernel: Any = ifcopenshell
_type_of: Any = get_type


def evaluate(file: Any, ids: Mapping[int, str], query: str) -> tuple[str, ...]:
    """Return the GlobalIds of what a query picks among the products in `ids`, step id to GlobalId.

    Raises
    ------
    SelectorError
        If the query cannot be parsed or evaluated, or names what does not exist.
    """
    try:
        tree = filter_elements_grammar.parse(query)
        _lint(tree, query)
        facets = _Facets(file, ids, query)
        facets.transform(tree)
    except lark.exceptions.UnexpectedInput as error:
        column = error.column if error.column > 0 else len(query) + 1
        hint = "A filter is a list of facets with one comma between, such as IfcDoor, Name=/D.*/."
        _refuse(query, "cannot be parsed", hint, column)
    except lark.exceptions.VisitError as error:
        if isinstance(error.orig_exc, SelectorError):
            raise error.orig_exc from None
        _refuse(query, f"cannot be evaluated: {error.orig_exc}", "Check its regular expressions and values.")
    chosen = {entity.id() for entity in facets.get_results()}
    return tuple(global_id for step_id, global_id in ids.items() if step_id in chosen)


def properties_of(entity: Any) -> dict[str, dict[str, Any]]:
    """Return the property sets of a product, those of its type included, as plain values."""
    sets: dict[str, dict[str, Any]] = plain(get_psets(entity))
    return sets


class _Facets(FacetTransformer):
    """The evaluation of a query on known products only: no types, no voids."""

    def __init__(self, file: Any, ids: Mapping[int, str], query: str) -> None:
        super().__init__(file)
        self._query = query
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
        name, schema = str(token), self.file.schema_identifier
        for known in (name, _CASE.sub("", name), *_RENAMED.get(name, ())):
            if known in _products_of(schema):
                if known != name:
                    _LOG.info("%s has no class %s; %s is taken for it", schema, name, known)
                return list(self.file.by_type(known))
        known_elsewhere = any(name in _products_of(other) for other in SCHEMAS)
        if known_elsewhere and f"{name}Type" in _entities_of(schema):  # IfcValve in IFC2X3: what has an IfcValveType
            kinds = ((product, _type_of(product)) for product in self._products.values())
            return [product for product, kind in kinds if kind is not None and kind.is_a(f"{name}Type")]
        if known_elsewhere and len(_CLASS.findall(self._query)) > 1:
            _LOG.warning("%s has no class %s; %r goes on without it", schema, name, self._query)
            return []
        if known_elsewhere:
            hint = "No element of this model can have it; name another class too, or match names."
            what = f"names {name}, which {schema} does not have"
            return _refuse(self._query, what, hint, token.column, schema=schema)
        if any(name in _entities_of(other) for other in SCHEMAS):
            hint = "A filter picks elements and rooms: name their classes, such as IfcDoor."
            return _refuse(self._query, f"names {name}, which is no class of products", hint, token.column)
        known_names = set().union(*map(_products_of, SCHEMAS))
        return _refuse(self._query, f"names an unknown class {name}", _nearest(name, known_names), token.column)


def _lint(tree: Any, query: str) -> None:
    """Refuse what would pick nothing without a word."""
    for facet in tree.find_data("property"):
        kind, *_ = facet.children[0].children
        if kind.data == "unquoted_string" and kind.children[0].startswith("query:"):
            token = kind.children[0]
            hint = f'Put all its keys in quotes: query:"{token.removeprefix("query:")}..."=...'
            _refuse(query, "asks query: without quotes", hint, token.column)
    known = set().union(*map(_attributes_of, SCHEMAS))
    for facet in tree.find_data("attribute_name"):
        token = facet.children[0]
        if token not in known:
            _refuse(query, f"names an unknown attribute {token}", _nearest(token, known), token.column)


@cache
def _declarations_of(schema: str) -> dict[str, Any]:
    declared = _kernel.schema_by_name(schema).declarations()
    return {declaration.name(): declaration for declaration in declared if declaration.as_entity()}


@cache
def _entities_of(schema: str) -> frozenset[str]:
    return frozenset(_declarations_of(schema))


@cache
def _products_of(schema: str) -> frozenset[str]:
    """Return the names of IfcProduct, of all its subtypes and of its supertypes."""
    lines = [list(_line_of(declaration)) for declaration in _declarations_of(schema).values()]
    return frozenset(name for line in lines if "IfcProduct" in line for name in line)


def _line_of(declaration: Any) -> Iterator[str]:
    while declaration:
        yield declaration.name()
        declaration = declaration.supertype()


@cache
def _attributes_of(schema: str) -> frozenset[str]:
    return frozenset(
        attribute.name()
        for name in _products_of(schema)
        for attribute in _declarations_of(schema)[name].all_attributes()
    ) | {"PredefinedType"}


def _nearest(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, sorted(known), n=1)
    return f"Did you mean {close[0]}?" if close else "Check its spelling."


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
