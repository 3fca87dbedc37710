"""Where a robot should go: elements that a task picks and points that users place, each on its storey."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from bimnav._floors import NEAR
from bimnav._sight import LIFTED, UNDER, sight_of
from bimnav.building import Building, Detection, Element, Space
from bimnav.environment._values import IndoorEnvironment, Target
from bimnav.footprint import outline

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.tasks import Choice, Overruled

__all__ = ["embodied", "target_at", "target_of"]

_FLUSH = 0.05  # metres; what ends so close under a floor lies on it


def embodied(visited: Mapping[str, Choice], building: Building) -> tuple[dict[str, Choice], tuple[Overruled, ...]]:
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


def target_of(choice: Choice, environment: IndoorEnvironment) -> Target | None:
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


def target_at(detection: Detection, environment: IndoorEnvironment, home: int | None) -> Target:
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
