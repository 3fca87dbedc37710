"""Paths and tours on a navigation graph."""

from bimnav.plan.assignment import Assignment, assign_stops
from bimnav.plan.orders import StopOrder, order_stops
from bimnav.plan.paths import Algorithm, Engine, Path, distance_field, distance_matrix, find_path
from bimnav.plan.tours import Tour, plan_tour

__all__ = [
    "Algorithm",
    "Assignment",
    "Engine",
    "Path",
    "StopOrder",
    "Tour",
    "assign_stops",
    "distance_field",
    "distance_matrix",
    "find_path",
    "order_stops",
    "plan_tour",
]
