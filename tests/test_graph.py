"""The navigation graph: kinds, costs, neighbors, and the explicit graphs made from it."""

from __future__ import annotations

import math

import networkx as nx
import numpy as np
import pytest

from bimnav.errors import GridError, ValueRangeError
from bimnav.graph import NavGraph, NodeKind
from bimnav.grid import Cell

CORNER = [[True, True], [True, False]]


def test_a_diagonal_step_needs_both_straight_neighbors():
    open_square = NavGraph.from_mask([[True, True], [True, True]])
    with_corner = NavGraph.from_mask(CORNER)
    assert len(open_square.edges()[0]) == 6
    assert len(with_corner.edges()[0]) == 2


def test_four_neighbors_know_no_diagonal():
    assert len(NavGraph.from_mask(np.ones((3, 3), bool), connectivity=4).edges()[0]) == 12


def test_the_cost_of_a_step_is_its_length_times_the_mean_factor():
    graph = NavGraph.from_mask([[True, True]], cell_size=0.5).with_cost([[[1.0, 3.0]]])
    assert graph.edges()[2].tolist() == [0.5 * 2.0]


def test_blocked_cells_are_nodes_without_edges():
    explicit = NavGraph.from_mask(CORNER).to_rustworkx()
    assert explicit.num_nodes() == 4
    assert explicit.degree(3) == 0


def test_blocking_makes_a_new_graph_and_leaves_the_old_one():
    graph = NavGraph.from_mask(np.ones((3, 3), bool))
    closed = graph.block([Cell(0, 1, 1)])
    assert graph.free.all()
    assert not closed.free[0, 1, 1]
    assert closed.kinds[0, 1, 1] == NodeKind.OBSTACLE
    assert closed.to_rustworkx().degree(4) == 0


def test_no_cost_opens_a_blocked_cell():
    graph = NavGraph.from_mask(CORNER).with_cost(5)
    assert math.isinf(graph.cost[0, 1, 1])


def test_networkx_gets_cells_kinds_and_metres():
    explicit = NavGraph.from_mask(CORNER, cell_size=2.0).to_networkx()
    assert explicit.nodes[Cell(0, 1, 1)]["kind"] == "obstacle"
    assert explicit.nodes[Cell(0, 1, 0)]["pos"] == (1.0, 3.0, 0.0)
    assert nx.shortest_path_length(explicit, Cell(0, 0, 1), Cell(0, 1, 0), weight="weight") == 4.0


def test_storeys_without_a_connector_are_apart():
    graph = NavGraph.from_mask(np.ones((2, 2, 2), bool))
    assert sorted(np.unique(graph.components).tolist()) == [1, 2]


def test_arrays_cannot_be_changed():
    graph = NavGraph.from_mask(CORNER)
    with pytest.raises(ValueError, match="read-only"):
        graph.cost[0, 0, 0] = 7


@pytest.mark.parametrize("factor", [0.5, math.nan, -1])
def test_a_factor_below_one_is_refused(factor):
    with pytest.raises(ValueRangeError):
        NavGraph.from_mask(CORNER).with_cost(factor)


def test_a_mask_that_is_no_grid_is_refused():
    with pytest.raises(GridError, match="shape"):
        NavGraph.from_mask([True, False])
