"""Where a robot stands to serve a target: near enough, on the free side, with nothing in between, facing it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav._meaning import NOT_LISTED
from bimnav._sight import LIFTED, UNDER, Scene, points_on, sight_of
from bimnav.building import Element
from bimnav.grid import Cell
from bimnav.robot import Robot
from bimnav.stops import Approach, Stand, Stop, Unreached
from bimnav.tasks import Standoff

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment, Obstacle, Target
    from bimnav.graph import NavGraph

__all__ = ["stop_for"]

_MOST = 8  # places for one target
_APART = math.radians(30)  # as seen from the target
_FARTHER = 1.0  # metres beyond the nearest place; a tour gains little from walking farther round its target
_COVER = 0.5  # metres; what is sunk into a wall deeper than this is behind it
_NAMED = 3  # of the things that hide a target
_AT_ONCE = 64  # cells looked at together
_ARM = 0.1  # metres above the floor, where a robot reaches lowest
_REACH = 3.0  # metres; of robots without an environment, as of the default one


@dataclass(frozen=True, slots=True)
class Miss:
    """Why no place serves a target: in words, how far the nearest one is off, and what blocks it.

    Parameters
    ----------
    distance
        Metres that are missing to the nearest place; inf if there is none at all.
    blocking
        GlobalIds.
    """

    reason: str
    distance: float = math.inf
    blocking: tuple[str, ...] = ()


def find_stands(graph: NavGraph, target: Target, component: int | None) -> tuple[tuple[Stand, ...], Miss]:
    """Find the places from which a robot serves a target that it does not drive onto.

    A place is a free cell within the robot's reach of a point of the target that the robot sees: by a
    straight line from the top of its body, or from its arm at the height of the point, that meets no
    wall, slab or other big thing. Doors count as open. What is sunk into a wall is served through as
    little of it as possible.

    Returns
    -------
    stands
        At most eight, best first: the nearest, then others around the target. Empty if there is none.
    miss
        Why not, if there is none.
    """
    if graph.environment is None:
        return _nearest(graph, target, component), Miss(f"no free cell is within {_REACH:g} m")
    misses = []
    for storey in _storeys(graph.environment, target):
        stands, miss = _Search(graph, target, storey, component).run()
        if stands:
            return stands, miss
        misses.append(miss)
    return (), min(misses, key=lambda miss: miss.distance)


def room_stands(graph: NavGraph, target: Target, component: int | None) -> tuple[Stand, ...]:
    """Return places all over the room that a target is, or is in; nothing without a room."""
    environment = graph.environment
    if environment is None:
        return ()
    point = shapely.Point(target.destination[:2])
    rooms = [r for r in environment.regions if r.storey == target.storey and r.source == "space"]
    own = [r for r in rooms if r.global_id == target.global_id] or [r for r in rooms if r.polygon.covers(point)]
    if not own:
        return ()
    polygon = shapely.union_all([region.polygon for region in own])
    cells, centers = _free_cells(graph, target.storey, polygon.bounds, component)
    inside = shapely.contains_xy(polygon, centers[:, :2])
    cells, centers = cells[inside], centers[inside]
    if not len(cells):
        return ()
    nearest = np.hypot(*(centers[:, :2] - target.destination[:2]).T).round(9)
    chosen = [int(np.lexsort((cells[:, 2], cells[:, 1], nearest))[0])]
    away = np.full(len(cells), np.inf)
    for _ in range(min(_MOST, len(cells)) - 1):
        away = np.minimum(away, np.hypot(*(centers[:, :2] - centers[chosen[-1], :2]).T))
        chosen.append(int(away.round(9).argmax()))
    return tuple(Stand(Cell(*cells[k].tolist()), _point(centers[k])) for k in dict.fromkeys(chosen))


def stop_for(graph: NavGraph, target: Target, cell: Cell | None, component: int | None) -> Stop | Unreached:
    """Return where a robot goes for a target, or why it cannot serve it.

    Parameters
    ----------
    cell
        The cell that holds the target's destination; None outside the map.
    component
        The part of the map that the robot is in; None for any.
    """
    room = room_stands(graph, target, component) if target.approach == "space" else ()
    if room:
        return _stop(target, room, "space")
    is_on = cell is not None and target.approach in ("center", "space") and graph.free[cell]
    if cell is not None and is_on and _serves_from(graph, target, cell):
        if component is not None and graph.components[cell] != component:
            reason = "no way from the start: its cell lies in another part of the building"
            return Unreached(target.global_id, target.name, target.destination, reason, cell)
        return _stop(target, (Stand(cell, target.destination),), "reach" if graph.obstacle[cell] else "center")
    stands, miss = find_stands(graph, target, component)
    if stands:
        return _stop(target, stands, "standing")
    distance = miss.distance if math.isfinite(miss.distance) else None
    return Unreached(target.global_id, target.name, target.destination, miss.reason, cell, distance, miss.blocking)


def _stop(target: Target, stands: tuple[Stand, ...], approach: Approach) -> Stop:
    asked = {name: getattr(target, name) for name in ("source", "service_time", "priority", "due", "abilities")}
    best = stands[0]
    return Stop(
        target.global_id,
        target.name,
        best.cell,
        target.destination,
        best.end,
        approach,
        best.distance,
        heading=best.heading,
        candidates=stands,
        **asked,
    )


def _serves_from(graph: NavGraph, target: Target, cell: Cell) -> bool:
    """Tell whether a robot on a target's own point serves it: it fits there, and reaches up to the target."""
    environment = graph.environment
    if environment is None or graph.obstacle[cell]:
        return True
    if not environment.is_clear(target.storey, target.destination):
        return False
    robot, level = environment.robot, environment.levels[target.storey]
    if math.isinf(robot.reach_height):
        return True
    lowest = float(_Aim(environment, target).points[:, 2].min())
    return lowest <= level + robot.height or _Search(graph, target, target.storey, None).sees_from(cell)


class _Aim:
    """What is aimed at: points of a target in space, and what does not hide it."""

    def __init__(self, environment: IndoorEnvironment, target: Target) -> None:
        self.environment, self.target = environment, target
        building, level = environment.building, environment.levels[target.storey]
        self.element: Element | None = None
        if target.global_id in building:
            self.element = building[target.global_id]
        points = points_on(self.element.shapes) if self.element else np.empty((0, 3))
        if not len(points):
            known = {d.global_id: d.z for d in building.detections} if target.source == "user" else {}
            z = known.get(target.global_id)
            points = np.array([[*target.destination[:2], level if z is None else z]])
        self.points = points

    @cached_property
    def without(self) -> frozenset[str]:
        """GlobalIds of the target itself, of what it is a part of and of the parts of that, and of what never blocks.

        What the task merely does not list as an obstacle still hides; a door does if it is closed for the robot.
        """
        environment, element = self.environment, self.element
        ignored = {g for g, why in environment.left_out if why != NOT_LISTED}
        ignored -= {obstacle.global_id for obstacle in environment.obstacles}
        family = {self.target.global_id}
        if element is not None:
            heads = {element.global_id} | ({element.parent} if element.parent else set())
            family |= heads | {e.global_id for e in environment.building.elements if e.parent in heads}
        if self.target.source == "user":
            point = shapely.Point(self.target.destination[:2])
            on = environment.obstacles_on(self.target.storey)
            ignored |= {o.global_id for o in on if o.footprint.intersects(point)}
        return frozenset(family | ignored)


def _storeys(environment: IndoorEnvironment, target: Target) -> list[int]:
    """Return the storeys from whose floor a target may be in reach: its own, then others by their height."""
    points = _Aim(environment, target).points
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    reach = environment.robot.reach_height
    walkable = sorted({region.storey for region in environment.regions})
    others = [
        storey
        for storey in walkable
        if storey != target.storey
        and environment.levels[storey] - UNDER <= high
        and low <= environment.levels[storey] + (environment.robot.height if math.isinf(reach) else reach)
    ]
    return [target.storey, *sorted(others, key=lambda s: (abs(environment.levels[s] - low), s))]


class _Search:
    """The search for places on one storey."""

    def __init__(self, graph: NavGraph, target: Target, storey: int, component: int | None) -> None:
        assert graph.environment is not None  # noqa: S101 - a graph from a mask has no targets to look at
        self.graph, self.target, self.storey = graph, target, storey
        self.environment: IndoorEnvironment = graph.environment
        self.robot: Robot = self.environment.robot
        self.level = self.environment.levels[storey]
        self.aim = _Aim(self.environment, target)
        heights = self.aim.points[:, 2] - self.level
        self.points = self.aim.points[(heights >= -UNDER) & (heights <= self.robot.reach_height + 1e-9)]
        around = self.aim.points[:, :2]
        (x0, y0), (x1, y1) = around.min(axis=0) - self.robot.reach, around.max(axis=0) + self.robot.reach
        self.cells, self.centers = _free_cells(graph, storey, (x0, y0, x1, y1), component)

    def run(self) -> tuple[tuple[Stand, ...], Miss]:
        if not len(self.points):
            low = float(self.aim.points[:, 2].min()) - self.level
            over = low - self.robot.reach_height
            what = f"its lowest point is {low:.2f} m above the floor, {over:.2f} m higher than the robot reaches"
            return (), Miss(what, over)
        order, off = self._ranked()
        if not len(order):
            return (), self._too_far(off)
        stands, blockers = self._seen(order, hosts=())
        if not stands:
            hosts = self.scene.holding(self.points)
            if hosts:
                stands, _ = self._seen(order, hosts=hosts)
        return stands, Miss("") if stands else self._hidden(order, blockers)

    def sees_from(self, cell: Cell) -> bool:
        """Tell whether the robot sees the target from a free cell."""
        here = np.flatnonzero((self.cells == cell).all(axis=1))
        return bool(len(self.points)) and bool((self._cover(here, ())[0] == 0).any())

    def _ranked(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the cells in reach, best first, and how far every cell is from the nearest point, metres."""
        x, y, _ = self.target.destination
        nearest = self._distances().min(axis=1) if len(self.centers) else np.empty(0)
        rank = np.hypot(self.centers[:, 0] - x, self.centers[:, 1] - y)
        usable = nearest <= self.robot.reach
        wish = self.target.approach
        if isinstance(wish, Standoff) and self.target.footprint is not None:
            centers = shapely.points(self.centers[:, :2])
            away = shapely.distance(self.target.footprint, centers)
            usable &= np.abs(away - wish.distance) <= 0.75 * self.graph.frame.cell_size
            usable &= self._on_side(wish.side)
        elif wish == "nearest_free" and self.target.footprint is not None:
            beside = usable & ~shapely.intersects_xy(self._beside(), self.centers[:, :2])
            under = ~shapely.intersects_xy(self.target.footprint, self.centers[:, :2])
            usable = beside if beside.any() else usable & under
        chosen = np.flatnonzero(usable)
        keys = (self.cells[chosen, 2], self.cells[chosen, 1], np.round(rank[chosen], 9))
        return chosen[np.lexsort(keys)], nearest

    def _beside(self) -> BaseGeometry:
        """Return where the robot would be on a target, or its body in one that it could run into, such as a door."""
        assert self.target.footprint is not None  # noqa: S101 - the caller has seen to it
        low = float(self.aim.points[:, 2].min()) - self.level
        is_met = self.robot.low < float(self.aim.points[:, 2].max()) - self.level and low < self.robot.height
        return self.target.footprint.buffer(self.robot.radius) if is_met else self.target.footprint

    def _distances(self) -> NDArray[np.float64]:
        """(cells, points), in plan view, metres."""
        apart = self.centers[:, None, :2] - self.points[None, :, :2]
        found: NDArray[np.float64] = np.hypot(apart[..., 0], apart[..., 1])
        return found

    def _on_side(self, side: str) -> NDArray[np.bool_]:
        """Tell which cells are before or behind a target, as its placement is turned: its front is its negative y."""
        element = self.aim.element
        if side == "any" or element is None or not element.shapes:
            return np.ones(len(self.centers), dtype=np.bool_)
        placement = element.shapes[0].placement
        across, along = placement[:2, 0], placement[:2, 1]
        own = np.concatenate([shape.world_vertices()[:, :2] for shape in element.shapes])
        x, y = self.centers[:, :2] @ across, self.centers[:, :2] @ along
        beyond = own @ along
        depth = beyond.min() - y if side == "front" else y - beyond.max()
        aside = np.maximum((own @ across).min() - x, x - (own @ across).max())
        on: NDArray[np.bool_] = (depth > 0) & (aside <= depth)
        return on

    @cached_property
    def scene(self) -> Scene:
        """What may hide the target, as far as the robot reaches."""
        corners = np.concatenate([self.points, self.centers])
        box = np.array([corners.min(axis=0), corners.max(axis=0)])
        box[0, 2] = min(box[0, 2], self.level)
        box[1, 2] = max(box[1, 2], self.level + self.robot.height)
        under = float(self.points[:, 2].max()) < self.level
        without = set(self.aim.without)
        sight = sight_of(self.environment.building)
        scene = sight.within(box, without)
        if not under:
            return scene
        lifted = {
            element.global_id
            for element, around in zip(scene.elements, scene.boxes, strict=True)
            if abs(around[1, 2] - self.level) <= LIFTED and around[1, 2] - around[0, 2] <= LIFTED
        }
        return sight.within(box, without | lifted)

    def _seen(self, order: NDArray[np.int64], *, hosts: Sequence[int]) -> tuple[tuple[Stand, ...], Counter[int]]:
        """Go through the cells from the best on; return the places found, and how often what hides the target."""
        found: list[Stand] = []
        angles: list[float] = []
        blockers, cover = Counter[int](), _COVER
        x, y, _ = self.target.destination
        for begin in range(0, len(order), _AT_ONCE):
            chunk = order[begin : begin + _AT_ONCE]
            hidden, first = self._cover(chunk, hosts)
            blockers.update(first[first >= 0].tolist())
            for k, deep in zip(chunk.tolist(), hidden.tolist(), strict=True):
                if deep > cover:
                    continue
                stand = self._stand(k)
                if found and (stand.distance > found[0].distance + _FARTHER or len(found) == _MOST):
                    return tuple(found), blockers
                angle = math.atan2(stand.end[1] - y, stand.end[0] - x)
                if all(abs(math.remainder(angle - other, math.tau)) >= _APART for other in angles):
                    cover = deep * 1.5 + 0.05 if not found else cover
                    found.append(stand)
                    angles.append(angle)
        return tuple(found), blockers

    def _cover(self, chunk: NDArray[np.int64], hosts: Sequence[int]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return through how much of its hosts each cell sees the target, inf if not at all, and what is in the way."""
        robot, n, m = self.robot, len(chunk), len(self.points)
        feet = np.repeat(self.centers[chunk], m, axis=0)
        aims = np.tile(self.points, (n, 1))
        in_reach = np.hypot(*(feet - aims)[:, :2].T) <= robot.reach + 1e-9
        eyes, arms = feet.copy(), feet.copy()
        eyes[:, 2] = self.level + robot.height
        top = self.level + max(robot.height, min(robot.reach_height, 1e3))
        arms[:, 2] = np.clip(aims[:, 2], self.level + min(_ARM, robot.height), top)
        deep = np.full((2, n * m), np.inf)
        blocker = np.full(n * m, -1)
        for row, begins in enumerate((eyes, arms)):
            first, left = self.scene.hits(begins, aims)
            is_host = np.isin(first, hosts)
            free = (first < 0) | (is_host & self._is_nearer_side(begins, aims, left, hosts))
            if row == 1:  # the arm goes up from the body
                risen, _ = self.scene.hits(np.where(arms[:, 2:] > eyes[:, 2:], eyes, arms), arms)
                free &= risen < 0
            deep[row, free & in_reach] = np.where(is_host, left, 0.0)[free & in_reach]
            blocker = np.where(first >= 0, first, blocker)
        best: NDArray[np.float64] = deep.min(axis=0).reshape(n, m).min(axis=1)
        nearest = np.where(in_reach, np.linalg.norm(feet - aims, axis=1), np.inf).reshape(n, m).argmin(axis=1)
        return best, blocker.reshape(n, m)[np.arange(n), nearest]

    def _is_nearer_side(
        self, begins: NDArray[np.float64], aims: NDArray[np.float64], left: NDArray[np.float64], hosts: Sequence[int]
    ) -> NDArray[np.bool_]:
        """Tell which lines go through no more of what holds the target than lies behind the target."""
        if not hosts:
            return np.zeros(len(aims), dtype=np.bool_)
        along = aims - begins
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
        met, behind = self.scene.only(hosts).hits(aims + along * 2 * _COVER, aims)
        nearer: NDArray[np.bool_] = (met < 0) | (left <= behind * 1.5 + 0.02)
        return nearer

    def _stand(self, k: int) -> Stand:
        x, y, _ = self.target.destination
        end = _point(self.centers[k])
        wish = self.target.approach
        is_facing = not isinstance(wish, Standoff) or wish.facing
        heading = math.atan2(y - end[1], x - end[0]) if is_facing else None
        return Stand(Cell(*self.cells[k].tolist()), end, math.dist(end[:2], (x, y)), heading)

    def _too_far(self, off: NDArray[np.float64]) -> Miss:
        robot = self.robot
        if not len(off) or off.min() > robot.reach:
            near = off.min() if len(off) else self._nearest_anywhere()
            if math.isinf(near):
                return Miss("no free cell of its storey can be reached", math.inf)
            if near <= robot.reach:
                return Miss(
                    "no way from the start: every free cell in reach of it lies in another part of the building"
                )
            blocking = self._around()
            what = f"the nearest free cell is {near:.2f} m from it, the robot reaches {robot.reach:g} m"
            return Miss(what + self._named(blocking), float(near - robot.reach), blocking)
        wish = self.target.approach
        if isinstance(wish, Standoff):
            side = "" if wish.side == "any" else f" at its {wish.side}"
            return Miss(f"no free cell{side} is {wish.distance:g} m from it", 0.0, self._around())
        return Miss("every free cell in reach lies under it", 0.0)

    def _nearest_anywhere(self) -> float:
        free = self.graph.free[self.storey]
        rows, cols = np.nonzero(free)
        centers = self.graph.frame.centers_of(np.column_stack([np.full_like(rows, self.storey), rows, cols]))
        x, y, _ = self.target.destination
        return float(np.hypot(centers[:, 0] - x, centers[:, 1] - y).min(initial=math.inf))

    def _around(self) -> tuple[str, ...]:
        """Return the GlobalIds of the obstacles at its point, without its own."""
        point = shapely.Point(self.target.destination[:2])
        at = (o.global_id for o, body in self.environment.bodies_on(self.storey) if body.intersects(point))
        return tuple(dict.fromkeys(g for g in at if g != self.target.global_id))

    def _hidden(self, order: NDArray[np.int64], blockers: Counter[int]) -> Miss:
        near = float(self._distances()[order].min())
        blocking = tuple(self.scene.elements[k].global_id for k, _ in blockers.most_common(_NAMED))
        what = f"from all {len(order)} free cells in reach, the nearest {near:.2f} m from it, something hides it"
        return Miss(what + self._named(blocking), 0.0, blocking)

    def _named(self, global_ids: Sequence[str]) -> str:
        known: dict[str, Obstacle | Element] = {o.global_id: o for o in self.environment.obstacles_on(self.storey)}
        known |= {e.global_id: e for e in self.scene.elements}
        names = ", ".join(f"{known[g].name or known[g].ifc_class} ({g})" for g in global_ids)
        return f": {names}" if names else ""


def _free_cells(
    graph: NavGraph, storey: int, bounds: Sequence[float], component: int | None
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the free cells of a storey in a box, (n, 3), and their middles, (n, 3) metres."""
    frame, size = graph.frame, graph.frame.cell_size
    first_row = max(math.floor(bounds[1] / size) - frame.first_row - 1, 0)
    first_col = max(math.floor(bounds[0] / size) - frame.first_col - 1, 0)
    last_row = max(math.ceil(bounds[3] / size) - frame.first_row + 1, 0)
    last_col = max(math.ceil(bounds[2] / size) - frame.first_col + 1, 0)
    window = (storey, slice(first_row, last_row), slice(first_col, last_col))
    free = graph.free[window]
    if component is not None:
        free = free & (graph.components[window] == component)
    rows, cols = np.nonzero(free)
    cells = np.column_stack([np.full_like(rows, storey), rows + first_row, cols + first_col])
    return cells, frame.centers_of(cells)


def _nearest(graph: NavGraph, target: Target, component: int | None) -> tuple[Stand, ...]:
    x, y, _ = target.destination
    bounds = (x - _REACH, y - _REACH, x + _REACH, y + _REACH)
    cells, centers = _free_cells(graph, target.storey, bounds, component)
    away = np.hypot(centers[:, 0] - x, centers[:, 1] - y).round(9)
    order = [k for k in np.lexsort((cells[:, 2], cells[:, 1], away)).tolist() if away[k] <= _REACH]
    return tuple(_facing(cells[k].tolist(), centers[k], x, y) for k in order[:1])


def _facing(cell: Sequence[int], center: NDArray[np.float64], x: float, y: float) -> Stand:
    end = _point(center)
    return Stand(Cell(*cell), end, math.dist(end[:2], (x, y)), math.atan2(y - end[1], x - end[0]))


def _point(center: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = center.tolist()
    return x, y, z
