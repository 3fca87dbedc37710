"""The benchmark of the search runs."""

from __future__ import annotations

import sys

from tests.conftest import REPOSITORY


def test_a_tiny_run_of_the_benchmark_measures_and_finds_equal_results(monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(REPOSITORY / "benchmarks"))
    monkeypatch.delitem(sys.modules, "search", raising=False)
    import search as benchmark

    parts = ["fields", "matrix", "building", "dilation", "transform", "eased", "repair", "memory", "growth"]
    rows = benchmark.main(["--tiny", "--queries", "2", "--only", *parts])
    assert len(rows) == 9
    assert not [row for row in rows if "NOT" in row.found]
    assert capsys.readouterr().out.count("\n") == 9
    assert benchmark.table(rows).count("\n") == 10
