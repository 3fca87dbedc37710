"""Openings cut out of their hosts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bimnav.building import Mesh
from bimnav.footprint import subtract, whole
from bimnav.ifc._tessellate import Reading

__all__ = ["Cutter", "Placed", "cut_all"]

_DIGITS = 7  # of a metre: hosts whose openings differ by less share a mesh
_TOUCH = 1e-6  # metres

Placed = tuple[int, NDArray[np.float64]]


class Cutter:
    """Cuts openings out of shapes; equal hosts with equal openings are cut once.

    Parameters
    ----------
    meshes
        All meshes; they are made whole when first needed, and new ones are added at the end.
    """

    def __init__(self, meshes: list[Mesh]) -> None:
        self.meshes = meshes
        self._whole: set[int] = set()
        self._cut: dict[tuple[int, frozenset[tuple[int, bytes]]], int | None] = {}

    def whole(self, index: int) -> Mesh:
        """Return a mesh, closed and turned outward where that can be."""
        if index not in self._whole:
            self.meshes[index] = whole(self.meshes[index])
            self._whole.add(index)
        return self.meshes[index]

    def cut(self, shape: Placed, openings: Sequence[Placed]) -> Placed | None:
        """Return a shape without the openings; None if one of the solids is open."""
        index, placement = shape
        to_host = np.linalg.inv(placement)
        relative = [(opening, np.round(to_host @ where, _DIGITS) + 0.0) for opening, where in openings]
        reaching = [cutter for cutter in relative if self._reaches(index, *cutter)]
        if not reaching:
            return shape
        key = (index, frozenset((opening, where.tobytes()) for opening, where in reaching))
        if key not in self._cut:
            cutters = [(self.whole(opening), where) for opening, where in reaching]
            self._cut[key] = self._keep(subtract(self.whole(index), cutters))
        done = self._cut[key]
        return None if done is None else (done, placement)

    def _reaches(self, host: int, opening: int, where: NDArray[np.float64]) -> bool:
        solid, void = self.meshes[host].vertices, self.meshes[opening].vertices
        void = void @ where[:3, :3].T + where[:3, 3]
        return bool(
            (void.min(axis=0) <= solid.max(axis=0) + _TOUCH).all()
            and (solid.min(axis=0) <= void.max(axis=0) + _TOUCH).all()
        )

    def _keep(self, mesh: Mesh | None) -> int | None:
        if mesh is None:
            return None
        self.meshes.append(mesh)
        self._whole.add(len(self.meshes) - 1)
        return len(self.meshes) - 1


def cut_all(
    readings: Mapping[int, Reading],
    openings: Mapping[int, Sequence[int]],
    cutter: Cutter,
    working_on: Callable[[int], None],
) -> list[int]:
    """Cut the openings of all hosts, in place.

    Parameters
    ----------
    readings
        What was read of each product, openings among them.
    openings
        Step id of a host to the step ids of what cuts it.

    Returns
    -------
    failed
        Step ids of the hosts that could not be cut; they are left as they were.
    """
    failed = []
    for host in sorted(openings):
        reading = readings.get(host)
        if reading is None or not reading.shapes:
            continue
        working_on(host)
        voids = [shape for opening in openings[host] if opening in readings for shape in readings[opening].shapes]
        cut = [cutter.cut(shape, voids) for shape in reading.shapes]
        if any(shape is None for shape in cut):
            failed.append(host)
        else:
            reading.shapes = [shape for shape in cut if shape and len(cutter.meshes[shape[0]].faces)]
    return failed
