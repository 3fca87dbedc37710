"""Compiling ahead of the first search."""

from __future__ import annotations

import numpy as np

from bimnav.search.components import components
from bimnav.search.dilation import dilate
from bimnav.search.engine import distances, distances_between, find
from bimnav.search.layout import Layout
from bimnav.search.mesh import mesh_of_mask
from bimnav.search.ordering import EXACT, order_rows
from bimnav.search.oriented import find_motion
from bimnav.search.repair import Field
from bimnav.search.sight import along, dearest, relax, shorten
from bimnav.search.taut import find_taut
from bimnav.search.trace import centers
from bimnav.search.transform import by_clearance, clearances

__all__ = ["warmup"]


def warmup() -> None:
    """Compile every kernel, or load it from its cache, by using each once on something tiny."""
    cost = np.ones((1, 3, 3), dtype=np.float32)
    cells = np.array([0, 8])
    components(cost > 0)
    clearances(cost > 0)
    by_clearance(cost > 0, cost[0, 0])
    dilate(cost[0] > 0, cost[0] > 0)
    everywhere = np.ones((8, 3, 3), dtype=np.bool_)
    find_motion(everywhere, everywhere, (0, 0, 0), (-1, 2, 2), 1.0, 2.0)
    mesh, face = mesh_of_mask(np.eye(3) < 1)
    find_taut(mesh, (0.5, 2.5), int(face[2, 0]), (2.5, 0.5), int(face[0, 2]))
    line = np.array([[0.5, 0.5], [2.5, 0.5], [2.5, 2.5]])
    shorten(cost[0], line)
    relax(cost[0], line)
    along(cost[0], 0.5, 0.5, 2.5, 2.5)
    dearest(cost[0], 0.5, 0.5, 2.5, 2.5)
    for multipliers in (cost, cost + np.arange(3).astype(np.float32)):
        layout = Layout(multipliers)
        found = find(layout, 0, 8)
        if found:
            centers(found.indices, 0, 0, 1.0, np.zeros(1))
        distances(layout, cells, 1.0)
        distances_between(layout, cells, 1.0)
        Field(layout, [0]).update([4], np.inf)
    for count in (3, EXACT + 2):
        order_rows(np.ones((count, count)), 0, None, True, 0.0)
