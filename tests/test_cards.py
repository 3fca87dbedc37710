"""Cards in notebooks: small, readable, and safe with any name."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

import bimnav as bn


@pytest.fixture(scope="module")
def shown():
    building = bn.read_ifc(bn.sample("apartment")).with_targets([("<b>spill</b> & more", 1.0, 17.0)])
    task = bn.load_task("cleaning")
    environment = bn.make_environment(building, task)
    graph = bn.build_graph(environment)
    start = bn.find_start(graph)
    tour = bn.plan_tour(graph, start.cell, start_point=start.point)
    return {"building": building, "task": task, "environment": environment, "graph": graph, "tour": tour}


@pytest.mark.parametrize("name", ["building", "task", "environment", "graph", "tour"])
def test_a_card_is_well_formed_and_its_names_are_text(shown, name):
    card = shown[name]._repr_html_()
    ElementTree.fromstring(card)
    assert "<b>spill</b>" not in card
    assert len(card) < 60_000


def test_the_card_of_a_tour_lists_its_stops_and_draws_its_way(shown):
    card = shown["tour"]._repr_html_()
    assert "&lt;b&gt;spill&lt;/b&gt; &amp; more" in card
    assert "polyline" in card
    assert "proved shortest" in card


def test_the_card_of_a_building_counts_what_is_in_it(shown):
    card = shown["building"]._repr_html_()
    assert re.search(r"\d+ Wall", card)
    assert "IFC4" in card
