"""Figures are drawn, of the right things, and to the byte."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure
from PIL import Image

import bimnav as bn
from bimnav.errors import InputError, MissingExtraError, ValueRangeError
from bimnav.plot import figure_bytes
from bimnav.plot._names import draw_names


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


def test_names_of_rooms_cover_neither_marks_nor_each_other_and_stay_in_their_rooms(office):
    tour = office[3].tours[0]
    ax = drawn(lambda ax: bn.plot_tour(tour, ax=ax))
    names = [text for text in ax.texts if text.get_style() == "italic"]
    to_plan = ax.transData.inverted()
    boxes = [shapely.box(*to_plan.transform(text.get_window_extent()).ravel()) for text in names]
    assert len(names) >= 8
    marks = [shapely.Point(stop.destination) for stop in tour.stops] + [shapely.Point(tour.start_point)]
    assert not any(box.intersects(mark) for box in boxes for mark in marks)
    assert not any(a.intersects(b) for a, b in itertools.combinations(boxes, 2))
    rooms = {region.name: region.polygon for region in tour.graph.environment.regions if region.storey == 0}
    for text, box in zip(names, boxes, strict=True):
        told = text.get_text().replace("\n", " ")
        room = next(polygon for name, polygon in rooms.items() if name.startswith(told))
        assert room.buffer(0.01).covers(box)


def test_a_name_is_written_on_two_lines_or_smaller_or_left_out_as_its_room_asks():
    def written(width, depth):
        figure = Figure(figsize=(5, 5))
        ax = figure.add_axes((0, 0, 1, 1))
        draw_names(ax, [("12 Archive", shapely.box(0, 0, width, depth))], (0, 0, 10, 10))
        return [(text.get_text(), text.get_fontsize()) for text in ax.texts]

    assert written(5, 1) == [("12 Archive", 6.5)]
    assert written(0.95, 1) == [("12\nArchive", 6.5)]
    assert written(0.55, 0.4) == [("12", 5.5)]
    assert written(0.2, 0.2) == []


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
