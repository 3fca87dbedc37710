"""Paths, fields and matrices on graphs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import bimnav as bn
from bimnav import Cell, NavGraph, find_path
from bimnav.errors import (
    GoalBlockedError,
    InputError,
    NoPathError,
    OutsideMapError,
    StartBlockedError,
    ValueRangeError,
)
from bimnav.testing import assert_valid_path, grid_from_text
from tests.conftest import bench_file

SEARCHES = [
    ("compiled", "auto"),
    ("compiled", "astar"),
    ("compiled", "dijkstra"),
    ("rustworkx", "astar"),
    ("rustworkx", "dijkstra"),
]

PILLAR = grid_from_text("""
    ...
    .#.
    ...
""")


def random_graph(rng, *, storeys=1, connectivity=8, weighted=False, cell_size=0.25):
    shape = (storeys, *rng.integers(3, 20, 2))
    graph = NavGraph.from_mask(rng.random(shape) < 0.75, cell_size=cell_size, connectivity=connectivity)
    return graph.with_cost(rng.choice([1, 2, 5.5], shape)) if weighted else graph


def free_cells(graph, rng, count):
    return [Cell(*cell) for cell in rng.choice(np.argwhere(graph.free), count).tolist()]


@pytest.mark.parametrize(("engine", "algorithm"), SEARCHES)
def test_a_path_goes_around_a_pillar(engine, algorithm):
    path = find_path(NavGraph.from_mask(PILLAR), Cell(0, 1, 0), Cell(0, 1, 2), engine=engine, algorithm=algorithm)
    assert path.length == 4.0
    assert path.cost == 4.0
    assert_valid_path(path)


@pytest.mark.parametrize(("engine", "algorithm"), SEARCHES)
@pytest.mark.parametrize("connectivity", [4, 8])
@pytest.mark.parametrize("weighted", [False, True])
def test_every_engine_and_algorithm_agrees_with_networkx(engine, algorithm, connectivity, weighted):
    networkx = pytest.importorskip("networkx")
    rng = np.random.default_rng(7)
    for _ in range(12):
        graph = random_graph(rng, connectivity=connectivity, weighted=weighted)
        start, *goals = free_cells(graph, rng, 6)
        best = networkx.single_source_dijkstra_path_length(graph.to_networkx(), start)
        for goal in goals:
            if goal not in best:
                with pytest.raises(NoPathError):
                    find_path(graph, start, goal, engine=engine, algorithm=algorithm)
                continue
            path = find_path(graph, start, goal, engine=engine, algorithm=algorithm)
            assert_valid_path(path)
            assert (path.cells[0], path.cells[-1]) == (start, goal)
            assert_allclose(path.cost, best[goal], rtol=1e-12, atol=1e-12)
            if not weighted:
                assert_allclose(path.length, path.cost, rtol=1e-12)


def test_a_path_knows_its_cells_and_points():
    graph = NavGraph.from_mask(PILLAR, cell_size=0.5)
    path = find_path(graph, Cell(0, 0, 0), Cell(0, 0, 2))
    assert path.cells == (Cell(0, 0, 0), Cell(0, 0, 1), Cell(0, 0, 2))
    assert path.indices.dtype == np.int32
    assert path.points.tolist() == [[0.25, 0.25, 0.0], [0.75, 0.25, 0.0], [1.25, 0.25, 0.0]]
    for array in (path.indices, path.points):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert repr(path).endswith("3 cells, 1.000 m)")


@pytest.mark.parametrize(("engine", "algorithm"), SEARCHES)
def test_a_cell_joined_to_itself_is_a_path_of_length_zero(engine, algorithm):
    path = find_path(NavGraph.from_mask(PILLAR), Cell(0, 0, 0), Cell(0, 0, 0), engine=engine, algorithm=algorithm)
    assert (path.cells, path.length, path.cost) == ((Cell(0, 0, 0),), 0.0, 0.0)


def test_a_diagonal_step_cuts_no_corner():
    graph = NavGraph.from_mask(
        grid_from_text("""
            #.
            .#
        """)
    )
    with pytest.raises(NoPathError):
        find_path(graph, Cell(0, 0, 0), Cell(0, 1, 1))


def test_four_neighbors_walk_in_right_angles():
    graph = NavGraph.from_mask(np.ones((4, 6), dtype=bool), connectivity=4)
    assert find_path(graph, Cell(0, 0, 0), Cell(0, 3, 5)).length == 8.0


def test_a_path_avoids_floor_that_costs_more_than_the_way_around():
    cost = np.ones((1, 3, 5))
    cost[0, 1, 1:4] = 10
    graph = NavGraph.from_mask(np.ones((3, 5), dtype=bool)).with_cost(cost)
    path = find_path(graph, Cell(0, 1, 0), Cell(0, 1, 4))
    assert path.length == 2 + 2 * math.sqrt(2)
    assert not any(cost[cell] > 1 for cell in path.cells)
    assert_allclose(path.cost, path.length)


def test_a_graph_with_a_door_closed_sends_the_path_another_way():
    free = grid_from_text("""
        .......
        .##.##.
        .......
    """)
    graph = NavGraph.from_mask(free, connectivity=4)
    start, goal = Cell(0, 0, 3), Cell(0, 2, 3)
    assert find_path(graph, start, goal).length == 2
    assert find_path(graph.block([Cell(0, 1, 3)]), start, goal).length == 8
    assert find_path(graph, start, goal).length == 2


def test_storeys_that_nothing_joins_are_apart():
    graph = NavGraph.from_mask(np.ones((2, 3, 3), dtype=bool))
    with pytest.raises(NoPathError, match="no path from"):
        find_path(graph, Cell(0, 0, 0), Cell(1, 0, 0))
    assert np.isinf(bn.distance_field(graph, Cell(0, 0, 0))[1]).all()
    assert find_path(graph, Cell(1, 0, 0), Cell(1, 2, 2)).points[-1, 2] == 3.0


def test_no_path_says_which_cells_it_could_not_join():
    graph = NavGraph.from_mask(grid_from_text(".#."))
    with pytest.raises(NoPathError) as caught:
        find_path(graph, Cell(0, 0, 0), Cell(0, 0, 2))
    assert str(caught.value) == (
        "no path from Cell(storey=0, row=0, col=0) to Cell(storey=0, row=0, col=2); "
        "both cells must be free and connected"
    )
    assert isinstance(caught.value, LookupError)
    assert caught.value.context == {"start": (0, 0, 0), "goal": (0, 0, 2)}


@pytest.mark.parametrize("engine", ["compiled", "rustworkx"])
def test_blocked_ends_name_the_nearest_free_cell(engine):
    graph = NavGraph.from_mask(PILLAR)
    middle, corner = Cell(0, 1, 1), Cell(0, 0, 0)
    with pytest.raises(StartBlockedError, match=r"start .* is blocked.* nearest free cell is Cell"):
        find_path(graph, middle, corner, engine=engine)
    with pytest.raises(GoalBlockedError, match=r"goal .* is blocked.* nearest free cell is Cell"):
        find_path(graph, corner, middle, engine=engine)


@pytest.mark.parametrize("cell", [Cell(0, 0, 3), Cell(0, -1, 0), Cell(1, 0, 0), Cell(-1, 0, 0)])
def test_cells_outside_the_map_are_refused(cell):
    graph = NavGraph.from_mask(PILLAR)
    for call in (
        lambda: find_path(graph, cell, Cell(0, 0, 0)),
        lambda: find_path(graph, Cell(0, 0, 0), cell),
        lambda: bn.distance_field(graph, cell),
        lambda: bn.distance_matrix(graph, [cell]),
        lambda: bn.plan_tour(graph, cell),
    ):
        with pytest.raises(OutsideMapError, match="1, 3 and 3 storeys, rows and columns"):
            call()


def test_unknown_choices_are_refused():
    graph = NavGraph.from_mask(PILLAR)
    with pytest.raises(ValueRangeError, match="algorithm is 'best'"):
        find_path(graph, Cell(0, 0, 0), Cell(0, 0, 1), algorithm="best")
    with pytest.raises(ValueRangeError, match="engine is 'gpu'"):
        find_path(graph, Cell(0, 0, 0), Cell(0, 0, 1), engine="gpu")


def test_a_field_holds_the_length_of_the_path_to_every_cell():
    rng = np.random.default_rng(8)
    for weighted in (False, True):
        graph = random_graph(rng, weighted=weighted)
        source, *cells = free_cells(graph, rng, 20)
        field = bn.distance_field(graph, source)
        for cell in cells:
            if math.isfinite(field[cell]):
                assert_allclose(find_path(graph, source, cell).cost, field[cell], rtol=1e-12)
        assert np.isinf(field[~graph.free]).all()


def test_a_field_from_several_sources_is_the_least_of_their_fields():
    graph = NavGraph.from_mask(np.ones((9, 9), dtype=bool), cell_size=0.5)
    sources = [Cell(0, 0, 0), Cell(0, 8, 8)]
    each = [bn.distance_field(graph, source) for source in sources]
    assert_array_equal(bn.distance_field(graph, sources), np.minimum(*each))
    with pytest.raises(InputError):
        bn.distance_field(graph, [])
    with pytest.raises(StartBlockedError):
        bn.distance_field(NavGraph.from_mask(PILLAR), Cell(0, 1, 1))


def test_a_matrix_may_hold_the_same_cell_twice_and_blocked_cells():
    graph = NavGraph.from_mask(PILLAR)
    matrix = bn.distance_matrix(graph, [Cell(0, 0, 0), Cell(0, 1, 1), Cell(0, 2, 2), Cell(0, 0, 0)])
    inf = math.inf
    assert matrix.tolist() == [[0, inf, 4, 0], [inf, 0, inf, inf], [4, inf, 0, 4], [0, inf, 4, 0]]
    assert bn.distance_matrix(graph, []).shape == (0, 0)


@given(st.integers(0, 2**32 - 1), st.sampled_from([4, 8]), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_way_back_is_as_long_and_no_detour_is_shorter(seed, connectivity, weighted):
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, connectivity=connectivity, weighted=weighted)
    if not graph.free.any():
        return
    a, b, c = free_cells(graph, rng, 3)
    matrix = bn.distance_matrix(graph, [a, b, c])
    assert_array_equal(matrix, matrix.T)
    assert matrix[0, 2] <= matrix[0, 1] + matrix[1, 2] + 1e-9
    if math.isfinite(matrix[0, 1]):
        assert_allclose(find_path(graph, b, a).cost, matrix[0, 1], rtol=1e-12)


def test_equal_inputs_give_equal_paths():
    rng = np.random.default_rng(9)
    free = rng.random((40, 40)) < 0.9
    start, goal = (Cell(0, *index) for index in np.argwhere(free)[[0, -1]].tolist())
    for engine, algorithm in SEARCHES:
        first, second = (
            find_path(NavGraph.from_mask(free), start, goal, engine=engine, algorithm=algorithm) for _ in range(2)
        )
        assert_array_equal(first.indices, second.indices)


PUBLISHED = [
    "rooms/8room_000", "rooms/16room_001", "rooms/32room_003", "rooms/64room_005",
    "mazes/maze512-4-0", "mazes/maze512-16-0", "mazes/maze512-32-0",
    "dao/arena", "dao/den312d", "dao/brc202d", "dao/ost003d", "dao/orz900d",
    "bg512/AR0012SR", "bg512/AR0205SR", "da2/ht_mansion_n", "da2/lt_gallowstemplar_n",
    "cities/Berlin_0_1024", "cities/Boston_0_256", "random/random512-20-0",
]  # fmt: skip


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_paths_are_matched(name, full):
    """Optimal lengths of the Moving AI Lab benchmarks, Sturtevant 2012."""
    lines = bench_file(f"grid2d/{name}.map").read_text().splitlines()[4:]
    graph = NavGraph.from_mask([[char in ".G" for char in line] for line in lines])
    rows = bench_file(f"grid2d/{name}.map.scen").read_text().split("\n", 1)[1].strip().splitlines()
    for row in rows[:: 1 if full else len(rows) // 20]:
        x, y, goal_x, goal_y, length = (float(word) for word in row.split()[-5:])
        path = find_path(graph, Cell(0, int(y), int(x)), Cell(0, int(goal_y), int(goal_x)))
        if not full:
            assert_valid_path(path)
        # printed with six digits, in bg512 with two decimals
        assert abs(path.length - length) <= (0.006 if name.startswith("bg512") else max(6e-6 * length, 1e-6))


def test_a_matrix_tells_how_far_it_is():
    graph, told = bn.NavGraph.from_mask(np.ones((3, 3), dtype=bool)), []
    cells = [Cell(0, 0, 0), Cell(0, 1, 1), Cell(0, 2, 0)]
    matrix = bn.distance_matrix(graph, cells, progress=lambda *beat: told.append(beat))
    assert told == [(0, 3, "rows"), (1, 3, "rows"), (2, 3, "rows"), (3, 3, "rows")]
    assert np.array_equal(matrix, bn.distance_matrix(graph, cells))
