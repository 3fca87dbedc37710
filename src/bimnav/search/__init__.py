"""Compiled searches on arrays: nothing here knows a type of bimnav."""

from bimnav.search.components import components
from bimnav.search.dilation import dilate
from bimnav.search.engine import Found, distances, distances_between, find
from bimnav.search.exact import share_out, trace_visits, visit_table
from bimnav.search.layout import Layout
from bimnav.search.mesh import Mesh, mesh_of_mask, mesh_of_triangles
from bimnav.search.ordering import Ordering, is_small, order_few, order_groups, order_rows
from bimnav.search.oriented import HEADINGS, find_motion
from bimnav.search.repair import Field
from bimnav.search.sight import along, dearest, relax, shorten
from bimnav.search.taut import Taut, find_taut
from bimnav.search.trace import centers
from bimnav.search.transform import by_clearance, clearances
from bimnav.search.warmup import warmup

__all__ = [
    "HEADINGS",
    "Field",
    "Found",
    "Layout",
    "Mesh",
    "Ordering",
    "Taut",
    "along",
    "by_clearance",
    "centers",
    "clearances",
    "components",
    "dearest",
    "dilate",
    "distances",
    "distances_between",
    "find",
    "find_motion",
    "find_taut",
    "is_small",
    "mesh_of_mask",
    "mesh_of_triangles",
    "order_few",
    "order_groups",
    "order_rows",
    "relax",
    "share_out",
    "shorten",
    "trace_visits",
    "visit_table",
    "warmup",
]
