"""How the documentation is built."""

from pathlib import Path

from bimnav import __version__

project = "bimnav"
author = "the bimnav developers"
copyright = "2026, the bimnav developers"
release = version = __version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
]
html_theme = "furo"
html_title = f"bimnav {version}"
exclude_patterns = ["_build", "benchmarks/*", "tasks/found/*"]  # parts of pages, written by the scripts

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_show_tb = True
myst_enable_extensions = ["deflist", "colon_fence"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_use_rtype = False
napoleon_preprocess_types = False
suppress_warnings = ["ref.python"]  # shapes and units in docstrings, such as `x, y`, are taken for names


def _copy_tutorials() -> None:
    """Copy the text of the notebooks to where Sphinx looks; the build runs them there."""
    here = Path(__file__).parent
    folder = here / "tutorials"
    folder.mkdir(exist_ok=True)
    sources = {path.name: path for path in (here.parent / "notebooks").glob("*.md")}
    for path in folder.iterdir():
        if path.name not in sources:
            path.unlink()
    for name, source in sources.items():
        text = source.read_text(encoding="utf-8").replace("](../docs/", "](../")
        (folder / name).write_text(text, encoding="utf-8")


_copy_tutorials()
