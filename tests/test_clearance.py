"""Preferred distance from obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays
from numpy.testing import assert_array_equal
from scipy import ndimage

import bimnav as bn
from bimnav import Cell, NavGraph, find_path, search
from bimnav.errors import ValueRangeError
from bimnav.tasks import Task
from bimnav.testing import box, room


@given(arrays.arrays(np.bool_, arrays.array_shapes(min_dims=3, max_dims=3, max_side=12)))
@settings(max_examples=150, deadline=None)
def test_clearances_are_those_of_scipy_with_a_rim_to_the_last_bit(free):
    for plane, found in zip(free, search.clearances(free), strict=True):
        assert_array_equal(found, ndimage.distance_transform_edt(np.pad(plane, 1))[1:-1, 1:-1])


@given(arrays.arrays(np.bool_, arrays.array_shapes(min_dims=3, max_dims=3, max_side=12)), st.integers(1, 2500))
@settings(max_examples=150, deadline=None)
def test_values_by_clearance_are_those_of_the_whole_transform(free, count):
    values = np.arange(count, dtype=np.float32)
    squared = np.round(np.square(search.clearances(free))).astype(int)
    assert_array_equal(search.by_clearance(free, values), values[np.minimum(squared, count - 1)])


@given(
    arrays.arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 150))),
    arrays.arrays(np.bool_, st.sampled_from([(1, 1), (3, 3), (5, 3), (1, 9), (3, 131)])),
)
@settings(max_examples=150, deadline=None)
def test_dilation_is_that_of_scipy(mask, footprint):
    assert_array_equal(search.dilate(mask, footprint), ndimage.binary_dilation(mask, footprint))


def test_a_path_keeps_to_the_middle_of_a_corridor_and_costs_its_length_there():
    graph = NavGraph.from_mask(np.ones((9, 60), dtype=bool), cell_size=0.25)
    near = find_path(graph, Cell(0, 0, 0), Cell(0, 0, 59))
    far = find_path(graph.with_clearance(1.0), Cell(0, 0, 0), Cell(0, 0, 59))
    assert near.indices[:, 1].max() == 0
    assert (far.indices[10:-10, 1] == 4).all()
    assert far.length > near.length
    cost = graph.with_clearance(1.0).cost[0]
    assert cost.max() == pytest.approx(1 + 4 * 0.875**2)
    assert (cost[4, 4:-4] == 1).all()
    assert (np.diff(cost[:5], axis=0) <= 0).all()


def test_a_gap_that_is_too_narrow_for_comfort_is_still_a_way():
    free = np.ones((7, 7), dtype=bool)
    free[3] = False
    free[3, 3] = True
    graph = NavGraph.from_mask(free).with_clearance(5.0, weight=100.0)
    assert Cell(0, 3, 3) in find_path(graph, Cell(0, 0, 3), Cell(0, 6, 3)).cells
    assert_array_equal(graph.free[0], free)


def test_clearance_multiplies_what_floor_costs_already():
    graph = NavGraph.from_mask(np.ones((5, 5), dtype=bool)).with_cost(2.0)
    assert_array_equal(graph.with_clearance(1.5).cost, 2 * NavGraph.from_mask(np.ones((5, 5))).with_clearance(1.5).cost)
    assert_array_equal(graph.with_clearance(0.0).cost, graph.cost)


def test_build_graph_takes_a_clearance():
    environment = bn.make_environment(room(4, 4, elements=[box("b", 1, 1, 0, 2, 2, 1)]), Task("nothing"))
    graph = bn.build_graph(environment, cell_size=0.2, clearance=0.5)
    assert_array_equal(graph.cost, bn.build_graph(environment, cell_size=0.2).with_clearance(0.5).cost)


@pytest.mark.parametrize(("metres", "weight"), [(-1, 1), (float("nan"), 1), (1, -1), (1, float("inf"))])
def test_a_clearance_out_of_range_is_refused(metres, weight):
    with pytest.raises(ValueRangeError, match="Give"):
        NavGraph.from_mask(np.ones((2, 2), dtype=bool)).with_clearance(metres, weight)
