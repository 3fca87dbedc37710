"""Where on the map a model lies."""

from __future__ import annotations

import math
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.geolocation as geolocation
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from bimnav._georeference import Georeference
from bimnav.errors import GeometryError, ModelError, ValueRangeError
from bimnav.footprint import merge_footprints, project
from bimnav.ifc import read_ifc
from bimnav.ifc._findings import Findings
from bimnav.ifc._georeference import anchor_rows, georeference_row
from tests.conftest import real_model
from tests.ifc_text import FRAME, model

UNITS = {"mm": 0.001, "ft": 0.3048, "m": 1.0}
POINTS = np.array([[0.0, 0.0, 0.0], [12.5, -3.25, 2.0], [-400.0, 90.0, 31.0]])
CONVERSION = {
    "Eastings": 458870.063,
    "Northings": 5438232.912,
    "OrthogonalHeight": 113.7,
    "XAxisAbscissa": 0.8,
    "XAxisOrdinate": -0.6,
}
SITE = "#50=IFCSITE('0000000000000000000050',$,$,$,$,#8,$,$,.ELEMENT.,({}),({}),{},$,$);"


class Written:
    """A file made in memory, with a unit, a context and a site."""

    def __init__(self, schema: str, unit: str = "m", wcs: tuple[float, float, float] | None = None) -> None:
        self.file = file = ifcopenshell.file(schema=schema)
        self.unit_scale = UNITS[unit]
        origin = tuple(np.array(wcs or (0.0, 0.0, 0.0)) / self.unit_scale)
        direction = file.createIfcDirection((0.6, 0.8, 0.0) if wcs else (1.0, 0.0, 0.0))
        axes = file.createIfcAxis2Placement3D(file.createIfcCartesianPoint(origin), None, direction)
        self.context = file.createIfcGeometricRepresentationContext(None, "Model", 3, 1e-5, axes)
        units = file.createIfcUnitAssignment([self.length(unit)])
        guid = ifcopenshell.guid.new
        self.project = file.create_entity(
            "IfcProject", guid(), UnitsInContext=units, RepresentationContexts=[self.context]
        )
        self.site = file.create_entity("IfcSite", guid())

    def length(self, unit: str) -> ifcopenshell.entity_instance:
        metre = self.file.createIfcSIUnit(None, "LENGTHUNIT", "MILLI" if unit == "mm" else None, "METRE")
        if unit != "ft":
            return metre
        powers = self.file.createIfcDimensionalExponents(1, 0, 0, 0, 0, 0, 0)
        factor = self.file.createIfcMeasureWithUnit(self.file.createIfcLengthMeasure(0.3048), metre)
        return self.file.createIfcConversionBasedUnit(powers, "LENGTHUNIT", "foot", factor)

    def convert(self, name: str = "IfcMapConversion", unit: str | None = "m", **values: object) -> Written:
        crs = {"Name": "EPSG:25832", "MapUnit": self.length(unit) if unit else None}
        target = self.file.create_entity("IfcProjectedCRS", **crs)
        self.file.create_entity(name, SourceCRS=self.context, TargetCRS=target, **values)
        return self

    def describe(self, owner: ifcopenshell.entity_instance, name: str, **values: object) -> Written:
        file = self.file
        wrapped = {
            key: file.create_entity("IfcLabel" if isinstance(value, str) else "IfcReal", value)
            for key, value in values.items()
        }
        properties = [file.createIfcPropertySingleValue(key, None, value) for key, value in wrapped.items()]
        written = file.create_entity("IfcPropertySet", ifcopenshell.guid.new(), Name=name, HasProperties=properties)
        file.create_entity(
            "IfcRelDefinesByProperties",
            ifcopenshell.guid.new(),
            RelatedObjects=[owner],
            RelatingPropertyDefinition=written,
        )
        return self

    def read(self) -> tuple[Georeference | None, list[str]]:
        findings = Findings({})
        row = georeference_row(self.file, self.unit_scale, findings)
        return (Georeference(**row) if row else None), [issue["message"] for issue in findings.rows]

    def judged(self, points: np.ndarray) -> np.ndarray:
        """What IfcOpenShell makes of points, for maps in metres."""
        return np.array([geolocation.auto_xyz2enh(self.file, *(point / self.unit_scale)) for point in points])


finite = {"allow_nan": False, "allow_infinity": False}
far = st.floats(-1e6, 1e6, **finite)


@settings(deadline=None)
@given(
    place=st.tuples(far, st.floats(-1e7, 1e7, **finite), st.floats(-1e3, 1e3, **finite)),
    angle=st.floats(-4, 4, **finite),
    scale=st.floats(0.99, 1.01, **finite),
    origin=st.tuples(far, far, st.floats(-100, 100, **finite)),
    point=st.tuples(far, far, far),
)
def test_the_way_to_the_map_and_back_ends_where_it_began(place, angle, scale, origin, point):
    here = Georeference(*place, math.cos(angle), math.sin(angle), scale, factors=(0.9997, 1.0002, 1.0), origin=origin)
    points = np.array([point])
    largest = max(1.0, *map(abs, (*place, *origin, *point)))
    np.testing.assert_allclose(here.to_model(here.to_map(points)), points, atol=1e-9 * largest)


def test_the_axis_says_where_x_points_on_the_map():
    here = Georeference(100.0, 200.0, 5.0, x_axis_abscissa=0.0, x_axis_ordinate=2.0, scale=0.9996)
    assert here.rotation == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(here.to_map([(10.0, 0.0)]), [(100.0, 209.996, 5.0)])


def test_what_knows_no_map_says_so():
    here = Georeference(latitude=41.9, longitude=-87.6)
    assert not here.is_mapped
    with pytest.raises(ModelError, match="map"):
        here.to_map([(0, 0)])
    with pytest.raises(GeometryError, match="shape"):
        Georeference(1.0, 2.0).to_map([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "nonsense",
    [
        {"scale": 0.0},
        {"scale": math.nan},
        {"eastings": math.inf, "northings": 0.0},
        {"eastings": 1.0},
        {"latitude": 270600745.0, "longitude": 0.0},
        {"x_axis_abscissa": 0.0, "x_axis_ordinate": 0.0},
        {"height": 1e6},
        {"factors": (1.0, 1000.0, 1.0)},
    ],
)
def test_what_is_no_place_on_earth_is_refused(nonsense):
    with pytest.raises(ValueRangeError):
        Georeference(**nonsense)


def test_a_model_that_is_moved_stays_where_it_is_on_the_map():
    here = Georeference(5e5, 5.4e6, 100.0, 0.6, 0.8, true_north=0.3)
    placement = np.array([[0.8, -0.6, 0, 7.0], [0.6, 0.8, 0, -3.0], [0, 0, 1, 2.0], [0, 0, 0, 1]])
    after = here.moved(placement)
    np.testing.assert_allclose(
        after.to_map(POINTS @ placement[:3, :3].T + placement[:3, 3]), here.to_map(POINTS), atol=1e-8
    )
    assert after.true_north == pytest.approx(0.3 + math.atan2(0.6, 0.8))


# reading


@pytest.mark.parametrize("wcs", [None, (1000.0, 2000.0, 30.0)])
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3"])
def test_points_lie_on_the_map_where_ifcopenshell_puts_them(schema, unit, wcs):
    written = Written(schema, unit, wcs)
    conversion = CONVERSION | {"Scale": 0.9996 * UNITS[unit]}
    if schema == "IFC2X3":
        written.describe(written.project, "ePSet_MapConversion", **conversion)
        written.describe(written.project, "ePSet_ProjectedCRS", Name="EPSG:25832", MapUnit="METRE")
    else:
        written.convert(**conversion)
    here, doubts = written.read()
    np.testing.assert_allclose(here.to_map(POINTS), written.judged(POINTS), rtol=1e-12)
    np.testing.assert_allclose(here.to_model(here.to_map(POINTS)), POINTS, atol=1e-7)
    assert (here.epsg, here.map_unit, doubts) == (25832, 1.0, [])
    assert here.scale == pytest.approx(0.9996)


def test_a_conversion_of_ifc4x3_may_scale_each_axis_or_none():
    factors = {"FactorX": 0.9998, "FactorY": 0.9997, "FactorZ": 1.0}
    scaled = Written("IFC4X3").convert("IfcMapConversionScaled", **CONVERSION, **factors)
    np.testing.assert_allclose(scaled.read()[0].to_map(POINTS), scaled.judged(POINTS), rtol=1e-12)
    rigid = Written("IFC4X3")
    corner = {
        "FirstCoordinate": rigid.file.createIfcLengthMeasure(5e5),
        "SecondCoordinate": rigid.file.createIfcLengthMeasure(5.4e6),
    }
    rigid.convert("IfcRigidOperation", **corner, Height=12.0)
    here, doubts = rigid.read()
    np.testing.assert_allclose(here.to_map(POINTS), rigid.judged(POINTS), rtol=1e-12)
    assert (here.source, here.rotation, doubts) == ("IfcRigidOperation", 0.0, [])


@pytest.mark.parametrize(
    ("owner", "prefix", "values"),
    [
        ("site", "EPset_", {"Eastings": "458870,063", "Northings": "5438232.912", "OrthogonalHeight": "113.7"}),
        ("project", "ePset_", {"Easting": 458870.063, "Northing": 5438232.912, "OrthogonalHeight": 113.7}),
        ("site", "Pset_", {"Eastings": 458870063.0, "Northings": 5438232912.0, "OrthogonalHeight": 113700.0}),
    ],
)
def test_property_sets_are_known_by_the_names_that_exporters_give_them(owner, prefix, values):
    written = Written("IFC2X3", "mm")
    at = getattr(written, owner)
    unit = "MILLIMETRE" if prefix == "Pset_" else "m"
    written.describe(at, f"{prefix}MapConversion", **values, Scale=1.0 if unit == "MILLIMETRE" else 0.001)
    written.describe(at, f"{prefix}ProjectedCRS", Name="urn:ogc:def:crs:EPSG::25832", MapUnit=unit)
    here, doubts = written.read()
    assert (here.eastings, here.northings, here.height) == pytest.approx((458870.063, 5438232.912, 113.7))
    assert (here.epsg, here.scale, doubts) == (25832, 1.0, [])


@pytest.mark.parametrize(
    ("unit", "map_unit", "scale"),
    [("mm", "m", None), ("ft", "m", 1.0), ("mm", None, None), ("mm", None, 0.001), ("ft", None, 0.3048)],
)
def test_a_scale_that_leaves_out_the_units_is_understood_and_said(unit, map_unit, scale):
    here, doubts = Written("IFC4", unit).convert(unit=map_unit, **CONVERSION, Scale=scale).read()
    assert (here.eastings, here.scale) == pytest.approx((458870.063, 1.0))
    assert ["do not fit" in doubt for doubt in doubts] == [True]


def test_eastings_are_in_the_unit_of_the_map():
    values = {name: value * 1000 for name, value in CONVERSION.items()}
    here, doubts = Written("IFC4", "mm").convert(unit="mm", **values).read()
    assert (here.eastings, here.map_unit, doubts) == (pytest.approx(458870.063), 0.001, [])
    here, doubts = Written("IFC4", "mm").convert(unit=None, **values).read()
    assert (here.eastings, doubts) == (pytest.approx(458870.063), [])


@pytest.mark.parametrize(
    "nonsense",
    [
        {"Scale": 0.0},
        {"Scale": -1.0},
        {"Scale": 42.0},
        {"Eastings": 1e300},
        {"XAxisAbscissa": 0.0, "XAxisOrdinate": 0.0},
        {"Northings": "nan"},
        {"XAxisAbscissa": "inf"},
        {"Eastings": "n/a"},
    ],
)
def test_a_conversion_without_sense_is_dropped_and_said(nonsense):
    if str in map(type, nonsense.values()):
        written = Written("IFC2X3")
        written.describe(written.site, "ePSet_MapConversion", **CONVERSION | nonsense)
    else:
        written = Written("IFC4").convert(**CONVERSION | nonsense)
    here, doubts = written.read()
    assert here is None
    assert ["dropped" in doubt for doubt in doubts] == [True]


def test_one_part_without_sense_leaves_the_others():
    written = Written("IFC4").convert(**CONVERSION)
    written.site.RefLatitude, written.site.RefLongitude = (270600745,) * 3, (13, 24, 0)
    written.context.TrueNorth = written.file.createIfcDirection((0.0, 0.0))
    here, doubts = written.read()
    assert here.is_mapped
    assert (here.latitude, here.true_north, here.source) == (None, None, "IfcMapConversion")
    assert len(doubts) == 2


@pytest.mark.parametrize(
    ("latitude", "longitude", "expected"),
    [
        ((41, 52, 27, 840000), (-87, -38, -21, -839999), (41.8744, -87.63939999972)),
        ((51, 30, 0, 549316), (0, -7, -34, -450321), (51.50015258778, -0.12623620028)),
        ((52, 31, 0), (13, 24, 0), (52.51666666667, 13.4)),
    ],
)
def test_degrees_carry_their_sign_through_minutes_and_seconds(latitude, longitude, expected):
    written = Written("IFC2X3", "mm")
    written.site.RefLatitude, written.site.RefLongitude, written.site.RefElevation = latitude, longitude, 62050.0
    written.context.TrueNorth = written.file.createIfcDirection((1.0, 1.0))
    here, doubts = written.read()
    assert (here.latitude, here.longitude) == pytest.approx(expected, abs=1e-10)
    assert (here.elevation, here.source, doubts) == (pytest.approx(62.05), "IfcSite, TrueNorth", [])
    assert math.degrees(here.true_north) == pytest.approx(-45.0)


def test_a_site_at_latitude_and_longitude_zero_is_a_default():
    written = Written("IFC4")
    written.site.RefLatitude = written.site.RefLongitude = (0, 0, 0)
    assert written.read()[0] is None
    assert "default" in written.read()[1][0]


def test_a_file_that_says_nothing_has_no_georeference_and_no_issue():
    assert Written("IFC4").read() == (None, [])


@pytest.mark.parametrize("isolate", [True, False])
def test_a_building_keeps_its_georeference(tmp_path: Path, isolate: bool):
    frame = [
        line.replace("$,'Model',3,1.E-5,#5,$", "$,'Model',3,1.E-5,#60,#63") if line.startswith("#4=") else line
        for line in FRAME
    ]
    lines = [
        "#60=IFCAXIS2PLACEMENT3D(#61,$,$);",
        "#61=IFCCARTESIANPOINT((100.,200.,3.));",
        "#63=IFCDIRECTION((0.,1.));",
        "#64=IFCPROJECTEDCRS('EPSG:32632',$,$,$,$,$,#3);",
        "#65=IFCMAPCONVERSION(#4,#64,691000.,5336000.,500.,$,$,$);",
        SITE.format("270600745,0,0", "11,0,0", "0."),
    ]
    path = tmp_path / "here.ifc"
    path.write_text(model(*lines, frame=frame))
    building = read_ifc(path, cache=False, isolate=isolate)
    here = building.georeference
    assert here == Georeference(
        691000.0,
        5336000.0,
        500.0,
        origin=(100.0, 200.0, 3.0),
        crs_name="EPSG:32632",
        epsg=32632,
        true_north=0.0,
        source="IfcMapConversion, TrueNorth",
    )
    [doubt] = [issue for issue in building.issues if issue.code == "doubtful-georeference"]
    assert "latitude is 270600745" in doubt.message
    np.testing.assert_array_equal(here.to_map([(101.0, 202.0)]), [(691001.0, 5336002.0, 497.0)])


def test_a_site_without_a_sound_placement_is_no_anchor():
    written = Written("IFC4", "mm")
    file = written.file
    assert anchor_rows(file, 0.001) == {}
    point, up = file.createIfcCartesianPoint((1000.0, 2000.0, 0.0)), file.createIfcDirection((0.0, 0.0, 1.0))
    written.site.ObjectPlacement = file.createIfcLocalPlacement(None, file.createIfcAxis2Placement3D(point, up, up))
    assert anchor_rows(file, 0.001) == {}
    written.site.ObjectPlacement.RelativePlacement.RefDirection = file.createIfcDirection((0.0, 1.0, 0.0))
    [placement] = anchor_rows(file, 0.001).values()
    np.testing.assert_allclose(placement, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-12)


# real models


def test_a_rotated_model_in_millimetres_lies_in_its_utm_zone():
    path = real_model("georef/building-architecture.ifc")
    here = read_ifc(path, cache=False).georeference
    file = ifcopenshell.open(path)
    judged = [np.array(geolocation.auto_xyz2enh(file, *(point * 1000))) / 1000 for point in POINTS]
    np.testing.assert_allclose(here.to_map(POINTS), judged, rtol=1e-13)
    assert (here.epsg, here.map_unit) == (32760, 0.001)
    assert here.eastings == pytest.approx(729013.3488)
    assert math.degrees(here.rotation) == pytest.approx(60.0)


def test_a_model_far_from_the_origin_has_the_footprints_of_the_same_one_near_it(tmp_path: Path):
    path = real_model("nasty/large_offset.ifc")
    file = ifcopenshell.open(path)
    place = file.by_type("IfcSite")[0].ObjectPlacement.RelativePlacement.Location
    shift = np.array(place.Coordinates) / 1000
    assert np.hypot(*shift[:2]) > 1e6
    place.Coordinates = (0.0, 0.0, 0.0)
    file.write(str(tmp_path / "near.ifc"))
    far, near = read_ifc(path, cache=False), read_ifc(tmp_path / "near.ifc", cache=False)
    assert len(far.elements) == len(near.elements) == 8
    for element in far:
        there, here = (
            merge_footprints([project(shape) for shape in e.shapes]).polygon for e in (element, near[element.global_id])
        )
        assert there.area == pytest.approx(here.area, abs=1e-6)
        np.testing.assert_allclose(np.array(there.bounds) - np.tile(shift[:2], 2), here.bounds, atol=1e-6)
    np.testing.assert_allclose(far.elements[0].bounds, near.elements[0].bounds + shift, atol=1e-6)
