"""Arguments of the wrong kind, as a user who is new here gives them."""

from __future__ import annotations

import numpy as np
import pytest

import bimnav as bn
from bimnav.errors import InputError


@pytest.fixture(scope="module")
def graph():
    return bn.NavGraph.from_mask(np.ones((4, 4), dtype=bool))


@pytest.mark.parametrize("given", [None, 3, b"house.ifc", [None]])
def test_what_is_no_path_of_a_model_is_refused(given):
    with pytest.raises(InputError, match="no path"):
        bn.read_ifc(given)


@pytest.mark.parametrize("cell", [None, "abc", (1, 2), (0, 1.5, 2), 7])
def test_what_is_no_cell_is_refused(graph, cell):
    with pytest.raises(InputError, match="no cell"):
        bn.find_path(graph, bn.Cell(0, 0, 0), cell)


@pytest.mark.parametrize("cell", [(0, 1, 2), np.array([0, 1, 2])])
def test_three_whole_numbers_are_a_cell(graph, cell):
    assert bn.find_path(graph, bn.Cell(0, 0, 0), cell).length == pytest.approx(1 + 2**0.5)


@pytest.mark.parametrize("field", ["radius", "height", "speed", "battery_wh", "name"])
def test_a_robot_is_made_of_numbers_and_a_name(field):
    with pytest.raises(InputError, match=field):
        bn.Robot(**{field: ["one"]})


@pytest.mark.parametrize("size", ["0.1", None, [1], np.nan])
def test_a_cell_size_is_a_number(size):
    with pytest.raises(InputError, match="cell size"):
        bn.GridFrame.covering((0, 0, 1, 1), size, elevations=(0.0,))


def test_an_environment_is_made_of_a_building_a_task_and_a_robot():
    building = bn.Building("house", (bn.Storey("G", "Ground", 0.0),))
    task = bn.load_task("cleaning")
    with pytest.raises(InputError, match="load_task"):
        bn.make_environment(building, "cleaning")
    with pytest.raises(InputError, match="read_ifc"):
        bn.make_environment("house.ifc", task)
    with pytest.raises(InputError, match="load_robot"):
        bn.make_environment(building, task, "scrubber")


@pytest.mark.parametrize("seed", [-1, "a", 1.5, None])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(InputError, match="seed"):
        bn.run("house.ifc", seed=seed)


@pytest.mark.parametrize("target", [3, "x", {"name": "spill"}, ("spill", "here", 1), (1, 2, 3), ("\udcff", 2, 16)])
def test_what_is_no_target_is_refused(target):
    building = bn.Building("house", (bn.Storey("G", "Ground", 0.0),))
    with pytest.raises(InputError, match="target"):
        building.with_targets([target])


@pytest.fixture(scope="module")
def apartment():
    return bn.make_environment(bn.read_ifc(bn.sample("apartment")), bn.load_task("cleaning"))


@pytest.mark.parametrize("place", ["abc", (1,), 5, ("x", 2), (None, None), (np.inf, 2)])
def test_what_is_no_place_is_refused(apartment, place):
    graph = bn.build_graph(apartment, cell_size=0.3048)
    with pytest.raises(InputError, match=r"no place|not a point"):
        bn.find_start(graph, place)


def test_a_study_without_robots_is_refused(apartment):
    with pytest.raises(InputError, match="robots"):
        bn.study(apartment, starts=[(3.1, 15.9)], robots=[1, 0])
