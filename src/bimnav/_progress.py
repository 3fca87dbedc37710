"""Progress of what takes long: on a terminal, in a notebook, or through the caller's function."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

from bimnav import _checks

__all__ = ["Display", "Progress"]

_PATIENCE = 2.0  # seconds before progress shows by itself
_REFRESH = 0.1
_WIDTH = 79

Progress = Callable[[int, int, str], None]


def _is_watched() -> bool:
    """Return whether somebody looks: at a terminal, or at a notebook."""
    if sys.stderr is not None and sys.stderr.isatty():
        return True
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell" and "CI" not in os.environ


class Display:
    """Shows how far a job is: on standard error, or through the caller's function."""

    def __init__(self, name: str, wanted: bool | Progress | None) -> None:
        if not isinstance(wanted, bool):
            _checks.function("progress", wanted)
        self._name = name
        self._call = wanted if callable(wanted) else None
        self._shows = _is_watched() if wanted is None else wanted is True
        self._next = time.monotonic() + (_PATIENCE if wanted is None else 0.0)
        self._shown = False

    def __enter__(self) -> Progress:
        return self._call or self._show

    def __exit__(self, *_: object) -> None:
        if self._shown:
            sys.stderr.write(f"\r{'':{_WIDTH}}\r")

    def _show(self, done: int, total: int, text: str) -> None:
        now = time.monotonic()
        if self._shows and now >= self._next:
            self._next, self._shown = now + _REFRESH, True
            count = f"{done}/{total} " if total else ""
            sys.stderr.write(f"\r{f'{self._name}: {count}{text}'[:_WIDTH]:{_WIDTH}}")
            sys.stderr.flush()
