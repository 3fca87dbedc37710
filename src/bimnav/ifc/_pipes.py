"""Pipes and elbows: circles swept along a line or round an axis, which kernels take a hundred times longer for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.ifc._clips import Clipper
from bimnav.ifc._kernel import Entity

__all__ = ["Pipes", "elbow", "pipe"]

_SAG = 1e-3  # metres; chords lie inside the circle by no more, as the kernels have it
_STEP = 0.5  # radians; no chord spans more
_FULL = 1e-9  # radians by which a turn may miss the full circle

Points = NDArray[np.float64]


class Pipes:
    """Reads solids whose profile is a circle.

    Parameters
    ----------
    clipper
        Reads placements.
    unit_scale
        Metres per length unit.
    angle_scale
        Radians per angle unit.
    """

    def __init__(self, clipper: Clipper, unit_scale: float, angle_scale: float) -> None:
        self._clipper, self._unit_scale, self._angle_scale = clipper, unit_scale, angle_scale

    def can_read(self, item: Entity, name: str) -> bool:
        """Tell whether an item of a class, given by name, is a pipe or an elbow."""
        return name in ("IfcExtrudedAreaSolid", "IfcRevolvedAreaSolid") and (
            item.SweptArea is not None and item.SweptArea.is_a() == "IfcCircleProfileDef"
        )

    def read(self, item: Entity) -> Mesh | None:
        """Return the mesh of an item that can be read, in metres; None if it is damaged or has no volume."""
        try:
            profile = item.SweptArea
            radius = profile.Radius * self._unit_scale
            frame, at = self._clipper.matrix(item.Position), self._clipper.matrix(profile.Position)
            if frame is None or at is None or not 0.0 < radius < math.inf:
                return None
            if item.is_a() == "IfcExtrudedAreaSolid":
                along = _unit(item.ExtrudedDirection.DirectionRatios) * (item.Depth * self._unit_scale)
                return _moved(pipe(at[:3, 3], radius, along), frame)
            axis = _unit(item.Axis.Axis.DirectionRatios) if item.Axis.Axis else np.array((0.0, 0.0, 1.0))
            through = np.array(item.Axis.Location.Coordinates) * self._unit_scale
            return _moved(elbow(at[:3, 3], radius, through, axis, item.Angle * self._angle_scale), frame)
        except (AttributeError, TypeError, ValueError):
            return None


def pipe(middle: Points, radius: float, along: Points) -> Mesh | None:
    """Sweep a circle round a point of the xy plane along a vector; None if that lies in the plane."""
    if not np.isfinite(along).all() or abs(along[2]) <= 0.0:
        return None
    ring = middle + _circle(radius, _SAG)
    return _tube(np.stack([ring, ring + along]))


def elbow(middle: Points, radius: float, through: Points, axis: Points, angle: float) -> Mesh | None:
    """Turn a circle round a point of the xy plane about an axis in that plane; None if the axis meets it."""
    reach = float(np.linalg.norm(np.cross(middle - through, axis)))
    if abs(axis[2]) > _FULL or abs(through[2]) > _FULL or reach < radius or not 0.0 < angle < math.tau + _FULL:
        return None
    is_full = angle > math.tau - _FULL
    ring = middle - through + _circle(radius, _SAG / 2)
    turns = np.linspace(0.0, angle, _chords(reach + radius, angle, _SAG / 2) + 1)[:, None, None]
    beside, lengthwise = np.cross(axis, ring), (ring @ axis)[:, None] * axis
    rings = lengthwise + (ring - lengthwise) * np.cos(turns) + beside * np.sin(turns)
    return _tube(through + (rings[:-1] if is_full else rings), is_full=is_full)


def _chords(radius: float, angle: float, sag: float) -> int:
    """Return into how many chords an arc is divided, so that none lies farther inside than `sag`."""
    step = min(_STEP, 2.0 * math.acos(max(1.0 - sag / radius, -1.0)))
    return max(math.ceil(angle / step), 3 if angle > math.pi else 1)


def _circle(radius: float, sag: float) -> Points:
    turns = np.arange(count := _chords(radius, math.tau, sag)) * (math.tau / count)
    return radius * np.stack([np.cos(turns), np.sin(turns), np.zeros(count)], axis=1)


def _tube(rings: Points, *, is_full: bool = False) -> Mesh:
    """Join rings, (m, n, 3), one after the other; close the ends, or join the last ring to the first."""
    rows, count = rings.shape[:2]
    first, second = np.arange(rows if is_full else rows - 1)[:, None] * count, np.arange(count)
    after = (second + 1) % count
    beyond = (first + count) % (rows * count)
    sides = np.stack([first + second, first + after, beyond + after, first + second, beyond + after, beyond + second])
    faces = [np.moveaxis(sides, 0, -1).reshape(-1, 3)]
    if not is_full:
        fan = np.stack([np.zeros(count - 2, np.int64), second[1:-1], second[2:]], axis=1)
        faces += [fan[:, ::-1], fan + (rows - 1) * count]
    return Mesh(rings.reshape(-1, 3), np.concatenate(faces).astype(np.int32))


def _unit(ratios: tuple[float, ...]) -> Points:
    vector = np.array(ratios, dtype=np.float64)
    if vector.shape != (3,) or not (length := float(np.linalg.norm(vector))) > 0.0:
        raise ValueError("a direction without a length")
    return vector / length


def _moved(mesh: Mesh | None, frame: Points) -> Mesh | None:
    return mesh and Mesh(mesh.vertices @ frame[:3, :3].T + frame[:3, 3], mesh.faces)
