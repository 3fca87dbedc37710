"""Paths and tours on a navigation graph."""

from bimnav.plan.paths import Algorithm, Engine, Path, distance_field, distance_matrix, find_path
from bimnav.plan.tours import StopOrder, Tour, order_stops, plan_tour

__all__ = [
    "Algorithm",
    "Engine",
    "Path",
    "StopOrder",
    "Tour",
    "distance_field",
    "distance_matrix",
    "find_path",
    "order_stops",
    "plan_tour",
]
