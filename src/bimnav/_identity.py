"""GlobalIds for what has none in a file."""

from __future__ import annotations

import hashlib

__all__ = ["global_id_of"]

_DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"


def global_id_of(text: str) -> str:
    """Derive a GlobalId from a text: the same text has the same id in every run."""
    return _compressed(hashlib.sha256(text.encode()).digest()[:16])


def _compressed(sixteen_bytes: bytes) -> str:
    """Write 128 bits as the 22 characters of an IFC GlobalId."""
    number = int.from_bytes(sixteen_bytes, "big")
    digits = []
    for _ in range(22):
        number, digit = divmod(number, 64)
        digits.append(_DIGITS[digit])
    return "".join(reversed(digits))
