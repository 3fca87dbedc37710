"""What becomes of elements whose geometry was lost: an obstacle nobody sees must not be driven through."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.building import Building, Element, Mesh, Shape
from bimnav.errors import IncompleteModelError, ValueRangeError

if TYPE_CHECKING:
    from bimnav.plan import Tour

__all__ = ["Lost", "refuse_lost", "with_boxes"]

Lost: TypeAlias = Literal["abort", "box", "ignore"]

_HINT = "Repair the model, or take their boxes as obstacles with --lost box, or leave them out with --lost ignore."
_FACES = np.array(  # of a box whose corners are counted by x, then y, then z
    [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 1, 3], [0, 3, 2],
     [4, 6, 7], [4, 7, 5]]
)  # fmt: skip


def with_boxes(building: Building, how: Lost | Mapping[str, Lost]) -> Building:
    """Return the building with boxes for the lost elements that are to have one.

    Parameters
    ----------
    building
        As read; its ledger says what was lost.
    how
        One treatment for all lost elements, or one by GlobalId; those not named are `abort`.

    Raises
    ------
    IncompleteModelError
        If nothing in the file says how far an element reaches that is to have a box.
    """
    for treatment in how.values() if isinstance(how, Mapping) else (how,):
        if treatment not in ("abort", "box", "ignore"):
            raise ValueRangeError(f"lost is {treatment!r}.", "Give 'abort', 'box' or 'ignore'.")
    boxed = {}
    for element in _lost_elements(building, how, "box"):
        bounds = building.ledger.lost_bounds.get(element.global_id)
        if bounds is None:
            raise IncompleteModelError(
                f"{_named(building, [element])} was lost, and the file does not say how far it reaches.",
                "Repair the model, or leave the element out with --lost ignore.",
                {"lost": [element.global_id]},
            )
        boxed[element.global_id] = replace(element, shapes=(*element.shapes, _box(bounds)))
    if not boxed:
        return building
    return replace(building, elements=tuple(boxed.get(e.global_id, e) for e in building.elements))


def refuse_lost(tour: Tour, how: Lost | Mapping[str, Lost]) -> None:
    """Refuse a tour that leads through a place where an obstacle was lost and nobody said what to do about it.

    Raises
    ------
    IncompleteModelError
        Naming the elements and why they were lost.
    """
    environment = tour.graph.environment
    if environment is None:
        return
    building, robot = environment.building, environment.robot
    ways = [shapely.LineString(leg[:, :2]) for leg in tour.route if len(leg) > 1]
    heights = {float(z) for leg in tour.route for z in leg[:, 2]} | {tour.start_point[2]}
    met = []
    for element in _lost_elements(building, how, "abort"):
        bounds = building.ledger.lost_bounds.get(element.global_id)
        if bounds is None:
            met.append(element)  # it may be anywhere
            continue
        (x0, y0, low), (x1, y1, high) = bounds
        is_in_band = any(low < z + robot.height and high > z + robot.low for z in heights)
        if is_in_band and any(way.distance(shapely.box(x0, y0, x1, y1)) <= robot.radius for way in ways):
            met.append(element)
    if met:
        raise IncompleteModelError(
            f"the way leads through {len(met)} places where an element was lost: {_named(building, met)}.",
            _HINT,
            {"lost": [element.global_id for element in met]},
        )


def _lost_elements(building: Building, how: Lost | Mapping[str, Lost], treatment: Lost) -> Iterable[Element]:
    """Yield the lost elements of one treatment that could stand in the way."""
    for global_id in building.ledger.lost:
        chosen = how.get(global_id, "abort") if isinstance(how, Mapping) else how
        if chosen == treatment and global_id in building:
            element = building[global_id]
            if not element.ifc_class.startswith("IfcDoor"):
                yield element


def _named(building: Building, elements: list[Element]) -> str:
    shown = [f"{e.ifc_class} {e.name} ({e.global_id}): {building.ledger.lost[e.global_id]}" for e in elements[:3]]
    return "; ".join(shown) + (f"; and {len(elements) - 3} more" if len(elements) > 3 else "")


def _box(bounds: NDArray[np.float64]) -> Shape:
    corners = np.array(list(product(*bounds.T)))
    return Shape(Mesh(corners, _FACES, "hull"))
