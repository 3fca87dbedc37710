"""Tiny worlds made by hand, for tests of bimnav and of what is built on it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.building import Building, Connector, Door, Element, Mesh, Opening, Shape, Space, Storey
from bimnav.errors import GeometryError, GridError
from bimnav.grid import Cell

if TYPE_CHECKING:
    from bimnav.plan import Path

__all__ = ["assert_valid_path", "box", "grid_from_text", "prism", "prism_shape", "room", "two_rooms", "two_storeys"]

_PROXY = "IfcBuildingElementProxy"


def grid_from_text(text: str) -> NDArray[np.bool_]:
    """Read a mask of free cells from a picture of it.

    The first line is the top of the picture, the highest y; row 0 of the answer is the last line. Space
    around lines and empty lines do not count.

    Parameters
    ----------
    text
        `.` is free, `#` is blocked.

    Returns
    -------
    free : (rows, cols) bool

    Examples
    --------
    >>> grid_from_text('''
    ...     .#
    ...     ..
    ... ''').tolist()
    [[True, True], [True, False]]
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if len({len(line) for line in lines}) != 1 or set("".join(lines)) - set(".#"):
        raise GridError("the picture is no grid.", "Give lines of equal length, of '.' and '#' only.")
    return np.array([[char == "." for char in line] for line in reversed(lines)])


def prism_shape(polygon: shapely.Polygon | Sequence[tuple[float, float]], low: float, high: float) -> Shape:
    """Make the closed solid over a polygon, between two world heights.

    Parameters
    ----------
    polygon
        A simple polygon, with holes or without, or the corners of one; metres.
    low, high
        Bottom and top in metres.
    """
    plan = shapely.orient_polygons(polygon if isinstance(polygon, shapely.Polygon) else shapely.Polygon(polygon))
    if not (plan.is_valid and plan.area > 0 and low < high):
        raise GeometryError(f"{plan.wkt} from {low} to {high} m is no solid.", "Give a simple polygon and low < high.")
    rings = [shapely.get_coordinates(ring)[:-1] for ring in (plan.exterior, *plan.interiors)]
    corners = np.concatenate(rings)
    index = {(x, y): k for k, (x, y) in enumerate(corners.tolist())}
    n = len(corners)
    faces: list[tuple[int, int, int]] = []
    for triangle in shapely.get_parts(shapely.orient_polygons(shapely.constrained_delaunay_triangles(plan))):
        a, b, c = (index[x, y] for x, y in shapely.get_coordinates(triangle)[:3].tolist())
        faces += [(n + a, n + b, n + c), (c, b, a)]
    first = 0
    for ring in rings:
        ks = range(first, first + len(ring))
        for a, b in zip(ks, (*ks[1:], first), strict=True):
            faces += [(a, b, n + b), (a, n + b, n + a)]
        first += len(ring)
    vertices = np.vstack([np.column_stack([corners, np.full(n, z)]) for z in (low, high)])
    return Shape(Mesh(vertices, np.array(faces)))


def prism(
    global_id: str,
    polygon: shapely.Polygon | Sequence[tuple[float, float]],
    low: float,
    high: float,
    *,
    ifc_class: str = _PROXY,
    name: str = "",
) -> Element:
    """Make an element that is a prism over a polygon; see `prism_shape`."""
    return Element(global_id, ifc_class, name or global_id, shapes=(prism_shape(polygon, low, high),))


def box(
    global_id: str,
    x0: float,
    y0: float,
    z0: float,
    x1: float,
    y1: float,
    z1: float,
    *,
    ifc_class: str = _PROXY,
    name: str = "",
) -> Element:
    """Make an element that is a box from `(x0, y0, z0)` to `(x1, y1, z1)`, world metres."""
    return prism(global_id, shapely.box(x0, y0, x1, y1), z0, z1, ifc_class=ifc_class, name=name)


def room(
    width: float = 5.0,
    depth: float = 4.0,
    *,
    height: float = 2.5,
    thickness: float = 0.2,
    elements: Iterable[Element] = (),
) -> Building:
    """Build a room: one storey, one space, four walls around it.

    The space lies from (0, 0, 0) to (width, depth, height); the walls stand outside it.

    Parameters
    ----------
    width, depth, height
        Inner size along x, y and z, metres.
    thickness
        Of the walls, metres.
    elements
        What stands in it.
    """
    return Building(
        "room",
        (Storey("storey", "Ground floor", 0.0),),
        (_space("space", 0.0, width, depth, height),),
        (*_walls(width, depth, height, thickness), *elements),
    )


def two_rooms(
    width: float = 4.0,
    depth: float = 4.0,
    *,
    door_width: float | None = 0.9,
    door_height: float = 2.1,
    height: float = 2.5,
    thickness: float = 0.2,
    elements: Iterable[Element] = (),
) -> Building:
    """Build two equal rooms side by side, with a closed door in the middle of the wall between them.

    The spaces `space-west` and `space-east` begin at x = 0 and x = width + thickness.

    Parameters
    ----------
    width, depth, height
        Inner size of each room along x, y and z, metres.
    door_width, door_height
        Of the door and of the opening it fills, metres; without a width the rooms are not joined.
    thickness
        Of the walls, metres.
    elements
        What stands in the rooms.
    """
    west, east = width, width + thickness
    between: list[Shape] = []
    doors: tuple[Door, ...] = ()
    plan = shapely.box(west, 0, east, depth)
    if door_width is not None:
        if not (0 < door_width < depth and 0 < door_height < height):
            raise GeometryError(f"a door of {door_width} x {door_height} m does not fit the wall.")
        hole = shapely.box(west, (depth - door_width) / 2, east, (depth + door_width) / 2)
        between = [prism_shape(part, 0.0, height) for part in plan.difference(hole).geoms]
        between.append(prism_shape(hole, door_height, height))
        opening = Opening("opening", "wall-between", ("door",), (prism_shape(hole, 0.0, door_height),))
        x, (_, y0, _, y1) = (west + east) / 2, hole.bounds
        leaf = box("door", x - 0.02, y0, 0.0, x + 0.02, y1, door_height, ifc_class="IfcDoor", name="Door")
        doors = (Door(leaf, opening, door_width, door_height),)
    wall = Element(
        "wall-between", "IfcWall", "Wall between", shapes=tuple(between) or (prism_shape(plan, 0.0, height),)
    )
    return Building(
        "two rooms",
        (Storey("storey", "Ground floor", 0.0),),
        (_space("space-west", 0.0, west, depth, height), _space("space-east", east, east + width, depth, height)),
        (*_walls(east + width, depth, height, thickness), wall, *(door.element for door in doors), *elements),
        doors,
        tuple(door.opening for door in doors if door.opening),
    )


def two_storeys(
    kind: Literal["stair", "ramp", "lift"] = "stair",
    *,
    rise: float = 3.0,
    width: float = 1.2,
    run: float = 3.5,
    elements: Iterable[Element] = (),
) -> Building:
    """Build two rooms, one above the other, joined by a stair, a ramp or a lift.

    The spaces `space-lower` and `space-upper` are as large: 4 m deep, and 3 m longer at both ends than the
    connector, which stands along the wall at y = 0 and begins at x = 3. A lift has its doors at x = 5.

    Parameters
    ----------
    kind
        What joins them: `stair` of 15 risers, `ramp` or `lift`.
    rise
        From floor to floor, metres.
    width, run
        Of the stair or ramp in plan view, metres.
    elements
        What stands in the rooms.
    """
    if kind == "lift":
        width, run = 2.0, 2.0
    plan = shapely.box(3, 0, 3 + run, width)
    length, depth = 6 + run, 4.0
    floor = shapely.box(0, 0, length, depth)
    doors: tuple[Door, ...] = ()
    if kind == "stair":
        treads = np.arange(14) * run / 14 + 3
        shapes = tuple(
            prism_shape(shapely.box(x, 0, x + run / 14, width), 0.0, (k + 1) * rise / 15)
            for k, x in enumerate(treads.tolist())
        )
        way = Element("way", "IfcStairFlight", "Stair", shapes=shapes)
    elif kind == "ramp":
        corners = [(x, y, z) for y in (0.0, width) for x, z in ((3.0, 0.0), (3.0 + run, 0.0), (3.0 + run, rise))]
        faces = [(0, 1, 2), (3, 5, 4), (0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2), (0, 2, 5), (0, 5, 3)]
        way = Element("way", "IfcRampFlight", "Ramp", shapes=(Shape(Mesh(np.array(corners), np.array(faces))),))
    else:
        way = box("way", 3, 0, -0.2, 5, 2, 2 * rise, ifc_class="IfcTransportElement", name="Lift")
        doors = tuple(
            Door(box(f"door-{name}", 5.0, 0.5, z, 5.1, 1.5, z + 2.1, ifc_class="IfcDoor", name="Lift door"), width=1.0)
            for name, z in (("lower", 0.0), ("upper", rise))
        )
    space = (
        Space("space-lower", "Lower", storey="lower", shapes=(prism_shape(floor, 0.0, rise - 0.3),)),
        Space("space-upper", "Upper", storey="upper", shapes=(prism_shape(floor, rise, 2 * rise - 0.3),)),
    )
    slabs = (
        prism("slab-lower", floor, -0.2, 0.0, ifc_class="IfcSlab"),
        prism("slab-upper", floor.difference(plan), rise - 0.2, rise, ifc_class="IfcSlab"),
    )
    high = rise if kind != "stair" else rise * 14 / 15
    return Building(
        "two storeys",
        (Storey("lower", "Lower floor", 0.0), Storey("upper", "Upper floor", rise)),
        space,
        (*_walls(length, depth, 2 * rise, 0.2), *slabs, way, *(door.element for door in doors), *elements),
        doors,
        connectors=(Connector("connector", way.name, kind, ("way",), 0.0, 2 * rise if kind == "lift" else high),),
    )


def _space(global_id: str, x0: float, x1: float, depth: float, height: float) -> Space:
    shape = prism_shape(shapely.box(x0, 0, x1, depth), 0.0, height)
    return Space(global_id, global_id, storey="storey", shapes=(shape,))


def _walls(width: float, depth: float, height: float, thickness: float) -> list[Element]:
    t = thickness
    return [
        box(f"wall-{side}", x0, y0, 0.0, x1, y1, height, ifc_class="IfcWall", name=f"Wall {side}")
        for side, x0, y0, x1, y1 in (
            ("south", -t, -t, width + t, 0.0),
            ("east", width, 0.0, width + t, depth),
            ("north", -t, depth, width + t, depth + t),
            ("west", -t, 0.0, 0.0, depth),
        )
    ]


def assert_valid_path(path: Path) -> None:
    """Check a path against the cells of its graph, whoever planned it.

    All cells are free, each is a neighbor of the one before or joined to it by a connector, no diagonal step
    passes a blocked corner, and the length is the sum of the steps and connectors.

    Raises
    ------
    AssertionError
        If a rule is broken; the message names the rule and the cell.
    """
    free, d = path.graph.free, path.graph.frame.cell_size
    cells = [tuple(cell) for cell in np.asarray(path.indices).tolist()]
    length = 0.0
    if not cells:
        raise AssertionError("the path has no cell")
    for cell in cells:
        if not all(0 <= index < size for index, size in zip(cell, free.shape, strict=True)):
            raise AssertionError(f"{cell} is not a cell of the frame")
        if not free[cell]:
            raise AssertionError(f"{cell} is blocked")
    for (storey, row, col), (storey_b, row_b, col_b) in pairwise(cells):
        rows, cols = abs(row_b - row), abs(col_b - col)
        if storey != storey_b:
            link = path.graph.link_between(Cell(storey, row, col), Cell(storey_b, row_b, col_b))
            if link is None:
                raise AssertionError(f"no connector leads from {(storey, row, col)} to {(storey_b, row_b, col_b)}")
            length += link.length
            continue
        if max(rows, cols) != 1:
            raise AssertionError(f"{(storey_b, row_b, col_b)} is no neighbor of {(storey, row, col)}")
        if rows == cols:
            if path.graph.connectivity == 4:
                raise AssertionError(f"the step from {(storey, row, col)} is diagonal")
            if not (free[storey, row, col_b] and free[storey, row_b, col]):
                raise AssertionError(f"the step from {(storey, row, col)} to {(row_b, col_b)} cuts a corner")
        length += d * (rows + cols) ** 0.5
    if abs(path.length - length) > 1e-9 * max(1.0, length):
        raise AssertionError(f"the steps add up to {length} m, the path says {path.length} m")
