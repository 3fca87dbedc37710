"""Arguments of the wrong kind, as a user who is new here gives them."""

from __future__ import annotations

import dataclasses
import inspect
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

import bimnav as bn
from bimnav.errors import InputError


@pytest.fixture(scope="module")
def graph():
    return bn.NavGraph.from_mask(np.ones((4, 4), dtype=bool))


@pytest.mark.parametrize("given", [None, 3, b"house.ifc", [None]])
def test_what_is_no_path_of_a_model_is_refused(given):
    with pytest.raises(InputError, match="no path"):
        bn.read_ifc(given)


@pytest.mark.parametrize("cell", [None, "abc", (1, 2), (0, 1.5, 2), 7])
def test_what_is_no_cell_is_refused(graph, cell):
    with pytest.raises(InputError, match="no cell"):
        bn.find_path(graph, bn.Cell(0, 0, 0), cell)


@pytest.mark.parametrize("cell", [(0, 1, 2), np.array([0, 1, 2])])
def test_three_whole_numbers_are_a_cell(graph, cell):
    assert bn.find_path(graph, bn.Cell(0, 0, 0), cell).length == pytest.approx(1 + 2**0.5)


@pytest.mark.parametrize("field", ["radius", "height", "speed", "battery_wh", "name"])
def test_a_robot_is_made_of_numbers_and_a_name(field):
    with pytest.raises(InputError, match=field):
        bn.Robot(**{field: ["one"]})


@pytest.mark.parametrize("size", ["0.1", None, [1], np.nan])
def test_a_cell_size_is_a_number(size):
    with pytest.raises(InputError, match="cell size"):
        bn.GridFrame.covering((0, 0, 1, 1), size, elevations=(0.0,))


def test_an_environment_is_made_of_a_building_a_task_and_a_robot():
    building = bn.Building("house", (bn.Storey("G", "Ground", 0.0),))
    task = bn.load_task("cleaning")
    with pytest.raises(InputError, match="load_task"):
        bn.make_environment(building, "cleaning")
    with pytest.raises(InputError, match="read_ifc"):
        bn.make_environment("house.ifc", task)
    with pytest.raises(InputError, match="load_robot"):
        bn.make_environment(building, task, "scrubber")


@pytest.mark.parametrize("seed", [-1, "a", 1.5, None])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(InputError, match="seed"):
        bn.run("house.ifc", seed=seed)


@pytest.mark.parametrize("target", [3, "x", {"name": "spill"}, ("spill", "here", 1), (1, 2, 3), ("\udcff", 2, 16)])
def test_what_is_no_target_is_refused(target):
    building = bn.Building("house", (bn.Storey("G", "Ground", 0.0),))
    with pytest.raises(InputError, match="target"):
        building.with_targets([target])


@pytest.fixture(scope="module")
def apartment():
    return bn.make_environment(bn.read_ifc(bn.sample("apartment")), bn.load_task("cleaning"))


@pytest.mark.parametrize("place", ["abc", (1,), 5, ("x", 2), (None, None), (np.inf, 2)])
def test_what_is_no_place_is_refused(apartment, place):
    graph = bn.build_graph(apartment, cell_size=0.3048)
    with pytest.raises(InputError, match=r"no place|not a point"):
        bn.find_start(graph, place)


def test_a_study_without_robots_is_refused(apartment):
    with pytest.raises(InputError, match="robots"):
        bn.study(apartment, starts=[(3.1, 15.9)], robots=[1, 0])


@pytest.fixture(scope="module")
def world(apartment):
    """Return one of everything that public functions take."""
    graph = bn.build_graph(apartment, cell_size=0.3048)
    start = bn.find_start(graph).cell
    tour = bn.plan_tour(graph, start)
    return SimpleNamespace(
        building=apartment.building,
        task=apartment.task,
        environment=apartment,
        graph=graph,
        start=start,
        goal=tour.stops[0].cell,
        tour=tour,
        result=bn.simulate(tour),
        study=bn.study(apartment, starts=[(3.1, 15.9)], connectivity=8),
    )


SQUARE = shapely.box(1, 16, 2, 17)
MATRIX = [[0, 1], [1, 0]]


@pytest.mark.parametrize(
    ("words", "call"),
    [
        # paths and distances
        ("graph is None, not a NavGraph. Make it with build_graph", lambda w: bn.find_path(None, w.start, w.goal)),
        ("graph is 3, not a NavGraph", lambda w: bn.distance_field(3, w.start)),
        ("sources is 7, not a list", lambda w: bn.distance_field(w.graph, 7)),
        ("graph is 3, not a NavGraph", lambda w: bn.LiveField(3, w.start)),
        ("sources is 7, not a list", lambda w: bn.LiveField(w.graph, 7)),
        ("graph is 3, not a NavGraph", lambda w: bn.LiveField(w.graph, w.start).update(3)),
        ("cells is None, not a list", lambda w: bn.distance_matrix(w.graph, None)),
        ("cell is 'a'", lambda w: bn.distance_matrix(w.graph, ["a"])),
        ("start is 3, which is no cell", lambda w: bn.why_unreachable(w.graph, 3, w.goal)),
        ("start is None, which is no cell", lambda w: bn.adaptive_graph(w.graph).find_path(None, w.goal)),
        ("largest is 'a'", lambda w: bn.adaptive_graph(w.graph, largest="a")),
        ("turn_cost is 'a'", lambda w: bn.find_poses(w.graph, (3.1, 15.9), (3.2, 15.9), turn_cost="a")),
        ("exits is 3, not a list", lambda w: bn.egress_distances(w.graph, 3)),
        ("radius is 'a', not a number", lambda w: bn.find_passages(w.graph, "a")),
        # tours
        (r"stops\[0\] is 3, not a Stop. Take those of a graph", lambda w: bn.plan_tour(w.graph, w.start, [3])),
        ("stops is 3, not a list", lambda w: bn.plan_tour(w.graph, w.start, 3)),
        ("robot is 'R1', not a Robot", lambda w: bn.plan_tour(w.graph, w.start, robot="R1")),
        ("start_point is 3", lambda w: bn.plan_tour(w.graph, w.start, start_point=3)),
        (r"chargers\[0\] is 3", lambda w: bn.plan_tour(w.graph, w.start, chargers=[3])),
        ("priority of Stop is 'high'", lambda w: dataclasses.replace(w.tour.stops[0], priority="high")),
        ("starts is None, not a list", lambda w: bn.plan_tours(w.graph, None)),
        (r"robots\[0\] is 'R1'", lambda w: bn.plan_tours(w.graph, [w.start], robots=["R1"])),
        ("2 start_points and 1 starts", lambda w: bn.plan_tours(w.graph, [w.start], start_points=[(0, 0, 0)] * 2)),
        ("matrix is 'abc', not an array of numbers", lambda w: bn.order_stops("abc")),
        ("time_limit is -1", lambda w: bn.order_stops(MATRIX, time_limit=-1)),
        ("time_limit is nan", lambda w: bn.order_stops(MATRIX, time_limit=np.nan)),
        ("start is 0.5, not a whole number", lambda w: bn.order_stops(MATRIX, 0.5)),
        ("due is 'late'", lambda w: bn.order_stops(MATRIX, due="late")),
        ("starts is 0, not a list", lambda w: bn.assign_stops(MATRIX, 0)),
        ("a start is None", lambda w: bn.assign_stops(MATRIX, [None])),
        ("time_limit is 'a'", lambda w: bn.assign_stops(MATRIX, [0], time_limit="a")),
        # graphs and their changes
        ("environment is 'house'", lambda w: bn.build_graph("house")),
        ("clearance is 'a', not a number", lambda w: bn.build_graph(w.environment, clearance="a")),
        ("clearance is -1", lambda w: bn.build_graph(w.environment, clearance=-1)),
        ("clearance is 'a'", lambda w: w.graph.with_clearance("a")),
        ("the weight of a clearance is None", lambda w: w.graph.with_clearance(0.3, None)),
        ("factor is 'a'", lambda w: w.graph.with_cost("a")),
        (r"factor is \(2,\)", lambda w: w.graph.with_cost([1, 2])),
        ("cells is 3, not a list", lambda w: w.graph.block(3)),
        ("cell is 'a', which is no cell", lambda w: w.graph.unblock(["a"])),
        ("polygon is 'a', not a Geometry", lambda w: w.graph.with_obstacle("a")),
        ("cell is None", lambda w: w.graph.explain(None)),
        (r"connectors\[0\] is 3, not a Link", lambda w: bn.NavGraph.from_mask([[True]], connectors=[3])),
        ("rows is 'a'", lambda w: bn.GridFrame(0.1, 0, 0, "a")),
        (r"\('a', 0\) is not a point", lambda w: w.graph.frame.cell_at("a", 0)),
        ("polygons is 3, not a list", lambda w: bn.rasterize(w.graph.frame, 3)),
        ("graph is None, not a NavGraph", lambda w: bn.Replanner(w.graph, w.start, w.goal).update(None)),
        # buildings
        ("robot is 'x', not a Robot", lambda w: w.building.readiness("x")),
        ("query is 3, not a str. Give a text", lambda w: w.building.select(3)),
        ("GlobalId", lambda w: w.building[[]]),
        ("GlobalId", lambda w: w.building.asset([])),
        ("targets is 3, not a list", lambda w: w.building.with_targets(3)),
        (r"storeys\[0\] is 'Ground', not a Storey", lambda w: bn.Building("house", ("Ground",))),
        (r"buildings\[0\] is 'a'", lambda w: bn.federate(["a"])),
        ("path is 3, not a path", lambda w: bn.read_targets(3)),
        ("task is 3, not a path", lambda w: bn.load_task(3)),
        ("robot is 3, not a path", lambda w: bn.load_robot(3)),
        ("keys is 3, not a list", lambda w: bn.Robot(keys=3)),
        (
            "floor_from has 'spaces'. Known are space",
            lambda w: bn.make_environment(w.building, w.task, floor_from=["spaces"]),
        ),
        ("global_id is 3, not a str", lambda w: w.building.properties(3)),
        ("global_id is 3", lambda w: w.environment.explain(3)),
        ("kind is 3", lambda w: w.building.asset(w.building.elements[0].global_id).find_upstream(3)),
        ("filter is 3", lambda w: bn.Rule(3)),
        ("name is None", lambda w: bn.Task(None, "")),
        ("tasks_path is 3, not a list", lambda w: bn.list_tasks(tasks_path=3)),
        ("robots_path is None, not a path", lambda w: bn.list_robots(robots_path=[None])),
        ("cache is 3, not a path", lambda w: bn.read_ifc(bn.sample("apartment"), cache=3)),
        ("x is 'a', not a number", lambda w: bn.topology(w.graph).place_at("a", 0, 0)),
        ("points is 'a'", lambda w: bn.topology(w.graph).along("a")),
        # simulation
        ("plan is 'tour', not a Tour", lambda w: bn.simulate("tour")),
        ("graph is 3", lambda w: bn.simulate(w.tour, 3)),
        ("robot is 'R1'", lambda w: bn.simulate(w.tour, robot="R1")),
        ("3 is no change of the world", lambda w: bn.simulate(w.tour, events=[3])),
        (r"people\[0\] is 'Ann', not a Person", lambda w: bn.simulate(w.tour, people=["Ann"])),
        ("doors is 3", lambda w: bn.simulate(w.tour, doors=3)),
        ("patience is 'a'", lambda w: bn.simulate(w.tour, patience="a")),
        ("rng is 0, not a Generator. Make it with numpy", lambda w: bn.simulate(w.tour, rng=0)),
        ("on_event is 3, not a function", lambda w: bn.simulate(w.tour, on_event=3)),
        ("policy is 'hope'", lambda w: bn.simulate(w.tour, policy="hope")),
        ("the speed of robot 'R1' is 'fast'", lambda w: bn.simulate(w.tour, speed="fast")),
        ("time of DoorLocks is 'noon'", lambda w: bn.DoorLocks("noon", "a")),
        ("width of Emergency is -1", lambda w: bn.Emergency(1.0, width=-1)),
        ("polygon of Passage is 3", lambda w: bn.Passage("gap", 3)),
        ("speed of SpeedLimit is 'a'", lambda w: bn.SpeedLimit(SQUARE, "a")),
        ("speed of Person is 'a'", lambda w: bn.Person("Ann", speed="a")),
        ("the route of 'Ann' is no line", lambda w: bn.Person("Ann", 3)),
        ("storey of Person is 5", lambda w: bn.simulate(w.tour, people=[bn.Person("Ann", storey=5)])),
        ("capacity of Lift is 'a'", lambda w: bn.Lift("lift", 0, 0, capacity="a")),
        ("range of Sensing is 'a'", lambda w: bn.Sensing("a")),
        ("opening_time of SimDoor is 'a'", lambda w: bn.SimDoor("door", opening_time="a")),
        ("values is 3, not a list", lambda w: bn.Chance("uniform", 3, "s")),
        ("time is 'a', not a number", lambda w: w.result.state_at("a")),
        ("path is 3, not a path", lambda w: w.result.to_html(3)),
        ("step is 'a'", lambda w: w.result.trajectory("a")),
        ("height is 'a'", lambda w: w.result.show(height="a")),
        # studies
        ("environment is None", lambda w: bn.study(None, starts=[(3.1, 15.9)])),
        ("starts is 3, not a list", lambda w: bn.study(w.environment, starts=3)),
        ("a start is 3, not a list", lambda w: bn.study(w.environment, starts=[3])),
        ("a number of robots is 0", lambda w: bn.study(w.environment, starts=[(3.1, 15.9)], robots=[0])),
        ("a seed is -1", lambda w: bn.study(w.environment, starts=[(3.1, 15.9)], seeds=[-1])),
        ("a set of doors is 'd', not a list", lambda w: bn.study(w.environment, starts=[(3, 15)], closed_doors=["d"])),
        ("connectivity is 6", lambda w: bn.study(w.environment, starts=[(3.1, 15.9)], connectivity=6)),
        ("confidence is 'a'", lambda w: w.study.summary("length", confidence="a")),
        # checks
        ("tour is None, not a Tour", lambda w: bn.check_plan(None)),
        ("points is 'a', not an array", lambda w: bn.check_path("a", w.environment)),
        ("ignore is 3, not a list", lambda w: bn.check_path(w.tour.route[0], w.environment, ignore=3)),
        ("environment is None", lambda w: bn.check_poses([[0, 0, 0, 0]], None)),
        # figures
        ("building is 3, not a Building", lambda w: bn.plot_building(3)),
        ("environment is 3", lambda w: bn.plot_environment(3)),
        ("graph is 3", lambda w: bn.plot_graph(3)),
        ("field is 'a'", lambda w: bn.plot_field(w.graph, "a")),
        ("tour is 3, not a Tour. Make it with plan_tour", lambda w: bn.plot_tour(3)),
        ("plan is 3, not a TeamPlan", lambda w: bn.plot_fleet(3)),
        ("study is 3, not a Study", lambda w: bn.plot_study(3)),
        ("result is 3, not a SimResult", lambda w: bn.plot_timeline(3)),
        ("result is 3, not a SimResult", lambda w: bn.animate(3, "a.gif")),
        ("storey is 9. Give a number from 0 to 0", lambda w: bn.plot_graph(w.graph, storey=9)),
        ("ax is 3, not an Axes", lambda w: bn.plot_tour(w.tour, ax=3)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_wrong_argument_is_named_with_its_value(world, words, call):
    with pytest.raises(bn.BimnavError, match=words):
        call(world)


FUNCTIONS = [
    name
    for name in bn.__all__
    if inspect.isfunction(getattr(bn, name)) and not name.startswith("list_")  # these need nothing
]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_public_function_fails_on_a_wrong_argument_with_anything_but_an_error_of_ours(name):
    function = getattr(bn, name)
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
    given = [object() for p in needed if p.kind is not p.KEYWORD_ONLY]
    named = {p.name: object() for p in needed if p.kind is p.KEYWORD_ONLY}
    with pytest.raises(bn.BimnavError) as caught:
        function(*given, **named)
    assert caught.value.hint


def test_a_study_of_which_nothing_can_be_played_says_so_once(apartment, caplog):
    study = bn.study(apartment, starts=[(99.0, 99.0)], speeds=[0.5, 1.0])
    assert [record.getMessage() for record in caplog.records] == [repr(study)]
    assert repr(study).startswith("Study(none of 2 scenarios could be played: ")
    with pytest.raises(InputError, match="nothing to draw: Study"):
        bn.plot_study(study)
