"""Polyhedra straight from the text of a model: compiled, for a large model has millions of their corners.

What is read is exactly `((#1,#2,...))` and the like. Anything else, a comment or a hole in a list, is for the
geometry kernel to make something of.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["UNREADABLE", "divide", "gather", "index"]

_kernel = numba.njit(cache=True, error_model="numpy", nogil=True)

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Points = NDArray[np.float64]

UNREADABLE = -1
_QUOTE, _HASH, _OPEN, _CLOSE, _STAR, _PLUS, _COMMA, _MINUS, _DOT, _SLASH = b"'#()*+,-./"
_SEMICOLON, _EQUALS, _ZERO, _E, _F, _T, _Z = b";=0EFTZ"
_LOWER = 32  # from a capital to its small letter
_DIGITS = 18  # of a number, as many as fit into 64 bits
_APICES = 8  # corners that are tried as the middle of a fan
_SLIVER = 1e-6  # of a face's area, below which a triangle of a fan is too thin


def _hash_of(name: str) -> int:
    value = 0
    for letter in name.encode():
        value = (value * 31 + letter) % (1 << 61)
    return value


_BREP = _hash_of("IFCFACETEDBREP")
_MODELS = (_hash_of("IFCFACEBASEDSURFACEMODEL"), _hash_of("IFCSHELLBASEDSURFACEMODEL"))
_SHELLS = (_hash_of("IFCCLOSEDSHELL"), _hash_of("IFCOPENSHELL"), _hash_of("IFCCONNECTEDFACESET"))
_FACE = _hash_of("IFCFACE")
_BOUNDS = (_hash_of("IFCFACEOUTERBOUND"), _hash_of("IFCFACEBOUND"))
_LOOP = _hash_of("IFCPOLYLOOP")
_POINT = _hash_of("IFCCARTESIANPOINT")


@_kernel
def index(text: Bytes) -> tuple[Ints, Ints]:
    """Find the entities of a model: their numbers, and where in the text each begins, after the `=`."""
    room = 1
    for byte in text:
        room += byte == _SEMICOLON
    numbers, places = np.empty(room, np.int64), np.empty(room, np.int64)
    count, at, is_fresh = 0, 0, True
    while at < len(text):
        byte = text[at]
        if byte == _QUOTE:
            at += 1
            while at < len(text) and text[at] != _QUOTE:
                at += 1
        elif byte == _SLASH and at + 1 < len(text) and text[at + 1] == _STAR:
            at += 3
            while at < len(text) and not (text[at] == _SLASH and text[at - 1] == _STAR):
                at += 1
        elif byte == _SEMICOLON:
            is_fresh = True
        elif byte == _HASH and is_fresh:
            at, number = _number_at(text, at + 1)
            at = _skip(text, at)
            if at < len(text) and text[at] == _EQUALS:
                numbers[count], places[count] = number, at + 1
                count += 1
            is_fresh = False
            continue
        elif byte > 32:
            is_fresh = False
        at += 1
    return numbers[:count], places[:count]


@_kernel
def _skip(text: Bytes, at: int) -> int:
    """Return where the next byte is that is no space."""
    while at < len(text) and text[at] <= 32:
        at += 1
    return at


@_kernel
def _byte(text: Bytes, at: int) -> int:
    return text[at] if at < len(text) else 0


@_kernel
def _number_at(text: Bytes, at: int) -> tuple[int, int]:
    """Read the digits of a step id."""
    at = _skip(text, at)
    number = 0
    while at < len(text) and _ZERO <= text[at] < _ZERO + 10 and number < 1 << 58:
        number = number * 10 + (text[at] - _ZERO)
        at += 1
    return at, number


@_kernel
def _keyword(text: Bytes, at: int) -> tuple[int, int]:
    """Read the name of a class; return where it ends, and its hash."""
    at = _skip(text, at)
    value = 0
    while at < len(text) and text[at] > 32 and text[at] != _OPEN:
        letter = text[at] - _LOWER if text[at] > _Z + 6 else text[at]
        value = (value * 31 + letter) % (1 << 61)
        at += 1
    return at, value


@_kernel
def _row_of(numbers: Ints, number: int) -> int:
    row = int(np.searchsorted(numbers, number))
    return row if row < len(numbers) and numbers[row] == number else UNREADABLE


@_kernel
def _references(text: Bytes, numbers: Ints, at: int, depth: int, rows: Ints, used: int) -> tuple[Ints, int]:
    """Add the rows of `((#1,#2))` to `rows`, where `depth` is 2; -1 entries if it is anything else."""
    for _ in range(depth):
        at = _skip(text, at)
        if _byte(text, at) != _OPEN:
            return rows, UNREADABLE
        at += 1
    while True:
        at = _skip(text, at)
        if _byte(text, at) != _HASH:
            return rows, UNREADABLE
        at, number = _number_at(text, at + 1)
        row = _row_of(numbers, number)
        if row < 0:
            return rows, UNREADABLE
        if used == len(rows):
            rows = np.concatenate((rows, np.empty_like(rows)))
        rows[used] = row
        used += 1
        at = _skip(text, at)
        if _byte(text, at) != _COMMA:
            break
        at += 1
    for _ in range(depth):
        at = _skip(text, at)
        if _byte(text, at) != _CLOSE:
            return rows, UNREADABLE
        at += 1
    at = _skip(text, at)
    return rows, used if _byte(text, at) == _SEMICOLON else UNREADABLE


@_kernel
def _bound(text: Bytes, numbers: Ints, at: int) -> tuple[int, bool]:
    """Read `(#1,.T.)`: the row of the loop, and whether it is to be taken as it is."""
    at = _skip(text, at)
    if _byte(text, at) != _OPEN:
        return UNREADABLE, True
    at = _skip(text, at + 1)
    if _byte(text, at) != _HASH:
        return UNREADABLE, True
    at, number = _number_at(text, at + 1)
    at = _skip(text, at)
    if _byte(text, at) != _COMMA:
        return UNREADABLE, True
    at = _skip(text, at + 1)
    if _byte(text, at) != _DOT or _byte(text, at + 2) != _DOT:
        return UNREADABLE, True
    letter = text[at + 1] & ~_LOWER
    is_read = letter in (_T, _F) and _ends(text, at + 3)
    return (_row_of(numbers, number) if is_read else UNREADABLE), letter == _T


@_kernel
def _point(text: Bytes, at: int, point: Points) -> bool:
    """Read `((1.,2.5,-3.E-1))` into `point`; tell whether it is that."""
    for _ in range(2):
        at = _skip(text, at)
        if _byte(text, at) != _OPEN:
            return False
        at += 1
    for axis in range(3):
        at, point[axis] = _real(text, _skip(text, at))
        at = _skip(text, at)
        if not math.isfinite(point[axis]) or _byte(text, at) != (_CLOSE if axis == 2 else _COMMA):
            return False
        at += 1
    return _ends(text, at)


@_kernel
def _ends(text: Bytes, at: int) -> bool:
    """Tell whether a statement ends here: `);`."""
    at = _skip(text, at)
    return _byte(text, at) == _CLOSE and _byte(text, _skip(text, at + 1)) == _SEMICOLON


@_kernel
def _real(text: Bytes, at: int) -> tuple[int, float]:
    """Read a number, to its last bit if it has up to 15 digits; nan if there is none."""
    is_negative = False
    if _byte(text, at) in (_PLUS, _MINUS):
        is_negative = text[at] == _MINUS
        at += 1
    whole, digits, power, seen, is_fraction = 0, 0, 0, False, False
    while at < len(text):
        byte = text[at]
        if byte == _DOT and not is_fraction:
            is_fraction = True
        elif _ZERO <= byte < _ZERO + 10:
            seen = True
            if digits < _DIGITS:
                whole = whole * 10 + (byte - _ZERO)
                digits += whole > 0
                power -= is_fraction
            else:
                power += not is_fraction
        else:
            break
        at += 1
    if _byte(text, at) & ~_LOWER == _E:
        at += 1
        is_small = False
        if _byte(text, at) in (_PLUS, _MINUS):
            is_small = text[at] == _MINUS
            at += 1
        at, exponent = _number_at(text, at)
        power += -min(exponent, 999) if is_small else min(exponent, 999)
    if not seen:
        return at, math.nan
    value = float(whole)
    if power < 0:
        value = value / 10.0**-power if power > -300 else 0.0
    elif whole:
        value *= 10.0**power
    return at, -value if is_negative and whole else value


@_kernel
def gather(text: Bytes, numbers: Ints, places: Ints, items: Ints) -> tuple[bool, Points, Ints, Ints, Ints]:
    """Collect the faces of polyhedra; corners of a shell that are in one place are one.

    Parameters
    ----------
    text
        A whole model.
    numbers, places
        From `index`, sorted by number.
    items
        Step ids of `IfcFacetedBrep`, `IfcFaceBasedSurfaceModel` or `IfcShellBasedSurfaceModel`.

    Returns
    -------
    is_read
        False if they are more than faces between straight edges, or damaged.
    points : (n, 3) float64, in the file's units
    corners
        Of all loops one after the other, indexes into `points`; no loop stays in place or has less than three.
    loops
        Where each loop begins in `corners`, and where the last ends.
    faces
        Where each face begins in `loops`, and where the last ends.
    """
    nothing = False, np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.int64)
    shells, shell_count = np.empty(16, np.int64), 0
    for number in items:
        row = _row_of(numbers, number)
        if row < 0:
            return nothing
        at, kind = _keyword(text, places[row])
        if kind != _BREP and kind not in _MODELS:
            return nothing
        shells, shell_count = _references(text, numbers, at, 1 if kind == _BREP else 2, shells, shell_count)
        if shell_count < 0:
            return nothing
    rows, row_count = np.empty(256, np.int64), 0
    first_faces = np.empty(shell_count + 1, np.int64)  # of each shell
    for number in range(shell_count):
        first_faces[number] = row_count
        at, kind = _keyword(text, places[shells[number]])
        if kind not in _SHELLS:
            return nothing
        rows, row_count = _references(text, numbers, at, 2, rows, row_count)
        if row_count < 0:
            return nothing
    first_faces[shell_count] = row_count
    corners, corner_count = np.empty(1024, np.int64), 0
    loops, loop_count = np.zeros(256, np.int64), 0
    faces = np.zeros(row_count + 1, np.int64)
    bounds = np.empty(16, np.int64)
    for face in range(row_count):
        at, kind = _keyword(text, places[rows[face]])
        bounds, bound_count = _references(text, numbers, at, 2, bounds, 0)
        if kind != _FACE or bound_count < 0:
            return nothing
        for bound in bounds[:bound_count]:
            at, kind = _keyword(text, places[bound])
            if kind not in _BOUNDS:
                return nothing
            loop, is_forward = _bound(text, numbers, at)
            if loop < 0:
                return nothing
            at, kind = _keyword(text, places[loop])
            if kind != _LOOP:
                return nothing
            begin = corner_count
            corners, corner_count = _references(text, numbers, at, 2, corners, corner_count)
            if corner_count < 0:
                return nothing
            if not is_forward:
                corners[begin:corner_count] = corners[begin:corner_count][::-1].copy()
            loop_count += 1
            if loop_count == len(loops):
                loops = np.concatenate((loops, np.empty_like(loops)))
            loops[loop_count] = corner_count
        faces[face + 1] = loop_count
    points, point_count = np.empty((corner_count, 3)), 0
    for number in range(shell_count):
        ends = loops[faces[first_faces[number]]], loops[faces[first_faces[number + 1]]]
        found = _join(text, places, corners[ends[0] : ends[1]], points[point_count:])
        if found < 0:
            return nothing
        corners[ends[0] : ends[1]] += point_count
        point_count += found
    return True, points[:point_count].copy(), *_proper(corners[:corner_count], loops[: loop_count + 1], faces)


@_kernel
def _join(text: Bytes, places: Ints, corners: Ints, points: Points) -> int:
    """Replace rows of points by numbers, the same for all in one place.

    Returns how many there are, and puts them into `points`; -1 if one is no point.
    """
    size = 16
    while size < 2 * len(corners):
        size *= 2
    by_row, by_place = np.full(size, -1, np.int64), np.full(size, -1, np.int64)
    rows, known = np.empty(len(corners), np.int64), np.empty(len(corners), np.int64)
    count = row_count = 0
    for corner in range(len(corners)):
        row = corners[corner]
        slot = (row * 0x9E3779B1) & (size - 1)
        while by_row[slot] >= 0 and rows[by_row[slot]] != row:
            slot = (slot + 1) & (size - 1)
        if by_row[slot] < 0:
            at, kind = _keyword(text, places[row])
            if kind != _POINT or not _point(text, at, points[count]):
                return UNREADABLE
            by_row[slot] = row_count
            rows[row_count], known[row_count] = row, _place(points, count, by_place)
            count += known[row_count] == count
            row_count += 1
        corners[corner] = known[by_row[slot]]
    return count


@_kernel
def _place(points: Points, candidate: int, by_place: Ints) -> int:
    """Return the number of the point that is where the candidate is, in a table of points; itself if it is new."""
    x, y, z = points[candidate]
    bits = points[candidate].view(np.int64)
    value = (bits[0] >> 12) * 0x9E3779B1 + (bits[1] >> 12) * 0x85EBCA77 + (bits[2] >> 12) * 0xC2B2AE3D
    slot = (value ^ (value >> 29) ^ (value >> 43)) & (len(by_place) - 1)
    while by_place[slot] >= 0:
        other = by_place[slot]
        if points[other, 0] == x and points[other, 1] == y and points[other, 2] == z:
            return int(other)
        slot = (slot + 1) & (len(by_place) - 1)
    by_place[slot] = candidate
    return candidate


@_kernel
def _proper(corners: Ints, loops: Ints, faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Leave out corners that repeat the one before, loops of less than three, and faces without loops."""
    kept, kept_loops, kept_faces = np.empty_like(corners), np.zeros_like(loops), np.zeros_like(faces)
    count = loop_count = face_count = 0
    for face in range(len(faces) - 1):
        for loop in range(faces[face], faces[face + 1]):
            begin = count
            for corner in corners[loops[loop] : loops[loop + 1]]:
                if count == begin or kept[count - 1] != corner:
                    kept[count] = corner
                    count += 1
            while count > begin + 1 and kept[count - 1] == kept[begin]:
                count -= 1
            if count - begin < 3:
                count = begin
                continue
            loop_count += 1
            kept_loops[loop_count] = count
        if loop_count > kept_faces[face_count]:
            face_count += 1
            kept_faces[face_count] = loop_count
    return kept[:count], kept_loops[: loop_count + 1], kept_faces[: face_count + 1]


@_kernel
def divide(points: Points, corners: Ints, loops: Ints, faces: Ints) -> tuple[NDArray[np.int32], Ints]:
    """Divide the faces into triangles that are fans round a corner; return also which faces are none.

    Parameters are as returned by `gather`.
    """
    triangles, count = np.empty((len(corners), 3), np.int32), 0
    left, left_count = np.empty(len(faces), np.int64), 0
    for face in range(len(faces) - 1):
        loop = corners[loops[faces[face]] : loops[faces[face] + 1]]
        apex = _apex(points, loop) if faces[face + 1] == faces[face] + 1 else UNREADABLE
        if apex < 0:
            left[left_count] = face
            left_count += 1
            continue
        for k in range(1, len(loop) - 1):
            triangles[count, 0] = loop[apex]
            triangles[count, 1] = loop[(apex + k) % len(loop)]
            triangles[count, 2] = loop[(apex + k + 1) % len(loop)]
            count += 1
    return triangles[:count], left[:left_count]


@_kernel
def _apex(points: Points, loop: Ints) -> int:
    """Return a corner that sees all of a loop; -1 if none of the first does."""
    if len(loop) == 3:
        return 0
    normal = np.zeros(3)
    for k in range(1, len(loop) - 1):
        normal += _cross(points, loop[0], loop[k], loop[k + 1])
    twice = math.sqrt((normal * normal).sum())
    if twice == 0.0:
        return UNREADABLE
    normal /= twice
    for apex in range(min(len(loop), _APICES)):
        turned = 0.0
        for k in range(1, len(loop) - 1):
            one, other = loop[(apex + k) % len(loop)], loop[(apex + k + 1) % len(loop)]
            area = (normal * _cross(points, loop[apex], one, other)).sum()
            if area < _SLIVER * twice:
                break
            turned += math.atan2(
                area, ((points[one] - points[loop[apex]]) * (points[other] - points[loop[apex]])).sum()
            )
        else:
            if turned < math.tau:
                return apex
    return UNREADABLE


@_kernel
def _cross(points: Points, at: int, one: int, other: int) -> Points:
    x, y, z = points[at]
    p, q, r = points[one, 0] - x, points[one, 1] - y, points[one, 2] - z
    s, t, u = points[other, 0] - x, points[other, 1] - y, points[other, 2] - z
    return np.array((q * u - r * t, r * s - p * u, p * t - q * s))
