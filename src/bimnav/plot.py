"""Figures: the environment, the grid, and a tour in them. Every function draws on an axes and returns it."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from bimnav.errors import ValueRangeError
from bimnav.graph import NavGraph, NodeKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment
    from bimnav.plan import Tour

__all__ = ["figure_bytes", "plot_environment", "plot_graph", "plot_tour", "save_tour"]

Unit = Literal["m", "ft"]

# Okabe and Ito's palette, which colour-blind readers can tell apart, and greys
_LISTED = 40  # stops named beside a plan; a longer list makes the figure taller than any page
_COLORS = {
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
_WALLS = ("IfcWall", "IfcCurtainWall", "IfcWindow", "IfcColumn", "IfcPlate", "IfcMember", "IfcRailing", "IfcSlab")
_METRES_PER_FOOT = 0.3048
_DOTS_PER_INCH = 200


def _axes(ax: Axes | None, bounds: Sequence[float]) -> Axes:
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=_size(bounds))[1]


def _size(bounds: Sequence[float]) -> tuple[float, float]:
    """Return a figure size in inches that suits a box, with room for a key at its right."""
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    scale = min(8.0 / width, 9.0 / height)
    return max(3.2, width * scale) + 3.2, max(3.2, height * scale) + 0.8


def _patches(polygons: Iterable[BaseGeometry], **style: Any) -> PatchCollection:
    parts = [part for polygon in polygons for part in shapely.get_parts(polygon) if part.geom_type == "Polygon"]
    outlines = []
    for part in parts:
        rings = [np.asarray(ring.coords) for ring in (part.exterior, *part.interiors)]
        codes = [c for r in rings for c in (Outline.MOVETO, *[Outline.LINETO] * (len(r) - 2), Outline.CLOSEPOLY)]
        outlines.append(PathPatch(Outline(np.concatenate(rings), codes)))
    return PatchCollection(outlines, **style)


def _unit_of(environment: IndoorEnvironment | None, unit: Unit | None) -> Unit:
    if unit not in (None, "m", "ft"):
        raise ValueRangeError(f"unit is {unit!r}.", "Give 'm' or 'ft'.")
    feet = environment is not None and "foot" in environment.building.unit.lower()
    return unit or ("ft" if feet else "m")


def _finish(ax: Axes, bounds: Sequence[float], unit: Unit) -> None:
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


def _key(ax: Axes, handles: Sequence[Any], names: Sequence[str] = ()) -> None:
    """Put the key, and a numbered list of names, at the right of the axes."""
    blank = [Line2D([], [], linestyle="none", label=name) for name in names]
    ax.legend(
        handles=[*handles, *blank],
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        borderaxespad=0,
        frameon=False,
        fontsize=8,
        handlelength=1.4,
    )


def _around(bounds: Sequence[float], share: float = 0.03) -> tuple[float, float, float, float]:
    margin = share * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    return bounds[0] - margin, bounds[1] - margin, bounds[2] + margin, bounds[3] + margin


def _draw_elements(ax: Axes, environment: IndoorEnvironment, storey: int) -> list[Patch]:
    """Draw walls, other obstacles and doorways of a storey."""
    obstacles = environment.obstacles_on(storey)
    walls = [o.footprint for o in obstacles if o.ifc_class.startswith(_WALLS)]
    others = [o.footprint for o in obstacles if not o.ifc_class.startswith(_WALLS)]
    doors = [r.polygon for r in environment.regions if r.storey == storey and r.source == "door"]
    ax.add_collection(_patches(doors, facecolor=_COLORS["door"], edgecolor="none", alpha=0.45, zorder=2))
    ax.add_collection(
        _patches(others, facecolor=_COLORS["furniture"], edgecolor="#6b6459", linewidth=0.5, alpha=0.75, zorder=3)
    )
    ax.add_collection(_patches(walls, facecolor=_COLORS["wall"], edgecolor="none", zorder=3))
    for region in environment.regions:
        if region.storey == storey and region.source == "space":
            x, y = region.polygon.representative_point().coords[0]
            name = ax.text(x, y, region.name, color="#6f6a5d", fontsize=6.5, style="italic", ha="center", zorder=4)
            name.set_clip_on(True)
            name.set_path_effects([withStroke(linewidth=2, foreground="white")])
    key = [Patch(color=_COLORS["wall"], label="wall, window, column")]
    if others:
        key.append(Patch(facecolor=_COLORS["furniture"], edgecolor="#6b6459", label="other obstacle"))
    if doors:
        key.append(Patch(color=_COLORS["door"], alpha=0.45, label="doorway"))
    return key


def plot_environment(
    environment: IndoorEnvironment, *, storey: int = 0, ax: Axes | None = None, unit: Unit | None = None
) -> Axes:
    """Draw floor, doorways, obstacles and targets of a storey.

    Parameters
    ----------
    environment
        As made by `make_environment`.
    storey
        Index into `environment.storeys`.
    ax
        Where to draw; a new figure if None.
    unit
        Of the axes; None takes feet for models in feet, else metres.
    """
    regions = [r.polygon for r in environment.regions if r.storey == storey]
    shown = shapely.geometrycollections([*regions, *(o.footprint for o in environment.obstacles_on(storey))])
    bounds = _around(shown.bounds if not shown.is_empty else (0, 0, 1, 1))
    ax = _axes(ax, bounds)
    ax.add_collection(_patches(regions, facecolor=_COLORS["floor"], edgecolor="#d0cdc4", linewidth=0.5, zorder=0))
    key = _draw_elements(ax, environment, storey)
    targets = [target for target in environment.targets if target.storey == storey]
    for number, target in enumerate(targets, 1):
        _mark(ax, target.destination, str(number), _COLORS["target"])
    ax.set_title(environment.storeys[storey].name, fontsize=10)
    _finish(ax, bounds, _unit_of(environment, unit))
    _key(ax, key, [f"{number}  {target.name}" for number, target in enumerate(targets, 1)])
    return ax


def plot_graph(graph: NavGraph, *, storey: int | None = None, ax: Axes | None = None, unit: Unit | None = None) -> Axes:
    """Draw the cells of a storey by kind, with the elements behind them.

    Parameters
    ----------
    graph
        As made by `build_graph` or `NavGraph.from_mask`.
    storey
        Index of the storey; None for the ground.
    ax
        Where to draw; a new figure if None.
    unit
        Of the axes; None takes feet for models in feet, else metres.
    """
    storey = graph.frame.ground if storey is None else storey
    bounds = _shown(graph, storey)
    ax = _axes(ax, bounds)
    key = _draw_cells(ax, graph, storey)
    if graph.environment is not None:
        key += _draw_elements(ax, graph.environment, storey)
        ax.set_title(graph.environment.storeys[storey].name, fontsize=10)
    _finish(ax, bounds, _unit_of(graph.environment, unit))
    _key(ax, key)
    return ax


def plot_tour(tour: Tour, *, storey: int | None = None, ax: Axes | None = None, unit: Unit | None = None) -> Axes:
    """Draw a tour in its grid: cells by kind, elements, the way with its direction, start and stops.

    Parameters
    ----------
    tour
        As made by `plan_tour`.
    storey
        Index of the storey; None for the one the tour starts on.
    ax
        Where to draw; a new figure if None.
    unit
        Of the axes; None takes feet for models in feet, else metres.
    """
    graph = tour.graph
    storey = tour.start.storey if storey is None else storey
    ax = plot_graph(graph, storey=storey, ax=ax, unit=unit)
    level = graph.frame.elevations[storey]
    legs, climbs = [], []
    for leg in tour.route:
        flat, rising = _parts_at(leg, level)
        legs += flat
        climbs += rising
    ax.add_collection(LineCollection(legs, colors=_COLORS["path"], linewidths=1.8, zorder=6, capstyle="round"))
    ax.add_collection(LineCollection(climbs, colors=_COLORS["path"], linewidths=1.8, zorder=6, linestyles=":"))
    for leg in legs:
        _arrow(ax, leg)
    key: list[Any] = [Line2D([], [], color=_COLORS["path"], linewidth=1.8, label=f"route, {tour.length:.1f} m")]
    if climbs:
        key.append(Line2D([], [], color=_COLORS["path"], linewidth=1.8, linestyle=":", label="to another storey"))
    if tour.start.storey == storey:
        ax.plot(*tour.start_point[:2], "s", color=_COLORS["start"], markersize=9, markeredgecolor="white", zorder=8)
        key.append(Line2D([], [], color=_COLORS["start"], marker="s", linestyle="none", label="start"))
    names = []
    for number, stop in enumerate(tour.stops, 1):
        aside = f" (from {stop.distance:.2f} m)" if stop.approach == "standing" else ""
        if stop.cell.storey == storey:
            names.append(f"{number}  {stop.name}{aside}")
            if stop.approach == "standing":
                ax.plot(*zip(stop.end[:2], stop.destination[:2], strict=True), ":", color=_COLORS["target"], zorder=7)
            _mark(ax, stop.destination, str(number), _COLORS["target"])
    for target in tour.unreached:
        if abs(target.destination[2] - level) < 1e-6:
            names.append(f"×  {target.name}: not reached")
            _mark(ax, target.destination, "×", _COLORS["lost"])
    if len(names) > _LISTED:
        names = [*names[:_LISTED], f"... and {len(names) - _LISTED} more"]
    legend = ax.get_legend()
    _key(ax, [*(legend.legend_handles if legend else ()), *key], ["", *names])
    return ax


def _parts_at(leg: NDArray[np.float64], level: float) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
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


def _shown(graph: NavGraph, storey: int) -> tuple[float, float, float, float]:
    """Return the box of the cells that are not outside, with a margin, metres."""
    rows, cols = np.nonzero(graph.kinds[storey] != NodeKind.OUTSIDE)
    if not len(rows):
        return graph.frame.bounds
    d, (x, y) = graph.frame.cell_size, graph.frame.origin
    return _around((x + cols.min() * d, y + rows.min() * d, x + (cols.max() + 1) * d, y + (rows.max() + 1) * d))


def _draw_cells(ax: Axes, graph: NavGraph, storey: int) -> list[Patch]:
    colors = [_COLORS[name] for name in ("floor", "obstacle cell", "target cell", "outside", "conflict cell")]
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


def _mark(ax: Axes, point: Sequence[float], text: str, color: str) -> None:
    x, y = point[:2]
    ax.plot(x, y, "o", color=color, markersize=11, markeredgecolor="white", zorder=8)
    ax.text(x, y, text, color="white", ha="center", va="center", fontsize=7, fontweight="bold", zorder=9)


def _arrow(ax: Axes, leg: NDArray[np.float64]) -> None:
    """Put an arrow head on the longest piece of a leg."""
    steps = np.diff(leg, axis=0)
    lengths = np.hypot(*steps.T)
    if not len(lengths) or lengths.max() == 0:
        return
    k = int(lengths.argmax())
    middle, ahead = leg[k] + 0.5 * steps[k], leg[k] + 0.5 * steps[k] + steps[k] / lengths[k] * 1e-3
    arrow = {"arrowstyle": "-|>", "color": _COLORS["path"], "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", xy=tuple(ahead), xytext=tuple(middle), arrowprops=arrow, zorder=7)


def figure_bytes(draw: Callable[[Axes], object], *, size: tuple[float, float] = (7.0, 5.0)) -> bytes:
    """Draw on a new figure without a screen and return it as PNG; equal inputs give equal bytes.

    Parameters
    ----------
    draw
        Called with an axes.
    size
        Width and height in inches.
    """
    with mpl.rc_context({"svg.hashsalt": "bimnav"}):
        figure = Figure(figsize=size, dpi=_DOTS_PER_INCH)
        FigureCanvasAgg(figure)
        draw(figure.add_subplot())
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", bbox_inches="tight", pad_inches=0.15, metadata={"Software": None})
    return buffer.getvalue()


def save_tour(tour: Tour, *, storey: int | None = None, unit: Unit | None = None) -> bytes:
    """Return the plan figure of a tour on one storey as PNG."""
    storey = tour.start.storey if storey is None else storey
    size = _size(_shown(tour.graph, storey))
    return figure_bytes(lambda ax: plot_tour(tour, storey=storey, ax=ax, unit=unit), size=size)
