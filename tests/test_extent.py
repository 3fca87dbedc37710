"""The box of a product by the numbers in its file: it holds what the geometry kernel makes of it."""

from __future__ import annotations

import ifcopenshell
import numpy as np
import pytest
from ifcopenshell.util.unit import calculate_unit_scale

import bimnav as bn
from bimnav.ifc._extent import extent_of
from tests.conftest import real_model

MODELS = [
    "duplex/Duplex_A_20110907.ifc",
    "houses/SampleHouse4.ifc",
    "mep/b03_heating_with_building_blenderBIM.ifc",
    "nasty/House.ifc",
    "office/demo2.ifc",
]


def assert_boxes_hold(path) -> None:
    building, file = bn.read_ifc(path), ifcopenshell.open(path)
    scale = calculate_unit_scale(file)
    judged = 0
    for element in building.elements:
        if element.bounds is not None:
            low, high = np.array(extent_of(file.by_guid(element.global_id), scale))
            assert (low <= element.bounds[0] + 1e-6).all(), element.name
            assert (high >= element.bounds[1] - 1e-6).all(), element.name
            judged += 1
    assert judged > 20


@pytest.mark.parametrize("name", bn.list_samples())
def test_every_box_holds_its_element_in_the_samples(name):
    assert_boxes_hold(bn.sample(name))


@pytest.mark.parametrize("name", MODELS)
def test_every_box_holds_its_element_in_real_models(name):
    assert_boxes_hold(real_model(name))
