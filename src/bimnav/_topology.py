"""Which rooms, doors and connectors lead to which: the map of a building that people carry in their heads."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from bimnav import _checks
from bimnav._why import FIXED
from bimnav.errors import InputError, NothingWalkableError

if TYPE_CHECKING:
    import rustworkx
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment, Region
    from bimnav.graph import NavGraph

__all__ = ["Node", "Topology", "topology"]

_JOINT = 0.05  # metres; floors up to twice as far apart are one floor
_LEAST = 0.1  # metres that two floors must touch along
_WAYS = ("door", "passage")


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node of a topology.

    Parameters
    ----------
    kind
        `space` for any floor: a room, or a slab where there are no rooms; `door`, also for a passage that
        nothing fills; or `stair`, `ramp`, `lift`.
    storey
        Index of the storey; of a connector, of its lower end.
    point : (x, y, z)
        Its middle, world metres.
    """

    kind: Literal["space", "door", "stair", "ramp", "lift"]
    global_id: str
    name: str
    storey: int
    point: tuple[float, float, float]

    def __repr__(self) -> str:
        return f"Node({self.kind} {self.name or self.global_id!r})"


@dataclass(frozen=True, eq=False)
class Topology:
    """Rooms, doors and connectors, and which of them lead to which.

    Parameters
    ----------
    places
        The nodes: node k of the graph is place k.
    edges : (n, 2) int64
        Which places touch, each pair once.
    lengths : (n,) float64
        Straight from middle to middle, metres; half the length of a connector to either end of it.
    """

    places: tuple[Node, ...]
    edges: NDArray[np.int64]
    lengths: NDArray[np.float64]
    regions: tuple[Region | None, ...]

    def __repr__(self) -> str:
        kinds = [place.kind for place in self.places]
        return f"Topology({', '.join(f'{kinds.count(kind)} {kind}s' for kind in dict.fromkeys(kinds))})"

    @cached_property
    def _graph(self) -> rustworkx.PyGraph[Node, float]:
        import rustworkx

        graph: rustworkx.PyGraph[Node, float] = rustworkx.PyGraph()
        graph.add_nodes_from(self.places)
        ends, lengths = self.edges.tolist(), self.lengths.tolist()
        graph.add_edges_from([(a, b, length) for (a, b), length in zip(ends, lengths, strict=True)])
        return graph

    def to_rustworkx(self) -> rustworkx.PyGraph[Node, float]:
        """Return an undirected graph of places, its edges weighted with metres."""
        return self._graph.copy()

    def place_at(self, x: float, y: float, storey: int) -> Node | None:
        """Return the room or door at a point of a storey, metres; else the nearest within a metre."""
        found = self._number_at(x, y, storey)
        return None if found is None else self.places[found]

    def _number_at(self, x: float, y: float, storey: int) -> int | None:
        point = shapely.Point(_checks.number("x", x), _checks.number("y", y))
        here = [
            (region.polygon.distance(point), k)
            for k, region in enumerate(self.regions)
            if region is not None and region.storey == storey
        ]
        distance, number = min(here, default=(np.inf, -1))
        return number if distance <= 1.0 else None

    def route(
        self, start: tuple[float, float, int], goal: tuple[float, float, int], *, closed: Collection[str] = ()
    ) -> tuple[Node, ...] | None:
        """Return the places on a short way from point to point, `(x, y, storey)` each.

        Lengths are those between middles, so this is the way people would describe, not a shortest path.

        Parameters
        ----------
        closed
            GlobalIds of doors and connectors not to take.

        Returns
        -------
        places
            From the room of the start to that of the goal; None if the topology shows no way.
        """
        import rustworkx

        for name, place in (("start", start), ("goal", goal)):
            _checks.point(name, place)
        begin, end = self._number_at(*start), self._number_at(*goal)
        if begin is None or end is None:
            return None
        kept = [k for k, place in enumerate(self.places) if place.global_id not in closed or k in (begin, end)]
        number = {k: i for i, k in enumerate(kept)}
        found = rustworkx.dijkstra_shortest_paths(self._graph.subgraph(kept), number[begin], number[end], float)
        nodes = list(found[number[end]]) if number[end] in found else [0] * (begin == end)
        if begin == end:
            return (self.places[begin],)
        return tuple(self.places[kept[node]] for node in nodes) or None

    def along(self, points: ArrayLike) -> tuple[Node, ...]:
        """Return the doors and connectors that a polyline, (n, 3) metres, passes, in its order."""
        line = _checks.numbers("points", points)
        if line.size and (line.ndim != 2 or line.shape[1] != 3):
            raise InputError(f"points is of shape {line.shape}.", "Give (n, 3) metres.")
        line = line.reshape(-1, 3)
        passed: list[tuple[float, int]] = []
        for k, (place, region) in enumerate(zip(self.places, self.regions, strict=True)):
            if place.kind == "space":
                continue
            passed += [(at, k) for at in self._where(line, place, region)]
        return tuple(self.places[k] for _, k in sorted(passed))

    def _where(self, line: NDArray[np.float64], place: Node, region: Region | None) -> Iterator[float]:
        """Yield the number of the piece of a polyline that enters a door or passes the middle of a connector."""
        if len(line) < 2:
            return
        if region is None:
            near = np.abs(line - place.point).max(axis=1) <= _JOINT
            yield from np.flatnonzero(near)[:1].tolist()
            return
        flat = np.abs(line[:, 2] - place.point[2]) <= _JOINT
        pieces = shapely.linestrings(np.stack([line[:-1, :2], line[1:, :2]], axis=1))
        # what only brushes the end of a doorway does not pass it
        inner = shapely.buffer(region.polygon, -min(_JOINT, 0.2 * shapely.minimum_clearance(region.polygon)))
        inside = shapely.intersects(pieces, inner if not inner.is_empty else region.polygon)
        inside &= flat[:-1] & flat[1:]
        yield from np.flatnonzero(inside & ~np.append(False, inside[:-1])).tolist()


def topology(graph: NavGraph) -> Topology:
    """Join the rooms, doors and connectors of a graph's environment.

    Two places touch where their floors do; a connector touches the floors at its ends. Furniture does not
    matter here, and neither does the size of the robot, but for the connectors it can use.

    Raises
    ------
    NothingWalkableError
        If the graph was made from a mask.
    """
    _checks.need("graph", graph, "NavGraph")
    environment = graph.environment
    if environment is None:
        raise NothingWalkableError("the graph was made from a mask; it has no rooms and doors.")
    places, regions = [], []
    for region in environment.regions:
        x, y = shapely.get_coordinates(shapely.point_on_surface(region.polygon))[0].tolist()
        kind: Literal["door", "space"] = "door" if region.source in _WAYS else "space"
        level = environment.levels[region.storey]
        places.append(Node(kind, region.global_id, region.name, region.storey, (x, y, level)))
        regions.append(region)
    edges = list(_touching(environment))
    lengths = [float(np.linalg.norm(np.subtract(places[a].point, places[b].point))) for a, b in edges]
    known: list[Region | None] = list(regions)
    for link in graph.connectors:
        points = link.points
        x, y, z = points[len(points) // 2].tolist()
        number = len(places)
        ends = [(points[0, :2], link.begin.storey), (points[-1, :2], link.end.storey)]
        for (px, py), storey in ends:
            point = shapely.Point(px, py)
            here = [(r.polygon.distance(point), k) for k, r in enumerate(regions) if r.storey == storey]
            if here:
                edges.append((min(here)[1], number))
                lengths.append(link.length / 2)
        places.append(Node(link.kind, link.global_id, link.name, link.begin.storey, (x, y, z)))
        known.append(None)
    return Topology(
        tuple(places), np.array(edges, dtype=np.int64).reshape(-1, 2), np.array(lengths, dtype=np.float64), tuple(known)
    )


def _touching(environment: IndoorEnvironment) -> Iterator[tuple[int, int]]:
    """Yield the numbers of regions whose floors touch where no wall stands."""
    regions = environment.regions
    grown: list[BaseGeometry] = [shapely.buffer(r.polygon, _JOINT, join_style="mitre") for r in regions]
    walls = [o for o in environment.obstacles if o.ifc_class.startswith(FIXED)]
    tree, standing = shapely.STRtree(grown), shapely.STRtree([wall.footprint for wall in walls])
    for a, b in np.unique(np.sort(tree.query(grown, predicate="intersects").T, axis=1), axis=0).tolist():
        storey = regions[a].storey
        if a == b or storey != regions[b].storey:
            continue
        common = grown[a].intersection(grown[b])
        near = [walls[k] for k in standing.query(common).tolist()]
        left = common.difference(shapely.union_all([wall.footprint for wall in near if wall.storey == storey]))
        if left.area >= 2 * _JOINT * _LEAST:  # a strip twice the joint wide
            yield a, b
