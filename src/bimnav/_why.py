"""Why no route leads from one cell to another: what would have to go, or by how much the way is too narrow."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Literal, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks, search
from bimnav._changes import cells_under
from bimnav.errors import OutsideMapError
from bimnav.graph import NavGraph, build_graph
from bimnav.grid import Cell

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment

__all__ = ["FIXED", "NoRoute", "why_unreachable"]

FIXED = (
    "IfcWall",
    "IfcCurtainWall",
    "IfcPlate",
    "IfcMember",
    "IfcWindow",
    "IfcColumn",
    "IfcSlab",
    "IfcRoof",
    "IfcStair",
    "IfcRailing",
)
"""How classes of elements begin that nobody moves out of the way."""

_EASY, _UNFIT, _STRUCTURE, _NO_FLOOR = 1.0, 3.0, 30.0, 100.0  # prices; one wall is dearer than much furniture
_MOST_CELLS = 4_000_000  # with more the question costs more than its answer is worth
_MOST_STATES = 50_000
_FINE = 0.05  # metres; cells in which the width of a way is looked for
_NEAR_ENTRY = 1.0  # metres from the entry of a stair to the floor it leads from
_SAME_LEVEL = 0.35  # metres between the height of that entry and of that floor
_TOUCHES = 0.01  # metres from a narrow place to what makes it narrow
_PROVED = 1e-6  # metres


@dataclass(frozen=True, slots=True)
class NoRoute:
    """Why there is no route.

    Parameters
    ----------
    reason
        `blocked`: by things or doors that can be moved or opened, or by cells that were closed. `climb`: the
        way leads over a stair, ramp or lift that the robot does not use. `narrow`: the robot is too wide.
        `cells`: the cells are too large to show the way. `apart`: nothing but walls, or no floor, lies between.
    message
        The same in words, with names and numbers.
    global_ids
        The elements: the cheapest set found whose removal, opening or use would open a route; of a narrow
        way, those at its sides.
    width
        Clear width of the widest way for anything as high as the robot, metres; None if it was not measured.
    shortage
        How much wider it would have to be, metres; 0 if it is wide enough or was not measured.
    point : (x, y, z), metres
        Where it is narrowest, or None.
    """

    reason: Literal["blocked", "climb", "narrow", "cells", "apart"]
    message: str
    global_ids: tuple[str, ...] = ()
    width: float | None = None
    shortage: float = 0.0
    point: tuple[float, float, float] | None = None


def why_unreachable(graph: NavGraph, start: Cell, goal: Cell) -> NoRoute | None:
    """Say why no route leads from one free cell to another.

    What would have to go is found by a search in which every obstacle has a price that is paid once,
    however many cells it covers: furniture and doors little, connectors that the robot cannot use more,
    walls much (see Hauser, The minimum constraint removal problem with three robotics applications,
    IJRR 2014; dominated sets are dropped, so the set is a cheapest one). How wide the way is without the
    robot's body is measured at its narrowest place between exact footprints.

    Parameters
    ----------
    graph
        Graph to search.
    start, goal
        Free cells.

    Returns
    -------
    why
        None if a route leads there.

    Raises
    ------
    OutsideMapError
        If a cell is not one of the graph's.
    """
    _checks.need("graph", graph, NavGraph)
    start, goal = Cell(*_checks.cell("start", start)), Cell(*_checks.cell("goal", goal))
    for role, cell in (("start", start), ("goal", goal)):
        if cell not in graph.frame:
            raise OutsideMapError(f"{role} {cell} lies outside the map.", "`graph.frame.cell_at` finds cells.")
    if graph.components[start] == graph.components[goal] and graph.free[start]:
        return None
    found = _cheapest(graph, start, goal) if graph.cost.size <= _MOST_CELLS else None
    barriers = found or []
    is_easy = bool(barriers) and all(barrier.price < _STRUCTURE for barrier in barriers)
    if graph.environment is not None and all(barrier.is_body for barrier in barriers):
        narrow = _narrow(graph, graph.environment, start, goal)
        if narrow is not None and (not is_easy or narrow.reason == "cells"):
            return narrow
        if narrow is not None:
            blocked = _blocked(barriers)
            message = f"{blocked.message}; beside it the way is {100 * narrow.shortage:.0f} cm too narrow"
            return replace(narrow, reason="blocked", message=message, global_ids=blocked.global_ids)
    return _blocked(barriers) if is_easy else _apart(graph, start, goal, barriers)


class _Barrier(NamedTuple):
    """What keeps cells closed."""

    global_id: str
    name: str
    price: float
    is_body: bool = True  # of an element, grown by the robot's radius
    why: str = ""

    @property
    def label(self) -> str:
        return f"{self.name} ({self.global_id})" if self.global_id else self.name


def _blocked(barriers: Sequence[_Barrier]) -> NoRoute:
    ids = tuple(dict.fromkeys(barrier.global_id for barrier in barriers if barrier.global_id))
    unfit = [barrier for barrier in barriers if barrier.why]
    if unfit:
        text = "; ".join(f"{barrier.label}: {barrier.why}" for barrier in unfit)
        others = [barrier.label for barrier in barriers if not barrier.why]
        rest = f", past {', '.join(others)}" if others else ""
        return NoRoute("climb", f"the way leads over {text}{rest}", ids)
    return NoRoute("blocked", f"blocked by {', '.join(barrier.label for barrier in barriers)}", ids)


def _apart(graph: NavGraph, start: Cell, goal: Cell, barriers: Sequence[_Barrier]) -> NoRoute:
    elements = [barrier for barrier in barriers if barrier.global_id]
    if elements and all(barrier.price < _NO_FLOOR for barrier in barriers):
        text = f"no door or passage leads past {', '.join(b.label for b in elements if b.price >= _STRUCTURE)}"
        others = [barrier for barrier in barriers if barrier.price < _STRUCTURE]
        text += f", and {_blocked(others).message}" if others else ""
        return NoRoute("apart", text, tuple(dict.fromkeys(barrier.global_id for barrier in elements)))
    if start.storey != goal.storey:
        return NoRoute("apart", "no stair, ramp or lift that was found joins their storeys")
    sizes = [int((graph.components == graph.components[cell]).sum()) for cell in (start, goal)]
    return NoRoute("apart", f"no floor joins the {sizes[0]} cells around the one and the {sizes[1]} around the other")


def _cheapest(graph: NavGraph, start: Cell, goal: Cell) -> list[_Barrier] | None:
    """Return the barriers of the cheapest way from cell to cell, in the order one comes to them."""
    map_ = _maps.get(graph)
    if map_ is None:
        map_ = _maps[graph] = _Map(graph)
    return map_.cheapest(start, goal)


class _Map:
    """The cells of a graph joined to regions that are closed by the same barriers."""

    def __init__(self, graph: NavGraph) -> None:
        self.frame = graph.frame
        self.barriers: list[_Barrier] = []
        self._numbers: dict[str, int] = {}
        self._sets: list[frozenset[int]] = [frozenset()]
        self._index = {self._sets[0]: 0}
        ids = np.zeros(graph.cost.size, dtype=np.int32)
        for barrier, cells in _closures(graph):
            self._close(ids, barrier, cells)
        ids[graph.free.ravel()] = 0
        closed = np.flatnonzero((ids == 0) & ~graph.free.ravel())
        on_floor = graph.floor.ravel()[closed]
        price = _NO_FLOOR if graph.environment is None else _EASY  # a mask does not tell walls from other things
        self._close(ids, _Barrier("", "cells that were closed", price, is_body=False), closed[on_floor])
        self._close(ids, _Barrier("", "where there is no floor", _NO_FLOOR), closed[~on_floor])
        self.regions, self._neighbors = _regions(ids.reshape(graph.frame.shape))
        first = np.unique(self.regions.ravel(), return_index=True)[1]
        self._of_region = ids[first].tolist()
        for a, b in graph.links[0].tolist():
            self._join(self.regions.flat[a], self.regions.flat[b], None)
        if graph.environment is not None:
            self._join_refused(graph, graph.environment)

    def _number(self, barrier: _Barrier) -> int:
        key = f"{barrier.global_id}, not used" if barrier.why else barrier.global_id or barrier.name
        if key not in self._numbers:
            self._numbers[key] = len(self.barriers)
            self.barriers.append(barrier)
        return self._numbers[key]

    def _close(self, ids: NDArray[np.int32], barrier: _Barrier, cells: NDArray[np.int64]) -> None:
        """Add a barrier to the sets of some cells."""
        number = self._number(barrier)
        olds, inverse = np.unique(ids[cells], return_inverse=True)
        news = []
        for old in olds.tolist():
            wider = self._sets[old] | {number}
            if wider not in self._index:
                self._index[wider] = len(self._sets)
                self._sets.append(wider)
            news.append(self._index[wider])
        ids[cells] = np.array(news, dtype=np.int32)[inverse] if news else 0

    def _join(self, a: int, b: int, barrier: int | None) -> None:
        self._neighbors.setdefault(int(a), []).append((int(b), barrier))
        self._neighbors.setdefault(int(b), []).append((int(a), barrier))

    def _join_refused(self, graph: NavGraph, environment: IndoorEnvironment) -> None:
        """Join the floors at the ends of connectors that the robot does not use."""
        reasons = {refused.global_id: refused for refused in graph.refused_connectors}
        for ascent in environment.building.ascents:
            if ascent.global_id not in reasons:
                continue
            why = reasons[ascent.global_id].reason
            name = f"{ascent.kind} {ascent.name}".strip()
            number = self._number(_Barrier(ascent.global_id, name, _UNFIT, is_body=False, why=why))
            places = [place for entry in ascent.entries if (place := self._floor_at(graph, entry)) is not None]
            for place in places[1:]:
                self._join(places[0], place, number)

    def _floor_at(self, graph: NavGraph, entry: Sequence[float]) -> int | None:
        """Return the region of the free cell nearest to where one gets on a connector."""
        x, y, z = entry
        frame, d = self.frame, self.frame.cell_size
        levels = np.abs(np.asarray(frame.elevations) - z)
        for storey in np.argsort(levels, kind="stable").tolist():
            if levels[storey] > _SAME_LEVEL:
                break
            rows, cols = np.nonzero(graph.free[storey])
            away = np.hypot((frame.first_row + rows + 0.5) * d - y, (frame.first_col + cols + 0.5) * d - x)
            if len(away) and away.min() <= _NEAR_ENTRY:
                k = int(away.argmin())
                return int(self.regions[storey, rows[k], cols[k]])
        return None

    def cheapest(self, start: Cell, goal: Cell) -> list[_Barrier] | None:
        begin, end = int(self.regions[start]), int(self.regions[goal])
        order = count()
        empty: tuple[int, ...] = ()
        heap: list[tuple[float, int, int, tuple[int, ...]]] = [(0.0, next(order), begin, empty)]
        best: dict[int, list[frozenset[int]]] = {}
        for _ in range(_MOST_STATES):
            if not heap:
                break
            price, _, region, paid = heapq.heappop(heap)
            if region == end:
                return [self.barriers[number] for number in paid]
            have = frozenset(paid)
            if any(other <= have for other in best.get(region, ())):
                continue
            best.setdefault(region, []).append(have)
            for other, barrier in self._neighbors.get(region, ()):
                asked = self._sets[self._of_region[other]] | (set() if barrier is None else {barrier})
                new = tuple(sorted(asked - have))
                further = price + sum(self.barriers[number].price for number in new)
                wider = have | asked
                if not any(known <= wider for known in best.get(other, ())):
                    heapq.heappush(heap, (further, next(order), other, (*paid, *new)))
        return None


_maps: WeakKeyDictionary[NavGraph, _Map] = WeakKeyDictionary()


def _closures(graph: NavGraph) -> Iterable[tuple[_Barrier, NDArray[np.int64]]]:
    """Yield what closes cells, and which."""
    environment = graph.environment
    if environment is None:
        for placed in graph.changes.placed:
            yield _Barrier(placed.global_id, placed.obstacle.name, _EASY), placed.cells
    else:
        for storey in range(len(environment.levels)):
            for obstacle, body in environment.bodies_on(storey):
                price = _STRUCTURE if obstacle.ifc_class.startswith(FIXED) else _EASY
                is_body = not obstacle.ifc_class.startswith("IfcDoor")
                name = obstacle.name or obstacle.ifc_class
                barrier = _Barrier(obstacle.global_id, name, price, is_body)
                yield barrier, cells_under(graph.frame, storey, body)
        for zone in environment.zones:
            if zone.factor == math.inf:
                barrier = _Barrier(zone.global_id, f"the restricted zone {zone.name}", _EASY, is_body=False)
                yield barrier, cells_under(graph.frame, zone.storey, zone.polygon)
    yield _Barrier("", "cells that were blocked", _EASY, is_body=False), graph.changes.blocked


def _regions(ids: NDArray[np.int32]) -> tuple[NDArray[np.int32], dict[int, list[tuple[int, int | None]]]]:
    """Number the connected regions of equal values, and list which touch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    index = np.arange(ids.size).reshape(ids.shape)
    pairs = [(index[:, :, :-1], index[:, :, 1:]), (index[:, :-1], index[:, 1:])]
    a, b = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    same = ids.ravel()[a] == ids.ravel()[b]
    joined = coo_array((np.ones(int(same.sum()), dtype=np.int8), (a[same], b[same])), shape=(ids.size, ids.size))
    labels = connected_components(joined, directed=False)[1].astype(np.int32)
    edges = np.unique(np.sort(np.column_stack([labels[a[~same]], labels[b[~same]]]), axis=1), axis=0)
    neighbors: dict[int, list[tuple[int, int | None]]] = {}
    for one, other in edges.tolist():
        neighbors.setdefault(one, []).append((other, None))
        neighbors.setdefault(other, []).append((one, None))
    return labels.reshape(ids.shape), neighbors


def _narrow(graph: NavGraph, environment: IndoorEnvironment, start: Cell, goal: Cell) -> NoRoute | None:
    """Measure the widest way from cell to cell for a robot without width; None if there is none."""
    robot = environment.robot
    thin = replace(environment, robot=replace(robot, radius=0.0, outline=None), targets=())
    d = graph.frame.cell_size / math.ceil(graph.frame.cell_size / _FINE - 1e-9)
    if graph.cost.size * (graph.frame.cell_size / d) ** 2 > _MOST_CELLS:
        d = graph.frame.cell_size
    fine = build_graph(thin, cell_size=d, connectivity=4)
    fine = fine.block(_fine_cells(graph, fine))
    begin, end = (fine.frame.cell_at(*graph.frame.center_of(cell)[:2], storey=cell.storey) for cell in (start, goal))
    if not fine.free[begin] or fine.components[begin] != fine.components[end]:
        return None
    place = _narrowest(fine, begin, end)
    point, width, sides = _measured(thin, fine, place)
    shortage = 2 * robot.radius - width
    x, y, _ = point
    where = f"at ({x:.2f}, {y:.2f})"
    if shortage <= _PROVED:
        size = graph.frame.cell_size
        text = f"cells of {size:g} m are too large to show the way: it is {width:.2f} m wide {where}"
        return NoRoute("cells", text, (), width, 0.0, point)
    names = " and ".join(dict.fromkeys(f"{name} ({global_id})" if global_id else name for global_id, name in sides))
    between = "between" if len(set(sides)) > 1 else "within"
    text = (
        f"too narrow by {100 * shortage:.0f} cm: the widest way is {width:.2f} m wide {where}, {between} {names}; "
        f"the robot is {2 * robot.radius:.2f} m wide"
    )
    ids = tuple(dict.fromkeys(global_id for global_id, _ in sides if global_id))
    return NoRoute("narrow", text, ids, width, shortage, point)


def _fine_cells(graph: NavGraph, fine: NavGraph) -> list[Cell]:
    """Return the fine cells in the cells that were closed."""
    storeys, rows, cols = np.unravel_index(graph.changes.blocked, graph.frame.shape)
    ratio = round(graph.frame.cell_size / fine.frame.cell_size)
    found = []
    for storey, row, col in zip(storeys.tolist(), rows.tolist(), cols.tolist(), strict=True):
        first_row = (row + graph.frame.first_row) * ratio - fine.frame.first_row
        first_col = (col + graph.frame.first_col) * ratio - fine.frame.first_col
        found += [Cell(storey, first_row + i, first_col + j) for i in range(ratio) for j in range(ratio)]
    return [cell for cell in found if cell in fine.frame]


def _narrowest(fine: NavGraph, begin: Cell, end: Cell) -> Cell:
    """Return the cell in which the widest way between two cells has the least clearance."""
    clearance = search.clearances(fine.free)
    links = fine.links[0]
    start, goal = (_flat(cell, clearance) for cell in (begin, end))
    clearance.reshape(-1)[[start, goal, *links.ravel().tolist()]] = np.inf
    steps = np.unique(clearance[np.isfinite(clearance) & (clearance > 0)])
    low, high = 0, len(steps)  # a way with steps[low] is known, one with steps[high] is not
    while high - low > 1:
        middle = (low + high) // 2
        labels = search.components(clearance >= steps[middle], links)
        if labels[begin] == labels[end]:
            low = middle
        else:
            high = middle
    wide = steps[high] if high < len(steps) else np.inf
    cost = np.where(clearance >= wide, np.float32(1), np.float32(1e6))
    cost[clearance < steps[low]] = np.inf
    layout = search.Layout(cost, 4, links, np.ones(len(links)))
    found = search.find(layout, start, goal, "astar")
    assert found is not None  # noqa: S101 - the parts are joined
    cells = found.indices
    tight = np.flatnonzero(clearance[tuple(cells.T)] < wide)
    if not len(tight):
        return begin
    run = tight[: int(np.argmax(np.append(np.diff(tight), 2) > 1)) + 1]  # the first stretch of them
    return Cell(*cells[run[len(run) // 2]].tolist())


def _flat(cell: Cell, array: NDArray[np.float64]) -> int:
    return int(np.ravel_multi_index(cell, array.shape))


def _measured(
    thin: IndoorEnvironment, fine: NavGraph, place: Cell
) -> tuple[tuple[float, float, float], float, list[tuple[str, str]]]:
    """Return the narrowest place near a cell, its width between exact footprints, and what stands at its sides."""
    storey = place.storey
    x, y, z = fine.frame.center_of(place)
    floor = thin.floor(storey)
    bodies = [(o.global_id, o.name or o.ifc_class, body) for o, body in thin.bodies_on(storey)]
    around = shapely.Point(x, y).buffer(4 * _NEAR_ENTRY)
    shapes = [(g, name, body.intersection(around)) for g, name, body in bodies if body.intersects(around)]
    solid = shapely.union_all([shape for *_, shape in shapes] + [shapely.boundary(floor).intersection(around)])
    here = np.array([x, y])
    one = other = here
    for _ in range(8):
        one = _nearest(here, solid)
        ahead = here - one
        length = float(np.hypot(*ahead))
        if length == 0:
            break
        other = _nearest(here, solid.intersection(_half_plane(here, ahead / length)))
        here = (one + other) / 2
    sides = []
    for point in (one, other):
        at = shapely.Point(point)
        near = [(g, name) for g, name, shape in shapes if shape.distance(at) <= _TOUCHES]
        sides.append(near[0] if near else ("", "the edge of the floor"))
    return (float(here[0]), float(here[1]), z), float(np.hypot(*(other - one))), sides


def _nearest(point: NDArray[np.float64], shape: BaseGeometry) -> NDArray[np.float64]:
    if shape.is_empty:
        return point
    nearest: NDArray[np.float64] = shapely.get_coordinates(shapely.shortest_line(shapely.Point(point), shape))[1]
    return nearest


def _half_plane(point: NDArray[np.float64], ahead: NDArray[np.float64]) -> BaseGeometry:
    """Return what lies ahead of a point, to either side, as far as it matters."""
    far = 8 * _NEAR_ENTRY
    aside = np.array([-ahead[1], ahead[0]]) * far
    begin = point + ahead * 1e-6
    return shapely.Polygon([begin + aside, begin - aside, begin - aside + ahead * far, begin + aside + ahead * far])
