"""Queries: the small language of buildings written by hand, and the real one with its silences broken."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import pytest

from bimnav._select import select_by_hand
from bimnav.building import Building, Element, Facts, Space, Storey
from bimnav.errors import FileMissingError, InputError, SelectorError
from bimnav.ifc import _query, _select, read_ifc
from bimnav.ifc._federate import federate
from tests.conftest import real_model
from tests.ifc_text import box, model

ROOM = (
    Element("table", "IfcFurniture", "Round table:90 cm", type_name="90 cm", predefined_type="TABLE"),
    Element("chair", "IfcFurniture", "Chair", object_type='the "good" one'),
    Element("wall", "IfcWall", "North", tag="17"),
    Space("room", "1", long_name="Kitchen"),
)


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("IfcFurniture", "table chair"),
        ("IfcWall, IfcSpace", "wall room"),
        ("IfcElement", "table chair wall"),
        ("IfcProduct", "table chair wall room"),
        ("! IfcFurniture", "wall room"),
        ("IfcElement, !IfcWall", "table chair"),
        ("Name=Chair", "chair"),
        ('Name="Round table:90 cm"', "table"),
        ("IfcFurniture, Name=/.*table.*/", "table"),
        ("Name=/table/", ""),
        ("Name *= able", "table"),
        ("IfcElement, Name!=/.*a.*/", "wall"),
        ("IfcElement, Name!*=a", "wall"),
        ("type=/90.*/", "table"),
        ("PredefinedType=TABLE", "table"),
        ("IfcElement, PredefinedType=NULL", "chair wall"),
        ("Tag=17", "wall"),
        ("LongName=Kitchen", "room"),
        (r'ObjectType="the \"good\" one"', "chair"),
        ("IfcWall + Name=Chair", "chair wall"),
        ("IfcFurniture, Name=Chair + IfcSpace", "chair room"),
        ("IfcDoor", ""),
    ],
)
def test_a_building_written_by_hand_answers_a_small_language(query: str, found: str):
    assert select_by_hand(ROOM, query) == tuple(found.split())


@pytest.mark.parametrize(
    ("query", "column"),
    [
        ("", 1),
        ("IfcWall,", 9),
        ("IfcWall,, IfcDoor", 9),
        ("Pset_WallCommon.IsExternal=TRUE", 1),
        ("IfcWall, material=Wood", 10),
        ('query:"a.b"=c', 1),
        ("Name>3", 1),
        ("IfcWall Name=a", 1),
        ("Name=/[/", 7),
    ],
)
def test_what_that_language_does_not_know_is_refused_with_its_column(query: str, column: int):
    with pytest.raises(SelectorError) as caught:
        select_by_hand(ROOM, query)
    assert caught.value.context["column"] == column
    assert repr(query) in str(caught.value)
    assert caught.value.hint


def test_a_building_uses_it():
    building = Building("hut", (Storey("s", "ground", 0.0),), elements=ROOM[:3], spaces=ROOM[3:])
    assert [product.global_id for product in building.select("IfcWall, IfcSpace")] == ["wall", "room"]


# models


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Building:
    """Two boxes, a wall with a property set and an opening, a space, and two pieces of furniture with one GlobalId."""
    path = tmp_path_factory.mktemp("house") / "house.ifc"
    twin = [line.replace("0000000000000000000500", "0000000000000000000400") for line in box(500, "b", "IFCFURNITURE")]
    path.write_text(
        model(
            box(200, "Wall", "IFCWALL"),
            box(300, "hole", "IFCOPENINGELEMENT"),
            box(400, "a", "IFCFURNITURE"),
            twin,
            "#600=IFCRELVOIDSELEMENT('0000000000000000000600',$,$,$,#200,#300);",
            "#700=IFCPROPERTYSET('0000000000000000000700',$,'Pset_WallCommon',$,(#701,#702));",
            "#701=IFCPROPERTYSINGLEVALUE('FireRating',$,IFCLABEL('F90'),$);",
            "#702=IFCPROPERTYSINGLEVALUE('Thickness',$,IFCREAL(0.5),$);",
            "#703=IFCRELDEFINESBYPROPERTIES('0000000000000000000703',$,$,$,(#200),#700);",
            "#704=IFCWALLTYPE('0000000000000000000704',$,'Wall',$,$,$,$,$,$,.STANDARD.);",
        )
    )
    return read_ifc(path, cache=False, isolate=False)


def picked(house: Building, query: str) -> list[str]:
    return [product.name for product in house.select(query)]


def test_types_and_voids_are_never_picked(house: Building):
    assert picked(house, "IfcElement") == ["box", "Wall", "a", "b"]
    assert picked(house, "Name=Wall") == ["Wall"]
    assert picked(house, "IfcOpeningElement") == []
    assert picked(house, "! IfcWall") == ["box", "a", "b"]
    assert picked(house, "IfcElement, ! IfcWall, Name=a + IfcWall") == ["Wall", "a"]


def test_two_products_with_one_global_id_are_told_apart(house: Building):
    ids = [product.global_id for product in house.select("IfcFurniture")]
    assert len(set(ids)) == 2
    assert picked(house, "IfcFurniture, Name=b") == ["b"]
    assert picked(house, ids[1]) == ["b"]


def test_properties_are_plain_values(house: Building):
    [wall] = house.select("Pset_WallCommon.FireRating=F90")
    assert house.properties(wall.global_id) == {"Pset_WallCommon": {"FireRating": "F90", "Thickness": 0.5}}
    assert house.properties(house.elements[0].global_id) == {}
    assert house.properties("nobody") == {}


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("IfcFurnitur", ("IfcFurnitur", "Did you mean IfcFurniture?", "column 1")),
        ("IfcWall, IfcDor", ("Did you mean IfcDoor?", "column 10")),
        ("IfcWallType", ("no class of products",)),
        ("IfcTask", ("no class of products",)),
        ("IfcEquipmentElement", ("IFC4 does not have",)),
        ('query:system.Name="x"', ("quotes", "query:")),
        ("IfcWall, Nmae=x", ("Nmae", "Did you mean Name?", "column 10")),
        ("IfcWall,,", ("cannot be parsed", "column 9")),
        ("IfcWall,", ("cannot be parsed", "column 9")),
        ("! PredefinedType=SOFA", ("cannot be parsed", "column 3")),
        ("", ("cannot be parsed",)),
        ("IfcWall, Name=/[/", ("cannot be evaluated",)),
    ],
)
def test_what_would_pick_nothing_without_a_word_is_refused(house: Building, query: str, words: tuple[str, ...]):
    with pytest.raises(SelectorError) as caught:
        house.select(query)
    for word in (repr(query), *words):
        assert word in str(caught.value)
    assert caught.value.hint


def test_a_class_of_another_schema_next_to_one_of_this_is_only_logged(
    house: Building, caplog: pytest.LogCaptureFixture
):
    assert picked(house, "IfcEquipmentElement, IfcWall") == ["Wall"]
    assert "names IfcEquipmentElement, which IFC4 does not have, and goes on without it" in caplog.text


def test_renamed_classes_are_found(house: Building):
    assert picked(house, "IfcBuiltElement") == picked(house, "IfcBuildingElement") == ["box", "Wall"]


def test_classes_younger_than_the_schema_are_found_by_their_types():
    building = read_ifc(real_model("office/Office_A_20110811.ifc"))
    terminals = building.select("IfcSanitaryTerminal")
    assert terminals
    assert {terminal.ifc_class for terminal in terminals} == {"IfcFlowTerminal"}
    assert building.select("IfcFurniture") == building.select("IfcFurnishingElement") != ()


def test_a_query_is_evaluated_once(house: Building, monkeypatch: pytest.MonkeyPatch):
    from bimnav.ifc import _query

    first = house.select("IfcWall, Name=Wall")
    monkeypatch.setattr(_query, "evaluate", None)
    assert house.select("IfcWall, Name=Wall") == first


def test_a_building_from_a_file_can_be_pickled_and_still_answers(house: Building):
    proxy = house.select("IfcBuildingElementProxy")[0].global_id
    assert house[proxy].shapes  # an element was looked up before
    for again in (pickle.loads(pickle.dumps(house)), copy.deepcopy(house)):
        assert picked(again, "IfcWall") == ["Wall"]
        [shape] = again[proxy].shapes
        assert not any(
            a.flags.writeable for a in (shape.mesh.vertices, shape.mesh.faces, shape.placement, shape.bounds)
        )


def test_a_file_that_changed_or_went_is_not_asked(tmp_path: Path):
    path = tmp_path / "house.ifc"
    path.write_text(model())
    changed, gone = (read_ifc(path, cache=False, isolate=False) for _ in range(2))
    path.write_text(model(box(200)))
    with pytest.raises(InputError, match="changed since it was read"):
        changed.select("IfcWall, Name=Wall")
    path.unlink()
    with pytest.raises(FileMissingError, match="gone"):
        gone.select("IfcWall, Name=Wall")


def test_the_facts_of_products_are_read_from_files_of_several_exporters():
    electrical = read_ifc(real_model("duplex/Ifc2s3_Duplex_Electrical.ifc"))
    lamps = [e for e in electrical if any(c.code == "D5020220" for c in electrical.facts(e.global_id).classifications)]
    assert lamps
    assert {c.system for e in lamps for c in electrical.facts(e.global_id).classifications} == {"UniFormat"}
    heating = read_ifc(real_model("mep/b03_heating_with_building_blenderBIM.ifc"))
    systems = {name for element in heating for name in heating.facts(element.global_id).systems}
    assert {"Heizung_RL", "Heizung_VL"} <= systems


def test_own_properties_are_told_apart_from_those_of_the_type():
    house = read_ifc(real_model("houses/SampleHouse4.ifc"))
    couch = house.facts("3cUkl32yn9qRSPvBJVyYGp")
    assert [(c.system, c.code) for c in couch.classifications] == [("Uniformat", "E2020200")]
    assert couch.type_properties["Identity Data"]["Assembly Code"] == "E2020200"
    assert "Assembly Code" not in couch.properties.get("Identity Data", {})
    assert house.facts("nobody") == Facts()


def test_several_models_tell_the_facts_of_one_product_together():
    duplex, handover = (
        read_ifc(real_model(f"duplex/{name}.ifc")) for name in ("Duplex_A_20110907", "2012-03-23-Duplex-Handover")
    )
    table = "2kvhekJrnDjRw0CDkKW$KL"
    facts = federate([duplex, handover]).facts(table)
    assert any(code.code.startswith("23-40 20 14 17 24") for code in facts.classifications)
    assert {*duplex.facts(table).properties, *handover.facts(table).properties} == set(facts.properties)


@pytest.mark.parametrize("model_name", ["houses/SampleHouse4.ifc", "office/Office_A_20110811.ifc"])
def test_a_query_for_classes_alone_is_answered_as_from_the_file(model_name, monkeypatch):
    path = real_model(model_name)
    quick, slow = read_ifc(path), read_ifc(path)
    queries = (
        "IfcElement",
        "IfcWall, IfcFlowTerminal",
        "IfcBuildingElementProxy, IfcFurniture, ! IfcFurnishingElement",
        "! IfcWall",
        "! IfcElement + IfcDoor",
        "IfcWall, ! IfcWallStandardCase, IfcSlab + IfcSpace",
        "IfcOpeningElement",
        "IfcObject",
        "IfcSanitaryTerminal, IfcLamp",
    )
    answers = [quick.select(query) for query in queries]
    monkeypatch.setattr(_query, "of_classes", lambda *_: None)
    for query, answer in zip(queries, answers, strict=True):
        assert [e.global_id for e in slow.select(query)] == [e.global_id for e in answer], query
    monkeypatch.undo()
    monkeypatch.setattr(_select, "open_copy", None)
    assert [e.global_id for e in read_ifc(path).select("IfcWall")] == [e.global_id for e in slow.select("IfcWall")]
