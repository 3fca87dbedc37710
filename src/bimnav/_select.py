"""A small part of the selector language, for buildings written by hand."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NoReturn

from bimnav.errors import SelectorError

if TYPE_CHECKING:
    from bimnav.building import Element, Space

__all__ = ["select_by_hand"]

_FIELDS = {
    "Name": "name",
    "LongName": "long_name",
    "ObjectType": "object_type",
    "PredefinedType": "predefined_type",
    "Tag": "tag",
    "type": "type_name",
}
_EVERYTHING = ("IfcProduct", "IfcObject", "IfcObjectDefinition", "IfcRoot")
_FACET = re.compile(
    r"""\s* (?: (?P<sign>!?) \s* (?P<class>Ifc\w+)
              | (?P<field>\w+) \s* (?P<no>!?) (?P<part>\*?) = \s*
                (?: "(?P<quoted>(?:[^"\\]|\\.)*)" | /(?P<regex>[^/]+)/ | (?P<plain>[^\s,.=<>*!+"/]+) )
        ) \s* (?P<end>[,+]|\Z)""",
    re.VERBOSE,
)
_SUPPORTED = (
    f"A building written by hand knows classes (exact ones, IfcElement, IfcProduct), ! class, {', '.join(_FIELDS)} "
    'with = != *= and a word, "text" or /regex/, joined by commas, and + between whole filters.'
)


def select_by_hand(products: Iterable[Element | Space], query: str) -> tuple[str, ...]:
    """Return the GlobalIds of the products a query picks.

    A class adds what has it, `! class` removes it, and an attribute keeps what fits, from left to right; a
    filter without a class begins with everything. Subclasses are unknown here: `IfcWall` is no
    `IfcWallStandardCase`.

    Raises
    ------
    SelectorError
        If the query holds anything else; the message lists what is known.

    Examples
    --------
    >>> from bimnav.building import Element
    >>> chairs = [Element("a", "IfcFurniture", "Chair"), Element("b", "IfcFurniture", "Table")]
    >>> select_by_hand(chairs, "IfcFurniture, Name=/Ch.*/")
    ('a',)
    """
    known = tuple(products)
    chosen: set[str] = set()
    part: Sequence[Element | Space] | None = None
    position, more = 0, True
    while more:
        facet = _FACET.match(query, position)
        if facet is None:
            _refuse(query, position)
        if facet["class"]:
            fits = _of_class(facet["class"])
            if facet["sign"]:
                part = [product for product in (known if part is None else part) if not fits(product)]
            else:
                part = [*(part or ()), *filter(fits, known)]
        elif facet["field"] in _FIELDS:
            part = list(filter(_with_value(facet), known if part is None else part))
        else:
            _refuse(query, facet.start("field"))
        position, more = facet.end(), facet["end"] != ""
        if facet["end"] != ",":
            chosen.update(product.global_id for product in part)
            part = None
    return tuple(product.global_id for product in known if product.global_id in chosen)


def _of_class(name: str) -> Callable[[Element | Space], bool]:
    if name in _EVERYTHING:
        return lambda _: True
    if name == "IfcElement":
        return lambda product: product.ifc_class != "IfcSpace"
    return lambda product: product.ifc_class == name


def _with_value(facet: re.Match[str]) -> Callable[[Element | Space], bool]:
    field, negated = _FIELDS[facet["field"]], bool(facet["no"])
    if facet["regex"] is not None:
        try:
            pattern = re.compile(facet["regex"])
        except re.error as error:
            raise SelectorError(
                f"filter {facet.string!r}: /{facet['regex']}/ is no regular expression: {error}.",
                "Mend it.",
                {"query": facet.string, "column": facet.start("regex") + 1},
            ) from error
        return lambda product: (pattern.match(getattr(product, field, "")) is not None) != negated
    quoted = facet["quoted"]
    sought = quoted.replace('\\"', '"') if quoted is not None else "" if facet["plain"] == "NULL" else facet["plain"]
    if facet["part"]:
        return lambda product: (sought in getattr(product, field, "")) != negated
    return lambda product: (getattr(product, field, "") == sought) != negated


def _refuse(query: str, position: int) -> NoReturn:
    column = position + 1
    raise SelectorError(
        f"filter {query!r} cannot be understood at column {column}.", _SUPPORTED, {"query": query, "column": column}
    )
