"""Values that say nothing: exporters write them where nobody wrote anything."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["is_placeholder"]

_NOTHING = re.compile(
    r"n/?a|none|null|undefined|not ?defined|unknown|varies|default|tb[dc]|todo|x{2,}|\?+|_[A-Z -]+_|dd/mm/yyyy"
    r"|1900-12-31(t[\d:]+)?|unbekannt|undefiniert|<default>|-+|sample( \w+)*|lorem ipsum.*|enter \w+ here.*"
    r"|project (name|number|status|address|issue date)|building name|(nombre|estado) de proyecto|introduzca .*",
    re.IGNORECASE | re.DOTALL,
)


def is_placeholder(name: str, value: Any) -> bool:
    """Tell whether the value of a property is but the property's own name, or a word for nothing.

    >>> is_placeholder("SerialNumber", "Serial Number"), is_placeholder("SerialNumber", "GH468642")
    (True, False)
    """
    if not isinstance(value, str):
        return False
    return _NOTHING.fullmatch(value.strip()) is not None or _bare(value) == _bare(name or "")


def _bare(text: str) -> str:
    return text.replace(" ", "").casefold()
