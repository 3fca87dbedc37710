"""The benchmarks run, on something tiny, and find their places on the page."""

from __future__ import annotations

import importlib
import re
from typing import Any

import pytest
import shapely

from bimnav.grid import GridFrame
from tests.conftest import REPOSITORY

PARTS = ("machine", "kernel", "copies", "raster", "cache", "memory", "peers", "growth")


@pytest.fixture
def reading(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(REPOSITORY / "benchmarks"))
    module = importlib.import_module("reading")
    monkeypatch.setattr(module, "ROUNDS", (1, 1))
    return module


def test_reading_is_measured_and_published(reading: Any, tmp_path, monkeypatch: pytest.MonkeyPatch):
    page = tmp_path / "reading.md"
    page.write_text("before <!-- kernel -->\nold\n<!-- end --> after")
    monkeypatch.setattr(reading, "PAGE", page)
    table = reading.against_kernel([reading.generated_model(tmp_path, 60)])
    reading.publish([table], {"machine": "two cores", "Python": "3"})
    text = page.read_text()
    assert text.startswith("before <!-- kernel -->\n\n| model | B0 / tessellation |")
    assert "| generated, 60 products |" in text
    assert text.endswith("<!-- end --> after")
    assert "old" not in text
    assert all(value > 0 for value in table.rows[0][1:])


def test_cells_are_compared_with_shapely(reading: Any):
    polygons = [shapely.Point(1.0, 1.0).buffer(0.7), shapely.box(0.0, 0.0, 0.3, 2.0)]
    _, _, _, count, differing, *_ = reading._raster(GridFrame.covering((0, 0, 2, 2), 0.1), polygons)
    assert (count, differing) == (2, 0)


def test_the_page_has_a_place_for_every_table():
    text = (REPOSITORY / "docs" / "benchmarks" / "reading.md").read_text(encoding="utf-8")
    assert tuple(re.findall(r"<!-- (\w+) -->\n(?=(?:(?!<!--).)*<!-- end -->)", text, re.DOTALL)) == PARTS


def test_growth_is_drawn(reading: Any, tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(reading, "FIGURE", tmp_path / "figures" / "growth.png")
    columns = ("products", "footprints, s", "B0, s", "peak, MB", "allowed, MB")
    reading.draw_growth(
        reading.Table("growth", columns, [(1000, 0.1, 0.2, 200.0, 260.0), (5000, 0.5, 1.1, 250.0, 300.0)])
    )
    assert reading.FIGURE.read_bytes().startswith(b"\x89PNG")
