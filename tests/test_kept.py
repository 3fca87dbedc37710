"""Pickled and copied values: the same, and as read-only as before."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import bimnav as bn
from bimnav import Cell
from bimnav.testing import two_storeys


def through_pickle(value):
    return pickle.loads(pickle.dumps(value))


@pytest.fixture(scope="module")
def graph():
    robot = bn.Robot(radius=0.25, max_riser=0.2)
    environment = bn.make_environment(two_storeys("stair"), bn.Task("visit"), robot)
    graph = bn.build_graph(environment, cell_size=0.2)
    return graph.block([graph.frame.cell_at(2.0, 3.0)]).with_clearance(0.5)


def arrays_of(graph):
    a, b = (graph.frame.cell_at(8.0, 3.0, storey=storey) for storey in (0, 1))
    path = bn.find_path(graph, a, b, smooth="any_angle")
    squares = bn.adaptive_graph(graph)
    yield from ((graph, name) for name in ("cost", "obstacle", "floor", "bare_cost", "kinds", "components"))
    yield from ((graph.changes, name) for name in ("blocked", "cells", "cost", "obstacle"))
    yield from ((path, name) for name in ("indices", "legs", "points", "waypoints"))
    yield from ((squares, name) for name in ("square", "centers", "sizes"))
    yield squares.find_path(a, b), "waypoints"
    yield graph.connectors[0], "points"


@pytest.mark.parametrize("again", [through_pickle, copy.copy, copy.deepcopy])
def test_a_copy_is_equal_and_cannot_be_written_into(graph, again):
    for value, name in arrays_of(graph):
        array = getattr(again(value), name)
        assert np.array_equal(array, getattr(value, name))
        assert not array.flags.writeable, (type(value), name)


@pytest.mark.parametrize("again", [through_pickle, copy.deepcopy])
def test_a_copy_goes_on_like_the_original(graph, again):
    a, b = (graph.frame.cell_at(8.0, 3.0, storey=storey) for storey in (0, 1))
    other, cell = again(graph), Cell(0, 5, 5)
    assert other.block([cell]).cost.tobytes() == graph.block([cell]).cost.tobytes()
    assert other.unblock([graph.frame.cell_at(2.0, 3.0)]).free.sum() == graph.free.sum() + 1
    assert bn.find_path(other, a, b).cells == bn.find_path(graph, a, b).cells
    assert again(bn.plan_tour(graph, a, [], end=b)).length == bn.find_path(graph, a, b).length
