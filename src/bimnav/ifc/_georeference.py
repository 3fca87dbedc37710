"""Where a file says that its model lies: map conversion, site, true north."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from ifcopenshell.util.element import get_psets
from ifcopenshell.util.placement import get_axis2placement, get_local_placement
from ifcopenshell.util.unit import get_prefix_multiplier
from numpy.typing import NDArray

from bimnav._georeference import FITTING_SCALES, Georeference
from bimnav.errors import ValueRangeError
from bimnav.ifc._findings import Findings
from bimnav.ifc._kernel import Entity, File
from bimnav.ifc._products import sorted_of

__all__ = ["anchor_rows", "georeference_row"]

Row = dict[str, Any]

_BROKEN = (ArithmeticError, AssertionError, AttributeError, LookupError, RuntimeError, TypeError, ValueError)
_NEAR = 1e4  # metres; the origin of a map lies farther from what is built than this
_SKEW = 1e-6  # of an axis of length 1
_EPSG = re.compile(r"EPSG.*?(?<![\d.])(\d{4,6})(?![\d.])|\s*(\d{4,6})\s*", re.IGNORECASE)
_UNITS = {  # how property sets write units
    **dict.fromkeys(("m", "meter", "metre"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimetre"), 0.01),
    **dict.fromkeys(("mm", "millimeter", "millimetre"), 0.001),
    **dict.fromkeys(("ft", "foot", "feet", "internationalfoot"), 0.3048),
    **dict.fromkeys(("ftus", "ussurveyfoot", "ussurveyfeet"), 1200 / 3937),
}


def georeference_row(file: File, unit_scale: float, findings: Findings) -> Row | None:
    """Read where the model lies, as what `Georeference` takes; None if the file does not say.

    What makes no sense is dropped and noted.
    """
    row: Row = {}
    sources = []
    for source in (_on_the_map, _on_the_globe, _to_the_north):
        try:
            found = source(file, unit_scale, findings)
        except ValueRangeError as error:
            _doubt(findings, f"{error.message.removesuffix('.')}; it was dropped.")
        except _BROKEN as error:
            _doubt(findings, f"it cannot be read ({error!s:.80}); it was dropped.")
        else:
            changed = {name: value for name, value in asdict(found).items() if value != _DEFAULTS[name]}
            sources += [changed.pop("source")] if changed else []
            row |= changed
    return row | {"source": ", ".join(sources)} if row else None


_prefix: Any = get_prefix_multiplier
_DEFAULTS = {field.name: field.default for field in fields(Georeference)}


def anchor_rows(file: File, unit_scale: float) -> dict[str, list[list[float]]]:
    """Return the placements of sites, buildings and storeys, (4, 4) metres, by the GlobalIds in the file.

    What has no placement, or one whose axes are not at right angles, tells nothing.
    """
    rows: dict[str, list[list[float]]] = {}
    for place in sorted_of(file, "IfcSite", "IfcBuilding", "IfcBuildingStorey"):
        try:
            placement = _in_metres(get_local_placement, place.ObjectPlacement, unit_scale)
        except _BROKEN:
            continue
        axes = placement[:3, :3]
        is_sound = np.isfinite(placement).all() and np.allclose(axes @ axes.T, np.eye(3), atol=_SKEW)
        if place.ObjectPlacement is not None and is_sound:
            rows.setdefault(str(place.GlobalId), placement.tolist())
    return rows


def _doubt(findings: Findings, what: str, severity: str = "warning") -> None:
    findings.add(
        "doubtful-georeference", f"georeference: {what}", severity=severity, hint="Check it in the authoring tool."
    )


def _in_metres(read: Callable[[Any], Any], written: Entity, unit_scale: float) -> NDArray[np.float64]:
    with np.errstate(all="ignore"):  # what has no direction becomes nan, and is found to be
        metres = np.array(read(written), dtype=np.float64)
    metres[:3, 3] *= unit_scale
    return metres


# on the map


def _on_the_map(file: File, unit_scale: float, findings: Findings) -> Georeference:
    """Read a coordinate operation, or the property sets that stand for one."""
    operations = sorted_of(file, "IfcCoordinateOperation")
    if operations:
        values, crs, context = _from_operation(operations[0])
    else:
        values, crs = _from_property_sets(file)
        context = _model_context(file)
    if not values.keys() & {"easting", "northing"}:
        return Georeference()
    number = {name: _number(value) for name, value in values.items() if name in _NUMBERS and value is not None}
    eastings, northings = number.get("easting", 0.0), number.get("northing", 0.0)
    written, stated = number.get("scale", 1.0), crs.get("mapunit")
    map_unit, scale = _fitting(written, stated, unit_scale, max(abs(eastings), abs(northings)))
    if (map_unit, scale) != (stated or unit_scale, written * (stated or unit_scale) / unit_scale):
        _doubt(
            findings,
            f"its units and its scale of {written:g} do not fit each other; the eastings were taken for "
            f"{eastings * map_unit:.3f} m, and the scale for {scale:g}.",
            "info",
        )
    name = str(crs.get("name") or "")
    code = _EPSG.fullmatch(name) or _EPSG.search(name)
    axis = number.get("xaxisabscissa"), number.get("xaxisordinate")
    factors = (number.get("factorx", 1.0), number.get("factory", 1.0), number.get("factorz", 1.0))
    found = Georeference(
        eastings=eastings * map_unit,
        northings=northings * map_unit,
        height=number.get("orthogonalheight", 0.0) * map_unit,
        x_axis_abscissa=1.0 if axis == (None, None) else axis[0] or 0.0,
        x_axis_ordinate=axis[1] or 0.0,
        scale=scale,
        factors=factors,
        map_unit=map_unit,
        crs_name=name,
        epsg=int(code[1] or code[2]) if code else None,
        source=values["source"],
    )
    system = getattr(context, "WorldCoordinateSystem", None)
    return found if system is None else found.moved(_in_metres(get_axis2placement, system, unit_scale))


_NUMBERS = frozenset(
    [
        "easting",
        "northing",
        "orthogonalheight",
        "xaxisabscissa",
        "xaxisordinate",
        "scale",
        "factorx",
        "factory",
        "factorz",
    ]
)


def _from_operation(operation: Entity) -> tuple[Row, Row, Entity | None]:
    values = {_key(name): value for name, value in operation.get_info().items()} | {"source": operation.is_a()}
    if operation.is_a("IfcRigidOperation"):
        first, second = operation.FirstCoordinate, operation.SecondCoordinate
        if not first.is_a("IfcLengthMeasure"):
            raise ValueRangeError(f"the coordinates of {operation.is_a()} are no lengths.")
        values |= {"easting": first.wrappedValue, "northing": second.wrappedValue}
        values["orthogonalheight"] = operation.Height
    target = operation.TargetCRS
    crs: Row = {} if target is None else {_key(name): value for name, value in target.get_info().items()}
    crs["mapunit"] = _metres_of(crs["mapunit"]) if crs.get("mapunit") is not None else None
    return values, crs, operation.SourceCRS


def _from_property_sets(file: File) -> tuple[Row, Row]:
    """Find the sets that the guide to georeferencing prescribes for IFC2X3; sites come before the project."""
    values: Row = {}
    crs: Row = {}
    for owner in (*sorted_of(file, "IfcSite"), *sorted_of(file, "IfcProject")):
        for name, properties in get_psets(owner).items():
            known = {_key(key): value for key, value in properties.items() if key != "id"}
            if _key(name).endswith("psetmapconversion") and not values:
                values = known | {"source": name}
            elif _key(name).endswith("psetprojectedcr") and not crs:
                crs = known
    unit = str(crs.get("mapunit") or "")
    crs["mapunit"] = _UNITS.get(re.sub(r"[^a-z]", "", unit.casefold()))
    return values, crs


def _key(name: str) -> str:
    """Write a name the way all exporters can agree on: ePset_MapConversion, EPset_MapConversion; Eastings, Easting."""
    return re.sub(r"[^a-z]", "", name.casefold()).removesuffix("s")


def _number(value: Any) -> float:
    return float(value.strip().replace(",", ".") if isinstance(value, str) else value)


def _metres_of(unit: Entity) -> float:
    """Return how many metres a length unit is."""
    if unit.is_a("IfcSIUnit"):
        return float(_prefix(unit.Prefix)) if unit.Prefix else 1.0
    factor = unit.ConversionFactor
    return float(factor.ValueComponent.wrappedValue) * _metres_of(factor.UnitComponent)


def _fitting(scale: float, stated: float | None, unit_scale: float, farthest: float) -> tuple[float, float]:
    """Find the unit of the map and the metres on the map per metre in the model.

    The scale of a file takes its units to those of the map. Many files leave the units out of it, or do
    not state that of the map; then the first reading holds that is true to scale and not at the map's origin.

    Parameters
    ----------
    stated
        Metres in the map's unit, or None.
    farthest
        The larger of eastings and northings, in the map's unit.
    """
    units = [stated] if stated else list(dict.fromkeys((unit_scale, 1.0)))
    readings = [(unit, scale * unit / unit_scale) for unit in units] + [(unit, scale) for unit in units]
    readings = [reading for reading in readings if FITTING_SCALES[0] <= reading[1] <= FITTING_SCALES[1]]
    if not readings:
        raise ValueRangeError(f"scale is {scale:g}.")
    return next((reading for reading in readings if farthest * reading[0] >= _NEAR), readings[0])


# on the globe


def _on_the_globe(file: File, unit_scale: float, _: Findings) -> Georeference:
    """Read latitude, longitude and elevation of the first site that has them."""
    for site in sorted_of(file, "IfcSite"):
        latitude, longitude = _degrees(site.RefLatitude), _degrees(site.RefLongitude)
        if latitude == longitude == 0:
            raise ValueRangeError("latitude and longitude are both 0, which is a default and no site.")
        if latitude is not None and longitude is not None:
            elevation = None if site.RefElevation is None else site.RefElevation * unit_scale + 0.0
            return Georeference(latitude=latitude, longitude=longitude, elevation=elevation, source="IfcSite")
    return Georeference()


def _degrees(parts: Any) -> float | None:
    """Return degrees of degrees, minutes, seconds and millionths of a second, which all carry the sign."""
    if not parts:
        return None
    size = sum(abs(part) / unit for part, unit in zip(parts, (1, 60, 3600, 3.6e9), strict=False))
    return -size if min(parts) < 0 else float(size)


# to the north


def _to_the_north(file: File, _: float, __: Findings) -> Georeference:
    """Read which way true north is."""
    north = getattr(_model_context(file), "TrueNorth", None)
    if north is None:
        return Georeference()
    x, y = north.DirectionRatios[:2]
    if not math.hypot(x, y) > 0:
        raise ValueRangeError(f"true north is ({x}, {y}).")
    return Georeference(true_north=math.remainder(math.atan2(y, x) - math.pi / 2, math.tau), source="TrueNorth")


def _model_context(file: File) -> Entity | None:
    """Return the context of the model's bodies, else the first one."""
    found = file.by_type("IfcGeometricRepresentationContext", include_subtypes=False)
    return min(found, key=lambda context: (context.ContextType != "Model", context.id()), default=None)
