"""What figures share: colors, axes, and how elements, cells and marks are drawn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import shapely
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from bimnav import _checks
from bimnav._cards import ROBOTS
from bimnav._wording import printable
from bimnav.errors import ValueRangeError
from bimnav.graph import NavGraph, NodeKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment

__all__ = [
    "COLORS",
    "DOTS_PER_INCH",
    "ROBOTS",
    "STATUSES",
    "WALLS",
    "Unit",
    "add_key",
    "axes_for",
    "box_around",
    "draw_arrow",
    "draw_cells",
    "draw_elements",
    "draw_mark",
    "figure_size",
    "finish",
    "parts_at",
    "patches_of",
    "plain",
    "shown_box",
    "storey_of",
    "unit_for",
]

Unit = Literal["m", "ft"]

STATUSES = {
    "moving": "#0072b2",
    "working": "#009e73",
    "charging": "#f0e442",
    "waiting": "#e69f00",
    "blocked": "#d55e00",
    "failed": "#000000",
    "idle": "#dddddd",
}
# Okabe and Ito's palette, which colour-blind readers can tell apart, and greys
COLORS = {
    "wall": "#4a4a4a",
    "furniture": "#a89f91",
    "door": "#56b4e9",
    "floor": "#fbfaf7",
    "outside": "#ffffff",
    "obstacle cell": "#d9d4cc",
    "target cell": "#fbd9a5",
    "conflict cell": "#e69f00",
    "target": "#d55e00",
    "path": "#0072b2",
    "start": "#009e73",
    "lost": "#cc79a7",
}
WALLS = ("IfcWall", "IfcCurtainWall", "IfcWindow", "IfcColumn", "IfcPlate", "IfcMember", "IfcRailing", "IfcSlab")
_METRES_PER_FOOT = 0.3048
_LONGEST, _TAIL = 72, 32  # letters of a name beside a plan, and how many of them from its end
DOTS_PER_INCH = 200


def plain(name: str) -> str:
    """Return a name as text that figures show as it is: dollars begin no formula, control characters are escapes."""
    return printable(name).replace("$", r"\$")


def axes_for(ax: Axes | None, bounds: Sequence[float]) -> Axes:
    _checks.need("ax", ax, "Axes", or_none=True)
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=figure_size(bounds))[1]


def storey_of(storey: int | None, default: int, elevations: Sequence[float]) -> int:
    """Return the storey to draw."""
    return default if storey is None else _checks.whole("storey", storey, 0, len(elevations) - 1)


def figure_size(bounds: Sequence[float]) -> tuple[float, float]:
    """Return a figure size in inches that suits a box, with room for a key at its right."""
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    scale = min(8.0 / width, 9.0 / height)
    return max(3.2, width * scale) + 3.2, max(3.2, height * scale) + 0.8


def patches_of(polygons: Iterable[BaseGeometry], **style: Any) -> PatchCollection:
    parts = [part for polygon in polygons for part in shapely.get_parts(polygon) if part.geom_type == "Polygon"]
    outlines = []
    for part in parts:
        rings = [np.asarray(ring.coords) for ring in (part.exterior, *part.interiors)]
        codes = [c for r in rings for c in (Outline.MOVETO, *[Outline.LINETO] * (len(r) - 2), Outline.CLOSEPOLY)]
        outlines.append(PathPatch(Outline(np.concatenate(rings), codes)))
    return PatchCollection(outlines, **style)


def unit_for(source: IndoorEnvironment | str | None, unit: Unit | None) -> Unit:
    """Return the unit of the axes: the one asked for, else feet for models in feet."""
    if unit not in (None, "m", "ft"):
        raise ValueRangeError(f"unit is {unit!r}.", "Give 'm' or 'ft'.")
    named = "" if source is None else source if isinstance(source, str) else source.building.unit
    feet = "foot" in named.lower()
    return unit or ("ft" if feet else "m")


def finish(ax: Axes, bounds: Sequence[float], unit: Unit) -> None:
    """Set limits, equal axes, ticks in the unit, and a scale bar."""
    metres = _METRES_PER_FOOT if unit == "ft" else 1.0
    ax.set_xlim(bounds[0], bounds[2])
    ax.set_ylim(bounds[1], bounds[3])
    ax.set_aspect("equal")
    for axis, low, high in ((ax.xaxis, bounds[0], bounds[2]), (ax.yaxis, bounds[1], bounds[3])):
        steps = MaxNLocator(10, steps=[1, 2, 5, 10], integer=True).tick_values(low / metres, high / metres)
        axis.set_major_locator(MultipleLocator(float(steps[1] - steps[0]) * metres))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(value / metres, 3):g}"))
    ax.set_xlabel(f"x ({unit})")
    ax.set_ylabel(f"y ({unit})")
    ax.tick_params(length=3, labelsize=8)
    span = (bounds[2] - bounds[0]) / metres / 4
    length = max(s for s in (10.0**e * m for e in range(-2, 4) for m in (1, 2, 5)) if s <= max(span, 0.01))
    x, y = bounds[0], bounds[3] + 0.02 * (bounds[3] - bounds[1])
    ax.plot([x, x + length * metres], [y, y], color="black", linewidth=2.5, solid_capstyle="butt", clip_on=False)
    ax.text(x + length * metres, y, f" {length:g} {unit}", ha="left", va="center", fontsize=7)


def add_key(ax: Axes, handles: Sequence[Any], names: Sequence[str] = ()) -> None:
    """Put the key, and a numbered list of names, at the right of the axes."""
    blank = [Line2D([], [], linestyle="none", label=plain(_shortened(name))) for name in names]
    ax.legend(
        handles=[*handles, *blank],
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        borderaxespad=0,
        frameon=False,
        fontsize=8,
        handlelength=1.4,
    )


def _shortened(name: str) -> str:
    """Return a name short enough to stand beside a plan; what tells it from others is often at its end."""
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - _TAIL - 3].rstrip()} … {name[-_TAIL:].lstrip()}"


def box_around(bounds: Sequence[float], share: float = 0.03) -> tuple[float, float, float, float]:
    margin = share * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    return bounds[0] - margin, bounds[1] - margin, bounds[2] + margin, bounds[3] + margin


def draw_elements(ax: Axes, environment: IndoorEnvironment, storey: int) -> list[Patch]:
    """Draw walls, other obstacles and doorways of a storey."""
    obstacles = environment.obstacles_on(storey)
    walls = [o.footprint for o in obstacles if o.ifc_class.startswith(WALLS)]
    others = [o.footprint for o in obstacles if not o.ifc_class.startswith(WALLS)]
    doors = [r.polygon for r in environment.regions if r.storey == storey and r.source == "door"]
    ax.add_collection(patches_of(doors, facecolor=COLORS["door"], edgecolor="none", alpha=0.45, zorder=2))
    ax.add_collection(
        patches_of(others, facecolor=COLORS["furniture"], edgecolor="#6b6459", linewidth=0.5, alpha=0.75, zorder=3)
    )
    ax.add_collection(patches_of(walls, facecolor=COLORS["wall"], edgecolor="none", zorder=3))
    key = [Patch(color=COLORS["wall"], label="wall, window, column")]
    if others:
        key.append(Patch(facecolor=COLORS["furniture"], edgecolor="#6b6459", label="other obstacle"))
    if doors:
        key.append(Patch(color=COLORS["door"], alpha=0.45, label="doorway"))
    return key


def shown_box(graph: NavGraph, storey: int) -> tuple[float, float, float, float]:
    """Return the box of the cells that are not outside, with a margin, metres."""
    rows, cols = np.nonzero(graph.kinds[storey] != NodeKind.OUTSIDE)
    if not len(rows):
        return graph.frame.bounds
    d, (x, y) = graph.frame.cell_size, graph.frame.origin
    return box_around((x + cols.min() * d, y + rows.min() * d, x + (cols.max() + 1) * d, y + (rows.max() + 1) * d))


def draw_cells(ax: Axes, graph: NavGraph, storey: int) -> list[Patch]:
    colors = [COLORS[name] for name in ("floor", "obstacle cell", "target cell", "outside", "conflict cell")]
    kinds = graph.kinds[storey].astype(np.int8)
    for conflict in graph.conflicts:
        if conflict.cell.storey == storey:
            kinds[conflict.cell[1:]] = 4
    x0, y0, x1, y1 = graph.frame.bounds
    ax.imshow(
        kinds,
        origin="lower",
        extent=(x0, x1, y0, y1),
        cmap=ListedColormap(colors),
        vmin=-0.5,
        vmax=4.5,
        interpolation="nearest",
        zorder=0,
    )
    if kinds.size <= 40_000:
        d = graph.frame.cell_size
        inside = kinds != NodeKind.OUTSIDE
        lines = [[(x0 + c * d, y0 + r * d), (x0 + (c + 1) * d, y0 + r * d)] for r, c in _sides(inside)]
        lines += [[(x0 + r * d, y0 + c * d), (x0 + r * d, y0 + (c + 1) * d)] for r, c in _sides(inside.T)]
        ax.add_collection(LineCollection(lines, colors="#c9c5bb", linewidths=0.3, zorder=1))
    names = ["regular cell", "obstacle cell", "target cell", "outside", "target on obstacle cell"]
    present = set(np.unique(kinds).tolist()) - {int(NodeKind.OUTSIDE)}
    return [Patch(facecolor=colors[k], edgecolor="#c9c5bb", label=names[k]) for k in sorted(present)]


def _sides(inside: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (row, column) of every horizontal side that borders a shown cell."""
    padded = np.pad(inside, ((1, 1), (0, 0)))
    return list(zip(*np.nonzero(padded[1:] | padded[:-1]), strict=True))


def draw_mark(ax: Axes, point: Sequence[float], text: str, color: str) -> None:
    x, y = point[:2]
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    is_outside = not (x0 <= x <= x1 and y0 <= y <= y1)  # the rim of the plan cuts no mark that lies within
    ax.plot(x, y, "o", color=color, markersize=11, markeredgecolor="white", zorder=8, clip_on=is_outside)
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7, "fontweight": "bold", "zorder": 9}
    ax.text(x, y, text, color="white", clip_on=is_outside, **style)


def draw_arrow(ax: Axes, leg: NDArray[np.float64], color: str = COLORS["path"]) -> None:
    """Put an arrow head on the longest piece of a leg."""
    steps = np.diff(leg, axis=0)
    lengths = np.hypot(*steps.T)
    if not len(lengths) or lengths.max() == 0:
        return
    k = int(lengths.argmax())
    middle, ahead = leg[k] + 0.5 * steps[k], leg[k] + 0.5 * steps[k] + steps[k] / lengths[k] * 1e-3
    arrow = {"arrowstyle": "-|>", "color": color, "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", xy=tuple(ahead), xytext=tuple(middle), arrowprops=arrow, zorder=7)


def parts_at(leg: NDArray[np.float64], level: float) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return the parts of a leg that lie at a level, and those that leave it or come to it, (n, 2) metres."""
    on = np.abs(leg[:, 2] - level) < 1e-6
    kinds = np.where(on[:-1] & on[1:], 0, np.where(np.abs(np.diff(leg[:, 2])) > 1e-6, 1, 2))
    flat, climbs = [], []
    for part in np.split(np.arange(len(kinds)), np.flatnonzero(np.diff(kinds)) + 1):
        points = leg[part[0] : part[-1] + 2] if len(part) else leg[:0]
        if len(part) and kinds[part[0]] == 0:
            flat.append(points[:, :2])
        elif len(part) and kinds[part[0]] == 1 and (on[part[0]] or on[part[-1] + 1]):
            climbs.append(points[:, :2])
    return flat, climbs
