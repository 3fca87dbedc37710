"""Paths drawn straight: exact on masks and around exact shapes, and never through anything."""

from __future__ import annotations

import csv
import dataclasses
import math
from itertools import combinations, pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose
from scipy.sparse.csgraph import dijkstra

import bimnav as bn
from bimnav import Cell, NavGraph, find_path, search
from bimnav.errors import ValueRangeError
from bimnav.tasks import Task
from bimnav.testing import box, grid_from_text, room
from tests.conftest import bench_file, real_model


def free_cells(graph, rng, count):
    return [Cell(*cell) for cell in rng.choice(np.argwhere(graph.free), count).tolist()]


def closed_floor(free):
    """Return what a point may not enter, as open polygons: a touch is no harm."""
    rows, cols = free.shape
    blocked = [shapely.box(c, r, c + 1, r + 1) for r, c in np.argwhere(~free)]
    rim = shapely.difference(shapely.box(-1, -1, cols + 1, rows + 1), shapely.box(0, 0, cols, rows))
    # cells that touch at a corner leave no gap between them
    pinches = [
        shapely.Point(c, r).buffer(1e-5)
        for r in range(1, rows)
        for c in range(1, cols)
        if free[r - 1, c - 1] == free[r, c] != free[r - 1, c] == free[r, c - 1]
    ]
    walls = shapely.buffer(shapely.union_all([*blocked, rim]), -1e-6, join_style="mitre")
    return shapely.union_all([walls, *pinches])


def shortest_by_visibility(free, start, goal):
    """Return the length of the shortest path by testing all pairs of corners with shapely."""
    wall = closed_floor(free)
    corners = [(c, r) for r in range(free.shape[0] + 1) for c in range(free.shape[1] + 1)]
    padded = np.pad(free, 1)
    corners = [(c, r) for c, r in corners if 1 <= padded[r : r + 2, c : c + 2].sum() < 4]
    points = [start, goal, *corners]
    pairs = list(combinations(range(len(points)), 2))
    lines = shapely.linestrings([[points[a], points[b]] for a, b in pairs])
    shapely.prepare(wall)
    length = np.zeros((len(points), len(points)))
    for (a, b), is_free in zip(pairs, ~shapely.intersects(wall, lines), strict=True):
        if is_free:
            length[a, b] = math.dist(points[a], points[b])
    return dijkstra(length, directed=False, indices=0)[1]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_a_taut_path_is_as_short_as_a_visibility_graph_allows(seed):
    rng = np.random.default_rng(seed)
    free = rng.random(rng.integers(2, 7, 2)) < rng.choice([0.6, 0.8, 0.9])
    free[tuple(rng.integers(free.shape))] = True
    cells = rng.choice(np.argwhere(free), 2)
    offset = rng.choice([0.5, 0.25, 0.0])  # middles, other points, and corners of cells
    start, goal = ((col + offset, row + offset) for row, col in cells.tolist())
    if start == goal or (
        offset == 0 and not all(free[max(r - 1, 0) : r + 1, max(c - 1, 0) : c + 1].all() for r, c in cells)
    ):
        return  # at a corner where cells meet, shapely cannot tell on which side the path begins
    mesh, face = search.mesh_of_mask(free)
    found = search.find_taut(mesh, start, int(face[tuple(cells[0])]), goal, int(face[tuple(cells[1])]))
    due = shortest_by_visibility(free, start, goal)
    assert_allclose(math.inf if found is None else found.length, due, rtol=1e-9, atol=1e-12)
    if found is not None:
        assert_allclose(sum(math.dist(a, b) for a, b in pairwise(found.points)), found.length)


def test_taut_paths_are_as_short_as_the_published_euclidean_ones(full):
    with bench_file("grid2d/euclid_reference.csv").open() as file:
        rows = list(csv.DictReader(file))
    for name in sorted({row["map"] for row in rows})[:: 1 if full else 3]:
        lines = bench_file(f"grid2d/{name}.map").read_text().splitlines()[4:]
        free = np.array([[letter in ".G" for letter in line] for line in lines if line])
        mesh, face = search.mesh_of_mask(free)
        for row in [row for row in rows if row["map"] == name][:: 1 if full else 5]:
            x, y, to_x, to_y = (int(row[key]) for key in ("start_x", "start_y", "goal_x", "goal_y"))
            found = search.find_taut(mesh, (x, y), int(face[y, x]), (to_x, to_y), int(face[to_y, to_x]))
            assert found is not None
            assert_allclose(found.length, float(row["euclid_optimal"]), rtol=1e-8)


def test_a_smooth_path_touches_the_corner_of_a_pillar():
    graph = NavGraph.from_mask(
        grid_from_text("""
        .....
        ..#..
        .....
    """)
    )
    path = find_path(graph, Cell(0, 1, 0), Cell(0, 1, 4), smooth="any_angle")
    assert_allclose(np.sort(path.waypoints[:, 0]), [0.5, 2, 3, 4.5])
    assert_allclose(path.length, 1 + 2 * math.hypot(1.5, 0.5))
    assert path.cost == path.length
    assert path.cells == find_path(graph, Cell(0, 1, 0), Cell(0, 1, 4)).cells


def test_waypoints_of_a_path_over_cells_are_its_turns():
    graph = NavGraph.from_mask(np.ones((3, 5), dtype=bool), connectivity=4)
    path = find_path(graph, Cell(0, 0, 0), Cell(0, 2, 4))
    steps = np.abs(np.diff(path.waypoints, axis=0)).sum(axis=1)
    assert len(path.waypoints) == 3
    assert_allclose(steps.sum(), path.length)


@pytest.mark.parametrize("connectivity", [4, 8])
@pytest.mark.parametrize("weighted", [False, True])
def test_smoothing_costs_nothing_and_cuts_no_corner(connectivity, weighted):
    rng = np.random.default_rng(3)
    for _ in range(40):
        shape = tuple(rng.integers(4, 30, 2))
        graph = NavGraph.from_mask(rng.random(shape) < 0.8, cell_size=0.5, connectivity=connectivity)
        if weighted:
            graph = graph.with_cost(rng.choice([1, 1, 1, 2, 5.5], shape))
        wall = shapely.affinity.scale(closed_floor(graph.free[0]), 0.5, 0.5, origin=(0, 0))
        for _ in range(4):
            start, goal = free_cells(graph, rng, 2)
            if graph.components[start] != graph.components[goal] or start == goal:
                continue
            plain = find_path(graph, start, goal)
            smooth = find_path(graph, start, goal, smooth="any_angle")
            assert_allclose(smooth.waypoints[[0, -1]], plain.points[[0, -1]], atol=1e-9)
            assert smooth.cost <= plain.cost * (1 + 1e-12)
            assert_allclose(smooth.length, sum(math.dist(a, b) for a, b in pairwise(smooth.waypoints)))
            assert smooth.cost >= smooth.length * (1 - 1e-12)
            assert not shapely.LineString(smooth.waypoints[:, :2]).intersects(wall)


def test_expensive_floor_is_gone_around_where_that_pays():
    cost = np.ones((9, 9))
    cost[:8, 4] = 10
    graph = NavGraph.from_mask(np.ones((9, 9), dtype=bool)).with_cost(cost)
    path = find_path(graph, Cell(0, 4, 0), Cell(0, 4, 8), smooth="any_angle")
    assert path.waypoints[:, 1].max() >= 8
    assert path.cost < 16


def test_turns_move_where_the_cost_changes_gradually():
    free = np.ones((40, 70), dtype=bool)
    free[:25, 20:23] = free[15:, 45:48] = False
    graph = NavGraph.from_mask(free, cell_size=0.1).with_clearance(0.8)
    ratios = []
    for rows in ((3, 30), (12, 20), (30, 8), (20, 37)):
        start, goal = Cell(0, rows[0], 2), Cell(0, rows[1], 66)
        plain, smooth = find_path(graph, start, goal), find_path(graph, start, goal, smooth="any_angle")
        ratios.append(smooth.cost / plain.cost)
        steps = np.diff(smooth.waypoints[:, :2], axis=0)
        turns = np.degrees(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
        assert np.abs(turns).max() < 45
    assert max(ratios) < 0.98


def test_an_unknown_way_of_smoothing_is_refused():
    graph = NavGraph.from_mask(np.ones((2, 2), dtype=bool))
    with pytest.raises(ValueRangeError, match="any_angle"):
        find_path(graph, Cell(0, 0, 0), Cell(0, 1, 1), smooth="spline")  # type: ignore[arg-type]


def furnished(radius=0.2, cell_size=0.25):
    building = room(6, 5, elements=[box("Table", 2, 1, 0, 4, 3.5, 0.8), box("Shelf", 4.6, 3, 0, 5, 5, 2)])
    environment = bn.make_environment(building, Task("nothing"), bn.Robot(radius=radius))
    return environment, bn.build_graph(environment, cell_size=cell_size, connectivity=8)


def test_legs_pass_exact_shapes_at_the_radius_of_the_robot():
    environment, graph = furnished()
    path = find_path(graph, graph.frame.cell_at(1, 2), graph.frame.cell_at(4.3, 2), smooth="any_angle")
    check = bn.check_path(path.waypoints, environment)
    check.raise_if_unsafe()
    assert 0 <= check.clearance < 0.002
    assert path.length < find_path(graph, path.cells[0], path.cells[-1]).length


def test_a_cell_that_is_closed_later_closes_its_surroundings_to_straight_legs():
    building = room(6, 5, elements=[box("Left", 0, 2.4, 0, 2.6, 2.6, 2), box("Right", 3.4, 2.4, 0, 6, 2.6, 2)])
    environment = bn.make_environment(building, Task("nothing"), bn.Robot(radius=0.05))
    graph = bn.build_graph(environment, cell_size=0.2, connectivity=8)
    gap = [
        Cell(0, *cell)
        for cell in np.argwhere(graph.free[0]).tolist()
        if abs(graph.frame.center_of(Cell(0, *cell))[1] - 2.5) < 0.25
    ]
    start, goal = graph.frame.cell_at(3, 1), graph.frame.cell_at(3, 4)
    assert find_path(graph, start, goal, smooth="any_angle").length == pytest.approx(3, abs=0.2)
    half = graph.block([cell for cell in gap if graph.frame.center_of(cell)[0] < 3.05])
    path = find_path(half, start, goal, smooth="any_angle")
    closed = shapely.union_all([shapely.box(*graph.frame.box_of(cell)) for cell in gap if not half.free[cell]])
    assert not shapely.LineString(path.waypoints[:, :2]).intersects(closed.buffer(-1e-9))


def test_smooth_paths_of_real_houses_pass_the_judge():
    building = bn.read_ifc(real_model("houses/SampleHouse4.ifc"))
    environment = bn.make_environment(building, bn.load_task("cleaning"), bn.Robot(radius=0.2))
    graph = bn.build_graph(environment, cell_size=0.1, connectivity=8)
    rng = np.random.default_rng(0)
    shorter = []
    for _ in range(25):
        start, goal = free_cells(graph, rng, 2)
        if start == goal or graph.components[start] != graph.components[goal]:
            continue
        plain, smooth = find_path(graph, start, goal), find_path(graph, start, goal, smooth="any_angle")
        bn.check_path(smooth.waypoints, environment).raise_if_unsafe()
        assert smooth.length <= plain.length + 1e-9
        shorter.append(smooth.length / plain.length)
    assert np.mean(shorter) < 0.97


def test_a_smooth_tour_goes_straight_from_exact_point_to_exact_point():
    building = bn.read_ifc(bn.sample("apartment"))
    for radius in (0.0, 0.2):
        environment = bn.make_environment(building, bn.load_task("cleaning"), bn.Robot(radius=radius))
        graph = bn.build_graph(environment, cell_size=0.1524, connectivity=8, on_conflict="reach")
        start = bn.find_start(graph).cell
        plain, smooth = (bn.plan_tour(graph, start, smooth=how, return_to_start=True) for how in (None, "any_angle"))
        assert [stop.name for stop in smooth.stops] == [stop.name for stop in plain.stops]
        due = {v.kind for v in bn.check_plan(plain).violations}
        assert {v.kind for v in bn.check_plan(smooth).violations} == due, "only what a stop in an obstacle costs"
        lengths = [sum(np.linalg.norm(np.diff(leg, axis=0), axis=1).sum() for leg in t.route) for t in (plain, smooth)]
        assert lengths[1] < 0.97 * lengths[0]
        if radius == 0:
            assert_allclose(smooth.length, lengths[1])


def test_a_smooth_path_takes_connectors_as_they_are():
    free = np.ones((2, 6, 8), dtype=bool)
    free[0, 1:3, 3] = free[1, 2, 2:5] = False
    way = [(7.5, 5.5, 0), (7.5, 7, 1.5), (7.5, 5.5, 3)]
    link = bn.Link(Cell(0, 5, 7), Cell(1, 5, 7), 5.0, points=way)
    graph = dataclasses.replace(NavGraph.from_mask(free), connectors=(link,))
    start, goal = Cell(0, 0, 0), Cell(1, 0, 1)
    plain, smooth = (find_path(graph, start, goal, smooth=how) for how in (None, "any_angle"))
    assert [link for _, link in smooth.rides] == [link]
    assert smooth.length < plain.length
    for path in (plain, smooth):
        assert (path.waypoints == way[1]).all(axis=1).sum() == 1
        flat = [math.dist(a, b) for a, b in pairwise(path.waypoints) if a[2] == b[2]]
        assert_allclose(path.length, sum(flat) + 5)
        assert_allclose(path.cost, path.length)
