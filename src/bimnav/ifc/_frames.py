"""How the coordinates of one model become those of another, and what in the models tells so."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from bimnav._georeference import turn_of
from bimnav.building import Building, Detection, Door, Element, Opening, Shape, Space, Storey
from bimnav.errors import ValueRangeError

__all__ = [
    "SAME",
    "Frame",
    "boxes_of",
    "called",
    "doors_with",
    "extent_of",
    "find_frame",
    "map_error",
    "moved",
    "placement_of",
]

SAME = 0.01  # metres within which places, sizes and heights are the same
_FEW = 3  # a chair or two may have been moved, and not the building
_NO_TURN = 1e-12  # radians; moves no point on Earth by a hundredth of a millimetre

Placement = NDArray[np.float64]  # (4, 4) metres
Product = TypeVar("Product", Element, Space, Opening)


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """How the coordinates of one model become those of another.

    Parameters
    ----------
    placement : (4, 4) float64, metres
        From the one to the other: a shift, and a turn about the z axis.
    reason
        What tells so.
    evidence
        GlobalIds of what both models hold.
    """

    placement: Placement
    reason: str
    evidence: tuple[str, ...] = ()


def find_frame(model: Building, reference: Building) -> Frame | None:
    """Find how the coordinates of a model become those of another; None if nothing tells."""
    ways = (_by_products, _by_anchors, _by_map, _by_storeys)
    return next((frame for way in ways if (frame := way(model, reference))), None)


def boxes_of(building: Building) -> dict[str, NDArray[np.float64]]:
    """Return the boxes of elements and spaces, (2, 3) metres, by GlobalId; found once for each building."""
    if building not in _boxes:
        products: tuple[Element | Space, ...] = (*building.elements, *building.spaces)
        _boxes[building] = {p.global_id: box for p in products if (box := p.bounds) is not None}
    return _boxes[building]


_boxes: WeakKeyDictionary[Building, dict[str, NDArray[np.float64]]] = WeakKeyDictionary()


def extent_of(building: Building) -> NDArray[np.float64] | None:
    """Return the box of all elements and spaces, (2, 3) metres; None without geometry."""
    boxes = np.array(list(boxes_of(building).values()))
    return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]) if len(boxes) else None


def placement_of(shift: NDArray[np.float64], turn: float = 0.0) -> Placement:
    """Return a turn about the z axis, in radians, and then a shift."""
    placement = np.eye(4)
    if abs(turn) > _NO_TURN:
        placement[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    placement[:3, 3] = shift
    return placement


def _by_products(model: Building, reference: Building) -> Frame | None:
    """Compare where products of the same GlobalId and size lie; most of them must agree."""
    here, there = boxes_of(model), boxes_of(reference)
    shared = [global_id for global_id in here if global_id in there]
    pairs = np.array([(here[global_id], there[global_id]) for global_id in shared]).reshape(-1, 2, 2, 3)
    sizes = np.ptp(pairs, axis=2)
    alike = np.abs(sizes[:, 0] - sizes[:, 1]).max(axis=1) <= SAME
    shifts = (pairs[:, 1] - pairs[:, 0]).mean(axis=1)[alike]
    if not len(shifts):
        return None
    shift = np.median(shifts, axis=0)
    agree = np.abs(shifts - shift).max(axis=1) <= SAME
    needed = 1 if np.abs(shift).max() <= SAME else _FEW
    if 2 * agree.sum() <= len(agree) or agree.sum() < needed:
        return None
    evidence = tuple(np.array(shared)[alike][agree].tolist())
    return Frame(placement_of(shift), "as products with the same GlobalId tell", evidence)


def _by_anchors(model: Building, reference: Building) -> Frame | None:
    """Compare the placements of sites, buildings and storeys of the same GlobalId; all must agree."""
    shared = [global_id for global_id in model.anchors if global_id in reference.anchors]
    extent = extent_of(model)
    if not shared or extent is None:
        return None
    placements = [reference.anchors[global_id] @ np.linalg.inv(model.anchors[global_id]) for global_id in shared]
    ends = np.array([_placed(extent, placement) for placement in placements])
    if np.ptp(ends, axis=0).max() > SAME:
        return None
    try:
        placement = placement_of(placements[0][:3, 3], turn_of(placements[0]))
    except ValueRangeError:
        return None
    return Frame(placement, "as sites, buildings or storeys with the same GlobalId tell", tuple(shared))


def _by_map(model: Building, reference: Building) -> Frame | None:
    """Compare map coordinates; not believed if they tear apart what lies together."""
    here, there, extent = model.georeference, reference.georeference, extent_of(model)
    if here is None or there is None or extent is None or map_error(model, reference) is None:
        return None
    middle = extent.mean(axis=0, keepdims=True)
    placement = placement_of(np.zeros(3), here.rotation - there.rotation)
    placement[:3, 3] = (there.to_model(here.to_map(middle)) - middle @ placement[:3, :3].T)[0]
    around = extent_of(reference)
    if around is not None and _overlap(extent, around) and not _overlap(_placed(extent, placement), around):
        return None
    return Frame(placement, "as map coordinates tell")


def map_error(model: Building, reference: Building) -> float | None:
    """Return how far apart, in metres, two models in one frame put the same point on the map; None if unknown."""
    here, there, extent = model.georeference, reference.georeference, extent_of(model)
    if here is None or there is None or extent is None or not (here.is_mapped and there.is_mapped):
        return None
    if (here.epsg or here.crs_name.casefold()) != (there.epsg or there.crs_name.casefold()):
        return None
    return float(np.abs(here.to_map(extent) - there.to_map(extent)).max())


def _by_storeys(model: Building, reference: Building) -> Frame | None:
    """Compare the heights of storeys of the same name; at least two, and all must agree."""
    there = {called(storey): storey.elevation for storey in reference.storeys}
    pairs = [(storey, there[name]) for storey in model.storeys if (name := called(storey)) in there]
    rises = np.array([height - storey.elevation for storey, height in pairs])
    if len(rises) < 2 or np.ptp(rises) > SAME:
        return None
    evidence = tuple(storey.global_id for storey, _ in pairs)
    return Frame(placement_of(np.array([0, 0, np.median(rises)])), "as storeys of the same name tell", evidence)


def called(storey: Storey) -> str:
    """Return the name of a storey as it is compared."""
    return storey.name.strip().casefold()


def _overlap(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Tell whether two boxes overlap or touch in plan view."""
    return bool((one[0, :2] <= other[1, :2] + SAME).all() and (other[0, :2] <= one[1, :2] + SAME).all())


def _placed(box: NDArray[np.float64], placement: Placement) -> NDArray[np.float64]:
    """Return the box around a box that was moved."""
    corners = np.array([(x, y, z) for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])
    corners = corners @ placement[:3, :3].T + placement[:3, 3]
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def doors_with(
    doors: Iterable[Door], elements: Mapping[str, Element], openings: Mapping[str, Opening]
) -> tuple[Door, ...]:
    """Return doors with other elements and openings, where there are others of their GlobalIds."""
    return tuple(
        replace(
            door,
            element=elements.get(door.global_id, door.element),
            opening=door.opening and openings.get(door.opening.global_id, door.opening),
        )
        for door in doors
    )


def moved(building: Building, placement: Placement) -> Building:
    """Return a building with all its coordinates changed."""

    def of(products: Iterable[Product]) -> dict[str, Product]:
        return {
            product.global_id: replace(
                product, shapes=tuple(Shape(shape.mesh, placement @ shape.placement) for shape in product.shapes)
            )
            for product in products
        }

    elements, openings = of(building.elements), of(building.openings)
    rise = float(placement[2, 3])
    ledger = building.ledger
    return replace(
        building,
        storeys=tuple(replace(storey, elevation=storey.elevation + rise) for storey in building.storeys),
        spaces=tuple(of(building.spaces).values()),
        elements=tuple(elements.values()),
        openings=tuple(openings.values()),
        terrain=tuple(of(building.terrain).values()),
        doors=doors_with(building.doors, elements, openings),
        connectors=tuple(
            replace(connector, low=connector.low + rise, high=connector.high + rise)
            for connector in building.connectors
        ),
        detections=tuple(_carried(detection, placement) for detection in building.detections),
        ledger=replace(ledger, lost_bounds={g: _placed(box, placement) for g, box in ledger.lost_bounds.items()}),
        georeference=building.georeference and building.georeference.moved(placement),
        anchors={global_id: placement @ anchor for global_id, anchor in building.anchors.items()},
    )


def _carried(detection: Detection, placement: Placement) -> Detection:
    x, y, z = (placement @ (detection.x, detection.y, detection.z or 0.0, 1.0))[:3].tolist()
    return replace(detection, x=x, y=y, z=None if detection.z is None else z)
