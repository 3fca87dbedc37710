"""Cells, costs and masks as users give them: plain numbers, rows of arrays, and what makes no sense."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import bimnav as bn
from bimnav import Cell, NavGraph
from bimnav.errors import BimnavError, GridError, InputError, OutsideMapError, StartBlockedError, ValueRangeError
from bimnav.testing import grid_from_text

GRAPH = NavGraph.from_mask(
    grid_from_text("""
        ......
        .####.
        ......
    """)
)
FORMS = [tuple, list, np.array]


@pytest.mark.parametrize("form", FORMS)
def test_three_plain_numbers_are_as_good_as_a_cell(form):
    a, b = Cell(0, 0, 0), Cell(0, 2, 5)
    start, goal = form(a), form(b)
    assert bn.find_path(GRAPH, start, goal).cells == bn.find_path(GRAPH, a, b).cells
    assert bn.distance_field(GRAPH, start).tobytes() == bn.distance_field(GRAPH, a).tobytes()
    assert bn.adaptive_graph(GRAPH).find_path(start, goal).length == bn.adaptive_graph(GRAPH).find_path(a, b).length
    assert bn.plan_tour(GRAPH, start, [], end=goal).end == b
    assert bn.plan_tours(GRAPH, [start], []).tours[0].start == a
    assert GRAPH.block([goal]).free.sum() == GRAPH.free.sum() - 1
    assert GRAPH.explain(start) == GRAPH.explain(a)
    parted = GRAPH.block([Cell(0, 1, 0), Cell(0, 1, 5)])
    assert bn.why_unreachable(parted, start, goal) is not None


@pytest.mark.parametrize("form", FORMS)
def test_a_blocked_cell_in_plain_numbers_is_said_to_be_blocked(form):
    with pytest.raises(StartBlockedError, match=r"nearest free cell is Cell\(storey=0, row=0, col=2\)"):
        bn.find_path(GRAPH, form((0, 1, 2)), Cell(0, 0, 0))


def test_half_a_cell_is_no_cell():
    assert (0, 0.5, 0) not in GRAPH.frame
    for ask in (GRAPH.block, lambda cells: bn.distance_field(GRAPH, cells)):
        with pytest.raises(InputError, match="which is no cell"):
            ask([(0, 0.5, 0)])


@pytest.mark.parametrize("cell", [(0, 3, 0), (0, -1, 0)])
def test_why_a_cell_outside_the_map_cannot_be_reached_is_an_error(cell):
    with pytest.raises(OutsideMapError, match="outside the map"):
        bn.why_unreachable(GRAPH, Cell(0, 0, 0), cell)


@pytest.mark.parametrize(
    ("factor", "error"),
    [(np.ones((2, 2)), GridError), (1e39, ValueRangeError), (np.full((3, 6), 1e300), ValueRangeError)],
)
def test_costs_that_fit_no_cell_are_refused(factor, error):
    with pytest.raises(error):
        GRAPH.with_cost(factor)


def test_a_mask_of_unknown_cells_is_refused():
    with pytest.raises(GridError, match="NaN"):
        NavGraph.from_mask([[1.0, np.nan]])


def test_a_storey_may_be_a_number_of_numpy():
    crate = shapely.box(0, 0, 1, 1)
    here, there = (GRAPH.with_obstacle(crate, storey) for storey in (0, np.int64(0)))
    assert here.cost.tobytes() == there.cost.tobytes()


@pytest.mark.parametrize("point", [(1.0, 2.0), (np.nan, 0.0, 0.0), "here", None])
def test_a_tour_starts_at_a_point_or_not_at_all(point):
    if point is None:
        assert bn.plan_tour(GRAPH, Cell(0, 0, 0), [], start_point=None).start_point == (0.5, 0.5, 0.0)
        return
    with pytest.raises(BimnavError, match="start_point is"):
        bn.plan_tour(GRAPH, Cell(0, 0, 0), [], start_point=point)


@pytest.mark.parametrize("reach", [1e15, 1e18, 1e30])
def test_an_obstacle_without_end_closes_everything_or_is_refused(reach):
    everything = shapely.box(-reach, -reach, reach, reach)
    if reach < 2**53:
        assert not GRAPH.with_obstacle(everything).free.any()
    else:
        with pytest.raises(GridError, match="too far"):
            GRAPH.with_obstacle(everything)


def test_a_point_out_of_all_counting_lies_outside_the_map():
    with pytest.raises(OutsideMapError):
        GRAPH.frame.cell_at(1e308, 0.0)


def test_a_clearance_closes_no_cell():
    with pytest.raises(ValueRangeError, match="a cost is above"):
        GRAPH.with_cost(3e38).with_clearance(2.0)


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "rope"},
        {"length": None},
        {"length": "1"},
        {"length": np.nan},
        {"begin": (0, 0)},
        {"begin": (0, 0.5, 0)},
        {"points": [[0, 0], [1, 1]]},
    ],
)
def test_a_link_that_cannot_be_is_refused(change):
    with pytest.raises(InputError):
        bn.Link(**{"begin": Cell(0, 0, 0), "end": Cell(1, 0, 0), "length": 1.0, **change})


def test_a_replanner_stays_with_its_cells():
    robot = bn.Replanner(GRAPH, Cell(0, 0, 0), Cell(0, 2, 5))
    with pytest.raises(GridError, match="same cells"):
        robot.update(NavGraph.from_mask(np.ones((2, 2), bool)))
