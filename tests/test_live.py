"""Distances that follow a changing world are those of a field searched anew."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_array_equal

import bimnav as bn
from bimnav import Cell, LiveField, NavGraph, distance_field
from bimnav.errors import GridError, InputError, StartBlockedError
from bimnav.testing import two_rooms, two_storeys

CHANGES = ("block", "unblock", "costs", "one cost", "clearance", "time")


@given(st.integers(0, 2**32 - 1), st.lists(st.sampled_from(CHANGES), min_size=1, max_size=6))
@settings(max_examples=60, deadline=None)
def test_a_live_field_is_the_field_of_the_graph_to_the_last_bit(seed, changes):
    rng = np.random.default_rng(seed)
    graph = NavGraph.from_mask(rng.random((2, 20, 30)) < 0.85, cell_size=0.3, connectivity=8)
    free = [Cell(*cell) for cell in np.argwhere(graph.free).tolist()]
    sources = [free[0], free[-1]]
    field = LiveField(graph, sources)
    for change in changes:
        some = [free[k] for k in rng.integers(1, len(free) - 1, 3)]
        if change == "block":
            graph = graph.block(some)
        elif change == "unblock":
            graph = graph.unblock([free[k] for k in rng.integers(0, len(free), 200)])
        elif change == "costs":
            graph = graph.with_cost(1 + 3 * rng.random(graph.frame.shape))
        elif change == "one cost":
            graph = graph.with_cost(float(rng.choice([1.0, 2.5])))
        elif change == "clearance":
            graph = graph.with_clearance(0.6)
        else:
            graph = graph.with_objective("time")
        field.update(graph)
        assert_array_equal(field.distance, distance_field(graph, sources))
        assert field.at(some[0]) == field.distance[some[0]]


def test_a_door_that_closes_is_repaired_and_its_room_cannot_be_reached():
    environment = bn.make_environment(two_rooms(), bn.Task("visit"), bn.Robot(radius=0.2))
    graph = bn.build_graph(environment, cell_size=0.1, connectivity=8)
    west, east = graph.frame.cell_at(1.0, 1.0), graph.frame.cell_at(7.0, 3.0)
    field = LiveField(graph, [west])
    assert field.at(east) == pytest.approx(bn.find_path(graph, west, east).length)
    far = field.distance
    field.update(graph.close_door("door"))
    assert math.isinf(field.at(east))
    field.update(graph)
    assert_array_equal(field.distance, far)
    assert repr(field).startswith("LiveField(NavGraph(")


@pytest.mark.parametrize("kind", ["stair", "lift"])
def test_a_connector_that_closes_takes_its_storey_along(kind):
    environment = bn.make_environment(two_storeys(kind), bn.Task("visit"), bn.Robot(radius=0.2, max_riser=0.21))
    graph = bn.build_graph(environment, cell_size=0.2, connectivity=8)
    link = graph.connectors[0]
    below = next(Cell(*c) for c in np.argwhere(graph.free[:1]).tolist() if Cell(*c) != link.begin)
    field = LiveField(graph, below)
    assert math.isfinite(field.at(link.end))
    for changed in (graph.block([link.end]), graph, graph.block([link.begin]), graph):
        field.update(changed)
        assert_array_equal(field.distance, distance_field(changed, below))


def test_a_live_field_refuses_other_cells_and_a_blocked_source_and_stays_as_it_was():
    graph = NavGraph.from_mask(np.ones((4, 5), dtype=bool))
    field = LiveField(graph, Cell(0, 0, 0))
    with pytest.raises(GridError, match="same cells"):
        field.update(NavGraph.from_mask(np.ones((5, 5), dtype=bool)))
    with pytest.raises(StartBlockedError):
        field.update(graph.block([Cell(0, 0, 0)]))
    with pytest.raises(GridError):
        field.at(Cell(0, 9, 9))
    with pytest.raises(InputError):
        LiveField(graph, [])
    assert field.graph is graph
    assert not field.distance.flags.writeable
    assert field.at(Cell(0, 3, 4)) == distance_field(graph, Cell(0, 0, 0))[0, 3, 4]
