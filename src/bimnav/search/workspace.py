"""Memory that searches use again: stamped instead of cleared."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import NEVER

__all__ = ["Workspace", "workspace"]

# 16 bytes, so that a visit touches one line of cache
_NODE = ("i4", "u2", "u1", "u1")
_NAMES = ["length", "parent", "stamp", "todo", "done"]
_UNITS = np.dtype({"names": _NAMES, "formats": ["i8", *_NODE]})
_COSTS = np.dtype({"names": _NAMES, "formats": ["f8", *_NODE]})


class Workspace:
    """Nodes and a heap for one search at a time, on maps of any size.

    Attributes
    ----------
    units, costs
        The nodes, with lengths as int64 or as float64: one memory, seen twice. A node counts as
        untouched unless it bears the stamp of the search.
    keys, float_keys, items
        The heap, seen twice as well.
    """

    def __init__(self) -> None:
        self.stamp = 0
        self.units = np.zeros(0, dtype=_UNITS)
        self.costs = self.units.view(_COSTS)
        self._reach = np.empty(0, dtype=np.int64)
        self._arrivals = np.empty(0, dtype=np.uint8)
        self._new_heap(1024)

    def begin(self, cells: int) -> int:
        """Return the stamp of a new search over so many cells."""
        if len(self.units) < cells:
            self.units = np.zeros(cells, dtype=_UNITS)
            self.costs = self.units.view(_COSTS)
            self.stamp = 0
        self.stamp += 1
        if self.stamp > 0xFFFF:
            self.units["stamp"] = 0
            self.stamp = 1
        return self.stamp

    def lengths(self, cells: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return memory for a distance field over so many cells."""
        if len(self._reach) < cells:
            self._reach = np.empty(cells, dtype=np.int64)
            self._arrivals = np.empty(cells, dtype=np.uint8)
        return self._reach[:cells], self._arrivals[:cells]

    def grow_heap(self) -> None:
        """Make a larger heap."""
        self._new_heap(4 * len(self.keys))

    def _new_heap(self, size: int) -> None:
        self.keys: NDArray[np.int64] = np.full(size, NEVER, dtype=np.int64)
        self.float_keys: NDArray[np.float64] = self.keys.view(np.float64)
        self.items: NDArray[np.int32] = np.empty(size, dtype=np.int32)


_local = threading.local()


def workspace() -> Workspace:
    """Return the workspace of this thread."""
    try:
        found: Workspace = _local.workspace
    except AttributeError:
        found = _local.workspace = Workspace()
    return found
