"""What blocks by meaning, which rule decides, and how doors are."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from bimnav.building import Building, Door, Element, Ledger, Mesh, Shape, Space, Storey
from bimnav.environment import make_environment
from bimnav.errors import GridError, ModelError, TaskError
from bimnav.graph import build_graph
from bimnav.grid import Cell
from bimnav.ifc import read_ifc
from bimnav.mission import run
from bimnav.robot import Robot
from bimnav.tasks import Rule, Task
from tests.conftest import real_model


def block(x, y, z, width, depth, height):
    """Return a box by its lower corner and its size."""
    corners = [(x + i * width, y + j * depth, z + k * height) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return (Shape(Mesh(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])),)


def proxy(name, type_name="", predefined_type=""):
    shapes = block(2, 2, 0, 0.5, 0.5, 1.8)
    return Element(name, "IfcBuildingElementProxy", name, type_name, predefined_type=predefined_type, shapes=shapes)


def room_with(*elements):
    return Building(
        "room",
        (Storey("s", "Ground", 0.0),),
        spaces=(Space("room", "1", "Hall", "s", shapes=block(0, 0, 0, 6, 6, 3)),),
        elements=elements,
    )


def blocking(environment):
    return {obstacle.global_id for obstacle in environment.obstacles}


@pytest.mark.parametrize(
    "figure",
    [
        proxy("RPC Female:YinYin:123"),
        proxy("RPC Tree - Deciduous:Scarlet Oak:5"),
        proxy("BuildingElementProxy", "Man Standing with Turban"),
        proxy("Baum", "Laubbaum"),
        proxy("Coche:Sedán:77"),
        proxy("汽车"),
        proxy("Figure", predefined_type="ENTOURAGE"),
        Element("green", "IfcGeographicElement", "Lawn", shapes=block(2, 2, 0, 1, 1, 1)),
    ],
    ids=lambda figure: figure.name,
)
def test_entourage_does_not_block_and_is_listed_with_the_reason(figure):
    environment = make_environment(room_with(figure), Task("any"))
    assert not environment.obstacles
    [(global_id, why)] = environment.left_out
    assert global_id == figure.global_id
    assert why.startswith("entourage: ")
    asked = make_environment(room_with(figure), Task("any", entourage="block"))
    assert blocking(asked) == {figure.global_id}


@pytest.mark.parametrize(
    "name",
    [
        "Sofa 3 personas", "Table for 6 people", "Manhole cover", "Elevator Car", "Hand truck", "Car park barrier",
        "Tree grate", "Potted tree", "Coat tree", "Carro de limpieza", "WC men", "Children slide", "Kast van hout",
        "Autoclave", "Menlo cabinet", "Forklift truck", "Person counting sensor",
    ],
)  # fmt: skip
def test_what_only_sounds_like_entourage_blocks(name):
    assert blocking(make_environment(room_with(proxy(name)), Task("any"))) == {name}


def test_the_class_decides_with_the_words_a_sofa_named_man_is_furniture():
    sofa = Element("sofa", "IfcFurniture", "Man cave sofa", shapes=block(2, 2, 0, 1, 1, 1))
    assert blocking(make_environment(room_with(sofa), Task("any"))) == {"sofa"}


def test_a_figure_of_a_real_model_is_entourage():
    environment = make_environment(
        read_ifc(real_model("rooms/3rooms_Heater_AirTerminal_Table_with_SB.ifc")), Task("any")
    )
    assert dict(environment.left_out)["2qe$lp$Un4i9NnfBo4VcXN"] == "entourage: its type is ENTOURAGE"


def test_no_door_part_of_one_opening_or_room_blocks_even_if_a_rule_says_so():
    door = Element("door", "IfcDoor", "D1", shapes=block(2, 2, 0, 1, 0.1, 2))
    pane = Element("pane", "IfcPlate", "glass", parent="leaf", shapes=block(2, 2, 0, 1, 0.1, 2))
    leaf = Element("leaf", "IfcMember", "leaf", parent="door", shapes=block(2, 2, 0, 1, 0.1, 2))
    wall = Element("wall", "IfcWall", "W", shapes=block(0, 4, 0, 6, 0.2, 3))
    task = Task("all", obstacles=[Rule("IfcProduct", label="everything")])
    environment = make_environment(room_with(door, pane, leaf, wall), task)
    assert blocking(environment) == {"wall"}
    left_out = dict(environment.left_out)
    assert left_out == {
        "door": "a door is passable because it is a door",
        "leaf": "a part of the door D1",
        "pane": "a part of the door D1",
    }
    lost = {each.global_id: each.by for each in environment.overruled}
    assert lost == left_out | {"room": "a room is empty; `restricted` closes it"}


def test_what_speaks_first_decides_and_the_others_are_listed():
    litter = Element("litter", "IfcFurniture", "litter box", shapes=block(1, 1, 0, 0.3, 0.3, 0.3))
    tree = proxy("tree")
    rules = {
        "targets": [Rule("IfcFurniture", label="a", priority=3), Rule("IfcFurniture", label="b")],
        "ignore": [Rule("IfcFurniture", label="soft")],
        "obstacles": [Rule("IfcFurniture", label="hard"), Rule("IfcBuildingElementProxy", label="proxies")],
        "avoid": [Rule("IfcSpace", label="slow", factor=2), Rule("IfcSpace", label="slower", factor=5)],
        "restricted": [Rule("IfcSpace", ["kitchen"], label="kitchen")],
    }
    environment = make_environment(room_with(litter, tree), Task("mixed", **rules))
    assert blocking(environment) == {"tree"}  # a rule that asks for it goes before its being entourage
    assert [(target.label, target.priority) for target in environment.targets] == [("a", 3)]
    assert [zone.factor for zone in environment.zones] == [2]
    told = {(each.global_id, each.rule.split("'")[1], each.by.split("'")[1]) for each in environment.overruled}
    assert told == {
        ("litter", "b", "a"),
        ("litter", "hard", "soft"),
        ("tree", "trees", "proxies"),
        ("room", "slower", "slow"),
    }


def test_what_is_never_to_be_entered_goes_before_what_is_only_to_be_avoided():
    task = Task("t", avoid=[Rule("IfcSpace", factor=9)], restricted=[Rule("IfcSpace", ["hall"], label="closed")])
    environment = make_environment(room_with(), task)
    assert [zone.factor for zone in environment.zones] == [math.inf]
    [lost] = environment.overruled
    assert "passes the filter 'IfcSpace'" in lost.rule
    assert lost.by.startswith("restricted: rule 'closed'")


def two_rooms():
    """Return two rooms of 3 by 3 metres, a wall between them, and a door in it."""
    leaf = Element("door", "IfcDoor", "Fire door", shapes=block(2.95, 1, 0, 0.1, 1, 2))
    return Building(
        "flat",
        (Storey("s", "Ground", 0.0),),
        spaces=(
            Space("a", "1", "Hall", "s", shapes=block(0, 0, 0, 2.95, 3, 3)),
            Space("b", "2", "Store", "s", shapes=block(3.05, 0, 0, 2.95, 3, 3)),
        ),
        elements=(
            Element("south", "IfcWall", "W", shapes=block(2.95, 0, 0, 0.1, 1, 3)),
            Element("north", "IfcWall", "W", shapes=block(2.95, 2, 0, 0.1, 1, 3)),
            leaf,
        ),
        doors=(Door(leaf),),
    )


def is_joined(building, robot, **rule):
    task = Task("go", doors=[Rule("IfcDoor", **rule)] if rule else [])
    environment = make_environment(building, task, robot)
    graph = build_graph(environment, cell_size=0.25)
    a, b = (graph.frame.cell_at(x, 1.5) for x in (1.5, 4.5))
    [door] = environment.doors
    return door, bool(graph.components[a] == graph.components[b])


@pytest.mark.parametrize(
    ("robot", "rule", "passes", "why"),
    [
        (Robot(), {}, True, "the door is closed: no door rule of the task matches"),
        (Robot(), {"state": "open"}, True, "the door is open: rule 'IfcDoor'"),
        (Robot(), {"state": "locked"}, False, "the door is locked and robot 'R1' has no key: rule 'IfcDoor'"),
        (Robot(keys=["Fire door"]), {"state": "locked"}, True, "the door is locked: rule 'IfcDoor'"),
        (Robot(keys=["door"]), {"state": "locked"}, True, "the door is locked: rule 'IfcDoor'"),
        (Robot(opens_doors=False), {}, False, "the door is closed and robot 'R1' opens no doors: no door rule"),
        (Robot(opens_doors=False), {"state": "automatic", "opening_time": 3}, True, "the door is automatic: rule"),
        (Robot(opens_doors=False), {"words": ["sliding"], "state": "automatic"}, False, "the door is closed and"),
    ],
)
def test_a_door_lets_pass_whom_its_state_allows(robot, rule, passes, why):
    door, joined = is_joined(two_rooms(), robot, **rule)
    assert (door.is_passable, joined) == (passes, passes)
    assert door.rule.startswith(why)
    assert door.opening_time == rule.get("opening_time", 0)


def test_a_locked_door_blocks_from_jamb_to_jamb_and_says_why():
    environment = make_environment(two_rooms(), Task("go", doors=[Rule("IfcDoor", state="locked", label="vault")]))
    [shut] = [obstacle for obstacle in environment.obstacles if obstacle.global_id == "door"]
    assert shut.footprint.bounds == pytest.approx((2.95, 1, 3.05, 2))
    assert shut.rule.startswith("the door is locked and robot 'R1' has no key: rule 'vault'")


def test_entourage_is_ignored_or_blocks_and_nothing_else():
    with pytest.raises(TaskError, match="entourage is 'maybe'"):
        Task("any", entourage="maybe")


@pytest.mark.parametrize(
    "name", ["houses/SampleHouse4.ifc", "office/Office_A_20110811.ifc", "nasty/Jesse.1.ifc", "office/demo2.ifc"]
)
def test_no_door_opening_or_room_of_a_real_model_blocks(name):
    building = read_ifc(real_model(name))
    environment = make_environment(building, Task("any"))
    never = {door.global_id for door in building.doors} | {space.global_id for space in building.spaces}
    never |= {opening.global_id for opening in building.openings}
    assert environment.obstacles
    assert not never & blocking(environment)


# explaining


def explained_room():
    table = Element(
        "table", "IfcFurniture", "Table", shapes=(*block(1, 1, 0.7, 2, 1, 0.05), *block(1, 1, 0, 0.1, 0.1, 0.7))
    )
    mat = Element("mat", "IfcCovering", "Mat", shapes=block(1.5, 1.2, 0, 0.5, 0.5, 0.01))
    chair = Element("chair", "IfcFurniture", "Chair", shapes=block(4, 4, 0, 0.5, 0.5, 0.9))
    building = room_with(table, mat, chair).with_targets([("spill", 2.1, 1.3)])
    task = Task(
        "look",
        targets=[Rule("IfcFurniture", ["chair"], label="chairs", source="my.toml:4")],
        ignore=[Rule("IfcFurniture", ["chair"], label="soft", source="my.toml:9")],
        obstacles=[Rule("IfcFurniture", label="furniture", source="my.toml:12")],
        avoid=[
            Rule("IfcSpace", label="hall", factor=3, source="my.toml:20"),
            Rule("IfcSpace", label="all", factor=9, source="my.toml:24"),
        ],
    )
    return make_environment(building, task, Robot(radius=0.1, height=0.5))


def test_an_environment_explains_what_an_element_is_to_the_task():
    environment = explained_room()
    table = environment.explain("table")
    [legs] = table.reasons
    assert (legs.role, legs.storey, legs.low, legs.high, legs.cost) == ("obstacle", 0, 0.05, 0.5, math.inf)
    assert [(p.kind, p.label, p.source, p.decides) for p in legs.picked_by] == [
        ("obstacles", "furniture", "my.toml:12", True)
    ]
    chair = environment.explain("chair")
    assert [reason.role for reason in chair.reasons] == ["left out", "target"]
    assert [pick.source for pick in chair.reasons[0].picked_by] == ["my.toml:12", "my.toml:9"]
    assert [reason.role for reason in environment.explain("room").reasons] == ["avoid", "floor"]
    assert environment.explain("mat").reasons[0].rule == "no obstacle rule of the task matches"
    spill = environment.building.detections[0].global_id
    assert [(r.role, r.rule) for r in environment.explain(spill).reasons] == [("target", "placed by the user")]
    assert repr(environment.explain("room")).split("\n") == [
        "IfcSpace '1' (room)",
        "  avoid: storey 0, 0.000 to 3.000 m, cost 3",
        "      rule 'hall' (my.toml:20): IfcSpace passes the filter 'IfcSpace'",
        "      gives way: rule 'all' (my.toml:24): IfcSpace passes the filter 'IfcSpace'",
        "  floor: storey 0, 0.000 to 3.000 m",
        "      walkable floor of a space",
    ]
    json.dumps(table.to_dict(), allow_nan=False)
    with pytest.raises(ModelError, match="'nobody'"):
        environment.explain("nobody")


def test_a_graph_explains_a_cell_by_everything_that_touches_it():
    graph = build_graph(explained_room(), cell_size=0.2)
    at = graph.frame.cell_at
    leg = graph.explain(at(1.05, 1.05))
    assert leg.summary == "blocked by Table (table)"
    assert (leg.reasons[0].role, leg.reasons[0].rule) == (
        "obstacle",
        "rule 'furniture' (my.toml:12): IfcFurniture passes the filter 'IfcFurniture'",
    )
    beside = graph.explain(at(1.25, 1.05))
    assert beside.reasons[0].rule.endswith("the cell lies within the robot's radius of it")
    under = graph.explain(at(2.1, 1.3))
    assert under.summary == "free, cost 3, because of 1 (room)"
    assert {(reason.role, reason.name) for reason in under.reasons} == {
        ("above", "Table"),
        ("avoid", "1"),
        ("floor", "1"),
        ("target", "spill"),
    }
    assert graph.explain(at(1.7, 1.3)).reasons[1].role == "left out"  # the mat
    edge = graph.explain(at(0.01, 3))
    assert (edge.summary, edge.is_floor) == ("not wholly on walkable floor", False)
    closed = graph.block([at(5, 5)]).explain(at(5, 5))
    assert closed.summary == "closed since the graph was built"
    assert repr(leg).startswith(
        "Cell(storey=0, row=6, col=6) on Ground, x 1.000 to 1.200 m, y 1.000 to 1.200 m: blocked"
    )
    json.dumps([each.to_dict() for each in (leg, under, edge)], allow_nan=False)
    with pytest.raises(GridError):
        graph.explain((0, 999, 0))


def test_the_explanation_of_a_cell_agrees_with_the_graph_on_a_real_model():
    building = read_ifc(real_model("houses/SampleHouse4.ifc"))
    graph = build_graph(make_environment(building, Task("any"), Robot(radius=0.2)), cell_size=0.3)
    rng = np.random.default_rng(5)
    rows, cols = graph.frame.shape[1:]
    for row, col in zip(rng.integers(rows, size=60).tolist(), rng.integers(cols, size=60).tolist(), strict=True):
        cell = Cell(graph.frame.ground, row, col)
        told = graph.explain(cell)
        obstacles = {reason.global_id for reason in told.reasons if reason.role == "obstacle"}
        assert bool(obstacles) == bool(graph.obstacle[cell]), cell
        assert told.summary.startswith("free") == bool(graph.free[cell]), cell


def test_a_cell_where_something_was_lost_says_so():
    ledger = Ledger(("gone",), lost={"gone": "the kernel crashed"}, lost_bounds={"gone": [[1, 1, 0], [2, 2, 1]]})
    building = replace(room_with(Element("gone", "IfcFurniture", "Cupboard")), ledger=ledger)
    graph = build_graph(make_environment(building, Task("any")), cell_size=0.5)
    at = graph.frame.cell_at
    [lost] = [reason for reason in graph.explain(at(1.2, 1.2)).reasons if reason.role == "lost"]
    assert (lost.name, lost.low, lost.high) == ("Cupboard", 0.0, 1.0)
    assert lost.rule.endswith("the kernel crashed")
    assert all(reason.role != "lost" for reason in graph.explain(at(4, 4)).reasons)


def test_exits_are_found_like_targets_and_are_none():
    task = Task("out", exits=[Rule("IfcDoor", ["fire"], label="exit")])
    environment = make_environment(two_rooms(), task)
    assert [(way.global_id, way.label, way.storey) for way in environment.exits] == [("door", "exit", 0)]
    assert environment.targets == ()


def test_a_job_makes_least_what_its_task_says(data_ifc):
    task = Task("look", targets=[Rule("IfcFurniture", ["sofa"])], objective="time", destination="nearest_free")
    mission = run(read_ifc(data_ifc / "apartment.ifc"), task=task, cell_size=0.2)
    assert mission.graph.objective == "time"
