"""Paths and tours on a navigation graph."""

from bimnav.plan.assignment import Assignment, assign_stops
from bimnav.plan.charging import Charge
from bimnav.plan.orders import StopOrder, order_stops
from bimnav.plan.paths import Algorithm, Engine, Path, distance_field, distance_matrix, find_path
from bimnav.plan.teams import TeamPlan, plan_tours
from bimnav.plan.tours import Tour, plan_tour

__all__ = [
    "Algorithm",
    "Assignment",
    "Charge",
    "Engine",
    "Path",
    "StopOrder",
    "TeamPlan",
    "Tour",
    "assign_stops",
    "distance_field",
    "distance_matrix",
    "find_path",
    "order_stops",
    "plan_tour",
    "plan_tours",
]
