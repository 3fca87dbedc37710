"""The navigation graph: what every cell is for, what it costs, and what joins it to its neighbors.

The graph is implicit: arrays over the cells of a frame. `to_rustworkx` and `to_networkx` write it out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from bimnav.errors import GridError, NothingWalkableError, OutsideMapError, ValueRangeError
from bimnav.grid import EROSION, Cell, GridFrame, cells_within, rasterize
from bimnav.stops import Stop, Unreached, standing_at, stop_at, why_not_served

if TYPE_CHECKING:
    import networkx
    import rustworkx

    from bimnav.environment import IndoorEnvironment, Target

__all__ = ["Conflict", "NavGraph", "NodeKind", "Stop", "Unreached", "build_graph"]

_FINEST = 0.01  # metres; `refine` goes no further


class NodeKind(IntEnum):
    """What a cell is for in one task."""

    REGULAR = 0
    OBSTACLE = 1
    TARGET = 2
    OUTSIDE = 3


@dataclass(frozen=True, slots=True, eq=False)
class Conflict:
    """A target whose cell is also an obstacle cell.

    Parameters
    ----------
    obstacles
        GlobalIds of the elements that touch the cell.
    curable
        Whether smaller cells would resolve it: the destination itself is clear of obstacles.
    """

    global_id: str
    name: str
    cell: Cell
    obstacles: tuple[str, ...]
    curable: bool


@dataclass(frozen=True, eq=False)
class NavGraph:
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
        Every target and the cell that holds its destination.
    conflicts
        Targets whose cell is also an obstacle cell.
    on_conflict
        What becomes of them: `approach` the nearest safe standing cell, or `reach` the cell itself.
    """

    frame: GridFrame
    cost: NDArray[np.float32]
    obstacle: NDArray[np.bool_]
    floor: NDArray[np.bool_]
    connectivity: Literal[4, 8] = 4
    environment: IndoorEnvironment | None = None
    targets: tuple[tuple[Target, Cell], ...] = ()
    conflicts: tuple[Conflict, ...] = ()
    on_conflict: Literal["approach", "reach"] = "approach"

    def __post_init__(self) -> None:
        if self.connectivity not in (4, 8):
            raise ValueRangeError(f"connectivity is {self.connectivity}.", "Give 4 or 8.")
        for name, dtype in (("cost", np.float32), ("obstacle", np.bool_), ("floor", np.bool_)):
            array = np.array(getattr(self, name), dtype=dtype)
            if array.shape != self.frame.shape:
                raise GridError(f"{name} is {array.shape}, the frame is {self.frame.shape}.")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if np.isnan(self.cost).any() or (self.cost < 1).any():
            raise ValueRangeError("a cost is below 1 or not a number.", "Give multipliers of at least 1, or inf.")

    @classmethod
    def from_mask(cls, free: ArrayLike, *, cell_size: float = 1.0, connectivity: Literal[4, 8] = 8) -> NavGraph:
        """Make a graph from a mask of free cells, without a building.

        Parameters
        ----------
        free : (rows, cols) or (storeys, rows, cols) bool
            True where a robot can be; row 0 is the lowest y.
        cell_size
            Edge of a cell in metres.
        connectivity
            4 or 8.
        """
        mask = np.asarray(free, dtype=np.bool_)
        if mask.ndim == 2:
            mask = mask[None]
        if mask.ndim != 3 or not mask.size:
            raise GridError(f"a mask of shape {np.shape(free)} is no grid.", "Give (storeys, rows, cols).")
        heights = tuple(3.0 * storey for storey in range(mask.shape[0]))
        frame = GridFrame(cell_size, 0, 0, mask.shape[1], mask.shape[2], heights)
        cost = np.where(mask, np.float32(1), np.float32(np.inf))
        return cls(frame, cost, ~mask, np.ones_like(mask), connectivity)

    def __repr__(self) -> str:
        storeys, rows, cols = self.frame.shape
        counts = ", ".join(f"{count} {kind.name.lower()}" for kind, count in self.counts.items())
        return f"NavGraph({storeys} x {rows} x {cols} cells of {self.frame.cell_size:g} m: {counts})"

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
        from scipy import ndimage

        cross = np.zeros((3, 3, 3), dtype=np.bool_)
        cross[1, 1, :] = cross[1, :, 1] = True
        labels: NDArray[np.int32] = ndimage.label(self.free, structure=cross)[0].astype(np.int32)
        labels.flags.writeable = False
        return labels

    @cached_property
    def stops(self) -> tuple[Stop, ...]:
        """Where a robot goes for every target that has a place to go to, whichever part it lies in."""
        return self.stops_from(None)[0]

    def stops_from(self, start: Cell | None) -> tuple[tuple[Stop, ...], tuple[Unreached, ...]]:
        """Return where a robot goes for every target, and the targets it cannot serve from a start.

        A target whose cell is blocked is served from the nearest cell, within three metres, that the
        robot can reach and from which no wall stands in the way.

        Parameters
        ----------
        start
            Cell the robot comes from; None for anywhere.
        """
        component = None if start is None else int(self.components[start])
        stops: list[Stop] = []
        unreached: list[Unreached] = []
        for target, cell in self.targets:
            stop = stop_at(self, target, cell) or standing_at(self, target, component)
            if stop is None:
                reason = why_not_served(self, target, cell)
            elif component is not None and self.components[stop.cell] != component:
                reason = "no way from the start: its cell lies in another part of the building"
            else:
                stops.append(stop)
                continue
            unreached.append(Unreached(target.global_id, target.name, target.destination, reason, cell))
        return tuple(stops), tuple(unreached)

    def block(self, cells: Iterable[Cell]) -> Self:
        """Return the graph with cells closed."""
        cost, obstacle = self.cost.copy(), self.obstacle.copy()
        for cell in cells:
            if cell not in self.frame:
                raise GridError(f"{cell} is not a cell of a frame of shape {self.frame.shape}.")
            cost[cell], obstacle[cell] = np.inf, True
        return replace(self, cost=cost, obstacle=obstacle)

    def with_cost(self, factor: ArrayLike) -> Self:
        """Return the graph with other costs; what is blocked stays blocked.

        Parameters
        ----------
        factor : anything that fits (storeys, rows, cols)
            Multiplier of the length of a step, at least 1; inf closes a cell.
        """
        cost = np.broadcast_to(np.asarray(factor, dtype=np.float32), self.frame.shape)
        return replace(self, cost=np.where(self.free, cost, np.float32(np.inf)))

    def edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Return all edges once: flat indexes of their two cells, and their cost in metres.

        A flat index counts cells in the order of the arrays. The cost of a step is its length times
        the mean of the two cells' multipliers.
        """
        index = np.arange(self.cost.size).reshape(self.frame.shape)
        free, cost = self.free, self.cost.astype(np.float64)
        ends: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]] = []

        def join(
            a: tuple[slice, ...], b: tuple[slice, ...], length: float, open_: NDArray[np.bool_] | np.bool_
        ) -> None:
            keep = free[a] & free[b] & open_
            ends.append((index[a][keep], index[b][keep], length * (cost[a][keep] + cost[b][keep]) / 2))

        d, all_, low, high = self.frame.cell_size, slice(None), slice(None, -1), slice(1, None)
        every = np.True_
        join((all_, all_, low), (all_, all_, high), d, every)
        join((all_, low, all_), (all_, high, all_), d, every)
        if self.connectivity == 8:
            corner_a, corner_b = free[:, low, high], free[:, high, low]
            join((all_, low, low), (all_, high, high), d * math.sqrt(2), corner_a & corner_b)
            corner_a, corner_b = free[:, low, low], free[:, high, high]
            join((all_, low, high), (all_, high, low), d * math.sqrt(2), corner_a & corner_b)
        a, b, weight = (np.concatenate(part) for part in zip(*ends, strict=True))
        return a, b, weight

    def to_rustworkx(self) -> rustworkx.PyGraph[int, float]:
        """Write the graph out for rustworkx.

        Returns
        -------
        graph
            Undirected; node k is the cell with flat index k, also if it has no edges; the weight of
            an edge is its cost in metres. Blocked cells have no edges.
        """
        return self._explicit.copy()

    @cached_property
    def _explicit(self) -> rustworkx.PyGraph[int, float]:
        import rustworkx

        a, b, weight = self.edges()
        graph: rustworkx.PyGraph[int, float] = rustworkx.PyGraph(multigraph=False)
        graph.add_nodes_from(range(self.cost.size))
        graph.add_edges_from(list(zip(a.tolist(), b.tolist(), weight.tolist(), strict=True)))
        return graph

    def to_networkx(self) -> networkx.Graph[Cell]:
        """Write the graph out for networkx.

        Returns
        -------
        graph
            Nodes are cells with `kind` and `pos` (metres); the `weight` of an edge is its cost in metres.
        """
        try:
            import networkx
        except ImportError as error:
            from bimnav.errors import MissingExtraError

            hint = "pip install 'bimnav[networkx]'"
            raise MissingExtraError("to_networkx needs networkx.", hint) from error
        graph: networkx.Graph[Cell] = networkx.Graph()
        cells = [Cell(*cell) for cell in np.ndindex(*self.frame.shape)]
        kinds = self.kinds.ravel()
        centers = self.frame.centers_of(np.array(cells))
        for cell, kind, center in zip(cells, kinds.tolist(), centers.tolist(), strict=True):
            graph.add_node(cell, kind=NodeKind(kind).name.lower(), pos=tuple(center))
        a, b, weight = self.edges()
        graph.add_weighted_edges_from(
            (cells[i], cells[j], w) for i, j, w in zip(a.tolist(), b.tolist(), weight.tolist(), strict=True)
        )
        return graph


def build_graph(
    environment: IndoorEnvironment,
    *,
    cell_size: float = 0.3048,
    connectivity: Literal[4, 8] = 4,
    refine: Literal["auto"] | None = None,
    on_conflict: Literal["approach", "reach"] = "approach",
) -> NavGraph:
    """Cut an environment into cells.

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

    Raises
    ------
    NothingWalkableError
        If no storey has floor.
    GridTooLargeError
        If the cells would be too many; the message names a size that fits.
    """
    if refine not in (None, "auto"):
        raise ValueRangeError(f"refine is {refine!r}.", "Give 'auto' or None.")
    if on_conflict not in ("approach", "reach"):
        raise ValueRangeError(f"on_conflict is {on_conflict!r}.", "Give 'approach' or 'reach'.")
    graph = _build(environment, cell_size, connectivity, on_conflict)
    while refine and any(c.curable for c in graph.conflicts) and graph.frame.cell_size / 2 >= _FINEST:
        graph = _build(environment, graph.frame.cell_size / 2, connectivity, on_conflict)
    return graph


def _build(
    environment: IndoorEnvironment,
    cell_size: float,
    connectivity: Literal[4, 8],
    on_conflict: Literal["approach", "reach"],
) -> NavGraph:
    floors = [environment.floor(storey) for storey in range(len(environment.levels))]
    bounds = np.array([floor.bounds for floor in floors if not floor.is_empty])
    if not len(bounds):
        raise NothingWalkableError(
            f"{environment.building.name!r} has no floor that robot {environment.robot.name!r} could stand on.",
            "Use a smaller robot." if environment.regions else "No space, slab or wall of it has a shape.",
        )
    frame = GridFrame.covering(
        (*bounds[:, :2].min(axis=0), *bounds[:, 2:].max(axis=0)),
        cell_size,
        elevations=environment.levels,
        ground=environment.ground,
    )
    obstacle = np.zeros(frame.shape, dtype=np.bool_)
    walkable = np.zeros(frame.shape, dtype=np.bool_)
    cost = np.ones(frame.shape, dtype=np.float32)
    for storey, floor in enumerate(floors):
        if floor.is_empty:
            continue
        walkable[storey] = cells_within(frame, floor)
        obstacle[storey] = rasterize(frame, [body for _, body in environment.bodies_on(storey)])
        for zone in environment.zones:
            if zone.storey == storey:
                touched = rasterize(frame, zone.polygon)
                cost[storey][touched] = np.maximum(cost[storey][touched], np.float32(zone.factor))
    cost[obstacle | ~walkable] = np.inf
    targets = tuple(_targets_in(frame, environment))
    conflicts = tuple(_conflict(frame, environment, target, cell) for target, cell in targets if obstacle[cell])
    if on_conflict == "reach":
        for conflict in conflicts:
            cost[conflict.cell] = 1
    return NavGraph(frame, cost, obstacle, walkable, connectivity, environment, targets, conflicts, on_conflict)


def _targets_in(frame: GridFrame, environment: IndoorEnvironment) -> Iterable[tuple[Target, Cell]]:
    for target in environment.targets:
        x, y, _ = target.destination
        try:
            yield target, frame.cell_at(x, y, storey=target.storey)
        except OutsideMapError as error:
            raise OutsideMapError(
                f"target {target.name!r} ({target.global_id}) at ({x:.3f}, {y:.3f}) lies outside the map.",
                error.hint,
                {"global_id": target.global_id, "name": target.name, "x": x, "y": y},
            ) from error


def _conflict(frame: GridFrame, environment: IndoorEnvironment, target: Target, cell: Cell) -> Conflict:
    x0, y0, x1, y1 = frame.box_of(cell)
    box = shapely.box(x0 + EROSION, y0 + EROSION, x1 - EROSION, y1 - EROSION)
    touching = [(o, body) for o, body in environment.bodies_on(cell.storey) if body.intersects(box)]
    point = shapely.Point(target.destination[:2])
    return Conflict(
        target.global_id,
        target.name,
        cell,
        tuple(dict.fromkeys(obstacle.global_id for obstacle, _ in touching)),
        curable=all(body.distance(point) > _FINEST for _, body in touching),
    )
