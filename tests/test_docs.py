"""What README and docstrings show is what runs."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re

import pytest

import bimnav
from tests.conftest import REPOSITORY

MODULES = sorted(
    name
    for _, name, _ in pkgutil.walk_packages(bimnav.__path__, "bimnav.")
    if not name.endswith(("__main__", "_worker"))
)


def test_the_readme_prints_what_it_says(capsys):
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(import bimnav.*?)```", text, re.DOTALL)
    printed = re.search(r"prints\n\n```text\n(.*?)```", text, re.DOTALL)
    exec(compile(code[1], "README.md", "exec"), {})
    assert capsys.readouterr().out == printed[1]


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings_hold(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_no_public_name_is_also_a_module_which_would_take_its_place_once_imported():
    modules = {name.rpartition(".")[2] for name in MODULES if name.count(".") == 1}
    assert not modules & set(bimnav.__all__)
