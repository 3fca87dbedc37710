"""Fields that follow a changing map are those of the map as it is, to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import settings, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from numpy.testing import assert_array_equal

from bimnav import search
from bimnav.search.workspace import workspace


class ChangingWorld(RuleBasedStateMachine):
    """Cells close, open and change cost in any order; a field keeps up."""

    @initialize(
        seed=st.integers(0, 2**32 - 1), connectivity=st.sampled_from([4, 8]), storeys=st.integers(1, 2),
        level=st.sampled_from([1.0, 2.5]), links=st.integers(0, 3),
    )  # fmt: skip
    def build(self, seed, connectivity, storeys, level, links):
        self.rng = np.random.default_rng(seed)
        shape = storeys, *self.rng.integers(2, 14, 2)
        self.cost = np.where(self.rng.random(shape) < 0.8, level, math.inf).astype(np.float32)
        self.cost.flat[0] = level
        self.level, self.connectivity = level, connectivity
        self.links = self.rng.choice(np.flatnonzero(np.isfinite(self.cost)), (links, 2))
        self.link_costs = self.rng.choice([0.0, 0.4, 1.0, 7.3], links)
        self.sources = self.rng.choice(np.flatnonzero(np.isfinite(self.cost)), 2)
        self.field = search.Field(self.layout(), self.sources)

    def layout(self):
        return search.Layout(self.cost, self.connectivity, self.links, self.link_costs)

    def change(self, cells, cost):
        cells = np.unique(cells)
        self.cost.flat[cells] = cost
        self.field.update(cells, cost)

    @rule(count=st.integers(1, 4))
    def close(self, count):
        self.change(self.rng.integers(self.cost.size, size=count), math.inf)

    @rule(count=st.integers(1, 4))
    def open(self, count):
        self.change(self.rng.integers(self.cost.size, size=count), self.level)

    @rule(cost=st.sampled_from([1.0, 1.3, 4.0]))
    def change_cost(self, cost):
        free = np.flatnonzero(np.isfinite(self.cost))
        if len(free):
            self.change(self.rng.choice(free, 1), cost)

    @invariant()
    def the_field_is_that_of_the_map_as_it_is(self):
        due = search.distances(self.layout(), self.sources, 0.5)
        if self.field.is_uniform == self.layout().is_uniform:
            assert_array_equal(self.field.distances(0.5), due)
        else:  # a map that has become uniform again is not counted in whole units
            np.testing.assert_allclose(self.field.distances(0.5), due, rtol=1e-9)
        cell = int(self.sources[0])
        assert self.field.at(cell, 0.5) == self.field.distances(0.5).flat[cell]
        assert not self.field._marks.any()


TestChangingWorld = ChangingWorld.TestCase
TestChangingWorld.settings = settings(max_examples=40, stateful_step_count=10, deadline=None)


@pytest.mark.parametrize("weighted", [False, True])
def test_small_changes_are_repaired_and_large_ones_searched_anew(weighted):
    rng = np.random.default_rng(2)
    cost = np.where(rng.random((1, 120, 120)) < 0.8, 1, math.inf).astype(np.float32)
    if weighted:
        cost *= rng.choice([1, 2.5], cost.shape).astype(np.float32)
    source = int(np.flatnonzero(np.isfinite(cost))[0])
    cost.flat[source + 120 : source + 122] = 1
    field = search.Field(search.Layout(cost), [source])
    repaired = []
    for cell in rng.choice(cost.size, 120, replace=False):
        new = math.inf if np.isfinite(cost.flat[cell]) else 1.0
        cost.flat[cell] = new
        repaired.append(field.update(cell, new))
        assert_array_equal(field.distances(2.0), search.distances(search.Layout(cost), np.array([source]), 2.0))
        assert (workspace().keys == search.compiled.NEVER).all()
    assert np.mean(repaired) > 0.5
    wall = np.arange(source + 5 * 120, source + 6 * 120)
    cost.flat[wall] = math.inf
    assert not field.update(wall, math.inf)
    assert_array_equal(field.distances(1.0), search.distances(search.Layout(cost), np.array([source]), 1.0))
    assert not field._marks.any()
    assert (workspace().keys == search.compiled.NEVER).all()


def test_a_change_that_changes_nothing_is_no_change():
    field = search.Field(search.Layout(np.ones((1, 3, 3), dtype=np.float32)), [0])
    assert field.update([4], 1.0)
    assert field.at(8, 1.0) == pytest.approx(2 * math.sqrt(2))
    assert field.update([1, 3], math.inf)
    assert field.at(8, 1.0) == math.inf
