"""Orders with alternatives, priorities and deadlines, compared with trying all."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bimnav import order_stops
from bimnav.errors import InputError, NoPathError, ValueRangeError


def spread(rng, count, *, directed=False):
    xy = rng.random((count, 2))
    cost = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return cost + (0.3 * rng.random((count, count)) if directed else 0.0) * (1 - np.eye(count))


def length_of(cost, rows, closed):
    return sum(cost[a, b] for a, b in itertools.pairwise([*rows, rows[0]] if closed else rows))


def all_orders(groups, start, end):
    members = {}
    for row, group in enumerate(groups):
        if row not in (start, end):
            members.setdefault(group, []).append(row)
    for chosen in itertools.product(*members.values()):
        for middle in itertools.permutations(chosen):
            yield [start, *middle, *([] if end is None else [end])]


@pytest.mark.parametrize("directed", [False, True])
@pytest.mark.parametrize(("end", "closed"), [(None, False), (None, True), (1, False)])
def test_one_of_every_group_is_visited_as_well_as_by_trying_all(directed, end, closed, monkeypatch):
    from bimnav.search import ordering

    rng = np.random.default_rng(1)
    for exact in (True, False):
        if not exact:
            monkeypatch.setattr(ordering, "EXACT", 0)
        for _ in range(3):
            cost = spread(rng, 12, directed=directed)
            groups = [-1, -2, *rng.permutation([0, 0, 0, 1, 1, 2, 2, 3, 4, 4])]
            best = min(length_of(cost, rows, closed) for rows in all_orders(groups, 0, end))
            found = order_stops(cost, groups=groups, end=end, return_to_start=closed)
            assert_allclose(found.length, best, rtol=1e-7 if exact else 0.05)
            assert_allclose(length_of(cost, found.order, closed), found.length)
            assert found.bound <= best + 1e-9
            assert found.is_optimal or not exact
            assert {groups[row] for row in found.order} >= set(range(5))
            assert len(found.order) == 5 + 1 + (0 if end is None else 1) + (end is None)  # row 1 is a stop of its own


def test_many_groups_have_an_order_at_least_as_good_as_with_the_first_of_each():
    rng = np.random.default_rng(2)
    middle = rng.random((40, 2))
    xy = np.vstack([middle[:1], *(m + 0.05 * rng.random((4, 2)) for m in middle[1:])])
    cost = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    groups = [0, *np.repeat(np.arange(1, 40), 4)]
    found = order_stops(cost, groups=groups, return_to_start=True)
    first = np.arange(1, 157, 4)
    assert sorted({groups[row] for row in found.order}) == list(range(40))
    assert (
        found.bound <= found.length <= order_stops(cost[np.ix_([0, *first], [0, *first])], return_to_start=True).length
    )
    assert found.order == order_stops(cost, groups=groups, return_to_start=True).order


@pytest.mark.parametrize("count", [7, 24])
@pytest.mark.parametrize(("end", "closed"), [(None, False), (None, True), (1, False)])
def test_a_higher_priority_goes_first(count, end, closed):
    rng = np.random.default_rng(3)
    cost = spread(rng, count)
    priority = rng.integers(0, 3, count)
    found = order_stops(cost, priority=priority, end=end, return_to_start=closed)
    visited = [row for row in found.order[1:] if row != end]
    assert sorted(found.order) == list(range(count))
    assert [priority[row] for row in visited] == sorted(priority[visited], reverse=True)
    assert found.bound <= found.length
    if count == 7:
        best = min(
            length_of(cost, rows, closed)
            for rows in all_orders(range(count), 0, end)
            if all(priority[a] >= priority[b] for a, b in itertools.pairwise([r for r in rows[1:] if r != end]))
        )
        assert found.is_optimal
        assert_allclose(found.length, best)


def best_by_due(cost, due, service, weight):
    """The most that can be kept, and the least time for it, by trying all."""
    best = (0.0, 0.0)
    for size in range(1, len(cost)):
        for rows in itertools.permutations(range(1, len(cost)), size):
            time, at = 0.0, 0
            for row in rows:
                time += cost[at, row] + service[row]
                at = row
                if time > due[row]:
                    break
            else:
                best = max(best, (sum(weight[row] for row in rows), -time))
    return best[0], -best[1]


def test_deadlines_are_kept_and_what_cannot_be_is_left_out():
    rng = np.random.default_rng(4)
    for _ in range(15):
        cost, service = spread(rng, 7), rng.random(7) * 0.1
        service[0] = 0.0
        due = np.where(rng.random(7) < 0.5, rng.random(7) * 1.5, math.inf)
        found = order_stops(cost, due=due, service=service)
        kept, time = best_by_due(cost, due, service, np.ones(7))
        assert len(found.order) - 1 == kept
        assert_allclose(found.length, time)
        assert sorted([*found.order, *found.left_out]) == list(range(7))


def test_of_two_that_cannot_both_be_in_time_the_one_of_higher_priority_is_kept():
    cost = [[0, 5, 5], [5, 0, 10], [5, 10, 0]]
    assert order_stops(cost, due=[math.inf, 6, 6], priority=[0, 1, 2]).order == (0, 2)
    assert order_stops(cost, due=[math.inf, 6, 6], priority=[0, 2, 1]).order == (0, 1)


def test_many_deadlines_are_kept_where_an_order_is_known_that_keeps_them():
    rng = np.random.default_rng(5)
    cost = spread(rng, 20)
    known = [0, *rng.permutation(np.arange(1, 20)).tolist()]
    times = np.cumsum([0.0, *(cost[a, b] for a, b in itertools.pairwise(known))])
    due = np.full(20, math.inf)
    due[known[1::4]] = times[1::4] + 1e-3
    found = order_stops(cost, due=due)
    assert found.left_out == ()
    arrival = dict(
        zip(found.order, np.cumsum([0.0, *(cost[a, b] for a, b in itertools.pairwise(found.order))]), strict=True)
    )
    assert all(arrival[row] <= due[row] + 1e-9 for row in range(20))
    assert found.length <= times[-1] + 1e-9


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"groups": [0, 1]}, InputError),
        ({"priority": [0, math.nan, 0]}, ValueRangeError),
        ({"due": [0, -1, 0]}, ValueRangeError),
        ({"service": [0, 1]}, InputError),
    ],
)
def test_conditions_that_do_not_fit_the_matrix_are_refused(options, error):
    with pytest.raises(error):
        order_stops(np.ones((3, 3)), **options)


def test_a_group_without_a_way_to_it_is_refused():
    cost = np.ones((4, 4))
    cost[:, 2:] = math.inf
    with pytest.raises(NoPathError):
        order_stops(cost, groups=[0, 1, 2, 2])


def test_no_order_that_breaks_priorities_is_taken_where_none_keeps_them():
    matrix = [[0, 1, math.inf], [1, 0, 1], [1, 1, 0]]
    assert order_stops(matrix, return_to_start=True).order == (0, 1, 2)
    with pytest.raises(NoPathError):
        order_stops(matrix, return_to_start=True, priority=[0, 0, 1])


def test_a_due_time_of_an_end_is_refused_and_not_forgotten():
    with pytest.raises(InputError, match="row 1, is due"):
        order_stops([[0, 9, 1], [9, 0, 2], [1, 2, 0]], end=1, due=[math.inf, 1.0, math.inf])
    assert order_stops([[0, 9, 1], [9, 0, 2], [1, 2, 0]], due=[0.0, math.inf, math.inf]).order == (0, 2, 1)
