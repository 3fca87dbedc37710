"""Narrow passages: floor on which two robots cannot pass each other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks
from bimnav.sim.areas import Passage

if TYPE_CHECKING:
    from bimnav.graph import NavGraph

__all__ = ["find_passages"]

_AROUND = np.ones((3, 3), dtype=np.bool_)
_DEEP = 4.0  # radii; a dead end this deep counts, a corner of a room does not


def find_passages(graph: NavGraph, radius: float) -> tuple[Passage, ...]:
    """Find where two robots of a radius cannot pass each other.

    The cells of the graph are where the middle of a robot may be. A cell is wide if it lies in some disk of
    free cells that is twice the radius across: there two robots fit side by side. What is left is
    narrow; it is a passage if it joins two wide parts, or is a dead end deeper than two robots. This is a
    morphological opening of the free cells; see Serra, *Image Analysis and Mathematical Morphology*, 1982.

    Parameters
    ----------
    graph
        Made for a robot of that radius.
    radius
        Of the robots, metres; nothing is narrow for a point.

    Returns
    -------
    passages
        Named `passage 1`, `passage 2` and so on, by storey, row and column.
    """
    from scipy import ndimage

    _checks.need("graph", graph, "NavGraph")
    d = graph.frame.cell_size
    if _checks.number("radius", radius, 0) == 0:
        return ()
    across = math.ceil(2 * radius / d - 1e-9)
    rows, cols = (np.mgrid[:across, :across] + 0.5 - across / 2) ** 2
    disk = rows + cols <= (across / 2) ** 2
    passages: list[Passage] = []
    for storey, free in enumerate(graph.free):
        wide = ndimage.binary_opening(free, structure=disk)
        labels, count = ndimage.label(free & ~wide, structure=_AROUND)
        for label in range(1, count + 1):
            part = labels == label
            if _is_passage(part, wide, radius / d):
                polygon = _outline(graph, part).buffer(radius)
                passages.append(Passage(f"passage {len(passages) + 1}", polygon, storey))
    return tuple(passages)


def _is_passage(part: NDArray[np.bool_], wide: NDArray[np.bool_], radius: float) -> bool:
    """Tell whether a narrow part joins two wide parts, or leads deep into a dead end."""
    from scipy import ndimage

    rows, cols = np.nonzero(part)
    window = np.s_[
        max(rows.min() - 2, 0) : rows.max() + 3,
        max(cols.min() - 2, 0) : cols.max() + 3,
    ]
    near, open_ = part[window], wide[window]
    ring = ndimage.binary_dilation(near, structure=_AROUND) & open_
    count = ndimage.label(ring, structure=_AROUND)[1]
    if count >= 2:
        return True
    if count == 0:
        return False
    depth = ndimage.distance_transform_edt(~ring)[near].max()
    return bool(depth > _DEEP * radius)


def _outline(graph: NavGraph, part: NDArray[np.bool_]) -> shapely.geometry.base.BaseGeometry:
    """Return the cells of a part as one polygon, world metres."""
    d, (x0, y0) = graph.frame.cell_size, graph.frame.origin
    rows, cols = np.nonzero(part)
    boxes = shapely.box(x0 + cols * d, y0 + rows * d, x0 + (cols + 1) * d, y0 + (rows + 1) * d)
    joined = shapely.union_all(boxes)
    return joined if math.isfinite(joined.area) else shapely.MultiPolygon()
