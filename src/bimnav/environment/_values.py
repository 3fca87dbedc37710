"""An environment as values: floor, obstacles, targets, zones, and what can be asked of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
import shapely

from bimnav import _checks
from bimnav._door_access import DoorAccess
from bimnav._floors import FloorSource
from bimnav.building import Building, Issue, Storey
from bimnav.errors import ValueRangeError
from bimnav.robot import Robot

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav._explain import Explanation
    from bimnav.environment import Place
    from bimnav.tasks import Destination, Overruled, Task

__all__ = ["IndoorEnvironment", "Obstacle", "Region", "Target", "Zone", "grown"]

_GAP = 0.05  # metres; floors up to twice as far apart, such as a space and a doorway, are one floor
_QUARTER = 16  # segments of a quarter circle in a buffer


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A piece of walkable floor.

    Parameters
    ----------
    global_id
        Of the space, slab, door or opening it comes from; of the storey for a hull or a margin.
    storey
        Index of the storey.
    polygon
        Plan view in world coordinates, metres.
    source
        What says that one can walk here: `space`, `slab`, `covering` or `landing` (its upper side), `hull`
        (guessed from walls), `door`, `passage` (an opening that nothing fills), `outdoors`.
    """

    global_id: str
    name: str
    storey: int
    polygon: BaseGeometry
    source: FloorSource


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """What an element takes from the floor of one storey, in the height band of the robot.

    Parameters
    ----------
    storey
        Index of the storey; an element that reaches into two bands is two obstacles.
    footprint
        Plan view in world coordinates, metres, not buffered.
    low, high
        World heights of the part that lies in the band, metres.
    quality
        `exact`, `repaired`, `surface` or `hull`: how well the footprint is known.
    rule
        Why it is an obstacle.
    """

    global_id: str
    name: str
    ifc_class: str
    storey: int
    footprint: BaseGeometry
    low: float
    high: float
    quality: str
    rule: str


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """What a robot should go to.

    Parameters
    ----------
    storey
        Index of the storey.
    destination
        The exact world point, metres; z is the floor it is reached from.
    footprint
        Plan view of the element, or None for a bare point.
    source
        `model`, or `user` for a detection.
    rule
        Why it is a target.
    label
        What the rule is about.
    service_time
        Seconds the robot works there; None for the task's.
    priority
        How much it matters.
    due
        Seconds from the beginning of the job within which it should be served; None for no limit.
    abilities
        What a robot must be able to do there.
    approach
        Where the robot is to go for it.
    """

    global_id: str
    name: str
    storey: int
    destination: tuple[float, float, float]
    footprint: BaseGeometry | None
    source: Literal["model", "user"]
    rule: str
    label: str = ""
    service_time: float | None = None
    priority: float = 1.0
    due: float | None = None
    abilities: tuple[str, ...] = ()
    approach: Destination = "center"


@dataclass(frozen=True, slots=True, eq=False)
class Zone:
    """Floor that costs more to cross.

    Parameters
    ----------
    factor
        Multiplier of the length of a step, at least 1; inf where the robot must never be.
    """

    global_id: str
    name: str
    storey: int
    polygon: BaseGeometry
    factor: float
    rule: str


@dataclass(frozen=True, eq=False)
class IndoorEnvironment:
    """Regions, obstacles, targets and zones of a building, for one task and one robot.

    Parameters
    ----------
    storeys
        What `storey` indexes in regions, obstacles, targets and cells: the building's storeys by the
        height of their floor. A storey whose rooms or slabs lie at several heights is several of these.
    levels
        World height of the walkable floor of every storey, metres.
    regions
        Walkable floor, from all sources.
    obstacles
        What blocks the robot in its height band, on every storey.
    targets
        What the task wants visited, and what the user placed.
    zones
        Floor that costs more to cross.
    left_out
        GlobalId to the rule that keeps an element from being an obstacle.
    outside_bands
        GlobalIds of elements that no robot of this height meets on any storey.
    issues
        What could not be classified, with GlobalIds.
    doors
        How every door is, as the task says, and whether the robot may pass it.
    overruled
        Rules that pick an element and do not decide about it, because others go before.
    exits
        Ways out, as the task's rules pick them.
    """

    building: Building
    task: Task
    robot: Robot
    storeys: tuple[Storey, ...]
    levels: tuple[float, ...]
    regions: tuple[Region, ...]
    obstacles: tuple[Obstacle, ...]
    targets: tuple[Target, ...]
    zones: tuple[Zone, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()
    outside_bands: tuple[str, ...] = ()
    issues: tuple[Issue, ...] = ()
    doors: tuple[DoorAccess, ...] = ()
    overruled: tuple[Overruled, ...] = ()
    exits: tuple[Target, ...] = ()

    def __repr__(self) -> str:
        return (
            f"IndoorEnvironment({self.building.name!r}, task {self.task.name!r}, robot {self.robot.name!r}: "
            f"{len(self.regions)} regions, {len(self.obstacles)} obstacles, {len(self.targets)} targets)"
        )

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        from bimnav._cards import card, plan_svg

        shown = self.ground
        areas = [(r.polygon, "#e6e0d5") for r in self.regions if r.storey == shown]
        areas += [(o.footprint, "#6b6459") for o in self.obstacles_on(shown)]
        points = [(shapely.Point(t.destination).buffer(0.2), "#d55e00") for t in self.targets if t.storey == shown]
        rows = [
            ("task", self.task.name),
            ("robot", f"{self.robot.name}, radius {self.robot.radius:g} m, height {self.robot.height:g} m"),
            ("floor", f"{sum(self.floor(s).area for s in range(len(self.levels))):.1f} m² for its middle"),
            ("obstacles", len(self.obstacles)),
            ("targets", len(self.targets)),
            ("zones", len(self.zones) or None),
            ("issues", len(self.issues) or None),
        ]
        return card(f"Environment in {self.building.name}", rows, plan_svg([*areas, *points]))

    @cached_property
    def _floors(self) -> tuple[BaseGeometry, ...]:
        return tuple(
            _floor([r.polygon for r in self.regions if r.storey == storey], self.robot.radius)
            for storey in range(len(self.levels))
        )

    @cached_property
    def _bodies(self) -> tuple[tuple[tuple[Obstacle, BaseGeometry], ...], ...]:
        bodies = _all_grown([o.footprint for o in self.obstacles], self.robot.radius)
        levels: list[list[tuple[Obstacle, BaseGeometry]]] = [[] for _ in self.levels]
        for obstacle, body in zip(self.obstacles, bodies, strict=True):
            levels[obstacle.storey].append((obstacle, body))
        return tuple(map(tuple, levels))

    @property
    def ground(self) -> int:
        """The lowest storey with floor; a level split off a storey, such as a pit, only if there is no other."""
        walkable = [s for s in range(len(self.levels)) if not self.floor(s).is_empty] or [0]
        known = set(self.building.storeys)
        return next((s for s in walkable if self.storeys[s] in known), walkable[0])

    def floor(self, storey: int) -> BaseGeometry:
        """Return where the middle of the robot may be, as far as the floor is concerned, metres."""
        return self._floors[storey]

    def obstacles_on(self, storey: int) -> tuple[Obstacle, ...]:
        """Return the obstacles of one storey."""
        return tuple(o for o in self.obstacles if o.storey == storey)

    def bodies_on(self, storey: int) -> tuple[tuple[Obstacle, BaseGeometry], ...]:
        """Return the obstacles of one storey with their footprints grown by the robot's radius."""
        return self._bodies[storey]

    def storeys_at(self, place: Place) -> tuple[int, ...]:
        """Return the storeys a place may mean, best first.

        Parameters
        ----------
        place
            `(x, y)` or `(x, y, storey)`: metres, and the name, GlobalId or index of a storey, or the name
            of one level of it, such as `Level 1 (+1.50 m)`. Best are storeys with floor there, then those
            with an obstacle there, then the lowest walkable one.
        """
        try:
            x, y = (float(value) for value in place[:2])
        except (TypeError, ValueError) as error:
            raise ValueRangeError(f"{place!r:.80} is no place.", "Give (x, y) or (x, y, storey).") from error
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueRangeError(f"({x}, {y}) is not a point.", "Give finite metres.")
        point = shapely.Point(x, y)
        storeys: Sequence[int] = range(len(self.levels))
        if len(place) > 2 and place[2] is not None:
            split = [s for s in storeys if self.storeys[s] not in self.building.storeys]
            named = [s for s in split if self.storeys[s].name == place[2]]
            if not named:
                global_id = self.building.storeys[self.building.storey_index(place[2])].global_id
                named = [s for s in storeys if self.storeys[s].global_id == global_id]
            storeys = named
        on = [s for s in storeys if self.floor(s).intersects(point)]
        within = [s for s in storeys if any(body.intersects(point) for _, body in self.bodies_on(s))]
        walkable = [s for s in (self.ground, *storeys) if s in storeys and not self.floor(s).is_empty]
        return tuple(dict.fromkeys([*on, *within, *walkable, *storeys]))

    def with_obstacles(self, added: Iterable[Obstacle] = (), removed: Iterable[Obstacle] = ()) -> Self:
        """Return the environment with other obstacles; floors and grown footprints are shared."""
        added, gone = tuple(added), {id(obstacle) for obstacle in removed}
        bodies = [tuple(pair for pair in level if id(pair[0]) not in gone) for level in self._bodies]
        for obstacle in added:
            bodies[obstacle.storey] += ((obstacle, grown(obstacle.footprint, self.robot.radius)),)
        changed = replace(self, obstacles=(*(o for o in self.obstacles if id(o) not in gone), *added))
        changed.__dict__.update(_floors=self._floors, _bodies=tuple(bodies))
        return changed

    def explain(self, global_id: str) -> Explanation:
        """Say what an element, room or detection is to the task, on every storey, and the rule that decides.

        Raises
        ------
        ModelError
            If there is nothing of this GlobalId.
        """
        from bimnav._explain import explain_element

        _checks.need("global_id", global_id, str)
        return explain_element(self, global_id)

    def is_clear(self, storey: int, *points: Sequence[float]) -> bool:
        """Tell whether the robot can be on a point, or drive straight from point to point, touching nothing."""
        at = shapely.Point(*points[0][:2]) if len(points) == 1 else shapely.LineString([p[:2] for p in points])
        on_floor = bool(shapely.buffer(self.floor(storey), 1e-9).covers(at))
        return on_floor and not any(body.intersects(at) for _, body in self.bodies_on(storey))


def grown(polygon: BaseGeometry, radius: float) -> BaseGeometry:
    """Return a polygon grown by a radius, never by less: the arcs lie outside the true circles."""
    return _all_grown([polygon], radius)[0]


def _all_grown(polygons: Sequence[BaseGeometry], radius: float) -> Sequence[BaseGeometry]:
    """Return polygons grown by a radius, each as by `grown`."""
    if radius == 0:
        return polygons
    enough = radius / math.cos(math.pi / (4 * _QUARTER))
    bodies: list[BaseGeometry] = shapely.buffer(np.asarray(polygons, dtype=object), enough, quad_segs=_QUARTER).tolist()
    return bodies


def _floor(polygons: Sequence[BaseGeometry], radius: float) -> BaseGeometry:
    """Join regions over small gaps and keep the robot's body on them."""
    joined = shapely.buffer(shapely.geometrycollections(polygons), _GAP, join_style="mitre")
    return grown(shapely.buffer(joined, -_GAP, join_style="mitre"), -radius)
