"""Orders of stops, and tours."""

from __future__ import annotations

import csv
import itertools
import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import bimnav as bn
from bimnav import Cell, NavGraph, Stop, order_stops, plan_tour
from bimnav.errors import InputError, NoPathError, StartBlockedError, ValueRangeError
from bimnav.testing import assert_valid_path, grid_from_text
from tests.conftest import bench_file

OPEN_FLOOR = NavGraph.from_mask(np.ones((20, 30), dtype=bool), cell_size=0.5)


def stop_in(graph, cell, name="", *, end=None, approach="center"):
    end = graph.frame.center_of(cell) if end is None else end
    return Stop(f"id-{name}", name or str(cell), cell, end, end, approach)


def stops_in(graph, rng, count):
    cells = rng.choice(np.argwhere(graph.free), count).tolist()
    return [stop_in(graph, Cell(*cell), f"s{k}") for k, cell in enumerate(cells)]


def length_of(matrix, order, closed=False):
    order = list(order) + ([order[0]] if closed else [])
    return sum(matrix[a][b] for a, b in itertools.pairwise(order))


def best_by_trying_all(matrix, start, end, closed):
    rest = [k for k in range(len(matrix)) if k not in (start, end)]
    tail = [] if end in (None, start) else [end]
    return min(
        length_of(matrix, [start, *middle, *tail], closed or end == start) for middle in itertools.permutations(rest)
    )


def points_matrix(rng, count, *, slope=0.0):
    xy, height = rng.random((count, 2)), rng.random(count)
    return np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1)) + slope * np.maximum(height - height[:, None], 0)


@pytest.mark.parametrize("kind", ["symmetric", "asymmetric", "with ways that are closed"])
def test_few_stops_are_ordered_as_well_as_by_trying_all_orders(kind):
    rng = np.random.default_rng(1)
    for trial in range(40):
        count = 1 + trial % 7
        matrix = points_matrix(rng, count) if kind == "symmetric" else rng.random((count, count))
        np.fill_diagonal(matrix, 0)
        if kind == "with ways that are closed":
            matrix[(rng.random((count, count)) < 0.2) & (matrix > 0)] = math.inf
        start, end = rng.integers(0, count, 2).tolist()
        for goal, closed in ((None, False), (None, True), (end, False)):
            best = best_by_trying_all(matrix, start, goal, closed) if count > 1 else 0.0
            if best == math.inf:
                with pytest.raises(NoPathError):
                    order_stops(matrix, start, end=goal, return_to_start=closed)
                continue
            found = order_stops(matrix, start, end=goal, return_to_start=closed)
            assert sorted(found.order) == list(range(count))
            assert found.order[0] == start
            if goal is not None and goal != start:
                assert found.order[-1] == goal
            assert_allclose(found.length, best, atol=1e-12)
            assert_allclose(found.length, length_of(matrix, found.order, closed or goal == start), atol=1e-12)
            assert (found.is_optimal, found.bound, found.gap) == (True, found.length, 0.0)


def test_fifteen_stops_besides_start_and_end_are_proved():
    rng = np.random.default_rng(2)
    found = order_stops(rng.random((17, 17)), 3, end=8)
    assert found.is_optimal
    assert (found.order[0], found.order[-1]) == (3, 8)


def nearest_neighbor(matrix, start):
    order, left = [start], set(range(len(matrix))) - {start}
    while left:
        order.append(min(left, key=lambda k: (matrix[order[-1]][k], k)))
        left.remove(order[-1])
    return order


@pytest.mark.parametrize("slope", [0.0, 0.5])
@pytest.mark.parametrize("closed", [False, True])
def test_many_stops_are_never_ordered_worse_than_by_going_to_the_nearest(slope, closed):
    rng = np.random.default_rng(3)
    for count in (17, 25, 60):
        matrix = points_matrix(rng, count, slope=slope)
        found = order_stops(matrix, 4, return_to_start=closed)
        assert sorted(found.order) == list(range(count))
        assert found.order[0] == 4
        assert_allclose(found.length, length_of(matrix, found.order, closed))
        assert found.bound <= found.length <= length_of(matrix, nearest_neighbor(matrix, 4), closed)
        assert found.gap < 0.3


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_a_fixed_end_is_kept_with_many_stops(slope):
    matrix = points_matrix(np.random.default_rng(4), 30, slope=slope)
    found = order_stops(matrix, 7, end=2)
    assert (found.order[0], found.order[-1]) == (7, 2)
    assert sorted(found.order) == list(range(30))
    assert found.bound <= found.length
    assert found.length >= order_stops(matrix, 7).bound - 1e-9


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_local_search_finds_what_dynamic_programming_proves(slope, monkeypatch):
    from bimnav.search import ordering

    rng = np.random.default_rng(5)
    for end, closed in ((None, False), (None, True), (1, False)):
        for _ in range(5):
            matrix = points_matrix(rng, 13, slope=slope)
            proved = order_stops(matrix, end=end, return_to_start=closed)
            with monkeypatch.context() as patch:
                patch.setattr(ordering, "EXACT", 0)
                found = order_stops(matrix, end=end, return_to_start=closed)
            assert_allclose(found.length, proved.length)
            assert found.bound <= proved.length + 1e-9
            assert found.order[0] == 0


def test_ways_that_are_closed_are_avoided_by_local_search_as_well():
    rng = np.random.default_rng(6)
    for symmetric in (True, False):
        matrix = points_matrix(rng, 24)
        closed = rng.random((24, 24)) < 0.3
        matrix[closed | closed.T if symmetric else closed] = math.inf
        for options in ({}, {"end": 9}, {"return_to_start": True}):
            found = order_stops(matrix, **options)
            assert math.isfinite(found.length)
            assert found.bound <= found.length
            assert found.order[-1] == options.get("end", found.order[-1])
    matrix[5, :] = matrix[:, 5] = math.inf
    with pytest.raises(NoPathError, match="no order of the 24 rows"):
        order_stops(matrix)


@pytest.mark.parametrize("options", [{}, {"end": 3}, {"return_to_start": True}])
def test_twenty_stops_in_one_place_have_an_order(options):
    found = order_stops(np.zeros((20, 20)), 5, **options)
    assert sorted(found.order) == list(range(20))
    assert (found.order[0], found.length, found.is_optimal) == (5, 0.0, True)
    assert found.order[-1] == options.get("end", found.order[-1])


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_the_costs_does_not_matter(unit):
    matrix = points_matrix(np.random.default_rng(11), 30)
    assert_allclose(order_stops(matrix * unit).length, order_stops(matrix).length * unit, rtol=1e-9)


def test_a_search_that_time_cut_short_says_so():
    matrix = points_matrix(np.random.default_rng(7), 40)
    assert order_stops(matrix, time_limit=0.0).is_cut_short
    unlimited = order_stops(matrix)
    assert not unlimited.is_cut_short
    assert order_stops(matrix, time_limit=60.0).order == unlimited.order


@pytest.mark.parametrize(
    ("matrix", "options", "error"),
    [
        ([[0, 1]], {}, InputError),
        ([], {}, InputError),
        ([[0, -1], [1, 0]], {}, ValueRangeError),
        ([[0, math.nan], [1, 0]], {}, ValueRangeError),
        ([[0, 1], [1, 0]], {"start": 2}, ValueRangeError),
        ([[0, 1], [1, 0]], {"end": -1}, ValueRangeError),
        ([[0, 1], [1, 0]], {"end": 1, "return_to_start": True}, InputError),
    ],
)
def test_what_cannot_be_ordered_is_refused(matrix, options, error):
    with pytest.raises(error):
        order_stops(matrix, **options)


def published_matrix(name):
    head, _, body = bench_file(f"tsp/{name}.tsp").read_text().partition("NODE_COORD_SECTION")
    xy = np.array([[float(word) for word in line.split()[1:]] for line in body.splitlines() if len(line.split()) == 3])
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return np.ceil(distance / math.sqrt(10)) if "ATT" in head else np.floor(distance + 0.5)


@pytest.mark.parametrize("name", ["att48", "berlin52", "eil76", "kroA100"])
def test_published_tours_are_matched_within_one_percent(name):
    """Optima of TSPLIB95, Reinelt 1991."""
    with bench_file("tsp/optima.csv").open() as file:
        optimum = {row["instance"]: float(row["optimal_tour_length"]) for row in csv.DictReader(file)}[name]
    found = order_stops(published_matrix(name), return_to_start=True)
    assert found.bound <= optimum <= found.length <= 1.01 * optimum
    assert found.bound >= 0.97 * optimum


@pytest.mark.parametrize("name", ["lab_ipa", "lab_c_scan", "Freiburg52_scan"])
def test_published_tours_of_furnished_floors_are_matched(name):
    """Closed tours over bins on the floors of Bormann et al. 2018, 5 cm a pixel; lengths in pixels."""
    from matplotlib.image import imread
    from scipy import ndimage

    cases = json.loads(bench_file("indoor_ipa/tours.json").read_text())
    case = next(case for case in cases if case["map"] == name)
    picture = imread(bench_file(f"indoor_ipa/{name}_furnitures.png"))
    gray = picture if picture.ndim == 2 else picture[..., :3].mean(axis=2)
    labels = ndimage.label(gray > 250 / 255)[0]
    free = labels == np.bincount(labels.ravel())[1:].argmax() + 1
    nearest = ndimage.distance_transform_edt(~free, return_distances=False, return_indices=True)
    start, *cells = (Cell(0, *nearest[:, y, x].tolist()) for x, y in (case["start_xy"], *case["targets_xy"]))
    graph = NavGraph.from_mask(free)
    tour = plan_tour(graph, start, [stop_in(graph, cell) for cell in cells], return_to_start=True)
    assert_allclose(tour.length, case["closed_tour_octile_px"], atol=0.01)


def test_a_tour_visits_every_stop_once_by_valid_legs():
    rng = np.random.default_rng(8)
    graph = NavGraph.from_mask(rng.random((40, 40)) < 0.85, cell_size=0.3)
    part = np.bincount(graph.components.ravel())[1:].argmax() + 1
    graph = NavGraph.from_mask(graph.components == part, cell_size=0.3)
    start, *stops = stops_in(graph, rng, 21)
    tour = plan_tour(graph, start.cell, stops)
    assert sorted(stop.name for stop in tour.stops) == sorted(stop.name for stop in stops)
    assert not tour.unreached
    here = start.cell
    for leg, stop in zip(tour.legs, tour.stops, strict=True):
        assert_valid_path(leg)
        assert (leg.cells[0], leg.cells[-1]) == (here, stop.cell)
        here = stop.cell
    assert_allclose(tour.length, sum(leg.length for leg in tour.legs))
    assert_allclose(tour.cost, tour.length)
    assert tour.lower_bound <= tour.cost + 1e-9
    matrix = bn.distance_matrix(graph, [start.cell, *(stop.cell for stop in tour.stops)])
    assert_allclose(tour.length, length_of(matrix, range(21)))


def test_a_tour_that_returns_has_one_leg_more():
    stops = stops_in(OPEN_FLOOR, np.random.default_rng(9), 5)
    tour = plan_tour(OPEN_FLOOR, Cell(0, 0, 0), stops, return_to_start=True, start_point=(0.1, 0.2, 0.0))
    assert len(tour.legs) == len(tour.route) == 6
    assert tour.legs[-1].cells[-1] == Cell(0, 0, 0)
    assert tour.route[0][0].tolist() == tour.route[-1][-1].tolist() == [0.1, 0.2, 0.0]
    assert tour.is_optimal
    assert tour.gap == 0


def test_a_tour_without_stops_goes_nowhere():
    for returns in (False, True):
        tour = plan_tour(OPEN_FLOOR, Cell(0, 0, 0), [], return_to_start=returns)
        assert (tour.stops, tour.legs, tour.route, tour.length, tour.is_optimal) == ((), (), (), 0.0, True)
    assert plan_tour(OPEN_FLOOR, Cell(0, 0, 0)).stops == ()


def test_stops_in_one_cell_are_visited_one_after_the_other():
    cell = Cell(0, 3, 3)
    x, y, z = OPEN_FLOOR.frame.center_of(cell)
    stops = [stop_in(OPEN_FLOOR, cell, name, end=(x + dx, y, z)) for name, dx in (("a", -0.1), ("b", 0.1))]
    tour = plan_tour(OPEN_FLOOR, Cell(0, 0, 0), [*stops, stop_in(OPEN_FLOOR, Cell(0, 0, 0), "here")])
    assert [stop.name for stop in tour.stops] == ["here", "a", "b"]
    assert tour.legs[2].length == 0
    assert tour.route[2].tolist() == [[x - 0.1, y, z], [x + 0.1, y, z]]


def test_stops_that_cannot_be_reached_are_listed_with_the_reason():
    free = grid_from_text("""
        ..#..
        ..#..
    """)
    graph = NavGraph.from_mask(np.stack([free, free]))
    reasons = {
        Cell(0, 0, 4): "in another part of the building",
        Cell(1, 0, 0): "on another storey",
        Cell(0, 0, 2): "its cell is blocked",
    }
    stops = [stop_in(graph, cell) for cell in reasons]
    stops.append(Stop("far", "far", Cell(0, 9, 9), (9.5, 9.5, 0.0), (9.5, 9.5, 0.0)))
    tour = plan_tour(graph, Cell(0, 0, 0), [*stops, stop_in(graph, Cell(0, 1, 1), "near")])
    assert [stop.name for stop in tour.stops] == ["near"]
    assert len(tour.unreached) == 4
    for lost, reason in zip(tour.unreached, (*reasons.values(), "outside the map"), strict=True):
        assert reason in lost.reason


def test_a_tour_from_a_blocked_cell_names_the_remedy():
    graph = NavGraph.from_mask(grid_from_text(".#."))
    with pytest.raises(StartBlockedError, match="nearest free cell"):
        plan_tour(graph, Cell(0, 0, 1))


def test_a_route_runs_from_exact_point_to_exact_point_and_keeps_its_corners():
    free = grid_from_text("""
        ....
        .##.
        .##.
    """)
    graph = NavGraph.from_mask(free, connectivity=4)
    tour = plan_tour(
        graph, Cell(0, 0, 0), [stop_in(graph, Cell(0, 0, 3), end=(3.7, 0.2, 0.0))], start_point=(0.3, 0.4, 0.0)
    )
    assert tour.route[0][:, :2].tolist() == [
        [0.3, 0.4], [0.5, 0.5], [0.5, 2.5], [3.5, 2.5], [3.5, 0.5], [3.7, 0.2],
    ]  # fmt: skip
    with pytest.raises(ValueError, match="read-only"):
        tour.route[0][0] = 0


def test_a_route_stays_out_of_the_middle_of_a_cell_that_is_reached_although_blocked():
    graph = NavGraph.from_mask(np.ones((1, 5), dtype=bool))
    stops = [
        stop_in(graph, Cell(0, 0, 2), "first", end=(2.1, 0.5, 0.0), approach="reach"),
        stop_in(graph, Cell(0, 0, 4), "second", end=(4.5, 0.5, 0.0)),
    ]
    tour = plan_tour(graph, Cell(0, 0, 0), stops)
    assert [line[:, 0].tolist() for line in tour.route] == [[0.5, 1.5, 2.1], [2.1, 3.5, 4.5]]


def test_costs_decide_on_the_order_and_lengths_are_still_metres():
    cost = np.ones((1, 1, 9))
    cost[..., 5:] = 10
    graph = NavGraph.from_mask(np.ones((1, 9), dtype=bool), cell_size=2.0).with_cost(cost)
    tour = plan_tour(
        graph, Cell(0, 0, 4), [stop_in(graph, Cell(0, 0, 7), "dear"), stop_in(graph, Cell(0, 0, 0), "cheap")]
    )
    assert [stop.name for stop in tour.stops] == ["cheap", "dear"]
    assert tour.length == 2.0 * (4 + 7)
    assert tour.cost == tour.lower_bound == 2.0 * (4 + 4 + 5.5 + 10 + 10)


def test_equal_inputs_give_equal_tours():
    stops = stops_in(OPEN_FLOOR, np.random.default_rng(10), 30)
    graphs = (NavGraph.from_mask(np.ones((20, 30), dtype=bool), cell_size=0.5) for _ in range(2))
    first, second = (plan_tour(graph, Cell(0, 0, 0), stops) for graph in graphs)
    assert [stop.name for stop in first.stops] == [stop.name for stop in second.stops]
    assert (first.length, first.lower_bound) == (second.length, second.lower_bound)
    for a, b in zip(first.route, second.route, strict=True):
        assert_array_equal(a, b)
