"""A look at the installation: versions, and a job small enough to check by eye."""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib import metadata
from typing import Any

__all__ = ["examine"]

_PACKAGES = (
    "bimnav ifcopenshell joblib lark manifold3d matplotlib numba numpy pydantic python-fcl pyvrp rustworkx scipy "
    "shapely simpy trimesh"
)


def examine() -> dict[str, Any]:
    """Return versions and the outcome of a few tests of the installation."""
    versions = {"python": platform.python_version(), "platform": platform.platform()}
    for package in _PACKAGES.split():
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    tests = [
        _try("read the sample apartment", _reads_the_sample),
        _try("clean it with a path that touches nothing", _cleans_the_sample),
        _try("draw a figure", _draws),
    ]
    return {"versions": versions, "tests": tests, "ok": all(test["ok"] for test in tests)}


def _try(name: str, test: Callable[[], None]) -> dict[str, Any]:
    try:
        test()
    except Exception as error:  # whatever breaks here is the finding
        return {"test": name, "ok": False, "why": f": {type(error).__name__}: {error}"}
    return {"test": name, "ok": True, "why": ""}


def _reads_the_sample() -> None:
    import bimnav as bn

    building = bn.read_ifc(bn.sample("apartment"), cache=False)
    if len(building.spaces) < 3 or building.ledger.lost:
        raise RuntimeError(f"the sample was read as {building!r}")


def _cleans_the_sample() -> None:
    import bimnav as bn

    mission = bn.run(bn.sample("apartment"), cell_size=0.1524)
    if not (mission.is_complete and mission.check.ok):
        raise RuntimeError(f"{len(mission.tour.unreached)} targets were not served")


def _draws() -> None:
    import bimnav as bn
    from bimnav.plot import figure_bytes

    graph = bn.NavGraph.from_mask([[True, True], [True, False]])
    if not figure_bytes(lambda ax: bn.plot_graph(graph, ax=ax)).startswith(b"\x89PNG"):
        raise RuntimeError("no PNG came out")
