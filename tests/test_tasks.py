"""Tasks: what the rules pick by name, and what task files may say."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from bimnav._toml import read_toml
from bimnav.building import Building, Classification, Element, Facts, Mesh, Shape, Space, Storey
from bimnav.environment import make_environment
from bimnav.errors import (
    FileKindError,
    FileMissingError,
    FileTooLargeError,
    InputError,
    SelectorError,
    TaskError,
)
from bimnav.tasks import Rule, Standoff, Task, choose, list_tasks, load_task, match, task_schema
from bimnav.tasks._conditions import parse_condition
from bimnav.tasks._lint import lint_filters
from tests.conftest import real_model

# what a robot that cleans is to find: names as exporters write them
LITTER = [
    ("IfcBuildingElementProxy", "Banana Peel:Banana Peel:345678", ""),
    ("IfcBuildingElementProxy", "BananaPeel:Small:345679", ""),
    ("IfcBuildingElementProxy", "banana_peel_2", ""),
    ("IfcFurnishingElement", "Trash:200mm:88121", "200mm"),
    ("IfcFurniture", "M_Garbage:Pile:1", ""),
    ("IfcBuildingElementProxy", "Entourage", "Litter"),
    ("IfcBuildingElementProxy", "Abfall-001", ""),
    ("IfcBuildingElementProxy", "Müll", ""),
    ("IfcBuildingElementProxy", "MÜLL:klein:2", ""),
    ("IfcBuildingElementProxy", "Muell 2", ""),
    ("IfcBuildingElementProxy", "Mu\u0308ll", ""),  # the umlaut as a mark of its own
    ("IfcBuildingElementProxy", "Bananenschale", ""),
    ("IfcBuildingElementProxy", "Zwerfafval", ""),
    ("IfcBuildingElementProxy", "Déchets", ""),
    ("IfcBuildingElementProxy", "Basura", ""),
    ("IfcBuildingElementProxy", "Buccia di banana", ""),
    ("IfcBuildingElementProxy", "Мусор 1", ""),
    ("IfcBuildingElementProxy", "床のゴミ", ""),
    ("IfcBuildingElementProxy", "ｺﾞﾐ", ""),
    ("IfcBuildingElementProxy", "地面垃圾", ""),
    ("IfcBuildingElementProxy", "香蕉皮:标准:3", ""),
    ("IfcBuildingElementProxy", "Food Waste:Small:12", ""),
]
SPILLS = [
    ("IfcBuildingElementProxy", "Water Spill:300mm:345680", ""),
    ("IfcBuildingElementProxy", "WaterSpill01", ""),
    ("IfcSlab", "Puddle", ""),
    ("IfcCovering", "Wasserpfütze", ""),
    ("IfcBuildingElementProxy", "Pfuetze", ""),
    ("IfcBuildingElementProxy", "Flaque d'eau", ""),
    ("IfcBuildingElementProxy", "Charco de agua", ""),
    ("IfcBuildingElementProxy", "Лужа", ""),
    ("IfcBuildingElementProxy", "水たまり", ""),
    ("IfcBuildingElementProxy", "水渍", ""),
    ("IfcBuildingElementProxy", "Wet floor", ""),
]
TRAPS = [
    ("IfcFlowTerminal", "Duplex Receptacle:Standard:303612", "Standard"),
    ("IfcMember", "Rectangular Mullion:50 x 150mm:1234", "Mullion"),
    ("IfcMember", "Mull Bar", ""),
    ("IfcFlowTerminal", "M_Towel Dispensers - receptical:Semi-Recessed:288", ""),
    ("IfcBuildingElementProxy", "Recycled Content", ""),
    ("IfcBuildingElementProxy", "RECYC", ""),
    ("IfcBuildingElementProxy", "Model Text:Model Text:12", ""),
    ("IfcFurniture", "Trash Can:Round:9", ""),
    ("IfcFurniture", "Waste Bin", ""),
    ("IfcFurniture", "Trash", "Trash Container"),
    ("IfcFurniture", "Mülleimer", ""),
    ("IfcFurniture", "Müll-Behälter", ""),
    ("IfcFurniture", "Prullenbak", ""),
    ("IfcFurniture", "Cubo de basura", ""),
    ("IfcFurniture", "Contenitore rifiuti", ""),
    ("IfcFurniture", "Контейнер для мусора", ""),
    ("IfcFurniture", "ゴミ箱", ""),
    ("IfcBuildingElementProxy", "コミュニティ", ""),  # ゴ and コ are two letters, not one with an accent
    ("IfcFurniture", "垃圾桶", ""),
    ("IfcPipeSegment", "Waste:110mm", ""),
    ("IfcPipeSegment", "Abfallrohr", ""),
    ("IfcWasteTerminal", "Waste Water Terminal", ""),
    ("IfcBuildingElementProxy", "Waste Disposal Unit", ""),
    ("IfcBuildingElementProxy", "Basin Waste", ""),
    ("IfcValve", "Waste Valve", ""),
    ("IfcDoor", "Door:Trash Room:3", ""),
    ("IfcLightFixture", "Spill Light:LED:12", ""),
    ("IfcBuildingElementProxy", "Spillway", ""),
    ("IfcBuildingElementProxy", "SpillWay", ""),
    ("IfcBuildingElementProxy", "Spill Kit", ""),
    ("IfcFlowFitting", "Puddle Flange", ""),
    ("IfcFurniture", "Wet Floor Sign", ""),
    ("IfcSlab", "Floor:Wet Floor 150mm:7", ""),
    ("IfcFurniture", "Furniture_Couch_Viper:2290x950x340mm:290852", "2290x950x340mm"),
]
DOCKS = ["Charging Dock:Charging Dock:345690", "Robot Charging Station", "Ladestation", "充电站", "Док-станция"]
NO_DOCKS = [
    "EV Charging Station:Double:1",
    "Ladestation E-Auto",
    "Loading Dock",
    "Laptop docking station",
    "电动车充电站",
]


def building_of(things, **more):
    elements = tuple(
        Element(f"{k:022d}", ifc_class, name=name, type_name=type_name)
        for k, (ifc_class, name, type_name) in enumerate(things)
    )

    def selector(query):
        classes = {part.strip() for part in query.split(",")}
        if "IfcFurnishingElement" in classes:
            classes.add("IfcFurniture")
        return [e.global_id for e in elements if classes & {"IfcElement", e.ifc_class}]

    return Building("by hand", (Storey("s", "Ground", 0.0),), elements=elements, **{"selector": selector} | more)


def names_of(rules, building):
    return {m.element.name for rule in rules for m in match(rule, building)}


def written(folder, text):
    path = folder / "my.toml"
    path.write_text(text, encoding="utf-8")
    return path


def box(x, y, z, size=0.2):
    """Return a box by its lower corner; its faces include the floor and the walls."""
    corners = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)], float) * size + [x, y, z]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return Shape(Mesh(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


@pytest.mark.parametrize("thing", LITTER + SPILLS, ids=lambda thing: thing[1])
def test_cleaning_finds_litter_and_spills_in_many_languages(thing):
    assert names_of(load_task("cleaning").targets, building_of([thing])) == {thing[1]}


@pytest.mark.parametrize("thing", TRAPS, ids=lambda thing: thing[1])
def test_cleaning_leaves_bins_pipes_and_lookalikes_alone(thing):
    assert names_of(load_task("cleaning").targets, building_of([thing])) == set()


@pytest.mark.parametrize("model", ["duplex/Duplex_A_20110907.ifc", "office/Office_A_20110811.ifc"])
def test_cleaning_finds_nothing_in_a_real_model_without_litter(model):
    ifcopenshell = pytest.importorskip("ifcopenshell")
    file = ifcopenshell.open(real_model(model))
    things = [(e.is_a(), e.Name or "", e.ObjectType or "") for e in file.by_type("IfcElement")]
    assert len(things) > 200
    cleaning = load_task("cleaning")
    assert names_of(cleaning.targets + cleaning.docks, building_of(things)) == set()


def test_cleaning_knows_charging_docks_of_robots_from_those_of_cars():
    building = building_of([("IfcElectricAppliance", name, "") for name in DOCKS + NO_DOCKS])
    assert names_of(load_task("cleaning").docks, building) == set(DOCKS)


def test_a_match_says_which_field_has_which_word_and_where_the_rule_is_written():
    task = load_task("cleaning")
    (found,) = match(task.targets[0], building_of([("IfcFurniture", "Trash:200mm:88121", "200mm")]))
    assert found.why == f"rule 'litter' ({task.targets[0].source}): family 'Trash' has the word 'trash'"
    line = int(task.targets[0].source.split(":")[1])
    text = (Path(sys.modules["bimnav.tasks"].__file__).parent / "library/cleaning.toml").read_text(encoding="utf-8")
    assert text.split("\n")[line - 1] == "[[tasks.cleaning.targets]]"


def test_a_rule_without_words_picks_what_the_filter_picks():
    building = building_of([("IfcDoor", "D1", ""), ("IfcWall", "W1", "")])
    (found,) = match(Rule("IfcDoor", label="doors"), building)
    assert found.element.name == "D1"
    assert found.why == "rule 'doors': IfcDoor passes the filter 'IfcDoor'"


@pytest.mark.parametrize("field", ["name", "type_name", "object_type"])
def test_words_are_found_in_every_name_an_element_has(field):
    element = Element("a", "IfcFurniture", **{field: "Family:Water Spill"})
    building = Building("b", (Storey("s", "G", 0.0),), elements=(element,), selector=lambda query: ["a"])
    assert len(match(Rule(words=["spill"]), building)) == 1


def test_words_find_rooms_by_their_long_name():
    room = Space("r", "101", "Bad / WC")
    building = Building("b", (Storey("s", "G", 0.0),), spaces=(room,), selector=lambda query: ["r"])
    (found,) = match(Rule("IfcSpace", words=["bad"]), building)
    assert found.why == "rule 'IfcSpace': room name 'Bad / WC' has the word 'bad'"


def test_each_filter_is_asked_once_per_building():
    asked = []
    building = building_of([("IfcDoor", "Trash", "")], selector=lambda query: asked.append(query) or [])
    for rule in (Rule(words=["trash"]), Rule(words=["spill"]), Rule("IfcDoor"), Rule("IfcDoor")):
        match(rule, building)
    assert asked == ["IfcElement", "IfcDoor"]


def test_a_filter_that_cannot_be_evaluated_is_told_with_its_rule():
    def refuse(query):
        raise SelectorError(f"{query!r} names an unknown class.", "Did you mean IfcDoor?")

    with pytest.raises(SelectorError, match=r"rule 'doors' \(my\.toml:7\): 'IfcDor' names .* Did you mean IfcDoor\?"):
        match(Rule("IfcDor", label="doors", source="my.toml:7"), building_of([], selector=refuse))


@pytest.mark.parametrize(
    ("expect", "is_met"),
    [
        ("", True),
        (">=1", True),
        (">= 3", False),
        ("2", True),
        ("==2", True),
        ("=3", False),
        ("<2", False),
        ("<=2", True),
    ],
)
def test_a_rule_may_expect_a_number_of_elements(expect, is_met):
    building = building_of([("IfcDoor", "D1", ""), ("IfcDoor", "D2", "")])
    rule = Rule("IfcDoor", label="doors", expect=expect)
    if is_met:
        assert len(match(rule, building)) == 2
    else:
        with pytest.raises(TaskError, match=r"rule 'doors' finds 2 in 'by hand' and expects"):
            match(rule, building)


def two_storeys():
    elements = (
        Element("low", "IfcFurniture", shapes=(box(0.5, 0.5, 0.0),), storey="up"),  # the container lies
        Element("high", "IfcFurniture", shapes=(box(0.5, 0.5, 2.99),), storey="up"),
        Element("bare", "IfcFurniture", storey="up", space="attic"),
    )
    spaces = (
        Space("hall", "1", "Hall", "down", (box(0, 0, 0.0, 2.5),)),
        Space("attic", "2", "Attic", "up", (box(0, 0, 3.0, 2.5),)),
    )
    ids = [product.global_id for product in elements + spaces]
    storeys = (Storey("down", "Ground", 0.0), Storey("up", "First", 3.0))
    return Building("two", storeys, spaces=spaces, elements=elements, selector=lambda query: ids)


@pytest.mark.parametrize(
    ("rule", "picked"),
    [
        (Rule(storeys=["Ground"]), {"low", "hall"}),
        (Rule(storeys=["up"]), {"high", "bare", "attic"}),
        (Rule(spaces=["hall"]), {"low", "hall"}),
        (Rule(spaces=["ATTIC"]), {"high", "bare", "attic"}),
        (Rule(spaces=["1", "2 Attic"], storeys=["First"]), {"high", "bare", "attic"}),
    ],
)
def test_a_rule_may_look_on_some_storeys_and_in_some_rooms_only(rule, picked):
    assert {m.element.global_id for m in match(rule, two_storeys())} == picked


def test_a_storey_or_room_that_is_not_there_is_an_error_that_names_those_that_are():
    with pytest.raises(TaskError, match=r"no storey 'Roof'\. It has 'Ground', 'First'"):
        match(Rule(storeys=["Roof"]), two_storeys())
    with pytest.raises(TaskError, match=r"no space 'Kitchen'\. Among its 2 spaces are '1 Hall'"):
        match(Rule(spaces=["Kitchen"]), two_storeys())


@pytest.mark.parametrize(
    "make",
    [
        lambda: Rule(filter=" "),
        lambda: Rule(words="spill"),
        lambda: Rule(words=["--"]),
        lambda: Rule(words=[3]),
        lambda: Rule(factor=0.5),
        lambda: Rule(factor=float("nan")),
        lambda: Rule(factor=float("inf")),
        lambda: Rule(expect="some"),
        lambda: Task(" "),
        lambda: Task("a", targets=Rule()),
        lambda: Task("a", targets=["IfcDoor"]),
        lambda: Task("a", service_time=-1),
        lambda: Task("a", service_time=float("nan")),
        lambda: Task("a", destination="centre"),
    ],
)
def test_a_task_written_by_hand_is_checked(make):
    with pytest.raises(TaskError):
        make()


def test_equal_rules_are_equal_wherever_they_are_written():
    assert Task("a", targets=[Rule(words=["x"], source="a.toml:3")], source="a.toml:1") == Task(
        "a", targets=(Rule(words=("x",)),)
    )


def test_the_library_lists_cleaning_and_its_time_per_target():
    (cleaning,) = [info for info in list_tasks() if info.name == "cleaning"]
    assert cleaning.description == "Visit litter and spills and remove them."
    assert cleaning.source.startswith("built-in cleaning.toml:")
    task = load_task("cleaning")
    assert (task.service_time, task.destination, task.obstacles) == (30.0, "center", ())


GOOD = """
schema = 1

[tasks.patrol]
description = "Look at all doors."
service_time = "PT1M30,5S"
destination = "nearest_free"

[[tasks.patrol.targets]]
filter = 'IfcDoor, Name=/D.*/'
words = [
    "door", # in English
    "Tür",
]
label = "doors"
expect = ">=1"

[[tasks.patrol.targets]]
exclude_words = ["locked"]
storeys = ["Level 1"]
spaces = ["Lobby"]

[[tasks.patrol.avoid]]
factor = 3

[[tasks.patrol.restricted]]
[[tasks.patrol.obstacles]]
[[tasks.patrol.ignore]]
[[tasks.patrol.exits]]
[[tasks.patrol.docks]]
"""


def test_a_task_file_holds_every_kind_of_rule(tmp_path):
    path = written(tmp_path, GOOD)
    task = load_task(path)
    assert task == Task(
        "patrol",
        "Look at all doors.",
        targets=(
            Rule("IfcDoor, Name=/D.*/", ("door", "Tür"), label="doors", expect=">=1"),
            Rule(exclude_words=("locked",), storeys=("Level 1",), spaces=("Lobby",)),
        ),
        avoid=(Rule(factor=3.0),),
        restricted=(Rule(),),
        obstacles=(Rule(),),
        ignore=(Rule(),),
        exits=(Rule(),),
        docks=(Rule(),),
        service_time=90.5,
        destination="nearest_free",
    )
    assert (task.source, task.targets[1].source) == (f"{path}:4", f"{path}:18")


@pytest.mark.parametrize(
    ("written_time", "seconds"),
    [("5", 5), ("0.5", 0.5), ("'PT30S'", 30), ("'P1DT1H'", 90000), ("'PT1.5M'", 90)],
)
def test_service_time_is_seconds_or_an_iso_duration(tmp_path, written_time, seconds):
    path = written(tmp_path, f"schema = 1\n[tasks.a]\nservice_time = {written_time}\n")
    assert load_task(path).service_time == seconds


@pytest.mark.parametrize(
    "bad", ["-1", "nan", "inf", "true", "'P'", "'PT'", "'1M'", "'-PT5S'", "'P1Y'", "[5]", "12:30:00"]
)
def test_service_time_is_nothing_else(tmp_path, bad):
    with pytest.raises(TaskError, match=r"my\.toml:3: tasks\.a\.service_time = "):
        load_task(written(tmp_path, f"schema = 1\n[tasks.a]\nservice_time = {bad}\n"))


def test_a_file_of_several_tasks_needs_a_name(tmp_path):
    path = written(tmp_path, "schema = 1\n[tasks.kitchen]\n[tasks.hall]\n")
    assert load_task(path, "hall") == load_task(f"{path}:hall") == Task("hall")
    with pytest.raises(TaskError, match=r"holds 2 tasks\. Known are kitchen, hall\."):
        load_task(path)
    with pytest.raises(TaskError, match=r"no task 'kitchn'\. Did you mean 'kitchen'\?"):
        load_task(path, "kitchn")


def test_an_unknown_name_brings_the_nearest_and_the_list():
    with pytest.raises(TaskError, match=r"no task 'cleanin'\. Did you mean 'cleaning'\? Known are .*cleaning"):
        load_task("cleanin")


BAD = """schema = 2
colour = 1
[tasks.a]
description = 5
destination = "centre"
targts = []
[[tasks.a.targets]]
filtr = "IfcWall"
words = "spill"
factor = 3
[[tasks.a.targets]]
words = [
    "--",
]
expect = "many"
filter = ""
[[tasks.a.avoid]]
factor = 0.5
[tasks.b.targets]
filter = "IfcWall"
[tasks]
c = 3
"""


def test_all_mistakes_are_told_at_once_each_with_its_line(tmp_path):
    path = written(tmp_path, BAD)
    with pytest.raises(TaskError) as caught:
        load_task(path)
    told = [line.removeprefix(f"{path}:") for line in caught.value.message.split("\n")]
    assert told == [
        "1: schema = 2: should be 1.",
        "2: unknown key 'colour' in the file; known are schema, tasks.",
        "4: tasks.a.description = 5: should be a text in quotes.",
        "5: tasks.a.destination = 'centre': should be 'center', 'nearest_free', 'standoff' or 'space'; "
        "did you mean 'center'?",
        "6: unknown key 'targts' in tasks.a; did you mean 'targets'?",
        "8: unknown key 'filtr' in tasks.a.targets[0]; did you mean 'filter'?",
        "9: tasks.a.targets[0].words = 'spill': should be a list.",
        "10: unknown key 'factor' in tasks.a.targets[0]; "
        "known are filter, words, exclude_words, label, storeys, spaces, use, classification, "
        "exclude_classification, properties, leads_outside, systems, expect, "
        "destination, service_time, priority, due, abilities.",
        "12: tasks.a.targets[1].words = ['--']: '--' is not a word. A word has letters or digits.",
        "15: tasks.a.targets[1].expect = 'many': should be a comparison with a whole number, such as '>=1'.",
        "16: tasks.a.targets[1].filter = '': should not be empty.",
        "18: tasks.a.avoid[0].factor = 0.5: should be greater than or equal to 1.",
        "19: tasks.b.targets = {'filter': 'IfcWall'}: should be a list: [[tasks.b.targets]].",
        "22: tasks.c = 3: should be a table.",
    ]
    assert caught.value.context["problems"][0] == {
        "file": str(path),
        "line": 1,
        "message": "schema = 2: should be 1.",
        "key": "schema",
        "value": "2",
    }
    json.dumps(caught.value.to_dict())


def test_what_is_not_toml_is_told_with_line_and_column_and_keys_said_twice_with_both_lines(tmp_path):
    text = """schema = 1
[tasks.a]
description = "x"
description = "y"
[[tasks.a.targets]]
  filter = IfcWall
label = '''
[tasks.a]'''
[tasks.a]
"""
    path = written(tmp_path, text)
    with pytest.raises(TaskError) as caught:
        load_task(path)
    assert [line.removeprefix(f"{path}:") for line in caught.value.message.split("\n")] == [
        "4: 'description' is said again; it was said on line 3.",
        "6: column 12: Invalid value in 'filter = IfcWall'.",
        "9: 'a' is said again; it was said on line 2.",
    ]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", r":1: 'schema' is missing in the file; begin with schema = 1\."),
        ("schema = 1\n[task.a]\n", r":1: 'tasks' is missing in the file\.\n.*:2: unknown key 'task' .* 'tasks'\?"),
        ("schema = 1\n[tasks]\n", r":2: tasks = {}: should hold at least one task\."),
        ("schema = 1\n[tasks.'']\n", r":2: .*should not be empty\."),
        ("schema = true\n[tasks.a]\n", r":1: schema = True: should be a valid integer\."),
        ("schema = 1\n[tasks.a]\ndescription = '''x\n\n", r":3: at the end: "),
        ("schema = 1\r\n[tasks.a\r\n", r":2: column 9: Expected .*declaration in '.tasks.a'\."),
        ("schema = " + "1" * 5000, r":1: Exceeds the limit"),
        ("schema = 1\n[tasks.a]\nservice_time = " + "9" * 400, r":3: tasks\.a\.service_time = "),
        ("schema = 1\nx = " + "[" * 100_000, r":2: tables and lists are nested deeper than 32\."),
        (f"schema = 1\nx{'.x' * 100_000} = 1", r":2: tables and lists are nested deeper than 32\."),
        ("schema = 1\n[tasks.a]\n" + "".join(f"k{k} = 1\n" for k in range(99)), r"There are 49 more mistakes\."),
    ],
    ids=lambda text: text[:30],
)
def test_a_strange_file_gets_one_clear_error(tmp_path, text, told):
    with pytest.raises(TaskError, match=rf"my\.toml{told}" if told.startswith(":") else told):
        load_task(written(tmp_path, text))


def test_a_file_that_cannot_be_read_says_why(tmp_path):
    with pytest.raises(FileMissingError, match=r"nope\.toml does not exist"):
        load_task(str(tmp_path / "nope.toml"))
    with pytest.raises(FileKindError, match="is not a file"):
        load_task(tmp_path)
    with pytest.raises(FileTooLargeError):
        load_task(written(tmp_path, "#" * 1_000_001))
    with pytest.raises(InputError, match="cannot be read"):
        load_task(tmp_path / ("x" * 5000))
    (tmp_path / "latin.toml").write_bytes("schema = 1\n# Müll".encode("latin-1"))
    with pytest.raises(TaskError, match=r"latin\.toml:2: this is not UTF-8"):
        load_task(tmp_path / "latin.toml")


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text("schema = 1\r\n[tasks.a]\r\n", encoding="utf-8-sig", newline="")
    assert load_task(path) == Task("a")


def test_the_json_schema_accepts_the_library_and_refuses_a_bad_file():
    jsonschema = pytest.importorskip("jsonschema")
    import tomllib

    schema = task_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    judge = jsonschema.Draft202012Validator(schema)
    for path in Path(sys.modules["bimnav.tasks"].__file__).parent.rglob("*.toml"):
        judge.validate(tomllib.loads(path.read_text(encoding="utf-8")))
    judge.validate(tomllib.loads(GOOD))
    bad = tomllib.loads(BAD)
    told = {tuple(map(str, error.path)) for error in judge.iter_errors(bad)}
    assert ("tasks", "a", "targets", "0") in told
    assert ("tasks", "a", "targets", "1", "expect") in told


def test_every_key_of_the_schema_says_what_it_is():
    schema = task_schema()
    for table in (schema, *schema["$defs"].values()):
        assert table["additionalProperties"] is False
        assert all("description" in entry for entry in table["properties"].values())


def test_pydantic_is_loaded_only_when_a_file_is_read():
    script = "import sys, bimnav.tasks as t; t.Task('a', targets=[t.Rule()]); assert 'pydantic' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True)


# what rules may ask for beside words


def told(**facts):
    """Return a building of four things, a heating system and two rooms, and what its file says of them."""
    known = {
        "sofa": Facts(
            {"Pset_Asset": {"Condition": "Good", "SerialNumber": "SerialNumber"}},
            {"Identity Data": {"OmniClass Number": "23.40.20.14.14.14", "OmniClass Title": "Settees, Sofas"}},
            (Classification("Uniformat", "E2020200", "Furniture & Accessories"),),
        ),
        "table": Facts(classifications=(Classification("", "23-40 20 14 17 24: Coffee Tables"),)),
        "valve": Facts(
            {"Pset_Valve": {"Size": 25.0, "IsOpen": True, "Status": ["Existing", "Kept"]}},
            {"Pset_Valve": {"Size": 15.0, "TestPressure": "16"}},
            (Classification("NL/SfB (4 cijfers)", "24.11"), Classification("Uniclass 2015", "Pr_65_53_24")),
            ("Heizung_VL", "HEATING"),
        ),
    } | facts
    return Building(
        "flat",
        (Storey("s", "Ground", 0.0),),
        elements=(
            Element("sofa", "IfcFurniture", "Sofa", shapes=(box(1, 1, 0),)),
            Element("table", "IfcFurniture", "Table", shapes=(box(6, 1, 0),)),
            Element("valve", "IfcValve", "V-1", space="wc"),
            Element("plain", "IfcWall", "Wall"),
        ),
        spaces=(
            Space("living", "101", "Living room", shapes=(box(0, 0, 0, 4),)),
            Space("wc", "102", "WC", object_type="Sanitary"),
        ),
        facts_reader=lambda global_id: known.get(global_id, Facts()),
    )


def picks(**asked):
    return [product.global_id for product, _ in match(Rule("IfcProduct", **asked), told())]


@pytest.mark.parametrize(
    ("sought", "found"),
    [
        ("23.40.20", ["sofa", "table"]),
        ("23-40 20 14", ["sofa", "table"]),
        ("OmniClass: 23 40 20 14 17", ["table"]),
        ("OmniClass:23.40", ["sofa", "table"]),
        ("Uniformat: 23", []),
        ("Uniformat: e20", ["sofa"]),
        ("UniFormat II: E2020", ["sofa"]),
        ("NL/SfB: 24", ["valve"]),
        ("NL-SfB: 24.1", ["valve"]),
        ("Uniclass: pr 65 53", ["valve"]),
        ("Uniclass: Pr_40", []),
        ("Settees", ["sofa"]),
        ("coffee tables", ["table"]),
        ("Table", []),
        ("3.40", []),
    ],
)
def test_a_classification_fits_by_the_beginning_of_its_code_or_words_of_its_title(sought, found):
    assert picks(classification=[sought]) == found


def test_one_of_several_classifications_is_enough():
    assert picks(classification=["NL/SfB: 24", "Settees"]) == ["sofa", "valve"]


@pytest.mark.parametrize(
    ("condition", "found"),
    [
        ("Pset_Asset.Condition = 'good'", ["sofa"]),
        ("*.Condition != ''", ["sofa"]),
        ("*.SerialNumber != ''", []),  # its value is but its own name
        ("*.SerialNumber = ''", ["sofa", "table", "valve", "plain", "living", "wc"]),
        ("Pset_Valve.Size >= 25", ["valve"]),  # its own size, not its type's
        ("Pset_Valve.Size < 25", []),
        ("pset_valve.size = 25", ["valve"]),
        ("Pset_*.TestPressure > 15.5", ["valve"]),  # its type's: it has none of its own
        ("*.IsOpen = true", ["valve"]),
        ("*.IsOpen = false", []),
        ("*.Status = Existing", ["valve"]),
        ("*.Status != 'Existing'", ["sofa", "table", "plain", "living", "wc"]),
        ("'Identity Data'.'OmniClass Title' *= sofa", ["sofa"]),
        ('Identity Data.OmniClass Title = "Settees, Sofas"', ["sofa"]),
    ],
)
def test_conditions_look_at_own_properties_before_those_of_the_type(condition, found):
    assert picks(properties=[condition]) == found


def test_all_conditions_must_hold():
    assert picks(properties=["*.IsOpen = true", "*.Size > 20"]) == ["valve"]
    assert picks(properties=["*.IsOpen = true", "*.Size > 30"]) == []


@pytest.mark.parametrize("bad", ["", "Size > 5", "*.Size", "*.Size > big", "*.Size ~ 5", "a.b = 'c", "a.b == 5"])
def test_what_is_no_condition_is_refused(bad):
    with pytest.raises(TaskError):
        Rule(properties=[bad])


def test_systems_are_found_by_words_of_their_names():
    assert picks(systems=["heizung"]) == picks(systems=["heating"]) == ["valve"]
    assert picks(systems=["heat"]) == []


def test_use_picks_rooms_and_what_is_in_them_by_geometry_or_by_the_file():
    assert picks(use=["living"]) == ["sofa", "living"]
    assert picks(use=["wc"]) == picks(use=["sanitary"]) == ["valve", "wc"]
    assert picks(use=["kitchen"]) == []
    assert [m.element.global_id for m in match(Rule("IfcSpace", use=["WC"]), told())] == ["wc"]


def test_a_match_says_everything_that_made_it():
    rule = Rule("IfcValve", ["V 1"], label="valves", use=["WC"], systems=["heating"], properties=["*.Size > 20"])
    [(_, why)] = match(rule, told())
    assert why == (
        "rule 'valves': family 'V-1' has the word 'V 1', room '102 WC' has the word 'WC', Pset_Valve.Size is 25.0, "
        "system 'HEATING' has the word 'heating'"
    )


ASKING = """
schema = 1
[tasks.rounds]
objective = "time"
priority = 2
due = "PT1H"
abilities = ["camera"]
destination = { distance = 0.8, side = "front", facing = false }
[[tasks.rounds.targets]]
filter = "IfcValve"
destination = "standoff"
service_time = 7
priority = 5
due = 60
abilities = ["arm"]
[[tasks.rounds.targets]]
filter = "IfcSpace"
destination = "space"
[[tasks.rounds.doors]]
state = "locked"
[[tasks.rounds.doors]]
words = ["sliding"]
state = "automatic"
opening_time = "PT3S"
"""


def test_rules_say_what_is_asked_at_their_targets_and_how_doors_are(tmp_path):
    task = load_task(written(tmp_path, ASKING))
    assert (task.objective, task.priority, task.due, task.abilities) == ("time", 2.0, 3600.0, ("camera",))
    assert task.destination == Standoff(0.8, "front", facing=False)
    valves, rooms = task.targets
    assert valves == Rule(
        "IfcValve", destination=Standoff(), service_time=7.0, priority=5.0, due=60.0, abilities=("arm",)
    )
    assert (rooms.destination, rooms.service_time, rooms.priority, rooms.due) == ("space", None, None, None)
    assert [(door.filter, door.state, door.opening_time) for door in task.doors] == [
        ("IfcDoor", "locked", 0.0),
        ("IfcDoor", "automatic", 3.0),
    ]


WRONG = """schema = 1
[tasks.a]
objective = "tme"
priority = -1
destination = { distanc = 1, side = "left" }
[[tasks.a.targets]]
properties = ["*.Size ~ 5"]
destination = 5
[[tasks.a.doors]]
state = "lockd"
[[tasks.a.obstacles]]
priority = 3
"""


def test_mistakes_in_what_is_asked_are_told_with_the_nearest_name(tmp_path):
    with pytest.raises(TaskError) as caught:
        load_task(written(tmp_path, WRONG))
    lines = [line.split("my.toml:")[1] for line in caught.value.message.split("\n")]
    assert lines[0] == ("3: tasks.a.objective = 'tme': should be 'distance', 'time' or 'energy'; did you mean 'time'?")
    assert lines[1] == "4: tasks.a.priority = -1: should be greater than or equal to 0."
    assert "unknown key 'distanc' in tasks.a.destination; did you mean 'distance'?" in "".join(lines[2:4])
    assert "tasks.a.destination.side = 'left': should be 'front', 'back' or 'any'." in "".join(lines[2:4])
    assert lines[4].startswith("7: tasks.a.targets[0].properties = ['*.Size ~ 5']: '*.Size ~ 5' is not a condition.")
    assert lines[5].startswith("8: tasks.a.targets[0].destination = 5: should be 'center'")
    assert lines[6].endswith("did you mean 'locked'?")
    assert lines[7].startswith("12: unknown key 'priority' in tasks.a.obstacles[0];")


def test_a_target_and_its_stop_carry_what_their_rule_asks():
    building = told()
    task = Task(
        "look",
        targets=[
            Rule("IfcFurniture", ["sofa"], label="sofas", priority=3, due=60, service_time=5, abilities=["arm"]),
            Rule("IfcFurniture"),
        ],
        destination="standoff",
        abilities=["camera"],
    )
    sofa, table = make_environment(building, task).targets
    assert (sofa.label, sofa.priority, sofa.due, sofa.service_time, sofa.abilities) == ("sofas", 3, 60, 5, ("arm",))
    assert (table.priority, table.due, table.service_time, table.abilities) == (1, None, None, ("camera",))
    assert sofa.approach == table.approach == Standoff()


# tasks built on tasks, and folders of tasks


def test_a_task_extends_another_its_rules_and_keys_going_before(tmp_path):
    path = written(
        tmp_path,
        """schema = 1
[tasks.night]
extends = "cleaning"
service_time = 90
[[tasks.night.targets]]
words = ["leaves"]
[tasks.later]
extends = "night"
[[tasks.later.avoid]]
words = ["carpet"]
""",
    )
    base, night, later = load_task("cleaning"), load_task(path, "night"), load_task(path, "later")
    assert night.targets == (Rule(words=("leaves",)), *base.targets)
    assert (night.service_time, night.removes_targets, night.docks) == (90, base.removes_targets, base.docks)
    assert night.targets[0].source == f"{path}:5"
    assert night.targets[-1].source.startswith("built-in cleaning.toml:")
    assert (later.targets, later.service_time, later.name) == (night.targets, 90, "later")
    assert later.avoid == (Rule(words=("carpet",)),)


def test_a_file_may_extend_a_known_task_under_its_own_name(tmp_path):
    path = written(tmp_path, 'schema = 1\n[tasks.cleaning]\nextends = "cleaning"\nservice_time = 5\n')
    assert load_task(path).targets == load_task("cleaning").targets
    assert load_task(path).service_time == 5


def test_extending_in_a_circle_or_what_is_not_there_is_refused_beside_all_else(tmp_path):
    path = written(
        tmp_path,
        """schema = 1
[tasks.a]
extends = "b"
[tasks.b]
extends = "c"
[tasks.c]
extends = "a"
[tasks.d]
extends = "cleanin"
[tasks.e]
extends = "e"
colour = 1
""",
    )
    with pytest.raises(TaskError) as caught:
        load_task(path)
    lines = [line.split("my.toml:")[1] for line in caught.value.message.split("\n")]
    assert lines[0] == "7: tasks.c.extends = 'a': goes round: 'a' extends 'b' extends 'c' extends 'a'."
    assert lines[1].startswith("9: tasks.d.extends = 'cleanin': there is no such task. Did you mean 'cleaning'?")
    assert lines[2].startswith("11: tasks.e.extends = 'e': there is no such task.")
    assert lines[3].startswith("12: unknown key 'colour'")
    assert caught.value.context["problems"][0]["key"] == "tasks.c.extends"


def folder_of(tmp_path, **texts):
    folder = tmp_path / "tasks"
    folder.mkdir()
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(f"schema = 1\n{text}", encoding="utf-8")
    return folder


def test_tasks_of_users_own_folders_are_known_by_name(tmp_path, monkeypatch):
    folder = folder_of(tmp_path, one="[tasks.rounds]\n", two="[tasks.night]\nextends = 'cleaning'\n")
    single = tmp_path / "single.toml"
    single.write_text("schema = 1\n[tasks.lone]\n")
    assert load_task("rounds", tasks_path=[folder]) == Task("rounds")
    names = {info.name for info in list_tasks(tasks_path=[folder])}
    assert {"cleaning", "night", "rounds"} <= names
    monkeypatch.setenv("BIMNAV_TASKS", f"{folder}{os.pathsep}{single}")
    assert {*names, "lone"} == {info.name for info in list_tasks()}
    assert load_task("night").targets == load_task("cleaning").targets
    other = tmp_path / "other.toml"
    other.write_text("schema = 1\n[tasks.mine]\nextends = 'night'\n")
    assert load_task(other).removes_targets


def test_two_tasks_of_one_name_are_refused_with_both_places(tmp_path):
    folder = folder_of(tmp_path, one="[tasks.rounds]\n", two="[tasks.rounds]\n", three="[tasks.cleaning]\n")
    with pytest.raises(TaskError) as caught:
        load_task("rounds", tasks_path=[folder])
    three, two = caught.value.message.split("\n")
    assert three.startswith(
        f"{folder / 'three.toml'}:2: there is a task 'cleaning' already, at built-in cleaning.toml:"
    )
    assert two == (
        f"{folder / 'two.toml'}:2: there is a task 'rounds' already, at {folder / 'one.toml'}:2; "
        "give this one another name."
    )


def test_a_folder_of_tasks_that_is_not_there_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("BIMNAV_TASKS", str(tmp_path / "nowhere"))
    with pytest.raises(FileMissingError, match=r"nowhere does not exist.*BIMNAV_TASKS"):
        list_tasks()
    assert load_task("cleaning")


def test_mistakes_in_filters_are_told_with_those_in_keys(tmp_path):
    path = written(
        tmp_path,
        """schema = 1
[tasks.a]
colour = 1
[[tasks.a.targets]]
filter = "IfcFurnitur"
[[tasks.a.targets]]
words = ["x"]
filter = 'query:system.Name="x"'
[[tasks.a.ignore]]
filter = "Name=x, IfcWall"
""",
    )
    with pytest.raises(TaskError) as caught:
        load_task(path)
    lines = [line.split("my.toml:")[1] for line in caught.value.message.split("\n")]
    assert [line.split(":")[0] for line in lines] == ["3", "5", "8"]
    assert lines[1] == (
        "5: tasks.a.targets[0]: filter 'IfcFurnitur' names an unknown class IfcFurnitur (column 1). "
        "Did you mean IfcFurniture?"
    )


def test_the_filters_of_the_library_have_nothing_wrong_with_them():
    for path in Path(sys.modules["bimnav.tasks"].__file__).parent.rglob("*.toml"):
        assert lint_filters(read_toml(path.read_text(encoding="utf-8"))) == ([], [])


def test_a_rule_for_a_class_the_schema_lacks_picks_nothing_and_says_so():
    def select(query):
        raise SelectorError(f"filter {query!r} names it", "", {"schema": "IFC2X3"})

    building = replace(building_of([("IfcFlowTerminal", "Speaker", "")]), selector=select, schema="IFC2X3")
    task = Task("look", targets=[Rule("IfcAudioVisualAppliance", label="speakers"), Rule("IfcValve")])
    environment = make_environment(building, task)
    assert environment.targets == ()
    told = [(issue.severity, issue.message) for issue in environment.issues if issue.code == "filter"]
    assert told == [
        (
            "warning",
            "rule 'speakers': filter 'IfcAudioVisualAppliance' names IfcAudioVisualAppliance, which IFC2X3 does not "
            "have (column 1). No element of this model can have it; name another class too, or match names.",
        ),
        (
            "info",
            "rule 'IfcValve': filter 'IfcValve' names IfcValve, which IFC2X3 does not have; what has an IfcValveType "
            "is taken for it (column 1).",
        ),
    ]


values = st.one_of(st.sampled_from(["", "x", "X", "5", "Existing"]), st.integers(0, 6), st.booleans(), st.floats(0, 6))


@given(
    own=st.one_of(st.none(), values),
    of_type=st.one_of(st.none(), values),
    wanted=st.sampled_from(["''", "x", "5", "true"]),
)
def test_a_condition_and_its_contrary_never_agree(own, of_type, wanted):
    facts = Facts({"P": {} if own is None else {"A": own}}, {"P": {} if of_type is None else {"A": of_type}})
    equal, other = (bool(parse_condition(f"P.A {sign} {wanted}").met_by(facts)) for sign in ("=", "!="))
    assert equal != other


@given(own=st.integers(0, 6), of_type=st.integers(0, 6))
def test_a_number_of_its_own_hides_that_of_the_type(own, of_type):
    facts = Facts({"P": {"A": own}}, {"Q": {"A": of_type}})
    for sign, holds in (("<", own < 3), ("<=", own <= 3), (">", own > 3), (">=", own >= 3), ("=", own == 3)):
        assert bool(parse_condition(f"*.A {sign} 3").met_by(facts)) == holds


@given(st.lists(st.sampled_from("abc"), min_size=1, max_size=4))
def test_the_first_rule_that_picks_an_element_decides(labels):
    rules = [Rule("IfcWall", label=label) for label in labels]
    chosen, overruled = choose(Task("any", targets=rules), "targets", told())
    assert chosen["plain"].rule.label == labels[0]
    assert len(overruled) == sum(label != labels[0] for label in labels)
