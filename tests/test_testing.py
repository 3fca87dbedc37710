"""The hand-made worlds are what they say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from bimnav.building import Mesh
from bimnav.errors import GeometryError, GridError
from bimnav.graph import NavGraph
from bimnav.testing import assert_valid_path, box, grid_from_text, prism, prism_shape, room, two_rooms


def volume_of(mesh: Mesh) -> float:
    """Sum the signed volumes of tetrahedra from the origin: positive when faces look outward."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def is_closed(mesh: Mesh) -> bool:
    """Tell whether every directed edge is met once by its reverse."""
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()
    return len(edges) == len(set(map(tuple, edges))) and {(a, b) for a, b in edges} == {(b, a) for a, b in edges}


def test_the_last_line_of_a_picture_is_row_zero():
    free = grid_from_text("""
        #..
        ...
    """)
    assert free.tolist() == [[True, True, True], [False, True, True]]


@pytest.mark.parametrize("picture", ["", "..\n...", "..x"])
def test_a_picture_that_is_no_grid_is_refused(picture):
    with pytest.raises(GridError, match="no grid"):
        grid_from_text(picture)


def test_a_box_is_a_closed_solid_of_its_size():
    element = box("b", 1, 2, 3, 2, 4, 6, ifc_class="IfcFurniture", name="Box")
    assert element.bounds.tolist() == [[1, 2, 3], [2, 4, 6]]
    assert (element.ifc_class, element.name) == ("IfcFurniture", "Box")
    assert volume_of(element.shapes[0].mesh) == pytest.approx(6.0)
    assert is_closed(element.shapes[0].mesh)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.2, 5), min_size=3, max_size=12), st.booleans())
def test_a_prism_over_any_simple_polygon_is_a_closed_solid(radii, holed):
    angles = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    star = shapely.Polygon(np.column_stack([np.cos(angles), np.sin(angles)]) * np.array(radii)[:, None])
    plan = star.difference(shapely.Point(0, 0).buffer(0.02, quad_segs=1)) if holed and len(radii) > 3 else star
    mesh = prism_shape(plan, -1.0, 1.5).mesh
    assert is_closed(mesh)
    assert volume_of(mesh) == pytest.approx(plan.area * 2.5)


def test_corners_may_run_either_way():
    corners = [(0, 0), (0, 1), (1, 1), (1, 0)]
    for order in (corners, corners[::-1]):
        assert volume_of(prism("p", order, 0, 1).shapes[0].mesh) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("corners", "low", "high"),
    [([(0, 0), (1, 1), (1, 0), (0, 1)], 0, 1), ([(0, 0), (1, 0), (2, 0)], 0, 1), ([(0, 0), (1, 0), (0, 1)], 1, 1)],
)
def test_what_is_no_solid_is_refused(corners, low, high):
    with pytest.raises(GeometryError, match="no solid"):
        prism("p", corners, low, high)


def test_a_room_is_a_space_between_four_walls_with_what_stands_in_it():
    building = room(4, 3, elements=[box("table", 1, 1, 0, 2, 2, 0.75)])
    assert [storey.elevation for storey in building.storeys] == [0.0]
    assert building.spaces[0].bounds.tolist() == [[0, 0, 0], [4, 3, 2.5]]
    walls = plan_of(element for element in building if element.ifc_class == "IfcWall")
    assert walls.equals(shapely.box(-0.2, -0.2, 4.2, 3.2).difference(shapely.box(0, 0, 4, 3)))
    assert building["table"].name == "table"


def plan_of(elements) -> shapely.Geometry:
    return shapely.union_all([shapely.box(*shape.bounds[:, :2].ravel()) for e in elements for shape in e.shapes])


def test_two_rooms_share_a_wall_with_a_door_in_its_opening():
    building = two_rooms(4, 4, door_width=0.9)
    (door,) = building.doors
    assert (door.width, door.height, door.opening.fillings) == (0.9, 2.1, ("door",))
    assert building[door.opening.host].bounds.tolist() == [[4, 0, 0], [4.2, 4, 2.5]]
    assert sum(volume_of(s.mesh) for s in building["wall-between"].shapes) == pytest.approx(0.2 * (4 * 2.5 - 0.9 * 2.1))
    assert "door" in building
    assert building.openings == (door.opening,)


def test_two_rooms_without_a_door_are_not_joined():
    building = two_rooms(door_width=None)
    assert (building.doors, building.openings) == ((), ())
    assert len(building["wall-between"].shapes) == 1


def test_a_door_wider_than_the_wall_is_refused():
    with pytest.raises(GeometryError, match="does not fit"):
        two_rooms(depth=1.0, door_width=1.0)


PILLAR = NavGraph.from_mask(
    grid_from_text("""
        ...
        .#.
        ...
    """)
)


def path_over(*cells, length, graph=PILLAR) -> SimpleNamespace:
    return SimpleNamespace(graph=graph, indices=np.array(cells, dtype=np.int32).reshape(-1, 3), length=length)


def test_a_walk_around_the_pillar_is_valid():
    assert_valid_path(path_over((0, 1, 0), (0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 2), length=4.0))
    assert_valid_path(path_over((0, 1, 0), length=0.0))


@pytest.mark.parametrize(
    ("cells", "length", "words"),
    [
        ([], 0.0, "no cell"),
        ([(0, 1, 0), (0, 1, 1)], 1.0, "is blocked"),
        ([(0, 0, 0), (0, 0, -1)], 1.0, "not a cell"),
        ([(0, 0, 0), (0, 0, 2)], 2.0, "no neighbor"),
        ([(0, 0, 0), (0, 0, 0)], 0.0, "no neighbor"),
        ([(0, 0, 1), (0, 1, 2)], 2**0.5, "cuts a corner"),
        ([(0, 0, 0), (0, 0, 1)], 1.5, "add up to 1.0 m"),
    ],
)
def test_a_path_that_breaks_a_rule_is_refused(cells, length, words):
    with pytest.raises(AssertionError, match=words):
        assert_valid_path(path_over(*cells, length=length))


def test_a_diagonal_step_needs_diagonal_neighbors():
    open_floor = np.ones((2, 2), dtype=bool)
    diagonal = (0, 0, 0), (0, 1, 1)
    assert_valid_path(path_over(*diagonal, length=2**0.5, graph=NavGraph.from_mask(open_floor, connectivity=8)))
    with pytest.raises(AssertionError, match="is diagonal"):
        assert_valid_path(path_over(*diagonal, length=2**0.5, graph=NavGraph.from_mask(open_floor, connectivity=4)))
