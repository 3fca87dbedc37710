"""Plans: a building, an environment, a grid, a tour, a fleet, seen from above."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bimnav import _checks
from bimnav._wording import counted
from bimnav.errors import InputError
from bimnav.footprint import footprints_of
from bimnav.plot._drawing import (
    COLORS,
    DOTS_PER_INCH,
    ROBOTS,
    WALLS,
    Unit,
    add_key,
    axes_for,
    box_around,
    draw_arrow,
    draw_cells,
    draw_elements,
    draw_mark,
    figure_size,
    finish,
    parts_at,
    patches_of,
    plain,
    shown_box,
    storey_of,
    unit_for,
)
from bimnav.plot._names import draw_names, draw_rooms

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from bimnav.building import Building
    from bimnav.environment import IndoorEnvironment
    from bimnav.graph import NavGraph
    from bimnav.plan import TeamPlan, Tour
    from bimnav.plan.tours import Point
    from bimnav.sim import SimResult

__all__ = [
    "draw_graph",
    "figure_bytes",
    "plot_building",
    "plot_environment",
    "plot_field",
    "plot_fleet",
    "plot_graph",
    "plot_tour",
    "save_tour",
]

_LISTED = 40  # stops named beside a plan; a longer list makes the figure taller than any page
_SECTION = (1.0, 1.2)  # metres above the floor at which walls are cut in the plan of a building
_BELOW = (0.05, 1.0)  # and what is seen beneath


def plot_building(
    building: Building, *, storey: int | str = 0, ax: Axes | None = None, unit: Unit | None = None
) -> Axes:
    """Draw the plan of a storey as read: walls cut a metre above the floor, things below, rooms, doors, stairs.

    Parameters
    ----------
    building
        As read, or written by hand.
    storey
        Its index, name or GlobalId.
    ax
        Where to draw; a new figure if None.
    unit
        Of the axes; None takes feet for models in feet, else metres.
    """
    _checks.need("building", building, "Building")
    index = building.storey_index(storey)
    level = building.storeys[index].elevation
    elements = [e for e in building.elements if e.shapes]
    doors = {door.global_id for door in building.doors}
    shapes = [(element, shape) for element in elements for shape in element.shapes]

    def seen(low: float, high: float) -> list[tuple[str, Any]]:
        parts = footprints_of([shape for _, shape in shapes], level + low, level + high)
        found = [(e, p.polygon) for (e, _), p in zip(shapes, parts, strict=True) if p is not None]
        return [(e.ifc_class, polygon) for e, polygon in found if e.global_id not in doors]

    cut, below = seen(*_SECTION), seen(*_BELOW)
    walls = [polygon for ifc_class, polygon in cut if ifc_class.startswith(WALLS)]
    others = [polygon for ifc_class, polygon in below if not ifc_class.startswith((*WALLS, "IfcStair", "IfcRamp"))]
    stairs = [polygon for ifc_class, polygon in below if ifc_class.startswith(("IfcStair", "IfcRamp"))]
    rooms = [
        (space, part)
        for space in building.spaces
        for part in footprints_of(space.shapes, level + 0.2, level + 0.5)
        if part is not None and not part.polygon.is_empty
    ]
    openings = [
        part.polygon
        for door in building.doors
        for part in footprints_of(door.element.shapes, level + 0.2, level + 1.0)
        if part is not None
    ]
    shown = shapely.geometrycollections([*walls, *others, *stairs, *(part.polygon for _, part in rooms)])
    bounds = box_around(shown.bounds if not shown.is_empty else (0, 0, 1, 1))
    ax = axes_for(ax, bounds)
    rooms_style = {"facecolor": COLORS["floor"], "edgecolor": "#d0cdc4", "linewidth": 0.5}
    ax.add_collection(patches_of([part.polygon for _, part in rooms], zorder=0, **rooms_style))
    ax.add_collection(patches_of(openings, facecolor=COLORS["door"], edgecolor="none", alpha=0.6, zorder=2))
    edge = {"edgecolor": "#6b6459", "linewidth": 0.5, "zorder": 3}
    ax.add_collection(patches_of(others, facecolor=COLORS["furniture"], alpha=0.75, **edge))
    ax.add_collection(patches_of(stairs, facecolor="#efe3c8", **edge))
    ax.add_collection(patches_of(walls, facecolor=COLORS["wall"], edgecolor="none", zorder=4))
    draw_names(ax, [(space.label, part.polygon) for space, part in rooms], bounds, others=[*walls, *others, *stairs])
    ax.set_title(plain(f"{building.name}, {building.storeys[index].name}"), fontsize=10)
    finish(ax, bounds, unit_for(building.unit, unit))
    key = [Patch(color=COLORS["wall"], label="wall, window, column")]
    key += [Patch(facecolor=COLORS["furniture"], edgecolor="#6b6459", label="other element")] if others else []
    key += [Patch(facecolor="#efe3c8", edgecolor="#6b6459", label="stair, ramp")] if stairs else []
    key += [Patch(color=COLORS["door"], alpha=0.6, label="door")] if openings else []
    add_key(ax, key)
    return ax


def plot_field(
    graph: NavGraph,
    field: NDArray[np.float64],
    *,
    storey: int | None = None,
    label: str = "distance (m)",
    ax: Axes | None = None,
    unit: Unit | None = None,
) -> Axes:
    """Draw a value for every cell, such as a distance field, with lines of equal value.

    Parameters
    ----------
    graph
        The cells.
    field : (storeys, rows, cols) float
        Values; what is not finite stays blank.
    storey
        Index of the storey; None for the ground.
    label
        What the values are, with their unit.
    ax
        Where to draw; a new figure if None.
    unit
        Of the axes; None takes feet for models in feet, else metres.
    """
    _checks.need("graph", graph, "NavGraph")
    field = _checks.numbers("field", field)
    if np.shape(field) != graph.frame.shape:
        raise InputError(
            f"the field is {np.shape(field)}, the graph {graph.frame.shape}.", "Give a value for each cell."
        )
    storey = storey_of(storey, graph.frame.ground, graph.frame.elevations)
    bounds = shown_box(graph, storey)
    ax = axes_for(ax, bounds)
    values = np.ma.masked_invalid(np.asarray(field[storey], dtype=np.float64))
    x0, y0, x1, y1 = graph.frame.bounds
    drawn = ax.imshow(values, origin="lower", extent=(x0, x1, y0, y1), cmap="cividis_r", zorder=0)
    if min(values.shape) > 1 and values.count() > 1 and values.max() > values.min():
        d = graph.frame.cell_size
        xs, ys = x0 + d * (0.5 + np.arange(values.shape[1])), y0 + d * (0.5 + np.arange(values.shape[0]))
        ax.contour(xs, ys, values, levels=8, colors="white", linewidths=0.5, alpha=0.7, zorder=1)
    if graph.environment is not None:
        draw_elements(ax, graph.environment, storey)
        draw_rooms(ax, graph.environment, storey, bounds)
        ax.set_title(plain(graph.environment.storeys[storey].name), fontsize=10)
    finish(ax, bounds, unit_for(graph.environment, unit))
    bar = ax.figure.colorbar(drawn, ax=ax, shrink=0.8, pad=0.02)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=8)
    return ax


def plot_fleet(
    plan: TeamPlan | SimResult, *, storey: int | None = None, ax: Axes | None = None, unit: Unit | None = None
) -> Axes:
    """Draw the tours of several robots on a storey, each in its color, with stops in their order.

    Parameters
    ----------
    plan
        As made by `plan_tours`, or played by `simulate`.
    storey
        Index of the storey; None for the one the first tour starts on.
    ax
        Where to draw; a new figure if None.
    unit
        Of the axes; None takes feet for models in feet, else metres.
    """
    if not isinstance(getattr(plan, "tours", None), tuple):
        _checks.need("plan", plan, "TeamPlan")
    graph = plan.tours[0].graph
    storey = storey_of(storey, plan.tours[0].start.storey, graph.frame.elevations)
    ax = draw_graph(graph, storey, ax, unit, tours=plan.tours)
    level = graph.frame.elevations[storey]
    key: list[Any] = []
    for k, (robot, tour) in enumerate(zip(plan.robots, plan.tours, strict=True)):
        color = ROBOTS[k % len(ROBOTS)]
        _draw_way(ax, tour, level, color)
        if tour.start.storey == storey:
            _draw_start(ax, tour, color)
        for number, stop in enumerate(tour.stops, 1):
            if stop.cell.storey == storey:
                draw_mark(ax, stop.end, str(number), color)
        said = f"{robot.name}: {counted('{n} stop[|s]', len(tour.stops))}, {tour.length:.1f} m"
        key.append(Line2D([], [], color=color, linewidth=1.8, marker="s", label=plain(said)))
    legend = ax.get_legend()
    add_key(ax, [*(legend.legend_handles if legend else ()), *key])
    return ax


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
    _checks.need("environment", environment, "IndoorEnvironment")
    storey = storey_of(storey, 0, environment.levels)
    regions = [r.polygon for r in environment.regions if r.storey == storey]
    shown = shapely.geometrycollections([*regions, *(o.footprint for o in environment.obstacles_on(storey))])
    bounds = box_around(shown.bounds if not shown.is_empty else (0, 0, 1, 1))
    ax = axes_for(ax, bounds)
    ax.add_collection(patches_of(regions, facecolor=COLORS["floor"], edgecolor="#d0cdc4", linewidth=0.5, zorder=0))
    key = draw_elements(ax, environment, storey)
    targets = [target for target in environment.targets if target.storey == storey]
    finish(ax, bounds, unit_for(environment, unit))
    for number, target in enumerate(targets, 1):
        draw_mark(ax, target.destination, str(number), COLORS["target"])
    draw_rooms(ax, environment, storey, bounds, marks=[target.destination for target in targets])
    ax.set_title(plain(environment.storeys[storey].name), fontsize=10)
    add_key(ax, key, [f"{number}  {target.name}" for number, target in enumerate(targets, 1)])
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
    return draw_graph(graph, storey, ax, unit)


def draw_graph(
    graph: NavGraph,
    storey: int | None,
    ax: Axes | None,
    unit: Unit | None,
    *,
    tours: Sequence[Tour] = (),
) -> Axes:
    """Draw as `plot_graph` does, with names of rooms where tours will leave them room."""
    _checks.need("graph", graph, "NavGraph")
    storey = storey_of(storey, graph.frame.ground, graph.frame.elevations)
    bounds = shown_box(graph, storey)
    ax = axes_for(ax, bounds)
    key = draw_cells(ax, graph, storey)
    if graph.environment is not None:
        key += draw_elements(ax, graph.environment, storey)
        marks, lines = _places_of(tours, graph.frame.elevations[storey])
        draw_rooms(ax, graph.environment, storey, bounds, marks=marks, lines=lines)
        ax.set_title(plain(graph.environment.storeys[storey].name), fontsize=10)
    finish(ax, bounds, unit_for(graph.environment, unit))
    add_key(ax, key)
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
    _checks.need("tour", tour, "Tour")
    graph = tour.graph
    storey = storey_of(storey, tour.start.storey, graph.frame.elevations)
    ax = draw_graph(graph, storey, ax, unit, tours=[tour])
    level = graph.frame.elevations[storey]
    climbs = _draw_way(ax, tour, level, COLORS["path"])
    key: list[Any] = [Line2D([], [], color=COLORS["path"], linewidth=1.8, label=f"route, {tour.length:.1f} m")]
    if climbs:
        key.append(Line2D([], [], color=COLORS["path"], linewidth=1.8, linestyle=":", label="to another storey"))
    if tour.start.storey == storey:
        _draw_start(ax, tour, COLORS["start"])
        key.append(Line2D([], [], color=COLORS["start"], marker="s", linestyle="none", label="start"))
    names = []
    for number, stop in enumerate(tour.stops, 1):
        aside = f" (from {stop.distance:.2f} m)" if stop.approach == "standing" else ""
        if stop.cell.storey == storey:
            names.append(f"{number}  {stop.name}{aside}")
            if stop.approach == "standing":
                ax.plot(*zip(stop.end[:2], stop.destination[:2], strict=True), ":", color=COLORS["target"], zorder=7)
            draw_mark(ax, stop.destination, str(number), COLORS["target"])
    for target in tour.unreached:
        if abs(target.destination[2] - level) < 1e-6:
            names.append(f"×  {target.name}: not reached")
            draw_mark(ax, target.destination, "×", COLORS["lost"])
    if len(names) > _LISTED:
        names = [*names[:_LISTED], f"... and {len(names) - _LISTED} more"]
    legend = ax.get_legend()
    add_key(ax, [*(legend.legend_handles if legend else ()), *key], ["", *names])
    return ax


def _places_of(tours: Sequence[Tour], level: float) -> tuple[list[Point], list[NDArray[np.float64]]]:
    """Return where marks of tours stand at a level, and their ways there, metres."""
    points = [tour.start_point for tour in tours]
    points += [point for tour in tours for stop in tour.stops for point in (stop.end, stop.destination)]
    points += [target.destination for tour in tours for target in tour.unreached]
    ways = [piece for tour in tours for leg in tour.route for part in parts_at(leg, level) for piece in part]
    return [point for point in points if abs(point[2] - level) < 1e-6], ways


def _draw_way(ax: Axes, tour: Tour, level: float, color: str) -> bool:
    """Draw what of a tour lies at a level, with its direction; tell whether it leaves the level or comes to it."""
    parts = [parts_at(leg, level) for leg in tour.route]
    pieces = [piece for flat, _ in parts for piece in flat]
    climbs = [piece for _, steep in parts for piece in steep]
    ax.add_collection(LineCollection(pieces, colors=color, linewidths=1.8, zorder=6, capstyle="round"))
    ax.add_collection(LineCollection(climbs, colors=color, linewidths=1.8, zorder=6, linestyles=":"))
    for piece in pieces:
        draw_arrow(ax, piece, color)
    return bool(climbs)


def _draw_start(ax: Axes, tour: Tour, color: str) -> None:
    ax.plot(*tour.start_point[:2], "s", color=color, markersize=9, markeredgecolor="white", zorder=8)


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
        figure = Figure(figsize=size, dpi=DOTS_PER_INCH)
        FigureCanvasAgg(figure)
        draw(figure.add_subplot())
        buffer = io.BytesIO()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing from font")  # the report holds such names, too
            figure.savefig(buffer, format="png", bbox_inches="tight", pad_inches=0.15, metadata={"Software": None})
    return buffer.getvalue()


def save_tour(tour: Tour, *, storey: int | None = None, unit: Unit | None = None) -> bytes:
    """Return the plan figure of a tour on one storey as PNG."""
    storey = tour.start.storey if storey is None else storey
    size = figure_size(shown_box(tour.graph, storey))
    return figure_bytes(lambda ax: plot_tour(tour, storey=storey, ax=ax, unit=unit), size=size)
