"""Studies: how one result depends on the settings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bimnav import _checks
from bimnav.errors import InputError
from bimnav.plot._drawing import ROBOTS, add_key

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bimnav._study import Study

__all__ = ["plot_study"]

_NAMES = {
    "cell_size": "cell size (m)",
    "closed_doors": "closed doors",
    "distance": "distance (m)",
    "energy": "energy (J)",
    "length": "length (m)",
    "makespan": "time until all is done (s)",
    "speed": "speed (m/s)",
    "waiting": "waiting (s)",
}
_SPREAD = 0.12  # between the columns of groups, in steps of the axis


def plot_study(
    study: Study, result: str = "length", by: str = "cell_size", group: str = "start", *, ax: Axes | None = None
) -> Axes:
    """Draw how a result depends on one setting, with a color for each value of another.

    Dots are scenarios. A line joins the means, and a bar goes from the least to the most. Scenarios that were
    not played are left out.

    Parameters
    ----------
    study
        What was found.
    result
        Column of results, on the vertical axis.
    by, group
        Settings: that of the horizontal axis, and that of the colors.
    ax
        Where to draw; a new figure if None.

    Raises
    ------
    ValueRangeError
        If there is no such result or setting.
    """
    _checks.need("study", study, "Study")
    _checks.need("ax", ax, "Axes", or_none=True)
    if study.is_in_vain:
        raise InputError(f"there is nothing to draw: {study!r}.", "Its rows say what to change.")
    means = study.summary(result, [by, group])
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.subplots(figsize=(5.2, 3.0))[1]
    places = {value: k for k, value in enumerate(dict.fromkeys(row[by] for row in study.rows))}
    groups = list(dict.fromkeys(row[group] for row in study.rows))
    for k, value in enumerate(groups):
        color = ROBOTS[k % len(ROBOTS)]
        aside = (k - (len(groups) - 1) / 2) * _SPREAD
        dots = [
            (places[row[by]] + aside, row[result]) for row in study.rows if row[group] == value and not row["error"]
        ]
        ax.scatter([x for x, _ in dots], [y for _, y in dots], s=10, color=color, alpha=0.45, linewidths=0)
        mine = [row for row in means if row[group] == value]
        x, y = [places[row[by]] + aside for row in mine], [row["mean"] for row in mine]
        found = [[height for place, height in dots if place == at] for at in x]
        below = [mean - min(heights) for mean, heights in zip(y, found, strict=True)]
        above = [max(heights) - mean for mean, heights in zip(y, found, strict=True)]
        style: dict[str, Any] = {"marker": "o", "markersize": 4, "linewidth": 1.2, "capsize": 2, "label": _told(value)}
        ax.errorbar(x, y, np.maximum([below, above], 0.0), color=color, **style)
    ax.set_xticks(range(len(places)), [_told(value) for value in places])
    ax.set_xlabel(_NAMES.get(by, by))
    ax.set_ylabel(_NAMES.get(result, result))
    ax.set_ylim(bottom=0)
    ax.tick_params(length=3, labelsize=8)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    handles, _ = ax.get_legend_handles_labels()
    add_key(ax, handles)
    legend = ax.get_legend()
    if legend is not None:
        legend.set_title(_NAMES.get(group, group))
        legend.get_title().set_fontsize(8)
    return ax


def _told(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value) or "none"
