"""Cards in notebooks: small, readable, and safe with any name."""

from __future__ import annotations

import re
from html.parser import HTMLParser
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


def test_the_card_of_a_team_says_who_does_what_and_that_of_a_study_what_was_tried(shown):
    graph = shown["graph"]
    start = bn.find_start(graph)
    team = bn.plan_tours(graph, [start.cell, start.cell])._repr_html_()
    ElementTree.fromstring(team)
    assert re.search(r"R1</td>.*stops, [\d.]+ m</td>", team)
    assert "makespan, proved best" in team
    told = []
    found = bn.study(
        shown["environment"], starts=[start.point[:2]], speeds=[0.5, 1.0], progress=lambda *beat: told.append(beat)
    )
    ElementTree.fromstring(card := found._repr_html_())
    assert "2 of 2" in card
    assert "0.5; 1.0" in card
    assert told == [(0, 2, "scenarios"), (2, 2, "scenarios")]


def test_the_replay_shows_inside_a_notebook_as_text_that_stays_in_its_frame(shown):
    pytest.importorskip("IPython", reason="IPython is not installed: pip install ipython")
    result = bn.simulate(shown["tour"], service_time=5.0)
    markup = result.show(height=321).data
    frames = []
    reader = HTMLParser()
    reader.handle_starttag = lambda tag, attributes: frames.append((tag, dict(attributes)))
    reader.feed(markup)
    assert [tag for tag, _ in frames] == ["div", "iframe"]
    frame = frames[1][1]
    assert frame["srcdoc"] == result.to_html()
    assert (frame["sandbox"], frame["height"]) == ("allow-scripts", "321")
