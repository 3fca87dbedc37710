"""Models in plain writing, looked through by compiled code: entities, what they refer to, how deep that goes.

Plain is `#12=IFCWALL('...',#3,(#4,#5),$);` without comments or oddities. Of anything else nothing is said here.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["FLAT", "FOLLOWED", "PLACEMENT", "Survey", "has_loops_or_gaps", "survey"]

_kernel = numba.njit(cache=True, error_model="numpy", nogil=True)

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

FOLLOWED, FLAT, PLACEMENT = range(3)
"""What `has_loops_or_gaps` does with the references of an entity: follow; ignore; follow, and demand their targets."""

_TAB, _RETURN, _SPACE = b"\t\r "
_QUOTE, _HASH, _OPEN, _CLOSE, _COMMA, _SLASH, _ZERO, _SEMICOLON, _EQUALS, _A, _Z, _UNDERSCORE = b"'#(),/0;=AZ_"
_DIGITS = 18  # of a number, as many as fit into 64 bits


class Survey(NamedTuple):
    """The entities of a model, in the order of the text.

    Parameters
    ----------
    end
        Where in the text the last entity ends.
    numbers : (n,) int64
    kinds : (n,) int64, index into `names`
    names : (k, 2) int64, where the name of each class begins and ends in the text
    bodies : (n, 2) int64, where the attributes of each entity begin and end in the text, with their brackets
    marks : (n, 2) int64, where its first attribute begins and ends, if that is a text and the seventh a reference
    sevenths : (n,) int64, the number that the seventh attribute refers to; -1 if `marks` is nothing
    has_text : (n,) bool, whether there is a text among its attributes
    references : (m,) int64, numbers
    firsts : (n + 1,) int64, where the references of each begin
    """

    end: int
    numbers: Ints
    kinds: Ints
    names: Ints
    bodies: Ints
    marks: Ints
    sevenths: Ints
    has_text: NDArray[np.bool_]
    references: Ints
    firsts: Ints


def survey(text: bytes, start: int) -> Survey | None:
    """List the entities of a model, from after its header; None if they are not in plain writing."""
    is_plain, found = _survey(np.frombuffer(text, np.uint8), start)
    return Survey(*found) if is_plain else None


@_kernel
def _is_space(byte: int) -> bool:
    return byte == _SPACE or _TAB <= byte <= _RETURN


@_kernel
def _skip(text: Bytes, at: int) -> int:
    while at < len(text) and _is_space(text[at]):
        at += 1
    return at


@_kernel
def _number(text: Bytes, at: int) -> tuple[int, int]:
    """Read digits; return where they end, and their value: -1 if there are none, or too many."""
    begin, value = at, 0
    while at < len(text) and _ZERO <= text[at] < _ZERO + 10 and at - begin <= _DIGITS:
        value = value * 10 + (text[at] - _ZERO)
        at += 1
    return at, value if 0 < at - begin <= _DIGITS else -1


@_kernel
def _name_end(text: Bytes, at: int) -> int:
    while at < len(text) and (_A <= text[at] <= _Z or text[at] == _UNDERSCORE or _ZERO <= text[at] < _ZERO + 10):
        at += 1
    return at


@_kernel
def _kind(text: Bytes, begin: int, end: int, names: Ints, count: int, table: Ints) -> int:
    """Return the number of a class in a list of names, by its letters; that of the next if it is new."""
    value = 0
    for at in range(begin, end):
        value = (value * 31 + text[at]) & 0xFFFFFFFFFFF
    slot = value % len(table)
    while table[slot] >= 0:
        known, is_same = table[slot], names[table[slot], 1] - names[table[slot], 0] == end - begin
        for k in range(end - begin if is_same else 0):
            if text[names[known, 0] + k] != text[begin + k]:
                is_same = False
                break
        if is_same:
            return int(known)
        slot = (slot + 1) % len(table)
    table[slot] = count
    names[count] = begin, end
    return count


@_kernel
def _seventh(text: Bytes, at: int, mark: Ints) -> int:
    """Return the number to which a seventh attribute refers, if the first is a text and no list comes before it.

    Where the first is goes into `mark`. -1 if it is otherwise.
    """
    at = _skip(text, at + 1)
    if text[at] != _QUOTE:
        return -1
    begin = at + 1
    at = begin
    while text[at] != _QUOTE:
        at += 1
    end = at
    for attribute in range(6):
        if attribute:
            at = _skip(text, at)
            if text[at] == _QUOTE:
                at += 1
                while text[at] != _QUOTE or text[at + 1] == _QUOTE:
                    at += 1 + (text[at] == _QUOTE)
            else:
                while text[at] not in (_COMMA, _QUOTE, _OPEN, _CLOSE):
                    at += 1
                at -= 1
        at = _skip(text, at + 1)
        if text[at] != _COMMA:
            return -1
        at += 1
    at = _skip(text, at)
    if text[at] != _HASH:
        return -1
    mark[0], mark[1] = begin, end
    return _number(text, at + 1)[1]


@_kernel
def _survey(
    text: Bytes, start: int
) -> tuple[bool, tuple[int, Ints, Ints, Ints, Ints, Ints, Ints, NDArray[np.bool_], Ints, Ints]]:
    room, references_room = 1, 1
    for byte in text[start:]:
        room += byte == _SEMICOLON
        references_room += byte == _HASH
    numbers, kinds, sevenths = np.empty(room, np.int64), np.empty(room, np.int64), np.full(room, -1)
    bodies, marks = np.empty((room, 2), np.int64), np.zeros((room, 2), np.int64)
    has_text = np.zeros(room, np.bool_)
    references, firsts = np.empty(references_room, np.int64), np.zeros(room + 1, np.int64)
    names, table, name_count = np.empty((64, 2), np.int64), np.full(256, -1), 0
    count, found, end, is_plain = 0, 0, start, True
    at = _skip(text, start)
    while at < len(text) and text[at] == _HASH:
        is_plain = False
        at, numbers[count] = _number(text, at + 1)
        at = _skip(text, at)
        if numbers[count] < 0 or at >= len(text) or text[at] != _EQUALS:
            break
        begin = _skip(text, at + 1)
        at = _name_end(text, begin)
        if at == begin or at >= len(text) or text[at] != _OPEN:
            break
        kinds[count] = _kind(text, begin, at, names, name_count, table)
        name_count += kinds[count] == name_count
        if name_count == len(names):
            names = np.concatenate((names, np.empty_like(names)))
            table = np.full(4 * len(names), -1)
            for known in range(name_count):
                _kind(text, names[known, 0], names[known, 1], names, known, table)
        bodies[count, 0] = at
        while at < len(text) and text[at] not in (_SEMICOLON, _SLASH, _EQUALS):
            if text[at] == _QUOTE:
                has_text[count] = True
                at += 1
                while at < len(text) and text[at] != _QUOTE:
                    at += 1
            elif text[at] == _HASH:
                at, references[found] = _number(text, at + 1)
                if references[found] < 0 or at >= len(text) or text[at] == _QUOTE:
                    break
                found += 1
                continue
            at += 1
        if at >= len(text) or text[at] != _SEMICOLON or text[at - 1] != _CLOSE:
            break
        bodies[count, 1] = at
        if has_text[count]:
            sevenths[count] = _seventh(text, bodies[count, 0], marks[count])
        count += 1
        firsts[count] = found
        end = at + 1
        at = _skip(text, end)
        is_plain = True
    found_all = (
        end,
        numbers[:count],
        kinds[:count],
        names[:name_count],
        bodies[:count],
        marks[:count],
        sevenths[:count],
        has_text[:count],
        references[:found],
        firsts[: count + 1],
    )
    return is_plain, found_all


@_kernel
def has_loops_or_gaps(rows: Ints, firsts: Ints, roles: Ints, limit: int) -> bool:
    """Tell whether references go round, chains of them are longer than a limit, or a placement misses its target.

    Parameters
    ----------
    rows : (m,) int64, the entity that each reference leads to; -1 if there is none
    firsts : (n + 1,) int64, where the references of each entity begin
    roles : (n,) int64, `FOLLOWED`, `FLAT` or `PLACEMENT`
    limit
        The longest chain allowed.
    """
    count = len(firsts) - 1
    depth = np.full(count, -1)  # -2 while it is on the trail
    upcoming = firsts[:-1].copy()
    trail = np.empty(limit + 2, np.int64)
    for root in range(count):
        if depth[root] >= 0:
            continue
        length = 1
        trail[0] = root
        depth[root] = -2
        while length:
            row = trail[length - 1]
            last = firsts[row] if roles[row] == FLAT else firsts[row + 1]
            while upcoming[row] < last:
                target = rows[upcoming[row]]
                if target < 0:
                    if roles[row] == PLACEMENT:
                        return True
                elif depth[target] == -2:
                    return True
                elif depth[target] == -1:
                    break
                upcoming[row] += 1
            if upcoming[row] < last:
                if length > limit:
                    return True
                trail[length] = rows[upcoming[row]]
                depth[trail[length]] = -2
                length += 1
                continue
            deepest = 0
            for k in range(firsts[row], last):
                below = depth[rows[k]] if rows[k] >= 0 else 0
                deepest = max(deepest, below + 1)
            if deepest > limit:
                return True
            depth[row] = deepest
            length -= 1
    return False
