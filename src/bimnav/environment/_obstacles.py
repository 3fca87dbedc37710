"""What takes floor from a robot: elements in its height band, doors it may not pass, zones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from bimnav._door_access import DoorAccess
from bimnav._doorways import doorway_of
from bimnav._floors import NEAR
from bimnav.building import Building, Element
from bimnav.environment._values import Obstacle, Zone, grown
from bimnav.footprint import Footprint, footprints_of, merge_footprints, outline
from bimnav.robot import Robot

if TYPE_CHECKING:
    from bimnav.tasks import Choice, Overruled, Task

__all__ = ["closed_doors", "obstacles_of", "zones_of"]


def obstacles_of(
    candidates: Sequence[tuple[Element, str]], robot: Robot, levels: Sequence[float], walkable: Sequence[int]
) -> Iterable[Obstacle]:
    """Yield what elements, each with the reason why it blocks, take from the floor of every walkable storey."""
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


def closed_doors(
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


def zones_of(task: Task, building: Building, levels: Sequence[float]) -> tuple[tuple[Zone, ...], tuple[Overruled, ...]]:
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
