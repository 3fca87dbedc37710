"""Codes of classification systems, whichever way they are written."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from bimnav._placeholders import is_placeholder
from bimnav.building import Classification, Facts

__all__ = ["classifications_of", "is_below", "system_of"]

_SYSTEMS = {  # a system to what its names hold, without case and signs
    "omniclass": ("omniclass", "occs"),
    "uniclass": ("uniclass",),
    "uniformat": ("uniformat",),
    "nlsfb": ("nlsfb", "sfb"),
    "din276": ("din276",),
    "din277": ("din277",),
    "masterformat": ("masterformat",),
    "ebkp": ("ebkp",),
    "cci": ("cci",),
    "archicad": ("archicad",),
}
_FORMS = (  # how codes look that come without the name of their system
    (re.compile(r"\d\d-\d\d( \d\d)*\b|\d\d\.\d\d\.\d\d(\.\d\d)*\b"), "omniclass"),
    (re.compile(r"[A-Z][a-z](_\d\d)+\b"), "uniclass"),
    (re.compile(r"[A-G]\d{4}(\d{2,3})?\b"), "uniformat"),
    (re.compile(r"\d\d\.\d\d?\b(?!\.)"), "nlsfb"),
)
_IN_PROPERTIES = (  # names of properties that hold codes, the system, and the name of the one that holds the title
    (re.compile(r"omniclass (number|table \d+ category)|omniclass ?\d*value", re.IGNORECASE), "OmniClass", "Number"),
    (re.compile(r"assembly code", re.IGNORECASE), "Uniformat", "Code"),
    (re.compile(r"uniclass.*", re.IGNORECASE), "Uniclass", ""),
    (re.compile(r"classification ?code", re.IGNORECASE), "", "Code"),
)
_TITLES = {"Number": ("Title",), "Code": ("Description",)}
_SIGNS = re.compile(r"[\W_]+")


def _bare(text: str) -> str:
    """Return letters and digits alone, without case.

    >>> _bare("23-40 20.14: Tables")
    '23402014tables'
    """
    return _SIGNS.sub("", text).casefold()


def system_of(classification: Classification) -> str:
    """Return which system a code belongs to, as its name says or else as it looks; empty if neither tells.

    >>> system_of(Classification("", "23-40 20 14 17 24: Coffee Tables"))
    'omniclass'
    """
    name = _bare(classification.system)
    for known, words in _SYSTEMS.items():
        if any(word in name for word in words):
            return known
    if name:
        return name
    return next((known for form, known in _FORMS if form.match(classification.code)), "")


def classifications_of(facts: Facts) -> Iterator[tuple[Classification, str]]:
    """Yield what a product is classified as, and where it says so: references first, then properties."""
    for classification in facts.classifications:
        yield classification, "reference"
    for sets in (facts.properties, facts.type_properties):
        for set_name, properties in sets.items():
            for name, value in properties.items():
                yield from _in_property(set_name, name, value, properties)


def _in_property(
    set_name: str, name: str, value: Any, others: Mapping[str, Any]
) -> Iterator[tuple[Classification, str]]:
    if not isinstance(value, str) or not value.strip() or is_placeholder(name, value):
        return
    for named, system, last in _IN_PROPERTIES:
        if named.fullmatch(name.strip()):
            titles = (str(others.get(name.replace(last, title), "") or "") for title in _TITLES.get(last, ()))
            title = next(filter(None, titles), "")
            yield Classification(system, value.strip(), title), f"{set_name}.{name}"


def is_below(classification: Classification, sought: str) -> bool:
    """Tell whether a code lies in a part of a system, or a title has its words.

    Parameters
    ----------
    sought
        The beginning of a code, such as `23.40.20`; `OmniClass: 23.40.20` asks for the system, too. Without
        any digit it is a whole code, or words of the title. Case, spaces, dots and dashes do not count.

    Examples
    --------
    >>> is_below(Classification("", "23-40 20 14 17 24: Coffee Tables"), "OmniClass: 23.40.20")
    True
    >>> is_below(Classification("Uniformat", "D5020220", "Lighting"), "OmniClass: 23")
    False
    """
    system, parted, code = sought.partition(":")
    if not parted:
        code = sought
    elif system_of(Classification(system, "")) != system_of(classification):
        return False
    prefix = _bare(code)
    written = _bare(classification.code) or _bare(classification.title)
    if any(sign.isdigit() for sign in prefix):
        return written.startswith(prefix)
    return written == prefix or _has_words(classification, code)


def _has_words(classification: Classification, words: str) -> bool:
    def parted(text: str) -> str:
        return f" {_SIGNS.sub(' ', text).casefold().strip()} "

    return any(parted(words) in parted(text) for text in (classification.title, classification.code))
