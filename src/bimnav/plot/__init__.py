"""Figures: a building, an environment, a grid, tours, fields, studies, time. Each draws on an axes and returns it."""

from bimnav.plot._plans import (
    figure_bytes,
    plot_building,
    plot_environment,
    plot_field,
    plot_fleet,
    plot_graph,
    plot_tour,
    save_tour,
)
from bimnav.plot._study import plot_study
from bimnav.plot._time import animate, plot_timeline

__all__ = [
    "animate",
    "figure_bytes",
    "plot_building",
    "plot_environment",
    "plot_field",
    "plot_fleet",
    "plot_graph",
    "plot_study",
    "plot_timeline",
    "plot_tour",
    "save_tour",
]
