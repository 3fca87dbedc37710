"""Who may be where: doors, passages and chargers, each used by a fixed number of robots at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import simpy

__all__ = ["Claims"]


@dataclass(slots=True)
class _Request:
    names: tuple[str, ...]
    granted: simpy.Event


@dataclass(slots=True)
class Claims:
    """Grants sets of resources, first come, first served.

    A set is granted whole or not at all, so that nobody holds one resource of a set while it waits for
    another. A request waits while one of its resources is full, or is wanted by a request that came before.

    Parameters
    ----------
    clock
        The simulation's.
    left
        How many more users each resource takes.
    """

    clock: simpy.Environment
    left: dict[str, int] = field(default_factory=dict)
    waiting: list[_Request] = field(default_factory=list)

    def request(self, names: Iterable[str]) -> simpy.Event | None:
        """Ask for resources; None if they are granted at once, else the event that they are."""
        wanted = tuple(sorted(names))
        if self.take(wanted):
            return None
        request = _Request(wanted, self.clock.event())
        self.waiting.append(request)
        return request.granted

    def take(self, names: Sequence[str]) -> bool:
        """Take resources if all are free and nobody waits for one; answer whether they are taken."""
        waited_for = {name for request in self.waiting for name in request.names}
        if any(self.left[name] <= 0 or name in waited_for for name in names):
            return False
        self._take(names)
        return True

    def withdraw(self, granted: simpy.Event) -> None:
        """Give a request up; what it was granted meanwhile is given back."""
        for request in self.waiting:
            if request.granted is granted:
                self.waiting.remove(request)
                self._grant()
                return
        if granted.triggered and granted.value is not None:
            self.release(granted.value)

    def release(self, names: Iterable[str]) -> None:
        """Give resources back; those who wait for them go on, in the order in which they asked."""
        for name in names:
            self.left[name] += 1
        self._grant()

    def _take(self, names: Iterable[str]) -> None:
        for name in names:
            self.left[name] -= 1

    def _grant(self) -> None:
        taken: set[str] = set()
        for request in tuple(self.waiting):
            if all(self.left[name] > 0 and name not in taken for name in request.names):
                self._take(request.names)
                self.waiting.remove(request)
                request.granted.succeed(request.names)
            taken.update(request.names)
