"""Adaptive grids stand for the fine one: fewer nodes, hardly longer paths, nothing lost."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import bimnav as bn
from bimnav import Cell, NavGraph, find_path
from bimnav.errors import GoalBlockedError, NoPathError, OutsideMapError, StartBlockedError
from bimnav.search import along, components


def test_squares_cover_free_cells_once_and_are_free():
    rng = np.random.default_rng(0)
    for _ in range(20):
        graph = NavGraph.from_mask(rng.random((2, *rng.integers(1, 50, 2))) < 0.9)
        graph = graph.with_cost(np.where(np.arange(graph.cost.shape[2]) < 9, 2.0, 1.0))
        adaptive = bn.adaptive_graph(graph, largest=8)
        assert_array_equal(adaptive.square >= 0, graph.free)
        counts = np.bincount(adaptive.square[graph.free], minlength=adaptive.node_count)
        assert_array_equal(counts, adaptive.sizes.astype(int) ** 2)
        for number in rng.integers(adaptive.node_count, size=5):
            storey, row, col = np.nonzero(adaptive.square == number)
            assert np.ptp(row) == np.ptp(col) == adaptive.sizes[number] - 1
            assert len(set(graph.cost[storey, row, col])) == 1


def test_an_open_hall_takes_few_nodes():
    free = np.ones((128, 128), dtype=bool)
    free[60:64, 60:64] = False
    adaptive = bn.adaptive_graph(NavGraph.from_mask(free))
    assert adaptive.node_count < free.sum() / 40
    assert adaptive.sizes.max() == 32
    assert "squares for 16368 free cells" in repr(adaptive)


def furnished(rng, side=150):
    free = np.ones((side, side), dtype=bool)
    free[::30] = free[:, ::30] = False
    for at in range(0, side - 29, 30):
        free[at, 12:18] = free[at, 72:80] = True
        free[at + 10 : at + 16, ::30] = True
    for row, col in rng.integers(1, side - 6, (60, 2)):
        free[row : row + 4, col : col + 5] = False
    return NavGraph.from_mask(free, cell_size=0.1)


def test_paths_are_at_most_a_hundredth_longer_than_over_the_fine_grid_on_average():
    rng = np.random.default_rng(1)
    graph = furnished(rng)
    adaptive = bn.adaptive_graph(graph)
    assert adaptive.node_count < graph.free.sum() / 2
    labels = components(graph.free)
    cells = np.argwhere(labels == np.bincount(labels.ravel())[1:].argmax() + 1)
    ratios = []
    for a, b in rng.choice(cells, (40, 2)).tolist():
        found, fine = adaptive.find_path(Cell(*a), Cell(*b)), find_path(graph, Cell(*a), Cell(*b))
        plan = found.waypoints[:, :2] / 0.1
        assert all(math.isfinite(along(graph.cost[0], *p, *q)) for p, q in pairwise(plan))
        assert np.allclose(found.waypoints[[0, -1]], fine.points[[0, -1]])
        ratios.append(found.length / fine.length if fine.length else 1)
    assert np.mean(ratios) < 1.01


def test_targets_keep_cells_of_their_own_and_paths_in_houses_pass_the_judge():
    building = bn.read_ifc(bn.sample("apartment"))
    environment = bn.make_environment(building, bn.load_task("cleaning"), bn.Robot(radius=0.15))
    graph = bn.build_graph(environment, cell_size=0.05, connectivity=8)
    adaptive = bn.adaptive_graph(graph)
    inside = [cell for _, cell in graph.targets if cell is not None and graph.free[cell]]
    assert inside
    assert all(adaptive.sizes[adaptive.square[cell]] == 1 for cell in inside)
    start = bn.find_start(graph).cell
    for cell in inside:
        if graph.components[cell] == graph.components[start]:
            path = adaptive.find_path(start, cell)
            bn.check_path(path.waypoints, environment).raise_if_unsafe()
            assert path.length < 1.02 * find_path(graph, start, cell).length


def test_connectors_are_kept():
    graph = NavGraph.from_mask(np.ones((2, 16, 16), dtype=bool))
    link = bn.Link(Cell(0, 15, 15), Cell(1, 15, 15), 4.0)
    adaptive = bn.adaptive_graph(replace(graph, connectors=(link,)))
    path = adaptive.find_path(Cell(0, 0, 0), Cell(1, 0, 0))
    assert path.waypoints[0, 2] == 0
    assert path.waypoints[-1, 2] == 3
    with pytest.raises(NoPathError):
        bn.adaptive_graph(graph).find_path(Cell(0, 0, 0), Cell(1, 0, 0))


def test_cells_that_are_none_or_blocked_are_refused():
    free = np.ones((4, 4), dtype=bool)
    free[0, 0] = False
    adaptive = bn.adaptive_graph(NavGraph.from_mask(free))
    with pytest.raises(StartBlockedError):
        adaptive.find_path(Cell(0, 0, 0), Cell(0, 1, 1))
    with pytest.raises(GoalBlockedError):
        adaptive.find_path(Cell(0, 1, 1), Cell(0, 0, 0))
    with pytest.raises(OutsideMapError):
        adaptive.find_path(Cell(0, 1, 1), Cell(0, 9, 0))


def test_build_graph_makes_an_adaptive_graph_when_asked():
    environment = bn.make_environment(bn.read_ifc(bn.sample("apartment")), bn.load_task("cleaning"))
    adaptive = bn.build_graph(environment, cell_size=0.1, connectivity=8, adaptive=True)
    assert isinstance(adaptive, bn.AdaptiveGraph)
    assert adaptive.node_count < adaptive.graph.free.sum() / 2
