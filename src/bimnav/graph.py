"""The navigation graph: what every cell is for, what it costs, and what joins it to its neighbors.

The graph is implicit: arrays over the cells of a frame. `to_rustworkx` and `to_networkx` write it out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias, get_args, overload

import numpy as np
import shapely
from numpy.typing import ArrayLike, DTypeLike, NDArray

from bimnav import _checks, search
from bimnav._approach import stop_for
from bimnav._changes import Changes, Placed, cells_under, changed_arrays, indexes_of
from bimnav._cut import FINEST, Conflict, conflict_at, cut, zone_factor
from bimnav._explicit import Edges, networkx_of, rustworkx_of
from bimnav._identity import global_id_of
from bimnav._kept import Kept
from bimnav.environment import IndoorEnvironment, Obstacle, grown
from bimnav.errors import GeometryError, GridError, ModelError, ValueRangeError
from bimnav.grid import Cell, GridFrame
from bimnav.links import Link, RefusedConnector, is_near_connector, join_connectors
from bimnav.robot import Robot
from bimnav.stops import Stop, Unreached

if TYPE_CHECKING:
    import networkx
    import rustworkx
    from shapely.geometry.base import BaseGeometry

    from bimnav._explain import CellExplanation
    from bimnav.adaptive import AdaptiveGraph
    from bimnav.environment import Target

__all__ = ["Conflict", "NavGraph", "NodeKind", "Objective", "Stop", "Unreached", "build_graph"]

Objective: TypeAlias = Literal["distance", "time", "energy"]

_CLOSED = "closed door"  # the rule by which a closed door is an obstacle


class NodeKind(IntEnum):
    """What a cell is for in one task."""

    REGULAR = 0
    OBSTACLE = 1
    TARGET = 2
    OUTSIDE = 3


@dataclass(frozen=True, eq=False)
class NavGraph(Kept):
    """Cells, costs and neighbors over all storeys.

    Parameters
    ----------
    frame
        The cells.
    cost : (storeys, rows, cols) float32
        Multiplier of the length of a step, at least 1; inf where a robot cannot be.
    obstacle : (storeys, rows, cols) bool
        Cells that share positive area with an obstacle.
    floor : (storeys, rows, cols) bool
        Cells that lie wholly on walkable floor.
    connectivity
        4 or 8. A diagonal step needs both straight neighbors free.
    environment
        Where it comes from; None for a graph made from a mask.
    targets
        Every target and the cell that holds its destination; None for one outside the map.
    conflicts
        Targets whose cell is also an obstacle cell.
    on_conflict
        What becomes of them: `approach` the nearest safe standing cell, or `reach` the cell itself.
    connectors
        Ways between storeys: over stairs and ramps, and in lifts. One whose cell is blocked is closed.
    refused_connectors
        Stairs, ramps and lifts that the robot does not use, and why.
    objective
        What a path makes least: `distance` in metres, `time` in seconds, or `energy` in joules; times the
        cells' multipliers.
    changes
        What was closed since the graph was built: by `block`, `with_obstacle` and `close_door`.
    clearances
        Distance in metres and weight of every `with_clearance` that holds.
    bare_cost : (storeys, rows, cols) float32
        The cost without what clearances add; None where there are none.
    """

    frame: GridFrame
    cost: NDArray[np.float32]
    obstacle: NDArray[np.bool_]
    floor: NDArray[np.bool_]
    connectivity: Literal[4, 8] = 4
    environment: IndoorEnvironment | None = None
    targets: tuple[tuple[Target, Cell | None], ...] = ()
    conflicts: tuple[Conflict, ...] = ()
    on_conflict: Literal["approach", "reach"] = "approach"
    connectors: tuple[Link, ...] = ()
    refused_connectors: tuple[RefusedConnector, ...] = ()
    objective: Objective = "distance"
    changes: Changes = field(default_factory=Changes)
    clearances: tuple[tuple[float, float], ...] = ()
    bare_cost: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if self.connectivity not in (4, 8):
            raise ValueRangeError(f"connectivity is {self.connectivity}.", "Give 4 or 8.")
        for name, dtype in (("cost", np.float32), ("obstacle", np.bool_), ("floor", np.bool_)):
            array = _owned(getattr(self, name), dtype)
            if array.shape != self.frame.shape:
                raise GridError(f"{name} is {array.shape}, the frame is {self.frame.shape}.")
            object.__setattr__(self, name, array)
        if not self.cost.min(initial=np.inf) >= 1:  # of what holds a NaN it is NaN
            raise ValueRangeError("a cost is below 1 or not a number.", "Give multipliers of at least 1, or inf.")
        object.__setattr__(self, "connectors", tuple(self.connectors))
        for link in self.connectors:
            if link.begin not in self.frame or link.end not in self.frame:
                raise GridError(f"{link} leaves a frame of shape {self.frame.shape}.")
        if self.objective not in get_args(Objective):
            raise ValueRangeError(f"objective is {self.objective!r}.", "Give 'distance', 'time' or 'energy'.")
        if self.objective == "energy" and not self._robot.drive_power:
            raise ValueRangeError(
                f"robot {self._robot.name!r} draws no power to drive, so no path saves energy.",
                "Give the robot its drive_power in watts.",
            )

    @classmethod
    def from_mask(
        cls,
        free: ArrayLike,
        *,
        cell_size: float = 1.0,
        connectivity: Literal[4, 8] = 8,
        connectors: Iterable[Link] = (),
    ) -> NavGraph:
        """Make a graph from a mask of free cells, without a building.

        Parameters
        ----------
        free : (rows, cols) or (storeys, rows, cols) bool
            True where a robot can be; row 0 is the lowest y.
        cell_size
            Edge of a cell in metres.
        connectivity
            4 or 8.
        connectors
            Ways between storeys.
        """
        given = np.asarray(free)
        if given.dtype.kind == "f" and np.isnan(given).any():
            raise GridError("the mask holds a NaN.", "Say for each cell whether it is free.")
        mask = given.astype(np.bool_)
        if mask.ndim == 2:
            mask = mask[None]
        if mask.ndim != 3 or not mask.size:
            raise GridError(f"a mask of shape {np.shape(free)} is no grid.", "Give (storeys, rows, cols).")
        heights = tuple(3.0 * storey for storey in range(mask.shape[0]))
        frame = GridFrame(cell_size, 0, 0, mask.shape[1], mask.shape[2], heights)
        cost = _frozen(np.where(mask, np.float32(1), np.float32(np.inf)))
        floor = _frozen(np.ones(mask.shape, dtype=np.bool_))
        return cls(
            frame, cost, _frozen(~mask), floor, connectivity, connectors=_checks.many("connectors", connectors, Link)
        )

    def __repr__(self) -> str:
        storeys, rows, cols = self.frame.shape
        counts = ", ".join(f"{count} {kind.name.lower()}" for kind, count in self.counts.items())
        return f"NavGraph({storeys} x {rows} x {cols} cells of {self.frame.cell_size:g} m: {counts})"

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        from bimnav._cards import card

        storeys, rows, cols = self.frame.shape
        told = [
            ("cells", f"{storeys} × {rows} × {cols} of {self.frame.cell_size:g} m, {self.connectivity} neighbors"),
            *((kind.name.lower(), count) for kind, count in self.counts.items()),
            ("conflicts", ", ".join(conflict.name for conflict in self.conflicts)),
            ("connectors", len(self.connectors) or None),
        ]
        return card("Navigation graph", told)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """(storeys, rows, cols) bool, where a robot can be."""
        free: NDArray[np.bool_] = np.isfinite(self.cost)
        free.flags.writeable = False
        return free

    @cached_property
    def kinds(self) -> NDArray[np.uint8]:
        """(storeys, rows, cols) uint8 of `NodeKind`; a target's cell is a target, also in a conflict."""
        kinds = np.where(
            self.obstacle, NodeKind.OBSTACLE, np.where(self.floor, NodeKind.REGULAR, NodeKind.OUTSIDE)
        ).astype(np.uint8)
        for _, cell in self.targets:
            if cell is not None:
                kinds[cell] = NodeKind.TARGET
        kinds.flags.writeable = False
        return kinds

    @property
    def counts(self) -> dict[NodeKind, int]:
        """Number of cells of each kind."""
        tally = np.bincount(self.kinds.ravel(), minlength=len(NodeKind))
        return {kind: int(tally[kind]) for kind in NodeKind}

    @cached_property
    def components(self) -> NDArray[np.int32]:
        """(storeys, rows, cols) int32: cells with the same positive number can reach each other; blocked is 0.

        Diagonal steps never cut corners, so they join nothing that straight steps do not join.
        """
        return _frozen(search.components(self.free, self.links[0]))

    @cached_property
    def parts(self) -> NDArray[np.int32]:
        """(storeys, rows, cols) int32: as `components`, but for ways that lead over other storeys."""
        return _frozen(search.components(self.free)) if len(self.links[0]) else self.components

    @property
    def unit_cost(self) -> float:
        """What a metre of floor without a multiplier costs: metres, seconds or joules, by the objective."""
        if self.objective == "distance":
            return 1.0
        return (1.0 if self.objective == "time" else self._robot.drive_power) / self._robot.speed

    def cost_of(self, link: Link) -> float:
        """Return what a link costs: metres, seconds or joules, by the objective, times its multiplier."""
        seconds = self.seconds_over(link)
        if self.objective == "distance":
            return link.length * link.factor
        if self.objective == "time":
            return seconds * link.factor
        waits = 0.0 if link.kind != "lift" else max(seconds - self.seconds_beside(link), 0.0)
        joules = (seconds - waits) * self._robot.drive_power + waits * self._robot.idle_power
        return joules * link.factor

    def seconds_over(self, link: Link, robot: Robot | None = None) -> float:
        """Return how long a link takes: a ride its own time, what is driven as much longer as a robot is slower.

        Parameters
        ----------
        robot
            None for the one that the graph was made for.
        """
        own = self._robot.speed
        speed = own if robot is None else robot.speed
        if link.seconds is None:
            return link.length / speed
        driven = link.seconds if link.kind != "lift" else min(self.seconds_beside(link), link.seconds)
        return link.seconds - driven + driven * own / speed

    def seconds_beside(self, link: Link) -> float:
        """Return how much of a link, in seconds, the robot of the graph drives on the flat, as to a lift's cabin."""
        levels = self.frame.elevations
        rise = abs(levels[link.end.storey] - levels[link.begin.storey])
        return max(link.length - rise, 0.0) / self._robot.speed

    @cached_property
    def links(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The open connectors as edges: (k, 2) flat indexes of from and to, both ways, and (k,) costs."""
        ends = np.array([(*link.begin, *link.end) for link in self.connectors], dtype=np.int64).reshape(-1, 2, 3)
        _, rows, cols = self.frame.shape
        flat = (ends[..., 0] * rows + ends[..., 1]) * cols + ends[..., 2]
        cost = np.array([self.cost_of(link) for link in self.connectors], dtype=np.float64)
        is_open = self.free.ravel()[flat].all(axis=1)
        flat, cost = flat[is_open], cost[is_open]
        return _frozen(np.concatenate([flat, flat[:, ::-1]])), _frozen(np.tile(cost, 2))

    def link_between(self, begin: Cell, end: Cell) -> Link | None:
        """Return the cheapest connector that joins two cells; None if none does."""
        return self._links_by_ends.get((*_checks.cell("begin", begin), *_checks.cell("end", end)))

    @cached_property
    def _links_by_ends(self) -> dict[tuple[int, ...], Link]:
        found: dict[tuple[int, ...], Link] = {}
        for link in sorted(self.connectors, key=self.cost_of):
            found.setdefault((*link.begin, *link.end), link)
            found.setdefault((*link.end, *link.begin), link)
        return found

    @property
    def _robot(self) -> Robot:
        return Robot() if self.environment is None else self.environment.robot

    @cached_property
    def stops(self) -> tuple[Stop, ...]:
        """Where a robot goes for every target that has a place to go to, whichever part it lies in."""
        return self.stops_from(None)[0]

    def stops_from(self, start: Cell | None) -> tuple[tuple[Stop, ...], tuple[Unreached, ...]]:
        """Return where a robot goes for every target, and the targets it cannot serve from a start.

        A robot drives onto a target's own point, if the target asks for nothing else and it can. Else it
        stands within its reach of the target, where nothing hides the target from it.

        Parameters
        ----------
        start
            Cell the robot comes from; None for anywhere.
        """
        component = None if start is None else int(self.components[self._own(start)])
        stops: list[Stop] = []
        unreached: list[Unreached] = []
        for target, cell in self.targets:
            found = stop_for(self, target, cell, component)
            if isinstance(found, Stop):
                stops.append(found)
            else:
                unreached.append(found)
        return tuple(stops), tuple(unreached)

    def block(self, cells: Iterable[Cell]) -> Self:
        """Return the graph with cells closed."""
        return self._changed(blocked=np.union1d(self.changes.blocked, self._flat(cells)))

    def unblock(self, cells: Iterable[Cell]) -> Self:
        """Return the graph with cells open again that `block` had closed; nothing else opens."""
        return self._changed(blocked=np.setdiff1d(self.changes.blocked, self._flat(cells)))

    def with_obstacle(
        self, polygon: BaseGeometry, storey: int | str = 0, *, global_id: str = "", name: str = "obstacle"
    ) -> Self:
        """Return the graph with something standing in the way, as if the model had it.

        Of what height it is nobody knows: it hides no target from the robot.

        Parameters
        ----------
        polygon
            Plan view in world coordinates, metres; not grown by the robot's radius.
        storey
            Index, name or GlobalId of a storey of the environment.
        global_id
            By which `without_obstacle` knows it; derived from place and form if not given.
        """
        _checks.need("polygon", polygon, shapely.Geometry)
        if not polygon.is_valid or polygon.is_empty:
            raise GeometryError(f"{name} has no valid plan view.", "Give a simple polygon in metres.")
        index = self._storey(storey)
        key = global_id or global_id_of(f"{polygon.normalize().wkt}\0{index}\0{name}")
        return self._with_placed([(index, polygon)], key, name, "IfcBuildingElementProxy", "placed since")

    def without_obstacle(self, global_id: str) -> Self:
        """Return the graph without an obstacle that `with_obstacle` had placed, or with a closed door open."""
        kept = tuple(entry for entry in self.changes.placed if entry.global_id != global_id)
        if len(kept) == len(self.changes.placed):
            raise ModelError(
                f"nothing that was placed or closed since is called {global_id!r}.",
                "See `graph.changes.placed`.",
                {"global_id": global_id},
            )
        return self._changed(placed=kept)

    def close_door(self, global_id: str) -> Self:
        """Return the graph with a door of the building closed: its doorway is an obstacle.

        Raises
        ------
        ModelError
            If no floor leads through a door of this GlobalId.
        """
        if any(_is_door(entry, global_id) for entry in self.changes.placed):
            return self
        environment = self.environment
        doorways = [] if environment is None else environment.regions
        ways = [(r.storey, r.polygon) for r in doorways if r.source == "door" and r.global_id == global_id]
        if environment is None or not ways:
            raise ModelError(
                f"no floor leads through a door {global_id!r}.",
                "`building.doors` lists the doors, `bimnav.doors_of` tells where they lead.",
                {"global_id": global_id},
            )
        door = next(door for door in environment.building.doors if door.global_id == global_id)
        return self._with_placed(ways, global_id, door.name, door.element.ifc_class, _CLOSED)

    def open_door(self, global_id: str) -> Self:
        """Return the graph with a door open that `close_door` had closed."""
        kept = tuple(entry for entry in self.changes.placed if not _is_door(entry, global_id))
        return self._changed(placed=kept) if len(kept) < len(self.changes.placed) else self

    def _with_placed(
        self, polygons: Iterable[tuple[int, BaseGeometry]], global_id: str, name: str, ifc_class: str, rule: str
    ) -> Self:
        placed = []
        for storey, polygon in polygons:
            level, robot = self.frame.elevations[storey], self._robot
            low, high = level + robot.low, level + robot.height
            obstacle = Obstacle(global_id, name, ifc_class, storey, polygon, low, high, "exact", rule)
            cells = cells_under(self.frame, storey, grown(polygon, robot.radius if self.environment else 0.0))
            placed.append(Placed(obstacle, cells))
        return self._changed(placed=(*self.changes.placed, *placed))

    def _flat(self, cells: Iterable[Cell]) -> NDArray[np.int64]:
        return indexes_of([self._own(cell) for cell in _checks.many("cells", cells)], self.frame)

    def _own(self, cell: Cell) -> Cell:
        """Return a cell; refuse what is none of this graph."""
        own = Cell(*_checks.cell("cell", cell))
        if own not in self.frame:
            raise GridError(f"{own} is not a cell of a frame of shape {self.frame.shape}.")
        return own

    def _storey(self, storey: int | str) -> int:
        storeys = self.environment.storeys if self.environment else ()
        names = (k for k, known in enumerate(storeys) if storey in (known.name, known.global_id))
        index = int(storey) if isinstance(storey, (int, np.integer)) else next(names, -1)
        if not 0 <= index < len(self.frame.elevations):
            raise ValueRangeError(
                f"storey is {storey!r}.", f"Give an index below {len(self.frame.elevations)} or a name."
            )
        return index

    def _changed(self, *, blocked: NDArray[np.int64] | None = None, placed: tuple[Placed, ...] | None = None) -> Self:
        """Return the graph with other things closed."""
        before, environment = self.changes, self.environment
        blocked = before.blocked if blocked is None else blocked
        placed = before.placed if placed is None else placed
        added = [entry.obstacle for entry in placed if entry not in before.placed]
        removed = [entry.obstacle for entry in before.placed if entry not in placed]
        if environment is not None and (added or removed):
            environment = environment.with_obstacles(added, removed)
        under = np.unique(np.concatenate([np.zeros(0, np.int64), *(entry.cells for entry in placed)]))
        conflicts = self._conflicts_with(environment, under)
        reached = [conflict.cell for conflict in conflicts] if self.on_conflict == "reach" else []
        kept = np.intersect1d(under, indexes_of(reached, self.frame))
        bare = self.cost if self.bare_cost is None else self.bare_cost
        cost, obstacle, changes, cells = changed_arrays(bare, self.obstacle, before, blocked, placed, kept)
        for cell in reached:  # one that no floor carries, as when it is cut
            if environment is not None and not self.floor[cell] and indexes_of([cell], self.frame)[0] in kept:
                known = float(bare[cell])
                cost[cell] = known if math.isfinite(known) else zone_factor(self.frame, environment, cell)
        graph = replace(
            self,
            **self._costs(_frozen(cost), self.clearances),
            obstacle=_frozen(obstacle),
            environment=environment,
            conflicts=conflicts,
            changes=changes,
        )
        return graph._rejoined(cells)

    def _conflicts_with(self, environment: IndoorEnvironment | None, under: NDArray[np.int64]) -> tuple[Conflict, ...]:
        """Return the targets on obstacle cells, now that obstacles placed since lie over some cells."""
        before = self.changes
        if environment is None or not (len(under) or before.placed):
            return self.conflicts
        within = [(target, cell) for target, cell in self.targets if cell is not None]
        flat = np.array([indexes_of([cell], self.frame)[0] for _, cell in within], dtype=np.int64)
        over = np.isin(flat, under)
        was_over = np.isin(flat, np.concatenate([np.zeros(0, np.int64), *(entry.cells for entry in before.placed)]))
        known = {(c.global_id, c.cell): c for c in self.conflicts}
        conflicts = []
        for (target, cell), now, then, index in zip(within, over, was_over, flat.tolist(), strict=True):
            if now or then:
                place = np.searchsorted(before.cells, index)
                recorded = place < len(before.cells) and before.cells[place] == index
                own = bool(before.obstacle[place]) if recorded else bool(self.obstacle[cell])
                if now or own:
                    conflicts.append(conflict_at(self.frame, environment, target, cell))
            elif (target.global_id, cell) in known:
                conflicts.append(known[target.global_id, cell])
        return tuple(conflicts)

    def _rejoined(self, cells: NDArray[np.int64]) -> Self:
        """Return the graph with its connectors joined anew if cells that changed lie near one."""
        if self.environment is None or not is_near_connector(self.environment, self.frame, cells):
            return self
        connectors, refused = join_connectors(self.environment, self.frame, self.free, self.connectors)
        return replace(self, connectors=connectors, refused_connectors=refused)

    def with_cost(self, factor: ArrayLike) -> Self:
        """Return the graph with other costs; what is blocked stays blocked, and no `with_clearance` holds any more.

        Parameters
        ----------
        factor : anything that fits (storeys, rows, cols)
            Multiplier of the length of a step, at least 1; inf closes a cell.
        """
        exact = _checks.numbers("factor", factor)
        with np.errstate(over="ignore"):
            factors = exact.astype(np.float32)
        if (np.isinf(factors) & np.isfinite(exact)).any():
            raise ValueRangeError("a cost is above 3.4e38.", "Give less, or inf to close a cell.")
        try:
            given = np.broadcast_to(factors, self.frame.shape)
        except ValueError as error:
            raise GridError(f"factor is {factors.shape}, the frame is {self.frame.shape}.") from error
        cost = _frozen(np.where(self.free, given, np.float32(np.inf)))
        graph = replace(self, cost=cost, bare_cost=None, clearances=(), changes=self.changes.with_cost(given))
        if self.environment is None:
            return graph
        return graph._rejoined(np.flatnonzero(self.free & ~graph.free))

    def with_clearance(self, metres: float, weight: float = 4.0) -> Self:
        """Return the graph with cells dearer the nearer they lie to blocked ones, so that paths keep away.

        Only the cost changes: where there is no other way, a path goes through all the same. What the
        robot must keep away from at all costs is its radius. What is closed later repels, too.

        Parameters
        ----------
        metres
            Distance, from the middle of a cell to the nearest blocked one, from which on nothing is added.
        weight
            Added to the multiplier right beside an obstacle; it falls with the square of the distance missing.
        """
        bare = self.cost if self.bare_cost is None else self.bare_cost
        wanted = _checks.number("clearance", metres, 0), _checks.number("the weight of a clearance", weight, 0)
        return replace(self, **self._costs(bare, (*self.clearances, wanted)))

    def _costs(self, bare: NDArray[np.float32], clearances: tuple[tuple[float, float], ...]) -> dict[str, Any]:
        """Return the fields of a graph of which the cost is known but for what clearances add."""
        if not clearances:
            return {"cost": bare, "bare_cost": None, "clearances": ()}
        from bimnav._clearance import clearance_factors

        free, cost = np.isfinite(bare), bare
        for metres, weight in clearances:
            with np.errstate(over="ignore"):
                cost = cost * clearance_factors(free, self.frame.cell_size, metres, weight)
        if not np.isfinite(cost, where=free, out=np.ones_like(free)).all():
            raise ValueRangeError("a cost is above 3.4e38.", "Give a clearance less weight.")
        return {"cost": _frozen(cost), "bare_cost": bare, "clearances": clearances}

    def with_objective(self, objective: Objective) -> Self:
        """Return the graph whose paths make something else least."""
        return self if objective == self.objective else replace(self, objective=objective)

    def explain(self, cell: Cell) -> CellExplanation:
        """Say what a cell is: every element that touches it, the rule that decides, heights and costs.

        Raises
        ------
        GridError
            If there is no such cell.
        """
        from bimnav._explain import explain_cell

        return explain_cell(self, self._own(cell))

    def edges(self) -> Edges:
        """Return all edges once: flat indexes of their two cells, and their cost.

        A flat index counts cells in the order of the arrays. The cost of a step is its length times the
        mean of the two cells' multipliers, in metres; under another objective in seconds or joules. Open
        connectors come last; of several between two cells, the cheapest.
        """
        index = np.arange(self.cost.size).reshape(self.frame.shape)
        free, cost = self.free, self.cost.astype(np.float64)
        ends: list[Edges] = []

        def join(
            a: tuple[slice, ...], b: tuple[slice, ...], length: float, open_: NDArray[np.bool_] | np.bool_
        ) -> None:
            keep = free[a] & free[b] & open_
            ends.append((index[a][keep], index[b][keep], length * (cost[a][keep] + cost[b][keep]) / 2))

        d, all_, low, high = self.frame.cell_size * self.unit_cost, slice(None), slice(None, -1), slice(1, None)
        every = np.True_
        join((all_, all_, low), (all_, all_, high), d, every)
        join((all_, low, all_), (all_, high, all_), d, every)
        if self.connectivity == 8:
            corner_a, corner_b = free[:, low, high], free[:, high, low]
            join((all_, low, low), (all_, high, high), d * math.sqrt(2), corner_a & corner_b)
            corner_a, corner_b = free[:, low, low], free[:, high, high]
            join((all_, low, high), (all_, high, low), d * math.sqrt(2), corner_a & corner_b)
        flat, link_cost = self.links
        flat = np.sort(flat[: len(flat) // 2], axis=1)
        order = np.lexsort((link_cost[: len(flat)], flat[:, 1], flat[:, 0]))
        flat, first = np.unique(flat[order], axis=0, return_index=True)
        ends.append((flat[:, 0], flat[:, 1], link_cost[order[first]]))
        a, b, weight = (np.concatenate(part) for part in zip(*ends, strict=True))
        return a, b, weight

    def to_rustworkx(self) -> rustworkx.PyGraph[int, float]:
        """Write the graph out for rustworkx.

        Returns
        -------
        graph
            Undirected; node k is the cell with flat index k, also if it has no edges; the weight of
            an edge is its cost, as in `edges`. Blocked cells have no edges.
        """
        return rustworkx_of(self.cost.size, self.edges())

    def to_networkx(self) -> networkx.Graph[Cell]:
        """Write the graph out for networkx.

        Returns
        -------
        graph
            Nodes are cells with `kind` and `pos` (metres); the `weight` of an edge is its cost, as in `edges`.
        """
        cells = [Cell(*cell) for cell in np.ndindex(*self.frame.shape)]
        kinds, centers = self.kinds.ravel().tolist(), self.frame.centers_of(np.array(cells)).tolist()
        nodes = (
            (cell, {"kind": NodeKind(kind).name.lower(), "pos": tuple(center)})
            for cell, kind, center in zip(cells, kinds, centers, strict=True)
        )
        return networkx_of(nodes, self.edges())


def _is_door(entry: Placed, global_id: str) -> bool:
    """Tell whether an entry is a door closed since; obstacles may bear the same GlobalId."""
    return entry.global_id == global_id and entry.obstacle.rule == _CLOSED


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array


def _owned(array: ArrayLike, dtype: DTypeLike) -> NDArray[Any]:
    """Return a private, read-only copy of an array; of one that is its own and read-only, itself."""
    if isinstance(array, np.ndarray) and array.dtype == dtype and array.flags.owndata and not array.flags.writeable:
        return array
    return _frozen(np.array(array, dtype=dtype))


@overload
def build_graph(
    environment: IndoorEnvironment,
    *,
    cell_size: float = ...,
    connectivity: Literal[4, 8] = ...,
    refine: Literal["auto"] | None = ...,
    on_conflict: Literal["approach", "reach"] = ...,
    objective: Objective = ...,
    clearance: float = ...,
    adaptive: Literal[False] = ...,
) -> NavGraph: ...


@overload
def build_graph(
    environment: IndoorEnvironment,
    *,
    cell_size: float = ...,
    connectivity: Literal[4, 8] = ...,
    refine: Literal["auto"] | None = ...,
    on_conflict: Literal["approach", "reach"] = ...,
    objective: Objective = ...,
    clearance: float = ...,
    adaptive: Literal[True],
) -> AdaptiveGraph: ...


def build_graph(
    environment: IndoorEnvironment,
    *,
    cell_size: float = 0.3048,
    connectivity: Literal[4, 8] = 4,
    refine: Literal["auto"] | None = None,
    on_conflict: Literal["approach", "reach"] = "approach",
    objective: Objective = "distance",
    clearance: float = 0.0,
    adaptive: bool = False,
) -> NavGraph | AdaptiveGraph:
    """Cut an environment into cells, and join its storeys by the connectors its robot can use.

    Parameters
    ----------
    environment
        What blocks, what is floor, what to visit.
    cell_size
        Edge of a cell in metres; 0.3048 is the paper's foot.
    connectivity
        Neighbors of a cell, 4 or 8.
    refine
        `auto` halves the cells until no target lies on an obstacle cell that smaller cells would clear.
    on_conflict
        `approach`: such a target is served from the nearest safe standing cell. `reach`: its cell is
        kept reachable, as in the paper.
    objective
        What paths make least: `distance`, `time` or `energy`.
    clearance
        Distance from obstacles that paths prefer, metres, beyond the robot's radius; `with_clearance`.
    adaptive
        Whether to join cells in open space to larger squares: an explicit graph of far fewer nodes, see
        `AdaptiveGraph`. Its `graph` is the fine one.

    Raises
    ------
    NothingWalkableError
        If no storey has floor.
    GridTooLargeError
        If the cells would be too many; the message names a size that fits.
    """
    _checks.need("environment", environment, IndoorEnvironment)
    clearance = _checks.number("clearance", clearance, 0)
    if refine not in (None, "auto"):
        raise ValueRangeError(f"refine is {refine!r}.", "Give 'auto' or None.")
    if on_conflict not in ("approach", "reach"):
        raise ValueRangeError(f"on_conflict is {on_conflict!r}.", "Give 'approach' or 'reach'.")
    cells = cut(environment, cell_size, on_conflict)
    while refine and any(c.curable for c in cells.conflicts) and cells.frame.cell_size / 2 >= FINEST:
        cells = cut(environment, cells.frame.cell_size / 2, on_conflict)
    frame, cost, obstacle, floor, targets, conflicts = cells
    for array in (cost, obstacle, floor):
        _frozen(array)
    connectors, refused = join_connectors(environment, frame, np.isfinite(cost))
    graph = NavGraph(
        frame, cost, obstacle, floor, connectivity, environment, targets, conflicts, on_conflict, connectors, refused,
        objective,
    )  # fmt: skip
    if clearance:
        graph = graph.with_clearance(clearance)
    if adaptive:
        from bimnav.adaptive import adaptive_graph

        return adaptive_graph(graph)
    return graph
