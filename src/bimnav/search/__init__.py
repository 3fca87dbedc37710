"""Compiled searches on arrays: nothing here knows a type of bimnav."""

from bimnav.search.components import components
from bimnav.search.engine import Found, distances, distances_between, find
from bimnav.search.exact import share_out, trace_visits, visit_table
from bimnav.search.layout import Layout
from bimnav.search.ordering import Ordering, is_small, order_few, order_groups, order_rows
from bimnav.search.warmup import warmup

__all__ = [
    "Found",
    "Layout",
    "Ordering",
    "components",
    "distances",
    "distances_between",
    "find",
    "is_small",
    "order_few",
    "order_groups",
    "order_rows",
    "share_out",
    "trace_visits",
    "visit_table",
    "warmup",
]
