"""Compiling ahead of the first search."""

from __future__ import annotations

import numpy as np

from bimnav.search.components import components
from bimnav.search.engine import distances, distances_between, find
from bimnav.search.layout import Layout
from bimnav.search.ordering import EXACT, order_rows

__all__ = ["warmup"]


def warmup() -> None:
    """Compile every kernel, or load it from its cache, by using each once on something tiny."""
    cost = np.ones((1, 3, 3), dtype=np.float32)
    cells = np.array([0, 8])
    components(cost > 0)
    for multipliers in (cost, cost + np.arange(3).astype(np.float32)):
        layout = Layout(multipliers)
        find(layout, 0, 8)
        distances(layout, cells, 1.0)
        distances_between(layout, cells, 1.0)
    for count in (3, EXACT + 2):
        order_rows(np.ones((count, count)), 0, None, True, 0.0)
