"""The environment of one building for one task and one robot, in continuous space."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias

import numpy as np
import shapely

from bimnav._door_access import DoorAccess, door_access
from bimnav._doorways import doorway_of
from bimnav._floors import FLOOR_SOURCES, NEAR, FloorSource, find_floors, outline
from bimnav._meaning import what_blocks
from bimnav._sight import LIFTED, UNDER, sight_of
from bimnav.building import Building, Detection, Element, Issue, Space, Storey
from bimnav.errors import InputError, ValueRangeError
from bimnav.footprint import Footprint, footprints_of, merge_footprints
from bimnav.robot import Robot

Place: TypeAlias = Sequence[Any]
"""`(x, y)` or `(x, y, storey)`: metres, and the name, GlobalId or index of a storey."""

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav._explain import Explanation
    from bimnav.tasks import Choice, Destination, Overruled, Task

__all__ = ["IndoorEnvironment", "Obstacle", "Place", "Region", "Target", "Zone", "make_environment", "rules_overruled"]


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


_GAP = 0.05  # metres; floors up to twice as far apart, such as a space and a doorway, are one floor
_FLUSH = 0.05  # metres; what ends so close under a floor lies on it
_QUARTER = 16  # segments of a quarter circle in a buffer


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
        bodies = all_grown([o.footprint for o in self.obstacles], self.robot.radius)
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

        return explain_element(self, global_id)

    def is_clear(self, storey: int, *points: Sequence[float]) -> bool:
        """Tell whether the robot can be on a point, or drive straight from point to point, touching nothing."""
        at = shapely.Point(*points[0][:2]) if len(points) == 1 else shapely.LineString([p[:2] for p in points])
        on_floor = bool(shapely.buffer(self.floor(storey), 1e-9).covers(at))
        return on_floor and not any(body.intersects(at) for _, body in self.bodies_on(storey))


def grown(polygon: BaseGeometry, radius: float) -> BaseGeometry:
    """Return a polygon grown by a radius, never by less: the arcs lie outside the true circles."""
    return all_grown([polygon], radius)[0]


def all_grown(polygons: Sequence[BaseGeometry], radius: float) -> Sequence[BaseGeometry]:
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


def make_environment(
    building: Building,
    task: Task,
    robot: Robot | None = None,
    *,
    start: Place | None = None,
    floor_from: Collection[FloorSource] = FLOOR_SOURCES,
    outdoors: bool = False,
) -> IndoorEnvironment:
    """Work out where a robot can go in a building, what blocks it, and what a task wants visited.

    Floor comes from spaces, from slabs, coverings and landings between them and on levels of their own,
    else from what the storey's walls enclose, and from doorways and passages. Holes in slabs, shafts and
    voids are no floor, and neither is the outside. Everything solid in the robot's height band blocks, from
    just above the floor (`robot.step_height`) to the robot's height, unless it is a door or the task says
    otherwise.

    Parameters
    ----------
    building
        As read, or written by hand.
    task
        Says what to visit; finding nothing is no error here.
    robot
        Its height and radius decide what blocks. The default is the paper's point, 1 m tall.
    start
        Where the job begins, `(x, y)` or `(x, y, storey)`: detections that name no storey lie on its
        storey. Without it they lie on the lowest floor at their point.
    floor_from
        What may say that there is floor: any of `space, slab, covering, landing, hull, door, passage`.
    outdoors
        Whether the ground around the building is floor too: slabs and terrain as high as a level, else a
        margin of two metres around the lowest level with a door to the outside.
    """
    from bimnav.tasks import Task, choose, lint_rules

    robot = robot or Robot()
    for name, value, kind, maker in (
        ("building", building, Building, "read_ifc"),
        ("task", task, Task, "load_task"),
        ("robot", robot, Robot, "Robot or load_robot"),
    ):
        if not isinstance(value, kind):
            raise InputError(f"{name} is {value!r:.80}, not a {kind.__name__}.", f"Make it with {maker}.")
    floors, issues = find_floors(building, robot, sources=floor_from, outdoors=outdoors)
    issues += lint_rules(task, building)
    levels = tuple(floor.level for floor in floors)
    regions = tuple(
        Region(piece.global_id, piece.name, storey, piece.polygon, piece.source)
        for storey, floor in enumerate(floors)
        for piece in floor.pieces
    )
    walkable = sorted({region.storey for region in regions})

    visited, overruled = choose(task, "targets", building)
    blocks = what_blocks(task, building, visited)
    visited, of_parts = _embodied(visited, building)
    access, doors_overruled = door_access(task, building, robot)
    obstacles = (
        *_obstacles(blocks.candidates, robot, levels, walkable),
        *_closed(access, building, robot, levels, walkable),
    )
    zones, zones_overruled = _rated(task, building, levels)
    blocking = {obstacle.global_id for obstacle in obstacles}

    environment = IndoorEnvironment(
        building,
        task,
        robot,
        tuple(floor.storey for floor in floors),
        levels,
        regions,
        obstacles,
        targets=(),
        zones=zones,
        left_out=tuple(sorted((g, why) for g, why in blocks.left_out.items() if g not in blocking)),
        outside_bands=tuple(e.global_id for e, _ in blocks.candidates if e.global_id not in blocking),
        issues=issues,
        doors=access,
        overruled=(*overruled, *of_parts, *blocks.overruled, *doors_overruled, *zones_overruled),
    )
    targets = [_found(choice, environment) for choice in visited.values()]
    home = None if start is None else environment.storeys_at(start)[0]
    targets += [_placed(detection, environment, home) for detection in building.detections]
    lost = tuple(global_id for global_id, target in zip(visited, targets, strict=False) if target is None)
    if lost:
        message = f"{len(lost)} targets of task {task.name!r} have no geometry, so no place to go to."
        issues += (Issue("target-without-shape", message, lost, "error", "Ask for an export with bodies."),)
    exits = (_found(choice, environment) for choice in choose(task, "exits", building)[0].values())
    return replace(
        environment,
        targets=tuple(t for t in targets if t is not None),
        exits=tuple(way for way in exits if way is not None),
        issues=issues,
    )


def _embodied(visited: Mapping[str, Choice], building: Building) -> tuple[dict[str, Choice], tuple[Overruled, ...]]:
    """Give targets without a body those of their parts; parts picked by the same label are then no targets."""
    from bimnav.tasks import Overruled

    parts = defaultdict[str, list[Element]](list)
    for element in building.elements:
        if element.parent:
            parts[element.parent].append(element)
    whole, overruled = dict(visited), []
    for global_id, choice in visited.items():
        if choice.element.shapes or global_id not in parts:
            continue
        found, pending = [], list(parts[global_id])
        while pending:
            part = pending.pop()
            found.append(part)
            pending += parts.pop(part.global_id, ())
        found.sort(key=lambda part: part.global_id)
        shapes = tuple(shape for part in found for shape in part.shapes)
        whole[global_id] = choice._replace(element=replace(choice.element, shapes=shapes))
        for part in found if shapes else ():
            other = visited.get(part.global_id)
            if other is not None and other.rule.label == choice.rule.label:
                whole.pop(part.global_id, None)
                told = f"a part of the target {choice.element.name} ({global_id})"
                overruled.append(Overruled(part.global_id, other.why, told))
    return whole, tuple(overruled)


def rules_overruled(task: Task, building: Building, robot: Robot | None = None) -> tuple[Overruled, ...]:
    """Return the rules of a task that pick an element of a building and do not decide, because others go before."""
    from bimnav.tasks import choose

    visited, overruled = choose(task, "targets", building)
    doors = door_access(task, building, robot or Robot())[1]
    return (*overruled, *what_blocks(task, building, visited).overruled, *doors, *_rated(task, building, ())[1])


def _obstacles(
    candidates: Sequence[tuple[Element, str]], robot: Robot, levels: Sequence[float], walkable: Sequence[int]
) -> Iterable[Obstacle]:
    shapes = [(element, why, shape) for element, why in candidates for shape in element.shapes]
    for storey in walkable:
        low, high = levels[storey] + robot.low, levels[storey] + robot.height
        parts: dict[str, list[Footprint]] = {}
        for (element, _, _), part in zip(shapes, footprints_of([s for _, _, s in shapes], low, high), strict=True):
            if part is not None and not part.polygon.is_empty:
                parts.setdefault(element.global_id, []).append(part)
        for element, why in candidates:
            if element.global_id in parts:
                whole = merge_footprints(parts[element.global_id])
                yield Obstacle(
                    element.global_id,
                    element.name,
                    element.ifc_class,
                    storey,
                    whole.polygon,
                    whole.low,
                    whole.high,
                    whole.quality,
                    why,
                )


def _closed(
    access: Iterable[DoorAccess], building: Building, robot: Robot, levels: Sequence[float], walkable: Sequence[int]
) -> Iterable[Obstacle]:
    """Make obstacles of the doorways that the robot may not pass: from jamb to jamb, whatever the leaf's shape."""
    shut = {door.global_id: door for door in access if not door.is_passable}
    for door in building.doors:
        way = doorway_of(door, building) if door.global_id in shut else None
        if way is None:
            continue
        for storey in walkable:
            low, high = max(way.bottom, levels[storey] + robot.low), min(way.top, levels[storey] + robot.height)
            if low < high:
                yield Obstacle(
                    door.global_id,
                    door.name,
                    door.element.ifc_class,
                    storey,
                    way.rectangle(),
                    low,
                    high,
                    "exact",
                    shut[door.global_id].rule,
                )


def _rated(task: Task, building: Building, levels: Sequence[float]) -> tuple[tuple[Zone, ...], tuple[Overruled, ...]]:
    """Make zones of what is to be avoided or never entered; where both pick a thing, the latter holds."""
    from bimnav.tasks import Overruled, choose

    avoided, overruled = choose(task, "avoid", building)
    closed, more = choose(task, "restricted", building)
    overruled += more
    zones: list[Zone] = []
    for global_id, choice in avoided.items():
        if global_id in closed:
            overruled.append(Overruled(global_id, choice.why, f"restricted: {closed[global_id].why}"))
        else:
            zones += _zones(choice, levels, choice.rule.factor)
    for choice in closed.values():
        zones += _zones(choice, levels, math.inf)
    return tuple(zones), tuple(overruled)


def _zones(choice: Choice, levels: Sequence[float], factor: float) -> Iterable[Zone]:
    product, rule, why = choice
    bounds = product.bounds
    if bounds is None:
        return
    polygon = grown(outline(product.shapes), rule.margin)
    if rule.margin:
        why += f", and {rule.margin:g} m around it"
    low, high = bounds[:, 2].tolist()
    storeys = [storey for storey, level in enumerate(levels) if low - NEAR <= level < high]
    if not storeys and isinstance(product, Element):  # a thing that hangs, or lies flat on the floor
        storeys = [storey for storey, level in enumerate(levels) if level <= low + NEAR][-1:]
    for storey in storeys:
        yield Zone(product.global_id, product.name, storey, polygon, factor, why)


def _found(choice: Choice, environment: IndoorEnvironment) -> Target | None:
    """Make a target of an element: its destination is the middle of its plan view."""
    product, rule, why = choice
    bounds = product.bounds
    if bounds is None:
        return None
    polygon = outline(product.shapes)
    center = polygon.centroid if polygon.area > 0 else shapely.box(*bounds[0, :2], *bounds[1, :2]).centroid
    storey = _storey_of(environment, product, center)
    destination = (center.x, center.y, environment.levels[storey])
    task = environment.task
    return Target(
        product.global_id,
        product.label if isinstance(product, Space) else product.name or product.type_name or product.ifc_class,
        storey,
        destination,
        polygon,
        "model",
        why,
        rule.label,
        rule.service_time,
        task.priority if rule.priority is None else rule.priority,
        task.due if rule.due is None else rule.due,
        rule.abilities or task.abilities,
        rule.destination or task.destination,
    )


def _storey_below(environment: IndoorEnvironment, point: BaseGeometry, z: float, top: float = math.inf) -> int:
    """Return the storey that something at a height stands on: the highest floor below it, under it if any is.

    What ends below a floor, such as a sprinkler under its slab, does not stand on it.
    """
    walkable = sorted({region.storey for region in environment.regions}) or [0]
    highest = min(z + NEAR, top + _FLUSH)
    below = [s for s in walkable if environment.levels[s] <= highest] or walkable[:1]
    under = [s for s in below if environment.floor(s).intersects(point)]
    return (under or below)[-1]


def _storey_of(environment: IndoorEnvironment, product: Element | Space, point: BaseGeometry) -> int:
    """Return the storey from which an element is reached: the one it stands on, or the one above a raised floor.

    What lies close under a floor belongs to it if something hides it from the floor below, and nothing
    but panels that are lifted hides it from above.
    """
    assert product.bounds is not None  # noqa: S101 - the caller has seen to it
    (low, high), levels = product.bounds[:, 2].tolist(), environment.levels
    below = _storey_below(environment, point, low, high)
    over = [s for s, level in enumerate(levels) if 0 <= level - high <= UNDER and s != below]
    over = [s for s in over if environment.floor(s).intersects(point)]
    if not over or levels[below] > low:
        return below
    above, sight = min(over, key=lambda s: levels[s]), sight_of(environment.building)
    x, y = point.x, point.y
    feet, bottom, top, head = (np.array([[x, y, z]]) for z in (levels[below] + NEAR, low, high, levels[above] + 1.0))
    scene = sight.within(np.array([feet[0], head[0]]), {product.global_id})
    thin = [e.global_id for e, box in zip(scene.elements, scene.boxes, strict=True) if box[1, 2] - box[0, 2] <= LIFTED]
    is_hidden = scene.hits(feet, bottom)[0][0] >= 0
    lifted = sight.within(np.array([feet[0], head[0]]), {product.global_id, *thin})
    return above if is_hidden and lifted.hits(head, top)[0][0] < 0 else below


def _placed(detection: Detection, environment: IndoorEnvironment, home: int | None) -> Target:
    """Make a target of a detection: on the storey it names, else by its height, else at home or the lowest floor."""
    point = shapely.Point(detection.x, detection.y)
    if detection.storey is None and detection.z is not None:
        storey = _storey_below(environment, point, detection.z)
    elif detection.storey is None and home is not None:
        storey = home
    else:
        storey = environment.storeys_at((detection.x, detection.y, detection.storey))[0]
    footprint = None
    if detection.size is not None:
        width, depth = (side / 2 for side in detection.size)
        x, y = detection.x, detection.y
        footprint = shapely.box(x - width, y - depth, x + width, y + depth)
    return Target(
        detection.global_id,
        detection.name,
        storey,
        (detection.x, detection.y, environment.levels[storey]),
        footprint,
        "user",
        "placed by the user",
        priority=environment.task.priority,
        due=environment.task.due,
        abilities=environment.task.abilities,
        approach=environment.task.destination,
    )
