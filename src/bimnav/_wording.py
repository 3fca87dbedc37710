"""Sentences about one thing or many."""

from __future__ import annotations

import re

__all__ = ["counted"]

_EITHER = re.compile(r"\[([^][|]*)\|([^][|]*)\]")


def counted(message: str, number: int) -> str:
    """Put a number for `{n}` into a message, and of `[one|many]` the words that go with it.

    >>> counted("{n} [room has|rooms have] no door.", 1), counted("{n} [room has|rooms have] no door.", 2)
    ('1 room has no door.', '2 rooms have no door.')
    """
    return _EITHER.sub(r"\1" if number == 1 else r"\2", message).replace("{n}", str(number))
