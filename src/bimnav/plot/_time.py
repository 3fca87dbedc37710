"""Time: who did what when, and motion as an animation."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch

from bimnav import _checks
from bimnav._files import write_bytes
from bimnav.errors import InputError, MissingExtraError, ValueRangeError
from bimnav.plot._drawing import ROBOTS, STATUSES, add_key, plain, shown_box, storey_of
from bimnav.plot._plans import draw_graph

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.axes import Axes

    from bimnav.sim import SimResult

__all__ = ["animate", "plot_timeline"]

_MOST_FRAMES = 2000
_DPI = 80
_WIDTH = 8.0  # inches


def plot_timeline(result: SimResult, *, ax: Axes | None = None) -> Axes:
    """Draw what every robot did when: a bar for each, colored by status, with the stops served.

    Parameters
    ----------
    result
        What was simulated, with its history.
    ax
        Where to draw; a new figure if None.
    """
    _checks.need("result", result, "SimResult")
    _checks.need("ax", ax, "Axes", or_none=True)
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.subplots(figsize=(_WIDTH, 1.2 + 0.4 * len(result.robots)))[1]
    seen: set[str] = set()
    for row, (robot, track) in enumerate(zip(result.robots, result.tracks, strict=True)):
        changes = np.flatnonzero(np.r_[True, track.statuses[1:] != track.statuses[:-1]])
        ends = np.r_[track.times[changes[1:]], result.span[1]]
        for begin, end, status in zip(track.times[changes], ends, track.statuses[changes].tolist(), strict=True):
            if end > begin:
                ax.barh(row, end - begin, left=begin, height=0.6, color=STATUSES.get(status, "#999999"))
                seen.add(status)
        served = [event for event in result.log if event.robot == robot.name and event.event == "end_service"]
        for number, event in enumerate(served, 1):
            ax.text(event.time, row - 0.42, str(number), fontsize=6.5, ha="center", va="bottom")
    ax.set_yticks(range(len(result.robots)), [plain(robot.name) for robot in result.robots], fontsize=8)
    ax.invert_yaxis()
    ax.set_xlabel("time (s)")
    ax.set_xlim(*result.span)
    ax.tick_params(length=3, labelsize=8)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    add_key(ax, [Patch(color=color, label=status) for status, color in STATUSES.items() if status in seen])
    return ax


def animate(
    result: SimResult,
    path: str | PathLike[str],
    *,
    storey: int | None = None,
    speed: float = 10.0,
    frames_per_second: int = 10,
) -> Path:
    """Write the motion on one storey as an animated GIF, or as MP4 where ffmpeg is installed.

    Parameters
    ----------
    result
        What was simulated, with its history.
    path
        File to write; its ending, `.gif` or `.mp4`, chooses the format.
    storey
        Index of the storey; None for the one the first tour starts on.
    speed
        Simulated seconds for each second shown.
    frames_per_second
        Of the file.

    Raises
    ------
    MissingExtraError
        If MP4 is asked for and ffmpeg is not installed.
    OutputError
        If the file cannot be written.
    """
    _checks.need("result", result, "SimResult")
    target = _checks.path("path", path)
    kind = target.suffix.lower()
    if kind not in (".gif", ".mp4"):
        raise InputError(f"{target.name!r} is neither a .gif nor an .mp4 file.", "Name the file so.")
    _checks.number("speed", speed, 1e-3, 1e6)
    _checks.number("frames_per_second", frames_per_second, 1, 60)
    begin, end = result.span
    count = int(np.ceil((end - begin) / speed * frames_per_second)) + 1
    if count > _MOST_FRAMES:
        raise ValueRangeError(
            f"the animation would have {count} frames.",
            f"Give a speed of at least {speed * count / _MOST_FRAMES:.0f}, or fewer frames for each second.",
        )
    if kind == ".mp4" and not FFMpegWriter.isAvailable():
        raise MissingExtraError("an .mp4 file needs ffmpeg.", "Install ffmpeg, or write a .gif file.")
    times = np.append(np.arange(count - 1) * (speed / frames_per_second) + begin, end)
    tour = result.tours[0]
    shown = storey_of(storey, tour.start.storey, tour.graph.frame.elevations)
    figure, update = _moving_plan(result, shown)
    writer: Any = PillowWriter(fps=frames_per_second) if kind == ".gif" else FFMpegWriter(fps=frames_per_second)
    with tempfile.TemporaryDirectory() as folder, mpl.rc_context({"savefig.bbox": None}):
        written = Path(folder) / f"animation{kind}"
        FuncAnimation(figure, lambda k: update(float(times[k])), frames=count).save(written, writer=writer, dpi=_DPI)
        write_bytes(target, written.read_bytes())
    return target


def _moving_plan(result: SimResult, storey: int) -> tuple[Figure, Any]:
    """Return a figure of the plan, and what moves the robots in it to a time."""
    graph = result.tours[0].graph
    box = shown_box(graph, storey)
    height = _WIDTH * min(max((box[3] - box[1]) / (box[2] - box[0]), 0.3), 1.2)
    figure = Figure(figsize=(_WIDTH + 2.2, height + 0.8), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    places = {
        stop.global_id: stop.destination[:2]
        for stops in result.stops
        for stop in stops
        if stop.cell.storey == storey and stop.kind == "target"
    }
    ax = draw_graph(graph, storey, figure.add_subplot(), None, tours=result.tours)
    least = 0.012 * max(box[2] - box[0], box[3] - box[1])
    bodies = []
    for k, robot in enumerate(result.robots):
        body = Circle((0, 0), max(robot.radius, least), color=ROBOTS[k % len(ROBOTS)], zorder=10)
        ax.add_patch(body)
        bodies.append(body)
    (left,) = ax.plot([], [], "o", color="#d55e00", markersize=6, markeredgecolor="white", zorder=9)
    title = ax.set_title(" ", fontsize=10)
    for _ in range(2):  # ticks get their places in the first
        figure.canvas.draw()
    figure.set_layout_engine("none")  # the layout is found once, not for every frame
    served = {event.target: event.time for event in result.log if event.event == "end_service"}

    def update(time: float) -> None:
        for robot, body in zip(result.robots, bodies, strict=True):
            state = result.state_at(time, robot.name)
            body.center = (state.x, state.y)
            body.set_visible(state.storey == result.storeys[storey])
        waiting = [place for target, place in places.items() if served.get(target, np.inf) > time]
        left.set_data(*np.array(waiting).reshape(-1, 2).T)
        title.set_text(f"{time - result.span[0]:.1f} s")

    return figure, update
