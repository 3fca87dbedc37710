"""Values that stay what they are when they are pickled or copied."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

__all__ = ["Kept"]

T = TypeVar("T")


class Kept:
    """A dataclass whose arrays are read-only in pickles and copies, too; what it has worked out is left behind.

    numpy forgets that an array is read-only. A graph that somebody then writes into would no longer be the one
    that was searched.
    """

    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return _restored, (type(self), values)


def _restored(kind: type[T], values: dict[str, Any]) -> T:
    value = object.__new__(kind)
    for name, part in values.items():
        for array in part if isinstance(part, tuple) else (part,):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
        object.__setattr__(value, name, part)
    return value
