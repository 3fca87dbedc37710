"""Pipes and elbows: closed, inside what is drawn and no more than a millimetre."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from bimnav.building import Mesh
from bimnav.footprint import whole
from bimnav.ifc._pipes import elbow, pipe
from tests.test_ifc_extract import Sketch

X, ORIGIN = np.array((1.0, 0.0, 0.0)), np.zeros(3)


def volume_of(mesh: Mesh) -> float:
    made = whole(mesh)
    assert made.quality == "exact"
    a, b, c = (made.vertices[made.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@settings(deadline=None)
@given(st.floats(0.005, 5.0), st.floats(-2.0, 2.0), st.floats(0.01, 10.0))
def test_a_pipe_is_a_prism_whose_chords_sag_a_millimetre_at_most(radius: float, lean: float, height: float):
    mesh = pipe(np.array((0.3, -0.2, 0.0)), radius, np.array((lean, 0.0, height)))
    assert mesh is not None
    count = len(mesh.vertices) // 2
    sides = radius**2 * count * math.sin(math.tau / count) / 2
    assert volume_of(mesh) == pytest.approx(sides * height, rel=1e-6)
    assert radius * (1 - math.cos(math.pi / count)) <= 1e-3 + 1e-12
    assert math.tau / count <= 0.5


@settings(deadline=None)
@given(st.floats(0.01, 0.5), st.floats(1.01, 10.0), st.floats(0.05, math.tau))
def test_an_elbow_is_closed_and_lies_within_the_torus(radius: float, reach: float, angle: float):
    middle = np.array((0.0, reach * radius, 0.0))
    mesh = elbow(middle, radius, ORIGIN, X, angle)
    assert mesh is not None
    torus = math.pi * radius**2 * reach * radius * angle
    assert 0.85 * torus <= volume_of(mesh) <= torus
    around = np.hypot(np.hypot(mesh.vertices[:, 1], mesh.vertices[:, 2]) - reach * radius, mesh.vertices[:, 0])
    assert around == pytest.approx(np.full(len(around), radius))


def test_a_full_turn_has_no_ends():
    mesh = elbow(np.array((0.0, 1.0, 0.0)), 0.2, ORIGIN, X, math.tau)
    assert mesh is not None
    assert volume_of(mesh) == pytest.approx(math.pi * 0.04 * math.tau, rel=0.02)


@pytest.mark.parametrize("angle", [0.0, -1.0, 7.0, math.nan, math.inf])
def test_a_turn_by_no_or_too_large_an_angle_is_none(angle: float):
    assert elbow(np.array((0.0, 1.0, 0.0)), 0.2, ORIGIN, X, angle) is None


def test_what_needs_a_kernel_is_none():
    assert pipe(ORIGIN, 1.0, X) is None  # no height
    assert elbow(np.array((0.0, 0.1, 0.0)), 0.2, ORIGIN, X, 1.0) is None  # the axis meets the circle
    assert elbow(np.array((0.0, 1.0, 0.0)), 0.2, ORIGIN, np.array((0.6, 0.0, 0.8)), 1.0) is None


@pytest.mark.parametrize("unit", ["metre", "millimetre", "foot"])
def test_a_file_with_a_pipe_and_an_elbow_holds_them_where_they_are(unit: str):
    sketch = Sketch(unit=unit)
    flat = sketch.make("IfcAxis2Placement2D", sketch.point(0.0, 1.0), None)
    circle = sketch.make("IfcCircleProfileDef", "AREA", None, flat, 0.1 * sketch.per_metre)
    upright = sketch.make(
        "IfcExtrudedAreaSolid", circle, sketch.axes((2, 0, 1)), sketch.direction(0, 0, 2), 3 * sketch.per_metre
    )
    axis = sketch.make("IfcAxis1Placement", sketch.point(0, 0, 0), sketch.direction(1, 0, 0))
    bent = sketch.make("IfcRevolvedAreaSolid", circle, sketch.axes((5, 0, 0)), axis, math.pi / 2)
    sketch.contain(sketch.storeys[0], sketch.add("IfcColumn", upright), sketch.add("IfcBeam", bent))
    building = sketch.read()
    column, beam = (element.shapes[0].bounds for element in building.elements)
    assert column == pytest.approx(np.array([[1.9, 0.9, 1.0], [2.1, 1.1, 4.0]]), abs=2e-3)
    assert beam == pytest.approx(np.array([[4.9, 0.0, 0.0], [5.1, 1.1, 1.1]]), abs=2e-3)
