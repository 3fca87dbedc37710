"""The built-in tasks: what they find among labelled elements of real models, and among names made up to mislead."""

from __future__ import annotations

import csv
import re
from collections import Counter, defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

import bimnav as bn
from bimnav.building import Building, Classification, Element, Facts, Space, Storey
from bimnav.tasks import Rule, match
from bimnav.testing import box, room, two_rooms
from tests.conftest import REPOSITORY, real_model

LABELS = Path(__file__).with_name("labels.csv")
COUNTS = Path(__file__).with_name("task_counts.csv")
PAGES = sorted((REPOSITORY / "docs" / "tasks").glob("*.md"))
OBSTACLES = "obstacles"  # stands for a task among the counts

# Each label is what someone who reads the element's names, type, properties and geometry would call it.
ROOMS = (
    "bedroom break_room classroom corridor gallery hall_room kitchen living medical meeting "
    "office reception room storage"
)
# a task, the labels that it is to find, and those of which reasonable people may say either
WANTED = {
    "cleaning": ("", ""),
    "cleaning_rooms": (f"{ROOMS} wet_room", "utility waste_room"),
    "delivery": (ROOMS.replace("corridor ", ""), "utility waste_room"),
    "disinfection": (
        "basin bath counter desk door grab_bar lift lift_door paper_holder railing shower switch table toilet "
        "waste_receptacle",
        "cabinet kitchen_unit",
    ),
    "emergency_egress": ("exit", "exit_unknown"),
    "inspection_building": ("beam brace column curtain_wall door rafter roof window", ""),
    "inspection_fire": ("alarm_panel detector fire_door sprinkler", ""),
    "inspection_mep": ("boiler fan panel pipe pump thermostat valve", ""),
    "maintenance_leak": ("pipe", ""),
    "security_patrol": (f"{ROOMS} door garage stair_room technical utility waste_room", "stall_door parking"),
    "waste_collection": ("waste_receptacle waste_room", ""),
}


@cache
def labels() -> dict[str, dict[str, set[str]]]:
    """Return the labels of each element, by model."""
    found: dict[str, dict[str, set[str]]] = defaultdict(dict)
    with LABELS.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found[row["model"]][row["global_id"]] = set(row["label"].split())
    return dict(found)


@cache
def building(model: str) -> Building:
    return bn.read_ifc(real_model(model))


@cache
def environment(model: str) -> bn.IndoorEnvironment:
    return bn.make_environment(building(model), bn.Task("look"), bn.Robot(radius=0.25))


def found_by(task: str, model: str) -> set[str]:
    rules = bn.load_task(task).targets
    return {hit.element.global_id for rule in rules for hit in match(rule, building(model))}


@cache
def outcomes(task: str) -> Counter[str]:
    """Count hits, misses and false alarms of a task over all labelled elements."""
    wanted, either = (set(text.split()) for text in WANTED[task])
    counts: Counter[str] = Counter()
    for model, known in labels().items():
        found = found_by(task, model)
        for global_id, label in known.items():
            if label & either:
                continue
            is_wanted, is_found = bool(label & wanted), global_id in found
            counts["hit" if is_wanted and is_found else "miss" if is_wanted else "alarm" if is_found else "rest"] += 1
    return counts


def test_every_task_of_the_library_is_judged_here():
    assert set(WANTED) == {task.name for task in bn.list_tasks()}


def test_the_labels_are_many_and_of_elements_that_exist():
    assert sum(map(len, labels().values())) > 1500
    for model, known in labels().items():
        there = {product.global_id for product in (*building(model).elements, *building(model).spaces)}
        assert set(known) <= there, model


@pytest.mark.parametrize("task", WANTED)
def test_a_task_finds_what_is_labelled_so_and_hardly_anything_else(task):
    counts = outcomes(task)
    assert counts["alarm"] <= 0.02 * (counts["hit"] + counts["alarm"])  # precision of 0.98
    assert counts["hit"] >= 0.95 * (counts["hit"] + counts["miss"])  # recall


def test_over_all_tasks_precision_and_recall_are_higher_still():
    counts = sum((outcomes(task) for task in WANTED), Counter())
    assert counts["hit"] / (counts["hit"] + counts["alarm"]) > 0.99
    assert counts["hit"] / (counts["hit"] + counts["miss"]) > 0.99


def counted() -> list[tuple[str, str, int]]:
    """Return model, task and how many targets are to be found: as counted by hand, or otherwise if noted so."""
    with COUNTS.open(encoding="utf-8") as file:
        listed = {(row["model"], row["task"]): row["found"] or row["count"] for row in csv.DictReader(file)}
    models = sorted({model for model, _ in listed})
    numbers = [(model, task, listed.get((model, task), "0")) for model in models for task in (*WANTED, OBSTACLES)]
    return [(model, task, int(number)) for model, task, number in numbers if number]


@pytest.mark.parametrize("model", sorted({model for model, _, _ in counted()}))
def test_as_many_targets_and_obstacles_are_found_as_were_counted_by_hand(model):
    found = {task: len(found_by(task, model)) for task in WANTED}
    found[OBSTACLES] = len({obstacle.global_id for obstacle in environment(model).obstacles})
    numbers = {task: number for name, task, number in counted() if name == model}
    assert {task: found[task] for task in numbers} == numbers


@pytest.mark.parametrize("model", sorted({model for model, _, _ in counted()}))
def test_no_door_opening_or_room_blocks_in_a_real_model(model):
    blocking = {obstacle.global_id for obstacle in environment(model).obstacles}
    house = building(model)
    passable = {door.global_id for door in house.doors} | {space.global_id for space in house.spaces}
    passable |= {opening.global_id for opening in house.openings}
    passable |= {global_id for global_id, label in labels()[model].items() if "door" in label}
    assert not blocking & passable


# names as exporters write them: class, name, type name; and what the task is to make of them
HITS = [
    ("inspection_mep", "IfcFlowController", "Gate Valve - 50-300 mm:100 mm:391", ""),
    ("inspection_mep", "IfcPipeFitting", "Heizungsarmatur", "Absperrventil DN20"),
    ("inspection_mep", "IfcFlowController", "Klappe", "Rückschlagklappe DN50"),
    ("inspection_mep", "IfcDistributionElement", "Шаровой кран DN15", ""),
    ("inspection_mep", "IfcDistributionElement", "Клапаны балансировочные", ""),
    ("inspection_mep", "IfcDistributionElement", "闸阀-DN100", ""),
    ("inspection_mep", "IfcDistributionElement", "Umwälzpumpe", ""),
    ("inspection_mep", "IfcDistributionElement", "M_Base Mounted Pump:50 LPS:12", ""),
    ("inspection_mep", "IfcBuildingElementProxy", "Pompe de circulation", ""),
    ("inspection_mep", "IfcDistributionElement", "Cirkulationspump CP1", ""),
    ("inspection_mep", "IfcDistributionElement", "Gasbrennwertkessel 24 kW", ""),
    ("inspection_mep", "IfcDistributionElement", "Wärmepumpe", ""),
    ("inspection_mep", "IfcDistributionElement", "Calentador de agua:Caldera mural:2", ""),
    ("inspection_mep", "IfcDistributionElement", "Brandschutzklappe FK90", ""),
    ("inspection_mep", "IfcDistributionElement", "Spjäll: brandspjäll 200", ""),
    ("inspection_mep", "IfcDistributionElement", "防火阀:500x300", ""),
    ("inspection_mep", "IfcDistributionElement", "Unterverteilung UV-EG", ""),
    ("inspection_mep", "IfcDistributionElement", "Tableau électrique:T1", ""),
    ("inspection_mep", "IfcDistributionElement", "Щит распределительный ЩР-1", ""),
    ("inspection_mep", "IfcDistributionElement", "Raumtemperaturfühler", ""),
    ("inspection_mep", "IfcDistributionElement", "Датчик температуры", ""),
    ("inspection_mep", "IfcFlowSegment", "Pipe Types:Copper - Type L:3312", ""),
    ("inspection_mep", "IfcFlowSegment", "Kupferrohr 22x1", ""),
    ("inspection_fire", "IfcBuildingElementProxy", "Fire Extinguisher:6 kg:991", ""),
    ("inspection_fire", "IfcFurnishingElement", "Pulverfeuerlöscher", ""),
    ("inspection_fire", "IfcBuildingElementProxy", "Brandblusser 6L", ""),
    ("inspection_fire", "IfcBuildingElementProxy", "Extintor portátil", ""),
    ("inspection_fire", "IfcBuildingElementProxy", "Огнетушитель ОП-4", ""),
    ("inspection_fire", "IfcBuildingElementProxy", "灭火器箱", ""),
    ("inspection_fire", "IfcFlowTerminal", "Wandhydrant Typ F", ""),
    ("inspection_fire", "IfcFlowTerminal", "室内消火栓", ""),
    ("inspection_fire", "IfcDistributionElement", "Rauchmelder", ""),
    ("inspection_fire", "IfcDistributionElement", "Manual Call Point:Red:3", ""),
    ("inspection_fire", "IfcDistributionElement", "Détecteur de fumée", ""),
    ("inspection_fire", "IfcDistributionElement", "Извещатель пожарный дымовой", ""),
    ("inspection_fire", "IfcLightFixture", "Exit Sign - Wall:Single Face:8", ""),
    ("inspection_fire", "IfcLightFixture", "Rettungszeichenleuchte", ""),
    ("inspection_fire", "IfcLightFixture", "誘導灯 C級", ""),
    ("inspection_fire", "IfcDoor", "Innentür", "Brandschutztür T30 RS"),
    ("inspection_fire", "IfcDoor", "防火门FM甲:1200x2100", ""),
    ("waste_collection", "IfcFurniture", "Trash Can:Round:9", ""),
    ("waste_collection", "IfcFurniture", "Papierkorb", ""),
    ("waste_collection", "IfcFurniture", "Treteimer", ""),
    ("waste_collection", "IfcFurniture", "Cubo de basura", ""),
    ("waste_collection", "IfcFurniture", "Контейнер для мусора", ""),
    ("waste_collection", "IfcFurniture", "分類垃圾桶", ""),
    ("waste_collection", "IfcSpace", "Müllraum", ""),
    ("disinfection", "IfcElectricAppliance", "Lichtschalter", ""),
    ("disinfection", "IfcFlowTerminal", "Einhebelmischer Waschtisch", ""),
    ("disinfection", "IfcFurniture", "Schreibtisch 160x80", ""),
    ("disinfection", "IfcFurniture", "ruokapöytä", ""),
    ("disinfection", "IfcBuildingElementProxy", "Handrail:Wall Mounted:5", ""),
    ("cleaning_rooms", "IfcSpace", "C-101", ""),
    ("cleaning_rooms", "IfcSpace", "WC Herren", ""),
    ("delivery", "IfcSpace", "Großraumbüro 2", ""),
    ("security_patrol", "IfcSpace", "Serverraum", ""),
    ("maintenance_leak", "IfcFlowSegment", "Tubería de cobre:22mm", ""),
    ("emergency_egress", "IfcDoor", "Notausgangstür", ""),
]
MISSES = [
    ("inspection_mep", "IfcFlowTerminal", "Urinal-Wall-3D:19 mm Flush Valve:4", ""),
    ("inspection_mep", "IfcFlowFitting", "Armatur/Flansch/Dichtung M_600", "Vorschweissflansch PN16"),
    ("inspection_mep", "IfcPlate", "System Panel:Glazed:3", ""),
    ("inspection_mep", "IfcBuildingElementProxy", "Whiteboard Panel", ""),
    ("inspection_mep", "IfcDistributionElement", "Fire Alarm Control Panel", ""),
    ("inspection_mep", "IfcDistributionElement", "Rauchmelder mit Sensor", ""),
    ("inspection_mep", "IfcLightFixture", "Leuchte mit Bewegungssensor", ""),
    ("inspection_mep", "IfcFurniture", "Wasserkocher", ""),
    ("inspection_mep", "IfcSpace", "Boiler Room", ""),
    ("inspection_mep", "IfcFlowSegment", "Rectangular Duct:Mitered:4", ""),
    ("inspection_mep", "IfcFlowSegment", "Conduit Pipe:EMT:4", ""),
    ("inspection_mep", "IfcRailing", "Railing:900mm Pipe:3", ""),
    ("inspection_mep", "IfcFlowTerminal", "Soap Pump Dispenser", ""),
    ("inspection_mep", "IfcCovering", "Fan Coil Ceiling", ""),
    ("inspection_fire", "IfcBuildingElementProxy", "Fire Extinguisher Sign:A5:7", ""),
    ("inspection_fire", "IfcWall", "Interior - Fire Rated 2-HR", ""),
    ("inspection_fire", "IfcDistributionElement", "Fireplace - Wood Burning", ""),
    ("inspection_fire", "IfcDoor", "M_Single-Flush:0915 x 2134mm:1", ""),
    ("inspection_fire", "IfcWindow", "Fire Rated Window", ""),
    ("inspection_fire", "IfcSpace", "Fire Alarm Room", ""),
    ("inspection_fire", "IfcDistributionElement", "Bewegungsmelder", ""),
    ("waste_collection", "IfcFlowTerminal", "Duplex Receptacle:Standard:3", ""),
    ("waste_collection", "IfcBuildingElementProxy", "Banana Peel:Banana Peel:3", ""),
    ("waste_collection", "IfcFlowTerminal", "Waste Water Terminal", ""),
    ("waste_collection", "IfcFurniture", "Storage Bin Shelf", ""),
    ("waste_collection", "IfcMember", "Rectangular Mullion:50x150:3", ""),
    ("disinfection", "IfcElectricAppliance", "Network Switch 24 Port", ""),
    ("disinfection", "IfcLightFixture", "Table Lamp", ""),
    ("disinfection", "IfcFurniture", "Desk Chair", ""),
    ("disinfection", "IfcBuildingElementProxy", "Twin Switched Socket Outlet:Standard:1", ""),
    ("disinfection", "IfcSpace", "Table Tennis", ""),
    ("cleaning_rooms", "IfcSpace", "Roof", ""),
    ("cleaning_rooms", "IfcSpace", "Aufzugsschacht", ""),
    ("cleaning_rooms", "IfcSpace", "Treppenhaus 1", ""),
    ("cleaning_rooms", "IfcSpace", "Tiefgarage", ""),
    ("cleaning_rooms", "IfcSpace", "ELEC RM", ""),
    ("cleaning_rooms", "IfcSpace", "Щитовая", ""),
    ("delivery", "IfcSpace", "MENS RR", ""),
    ("security_patrol", "IfcSpace", "Dachterrasse", ""),
    ("security_patrol", "IfcDoor", "M_Toilet Partition:0915 x 1525mm:4", ""),
    ("maintenance_leak", "IfcFlowSegment", "Kabelleerrohr M25", ""),
    ("emergency_egress", "IfcDoor", "Innentür", ""),
    ("emergency_egress", "IfcWindow", "Notausstieg Fenster", ""),
]
ABOVE = {  # what the schema says is one of these
    "IfcElectricAppliance": ("IfcFlowTerminal", "IfcDistributionElement"),
    "IfcFlowController": ("IfcDistributionElement",),
    "IfcFlowFitting": ("IfcDistributionElement",),
    "IfcFlowSegment": ("IfcDistributionElement",),
    "IfcFlowTerminal": ("IfcDistributionElement",),
    "IfcFurniture": ("IfcFurnishingElement",),
    "IfcLightFixture": ("IfcFlowTerminal", "IfcDistributionElement"),
    "IfcPipeFitting": ("IfcFlowFitting", "IfcDistributionElement"),
}


def one(ifc_class: str, name: str, type_name: str) -> Building:
    """Return a building of one element or room."""
    if ifc_class == "IfcSpace":
        rooms, elements = (Space("0", "1", name),), ()
    else:
        rooms, elements = (), (Element("0", ifc_class, name, type_name),)

    def selector(query: str) -> list[str]:
        facets = [facet.strip() for part in query.split("+") for facet in part.split(",")]
        known = {"IfcElement", ifc_class, *ABOVE.get(ifc_class, ())} - ({"IfcElement"} if rooms else set())
        excluded = {facet.removeprefix("!").strip() for facet in facets if facet.startswith("!")}
        return ["0"] if known & set(facets) and not known & excluded else []

    return Building("by hand", (Storey("s", "G", 0.0),), spaces=rooms, elements=elements, selector=selector)


@pytest.mark.parametrize("case", HITS, ids=lambda case: f"{case[0]}: {case[2]}")
def test_a_task_knows_its_targets_in_many_languages(case):
    task, *thing = case
    assert any(match(rule, one(*thing)) for rule in bn.load_task(task).targets)


@pytest.mark.parametrize("case", MISSES, ids=lambda case: f"{case[0]}: {case[2]}")
def test_a_task_is_not_misled_by_words(case):
    task, *thing = case
    rules = [rule for rule in bn.load_task(task).targets if "PredefinedType" not in rule.filter]
    assert not [hit.why for rule in rules for hit in match(rule, one(*thing))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_task_files_shown_in_the_documentation_can_be_loaded(page, tmp_path):
    shown = re.findall(r"^```toml\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    for text in (whole for whole in shown if "[tasks." in whole and "schema = 1" in whole):  # others are parts of files
        path = tmp_path / "shown.toml"
        path.write_text(text, encoding="utf-8")
        task = bn.load_task(path)
        assert task.targets or task.restricted
        for rule in (*task.targets, *task.restricted):
            match(replace(rule, expect="", spaces=()), one("IfcDoor", "Door", ""))


@pytest.mark.parametrize(
    ("properties", "is_found"),
    [
        ({}, True),  # geometry tells
        ({"IsExternal": True}, True),
        ({"IsExternal": False}, False),  # the model goes before geometry
        ({"IsExternal": False, "FireExit": True}, True),
        ({"IsExternal": None}, True),
    ],
)
def test_what_a_model_says_of_a_door_goes_before_what_geometry_tells(properties, is_found):
    house = two_rooms()
    doors = (replace(house.doors[0], clear_width=None),)
    house = replace(house, spaces=house.spaces[:1], doors=doors)
    house = replace(house, property_reader=lambda _: {"Pset_DoorCommon": properties})
    assert bool(match(Rule("IfcDoor", leads_outside=True), house)) == is_found


def test_a_door_between_two_rooms_leads_nowhere_else():
    house = replace(two_rooms(), property_reader=lambda _: {"Pset_DoorCommon": {"IsExternal": True}})
    assert not match(Rule("IfcDoor", leads_outside=True), house)


@pytest.mark.parametrize(
    ("word", "name", "is_found"),
    [
        ("*ventil", "Absperrventil DN20", True),
        ("*ventil", "Ventil", True),
        ("*ventil", "Ventilator", False),
        ("ventil*", "Ventilator", True),
        ("ventil*", "Absperrventil", False),
        ("*ventil*", "Absperrventile", True),
        ("клапан*", "Клапаны", True),
    ],
)
def test_a_star_stands_for_the_rest_of_a_word(word, name, is_found):
    assert bool(match(Rule(words=[word]), one("IfcFlowController", name, ""))) == is_found


def test_a_rule_may_leave_out_what_is_classified_as_something():
    house = replace(
        one("IfcSpace", "Room", ""),
        facts_reader=lambda _: Facts(classifications=(Classification("OmniClass", "13-21 11", "Parking Spaces"),)),
    )
    assert match(Rule("IfcSpace"), house)
    for word in ("parking", "OmniClass: 13.21"):
        assert not match(Rule("IfcSpace", exclude_classification=[word]), house)
    assert match(Rule("IfcSpace", exclude_classification=["roof"]), house)


def test_every_task_has_a_page_that_shows_its_file():
    assert {task.name for task in bn.list_tasks()} <= {page.stem for page in PAGES}
    for task in bn.list_tasks():
        page = REPOSITORY / "docs" / "tasks" / f"{task.name}.md"
        assert f"library/{task.name}.toml" in page.read_text(encoding="utf-8")


def test_a_robot_that_checks_a_door_does_not_stand_in_it():
    house = two_rooms()
    mission = bn.run(
        house,
        task=bn.Task("look", targets=[Rule("IfcDoor")], destination="nearest_free"),
        robot=bn.Robot(radius=0.25),
        start=(1, 1),
        cell_size=0.1,
    )
    (stop,) = mission.tour.stops
    assert abs(stop.end[0] - 4.1) >= 0.25 + 0.02  # half the leaf


def test_a_roof_is_where_its_parts_are_and_they_are_no_targets_of_their_own():
    slab = replace(box("slab", 0, 0, 2.5, 5, 4, 2.7, ifc_class="IfcSlab"), predefined_type="ROOF", parent="roof")
    roof = Element("roof", "IfcRoof", "Roof")
    wall = Element("facade", "IfcCurtainWall", "Facade")
    door = replace(box("door", 4, 3, 0, 5, 3.1, 2, ifc_class="IfcDoor"), parent="facade")
    task = bn.load_task("inspection_building")
    environment = bn.make_environment(room(elements=[roof, slab, wall, door]), task)
    assert [target.global_id for target in environment.targets] == ["door", "facade", "roof"]
    assert environment.targets[2].footprint.area == pytest.approx(20)
    assert [(one.global_id, one.by) for one in environment.overruled] == [("slab", "a part of the target Roof (roof)")]
    assert not environment.issues


def test_a_room_is_called_by_its_number_and_its_name():
    house = room()
    house = replace(house, spaces=(replace(house.spaces[0], name="101", long_name="Archive"),))
    (target,) = bn.make_environment(house, bn.load_task("cleaning_rooms")).targets
    assert (target.name, target.label) == ("101 Archive", "storage")


def test_a_sprinkler_under_a_slab_is_looked_at_from_below():
    environment = bn.make_environment(
        building("fm/BasicFM_wAssembly.ifc"), bn.load_task("inspection_fire"), bn.Robot(radius=0.25)
    )
    sprinklers = [target for target in environment.targets if target.label == "sprinkler or other suppression"]
    assert [target.destination[2] for target in sprinklers] == [0.0, 0.0, 0.0]


def test_nearly_every_pipe_of_a_plant_knows_the_valve_that_shuts_it_off():
    plant = building("mep/b03_heating_with_building_blenderBIM.ifc")
    pipes = [hit.element for hit in match(bn.load_task("maintenance_leak").targets[0], plant)]
    ways = [plant.asset(pipe.global_id).find_upstream("valve") for pipe in pipes]
    assert len(pipes) == 100
    assert sum(bool(way) and way[-1].ifc_class == "IfcValve" for way in ways) == 98
