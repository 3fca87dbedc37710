"""Facts about public models, found by other means than ours: what is read must agree with them."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import pytest
import shapely

import bimnav as bn
from bimnav.errors import IfcSyntaxError
from bimnav.footprint import footprints_of, project, unite
from tests.conftest import real_model

DINING_TABLE = "3cUkl32yn9qRSPvBJVyZ$$"


@cache
def read(name: str) -> bn.Building:
    return bn.read_ifc(real_model(name))


def area_between(element: bn.Element, low: float, high: float) -> float:
    """Area of what lies between two heights above the underside of an element."""
    base = element.bounds[0, 2]
    parts = footprints_of(element.shapes, base + low, base + high)
    return unite(part.polygon for part in parts if part is not None).area


def area_from_above(element: bn.Element) -> float:
    return unite(project(shape).polygon for shape in element.shapes).area


def furniture(building: bn.Building) -> list[bn.Element]:
    return [element for element in building.elements if element.ifc_class.startswith("IfcFurn")]


@pytest.mark.parametrize(
    ("name", "pieces", "in_rooms"),
    [
        ("houses/SampleHouse4.ifc", 14, 14),
        ("duplex/Duplex_A_20110907.ifc", 61, 61),
        ("houses/231110AC11-FZK-Haus-IFC.ifc", 15, 15),
        ("rooms/Standard_Classroom_CIC_6_Project_mod2.ifc", 46, 46),
        ("rooms/tested_sample_project.ifc", 35, 0),
        ("rooms/3rooms_Heater_AirTerminal_Table_with_SB.ifc", 3, 0),
    ],
)
def test_furniture_that_sits_in_rooms_is_found_and_belongs_to_their_storey(name, pieces, in_rooms):
    found = furniture(read(name))
    assert len(found) == pieces
    assert sum(piece.space is not None for piece in found) == in_rooms
    assert all(piece.storey is not None for piece in found)


def test_a_person_that_hangs_in_the_building_belongs_to_no_storey_and_that_is_said():
    building = read("rooms/3rooms_Heater_AirTerminal_Table_with_SB.ifc")
    [person] = [e for e in building.elements if e.storey is None and e.shapes]
    assert person.ifc_class == "IfcBuildingElementProxy"
    assert [issue.global_ids for issue in building.issues if issue.code == "outside-storeys"] == [(person.global_id,)]


def test_a_low_robot_meets_the_legs_of_a_dining_table_and_not_its_top():
    table = read("houses/SampleHouse4.ifc")[DINING_TABLE]
    assert area_from_above(table) == pytest.approx(2.0, abs=1e-4)
    assert area_between(table, 0.05, 0.10) == pytest.approx(0.0225, abs=1e-6)
    assert area_between(table, 0.05, 0.60) == pytest.approx(0.1071, abs=1e-4)  # the legs lean outward


def test_a_dining_chair_stands_on_thin_legs_as_well():
    chairs = [piece for piece in furniture(read("houses/SampleHouse4.ifc")) if piece.name.startswith("Chair - Dining")]
    assert len(chairs) == 6
    for chair in chairs:
        assert area_from_above(chair) == pytest.approx(0.155, abs=1e-3)
        assert area_between(chair, 0.05, 0.10) == pytest.approx(0.0047, abs=1e-4)


def test_counter_tops_lie_high_and_upper_cabinets_hang():
    duplex = read("duplex/Duplex_A_20110907.ifc")
    counters = [piece for piece in furniture(duplex) if "Counter Top" in piece.name]
    cabinets = [piece for piece in furniture(duplex) if "Upper Cabinet" in piece.name]
    assert [piece.bounds[0, 2].round(3) for piece in counters] == [0.86] * 6
    assert [piece.bounds[0, 2].round(3) for piece in cabinets] == [1.4] * 8
    fzk = furniture(read("houses/231110AC11-FZK-Haus-IFC.ifc"))
    above_floor = [piece.bounds[0, 2] - (2.7 if piece.bounds[0, 2] > 2 else 0.0) for piece in fzk]
    assert max(above_floor) < 0.3


@pytest.mark.parametrize(
    "name",
    [
        "houses/SampleHouse4.ifc",
        "duplex/Duplex_A_20110907.ifc",
        "houses/231110AC11-FZK-Haus-IFC.ifc",
        "office/Office_A_20110811.ifc",
        "nasty/House.ifc",
        "nasty/Jesse.1.ifc",
    ],
)
def test_every_door_is_a_closed_leaf(name):
    for door in read(name).doors:
        plan = unite(project(shape).polygon for shape in door.element.shapes)
        corners = np.array(shapely.oriented_envelope(plan).exterior.coords)[:3]
        along = max(np.diff(corners, axis=0), key=np.linalg.norm)
        width = np.linalg.norm(along)
        ends = [shapely.get_coordinates(part) @ (along / width) for part in shapely.get_parts(plan)]
        covered = unite(shapely.box(end.min(), 0, end.max(), 1) for end in ends).area
        assert covered / width > 0.97


def test_the_slabs_of_the_office_are_landings_of_its_stairs():
    office = read("office/Office_A_20110811.ifc")
    slabs = [element for element in office.elements if element.ifc_class == "IfcSlab"]
    assert [slab.predefined_type for slab in slabs] == ["LANDING", "LANDING"]
    assert {office[slab.parent].ifc_class for slab in slabs} == {"IfcStair"}
    floor = bn.make_environment(office, bn.Task("look"))
    assert {region.source for region in floor.regions if region.storey == 0} <= {"space", "door", "passage", "landing"}


def test_finish_floors_of_the_duplex_lie_on_its_structural_slabs():
    duplex = read("duplex/Duplex_A_20110907.ifc")
    slabs = [element.bounds[:, 2].round(3) for element in duplex.elements if element.ifc_class == "IfcSlab"]
    assert {top - bottom for bottom, top in slabs if bottom == 0} == {0.013, 0.019}
    assert Counter(space.bounds[0, 2].round(3) for space in duplex.spaces) == {
        0.013: 4,
        0.019: 6,
        3.113: 4,
        3.119: 6,
        6.0: 1,
    }


def test_three_levels_in_one_storey_are_three_levels():
    heating = read("mep/b03_heating_with_building_blenderBIM.ifc")
    assert [storey.elevation for storey in heating.storeys] == [0.0]
    environment = bn.make_environment(heating, bn.Task("look"))
    assert environment.levels == pytest.approx((-4.0, 0.115, 3.34), abs=1e-3)


def test_terrain_and_markers_do_not_stretch_the_floor():
    fzk = read("houses/231110AC11-FZK-Haus-IFC.ifc")
    [site] = fzk.terrain
    assert site.bounds[:, 0] == pytest.approx([-3.0, 15.0])
    markers = read("georef/building-architecture.ifc")
    assert min(e.bounds[0, 0] for e in markers.elements if e.shapes) == pytest.approx(-29.64, abs=0.01)
    for building, low, high in ((fzk, -0.5, 12.5), (markers, 3.0, 8.6)):
        regions = bn.make_environment(building, bn.Task("look")).regions
        west, _, east, _ = shapely.total_bounds([region.polygon for region in regions])
        assert low - 0.01 <= west < east <= high + 0.01


def test_a_file_that_loses_all_but_seven_entities_is_refused_at_the_line_that_breaks_it():
    with pytest.raises(IfcSyntaxError, match=r"errorfile\.ifc cannot be parsed after #14") as caught:
        bn.read_ifc(real_model("nasty/errorfile.ifc"))
    assert caught.value.context["line"] == 15
