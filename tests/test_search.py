"""The kernels, on bare arrays, against searches that share nothing with them."""

from __future__ import annotations

import heapq
import math
import threading
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from bimnav import search
from bimnav.search import compiled, lengths
from bimnav.search.astar import astar
from bimnav.search.compiled import FULL
from bimnav.search.flow import flood
from bimnav.search.workspace import Workspace, workspace

ROOT = math.sqrt(2)
NO_LINKS = (), ()
STRAIGHT = [(0, 1), (1, 0), (0, -1), (-1, 0)]
DIAGONAL = [(1, 1), (1, -1), (-1, -1), (-1, 1)]


def plain_dijkstra(cost, connectivity, links, source):
    """Return the cost of reaching every cell, by the book."""
    _, rows, cols = cost.shape
    joined: dict[int, list[tuple[int, float]]] = {}
    for (a, b), length in zip(*links, strict=True):
        joined.setdefault(int(a), []).append((int(b), float(length)))

    def is_free(storey, row, col):
        return 0 <= row < rows and 0 <= col < cols and math.isfinite(cost[storey, row, col])

    best = np.full(cost.size, math.inf)
    best[source] = 0.0
    waiting = [(0.0, int(source))]
    while waiting:
        so_far, cell = heapq.heappop(waiting)
        if so_far > best[cell]:
            continue
        storey, rest = divmod(cell, rows * cols)
        row, col = divmod(rest, cols)
        steps = list(joined.get(cell, ()))
        for d_row, d_col in STRAIGHT + (DIAGONAL if connectivity == 8 else []):
            end = storey, row + d_row, col + d_col
            if is_free(*end) and is_free(storey, row + d_row, col) and is_free(storey, row, col + d_col):
                length = math.hypot(d_row, d_col)
                mean = (float(cost[storey, row, col]) + float(cost[end])) / 2
                steps.append(((storey * rows + end[1]) * cols + end[2], length * mean))
        for end, length in steps:
            if so_far + length < best[end]:
                best[end] = so_far + length
                heapq.heappush(waiting, (best[end], end))
    return best


def explicit_graph(cost, connectivity):
    """Return the edges as a sparse matrix."""
    free, weight = np.isfinite(cost), cost.astype(float)
    index = np.arange(cost.size).reshape(cost.shape)
    every, low, high = slice(None), slice(None, -1), slice(1, None)
    pairs = [((every, every, low), (every, every, high), 1.0, True), ((every, low), (every, high), 1.0, True)]
    if connectivity == 8:
        rising = free[:, low, high] & free[:, high, low]
        falling = free[:, low, low] & free[:, high, high]
        pairs += [
            ((every, low, low), (every, high, high), ROOT, rising),
            ((every, low, high), (every, high, low), ROOT, falling),
        ]
    ends, lengths_ = [], []
    for a, b, length, is_open in pairs:
        keep = free[a] & free[b] & is_open
        ends.append(np.stack([index[a][keep], index[b][keep]]))
        lengths_.append((length * (weight[a] + weight[b]) / 2)[keep])
    return coo_array((np.concatenate(lengths_), np.hstack(ends)), shape=(cost.size, cost.size)).tocsr()


def random_cost(rng, *, storeys=1, largest=24, kind="uniform"):
    shape = (storeys, *rng.integers(2, largest, 2))
    free = rng.random(shape) >= rng.choice([0.05, 0.2, 0.35, 0.5])
    free.flat[0] = True
    factor = {"uniform": 1.0, "scaled": 2.5, "weighted": rng.choice([1, 1.5, 3, 7.25], shape)}[kind]
    return np.where(free, factor, np.inf).astype(np.float32)


def random_links(rng, cost, count, lengths_=(0.0, 0.3, 1.0, 2.5, 7.123)):
    free = np.flatnonzero(np.isfinite(cost))
    return rng.choice(free, (count, 2)), rng.choice(lengths_, count)


def assert_is_walk(found, cost, connectivity, links, start, goal):
    """Check that a path goes from start to goal in allowed steps, and that its sums are right."""
    _, rows, cols = cost.shape
    indices = found.indices.astype(int)
    flat = (indices[:, 0] * rows + indices[:, 1]) * cols + indices[:, 2]
    assert (flat[0], flat[-1]) == (start, goal)
    shortcuts: dict[tuple[int, int], float] = {}
    for (a, b), length in zip(*links, strict=True):
        shortcuts[int(a), int(b)] = min(float(length), shortcuts.get((int(a), int(b)), math.inf))
    total = 0.0
    for k, (a, b) in enumerate(pairwise(map(tuple, indices))):
        d_row, d_col = abs(a[1] - b[1]), abs(a[2] - b[2])
        ways = [shortcuts.get((flat[k], flat[k + 1]), math.inf)]
        corners = (a[0], a[1], b[2]), (a[0], b[1], a[2])
        is_step = a[0] == b[0] and max(d_row, d_col) == 1 and (connectivity == 8 or d_row + d_col == 1)
        if is_step and all(math.isfinite(cost[corner]) for corner in corners):
            ways.append(math.hypot(d_row, d_col) * (float(cost[a]) + float(cost[b])) / 2)
        assert math.isfinite(min(ways)), f"{a} to {b} is no step"
        total += min(ways)
    assert_allclose(found.cost, total, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("connectivity", [4, 8])
@pytest.mark.parametrize("kind", ["uniform", "scaled", "weighted"])
def test_all_searches_find_a_cheapest_path_by_a_plain_dijkstra(connectivity, kind):
    rng = np.random.default_rng(1)
    for trial in range(60):
        cost = random_cost(rng, storeys=1 + trial % 3, largest=14, kind=kind)
        links = random_links(rng, cost, trial % 5)
        layout = search.Layout(cost, connectivity, *links)
        start, *goals = rng.choice(np.flatnonzero(np.isfinite(cost)), 5)
        best = plain_dijkstra(cost, connectivity, links, start)
        assert_allclose(search.distances(layout, np.array([start]), 1.0).ravel(), best, rtol=1e-9, atol=1e-12)
        for goal in goals:
            for algorithm in ("auto", "astar", "dijkstra"):
                found = search.find(layout, start, goal, algorithm)
                if found is None:
                    assert best[goal] == math.inf
                else:
                    assert_allclose(found.cost, best[goal], rtol=1e-9, atol=1e-12)
                    assert_is_walk(found, cost, connectivity, links, start, goal)


def test_jump_points_find_shortest_paths_where_runs_span_words():
    rng = np.random.default_rng(2)
    for density in (0.005, 0.02, 0.1, 0.3):
        free = rng.random((1, 150, 211)) >= density
        cost = np.where(free, 1, np.inf).astype(np.float32)
        layout, graph = search.Layout(cost), explicit_graph(cost, 8)
        cells = rng.choice(np.flatnonzero(free), 24)
        best = dijkstra(graph, directed=False, indices=cells[:4])
        for k, start in enumerate(cells[:4]):
            for goal in cells[4:]:
                found = search.find(layout, start, goal)
                assert (found is None) == (best[k, goal] == math.inf)
                if found:
                    assert_allclose(found.length, best[k, goal], rtol=1e-12)
                    assert_is_walk(found, cost, 8, NO_LINKS, start, goal)


@pytest.mark.parametrize("connectivity", [4, 8])
@pytest.mark.parametrize("kind", ["uniform", "weighted"])
def test_fields_and_matrices_agree_with_scipy(connectivity, kind):
    rng = np.random.default_rng(3)
    for _ in range(12):
        cost = random_cost(rng, largest=90, kind=kind)
        layout, graph = search.Layout(cost, connectivity), explicit_graph(cost, connectivity)
        cells = rng.choice(np.flatnonzero(np.isfinite(cost)), 5)
        best = dijkstra(graph, directed=False, indices=cells)
        assert_allclose(search.distances(layout, cells[:1], 1.0).ravel(), best[0], rtol=1e-12)
        assert_allclose(search.distances(layout, cells, 0.5).ravel(), best.min(axis=0) / 2, rtol=1e-12)
        matrix = search.distances_between(layout, cells, 1.0)
        assert_allclose(matrix, best[:, cells], rtol=1e-12)
        assert_array_equal(matrix, matrix.T)


def test_a_path_a_field_and_a_matrix_give_the_same_number_to_the_last_bit():
    rng = np.random.default_rng(4)
    cost = np.where(rng.random((1, 80, 80)) < 0.8, 1, np.inf).astype(np.float32)
    layout = search.Layout(cost)
    cells = rng.choice(np.flatnonzero(np.isfinite(cost)), 12)
    field = search.distances(layout, cells[:1], 1.0).ravel()
    matrix = search.distances_between(layout, cells, 1.0)
    assert_array_equal(field[cells], matrix[0])
    for goal in cells:
        found = search.find(layout, cells[0], goal)
        assert (math.inf if found is None else found.length) == field[goal]


def test_a_one_way_link_counts_in_its_direction_only():
    cost = np.ones((2, 3, 3), dtype=np.float32)
    layout = search.Layout(cost, 8, [(4, 13)], [2.0])
    assert not layout.is_symmetric
    assert_array_equal(search.distances_between(layout, np.array([4, 13]), 1.0), [[0, 2], [math.inf, 0]])
    down = search.find(layout, 4, 13)
    assert down is not None
    assert down.indices.tolist() == [[0, 1, 1], [1, 1, 1]]
    assert down.length == 2.0
    assert search.find(layout, 13, 4) is None


def test_a_link_may_be_a_shortcut_on_its_own_storey():
    cost = np.ones((1, 1, 50), dtype=np.float32)
    layout = search.Layout(cost, 8, [(10, 40), (40, 10)], [1.0, 1.0])
    assert layout.shrink < 0.1
    for algorithm in ("auto", "astar", "dijkstra"):
        found = search.find(layout, 0, 49, algorithm)
        assert found is not None
        assert found.length == 10 + 1 + 9


def test_a_link_at_a_blocked_cell_is_closed():
    cost = np.ones((2, 2, 2), dtype=np.float32)
    cost[1, 0, 0] = math.inf
    for links in ([(0, 4)], [(4, 0)]):
        layout = search.Layout(cost, 8, links, [1.0])
        assert search.find(layout, 0, 5) is None
        assert search.find(layout, 5, 0) is None
        assert search.components(np.isfinite(cost), links).ravel().tolist() == [1, 1, 1, 1, 0, 2, 2, 2]


def test_links_cost_what_they_say_where_floor_costs_more():
    cost = np.full((1, 1, 9), 3.0, dtype=np.float32)
    layout = search.Layout(cost, 8, [(0, 8)], [20.0])
    for algorithm in ("auto", "astar"):
        found = search.find(layout, 0, 8, algorithm)
        assert found is not None
        assert (found.length, found.cost) == (20.0, 20.0)
    assert_allclose(search.distances(layout, np.array([0]), 1.0)[0, 0, -1], 20.0, rtol=1e-11)


def test_components_are_what_fields_reach():
    rng = np.random.default_rng(9)
    for trial in range(40):
        cost = random_cost(rng, storeys=1 + trial % 3)
        links, lengths_ = random_links(rng, cost, trial % 4)
        links, lengths_ = np.vstack([links, links[:, ::-1]]), np.tile(lengths_, 2)
        labels = search.components(np.isfinite(cost), links)
        assert labels.dtype == np.int32
        assert_array_equal(labels == 0, np.isinf(cost))
        found, first = np.unique(labels[labels > 0], return_index=True)
        assert found.tolist() == list(range(1, len(found) + 1))
        assert first.tolist() == sorted(first), "numbers follow the first cell of each component"
        layout = search.Layout(cost, 4, links, lengths_)
        for source in rng.choice(np.flatnonzero(labels), 3):
            reached = np.isfinite(search.distances(layout, np.array([source]), 1.0))
            assert_array_equal(reached, labels == labels.flat[source])


def test_a_map_without_free_cells_and_a_map_of_one_cell_are_maps():
    nothing = search.Layout(np.full((1, 2, 2), np.inf, dtype=np.float32))
    assert not nothing.is_uniform
    one = search.Layout(np.ones((1, 1, 1), dtype=np.float32))
    found = search.find(one, 0, 0)
    assert found is not None
    assert found.indices.tolist() == [[0, 0, 0]]
    assert search.distances(one, np.array([0]), 1.0).tolist() == [[[0.0]]]


def test_a_heap_that_is_too_small_grows():
    rng = np.random.default_rng(5)
    cost = np.where(rng.random((1, 60, 60)) < 0.75, 1, np.inf).astype(np.float32)
    heavy = np.where(np.isfinite(cost), 1 + 1e5 * rng.random(cost.shape), np.inf).astype(np.float32)
    start, goal = np.flatnonzero(np.isfinite(cost))[[0, -1]]
    sources = np.flatnonzero(np.isfinite(cost))[::7]
    space = workspace()
    for layout in (search.Layout(cost), search.Layout(heavy)):
        expected = search.find(layout, start, goal), search.distances(layout, sources, 1.0)
        space._new_heap(8)
        found = search.find(layout, start, goal)
        assert found is not None
        assert expected[0] is not None
        assert_array_equal(found.indices, expected[0].indices)
        space._new_heap(8)
        assert_array_equal(search.distances(layout, sources, 1.0), expected[1])
        assert len(space.keys) > 8
        assert (space.keys == compiled.NEVER).all()


def test_stamps_that_run_out_begin_again():
    layout = search.Layout(np.ones((1, 4, 4), dtype=np.float32))
    workspace().begin(layout.moves.size)
    workspace().stamp = 0xFFFE
    for _ in range(4):
        found = search.find(layout, 0, 15)
        assert found is not None
        assert_allclose(found.length, 3 * ROOT)
    assert workspace().stamp == 3


def test_threads_do_not_disturb_each_other():
    rng = np.random.default_rng(6)
    cost = np.where(rng.random((1, 100, 100)) < 0.8, 1, np.inf).astype(np.float32)
    cells = rng.choice(np.flatnonzero(np.isfinite(cost)), 40)
    expected = [search.find(search.Layout(cost), cells[0], goal) for goal in cells]
    shared = search.Layout(cost)  # its stops are not made yet
    wrong: list[int] = []

    def work():
        for _ in range(5):
            for goal, due in zip(cells, expected, strict=True):
                found = search.find(shared, cells[0], goal)
                same = due is None if found is None else due is not None and np.array_equal(found.indices, due.indices)
                if not same:
                    wrong.append(goal)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@given(st.integers(0, 10**6), st.integers(0, 10**6))
@settings(max_examples=200, deadline=None)
def test_numbers_of_steps_can_be_read_back_from_a_length(straight, diagonal):
    units = straight * lengths.STRAIGHT + diagonal * lengths.DIAGONAL
    assert lengths.to_cells(units) == straight + diagonal * ROOT


def test_kernels_compile_without_the_undocumented_option(monkeypatch):
    import numba.core.options

    assert compiled._without_counting() == {"_nrt": False}
    monkeypatch.delattr(numba.core.options.DefaultOptions, "_nrt")
    assert compiled._without_counting() == {}


def test_warming_up_uses_every_kernel():
    from bimnav.search import astar, field, jump, layout, tours, trace

    search.warmup()
    for module in (astar, field, jump, layout, tours, trace):
        for name in module.__all__:
            kernel = getattr(module, name)
            if hasattr(kernel, "signatures"):
                assert kernel.signatures, f"{name} was not compiled"


@pytest.mark.parametrize("dearest", [1.0, 30.0, 2000.0])
@pytest.mark.parametrize("connectivity", [4, 8])
def test_buckets_find_what_a_heap_finds(dearest, connectivity):
    rng = np.random.default_rng(5)
    cost = np.where(rng.random((2, 70, 90)) < 0.85, 1 + dearest * rng.random((2, 70, 90)), np.inf).astype(np.float32)
    free = np.flatnonzero(np.isfinite(cost))
    layout = search.Layout(cost, connectivity, rng.choice(free, (6, 2)), rng.uniform(2, 9, 6))
    for sources in (free[:1], free[::7], free):
        padded, space = layout.padded(sources), Workspace()
        found = flood(
            space, layout.cost, layout.moves, layout.steps[:connectivity], layout.links, layout.least,
            layout.greatest, padded,
        )  # fmt: skip
        assert found is not None
        outcome = FULL
        while outcome == FULL:
            stamp = space.begin(layout.moves.size)
            outcome = astar(
                *layout.astar_arguments, padded, np.zeros(0, np.int64), 0.0, space.costs, space.float_keys,
                space.items, stamp,
            )  # fmt: skip
            space.grow_heap()
        nodes = space.costs
        assert_array_equal(found, np.where(nodes["stamp"] == stamp, nodes["length"], np.inf))
