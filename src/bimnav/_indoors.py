"""What lies inside a building at a height: the plan that its walls, windows and doors go round."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import shapely

from bimnav._doorways import doorway_of
from bimnav.building import Building, Element, Shape
from bimnav.footprint import footprints_of, unite

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

__all__ = ["Shell", "filled", "opened", "part_in"]

_WALLS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcMember", "IfcWindow", "IfcColumn")
_CUT = (1.2, 1.5)  # metres above a floor: over parapets and railings, through windows, under lintels
_SILL = 0.1  # metres above a floor
_JOINT = 0.25  # metres; a gap in a facade up to twice as wide is bad joinery, not a way out
_ENCLOSED = 0.5  # share of what the hull of the walls holds; walls that enclose less do not enclose


def part_in(shapes: Sequence[Shape], low: float, high: float) -> BaseGeometry:
    """Return the plan view of what lies between two world heights."""
    return unite(part.polygon for part in footprints_of(shapes, low, high) if part is not None)


def filled(polygon: BaseGeometry) -> BaseGeometry:
    """Return a polygon without its holes."""
    parts = [part for part in shapely.get_parts(polygon) if part.geom_type == "Polygon"]
    return unite(shapely.Polygon(part.exterior) for part in parts)


def opened(polygon: BaseGeometry, width: float) -> BaseGeometry:
    """Return a polygon without the parts that are narrower than a width, metres."""
    eroded = shapely.buffer(polygon, -width / 2, join_style="mitre")
    return shapely.buffer(eroded, width / 2, join_style="mitre").intersection(polygon)


class Shell:
    """What stands between the inside of a building and the outside: walls, windows, doors, sloping roofs."""

    def __init__(self, building: Building) -> None:
        walls = [element for element in building.elements if element.ifc_class.startswith(_WALLS)]
        hosts = {wall.global_id for wall in walls}
        ways = (doorway_of(opening, building) for opening in building.openings if opening.host in hosts)
        self._walls = _shapes_of(walls)
        self._rest = _shapes_of([*(door.element for door in building.doors), *filter(_is_roof, building.elements)])
        self._holes = [way for way in ways if way is not None]
        self._rooms = [shape for space in building.spaces for shape in space.shapes]

    @property
    def is_bare(self) -> bool:
        """Whether nothing tells inside from outside."""
        return not (self._walls or self._rooms)

    def walls(self, level: float) -> BaseGeometry:
        """Return the plan of the walls, windows and columns that stand on a floor, down to their sills."""
        return part_in(self._walls, level + _SILL, level + _CUT[1])

    def inside(self, level: float) -> BaseGeometry:
        """Return the plan of all that walls or rooms enclose on a floor, walls included.

        In a building without rooms, walls that do not close are taken to enclose their hull.
        """
        low, high = level + _CUT[0], level + _CUT[1]
        holes = [way.rectangle() for way in self._holes if way.bottom < high and way.top > low]
        rest = (part_in(shapes, low, high) for shapes in (self._rest, self._rooms))
        walls = part_in(self._walls, low, high)
        ring = shapely.buffer(unite([walls, *holes, *rest]), _JOINT, join_style="mitre")
        inside = shapely.buffer(filled(ring), -_JOINT, join_style="mitre")
        hull = shapely.convex_hull(walls)
        if not self._rooms and inside.area - walls.area < _ENCLOSED * (hull.area - walls.area):
            return hull
        return inside


def _is_roof(element: Element) -> bool:
    """Tell a roof, which closes an attic where its walls are low."""
    return element.ifc_class == "IfcRoof" or element.predefined_type == "ROOF"


def _shapes_of(products: Iterable[Element]) -> list[Shape]:
    return [shape for product in products for shape in product.shapes]
