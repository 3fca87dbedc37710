"""Routes that stay valid while the world changes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._topology import Node, Topology, topology
from bimnav._why import NoRoute, why_unreachable
from bimnav.errors import GridError, NoPathError
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.plan import Path, find_path

__all__ = ["Replan", "Replanner"]

_Thing: TypeAlias = tuple[str, str]  # GlobalId and name
_SAME = 1e-9  # relative; costs that differ by less are equal


@dataclass(frozen=True, slots=True, eq=False)
class Replan:
    """What became of a route when the world changed.

    Parameters
    ----------
    path
        From where the robot is to its goal; None if there is no route now.
    is_changed
        Whether it is another way than before.
    message
        What changed the route, and how, in words.
    causes
        GlobalIds of what was closed on the old way, or was opened on the new one.
    searched
        Whether a search was needed.
    why
        Why there is no route.
    """

    path: Path | None
    is_changed: bool
    message: str
    causes: tuple[str, ...] = ()
    searched: bool = False
    why: NoRoute | None = None


class Replanner:
    """Keeps the path of one robot a cheapest one while its world changes.

    A change that leaves the way ahead as it is, and makes nothing cheaper, needs no search: a door that closes
    elsewhere, or one the way does not pass. Else the path is searched anew over the cells, and kept if it is still
    a cheapest one. A closed door is blocked cells to that search, which is exact, so the path costs what it
    costs in a graph built anew. The topology of spaces and doors would only say which rooms to pass: it measures
    from middle to middle, and the rooms of its shortest way need not be those of the shortest path. So it is asked
    for names: of the doors and connectors that the new way takes in place of others.

    Parameters
    ----------
    graph
        The world as it is now.
    start, goal
        Free cells.

    Raises
    ------
    NoPathError
        If no route leads to the goal to begin with.

    Examples
    --------
    >>> import numpy as np
    >>> from bimnav import Cell, NavGraph, Replanner
    >>> graph = NavGraph.from_mask(np.ones((3, 4), bool))
    >>> replanner = Replanner(graph, Cell(0, 1, 0), Cell(0, 1, 3))
    >>> replanner.update(graph.block([Cell(0, 0, 2)])).message
    'the way ahead is as it was'
    >>> replanner.update(graph.block([Cell(0, 1, 2)])).message
    'cells on the way were blocked; the new way is 1.41 m longer'
    """

    def __init__(self, graph: NavGraph, start: Cell, goal: Cell) -> None:
        self.graph, self.at, self.goal = graph, start, goal
        self.path: Path | None = find_path(graph, start, goal)
        self._topology: Topology | None = None if graph.environment is None else topology(graph)

    def __repr__(self) -> str:
        way = "no route now" if self.path is None else f"{len(self.path.indices)} cells, {self.path.length:.3f} m"
        return f"Replanner({self.at} to {self.goal}, {way})"

    def update(self, graph: NavGraph, at: Cell | None = None) -> Replan:
        """Take over a changed world, and find out what it means for the route.

        Parameters
        ----------
        graph
            The world as it is now, derived from the one before.
        at
            Free cell in which the robot is; None if it has not moved.

        Raises
        ------
        GridError
            If the cells of the graph are others.
        StartBlockedError, GoalBlockedError
            If the robot's own cell or its goal is blocked now.
        """
        _checks.need("graph", graph, NavGraph)
        if graph.frame != self.graph.frame:
            raise GridError(
                f"the route is one of {self.graph!r}, the graph is {graph!r}.",
                "Give a graph of the same cells, or make a new Replanner.",
            )
        before, ahead = self.graph, self._ahead(at)
        self.graph, self.at = graph, self.at if at is None else at
        if ahead is not None and self._still_holds(before, graph, ahead):
            self.path = ahead = replace(ahead, graph=graph)  # who draws it straight must heed what is new
            return Replan(ahead, False, "the way ahead is as it was")
        try:
            found = find_path(graph, self.at, self.goal)
        except NoPathError:
            self.path = None
            why = why_unreachable(graph, self.at, self.goal)
            message = f"there is no route now: {why.message}" if why else "there is no route now"
            causes = why.global_ids if why else ()
            return Replan(None, ahead is not None, message, causes, True, why)
        if ahead is not None and _is_valid(graph, ahead) and found.cost >= _cost_of(graph, ahead) * (1 - _SAME):
            self.path = Path(graph, ahead.indices, ahead.length, _cost_of(graph, ahead))
            return Replan(self.path, False, "the way ahead is still a cheapest one", searched=True)
        self.path = found
        return self._changed(before, graph, ahead, found)

    def _ahead(self, at: Cell | None) -> Path | None:
        """Return what is left of the path from a cell of it on; None if the robot has left the path."""
        if self.path is None or at is None or at == self.at:
            return self.path
        on = np.flatnonzero((self.path.indices == np.array(at)).all(axis=1))
        if not len(on):
            return None
        indices = self.path.indices[int(on[0]) :].copy()
        rest = Path(self.path.graph, indices, 0.0, 0.0)
        return Path(self.path.graph, indices, _length_of(rest), _cost_of(self.path.graph, rest))

    def _still_holds(self, before: NavGraph, graph: NavGraph, ahead: Path) -> bool:
        """Tell without a search whether a path is still a cheapest one: nothing else got cheaper, nor it dearer."""
        if graph is before:
            return True
        if graph.objective != before.objective or (graph.cost < before.cost).any():
            return False
        if {*graph.connectors} - {*before.connectors} or not _is_valid(graph, ahead):
            return False
        cells = tuple(ahead.indices.T)
        return bool((graph.cost[cells] == before.cost[cells]).all())

    def _changed(self, before: NavGraph, graph: NavGraph, ahead: Path | None, found: Path) -> Replan:
        """Say what changed the route: what was closed on the old one, else what was opened on the new one."""
        on_new = _closing(before, found, _difference(graph, before))
        if ahead is None:
            text = (
                f"{_names(on_new)} no longer closes the way" if on_new else "a route was found from where the robot is"
            )
            return Replan(found, True, text, tuple(global_id for global_id, _ in on_new), True)
        on_old = _closing(graph, ahead, _difference(before, graph))
        if on_old:
            causes, text = on_old, f"{_names(on_old)} closed the way"
        elif not _is_valid(graph, ahead):
            causes, text = [], "cells on the way were blocked"
        elif on_new:
            causes, text = on_new, f"{_names(on_new)} no longer closes the way"
        else:
            causes, text = [], "another way is cheaper now"
        longer = found.length - ahead.length
        text += f"; the new way is {abs(longer):.2f} m {'longer' if longer >= 0 else 'shorter'}"
        passed = self._passed(ahead, found)
        return Replan(found, True, text + passed, tuple(global_id for global_id, _ in causes), True)

    def _passed(self, ahead: Path, found: Path) -> str:
        """Say which doors and connectors the new way takes in place of which."""
        if self._topology is None:
            return ""
        old, new = (self._topology.along(path.points) for path in (ahead, found))
        fresh, gone = _only(new, old), _only(old, new)
        if not fresh:
            return ""
        return f", through {', '.join(fresh)}" + (f" in place of {', '.join(gone)}" if gone else "")


def _only(places: tuple[Node, ...], others: tuple[Node, ...]) -> list[str]:
    known = {place.global_id for place in others}
    return list(dict.fromkeys(place.name or place.global_id for place in places if place.global_id not in known))


def _difference(before: NavGraph, after: NavGraph) -> list[_Thing]:
    """Return GlobalId and name of what was placed or closed between two worlds."""
    known = {id(placed) for placed in before.changes.placed}
    new = (placed.obstacle for placed in after.changes.placed if id(placed) not in known)
    return list(dict.fromkeys((obstacle.global_id, obstacle.name) for obstacle in new))


def _closing(graph: NavGraph, path: Path, candidates: list[_Thing]) -> list[_Thing]:
    """Return which of some obstacles of a graph lie over cells of a path."""
    flat: NDArray[np.int64] = np.ravel_multi_index(tuple(path.indices.T), graph.frame.shape)
    over = {placed.global_id for placed in graph.changes.placed if np.isin(flat, placed.cells).any()}
    return [(global_id, name) for global_id, name in candidates if global_id in over]


def _names(things: list[_Thing]) -> str:
    return ", ".join(f"{name} ({global_id})" for global_id, name in things)


def _is_valid(graph: NavGraph, path: Path) -> bool:
    """Tell whether a path found in another graph can be driven in this one."""
    indices = path.indices
    storey, row, col = indices.T
    if not graph.free[storey, row, col].all():
        return False
    for k in np.flatnonzero(np.diff(storey)).tolist():
        if graph.link_between(Cell(*indices[k].tolist()), Cell(*indices[k + 1].tolist())) is None:
            return False
    flat = np.diff(storey) == 0
    corners = graph.free[storey[:-1], row[:-1], col[1:]] & graph.free[storey[:-1], row[1:], col[:-1]]
    return bool(corners[flat].all())


def _length_of(path: Path) -> float:
    steps = np.abs(np.diff(path.indices, axis=0))
    flat = np.sqrt(steps[:, 1] + steps[:, 2])[steps[:, 0] == 0].sum() * path.graph.frame.cell_size
    return float(flat) + sum(link.length for _, link in path.rides)


def _cost_of(graph: NavGraph, path: Path) -> float:
    """Return what a path costs in a graph in which it is valid."""
    indices = path.indices
    steps = np.abs(np.diff(indices, axis=0))
    cost = graph.cost[tuple(indices.T)].astype(np.float64)
    flat = np.sqrt(steps[:, 1] + steps[:, 2]) * (cost[:-1] + cost[1:]) / 2
    total = float(flat[steps[:, 0] == 0].sum()) * graph.frame.cell_size * graph.unit_cost
    rides = Path(graph, indices.copy(), 0.0, 0.0).rides
    return total + sum(graph.cost_of(link) for _, link in rides)
