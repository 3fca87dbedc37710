# mypy: disable-error-code="assignment"
"""Growing blocked cells by a footprint of cells, 64 cells at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bimnav.search.compiled import lean

__all__ = ["dilate", "grow"]


def dilate(mask: NDArray[np.bool_], footprint: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells on which a footprint lies whose middle is somewhere in a mask.

    Parameters
    ----------
    mask : (rows, cols) bool
    footprint : (odd, odd) bool
        Laid with its middle on every cell of the mask.
    """
    rows, cols = mask.shape
    up, aside = footprint.shape[0] // 2, footprint.shape[1] // 2
    edges = np.diff(np.pad(footprint, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    after = np.nonzero(edges == -1)[1]
    lengths, run_length = np.unique(after - first, return_inverse=True)
    # guard words on both sides, so that a shift never asks where a row ends
    guard = aside // 64 + 2
    words = (cols + 63) // 64 + 2 * guard
    bits = np.zeros((rows, words), dtype=np.uint64)
    inside = slice(8 * guard, 8 * guard + (cols + 7) // 8)
    bits.view(np.uint8)[:, inside] = np.packbits(mask, axis=1, bitorder="little")
    grown = np.zeros((rows + 2 * up, words), dtype=np.uint64)
    powers = np.empty((footprint.shape[1].bit_length(), words), dtype=np.uint64)
    lines = np.empty((len(lengths), words), dtype=np.uint64)
    grow(bits, row, first - aside, run_length, lengths, grown, powers, lines, guard)
    found = grown[up : up + rows].view(np.uint8)[:, inside]
    return np.unpackbits(found, axis=1, count=cols, bitorder="little").view(np.bool_)


@lean
def _shift_into(line: NDArray[np.uint64], by: int, into: NDArray[np.uint64], guard: int) -> None:
    """Add a line of bits to another, moved to higher places; to lower ones where `by` is negative."""
    words, bits = by >> 6, np.uint64(by & 63)
    back = np.uint64(63) - bits
    # slices, so that no index can be negative and the loop works on several words at a time
    begin, end = guard - 1, len(line) - guard + 1
    low, high = line[begin - words - 1 : end - words - 1], line[begin - words : end - words]
    into = into[begin:end]
    for k in range(len(into)):
        into[k] |= high[k] << bits | low[k] >> np.uint64(1) >> back


@lean
def grow(
    bits: NDArray[np.uint64],
    run_row: NDArray[np.int64],
    run_first: NDArray[np.int64],
    run_length: NDArray[np.int64],
    lengths: NDArray[np.int64],
    grown: NDArray[np.uint64],
    powers: NDArray[np.uint64],
    lines: NDArray[np.uint64],
    guard: int,
) -> None:
    """Add every run of a footprint, laid on every bit, to `grown`; row k of the footprint moves rows up by k.

    Parameters
    ----------
    run_length
        Index into `lengths`.
    powers, lines
        Scratch: a row of bits with every bit drawn out to 1, 2, 4, ... cells; two of these make one of any
        of the `lengths`.
    """
    rows, words = bits.shape
    for row in range(rows):
        anything = np.uint64(0)
        for word in range(words):
            anything |= bits[row, word]
            powers[0, word] = bits[row, word]
        if not anything:
            continue
        for k in range(1, len(powers)):
            for word in range(words):
                powers[k, word] = powers[k - 1, word]
            _shift_into(powers[k - 1], 1 << (k - 1), powers[k], guard)
        for k in range(len(lengths)):
            power = 0
            while 2 << power <= lengths[k]:
                power += 1
            for word in range(words):
                lines[k, word] = powers[power, word]
            _shift_into(powers[power], lengths[k] - (1 << power), lines[k], guard)
        for k in range(len(run_row)):
            _shift_into(lines[run_length[k]], run_first[k], grown[row + run_row[k]], guard)
