"""Footprints: analytic solids, a second opinion from manifold3d and shapely, and laws that hold for any solid."""

from __future__ import annotations

import math
from collections.abc import Sequence

import manifold3d
import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings, strategies as st
from numpy.typing import NDArray

import bimnav.footprint
from bimnav.building import Mesh, Shape
from bimnav.errors import ValueRangeError
from bimnav.footprint import Footprint, footprint, footprints_of, merge_footprints, project, subtract, unite, whole

INF = math.inf
FAR = np.array([1_186_400.123, 5_200_300.456, 431.5])
GRID = 1e-9  # without it, GEOS may take two polygons that differ by rounding for disjoint ones
quick = settings(max_examples=40, deadline=None)


# --- solids ---------------------------------------------------------------------------------------


def mesh_of(solid: manifold3d.Manifold) -> Mesh:
    result = solid.to_mesh64()
    return Mesh(result.vert_properties[:, :3], result.tri_verts.astype(np.int32))


def cuboid(low: Sequence[float], high: Sequence[float]) -> manifold3d.Manifold:
    size = np.subtract(high, low)
    return manifold3d.Manifold.cube(size.tolist()).translate(list(low))


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    return mesh_of(cuboid(low, high))


def prism(profile: Sequence[Sequence[float]], low: float, high: float) -> Mesh:
    section = manifold3d.CrossSection([np.array(profile, dtype=float)])
    return mesh_of(section.extrude(high - low).translate([0, 0, low]))


def together(*meshes: Mesh) -> Mesh:
    """Put meshes into one, without uniting them."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def table() -> Mesh:
    """A top of 2 m by 1 m on four legs of 75 mm."""
    legs = [box((x, y, 0), (x + 0.075, y + 0.075, 0.71)) for x in (0.25, 1.675) for y in (0.05, 0.875)]
    return together(box((0, 0, 0.71), (2, 1, 0.75)), *legs)


def reversed_(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])


def without_faces_at(mesh: Mesh, height: float) -> Mesh:
    at_height = (mesh.vertices[mesh.faces, 2] == height).all(axis=1)
    return Mesh(mesh.vertices, mesh.faces[~at_height])


def placement(
    *, yaw: float = 0.0, pitch: float = 0.0, shift: Sequence[float] = (0, 0, 0), mirror: Sequence[float] = (1, 1, 1)
) -> NDArray[np.float64]:
    cz, sz, cx, sx = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1.0]])
    about_x = np.array([[1.0, 0, 0], [0, cx, -sx], [0, sx, cx]]) if pitch else np.eye(3)
    matrix = np.eye(4)
    matrix[:3, :3] = about_z @ about_x @ np.diag(np.array(mirror, dtype=float))
    matrix[:3, 3] = shift
    return matrix


def manifold_of(mesh: Mesh) -> manifold3d.Manifold:
    return manifold3d.Manifold(manifold3d.Mesh64(np.array(mesh.vertices), mesh.faces.astype(np.uint64)))


# --- second opinions ------------------------------------------------------------------------------


def by_manifold(mesh: Mesh, low: float, high: float) -> shapely.Geometry:
    """Cut a closed mesh with two planes and project what is left."""
    solid = manifold_of(mesh)
    if math.isfinite(low):
        solid = solid.trim_by_plane((0, 0, 1), low + 1e-4)
    if math.isfinite(high):
        solid = solid.trim_by_plane((0, 0, -1), -(high - 1e-4))
    parts = [part.to_polygons() for part in solid.project().decompose()]
    return shapely.make_valid(shapely.MultiPolygon([shapely.Polygon(rings[0], rings[1:]) for rings in parts if rings]))


def clipped(corners: NDArray[np.float64], sign: float, height: float) -> NDArray[np.float64]:
    """Cut a convex polygon in space with a horizontal plane (Sutherland and Hodgman)."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        above_a, above_b = sign * (a[2] - height), sign * (b[2] - height)
        if above_a > 0:
            kept.append(a)
        if (above_a > 0) != (above_b > 0):
            kept.append(a + (b - a) * above_a / (above_a - above_b))
    return np.array(kept).reshape(-1, 3)


def by_triangles(mesh: Mesh, low: float, high: float) -> shapely.Geometry:
    """Unite the plan views of all triangles between two heights."""
    pieces = [clipped(clipped(corners, 1, low + 1e-4), -1, high - 1e-4) for corners in mesh.vertices[mesh.faces]]
    hulls = [shapely.MultiPoint(corners[:, :2]).convex_hull for corners in pieces if len(corners)]
    return shapely.union_all([hull for hull in hulls if hull.area > 1e-12], grid_size=GRID)


def assert_same(found: shapely.Geometry, expected: shapely.Geometry, slack: float = 1e-6) -> None:
    difference = shapely.symmetric_difference(found, expected, grid_size=GRID).area
    assert difference <= slack * (1 + expected.area), (difference, found.area, expected.area)


def assert_within(inner: shapely.Geometry, outer: shapely.Geometry, slack: float = 1e-6) -> None:
    assert shapely.difference(inner, outer, grid_size=GRID).area <= slack * (1 + outer.area)


# --- analytic solids ------------------------------------------------------------------------------


@pytest.mark.parametrize("band", [(-INF, INF), (0.0, 3.0), (1.0, 1.2), (-5.0, 0.5), (2.9, 10.0)])
def test_a_box_covers_its_rectangle_in_every_band_that_meets_it(band):
    found = footprint(Shape(box((1, 2, 0), (4, 2.5, 3))), *band)
    assert_same(found.polygon, shapely.box(1, 2, 4, 2.5), 1e-8)
    assert (found.low, found.high, found.quality) == (max(band[0], 0), min(band[1], 3), "exact")


def test_a_table_covers_its_top_from_above_and_its_legs_at_robot_height():
    shape = Shape(table())
    assert project(shape).polygon.area == pytest.approx(2.0, abs=1e-6)
    legs = footprint(shape, 0.05, 0.60)
    assert legs.polygon.area == pytest.approx(4 * 0.075**2, abs=1e-6)
    assert len(legs.polygon.geoms) == 4
    assert (legs.low, legs.high) == (0.05, 0.60)


def test_a_profile_with_a_corner_covers_just_its_profile():
    corner = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)]
    found = footprint(Shape(prism(corner, 0, 2.5)), 0.05, 1.5)
    assert_same(found.polygon, shapely.Polygon(corner), 1e-8)
    assert found.polygon.area == pytest.approx(4.0, abs=1e-6)


def test_a_cylinder_covers_its_polygon_of_corners():
    found = footprint(Shape(mesh_of(manifold3d.Manifold.cylinder(2, 0.5, 0.5, 40))), 0.5, 1.0)
    assert found.polygon.area == pytest.approx(20 * 0.25 * math.sin(2 * math.pi / 40), abs=1e-6)


def test_a_ring_keeps_its_hole():
    ring = manifold_of(prism([(0, 0), (4, 0), (4, 4), (0, 4)], 0, 1)) - cuboid((1, 1, -1), (3, 3, 2))
    found = footprint(Shape(mesh_of(ring)), 0.2, 0.8)
    assert len(found.polygon.interiors) == 1
    assert found.polygon.area == pytest.approx(12, abs=1e-6)


def test_an_island_inside_a_hole_is_kept():
    ring = manifold_of(prism([(0, 0), (4, 0), (4, 4), (0, 4)], 0, 1)) - cuboid((1, 1, -1), (3, 3, 2))
    found = footprint(Shape(together(mesh_of(ring), box((1.5, 1.5, 0), (2.5, 2.5, 1)))), 0.2, 0.8)
    assert found.polygon.area == pytest.approx(13, abs=1e-6)
    assert sorted(len(part.interiors) for part in found.polygon.geoms) == [0, 1]


def test_a_torus_covers_less_above_its_middle():
    circle = manifold3d.CrossSection.circle(0.3, 24).translate((1.0, 0.0))
    mesh = mesh_of(manifold3d.Manifold.revolve(circle, 48))
    for band in ((-INF, INF), (-1, 0.1), (0.1, 0.2), (0.25, 1)):
        found = footprint(Shape(mesh), *band)
        assert_same(found.polygon, by_manifold(mesh, *band))
        assert len(found.polygon.interiors) == 1


def test_a_stair_covers_the_steps_that_reach_into_the_band():
    steps = together(*(box((i * 0.3, 0, 0), ((i + 1) * 0.3, 1.2, (i + 1) * 0.18)) for i in range(8)))
    found = footprint(Shape(steps), 0.5, 1.8)  # the first two steps end at 0.36 m
    assert found.polygon.area == pytest.approx(6 * 0.3 * 1.2, abs=1e-6)


def test_a_slope_covers_what_lies_between_the_heights():
    ramp = prism([(0, 0), (4, 0), (4, 1)], 0, 1)  # its profile, to be put upright
    turned = Mesh(ramp.vertices[:, [0, 2, 1]], ramp.faces)
    found = footprint(Shape(turned), 0.25, 0.75)
    assert found.polygon.bounds == pytest.approx((4 * (0.25 + 1e-4), 0, 4, 1), abs=1e-7)


def test_a_wall_with_a_door_is_open_below_the_lintel_and_closed_above():
    wall = subtract(box((0, 0, 0), (5, 0.2, 3)), [(box((2, 0, 0), (3, 0.2, 2.1)), np.eye(4))])
    below, above = footprint(Shape(wall), 0.05, 1.5), footprint(Shape(wall), 0.05, 2.5)
    assert_same(below.polygon, shapely.box(0, 0, 5, 0.2) - shapely.box(2, 0, 3, 0.2), 1e-5)
    assert len(below.polygon.geoms) == 2
    assert_same(above.polygon, shapely.box(0, 0, 5, 0.2))


def test_heights_are_those_of_the_part_inside_the_band():
    shape = Shape(together(box((0, 0, 0), (1, 1, 0.02)), box((0, 0, 0.5), (1, 1, 0.55))))
    found = footprint(shape, 0.05, 0.6)
    assert (found.low, found.high) == pytest.approx((0.5, 0.55))


# --- placements -----------------------------------------------------------------------------------


def test_a_footprint_far_from_the_origin_is_as_precise_as_one_nearby():
    found = footprint(Shape(table(), placement(yaw=0.3, shift=FAR)), 431.55, 432.1)
    nearby = footprint(Shape(table(), placement(yaw=0.3)), 0.05, 0.6)
    moved = shapely.transform(found.polygon, lambda xy: xy - FAR[:2])
    assert_same(moved, nearby.polygon, 1e-8)
    assert (found.low, found.high) == (431.55, 432.1)


def test_a_mesh_whose_own_coordinates_are_far_away_is_as_precise():
    mesh = Mesh(table().vertices + FAR, table().faces)
    for matrix in (np.eye(4), placement(pitch=1e-9)):
        found = footprint(Shape(mesh, matrix), 431.55, 432.1)
        assert found.polygon.area == pytest.approx(0.0225, abs=1e-6)


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)])
@pytest.mark.parametrize("pitch", [0.0, 0.4])
def test_mirrored_placements_cover_what_their_world_meshes_cover(mirror, pitch):
    corner = prism([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)], 0, 2.5)
    shape = Shape(corner, placement(yaw=0.7, pitch=pitch, mirror=mirror, shift=(5, 6, 0.2)))
    in_world = whole(Mesh(shape.world_vertices(), corner.faces))
    found = footprint(shape, 0.3, 1.4) if mirror[2] > 0 else footprint(shape, -1.4, -0.1)
    expected = by_manifold(in_world, 0.3, 1.4) if mirror[2] > 0 else by_manifold(in_world, -1.4, -0.1)
    assert_same(found.polygon, expected)


def test_copies_of_a_mesh_at_one_height_are_worked_on_once(monkeypatch):
    calls = []
    cover = bimnav.footprint._cover
    monkeypatch.setattr(bimnav.footprint, "_cover", lambda *args: calls.append(1) or cover(*args))
    mesh = table()
    shapes = [Shape(mesh, placement(yaw=i / 10, shift=(i, -i, 0))) for i in range(50)]
    assert len(footprints_of(shapes, 0.05, 0.6)) == 50
    assert len(calls) == 1


def test_many_shapes_get_what_each_would_get_alone():
    mesh = table()
    shapes = [
        *(Shape(mesh, placement(yaw=i, shift=(i, 2 * i, 0.1 * i))) for i in range(6)),
        Shape(mesh, placement(pitch=0.5)),
        Shape(Mesh(np.zeros((0, 3)), np.zeros((0, 3)))),
        Shape(box((0, 0, 5), (1, 1, 6))),
    ]
    lows = np.linspace(0.0, 0.5, len(shapes))
    for low, shape, found in zip(lows, shapes, footprints_of(shapes, lows, 1.0), strict=True):
        alone = footprint(shape, low, 1.0)
        assert (found is None) == alone.polygon.is_empty
        if found is not None:
            assert found.polygon.equals_exact(alone.polygon, 0)
            assert (found.low, found.high, found.quality) == (alone.low, alone.high, alone.quality)
    assert footprints_of([], 0, 1) == []


# --- inside the band or outside -------------------------------------------------------------------


@pytest.mark.parametrize("band", [(3.0, 5.0), (-2.0, 0.0), (3.5, 4.0), (-INF, -1.0)])
def test_a_solid_that_only_touches_the_band_is_outside(band):
    shape = Shape(box((0, 0, 0), (1, 1, 3)))
    assert footprints_of([shape], *band) == [None]
    found = footprint(shape, *band)
    assert found.polygon.is_empty
    assert math.isnan(found.low)


@pytest.mark.parametrize("band", [(1.0, 1.0), (2.0, 1.0), (math.nan, 1.0)])
def test_a_band_without_height_is_refused(band):
    with pytest.raises(ValueRangeError):
        footprint(Shape(table()), *band)


# --- meshes that are not as they should be --------------------------------------------------------


def test_a_good_mesh_is_left_alone():
    mesh = table()
    assert whole(mesh) is mesh


def test_inside_out_parts_are_turned_one_by_one():
    good, bad = box((0, 0, 0), (2, 2, 1)), reversed_(box((1, 1, 0), (3, 3, 1)))
    mesh = whole(together(good, bad))
    assert mesh.quality == "exact"
    assert manifold_of(mesh).volume() == pytest.approx(8)
    expected = shapely.box(0, 0, 2, 2) | shapely.box(1, 1, 3, 3)
    assert_same(footprint(Shape(together(good, bad)), 0.2, 0.8).polygon, expected, 1e-8)


def test_faces_turned_at_random_are_turned_back():
    faces = np.array(table().faces)
    faces[::3] = faces[::3, ::-1]
    mesh = whole(Mesh(table().vertices, faces))
    assert mesh.quality == "exact"
    assert manifold_of(mesh).volume() == pytest.approx(2 * 0.04 + 4 * 0.075**2 * 0.71)


def test_parts_that_share_an_edge_are_turned_one_by_one():
    one, other = box((0, 0, 0), (1, 1, 1)), reversed_(box((1, 1, 0), (2, 2, 1)))
    mesh = together(one, other)
    vertices, same = np.unique(mesh.vertices, axis=0, return_inverse=True)
    mesh = whole(Mesh(vertices, same.reshape(-1)[mesh.faces]))
    assert mesh.quality == "exact"
    assert manifold_of(mesh).volume() == pytest.approx(2)


def test_corners_that_are_nearly_one_are_welded():
    mesh = table()
    loose = mesh.vertices[mesh.faces].reshape(-1, 3)
    loose += np.random.default_rng(0).uniform(-1e-7, 1e-7, loose.shape)
    mesh = whole(Mesh(loose, np.arange(len(loose)).reshape(-1, 3)))
    assert mesh.quality == "repaired"
    assert footprint(Shape(mesh), 0.05, 0.6).quality == "repaired"
    assert project(Shape(mesh)).polygon.area == pytest.approx(2, abs=1e-5)


def test_faces_that_use_a_corner_twice_are_left_out():
    mesh = box((0, 0, 0), (1, 1, 1))
    odd = Mesh(mesh.vertices, np.concatenate([mesh.faces, [[0, 0, 1], [2, 2, 2]]]))
    assert whole(odd).quality == "exact"
    assert len(whole(odd).faces) == len(mesh.faces)


@pytest.mark.parametrize("missing", [0.0, 1.0])
def test_a_box_without_lid_or_floor_still_covers_its_rectangle(missing):
    mesh = whole(without_faces_at(box((0, 0, 0), (2, 1, 1)), missing))
    assert mesh.quality == "surface"
    for band in ((-INF, INF), (0.2, 0.8), (-1, 0.5), (0.5, 2)):
        found = footprint(Shape(mesh), *band)
        assert_same(found.polygon, shapely.box(0, 0, 2, 1), 1e-8)
        assert found.quality == "surface"


def test_a_box_open_at_both_ends_covers_its_rectangle_wherever_a_section_closes():
    mesh = without_faces_at(without_faces_at(box((0, 0, 0), (2, 1, 1)), 0.0), 1.0)
    for band in ((0.2, 0.8), (-1, 0.5), (0.5, 2)):
        assert_same(footprint(Shape(mesh), *band).polygon, shapely.box(0, 0, 2, 1), 1e-8)
    seen_from_above = project(Shape(mesh)).polygon  # no section: four sheets on edge
    assert seen_from_above.area == pytest.approx(6 * 1e-3, rel=1e-2)


def test_the_same_box_with_loose_corners_covers_as_much():
    mesh = without_faces_at(box((0, 0, 0), (2, 1, 1)), 0.0)
    loose = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))
    assert_same(footprint(Shape(loose), -1, 0.5).polygon, shapely.box(0, 0, 2, 1), 1e-8)


@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]]])
@pytest.mark.parametrize("bottom", [-1.0, 0.3])
def test_a_sheet_on_edge_is_given_a_millimetre(faces, bottom):
    corners = [(0, 0, bottom), (3, 4, bottom), (3, 4, 0.9), (0, 0, 0.9)]
    found = footprint(Shape(Mesh(np.array(corners), np.array(faces))), 0.05, 2.0)
    assert found.polygon.area == pytest.approx(5 * 1e-3, rel=1e-3)
    assert found.polygon.buffer(1e-9).covers(shapely.LineString([(0, 0), (3, 4)]))


def test_a_sheet_beside_a_solid_stays():
    sheet = Mesh(np.array([(3, 0, 0), (3, 1, 0), (3, 0.5, 1)], dtype=float), np.array([[0, 1, 2]]))
    found = footprint(Shape(together(box((0, 0, 0), (1, 1, 1)), sheet)), 0.05, 0.5)
    assert found.polygon.area == pytest.approx(1 + 0.95e-3, abs=1e-5)
    assert found.quality == "surface"


def test_what_has_no_extent_in_plan_view_does_not_vanish():
    upright = Mesh(np.array([(1, 1, 0), (1, 1, 1), (1, 1, 2)], dtype=float), np.array([[0, 1, 2]]))
    assert footprint(Shape(upright), 0.5, 0.6).polygon.area == pytest.approx(1e-6, rel=1e-3)
    needle = mesh_of(manifold3d.Manifold.cylinder(1, 1e-6, 1e-6, 8))
    assert 0 < footprint(Shape(needle), 0.5, 0.6).polygon.area < 2e-6


def test_an_open_mesh_covers_the_plan_view_of_all_its_faces():
    rng = np.random.default_rng(3)
    mesh = Mesh(rng.uniform(0, 2, (30, 3)), rng.permutation(30).reshape(-1, 3))
    found = footprint(Shape(mesh), 0.4, 1.5)
    assert_same(found.polygon, by_triangles(mesh, 0.4, 1.5))


def test_a_profile_that_crosses_itself_covers_all_its_lobes():
    corners = [(0, 0), (1, 1), (3, 3), (3, 1), (1, 1), (0, 2)]  # one lobe runs clockwise; (1, 1) is there twice
    sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6) for i in range(6)] + [(i, (i + 1) % 6 + 6, i + 6) for i in range(6)]
    caps = [(5, 1, 0), (5, 4, 1), (4, 2, 1), (4, 3, 2)]
    caps += [(c + 6, b + 6, a + 6) for a, b, c in caps]
    vertices = [(x, y, z) for z in (0.0, 1.0) for x, y in corners]
    mesh = Mesh(np.array(vertices), np.array(sides + caps))
    assert whole(mesh).quality == "exact"
    expected = shapely.Polygon([(0, 0), (1, 1), (0, 2)]) | shapely.Polygon([(1, 1), (3, 3), (3, 1)])
    for band in ((-INF, INF), (-1, 0.5), (0.2, 0.8), (0.5, 2)):
        for turned in (mesh, reversed_(mesh)):
            assert_same(footprint(Shape(turned), *band).polygon, expected, 1e-8)


def test_what_a_boolean_left_standing_out_is_removed():
    finned = [(0, 0), (1, 0), (1, 1), (0.5 + 1e-7, 1), (0.5 + 1e-7, 2.2), (0.5, 2.2), (0.5, 1), (0, 1)]
    found = footprint(Shape(prism(finned, 0, 1)), 0.2, 0.8)
    assert_same(found.polygon, shapely.box(0, 0, 1, 1))
    assert found.polygon.bounds == pytest.approx((0, 0, 1, 1), abs=1e-6)


def test_thin_glass_is_kept():
    found = footprint(Shape(box((0, 0, 0), (3, 1e-5, 1))), 0.2, 0.8)
    assert found.polygon.area == pytest.approx(3e-5, rel=1e-2)


# --- openings -------------------------------------------------------------------------------------


WALL = box((0, 0, 0), (5, 0.2, 3))


def test_flush_openings_leave_no_skin():
    flush = box((1, 0, 0), (2, 0.2, 3))
    nearly = box((3, 1e-9, 1), (4, 0.2 - 1e-9, 2))  # what is left of a turn there and back
    cut = subtract(WALL, [(flush, np.eye(4)), (nearly, np.eye(4))])
    assert len(footprint(Shape(cut), 0.05, 0.9).polygon.geoms) == 2
    assert len(footprint(Shape(cut), 1.2, 1.8).polygon.geoms) == 3
    assert manifold_of(cut).volume() == pytest.approx(0.2 * (15 - 3 - 1), abs=1e-4)


def test_openings_are_placed_in_the_coordinates_of_the_host():
    opening = box((-0.5, -0.5, 0), (0.5, 0.5, 2))
    for matrix in (
        placement(shift=(2.5, 0, 0)),
        placement(yaw=math.pi / 2, shift=(2.5, 0, 0)),
        placement(mirror=(-1, 1, 1), shift=(2.5, 0, 0)),
    ):
        cut = subtract(WALL, [(opening, matrix)])
        assert cut.quality == "exact"
        assert footprint(Shape(cut), 0.1, 1).polygon.area == pytest.approx(0.8, abs=1e-5)


def test_openings_far_from_the_origin_are_cut_as_precisely():
    host, opening = Mesh(WALL.vertices + FAR, WALL.faces), box((2, -0.1, 0), (3, 0.3, 2))
    cut = subtract(host, [(opening, placement(shift=FAR))])
    assert footprint(Shape(cut), 431.6, 432.5).polygon.area == pytest.approx(0.8, abs=1e-5)


def test_openings_beside_the_host_are_not_looked_at(monkeypatch):
    monkeypatch.setattr(bimnav.footprint._solids, "_solid", None)
    opened = without_faces_at(box((8, 0, 0), (9, 1, 1)), 0.0)
    assert subtract(WALL, [(opened, np.eye(4))]) is WALL


def test_an_open_mesh_never_reaches_manifold3d(monkeypatch):
    monkeypatch.setattr(bimnav.footprint._solids, "_solid", None)  # calling it would raise
    solid, opened = box((1, -1, 0), (2, 1, 1)), without_faces_at(box((1, -1, 0), (2, 1, 1)), 1.0)
    assert subtract(without_faces_at(WALL, 3.0), [(solid, np.eye(4))]) is None
    assert subtract(WALL, [(solid, np.eye(4)), (opened, np.eye(4))]) is None


def test_a_host_that_is_cut_away_has_no_faces():
    cut = subtract(WALL, [(WALL, np.eye(4))])
    assert len(cut.faces) == 0
    assert footprints_of([Shape(cut)], 0, 1) == [None]
    assert subtract(cut, [(WALL, np.eye(4))]) is cut


def test_an_inside_out_host_and_opening_are_cut_as_they_are_meant():
    cut = subtract(reversed_(WALL), [(reversed_(box((2, 0, 0), (3, 0.2, 2))), np.eye(4))])
    assert footprint(Shape(cut), 0.1, 1).polygon.area == pytest.approx(0.8, abs=1e-5)


# --- merging --------------------------------------------------------------------------------------


def test_merged_footprints_are_one_with_the_worst_quality():
    one = Footprint(shapely.box(0, 0, 2, 1), 0.1, 0.5, "exact")
    other = Footprint(shapely.box(1, 0, 3, 1), 0.3, 0.9, "surface")
    nothing = Footprint(shapely.Polygon(), math.nan, math.nan, "exact")
    merged = merge_footprints([one, nothing, other])
    assert merged.polygon.area == pytest.approx(3)
    assert (merged.low, merged.high, merged.quality) == (0.1, 0.9, "surface")
    assert merge_footprints([nothing]).polygon.is_empty
    assert merge_footprints([]).polygon.is_empty


def test_a_union_loses_nothing_to_rounding():
    near = shapely.Polygon([(1.2513509037296007, 2.507034296880502), (-0.6481890353427064, 3.064374498076482),
                            (1.1944710698585093, 4.071024301483727)])  # fmt: skip
    inside = shapely.Polygon([(-0.6481890353427063, 3.064374498076482), (1.1944710698585093, 4.071024301483727),
                              (0.7480260020259782, 3.4283643494811096)])  # fmt: skip
    beside = shapely.Polygon([(1.6977959715621318, 3.1496942488831197), (1.222910986794055, 3.289029299182115),
                              (1.1944710698585093, 4.071024301483727)])  # fmt: skip
    united = unite([near, inside, beside])
    assert united.area == pytest.approx(near.area + (beside - near).area, abs=1e-7)
    far = unite(shapely.transform([near, inside, beside], lambda xy: xy + FAR[:2]))
    assert far.area == pytest.approx(united.area, abs=1e-7)


def test_a_union_keeps_holes_and_leaves_out_what_is_no_polygon():
    frame = shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2)
    united = unite([frame, shapely.LineString([(0, 0), (9, 9)]), shapely.box(3, 0, 4, 3).reverse(), shapely.Polygon()])
    assert united.area == pytest.approx(11)
    assert len(united.interiors) == 1
    assert unite([]).is_empty


# --- laws -----------------------------------------------------------------------------------------

coordinates = st.integers(-20, 20).map(lambda k: k / 10)
sizes = st.integers(1, 20).map(lambda k: k / 10)
angles = st.floats(-3.1, 3.1)


@st.composite
def cuboids(draw):
    low = np.array([draw(coordinates) for _ in range(3)])
    return low, low + [draw(sizes) for _ in range(3)]


@st.composite
def blocks(draw):
    """A solid of boxes on a grid of 10 cm, some of them cut out."""
    solid = cuboid(*draw(cuboids()))
    for low, high in draw(st.lists(cuboids(), max_size=3)):
        solid = solid + cuboid(low, high) if draw(st.booleans()) else solid - cuboid(low, high)
    assume(solid.volume() > 1e-3)
    return mesh_of(solid)


@st.composite
def solids(draw):
    """A solid of boxes, cylinders and spheres at any angle, united and cut out."""
    solid = manifold3d.Manifold()
    for k in range(draw(st.integers(1, 4))):
        a, b, c = (draw(sizes) for _ in range(3))
        part = draw(
            st.sampled_from(
                [
                    manifold3d.Manifold.cube([a, b, c], True),
                    manifold3d.Manifold.cylinder(a, b / 2, c / 2, 12),
                    manifold3d.Manifold.sphere(a / 2, 12),
                ]
            )
        )
        part = part.rotate([math.degrees(draw(angles)) for _ in range(3)])
        part = part.translate([draw(coordinates) / 2 for _ in range(3)])
        solid = solid - part if k and draw(st.booleans()) else solid + part
    assume(solid.volume() > 1e-3)
    return mesh_of(solid)


@st.composite
def bands(draw):
    low = draw(st.floats(-1.5, 1.0))
    return low, low + draw(st.floats(0.05, 2.0))


@st.composite
def placements(draw):
    pitch = draw(st.sampled_from([0.0, 0.0, 0.3, 1.2]))
    return placement(yaw=draw(angles), pitch=pitch, shift=[draw(coordinates) for _ in range(3)])


def parts_of(found: list[Footprint | None]) -> shapely.Geometry:
    return unite(footprint.polygon for footprint in found if footprint is not None)


@quick
@given(solids(), bands(), placements())
def test_a_footprint_is_the_projection_of_the_cut_solid(mesh, band, matrix):
    shape = Shape(mesh, matrix)
    in_world = Mesh(shape.world_vertices(), mesh.faces)
    assert_same(footprint(shape, *band).polygon, by_manifold(in_world, *band))
    assert_same(project(shape).polygon, by_manifold(in_world, -INF, INF))


@quick
@given(solids(), bands(), st.randoms(use_true_random=False))
def test_a_footprint_does_not_depend_on_how_the_mesh_is_written(mesh, band, random):
    plain = footprint(Shape(mesh), *band).polygon
    faces = [random.sample(list(np.roll(face, random.randrange(3))), 3) for face in mesh.faces.tolist()]
    centers = np.arange(len(mesh.faces)) + len(mesh.vertices)
    a, b, c = mesh.faces.T
    finer = np.concatenate([np.stack([a, b, centers], 1), np.stack([b, c, centers], 1), np.stack([c, a, centers], 1)])
    order = np.array(random.sample(range(len(mesh.vertices)), len(mesh.vertices)), dtype=int)
    for written in (
        reversed_(mesh),
        Mesh(mesh.vertices, np.array(random.sample(faces, len(faces)))),
        Mesh(mesh.vertices[order], np.argsort(order)[mesh.faces]),
        Mesh(np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)]), finer),
        Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3)),
    ):
        found = footprint(Shape(written), *band)
        assert_same(found.polygon, plain)
        assert found.quality in ("exact", "repaired")


@quick
@given(solids(), bands(), placements())
def test_an_instance_turned_away_and_back_covers_the_same(mesh, band, matrix):
    back = np.linalg.inv(matrix)
    local = Mesh(mesh.vertices @ back[:3, :3].T + back[:3, 3], mesh.faces)
    assert_same(footprint(Shape(local, matrix), *band).polygon, footprint(Shape(mesh), *band).polygon)


@quick
@given(solids(), solids(), bands(), bands())
def test_a_footprint_grows_with_the_band_and_with_the_mesh(one, other, band, wider):
    around = (min(band[0], wider[0]), max(band[1], wider[1]))
    assert_within(footprint(Shape(one), *band).polygon, footprint(Shape(one), *around).polygon)
    apart = parts_of(footprints_of([Shape(one), Shape(other)], *band))
    assert_same(footprint(Shape(together(one, other)), *band).polygon, apart)


@quick
@given(blocks(), st.integers(-30, 10), st.integers(1, 20), st.integers(1, 20))
def test_two_bands_on_top_of_each_other_cover_what_one_does(mesh, start, lower, upper):
    a, b, c = ((k + 0.5) / 10 for k in (start, start + lower, start + lower + upper))  # between the boxes' faces
    halves = parts_of([*footprints_of([Shape(mesh)], a, b), *footprints_of([Shape(mesh)], b, c)])
    assert_same(footprint(Shape(mesh), a, c).polygon, halves)


@quick
@given(blocks(), cuboids(), bands())
def test_an_opening_takes_away_its_section_and_no_more(host, opening, band):
    low, high = opening
    plain = footprint(Shape(host), *band).polygon
    cut = subtract(host, [(box(low, high), np.eye(4))])
    assert_within(footprint(Shape(cut), *band).polygon, plain, 2e-5)
    through = subtract(host, [(box((*low[:2], -9), (*high[:2], 9)), np.eye(4))])
    assert_same(footprint(Shape(through), *band).polygon, plain - shapely.box(*low[:2], *high[:2]), 3e-4)
    above = subtract(host, [(box((*low[:2], band[1] + 1e-3), (*high[:2], 9)), np.eye(4))])
    assert_same(footprint(Shape(above), *band).polygon, plain)


@quick
@given(st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=5, max_size=15), bands())
def test_a_convex_solid_covers_the_hull_of_its_clipped_corners(points, band):
    solid = manifold3d.Manifold.hull_points(np.array(points, dtype=float))
    assume(solid.volume() > 1e-3)
    mesh = mesh_of(solid)
    faces = [clipped(clipped(face, 1, band[0] + 1e-4), -1, band[1] - 1e-4) for face in mesh.vertices[mesh.faces]]
    found = footprint(Shape(mesh), *band).polygon
    assert_same(found, shapely.MultiPoint(np.concatenate(faces)[:, :2]).convex_hull)


@quick
@given(blocks(), st.floats(0.01, 3.0))
def test_a_band_that_begins_where_a_solid_ends_holds_nothing(mesh, height):
    bottom, top = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    assert footprints_of([Shape(mesh)] * 2, [top, bottom - height], [top + height, bottom]) == [None, None]


@quick
@given(solids(), st.integers(0, 10), st.integers(0, 2**32 - 1))
def test_closed_meshes_are_welcome_to_manifold3d_and_open_ones_are_told_apart(mesh, missing, seed):
    rng = np.random.default_rng(seed)
    kept = rng.permutation(len(mesh.faces))[missing:]
    mended = whole(Mesh(mesh.vertices, mesh.faces[kept]))
    if mended.quality == "surface":
        assert missing > 0
        assert subtract(mended, [(mesh, np.eye(4))]) is None
    else:
        assert manifold_of(mended).status() == manifold3d.Error.NoError
    for found in footprints_of([Shape(mended)], [-INF], [INF]):
        assert found is None or not found.polygon.is_empty
