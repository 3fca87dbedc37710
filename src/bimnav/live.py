"""Distance fields that stay right while the world changes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks, search
from bimnav.errors import GridError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan.paths import layout_of, source_indexes

__all__ = ["LiveField"]


class LiveField:
    """The distance from the nearest source to every cell, kept right while the world changes.

    Where a change moves few distances they are repaired, which costs a fraction of a new search; where it moves
    many, the repair is given up soon and all are searched anew. Equal, to the last bit, to
    `distance_field(graph, sources)` of the graph it follows.

    Parameters
    ----------
    graph
        The world as it is now.
    sources
        One free cell or several: exits, chargers, goals.

    Raises
    ------
    OutsideMapError, StartBlockedError
        If a source lies outside the map or is blocked.

    Examples
    --------
    >>> import numpy as np
    >>> from bimnav import Cell, LiveField, NavGraph
    >>> graph = NavGraph.from_mask(np.ones((3, 4), bool))
    >>> field = LiveField(graph, Cell(0, 1, 0))
    >>> field.at(Cell(0, 1, 3))
    3.0
    >>> field.update(graph.block([Cell(0, 1, 2)]))
    True
    >>> round(field.at(Cell(0, 1, 3)), 3)
    4.414
    """

    def __init__(self, graph: NavGraph, sources: Cell | Iterable[Cell]) -> None:
        _checks.need("graph", graph, NavGraph)
        self._cells = (sources,) if isinstance(sources, Cell) else _checks.many("sources", sources)
        self.graph: NavGraph
        self._level: float | None
        self._distance: NDArray[np.float64] | None
        self._search(graph)

    def __repr__(self) -> str:
        return f"LiveField({self.graph!r}, {self._cells!r:.60})"

    def update(self, graph: NavGraph) -> bool:
        """Take over a changed world; return whether what was known could be repaired or kept.

        Parameters
        ----------
        graph
            The world as it is now: a graph of the same cells, as `block` and its like return.

        Raises
        ------
        GridError
            If its cells are others.
        StartBlockedError
            If a source is blocked now; the field then stays as it was.
        """
        _checks.need("graph", graph, NavGraph)
        before = self.graph
        if graph is before:
            return True
        if graph.frame != before.frame or graph.connectivity != before.connectivity:
            raise GridError(
                f"the field has {before!r}, the graph is {graph!r}.",
                "Give a graph of the same cells, or make a new LiveField.",
            )
        source_indexes(graph, self._cells)
        same_links = all(np.array_equal(a, b) for a, b in zip(graph.links, before.links, strict=True))
        level = _level(graph)
        if not same_links or graph.objective != before.objective or level not in (None, self._level):
            self._search(graph)
            return False
        changed = np.flatnonzero(graph.cost.ravel() != before.cost.ravel())
        self.graph, self._level, self._distance = graph, level, None
        return self._field.update(changed, graph.cost.ravel()[changed])

    @property
    def distance(self) -> NDArray[np.float64]:
        """(storeys, rows, cols) float64, read-only, as `distance_field` returns it."""
        if self._distance is None:
            found = self._field.distances(self._scale)
            found.flags.writeable = False
            self._distance = found
        return self._distance

    def at(self, cell: Cell) -> float:
        """Return the distance of one cell.

        Raises
        ------
        GridError
            If there is no such cell.
        """
        if cell not in self.graph.frame:
            raise GridError(f"{cell} is no cell of {self.graph!r}.")
        return self._field.at(int(np.ravel_multi_index(cell, self.graph.frame.shape)), self._scale)

    @property
    def _scale(self) -> float:
        return self.graph.frame.cell_size * self.graph.unit_cost

    def _search(self, graph: NavGraph) -> None:
        self._field = search.Field(layout_of(graph), source_indexes(graph, self._cells))
        self.graph, self._level = graph, _level(graph)
        self._distance = None


def _level(graph: NavGraph) -> float | None:
    """Return what every free cell costs; None if they differ."""
    cost = graph.cost[graph.free]
    least = float(cost.min(initial=np.inf))
    return least if least == cost.max(initial=-np.inf) else None
