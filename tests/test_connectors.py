"""Stairs, ramps and lifts described, in small worlds and in real models."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import bimnav as bn
from bimnav._connectors import describe_connectors
from bimnav.testing import box, prism_shape
from tests.conftest import real_model

STOREYS = (bn.Storey("s0", "Ground", 0.0), bn.Storey("s1", "Upper", 3.0))


def described(elements, kind, low, high, **known):
    connector = bn.Connector("c", "the way", kind, tuple(e.global_id for e in elements), low, high)
    (found,) = describe_connectors(
        bn.Building("b", STOREYS, elements=tuple(elements), connectors=(connector,), **known)
    )
    return found


def steps(x0=0.0, z0=0.0, count=14, going=0.25, riser=0.2, thickness=None):
    """Return the treads of a straight flight along x, 1.2 m wide: solid down to its foot, or plates."""
    return tuple(
        prism_shape(
            shapely.box(x0 + k * going, 0, x0 + (k + 1) * going, 1.2),
            z0 if thickness is None else z0 + (k + 1) * riser - thickness,
            z0 + (k + 1) * riser,
        )
        for k in range(count)
    )


@pytest.mark.parametrize("thickness", [None, 0.04])
@pytest.mark.parametrize("ifc_class", ["IfcStairFlight", "IfcStair"])
def test_a_straight_stair_is_measured_however_it_is_written(thickness, ifc_class):
    flight = bn.Element("flight", ifc_class, shapes=steps(thickness=thickness))
    rail = box("rail", 0, 1.2, 0.9, 3.5, 1.25, 3.9, ifc_class="IfcRailing")
    way = described([flight, rail], "stair", 0.0, 3.9)
    assert (way.levels, way.storeys, way.steps) == ((0.0, 3.0), (0, 1), 15)
    assert (way.riser, way.width, way.rise, way.run) == pytest.approx((0.2, 1.2, 3.0, 3.5))
    assert way.slope == pytest.approx(3.0 / 3.5)
    assert way.entries[0] == pytest.approx((-0.4, 0.6, 0.0))
    assert way.entries[1] == pytest.approx((3.9, 0.6, 3.0))


def test_a_stair_with_a_landing_is_walked_over_it():
    first = bn.Element("first", "IfcStairFlight", shapes=steps(count=7))
    landing = box("landing", 1.75, 0, 1.3, 3.25, 2.7, 1.6, ifc_class="IfcSlab")
    back = tuple(
        prism_shape(shapely.box(1.5 - k * 0.25, 1.5, 1.75 - k * 0.25, 2.7), 1.6 + 0.2 * k, 1.8 + 0.2 * k)
        for k in range(6)
    )
    second = bn.Element("second", "IfcStairFlight", shapes=back)
    way = described([first, landing, second], "stair", 0.0, 2.8)
    assert (way.levels, way.steps) == ((0.0, 3.0), 15)
    assert way.width == pytest.approx(1.2)
    assert way.entries[0] == pytest.approx((-0.4, 0.6, 0.0))
    assert way.entries[1][:2] == pytest.approx((-0.15, 2.1))


def test_a_flush_last_tread_is_no_further_step():
    way = described([bn.Element("flight", "IfcStairFlight", shapes=steps(count=15))], "stair", 0.0, 3.0)
    assert (way.levels, way.steps) == ((0.0, 3.0), 15)


def test_a_ramp_is_measured_along_its_slope():
    wedge = bn.Mesh(
        np.array([(0, 0, 0), (6, 0, 0), (6, 0, 0.5), (0, 1.5, 0), (6, 1.5, 0), (6, 1.5, 0.5)], dtype=float),
        np.array([(0, 1, 2), (3, 5, 4), (0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2), (0, 2, 5), (0, 5, 3)]),
    )
    deck = box("deck", 6, 0, 0.3, 9, 3, 0.5, ifc_class="IfcSlab")
    ramp = bn.Element("ramp", "IfcRampFlight", shapes=(bn.Shape(wedge),))
    connector = bn.Connector("c", "ramp", "ramp", ("ramp",), 0.0, 0.5)
    building = bn.Building("b", STOREYS, elements=(ramp, deck), connectors=(connector,))
    (way,) = describe_connectors(building)
    assert way.levels == pytest.approx((0.0, 0.5))
    assert (way.run, way.width, way.slope) == pytest.approx((6.0, 1.5, 0.5 / 6))
    assert way.length == pytest.approx(np.hypot(6, 0.5))
    assert way.entries[0] == pytest.approx((-0.4, 0.75, 0.0))
    assert way.entries[1] == pytest.approx((6.4, 0.75, 0.5))


def test_a_lift_stops_where_it_has_doors_also_if_they_are_equipment():
    car = box("car", 0, 0, -1.2, 2, 2, 7.0, ifc_class="IfcFlowTerminal")
    doors = [
        box(f"door {z}", 2.0, 0.5, z, 2.1, 1.5, z + 2.1, ifc_class="IfcFlowTerminal", name="Elevator Door")
        for z in (0.0, 3.0)
    ]
    connector = bn.Connector("c", "lift", "lift", ("car",), -1.2, 7.0)
    (way,) = describe_connectors(bn.Building("b", STOREYS, elements=(car, *doors), connectors=(connector,)))
    assert (way.levels, way.storeys, way.rise) == ((0.0, 3.0), (0, 1), 3.0)
    assert [entry[:2] for entry in way.entries] == [pytest.approx((2.5, 1.0))] * 2
    assert way.width == pytest.approx(1.0)


def test_a_connector_without_form_is_described_by_its_box():
    way = described([box("lump", 0, 0, 0, 2, 4, 3, ifc_class="IfcStair")], "stair", 0.0, 3.0)
    assert (way.levels, way.steps, way.width) == ((0.0, 3.0), None, None)
    assert way.entries == ((1.0, 2.0, 0.0), (1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("name", "facts"),
    [
        ("duplex/Duplex_A_20110907.ifc", [("stair", (1, 2), 16, 0.194, 0.91)] * 2),
        ("houses/231110AC11-FZK-Haus-IFC.ifc", [("stair", (0, 1), 16, 0.177, 0.75)]),
        ("nasty/AC20-FZK-Haus_NoneAndDoubleGUID.ifc", [("stair", (0, 1), 16, 0.177, 0.75)]),
        ("nasty/Jesse.1.ifc", [("stair", (0, 2), 7, 0.18, 1.15), ("stair", (2, 4), 10, 0.18, 1.15)]),
        (
            "office/Office_A_20110811.ifc",
            [("stair", (0, 1), 24, 0.178, 1.0), ("stair", (0, 1), 24, 0.178, 1.0), ("lift", (0, 1), None, None, 1.37)],
        ),
        ("office/demo2.ifc", [("ramp", (0, 0), None, None, 1.0), ("stair", (0, 1), 14, 0.179, 1.0)]),
    ],
)
def test_the_ways_of_a_real_model(name, facts):
    ways = describe_connectors(bn.read_ifc(real_model(name)))
    found = [
        (w.kind, w.storeys, w.steps, None if w.riser is None else round(w.riser, 3), round(w.width, 2)) for w in ways
    ]
    assert found[: len(facts)] == facts


def test_the_ramp_of_demo2_leads_to_its_deck():
    ramp = describe_connectors(bn.read_ifc(real_model("office/demo2.ifc")))[0]
    assert ramp.levels == pytest.approx((0.0, 1.5), abs=1e-3)
    assert ramp.slope == pytest.approx(0.375, abs=1e-3)
    assert ramp.length == pytest.approx(4.272, abs=1e-3)


def test_the_stair_of_the_split_house_that_is_an_open_mesh_has_all_its_steps():
    ways = describe_connectors(bn.read_ifc(real_model("nasty/House.ifc")))
    assert [(way.steps, round(way.rise, 2)) for way in ways] == [(3, 0.6), (3, 0.45), (3, 0.6), (19, 2.85), (4, 0.6)]
