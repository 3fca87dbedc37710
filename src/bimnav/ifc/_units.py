"""The length unit of a file."""

from __future__ import annotations

import math

from ifcopenshell.util.unit import calculate_unit_scale

from bimnav.errors import IfcStructureError, IfcUnitsError
from bimnav.ifc._kernel import File

__all__ = ["angle_unit", "length_unit"]

_RANGE = (1e-6, 1e4)  # metres per unit: a micrometre to ten kilometres


def length_unit(file: File) -> tuple[str, float]:
    """Return the name of the length unit, such as `millimetre` or `foot`, and how many metres it is.

    Raises
    ------
    IfcStructureError
        If the file has no project.
    IfcUnitsError
        If the project states no length unit, several, or one that is not a sensible number of metres.
    """
    projects = sorted(file.by_type("IfcProject"), key=lambda project: project.id())
    if not projects:
        raise IfcStructureError("the file has no IfcProject.", "It may be cut off or no building model.")
    assignment = projects[0].UnitsInContext
    units = [u for u in (assignment and assignment.Units) or () if getattr(u, "UnitType", "") == "LENGTHUNIT"]
    if len(units) != 1:
        found = "no length unit" if not units else f"{len(units)} length units"
        raise IfcUnitsError(f"the file states {found}.", "State exactly one in the authoring tool.")
    name = f"{getattr(units[0], 'Prefix', None) or ''}{units[0].Name or ''}".casefold()
    try:
        scale = float(calculate_unit_scale(file))
    except (AttributeError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise IfcUnitsError(f"the length unit {name!r} cannot be read.", "State it in metres.") from error
    if not (math.isfinite(scale) and _RANGE[0] <= scale <= _RANGE[1]):
        raise IfcUnitsError(
            f"the length unit {name!r} is {scale:.6g} m.", "Export in metres, millimetres or feet.", {"scale": scale}
        )
    return name, scale


def angle_unit(file: File) -> float:
    """Return the radians of the file's angle unit; nan if it cannot be read."""
    try:
        return float(calculate_unit_scale(file, "PLANEANGLEUNIT"))
    except (AttributeError, KeyError, RuntimeError, TypeError, ValueError):
        return math.nan
