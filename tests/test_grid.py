"""Cells, frames, and which cells a polygon touches."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from bimnav.errors import GridTooLargeError, OutsideMapError, ValueRangeError
from bimnav.grid import EROSION, Cell, GridFrame, cells_within, rasterize

SIZES = st.sampled_from([0.05, 0.1, 0.1524, 0.3048, 1.0])
ORIGINS = st.sampled_from([0.0, -7.3, 15.5448, 114_502.0, 6_269_630.0])


def oracle(frame: GridFrame, polygon: shapely.Geometry) -> np.ndarray:
    occupied = np.zeros((frame.rows, frame.cols), dtype=bool)
    for row, col in np.ndindex(occupied.shape):
        x0, y0, x1, y1 = frame.box_of(Cell(0, row, col))
        box = shapely.box(x0 + EROSION, y0 + EROSION, x1 - EROSION, y1 - EROSION)
        occupied[row, col] = box.intersects(polygon)
    return occupied


@given(SIZES, ORIGINS, ORIGINS, st.integers(0, 40), st.integers(0, 30))
def test_the_middle_of_a_cell_lies_in_the_cell(size, x, y, row, col):
    frame = GridFrame.covering((x, y, x + 41 * size, y + 31 * size), size)
    row, col = min(row, frame.rows - 1), min(col, frame.cols - 1)
    x, y, _ = frame.center_of(Cell(0, row, col))
    assert frame.cell_at(x, y) == Cell(0, row, col)


@given(SIZES, st.integers(-1000, 1000), st.integers(-1000, 1000))
def test_a_point_on_a_cell_edge_belongs_to_the_cell_that_begins_there(size, col, row):
    frame = GridFrame(size, -1000, -1000, 2001, 2001)
    cell = frame.cell_at(col * size, row * size)
    assert (cell.col + frame.first_col, cell.row + frame.first_row) == (col, row)


def test_the_papers_living_room_begins_at_a_whole_foot():
    foot = 0.3048
    frame = GridFrame.covering((0, 51 * foot, 11 * foot, 63 * foot), foot, margin=0)
    assert frame.shape == (1, 12, 11)
    assert frame.cell_at(0, 51 * foot) == Cell(0, 0, 0)
    assert frame.cell_at(10.99 * foot, 62.99 * foot) == Cell(0, 11, 10)


def test_two_frames_of_one_size_share_their_cells():
    one = GridFrame.covering((0.03, 0.03, 5, 5), 0.1)
    other = GridFrame.covering((2.27, 1.11, 9, 9), 0.1)
    x, y, _ = one.center_of(one.cell_at(3.0, 3.0))
    assert other.center_of(other.cell_at(3.0, 3.0))[:2] == pytest.approx((x, y), abs=1e-12)


def test_a_height_picks_the_storey_below_it():
    frame = GridFrame(1.0, 0, 0, 4, 4, elevations=(-3.0, 0.0, 3.1))
    assert [frame.cell_at(1, 1, z).storey for z in (-3.0, 0.0, 1.7, 3.1, 9.0)] == [0, 1, 1, 2, 2]


@settings(deadline=None, max_examples=60)
@given(SIZES, ORIGINS, st.integers(0, 2**32 - 1))
def test_the_raster_agrees_with_shapely_cell_by_cell(size, origin, seed):
    rng = np.random.default_rng(seed)
    kind = rng.integers(5)
    if kind == 0:
        polygon = shapely.Point(rng.uniform(0, 10, 2)).buffer(rng.uniform(0.2, 4))
    elif kind == 1:  # sides on cell edges: touching is not overlap
        x0, y0 = rng.integers(0, 6, 2)
        polygon = shapely.box(x0, y0, x0 + rng.integers(1, 5), y0 + rng.integers(1, 5))
    elif kind == 2:
        polygon = shapely.Polygon(rng.uniform(0, 10, (7, 2))).buffer(0)
    elif kind == 3:  # a ring
        polygon = shapely.Point(5, 5).buffer(4).difference(shapely.Point(*rng.uniform(4, 6, 2)).buffer(1.3))
    else:  # thinner than a cell
        polygon = shapely.LineString(rng.uniform(0, 10, (2, 2))).buffer(0.01)
    polygon = shapely.transform(polygon, lambda xy: xy * size + np.floor(origin / size) * size)
    frame = GridFrame.covering((origin, origin, origin + 10 * size, origin + 10 * size), size)
    assert (rasterize(frame, polygon) == oracle(frame, polygon)).all()


def some_shape(rng: np.random.Generator) -> shapely.Geometry:
    x, y = rng.uniform(0, 10, 2)
    kind = rng.integers(8)
    if kind == 0:
        return shapely.box(*np.floor([x, y, x + 2, y + 1]))
    if kind == 1:
        return shapely.Point(x, y).buffer(3).difference(shapely.Point(x, y).buffer(1.7))
    if kind == 2:
        return shapely.MultiPolygon([shapely.box(x, y, x + 0.1, y + 2), shapely.box(x + 3, y, x + 5, y + 2)])
    if kind == 3:
        return shapely.LineString(rng.uniform(0, 10, (3, 2)))
    if kind == 4:
        return shapely.Point(x, y)
    if kind == 5:
        inner = shapely.GeometryCollection(
            [shapely.Point(y, x).buffer(1), shapely.LinearRing([(x, y), (y, x), (5, 5)])]
        )
        return shapely.GeometryCollection([inner, shapely.Polygon()])
    if kind == 6:
        return shapely.Polygon()
    return shapely.Point(x, y).buffer(2)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(0, 12))
def test_shapes_of_all_kinds_rasterized_together_occupy_what_each_occupies_alone(seed, count):
    rng = np.random.default_rng(seed)
    shapes = [some_shape(rng) for _ in range(count)]
    frame = GridFrame(0.5, 0, 0, 20, 20)
    together = np.zeros((20, 20), dtype=bool)
    for shape in shapes:
        alone = rasterize(frame, shape)
        assert (alone == oracle(frame, shape)).all()
        together |= alone
    assert (rasterize(frame, shapes) == together).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_a_cell_lies_within_a_polygon_if_its_eroded_box_does(seed):
    rng = np.random.default_rng(seed)
    polygon = shapely.union_all([shape for shape in (some_shape(rng) for _ in range(4)) if shape.area > 0])
    frame = GridFrame(0.5, 0, 0, 20, 20)
    within = np.zeros((20, 20), dtype=bool)
    for row, col in np.ndindex(within.shape):
        x0, y0, x1, y1 = frame.box_of(Cell(0, row, col))
        box = shapely.box(x0 + EROSION, y0 + EROSION, x1 - EROSION, y1 - EROSION)
        within[row, col] = shapely.contains_properly(polygon, box)
    assert (cells_within(frame, polygon) == within).all()


def test_a_wall_that_only_touches_a_cell_does_not_occupy_it():
    frame = GridFrame(0.1, 0, 0, 10, 10)
    occupied = rasterize(frame, shapely.box(0.3, 0.0, 0.4, 1.0))
    assert occupied.sum(axis=0).tolist() == [0, 0, 0, 10, 0, 0, 0, 0, 0, 0]


def test_a_line_without_width_occupies_the_cells_it_crosses():
    frame = GridFrame(1.0, 0, 0, 3, 3)
    assert rasterize(frame, shapely.LineString([(0.5, 0.5), (2.5, 0.5)])).tolist()[0] == [True] * 3


def test_a_long_thin_wall_leaves_no_gap():
    frame = GridFrame.covering((0, 0, 30, 10), 0.1)
    wall = shapely.affinity.rotate(shapely.box(-5, 4.999, 35, 5.001), 7, origin=(15, 5))
    free = ~rasterize(frame, wall)
    from scipy import ndimage

    assert ndimage.label(free)[1] == 2


@pytest.mark.parametrize("size", [0.0, -0.1, math.nan, math.inf, 1e-9])
def test_an_impossible_cell_size_is_refused(size):
    with pytest.raises(ValueRangeError, match="cell size"):
        GridFrame.covering((0, 0, 1, 1), size)


def test_too_many_cells_are_refused_before_anything_is_allocated_and_a_size_that_fits_is_named():
    with pytest.raises(GridTooLargeError) as caught:
        GridFrame.covering((0, 0, 1000, 1000), 0.001)
    fits = caught.value.context["fits"]
    assert f"{fits:g}" in str(caught.value)
    assert math.prod(GridFrame.covering((0, 0, 1000, 1000), fits).shape) <= 50_000_000


def test_a_point_outside_the_frame_is_refused_with_its_limits():
    with pytest.raises(OutsideMapError, match=r"from x 0\.00 to 4\.00 m"):
        GridFrame(1.0, 0, 0, 4, 4).cell_at(9, 9)
