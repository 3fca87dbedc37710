"""Several files of one building: what is one product, what lies where, and what each file answers."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav import Building, Connector, Door, Element, Issue, Ledger, Space, Storey
from bimnav._georeference import Georeference
from bimnav.errors import FileMissingError, InputError, SelectorError, ValueRangeError
from bimnav.ifc import read_ifc
from bimnav.ifc._federate import federate
from bimnav.ifc._frames import extent_of, moved
from bimnav.testing import box, prism_shape, room, two_rooms
from tests.conftest import real_model
from tests.ifc_text import FRAME, box as text_box, model

GROUND = (Storey("storey", "Ground floor", 0.0),)


def part(name: str, *elements: Element, storeys: tuple[Storey, ...] = GROUND, **more: object) -> Building:
    return Building(name, storeys, elements=elements, **more)


def codes(building: Building) -> set[str]:
    return {issue.code for issue in building.issues}


def issue_of(building: Building, code: str) -> Issue:
    [issue] = [issue for issue in building.issues if issue.code == code]
    return issue


def rectangle(global_id: str, x0: float, y0: float, x1: float, y1: float, high: float = 2.5) -> Space:
    return Space(global_id, global_id, storey="storey", shapes=(prism_shape(shapely.box(x0, y0, x1, y1), 0.0, high),))


def placement_of(x: float, y: float, z: float, turn: float = 0.0) -> np.ndarray:
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


# products


def test_a_product_of_several_files_is_one():
    drawn = part("drawn", box("chair", 0, 0, 0, 1, 1, 1, ifc_class="IfcFurnishingElement"))
    listed = part("listed", Element("chair", "IfcFurniture", "seat", tag="17"), Element("lamp", "IfcLamp"))
    joined = federate([drawn, listed])
    assert [element.global_id for element in joined] == ["chair", "lamp"]
    chair = joined["chair"]
    assert (chair.ifc_class, chair.name, chair.tag) == ("IfcFurnishingElement", "chair", "17")
    assert chair.shapes == drawn["chair"].shapes


def test_a_file_without_geometry_comes_after_the_others():
    drawn = part("drawn", box("chair", 0, 0, 0, 1, 1, 1), storeys=(Storey("storey", "Ground floor", 3.1),))
    listed = part("listed", Element("chair", "IfcFurniture", "seat"), storeys=(Storey("storey", "EG", 0.0031),))
    joined = federate([listed, drawn])
    assert joined["chair"].name == "chair"
    assert joined.storeys == drawn.storeys
    assert issue_of(joined, "storey-heights").severity == "info"


def test_a_shape_lost_in_one_file_comes_from_another():
    ledger = Ledger(("chair", "desk"), lost={"chair": "crashed", "desk": "crashed"})
    said = Issue("lost-shape", "2 products are lost.", ("chair", "desk"), "error")
    stump = box("chair", 0, 0, 0, 1, 1, 0.1)
    bed = box("bed", 4, 0, 0, 6, 1, 1)
    first = part("first", stump, Element("desk", "IfcDesk"), bed, ledger=ledger, issues=(said,))
    other = part("other", box("chair", 0, 0, 0, 1, 1, 1))
    joined = federate([first, other])
    assert joined["chair"].bounds[1, 2] == 1.0
    assert joined.ledger.lost == {"desk": "crashed"}
    assert "lost-shape" in codes(joined)
    assert "lost-shape" not in codes(federate([joined, part("third", box("desk", 2, 0, 0, 3, 1, 1))]))


def test_the_ledger_closes_over_all_files():
    first = part("a", ledger=Ledger(("1", "2", "3"), left_out={"2": "no-body"}, lost={"3": "crashed"}))
    other = part("b", ledger=Ledger(("2", "3", "4"), left_out={"3": "no-body"}, lost={"4": "stalled"}))
    ledger = federate([first, other]).ledger
    assert ledger.asked == ("1", "2", "3", "4")
    assert ledger.read == ("1", "2")
    assert (ledger.lost, ledger.left_out) == ({"3": "crashed", "4": "stalled"}, {})


def test_doors_are_measured_among_the_rooms_of_all_files():
    whole = two_rooms()
    unmeasured = tuple(replace(door, clear_width=None, sill=None, spaces=()) for door in whole.doors)
    walls = replace(whole, name="walls", spaces=(), doors=unmeasured)
    rooms = replace(whole, name="rooms", elements=(), doors=(), openings=())
    assert walls.doors[0].spaces == ()
    assert federate([walls, rooms]).doors[0].spaces == ("space-west", "space-east")
    listed = replace(whole, name="list", spaces=(), elements=(Element("door", "IfcDoor"),), openings=())
    listed = replace(listed, doors=(Door(listed.elements[0], width=99.0),))
    [door] = federate([listed, walls]).doors
    assert (door.element.shapes, door.opening, door.width) == (walls["door"].shapes, walls.openings[0], 0.9)


def test_a_product_of_another_kind_with_the_same_id_is_left_out_and_said():
    joined = federate([room(), part("other", box("space", 0, 0, 0, 1, 1, 1), box("desk", 0, 0, 0, 1, 1, 1))])
    assert "space" not in joined
    assert "desk" in joined
    assert issue_of(joined, "global-id-clash").global_ids == ("space",)


def test_what_one_file_lacks_is_no_issue_if_another_has_it():
    lacking = (Issue("no-spaces", "the file has no rooms."), Issue("no-shape", "1 elements", ("chair",)))
    bare = part("bare", Element("chair", "IfcChair"), issues=(*lacking, Issue("parser-log", "the parser said.")))
    joined = federate([room(elements=[box("chair", 1, 1, 0, 2, 2, 1)]), bare])
    assert codes(joined).isdisjoint({"no-spaces", "no-shape"})
    assert issue_of(joined, "parser-log").message == "bare: the parser said."


# storeys and spaces


def test_storeys_are_one_by_id_or_by_name_and_height():
    first = part("a", storeys=(Storey("g", "Level 1", 0.0), Storey("u", "Level 2", 3.1)))
    storeys = (Storey("x", "level 1 ", 0.004), Storey("u", "Upper", 3.1), Storey("z", "Level 2", 3.3))
    pipes = [box(name, 0, 0, 0, 1, 1, 1) for name in ("p", "q", "r")]
    pipes = [replace(pipe, storey=storey.global_id) for pipe, storey in zip(pipes, storeys, strict=True)]
    joined = federate([replace(first, elements=(box("w", 0, 0, 0, 1, 1, 1),)), part("b", *pipes, storeys=storeys)])
    assert [storey.global_id for storey in joined.storeys] == ["g", "u", "z"]
    assert [joined[name].storey for name in ("p", "q", "r")] == ["g", "u", "z"]
    assert issue_of(joined, "separate-storey").global_ids == ("z",)


def test_a_storey_is_known_by_all_ids_it_has_in_any_file():
    first = part("a", box("w", 0, 0, 0, 1, 1, 1), storeys=(Storey("g", "Level 1", 0.0),))
    other = part("b", box("p", 0, 0, 0, 1, 1, 1), storeys=(Storey("x", "Level 1", 0.0),))
    listed = part("c", Element("w", "IfcWall", storey="x"), storeys=(Storey("x", "EG", 0.0),))
    assert [storey.global_id for storey in federate([first, other, listed]).storeys] == ["g"]


def test_a_storey_that_was_made_up_gives_way_to_real_ones():
    made_up = (Storey("derived", "derived", -0.4),)
    pipe = replace(box("pipe", 0, 0, -0.4, 1, 1, 0), storey="derived")
    services = part("services", pipe, storeys=made_up, issues=(Issue("no-storeys", "one was made."),))
    joined = federate([services, room()])
    assert [storey.global_id for storey in joined.storeys] == ["storey"]
    assert joined["pipe"].storey is None


@pytest.mark.parametrize(
    ("drawn", "same"),
    [
        ((-0.1, -0.1, 5.1, 4.1), True),  # to the middle of the walls
        ((0.1, 0.0, 5.0, 4.0), True),
        ((0.0, 0.0, 20.0, 4.0), False),  # a zone of many rooms
        ((0.0, 0.0, 1.0, 1.0), False),  # a closet in the room
        ((1.0, 0.0, 6.0, 4.0), False),
    ],
)
def test_a_space_drawn_twice_counts_once(drawn, same):
    fan = replace(box("fan", 1, 1, 2, 2, 2, 2.4), space="other")
    other = Building("services", GROUND, (rectangle("other", *drawn),), (fan,))
    joined = federate([room(), other])
    assert [space.global_id for space in joined.spaces] == (["space"] if same else ["space", "other"])
    assert joined["fan"].space == ("space" if same else "other")
    assert ("same-space" in codes(joined)) == same


def test_a_space_that_was_left_out_stays_out_under_its_id():
    services = Building("services", GROUND, (rectangle("other", 0, 0, 5, 4),), ledger=Ledger(("other",)))
    joined = federate([room(), services, Building("list", GROUND, (Space("other", "101"),))])
    assert [space.global_id for space in joined.spaces] == ["space"]
    assert joined.ledger.left_out == {"other": "same-space"}


def test_rooms_one_above_the_other_are_two():
    above = Space("above", "above", shapes=(prism_shape(shapely.box(0, 0, 5, 4), 2.5, 5.0),))
    assert len(federate([room(), Building("upper", GROUND, (above,))]).spaces) == 2


# frames


angles = st.sampled_from([0.0, 0.3, -2.0, math.pi / 2, math.pi])
shifts = st.floats(-1e5, 1e5, allow_nan=False)


@settings(deadline=None, max_examples=30)
@given(x=shifts, y=shifts, z=st.floats(-50, 50, allow_nan=False), turn=angles)
def test_a_copy_that_was_moved_comes_back(x, y, z, turn):
    stair = Connector("stair", "stair", "stair", ("chair",), 0.0, 1.0)
    original = room(elements=[box("chair", 1, 1, 0, 2, 1.5, 1)])
    original = replace(original, anchors={"site": placement_of(3, 4, 5, 0.1)}, connectors=(stair,))
    copy = moved(original, placement_of(x, y, z, turn))
    joined = federate([original, replace(copy, name="copy", connectors=(replace(copy.connectors[0], global_id="s"),))])
    for element in original:
        np.testing.assert_allclose(joined[element.global_id].bounds, element.bounds, atol=1e-6)
    assert len(joined.elements) == len(original.elements)
    assert len(joined.spaces) == 1
    assert joined.connectors[1].high == pytest.approx(1.0, abs=0.01)
    assert len(joined.storeys) == 1
    assert "moved-product" not in codes(joined)
    assert ("federated-offset" in codes(joined)) == (max(abs(x), abs(y), abs(z)) > 0.01 or turn != 0)


def test_products_that_both_files_hold_tell_the_offset():
    walls = part("walls", *(box(name, 0, y, 0, 5, y + 0.2, 3) for name, y in [("a", 0), ("b", 4), ("c", 8)]))
    copies = moved(walls, placement_of(100, 0, 7)).elements
    joined = federate([walls, part("pipes", *copies, box("p", 101, 1, 9, 102, 2, 10))])
    np.testing.assert_allclose(joined["p"].bounds, [[1, 1, 2], [2, 2, 3]])
    issue = issue_of(joined, "federated-offset")
    assert "(-100.000, 0.000, -7.000) m, as products" in issue.message
    assert (issue.global_ids, issue.severity) == (("a", "b", "c"), "warning")


def test_a_chair_that_was_moved_does_not_move_the_building():
    first = part("old", box("chair", 0, 0, 0, 1, 1, 1), box("wall", 0, 5, 0, 9, 5.2, 3))
    joined = federate([first, part("new", box("chair", 3, 0, 0, 4, 1, 1), box("pipe", 1, 2, 0, 2, 3, 1))])
    assert joined["pipe"].bounds[0, 0] == 1.0
    assert issue_of(joined, "moved-product").global_ids == ("chair",)


def test_a_product_that_was_redrawn_moves_nothing():
    first = part("old", box("a", 0, 0, 0, 5, 1, 3), box("b", 0, 4, 0, 5, 5, 3), box("c", 8, 0, 0, 9, 1, 3))
    other = part("new", *first.elements[:2], box("c", 12, 0, 0, 13, 1, 3), box("d", 3, 0, 0, 4, 1, 9))
    joined = federate([first, other])
    assert joined["d"].bounds[0, 0] == 3.0
    assert joined["c"].bounds[0, 0] == 8.0
    assert issue_of(joined, "moved-product").global_ids == ("c",)


def test_placements_of_the_same_site_tell_turn_and_offset():
    turn = placement_of(1000, 2000, 50, math.radians(30))
    services = replace(moved(part("pipes", box("pipe", 1, 1, 0, 2, 3, 1)), turn), anchors={"site": turn})
    joined = federate([replace(room(), anchors={"site": np.eye(4)}), services])
    np.testing.assert_allclose(joined["pipe"].bounds, [[1, 1, 0], [2, 3, 1]], atol=1e-9)
    assert "after a turn by -30.0000 degrees" in issue_of(joined, "federated-offset").message
    unsure = replace(services, anchors={"site": turn, "storey": np.eye(4)})
    apart = federate([replace(room(), anchors={"site": np.eye(4), "storey": np.eye(4)}), unsure])
    assert "federated-apart" in codes(apart)


def test_map_coordinates_tell_turn_and_offset_unless_they_tear_apart_what_lies_together():
    here = Georeference(5e5, 5.4e6, 100.0, 0.6, 0.8, epsg=25832)
    turn = placement_of(1000, 2000, 50, 0.5)
    pipe = part("pipes", box("pipe", 1, 1, 0, 2, 3, 1), georeference=here)
    joined = federate([replace(room(), georeference=here), moved(pipe, turn)])
    np.testing.assert_allclose(joined["pipe"].bounds, [[1, 1, 0], [2, 3, 1]], atol=1e-6)
    assert "map coordinates" in issue_of(joined, "federated-offset").message
    stale = replace(pipe, georeference=replace(here, eastings=4e5))
    joined = federate([replace(room(), georeference=here), stale])
    np.testing.assert_array_equal(joined["pipe"].bounds, [[1, 1, 0], [2, 3, 1]])
    assert "100000" in issue_of(joined, "georeference-differs").message
    elsewhere = replace(pipe, georeference=replace(here, eastings=4e5, epsg=25833))
    assert codes(federate([replace(room(), georeference=here), elsewhere])).isdisjoint(
        {"federated-offset", "georeference-differs"}
    )


def test_storeys_of_the_same_names_tell_how_much_higher_a_file_lies():
    levels = [("G", 0.0), ("1", 3.0), ("2", 6.5)]
    low = part("low", box("w", 0, 0, 0, 5, 1, 3), storeys=tuple(Storey(f"a{n}", n, z) for n, z in levels))
    high = part("high", box("p", 0, 0, 103, 1, 1, 104), storeys=tuple(Storey(f"b{n}", n, z + 100) for n, z in levels))
    joined = federate([low, high])
    assert joined["p"].bounds[0, 2] == pytest.approx(3.0)
    assert len(joined.storeys) == 3
    assert issue_of(joined, "federated-offset").global_ids == ("bG", "b1", "b2")
    uneven = replace(high, storeys=(*high.storeys[:2], Storey("b2", "2", 106.0)))
    assert "federated-offset" not in codes(federate([low, uneven]))
    assert len(federate([low, uneven]).storeys) == 6


def test_an_offset_that_is_stated_wins():
    pipes = part("pipes", box("chair", 100, 0, 0, 101, 1, 1), box("pipe", 103, 0, 0, 104, 1, 1))
    house = room(elements=[box("chair", 1, 1, 0, 2, 2, 1)])
    joined = federate([house, pipes], offsets=[None, (-101.0, 0.0, 0.5)])
    np.testing.assert_array_equal(joined["pipe"].bounds, [[2, 0, 0.5], [3, 1, 1.5]])
    assert issue_of(joined, "federated-offset").severity == "info"
    alone = federate([house], offsets=[(10, 20, 30)])
    np.testing.assert_allclose(extent_of(alone), extent_of(house) + np.array([10, 20, 30]))
    assert (alone.storeys[0].elevation, alone.detections) == (30.0, ())


def test_targets_and_map_move_with_their_model():
    here = Georeference(5e5, 5.4e6, epsg=25832)
    house = replace(room().with_targets([("spill", 1.0, 2.0)]), georeference=here)
    joined = federate([house], offsets=[(10, 20, 30)])
    assert (joined.detections[0].x, joined.detections[0].z) == (11.0, None)
    np.testing.assert_allclose(joined.georeference.to_map([(11.0, 22.0, 30.0)]), [(500001.0, 5400002.0, 0.0)])


@pytest.mark.parametrize("offsets", [[], [None], [(0, 0), None], [(0, 0, math.nan), None]])
def test_offsets_that_do_not_fit_are_refused(offsets):
    with pytest.raises(ValueRangeError, match="offset"):
        federate([room(), room()], offsets=offsets)
    with pytest.raises(ValueRangeError):
        federate([])


# what the files answer


def reader(sets: dict[str, dict[str, object]]):
    return lambda global_id: sets if global_id == "chair" else {}


def test_property_sets_of_all_files_are_listed_and_the_first_file_holds():
    chair = box("chair", 0, 0, 0, 1, 1, 1)
    first = part("a", chair, sources=("a.ifc",), property_reader=reader({"P": {"x": 1}, "Q": {"y": 2}}))
    other = part("b", chair, sources=("b.ifc",), property_reader=reader({"P": {"x": 9, "z": 3}, "R": {"w": 4}}))
    joined = federate([first, other])
    assert joined.properties("chair") == {"P": {"x": 1, "z": 3}, "Q": {"y": 2}, "R": {"w": 4}}
    assert joined.properties_by_source("chair")["b.ifc"] == {"P": {"x": 9, "z": 3}, "R": {"w": 4}}
    assert joined.properties_by_source("wall") == {}
    assert joined.sources == ("a.ifc", "b.ifc")
    assert federate([joined, room()]).properties_by_source("chair").keys() == {"a.ifc", "b.ifc"}
    assert first.properties_by_source("chair") == {"a.ifc": {"P": {"x": 1}, "Q": {"y": 2}}}


@pytest.fixture
def two_files(tmp_path: Path) -> tuple[Path, Path]:
    """Architecture in IFC2X3 and its surroundings in IFC4, of one site."""
    tree = text_box(300, "tree", "IFCGEOGRAPHICELEMENT")
    paths = tmp_path / "house.ifc", tmp_path / "garden.ifc"
    origin = ["#12=IFCAXIS2PLACEMENT2D(#13,$);", "#13=IFCCARTESIANPOINT((0.,0.));"]  # IFC2X3 requires them
    house = model(text_box(200, "wall", "IFCWALL"), origin, schema="IFC2X3")
    paths[0].write_text(house.replace("(#11,$,", "(#11,#5,").replace("(.AREA.,$,$,", "(.AREA.,$,#12,"))
    paths[1].write_text(model(tree, frame=[line.replace("'house'", "'garden'") for line in FRAME]))
    return paths


def test_each_file_answers_in_its_own_schema(two_files):
    building = read_ifc(two_files, cache=False, isolate=False)
    assert [element.name for element in building.select("IfcGeographicElement")] == ["tree"]
    assert {element.name for element in building.select("IfcElement")} == {"box", "wall", "tree"}
    assert building.schema == "IFC2X3, IFC4"
    with pytest.raises(SelectorError, match="IfcWal "):
        building.select("IfcWal")
    with pytest.raises(SelectorError, match="does not have"):
        building.select("IfcFacility")


def test_files_are_given_one_by_one_or_as_a_list(two_files):
    one, other = read_ifc(*two_files, cache=False, isolate=False), read_ifc(list(two_files), cache=False, isolate=False)
    assert [e.global_id for e in one] == [e.global_id for e in other]
    assert one.sources == other.sources == tuple(map(str, two_files))
    assert one.name == "house"
    assert len(one.storeys) == 1
    assert set(one.anchors) == {"0000000000000000000002"}
    lifted = read_ifc(*two_files, offsets=[None, (0, 0, 2)], cache=False, isolate=False)
    assert lifted.select("IfcGeographicElement")[0].bounds[0, 2] == pytest.approx(2.0)


def test_terrain_moves_with_its_file_and_is_joined_by_its_global_id(tmp_path: Path):
    house, garden = tmp_path / "house.ifc", tmp_path / "garden.ifc"
    house.write_text(model(text_box(300, "site", "IFCSITE")))
    garden.write_text(model(text_box(300, "site", "IFCSITE"), text_box(400, "hill", "IFCSITE")))
    building = read_ifc(house, garden, offsets=[None, (0, 0, 2)], cache=False, isolate=False)
    assert {each.name: each.bounds[0, 2] for each in building.terrain} == {"site": 0.0, "hill": 2.0}
    assert set(building.ledger.left_out.values()) == {"site"}


def test_all_files_are_looked_for_before_any_is_read(two_files, tmp_path):
    told = []
    with pytest.raises(FileMissingError, match="nowhere"):
        read_ifc(two_files[0], tmp_path / "nowhere.ifc", progress=lambda *beat: told.append(beat))
    with pytest.raises(ValueRangeError, match="offsets"):
        read_ifc(*two_files, offsets=[None], progress=lambda *beat: told.append(beat))
    with pytest.raises(InputError, match="no file"):
        read_ifc([])
    assert told == []


def test_a_joined_building_crosses_to_another_process(two_files):
    import pickle

    building = pickle.loads(pickle.dumps(read_ifc(two_files, cache=False, isolate=False)))
    assert len(building.select("IfcWall")) == 1


def test_one_flat_in_three_schemas_and_units_is_one_flat():
    names = ("apartment", "apartment_ifc2x3_mm", "apartment_ifc4x3_m")
    flats = [read_ifc(bn.sample(name), isolate=False, cache=False) for name in names]
    joined = federate(flats)
    assert len(joined.elements) == len(flats[0].elements)
    assert len(joined.spaces) == len(flats[0].spaces)
    assert [storey.name for storey in joined.storeys] == [storey.name for storey in flats[0].storeys]
    assert joined.ledger == flats[0].ledger
    assert codes(joined).isdisjoint({"federated-offset", "moved-product", "same-space", "separate-storey"})
    assert [door.sill for door in joined.doors] == [door.sill for door in flats[0].doors]


# real models


@pytest.fixture(scope="module")
def duplex() -> tuple[Building, ...]:
    names = ("Duplex_A_20110907", "Ifc2s3_Duplex_Electrical", "2012-03-23-Duplex-Handover")
    return tuple(read_ifc(real_model(f"duplex/{name}.ifc"), cache=False) for name in names)


SIDE_TABLE = "2kvhekJrnDjRw0CDkKW$KL"


def test_the_files_of_the_duplex_share_products(duplex):
    ids = [{*part.anchors, *(product.global_id for product in (*part.elements, *part.spaces))} for part in duplex]
    listed = Path(duplex[2].sources[0]).read_text("latin-1")
    ids[2].update(re.findall(r"IFC(?:SITE|BUILDING|BUILDINGSTOREY)\('(.{22})'", listed))  # they have no placement there
    assert [len(ids[k] & ids[2]) for k in (0, 1)] == [126, 86]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2)])
def test_the_files_of_the_duplex_are_one_building(duplex, order):
    building = federate([duplex[k] for k in order])
    architecture, electrical, _ = duplex
    assert [(s.name, round(s.elevation, 3)) for s in building.storeys] == [
        ("T/FDN", -1.25),
        ("Level 1", 0.0),
        ("Level 2", 3.1),
        ("Roof", 6.0),
    ]
    assert codes(building).isdisjoint({"federated-offset", "federated-apart", "moved-product", "global-id-clash"})
    shaped = {e.global_id for e in (*architecture, *electrical) if e.shapes}
    assert shaped == {e.global_id for e in building if e.shapes}
    assert set(building.ledger.asked) == {*architecture.ledger.asked, *electrical.ledger.asked}
    assert len(building.ledger.read) == len(building.ledger.asked) - 1
    assert len(building.spaces) == 22  # 21 drawn rooms, and the site that the list calls a space
    known = {storey.global_id for storey in building.storeys}
    assert {element.storey for element in building} <= {*known, None}


def test_the_electrical_model_of_the_duplex_in_feet_lies_inside_the_architecture_in_metres(duplex):
    outer, inner = (extent_of(replace(part, spaces=())) for part in duplex[:2])
    assert (outer[0] <= inner[0] + 0.01).all()
    assert (inner[1] <= outer[1] + 0.2).all()  # a lamp on the roof


def test_a_side_table_is_drawn_in_one_file_and_described_in_another(duplex):
    building = federate(duplex)
    np.testing.assert_allclose(building[SIDE_TABLE].bounds[0], [3.425, -17.279, 3.119], atol=1e-3)
    assert building.properties(SIDE_TABLE)["Pset_Component"]["SerialNumber"] == "GH468642"
    sources = building.properties_by_source(SIDE_TABLE)
    assert [Path(source).name[:4] for source in sources] == ["Dupl", "2012"]
    [found] = building.select("IfcElement, Pset_Component.SerialNumber=GH468642")
    assert found is building[SIDE_TABLE]
