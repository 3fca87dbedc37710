"""Preferred distance from obstacles, as a multiplier that falls smoothly to 1."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav import search
from bimnav.errors import ValueRangeError

__all__ = ["clearance_factors"]


def clearance_factors(
    free: NDArray[np.bool_], cell_size: float, metres: float, weight: float = 4.0
) -> NDArray[np.float32]:
    """Return what free cells cost for being near blocked ones.

    Parameters
    ----------
    free : (storeys, rows, cols) bool
        All around it is blocked.
    cell_size
        Edge of a cell in metres.
    metres
        Distance, from the middle of a cell to the nearest blocked one, from which on nothing is added.
    weight
        Added right beside an obstacle; it falls with the square of the distance that is missing.

    Returns
    -------
    factor : (storeys, rows, cols) float32
        From 1 to 1 + weight; 1 where blocked.
    """
    if not 0 <= metres < math.inf:
        raise ValueRangeError(f"clearance is {metres}.", "Give metres, at least 0.")
    if not 0 <= weight < math.inf:
        raise ValueRangeError(f"the weight of a clearance is {weight}.", "Give a number of at least 0.")
    # one factor for each squared distance, up to where nothing is missing; 0 is a blocked cell
    reach = min(metres / cell_size + 0.5, float(sum(free.shape)))
    away = np.sqrt(np.arange(math.ceil(reach * reach) + 2))
    missing = 1 - (away - 0.5) * (cell_size / max(metres, 1e-9))
    factor = (1 + weight * np.square(np.clip(missing, 0, 1))).astype(np.float32)
    factor[0] = 1
    return search.by_clearance(free, factor)
