"""Notebooks are their text sources, and hold no outputs."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "notebooks"
SOURCES = sorted(FOLDER.glob("*.md"))

pytest.importorskip("jupytext", reason="jupytext is not installed: pip install --group docs")


@pytest.fixture(scope="module")
def notebook_of():
    return runpy.run_path(str(FOLDER / "pair.py"))["notebook_of"]


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_a_notebook_is_its_text_source_to_the_byte(source: Path, notebook_of):
    kept = source.with_suffix(".ipynb").read_text(encoding="utf-8")
    assert kept == notebook_of(source), "write the notebooks again: make notebooks"


def test_no_notebook_is_without_its_source_and_none_holds_outputs():
    kept = sorted(FOLDER.glob("*.ipynb"))
    assert [path.stem for path in kept] == [path.stem for path in SOURCES]
    for path in kept:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), path.name


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_a_tutorial_begins_with_its_title_and_is_linked(source: Path):
    text = source.read_text(encoding="utf-8").split("---", 2)[2].lstrip()
    assert text.startswith("# ")
    assert f"tutorials/{source.stem}" in (REPOSITORY / "docs" / "index.md").read_text(encoding="utf-8")
