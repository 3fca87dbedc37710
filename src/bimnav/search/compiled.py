"""How kernels are compiled, and the few words they share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.extending import intrinsic
from numpy.typing import NDArray

__all__ = [
    "FOUND",
    "FULL",
    "NEVER",
    "NOTHING",
    "first_at_least",
    "forget",
    "kernel",
    "leading_zeros",
    "lean",
    "pop_least",
    "push",
    "put",
    "trailing_zeros",
]

_Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def _without_counting() -> dict[str, Any]:
    """Return the option that leaves out reference counting, where this numba has it.

    Counting makes a small function that takes arrays sixteen times slower to call. The option is not
    documented; without it kernels are slow but right.
    """
    try:
        from numba.core.options import DefaultOptions
    except ImportError:
        return {}
    return {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}


kernel: _Decorator = numba.njit(cache=True, error_model="numpy", nogil=True)
"""Compiles a function that may make arrays."""

lean: _Decorator = numba.njit(cache=True, error_model="numpy", nogil=True, **_without_counting())
"""Compiles a function that makes no array."""


def _count(name: str) -> Any:
    def counter(_typing_context: Any, word: Any) -> Any:
        def emit(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            return getattr(builder, name)(args[0], ir.Constant(ir.IntType(1), 1))

        return numba.types.int64(word), emit

    return intrinsic(counter)


trailing_zeros = _count("cttz")
"""Number of zeros below the lowest one of a uint64, which must not be 0, as int64."""

leading_zeros = _count("ctlz")
"""Number of zeros above the highest one of a uint64, which must not be 0, as int64."""


NOTHING, FOUND, FULL = 0, 1, 2
"""How a search ends; `FULL`: its heap was too small."""


@lean
def first_at_least(values: NDArray[Any], value: Any) -> int:
    """Return the place of the first of some ordered values that is not less than one."""
    low, high = 0, len(values)
    while low < high:
        middle = (low + high) >> 1
        if values[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


NEVER = 0x7FF0_0000_0000_0000
"""Fills the unused end of a heap: later than any key, also when read as float64 (infinity)."""


@lean
def _sink(keys: NDArray[Any], items: NDArray[np.int32], size: int, key: Any, item: int) -> None:
    """Put an entry in place of the top of a heap, and down to where it belongs."""
    at = 0
    while True:
        least = 4 * at + 1
        if least >= size:
            break
        # beyond the end lie keys that are never least
        right = least + 2 + (keys[least + 3] < keys[least + 2])
        least += keys[least + 1] < keys[least]
        if keys[right] < keys[least]:
            least = right
        if keys[least] >= key:
            break
        keys[at] = keys[least]
        items[at] = items[least]
        at = least
    keys[at] = key
    items[at] = item


@lean
def push(keys: NDArray[Any], items: NDArray[np.int32], size: int, key: Any, item: int) -> int:
    """Add to a heap of `size` entries with four children each; return its new size.

    A full heap stays as it is, and its size becomes `len(keys)`: too large to be true.
    """
    if size >= len(keys) - 4:
        return len(keys)
    at = size
    while at > 0:
        above = (at - 1) >> 2
        if keys[above] <= key:
            break
        keys[at] = keys[above]
        items[at] = items[above]
        at = above
    keys[at] = key
    items[at] = item
    return size + 1


@lean
def pop_least(keys: NDArray[Any], items: NDArray[np.int32], size: int, never: Any) -> int:
    """Take the least entry, at 0, off a heap of `size` entries; return its new size."""
    size -= 1
    key, item = keys[size], items[size]
    keys[size] = never
    if size:
        _sink(keys, items, size, key, item)
    return size


@lean
def put(keys: NDArray[Any], items: NDArray[np.int32], size: int, key: Any, item: int) -> int:
    """Add to a heap as `push` does; where `size` is negative, in place of its top, which was dealt with."""
    if size >= 0:
        return push(keys, items, size, key, item)  # type: ignore[no-any-return]
    _sink(keys, items, -size, key, item)
    return -size


@lean
def forget(keys: NDArray[Any], size: int, never: Any) -> None:
    """Empty a heap of so many entries."""
    for at in range(size):
        keys[at] = never
