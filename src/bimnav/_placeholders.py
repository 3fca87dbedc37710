"""Values that say nothing: exporters write them where nobody wrote anything."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["is_placeholder", "names_nothing"]

_TOLD = """
    na none null nil nan tbd tba tbc todo unknown undefined notdefined unset default varies various notapplicable
    notavailable notspecified nodata noinfo xx xxxx ddmmyyyy yyyymmdd mmddyyyy 19001231 19001231t235959 19000101
    19000101t000000 00010101 00010101t000000 18991230 18991230t000000 unbekannt keineangabe nichtdefiniert undefiniert
    onbekend nvt inconnu sansobjet indefini indéfini desconocido nodefinido sconosciuto nondefinito неизвестно
    неопределено 不明 未定 未知 暂无
"""
_WORDS = frozenset(_TOLD.split())
_KINDS = """
    project projekt projet proyecto progetto projeto проект building gebäude gebaude bauwerk bâtiment batiment edificio
    edifício gebouw здание untitled unnamed noname ohnetitel unbenannt sanstitre sintitulo model modell
"""
_KIND = re.compile(rf"(my|new|mein|neues?)?({'|'.join(_KINDS.split())})(name|number|nummer|\d*)")
_PHRASES = re.compile(
    r"x{2,}|1900-12-31(t[\d:]+)?|_[A-Z -]+_|sample( \w+)*|lorem ipsum.*|enter \w+ here.*"
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
    bare = _bare(value)
    if not bare:
        return bool(value.strip())  # signs alone, such as a dash
    return bare in _WORDS or bare == _bare(name or "") or _PHRASES.fullmatch(value.strip()) is not None


def names_nothing(name: str) -> bool:
    """Tell whether a name of a project or a building is what the program wrote, or but a number.

    >>> [names_nothing(name) for name in ("Project Number", "My Project", "Building 2", "0001", "Town Hall")]
    [True, True, True, True, False]
    """
    bare = _bare(name)
    return bare.isdigit() or not bare or _KIND.fullmatch(bare) is not None or is_placeholder("Name", name)


def _bare(text: str) -> str:
    """Return letters and digits only, without case."""
    return "".join(char for char in text.casefold() if char.isalnum())
