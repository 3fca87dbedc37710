"""Whole words in the names that exporters write, in any script."""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache

__all__ = ["folded", "haystack", "needle", "tokens"]

_TOKEN = re.compile(r"[^\W\d_]+|\d+")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_UNPARTED = re.compile(r"[\u0e00-\u0eff\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af\uf900-\ufaff\U00020000-\U0003ffff]")
_ACCENTS = re.compile(r"[\u0300-\u036f]")  # not the voicing marks of kana: they make other letters


def folded(text: str) -> str:
    """Return a text without case and accents.

    >>> folded("Straßenmüll")
    'strassenmull'
    """
    return unicodedata.normalize("NFC", _ACCENTS.sub("", unicodedata.normalize("NFKD", text).casefold()))


def tokens(text: str) -> str:
    """Return the words and numbers of a text, folded, with one space between them.

    >>> tokens("Banana_Peel:Ø12-Typ A")
    'banana peel ø 12 typ a'
    """
    return " ".join(_TOKEN.findall(folded(text)))


@lru_cache(maxsize=1 << 14)
def haystack(text: str) -> str:
    """Return what needles are sought in: the words as written, and with `BananaPeel` taken apart."""
    return f" {tokens(text)} \n {tokens(_CAMEL.sub(' ', text))} "


def needle(word: str) -> str:
    """Return what to seek in a haystack: whole words, or any part where a script does not part words.

    A star in front finds the ends of words, and one behind their beginnings.

    >>> needle("*ventil") in haystack("Absperrventil DN20"), needle("*ventil") in haystack("Ventilator")
    (True, False)
    """
    if _UNPARTED.search(word):
        return tokens(word)
    word = word.strip()
    return f"{'' if word.startswith('*') else ' '}{tokens(word)}{'' if word.endswith('*') else ' '}"
