"""Sentences about one thing or many, and names that others gave."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

__all__ = ["counted", "meant", "nearest", "printable"]

_MOST = 50  # names listed in one sentence

_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")  # what breaks a line, a terminal or UTF-8
_EITHER = re.compile(r"\[([^][|]*)\|([^][|]*)\]")


def counted(message: str, number: int) -> str:
    """Put a number for `{n}` into a message, and of `[one|many]` the words that go with it.

    >>> counted("{n} [room has|rooms have] no door.", 1), counted("{n} [room has|rooms have] no door.", 2)
    ('1 room has no door.', '2 rooms have no door.')
    """
    return _EITHER.sub(r"\1" if number == 1 else r"\2", message).replace("{n}", str(number))


def printable(name: str) -> str:
    r"""Return a name with its line ends and control characters as escapes, so that it stays on its line.

    >>> printable("Chair\x1b[31m")
    'Chair\\x1b[31m'
    """
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), name)


def nearest(name: str, known: Iterable[str]) -> str:
    """Say which known name is meant, if one is like it, and which are known.

    >>> nearest("scot", ["scout", "mule"])
    "Did you mean 'scout'? Known are scout, mule."
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, 1)
    listed = f"Known are {', '.join(known[:_MOST])}{', ...' if len(known) > _MOST else '.'}"
    return f"Did you mean {near[0]!r}? {listed}" if near else listed


def meant(name: str, known: Iterable[str]) -> str:
    """Say which known name is meant, or if none is like it, which are known: the end of a sentence.

    >>> meant("scot", ["scout", "mule"]), meant("x", ["scout", "mule"])
    ("did you mean 'scout'?", 'known are scout, mule.')
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, 1)
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}."
