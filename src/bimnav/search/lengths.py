"""Lengths as whole numbers, so that sums are exact and ties are ties.

A length in cells is held in units of 2**-36. A diagonal step is then an odd number of units, and the
numbers of straight and diagonal steps of a path can be read back from its length, by the inverse of
that odd number modulo 2**36: the length in float64 is right to the last bit however it was summed.
"""

from __future__ import annotations

import math

from bimnav.search.compiled import lean

__all__ = ["DIAGONAL", "FAR", "SHIFT", "STRAIGHT", "to_cells"]

SHIFT = 36  # makes the rounded root odd; it is 4e-12 from the root itself
STRAIGHT = 1 << SHIFT
DIAGONAL = round(math.sqrt(2) * STRAIGHT)
FAR = 1 << 62

_INVERSE = pow(DIAGONAL, -1, STRAIGHT)
_ROOT = math.sqrt(2)


@lean
def to_cells(units: int) -> float:
    """Return the length of a path of straight and diagonal steps, in cells."""
    diagonal = (units * _INVERSE) & (STRAIGHT - 1)
    return ((units - diagonal * DIAGONAL) >> SHIFT) + diagonal * _ROOT
