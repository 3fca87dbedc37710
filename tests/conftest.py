"""What tests share: small worlds, and real models where they are at hand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
REAL_IFC = Path(os.environ.get("BIMNAV_REAL_IFC", REPOSITORY.parent / "shared" / "ifc"))
BENCH = Path(os.environ.get("BIMNAV_BENCH", REPOSITORY.parent / "shared" / "bench"))


def real_model(name: str) -> Path:
    """Return the path of a real model, or skip the test with a reason."""
    path = REAL_IFC / name
    if not path.exists():
        pytest.skip(f"real model {name} is not at hand: set BIMNAV_REAL_IFC")
    return path


def bench_file(name: str) -> Path:
    """Return the path of a benchmark file, or skip the test with a reason."""
    path = BENCH / name
    if not path.exists():
        pytest.skip(f"benchmark {name} is not at hand: set BIMNAV_BENCH")
    return path


@pytest.fixture
def data_ifc() -> Path:
    """Return the folder of our own sample models."""
    return REPOSITORY / "data" / "ifc"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --full, which runs the large campaigns whole."""
    parser.addoption("--full", action="store_true", help="run the large campaigns whole")


@pytest.fixture
def full(request: pytest.FixtureRequest) -> bool:
    """Tell whether large campaigns run whole."""
    return bool(request.config.getoption("--full"))
