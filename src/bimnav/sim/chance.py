"""Chance with units: how long, or how fast, drawn from a distribution."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from bimnav import _checks
from bimnav.errors import ValueRangeError

__all__ = ["Chance", "Unit", "seeded"]

Unit: TypeAlias = Literal["s", "min", "h", "m/s", "km/h"]
Shape: TypeAlias = Literal["uniform", "normal", "lognormal", "triangular", "exponential"]

_SI: dict[str, tuple[str, float]] = {
    "s": ("s", 1.0),
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
    "m/s": ("m/s", 1.0),
    "km/h": ("m/s", 1 / 3.6),
}
_COUNT = {"uniform": 2, "normal": 2, "lognormal": 2, "triangular": 3, "exponential": 1}


@dataclass(frozen=True, slots=True)
class Chance:
    """A quantity that is drawn anew each time.

    Parameters
    ----------
    shape
        `uniform` between two values, `normal` or `lognormal` of a mean and a standard deviation,
        `triangular` of lowest, likeliest and highest value, `exponential` of a mean.
    values
        As the shape asks, in `unit`.
    unit
        `s`, `min`, `h`, `m/s` or `km/h`.
    least
        What is below is drawn as this, in `unit`; a normal distribution has no end of its own.

    Raises
    ------
    ValueRangeError
        If shape or unit is unknown, or the values do not fit.

    Examples
    --------
    >>> half_a_minute = Chance("lognormal", (0.5, 0.1), "min")
    >>> round(half_a_minute.draw(np.random.default_rng(0)), 1)
    30.2
    """

    shape: Shape
    values: tuple[float, ...]
    unit: Unit
    least: float = 0.0

    def __post_init__(self) -> None:
        for name in ("shape", "unit"):
            _checks.need(name, getattr(self, name), str)
        values = tuple(_checks.number("a value", value) for value in _checks.many("values", self.values))
        object.__setattr__(self, "values", values)
        if self.unit not in _SI or self.shape not in _COUNT:
            raise ValueRangeError(
                f"{self.shape!r} in {self.unit!r} is no distribution.",
                f"Known are {', '.join(_COUNT)}; units are {', '.join(_SI)}.",
            )
        fits = len(values) == _COUNT[self.shape] and all(math.isfinite(value) for value in (*values, self.least))
        if fits and self.shape in ("uniform", "triangular"):
            fits = list(values) == sorted(values) and values[0] < values[-1]
        elif fits:
            fits = values[0] > 0 and all(value >= 0 for value in values)
        if not fits:
            raise ValueRangeError(
                f"a {self.shape} distribution cannot have the values {values}.",
                "Give lowest (, likeliest) and highest, or mean and standard deviation above 0.",
                {"shape": self.shape, "values": values},
            )

    @property
    def dimension(self) -> str:
        """The SI unit: `s` or `m/s`."""
        return _SI[self.unit][0]

    def draw(self, rng: np.random.Generator) -> float:
        """Return one value, in seconds or metres per second."""
        a, *more = self.values
        if self.shape == "uniform":
            value = rng.uniform(a, more[0])
        elif self.shape == "normal":
            value = rng.normal(a, more[0])
        elif self.shape == "lognormal":
            spread = math.log1p((more[0] / a) ** 2)
            value = rng.lognormal(math.log(a) - spread / 2, math.sqrt(spread))
        elif self.shape == "triangular":
            value = rng.triangular(a, more[0], more[1])
        else:
            value = rng.exponential(a)
        return max(float(value), self.least) * _SI[self.unit][1]

    def __call__(self, *arguments: Any) -> float:
        """Draw with the last argument, a generator; so a chance is a service time or a speed."""
        return self.draw(arguments[-1])


def seeded(seed: int) -> np.random.Generator:
    """Return a generator of random numbers for a seed, a whole number of at least 0."""
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if number < 0:
        raise ValueRangeError(f"seed is {seed!r}.", "Give a whole number of at least 0.", {"seed": seed})
    return np.random.default_rng(number)
