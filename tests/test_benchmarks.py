"""The benchmark scripts run; what they find is published, not tested."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.conftest import REPOSITORY, bench_file


@pytest.mark.parametrize(("script", "case"), [("tours", "tsp/optima.csv")])
def test_a_script_runs_on_its_smallest_cases(script, case):
    bench_file(case)
    command = [sys.executable, str(REPOSITORY / "benchmarks" / f"{script}.py"), "--quick"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "| --- |" in done.stdout
