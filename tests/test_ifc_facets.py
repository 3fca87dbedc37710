"""Faceted bodies from the text: the same as from a geometry kernel, and nothing that the kernel should judge."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import ifcopenshell
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from bimnav.building import Mesh
from bimnav.errors import GeometryError
from bimnav.footprint import whole
from bimnav.ifc._extract import _sort_out, extract, to_building
from bimnav.ifc._facets import Facets
from bimnav.ifc._products import left_out_by_class, sorted_of
from bimnav.ifc._step import gather, index
from bimnav.ifc._tessellate import Tessellator
from bimnav.ifc._units import length_unit
from tests.conftest import real_model

POINT = "IFCCARTESIANPOINT"


def index_of(text: str) -> dict[int, int]:
    numbers, places = index(np.frombuffer(text.encode(), np.uint8))
    return dict(zip(numbers.tolist(), places.tolist(), strict=True))


def gathered(lines: dict[int, str]) -> tuple[bool, Any, Any, Any, Any]:
    text = np.frombuffer("".join(f"#{number}={line};\n" for number, line in lines.items()).encode(), np.uint8)
    is_read, *rest = gather(text, *index(text), np.array([1]))
    return is_read, *rest


def brep_of(*faces: list[list[tuple[object, ...]]]) -> dict[int, str]:
    """Write a brep; each face is its loops, each loop its corners."""
    lines = {1: "IFCFACETEDBREP(#2)"}
    number, written = 2, []
    for loops in faces:
        bounds = []
        for k, loop in enumerate(loops):
            points = []
            for corner in loop:
                number += 1
                lines[number] = f"{POINT}(({','.join(map(str, corner))}))"
                points.append(f"#{number}")
            number += 2
            lines[number - 1] = f"IFCPOLYLOOP(({','.join(points)}))"
            lines[number] = f"IFC{'FACEBOUND' if k else 'FACEOUTERBOUND'}(#{number - 1},.T.)"
            bounds.append(f"#{number}")
        number += 1
        lines[number] = f"IFCFACE(({','.join(bounds)}))"
        written.append(f"#{number}")
    lines[2] = f"IFCCLOSEDSHELL(({','.join(written)}))"
    return dict(sorted(lines.items()))


def prism(outline: list[tuple[float, float]], height: float, holes: tuple[list[tuple[float, float]], ...] = ()) -> Any:
    """Draw an upright prism; the outline runs counter-clockwise, holes clockwise."""
    rings = [outline, *holes]
    sides = [
        [[(*a, 0.0), (*b, 0.0), (*b, height), (*a, height)]] for ring in rings for a, b in pairwise([*ring, ring[0]])
    ]
    top = [[(*corner, height) for corner in ring] for ring in rings]
    bottom = [[(*corner, 0.0) for corner in ring[::-1]] for ring in rings]
    return [top, bottom, *sides]


def mesh_of(lines: dict[int, str], scale: float = 1.0) -> Mesh | None:
    class Item:
        def id(self) -> int:
            return 1

    text = "".join(f"#{number}={line};\n" for number, line in lines.items())
    return Facets(text.encode(), scale).read([Item()])


def volume_of(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_the_index_finds_entities_and_nothing_in_names_comments_and_the_header():
    text = "HEADER;FILE_NAME('#1=A;');ENDSEC;DATA;\n#2=B('it''s #3=C;',/* #4=D; */#5);# 6 \n=\tE();\r\n#007=F(#8);"
    found = index_of(text)
    assert [*found] == [2, 6, 7]
    assert [text[at:].lstrip()[0] for at in found.values()] == ["B", "E", "F"]


@settings(deadline=None)  # the first one waits for the compiler
@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12))
def test_coordinates_are_read_to_the_last_bits(value: float):
    lines = brep_of([[(repr(value), 0.0, 0.0), (1.5, 0.0, 0.0), (1.5, 7.25, 0.0)]])
    is_read, points, *_ = gathered(lines)
    assert is_read
    assert points[0, 0] == pytest.approx(value, rel=1e-15 if abs(value) > 1e-9 else 1e-14, abs=1e-99)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1.", 1.0), ("-.5", -0.5), ("+2.5E1", 25.0), ("0.1e-2", 0.001), ("12", 12.0), ("-0.", 0.0), (" 3. ", 3.0)],
)
def test_all_ways_to_write_a_number_are_understood(text: str, value: float):
    is_read, points, *_ = gathered(brep_of([[(text, "9.", "9."), ("8.", "9.", "9."), ("8.", "7.", "9.")]]))
    assert is_read
    assert points[0, 0] == value


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("IFCPOLYLOOP((#3,", "IFCPOLYLOOP(($,#3,"),
        ("IFCPOLYLOOP((#3,", "IFCPOLYLOOP((/* */#3,"),
        ("IFCPOLYLOOP((#3,", "IFCPOLYLOOP((#999,"),
        ("IFCPOLYLOOP((#3,", "IFCPOLYLOOP(((#3),"),
        ("IFCPOLYLOOP((#3,", "IFCEDGELOOP((#3,"),
        (f"{POINT}((0.0,0.0,1.0))", f"{POINT}((0.0,0.0))"),
        (f"{POINT}((0.0,0.0,1.0))", f"{POINT}((0.0,0.0,$))"),
        (f"{POINT}((0.0,0.0,1.0))", f"{POINT}((0.0,0.0,1.0,2.0))"),
        (f"{POINT}((0.0,0.0,1.0))", f"{POINT}((0.0,0.0,1.E400))"),
        (f"{POINT}((0.0,0.0,1.0))", f"{POINT}((0.0,0.0,'1.0'))"),
        (",.T.)", ",.U.)"),
        ("IFCFACE((", "IFCFACESURFACE(("),
        ("IFCCLOSEDSHELL", "IFCSHELL"),
        ("IFCFACETEDBREP(#2)", "IFCFACETEDBREP((#2))"),
    ],
)
def test_what_is_not_plainly_a_polyhedron_is_left_to_the_kernel(old: str, new: str):
    lines = brep_of(*prism([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 1.0))
    assert gathered(lines)[0]
    assert any(old in line for line in lines.values())
    assert not gathered({number: line.replace(old, new) for number, line in lines.items()})[0]


@pytest.mark.parametrize("number", [2, 10, 11, 12, 3])
def test_a_text_that_ends_anywhere_is_left_to_the_kernel(number: int):
    lines = brep_of(*prism([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 1.0))
    last = lines.pop(number)
    whole_text = "".join(f"#{k}={line};\n" for k, line in lines.items()) + f"#{number}={last}"
    for length in range(len(whole_text) - len(last), len(whole_text)):
        text = np.frombuffer(whole_text[:length].encode(), np.uint8)
        numbers, places = index(text)
        order = np.argsort(numbers)
        assert not gather(text, numbers[order], places[order], np.array([1]))[0]


def test_a_number_given_twice_leaves_all_to_the_kernel():
    lines = brep_of(*prism([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 1.0))
    assert mesh_of(lines) is not None
    assert mesh_of({**lines, 9999: "IFCWALL()\n;#3=IFCWALL()"}) is None


def test_a_body_longer_than_any_building_is_refused():
    with pytest.raises(GeometryError, match="m long"):
        mesh_of(brep_of(*prism([(0.0, 0.0), (1e6, 0.0), (0.0, 1.0)], 1.0)))


@settings(deadline=None)
@given(
    st.lists(st.floats(0.5, 2.0), min_size=4, max_size=40),
    st.sampled_from([1.0, 0.001, 0.3048]),
    st.booleans(),
)
def test_any_prism_is_closed_and_has_its_volume(radii: list[float], scale: float, has_hole: bool):
    angles = np.linspace(0, math.tau, len(radii), endpoint=False)
    outline = [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]
    hole = [(0.1, 0.1), (0.1, -0.1), (-0.1, -0.1), (-0.1, 0.1)]
    mesh = mesh_of(brep_of(*prism(outline, 3.0, (hole,) if has_hole else ())), scale)
    assert mesh is not None
    area = sum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise([*outline, outline[0]])) / 2 - 0.04 * has_hole
    assert whole(mesh).quality == "exact"
    assert volume_of(whole(mesh)) == pytest.approx(3 * area * scale**3, rel=1e-9)


def test_loops_that_close_twice_run_backward_or_touch_themselves_are_divided():
    outline = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 0.0), (0.0, 1.0)]  # touches its own side
    lines = brep_of(*prism([*outline, outline[0]], 1.0))
    backward = {number: line.replace(".T.", ".F.") for number, line in lines.items()}
    for mesh in (mesh_of(lines), mesh_of(backward)):
        assert mesh is not None
        assert whole(mesh).quality == "exact"
        assert volume_of(whole(mesh)) == pytest.approx(1.0, rel=1e-9)


def test_shells_that_touch_stay_apart():
    cube = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    lines = brep_of(*prism(cube, 1.0))
    moved = brep_of(*prism([(x + 1.0, y) for x, y in cube], 1.0))
    shift = {number + 5000: _shifted(line, 5000) for number, line in moved.items() if number > 1}
    both = {
        1: "IFCSHELLBASEDSURFACEMODEL((#2,#5002))",
        **{number: line for number, line in lines.items() if number > 1},
        **shift,
    }
    mesh = mesh_of(both)
    assert mesh is not None
    assert len(mesh.vertices) == 16
    assert volume_of(whole(mesh)) == pytest.approx(2.0)


def _shifted(line: str, by: int) -> str:
    head, *references = line.split("#")
    shifted = [head]
    for reference in references:
        digits = reference[: len(reference) - len(reference.lstrip("0123456789"))]
        shifted.append(f"#{int(digits) + by}{reference[len(digits) :]}")
    return "".join(shifted)


@pytest.mark.parametrize(
    "name",
    ["nasty/nested_mapped_item.ifc", "rooms/Standard_Classroom_CIC_6_Project_mod2.ifc", "houses/SampleHouse4.ifc"],
)
def test_real_bodies_are_as_the_kernel_makes_them(name: str):
    path = real_model(name)
    file = ifcopenshell.open(path)
    asked = [product for product in sorted_of(file, "IfcProduct") if product.Representation]
    solids, contexts, *_ = _sort_out(asked, left_out_by_class(file))
    scale = length_unit(file)[1]
    facets = Facets(path.read_bytes(), scale)
    ours = Tessellator(file, solids, contexts, lambda _: None, facets=facets, unit_scale=scale)
    theirs = Tessellator(file, solids, contexts, lambda _: None)
    products = [product for product in asked if product.id() in solids]
    read = ours._read_past(products)
    assert len(read) > 20
    kernel = theirs.read([product for product in products if product.id() in read])
    for step_id, reading in read.items():
        one, other = measures(ours.meshes, reading.shapes), measures(theirs.meshes, kernel[step_id].shapes)
        assert one[:6] == pytest.approx(other[:6], abs=1e-6)  # the box
        assert one[6:] == pytest.approx(other[6:], rel=1e-6, abs=1e-9)  # surface, and volume if closed


def measures(meshes: list[Mesh], shapes: list[tuple[int, Any]]) -> list[float]:
    made = [whole(meshes[index]) for index, _ in shapes]
    points = [
        mesh.vertices[mesh.faces] @ placement[:3, :3].T + placement[:3, 3]
        for mesh, (_, placement) in zip(made, shapes, strict=True)
    ]
    corners = np.concatenate(points)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = corners.mean(axis=(0, 1))
    volume = np.einsum("ij,ij->i", corners[:, 0] - middle, normals).sum() / 6
    is_closed = all(mesh.quality != "surface" for mesh in made)
    surface = float(np.linalg.norm(normals, axis=1).sum() / 2)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    return [*low, *high, surface, float(volume) if is_closed else 0.0]


def test_a_model_read_from_its_text_has_the_same_products_as_from_the_kernel_alone():
    path = real_model("rooms/Standard_Classroom_CIC_6_Project_mod2.ifc")
    ours = to_building(extract(ifcopenshell.open(path), path.read_bytes()))
    theirs = to_building(extract(ifcopenshell.open(path)))
    assert ours.ledger == theirs.ledger
    assert [issue.code for issue in ours.issues] == [issue.code for issue in theirs.issues]
