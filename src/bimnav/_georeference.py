"""Where on the map a model lies."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bimnav.errors import GeometryError, ModelError, ValueRangeError

__all__ = ["FITTING_SCALES", "Georeference", "turn_of"]

FITTING_SCALES = (0.9, 1.1)
"""Metres on the map per metre on the ground: no projection in use is farther from true to scale."""

_FARTHEST = 1e8  # metres; zone numbers written before the eastings reach 6e7
_HIGHEST = 2e4  # metres above or below the sea
_UPRIGHT = 1e-9  # share of a length by which a placement may lean


@dataclass(frozen=True, slots=True)
class Georeference:
    """Where on Earth a model lies, as its file says: on a map, in degrees, or only which way is north.

    Parameters
    ----------
    eastings, northings, height
        Map coordinates and orthogonal height of `origin`, metres whatever the unit of the map; eastings
        and northings are None if the file does not say where on a map it lies.
    x_axis_abscissa, x_axis_ordinate
        East and north part of the model's x axis on the map.
    scale
        Metres on the map per metre in the model.
    factors
        What `scale` is multiplied by along the model's x, y and z.
    origin
        The model point, metres, that the map coordinates are those of.
    map_unit
        Metres in the unit of the map: what to divide by for coordinates as the map counts them.
    crs_name, epsg
        The coordinate reference system of the map, as the file writes it, and its EPSG code or None.
    true_north
        Radians from the model's y axis to true north, counter-clockwise; None if not stated.
    latitude, longitude
        Of the site, degrees; None if not stated.
    elevation
        Of the site above the sea, metres; None if not stated.
    source
        What in the file says so, such as `IfcMapConversion` or `IfcSite`.

    Raises
    ------
    ValueRangeError
        If a number is not finite, or no place on Earth has it.

    Examples
    --------
    >>> here = Georeference(eastings=500_000.0, northings=5_800_000.0, height=30.0)
    >>> here.to_map([[1.0, 2.0, 3.0]]).tolist()
    [[500001.0, 5800002.0, 33.0]]
    """

    eastings: float | None = None
    northings: float | None = None
    height: float = 0.0
    x_axis_abscissa: float = 1.0
    x_axis_ordinate: float = 0.0
    scale: float = 1.0
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    map_unit: float = 1.0
    crs_name: str = ""
    epsg: int | None = None
    true_north: float | None = None
    latitude: float | None = None
    longitude: float | None = None
    elevation: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("factors", "origin"):
            x, y, z = getattr(self, name)
            object.__setattr__(self, name, (float(x), float(y), float(z)))
        for field in fields(self):
            value = getattr(self, field.name)
            for number in value if isinstance(value, tuple) else (value,):
                if isinstance(number, float) and not math.isfinite(number):
                    _refuse(field.name, value)
        for name, limit in _LIMITS.items():
            value = getattr(self, name)
            if value is not None and abs(value) > limit:
                _refuse(name, value)
        for pair in (("eastings", "northings"), ("latitude", "longitude")):
            if (getattr(self, pair[0]) is None) != (getattr(self, pair[1]) is None):
                _refuse(" and ".join(pair), tuple(getattr(self, name) for name in pair))
        if self.x_axis_abscissa == self.x_axis_ordinate == 0:
            _refuse("x_axis_abscissa and x_axis_ordinate", (0.0, 0.0))
        for scale in (self.scale, *self.factors):
            if not FITTING_SCALES[0] <= scale <= FITTING_SCALES[1]:
                _refuse("scale", scale)
        if not self.map_unit > 0:
            _refuse("map_unit", self.map_unit)

    @property
    def rotation(self) -> float:
        """Radians from the map's east to the model's x axis, counter-clockwise."""
        return math.atan2(self.x_axis_ordinate, self.x_axis_abscissa)

    @property
    def is_mapped(self) -> bool:
        """Whether the file says where on a map the model lies."""
        return self.eastings is not None

    def to_map(self, points: ArrayLike) -> NDArray[np.float64]:
        """Convert model points to map coordinates.

        Parameters
        ----------
        points : (n, 2) or (n, 3), metres
            In the plane, z is 0.

        Returns
        -------
        mapped : (n, 3) float64, metres
            Eastings, northings and orthogonal heights.

        Raises
        ------
        ModelError
            If the file does not say where on a map the model lies.
        """
        shift = self._map_origin()
        local = (_points(points) - self.origin) * self._scales()
        return _turned(local, self.rotation) + shift

    def to_model(self, points: ArrayLike) -> NDArray[np.float64]:
        """Convert map coordinates to model points, both in metres; the way back of `to_map`.

        Of (n, 2) eastings and northings, the height is 0.
        """
        local = _turned(_points(points) - self._map_origin(), -self.rotation)
        mapped: NDArray[np.float64] = local / self._scales() + self.origin
        return mapped

    def moved(self, placement: NDArray[np.float64]) -> Self:
        """Return what holds after the model was moved.

        Parameters
        ----------
        placement : (4, 4) float64
            From old to new model coordinates, metres: a shift, and a turn about the z axis.

        Raises
        ------
        ValueRangeError
            If it leans, or turns a model whose x and y have different factors.
        """
        turn = turn_of(placement)
        if turn and self.factors[0] != self.factors[1]:
            _refuse("factors", self.factors)
        east, north = self.x_axis_abscissa, self.x_axis_ordinate
        cos, sin = (math.cos(turn), math.sin(turn)) if turn else (1.0, 0.0)
        origin = placement[:3, :3] @ self.origin + placement[:3, 3]
        return replace(
            self,
            origin=tuple(origin.tolist()),
            x_axis_abscissa=cos * east + sin * north,
            x_axis_ordinate=cos * north - sin * east,
            true_north=None if self.true_north is None else math.remainder(self.true_north + turn, math.tau),
        )

    def _map_origin(self) -> tuple[float, float, float]:
        if self.eastings is None or self.northings is None:
            raise ModelError("the model does not say where on a map it lies.", "Export it with a map conversion.")
        return self.eastings, self.northings, self.height

    def _scales(self) -> NDArray[np.float64]:
        return self.scale * np.array(self.factors)


_LIMITS = {
    "eastings": _FARTHEST,
    "northings": _FARTHEST,
    "height": _HIGHEST,
    "elevation": _HIGHEST,
    "latitude": 90.0,
    "longitude": 180.0,
    "true_north": math.tau,
}


def turn_of(placement: NDArray[np.float64]) -> float:
    """Return by how many radians a placement turns about the z axis, counter-clockwise.

    Raises
    ------
    ValueRangeError
        If it also leans.
    """
    if not abs(placement[2, 2] - 1) <= _UPRIGHT:
        _refuse("z axis of the placement", tuple(placement[:3, 2].tolist()))
    return math.atan2(placement[1, 0], placement[0, 0])


def _points(points: ArrayLike) -> NDArray[np.float64]:
    given = np.asarray(points, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] not in (2, 3):
        raise GeometryError(f"points have shape {given.shape}.", "Give an array of shape (n, 2) or (n, 3).")
    return np.pad(given, ((0, 0), (0, 3 - given.shape[1])))


def _turned(points: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    cos, sin = math.cos(angle), math.sin(angle)
    x, y, z = points.T
    return np.column_stack([cos * x - sin * y, sin * x + cos * y, z])


def _refuse(name: str, value: object) -> NoReturn:
    raise ValueRangeError(f"{name.replace('_', ' ')} is {value}.", "No place on Earth has it.", {name: value})
