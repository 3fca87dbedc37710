"""Write the .ipynb beside each tutorial: `python notebooks/pair.py`. The text is the source; outputs are never kept."""

from __future__ import annotations

from pathlib import Path

import jupytext
import nbformat

HERE = Path(__file__).parent


def notebook_of(source: Path) -> str:
    """Return a text source as a notebook without outputs, the same bytes every time."""
    notebook = jupytext.read(source)
    notebook.metadata.pop("file_format", None)
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"  # else they are drawn at random
    return nbformat.writes(notebook) + "\n"


if __name__ == "__main__":
    for source in sorted(HERE.glob("*.md")):
        source.with_suffix(".ipynb").write_text(notebook_of(source), encoding="utf-8")
