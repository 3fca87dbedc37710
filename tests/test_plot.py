"""Figures are drawn, of the right things, and to the byte."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

import bimnav as bn
from bimnav.errors import InputError, MissingExtraError, ValueRangeError
from bimnav.plot import figure_bytes


@pytest.fixture(scope="module")
def office():
    building = bn.read_ifc(bn.sample("office"))
    environment = bn.make_environment(building, bn.load_task("cleaning"), bn.Robot(radius=0.2))
    graph = bn.build_graph(environment, cell_size=0.2)
    start = bn.find_start(graph)
    plan = bn.plan_tours(graph, [start.cell, start.cell], start_points=[start.point, start.point])
    return building, graph, start, plan, bn.simulate(plan.tours, robots=plan.robots, service_time=5.0)


def texts(ax):
    legend = ax.get_legend()
    named = [text.get_text() for text in legend.get_texts()] if legend else []
    return [text.get_text() for text in ax.texts] + named + [ax.get_title()]


def drawn(draw):
    """Draw without a screen, and return the axes."""
    kept = []
    picture = figure_bytes(lambda ax: kept.append(draw(ax)))
    assert picture == figure_bytes(draw)
    return kept[0]


def test_the_plan_of_a_building_names_its_rooms_and_what_is_drawn(office):
    ax = drawn(lambda ax: bn.plot_building(office[0], storey="First Floor", ax=ax))
    assert "102 Lounge" in texts(ax)
    assert "door" in texts(ax)
    assert "Office, First Floor" in texts(ax)


def test_a_field_is_drawn_with_its_unit_and_refused_in_another_shape(office):
    _, graph, start, _, _ = office
    field = bn.distance_field(graph, start.cell)
    ax = drawn(lambda ax: bn.plot_field(graph, field, ax=ax))
    assert ax.images[0].get_array().max() == pytest.approx(field[0][np.isfinite(field[0])].max())
    with pytest.raises(InputError, match="the field is"):
        bn.plot_field(graph, field[0])


def test_a_fleet_is_drawn_robot_by_robot(office):
    _, _, _, plan, result = office
    for shown in (plan, result):
        names = texts(drawn(lambda ax, shown=shown: bn.plot_fleet(shown, ax=ax)))
        assert any(name.startswith("R1: ") for name in names)
        assert any(name.startswith("R2: ") for name in names)


def test_a_timeline_has_a_row_for_each_robot_and_ends_with_the_last(office):
    result = office[4]
    ax = drawn(lambda ax: bn.plot_timeline(result, ax=ax))
    assert [label.get_text() for label in ax.get_yticklabels()] == ["R1", "R2"]
    assert ax.get_xlim() == result.span
    assert {"moving", "working"} <= set(texts(ax))


def test_an_animation_has_a_frame_for_every_moment(office, tmp_path):
    path = bn.animate(office[4], tmp_path / "a.gif", speed=60.0, frames_per_second=5)
    with Image.open(path) as image:
        assert image.n_frames == int(np.ceil(office[4].makespan / 60.0 * 5)) + 1
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "options", "error"),
    [
        ("a.txt", {}, InputError),
        ("a.gif", {"speed": 0.0}, ValueRangeError),
        ("a.gif", {"speed": 0.01}, ValueRangeError),
    ],
)
def test_an_animation_that_cannot_be_written_is_refused(office, tmp_path, name, options, error):
    with pytest.raises(error):
        bn.animate(office[4], tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []


def test_mp4_without_ffmpeg_names_the_remedy(office, tmp_path, monkeypatch):
    from bimnav.plot import _time

    monkeypatch.setattr(_time.FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(MissingExtraError, match="ffmpeg"):
        bn.animate(office[4], tmp_path / "a.mp4")
