"""Names of rooms: where in a room its name has a place, so that it covers no mark and no other name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import shapely
from matplotlib.font_manager import FontProperties
from matplotlib.patheffects import withStroke
from matplotlib.textpath import TextToPath

from bimnav.plot._drawing import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment

__all__ = ["draw_names", "draw_rooms"]

_SIZES = (6.5, 5.5, 4.5)  # points; a name that has no place at the smallest is left out
_LINE = 1.25  # height of a line, in sizes
_RIM = 2.0  # points between a name and what it keeps clear of
_MARK = 7.0  # points from the middle of a mark to its rim
_PLACES = np.linspace(0, 1, 11)  # tried along each side of a room
_POINTS_PER_INCH = 72


def draw_names(
    ax: Axes,
    rooms: Sequence[tuple[str, BaseGeometry]],
    bounds: Sequence[float],
    *,
    marks: Sequence[Sequence[float]] = (),
    others: Sequence[BaseGeometry] = (),
) -> None:
    """Write the names of rooms into them: whole, on two lines, smaller, or only the number, as there is room.

    Parameters
    ----------
    rooms
        Name and plan view of each.
    bounds
        What the axes show, metres.
    marks
        Points (x, y) at which marks stand; no name covers one.
    others
        What names cover only where there is no other place, such as routes and furniture.
    """
    metres = 1 / _points_per_metre(ax, bounds)
    reach = (_MARK + _RIM) * metres
    taken = [shapely.box(x - reach, y - reach, x + reach, y + reach) for x, y in (mark[:2] for mark in marks)]
    covered = shapely.STRtree(list(others))
    for name, polygon in rooms:
        near = [taken[k] for k in np.flatnonzero(shapely.intersects(taken, shapely.box(*polygon.bounds)))]
        for text, size in _ways(plain(name)):
            width, height = _extent(text, size)
            half = np.array([width, height]) / 2 * metres + _RIM * metres
            middle = _place(polygon, half, near, covered)
            if middle is not None:
                written = ax.text(
                    float(middle[0]), float(middle[1]), text, color="#6f6a5d", fontsize=size, style="italic", zorder=5
                )
                written.set(ha="center", va="center", clip_on=True, linespacing=1.0)
                written.set_path_effects([withStroke(linewidth=2, foreground="white")])
                taken.append(shapely.box(*(middle - half), *(middle + half)))
                break


def draw_rooms(
    ax: Axes,
    environment: IndoorEnvironment,
    storey: int,
    bounds: Sequence[float],
    *,
    marks: Sequence[Sequence[float]] = (),
    lines: Sequence[NDArray[np.float64]] = (),
) -> None:
    """Write the names of the rooms of a storey, clear of marks, and of routes and obstacles where they can be."""
    rooms = [(r.name, r.polygon) for r in environment.regions if r.storey == storey and r.source == "space"]
    routes = [shapely.linestrings(line) for line in lines if len(line) > 1]
    obstacles = [obstacle.footprint for obstacle in environment.obstacles_on(storey)]
    draw_names(ax, rooms, bounds, marks=marks, others=[*routes, *obstacles])


def _points_per_metre(ax: Axes, bounds: Sequence[float]) -> float:
    figure = ax.get_figure(root=True)
    assert figure is not None  # noqa: S101 - axes belong to one
    sides = figure.get_size_inches() * ax.get_position(original=True).size
    return float(min(sides / (bounds[2] - bounds[0], bounds[3] - bounds[1]))) * _POINTS_PER_INCH


def _ways(name: str) -> Iterator[tuple[str, float]]:
    """Yield the ways to write a name, best first."""
    words = name.split()
    middles = [abs(len(" ".join(words[:k])) - len(name) / 2) for k in range(1, len(words))]
    k = int(np.argmin(middles)) + 1 if middles else 0
    for size in _SIZES:
        yield name, size
        if k:
            yield " ".join(words[:k]) + "\n" + " ".join(words[k:]), size
    if k and any(letter.isdigit() for letter in words[0]):
        yield words[0], _SIZES[1]


@cache
def _extent(text: str, size: float) -> tuple[float, float]:
    """Return width and height of a text in points."""
    font = FontProperties(size=size, style="italic")
    lines = text.replace(r"\$", "$").split("\n")
    width = max(TextToPath().get_text_width_height_descent(line, font, False)[0] for line in lines)
    return float(width), len(lines) * size * _LINE


def _place(
    polygon: BaseGeometry, half: NDArray[np.float64], taken: Sequence[BaseGeometry], covered: shapely.STRtree
) -> NDArray[np.float64] | None:
    """Return where a box has its middle in a room: over as little as can be, then nearest the room's middle."""
    x0, y0, x1, y1 = polygon.bounds
    low, high = np.array([x0, y0]) + half, np.array([x1, y1]) - half
    if (low > high).any():
        return None
    best = np.clip(shapely.get_coordinates(polygon.representative_point())[0], low, high)
    across, up = np.meshgrid(*(low[:, None] + (high - low)[:, None] * _PLACES))
    middles = np.vstack([best, np.column_stack([across.ravel(), up.ravel()])])
    boxes = shapely.box(*(middles - half).T, *(middles + half).T)
    is_free = shapely.covers(polygon, boxes)
    for other in taken:
        is_free &= ~shapely.intersects(other, boxes)
    if not is_free.any():
        return None
    over = np.bincount(covered.query(boxes, predicate="intersects")[0], minlength=len(boxes))
    away = np.round(np.hypot(*(middles - best).T), 6)
    order = np.lexsort((away, over, ~is_free))
    found: NDArray[np.float64] = middles[order[0]]
    return found
