"""Where a robot stands to serve a target."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav._service_check import unserved
from bimnav._sight import points_on, sight_of
from bimnav.building import Building, Shape, Space, Storey
from bimnav.tasks import Rule, Standoff, Task
from bimnav.testing import box, prism_shape, room, two_rooms
from tests.conftest import real_model

ARM = bn.Robot("arm", radius=0.2, height=1.2, reach=1.0, reach_height=2.0)


def graph_of(building, robot=ARM, *, approach="center", cell_size=0.1, words=("valve",)):
    task = Task("look", targets=[Rule(words=list(words), destination=approach)])
    return bn.build_graph(bn.make_environment(building, task, robot), cell_size=cell_size)


def the_stop(building, robot=ARM, **more):
    (stop,) = graph_of(building, robot, **more).stops
    return stop


def the_loss(building, robot=ARM, **more):
    stops, (lost,) = graph_of(building, robot, **more).stops_from(None)
    assert not stops
    return lost


def test_a_valve_on_a_wall_is_served_from_its_own_side_and_faced():
    valve = box("valve", 3.85, 2.0, 0.9, 4.0, 2.2, 1.1, name="Valve")  # on the west face of the wall between
    stop = the_stop(two_rooms(door_width=None, elements=[valve]))
    assert stop.approach == "standing"
    assert all(stand.end[0] < 3.85 for stand in stop.candidates)
    assert stop.end[0] == pytest.approx(3.65, abs=0.1)  # as near as its radius lets it
    for stand in stop.candidates:
        x, y = stop.destination[0] - stand.end[0], stop.destination[1] - stand.end[1]
        assert stand.heading == pytest.approx(math.atan2(y, x))
        assert stand.distance == pytest.approx(math.hypot(x, y))


def test_candidates_lie_around_a_target_best_first():
    tank = box("tank", 2.0, 1.5, 0, 3.0, 2.5, 1.5, name="Valve tank")
    stop = the_stop(room(elements=[tank]))
    assert len(stop.candidates) == 8
    assert (stop.cell, stop.end) == stop.candidates[0][:2]
    distances = [stand.distance for stand in stop.candidates]
    assert distances == sorted(distances)
    angles = [math.atan2(s.end[1] - 2.0, s.end[0] - 2.5) for s in stop.candidates]
    apart = [abs(math.remainder(a - b, math.tau)) for k, a in enumerate(angles) for b in angles[:k]]
    assert min(apart) >= math.radians(30)
    other = stop.at(stop.candidates[3])
    assert (other.cell, other.heading) == (stop.candidates[3].cell, stop.candidates[3].heading)
    assert other.candidates == stop.candidates


def test_what_is_sunk_into_a_wall_is_served_from_the_side_it_is_nearest_to():
    valve = box("valve", 4.02, 2.0, 0.9, 4.08, 2.2, 1.1, name="Valve")  # inside a wall from x = 4.0 to 4.2
    stop = the_stop(two_rooms(door_width=None, elements=[valve]))
    assert all(stand.end[0] < 4.0 for stand in stop.candidates)


def test_what_lies_behind_a_wall_is_not_served_through_it():
    valve = box("valve", 4.3, 2.0, 0.9, 4.5, 2.2, 1.1, name="Valve")
    building = two_rooms(door_width=None, elements=[valve])
    closed = replace(building, spaces=building.spaces[:1])  # the room behind is no floor
    lost = the_loss(closed)
    assert lost.blocking == ("wall-between",)
    assert "something hides it: Wall between (wall-between)" in lost.reason


def test_a_robot_with_a_short_arm_is_told_how_far_it_is_off():
    tank = box("tank", 1.0, 1.0, 0, 4.0, 3.0, 1.5, name="Tank")
    valve = box("valve", 2.45, 1.95, 1.5, 2.55, 2.05, 1.6, name="Valve")  # in the middle of its top
    building = room(elements=[tank, valve])
    lost = the_loss(building, replace(ARM, reach=0.5))
    assert lost.blocking == ("tank",)
    assert 0.5 < lost.miss < 1.0
    assert "the robot reaches 0.5 m: Tank (tank)" in lost.reason
    assert the_stop(building, replace(ARM, reach=1.5)).approach == "standing"


def test_a_sensor_under_the_ceiling_needs_an_arm_as_high():
    sensor = box("sensor", 2.0, 2.0, 2.4, 2.2, 2.2, 2.5, name="Valve sensor")
    building = room(elements=[sensor])
    lost = the_loss(building)
    assert lost.miss == pytest.approx(0.4)
    assert "2.40 m above the floor, 0.40 m higher than the robot reaches" in lost.reason
    high = the_stop(building, replace(ARM, reach_height=2.4))
    assert (high.approach, high.heading) == ("center", None)
    assert the_stop(building, bn.Robot()).approach == "center"  # the paper's robot reaches up to any height


@pytest.mark.parametrize(("height", "is_hidden"), [(0.8, False), (2.4, True)])
def test_only_what_is_higher_than_the_line_of_sight_hides(height, is_hidden):
    valve = box("valve", 4.9, 2.0, 1.0, 5.0, 2.2, 1.2, name="Valve")
    shelf = box("shelf", 4.4, 0.0, 0.0, 4.6, 4.0, height, name="Shelf")  # all along the wall, before the valve
    building = room(elements=[valve, shelf])
    if is_hidden:
        assert the_loss(building).blocking == ("shelf",)
    else:
        assert the_stop(building).end[0] < 4.4


def test_a_narrow_piece_of_wall_hides_and_a_narrow_post_does_not():
    valve = box("valve", 4.9, 2.0, 1.0, 5.0, 2.1, 1.1, name="Valve")
    for ifc_class in ("IfcWall", "IfcMember"):
        piece = box("piece", 4.8, 1.95, 0.0, 4.89, 2.15, 2.5, ifc_class=ifc_class)
        stop = the_stop(room(elements=[valve, piece]))
        is_straight = any(abs(stand.end[1] - 2.05) < 0.25 for stand in stop.candidates)
        assert is_straight == (ifc_class == "IfcMember")


def test_a_door_hides_nothing_unless_it_is_locked_and_a_window_does():
    valve = box("valve", 4.3, 1.9, 1.0, 4.4, 2.1, 1.2, name="Valve")
    building = two_rooms(elements=[valve])
    west = replace(building, spaces=building.spaces[:1])
    assert the_stop(west).end[0] < 4.3
    locked = Task("look", targets=[Rule(words=["valve"])], doors=[Rule("IfcDoor", state="locked")])
    graph = bn.build_graph(bn.make_environment(west, locked, ARM), cell_size=0.1)
    assert [lost.blocking for lost in graph.stops_from(None)[1]] == [("door",)]
    glass = box("glass", 4.25, 0.0, 0.0, 4.28, 4.0, 2.5, ifc_class="IfcWindow", name="Glass")
    hidden = replace(west, elements=(*west.elements, glass))
    stops, lost = graph_of(hidden).stops_from(None)
    assert not stops or all(stop.end[0] > 4.0 for stop in stops)
    assert {g for each in lost for g in each.blocking} <= {"glass", "wall-between"}


@pytest.mark.parametrize(("side", "is_there"), [("front", "south"), ("back", "north"), ("any", "")])
@pytest.mark.parametrize("turn", [0.0, math.pi / 2])
def test_a_standoff_keeps_its_distance_and_its_side(side, is_there, turn):
    c, s = math.cos(turn), math.sin(turn)
    placement = np.array([[c, -s, 0, 2.5], [s, c, 0, 2.0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    mesh = prism_shape([(-0.4, -0.2), (0.4, -0.2), (0.4, 0.2), (-0.4, 0.2)], 0.0, 1.5).mesh
    panel = replace(box("panel", 0, 0, 0, 1, 1, 1, name="Valve panel"), shapes=(Shape(mesh, placement),))
    stop = the_stop(room(elements=[panel]), approach=Standoff(0.6, side))
    outline = shapely.box(-0.4, -0.2, 0.4, 0.2)
    for stand in stop.candidates:
        x, y = stand.end[0] - 2.5, stand.end[1] - 2.0
        own = shapely.Point(c * x + s * y, -s * x + c * y)
        assert outline.distance(own) == pytest.approx(0.6, abs=0.08)
        if is_there:
            assert own.y < -0.2 if is_there == "south" else own.y > 0.2
        assert stand.heading is not None
    calm = the_stop(room(elements=[panel]), approach=Standoff(0.6, side, facing=False))
    assert calm.heading is None


def test_a_standoff_that_does_not_fit_is_told():
    panel = box("panel", 2.0, 0.0, 0, 3.0, 0.2, 1.5, name="Valve panel")  # its front is at the wall
    lost = the_loss(room(elements=[panel]), approach=Standoff(0.6, "front"))
    assert "no free cell at its front is 0.6 m from it" in lost.reason


def test_nearest_free_stands_beside_even_where_the_robot_could_drive_on():
    mat = box("mat", 2.0, 1.5, 0, 3.0, 2.5, 0.01, name="Valve mat")
    assert the_stop(room(elements=[mat])).approach == "center"
    beside = the_stop(room(elements=[mat]), approach="nearest_free")
    assert beside.approach == "standing"
    assert not any(shapely.box(2, 1.5, 3, 2.5).contains(shapely.Point(s.end[:2])) for s in beside.candidates)


def test_anywhere_in_a_room_is_somewhere_in_it():
    building = two_rooms(elements=[box("valve", 5.0, 2.0, 0.5, 5.2, 2.2, 1.5, name="Valve")])
    stop = the_stop(building, approach="space")
    assert stop.approach == "space"
    assert len(stop.candidates) == 8
    assert all(4.2 < stand.end[0] < 8.2 and stand.distance == 0 for stand in stop.candidates)
    tour = bn.plan_tour(graph := graph_of(building, approach="space"), graph.frame.cell_at(1.0, 2.0))
    assert tour.stops[0].end[0] < 6.0  # just inside the door, not in the middle


def two_floors(*elements, panel=0.04):
    """Two storeys; the upper one has a raised floor at 3.0 m over a slab from 2.3 to 2.6 m."""

    def slab(name, low, high):
        return box(name, 0, 0, low, 5, 4, high, ifc_class="IfcSlab", name=name)

    rooms = [
        Space(
            f"room {k}", f"room {k}", storey=f"storey {k}", shapes=(prism_shape(shapely.box(0, 0, 5, 4), z, z + 2.3),)
        )
        for k, z in enumerate((0.0, 3.0))
    ]
    return Building(
        "tower",
        (Storey("storey 0", "low", 0.0), Storey("storey 1", "high", 3.0)),
        tuple(rooms),
        (slab("ground", -0.2, 0.0), slab("slab", 2.3, 2.6), slab("panels", 3.0 - panel, 3.0), *elements),
    )


@pytest.mark.parametrize(
    ("low", "high", "storey"),
    [(2.1, 2.3, 0), (2.65, 2.8, 1), (3.0, 3.5, 1), (5.2, 5.3, 1), (0.0, 0.5, 0)],
    ids=["under the ceiling", "under the raised floor", "on it", "under the upper ceiling", "on the ground"],
)
def test_the_storey_is_the_one_from_which_a_thing_is_reached(low, high, storey):
    valve = box("valve", 2.0, 2.0, low, 2.2, 2.2, high, name="Valve")
    stop = the_stop(two_floors(valve), replace(ARM, reach_height=2.5))
    assert stop.cell.storey == storey


def test_a_thick_floor_is_not_lifted():
    valve = box("valve", 2.0, 2.0, 2.62, 2.2, 2.2, 2.7, name="Valve")
    lost = the_loss(two_floors(valve, panel=0.25), replace(ARM, reach_height=2.7))
    assert set(lost.blocking) <= {"panels", "slab"}
    assert lost.blocking


def test_what_hangs_high_in_a_hall_is_served_from_the_gallery():
    hall = two_floors()
    valve = box("valve", 2.3, 2.0, 3.2, 2.5, 2.2, 3.4, name="Valve")
    gallery = prism_shape(shapely.box(0, 0, 2, 4), 3.0, 5.3)
    spaces = (hall.spaces[0], replace(hall.spaces[1], shapes=(gallery,)))
    slab = box("slab", 0, 0, 2.8, 2, 4, 3.0, ifc_class="IfcSlab")
    building = Building("hall", hall.storeys, spaces, (slab, valve))
    stop = the_stop(building)
    assert stop.cell.storey == 1
    assert stop.end[0] < 2.0


def test_a_target_outside_the_map_is_listed_and_not_an_error():
    far = box("valve", 9.0, 2.0, 0.5, 9.2, 2.2, 1.0, name="Valve")
    lost = the_loss(room(elements=[far]))
    assert lost.cell is None
    assert "no free cell" in lost.reason or "nearest free cell" in lost.reason
    near = box("valve", 5.2, 2.0, 0.5, 5.3, 2.2, 1.0, name="Valve")  # on the outside of the east wall
    assert the_loss(room(elements=[near])).blocking == ("wall-east",)


@settings(max_examples=25, deadline=None)
@given(
    x=st.floats(0.3, 7.9),
    y=st.floats(0.2, 3.8),
    z=st.floats(0.1, 1.8),
    reach=st.floats(0.5, 3.0),
    radius=st.sampled_from([0.0, 0.15, 0.3]),
)
def test_every_candidate_is_free_in_reach_and_on_the_free_side(x, y, z, reach, radius):
    valve = box("valve", x, y, z, x + 0.05, y + 0.05, z + 0.05, name="Valve")
    robot = bn.Robot("r", radius=radius, height=1.0, reach=reach, reach_height=2.0)
    building = two_rooms(door_width=None, elements=[valve])
    graph = graph_of(building, robot, approach="nearest_free", cell_size=0.2)
    for stop in graph.stops:
        middle = shapely.Point(x + 0.025, y + 0.025)
        walls = [o.footprint for o in graph.environment.obstacles if o.global_id.startswith("wall")]
        for stand in stop.candidates:
            assert graph.free[stand.cell]
            place = shapely.Point(stand.end[:2])
            assert place.distance(middle) <= reach + 0.05
            sight = shapely.LineString([place, middle])
            assert all(w.contains(middle) or w.distance(middle) < 0.06 or not w.intersects(sight) for w in walls)


def test_lines_of_sight_agree_with_the_exact_plan_of_upright_walls():
    rng = np.random.default_rng(4)
    walls = []
    for k, (x, y, turn) in enumerate(rng.uniform((0, 0, 0), (8, 8, math.pi), (12, 3)).tolist()):
        plan = shapely.affinity.translate(
            shapely.affinity.rotate(shapely.box(-1, -0.1, 1, 0.1), turn, use_radians=True), x, y
        )
        walls.append(replace(box(f"w{k}", 0, 0, 0, 1, 1, 1), shapes=(prism_shape(plan, 0.0, 2.0),)))
    plans = [shapely.Polygon(wall.shapes[0].world_vertices()[:4, :2]) for wall in walls]
    begins, ends = rng.uniform(0, 8, (2, 400, 3))
    begins[:, 2], ends[:, 2] = 0.5, 1.5
    scene = sight_of(replace(room(), elements=tuple(walls))).within(np.array([[-9, -9, -9], [9, 9, 9.0]]))
    first, left = scene.hits(begins, ends)
    for begin, end, hit, far in zip(begins, ends, first, left, strict=True):
        line = shapely.LineString([begin[:2], end[:2]])
        inside = any(plan.distance(shapely.Point(p[:2])) < 0.02 for plan in plans for p in (begin, end))
        if inside:
            continue  # a line that begins in a wall
        assert (hit >= 0) == any(plan.intersects(line) for plan in plans)
        if hit >= 0:
            assert plans[hit].intersects(line)
            assert 0 < far <= np.linalg.norm(end - begin) + 1e-9


def test_points_on_a_shape_are_its_own_and_far_apart():
    shapes = room().elements[0].shapes
    points = points_on(shapes)
    assert len(points) == 12
    low, high = shapes[0].bounds
    assert ((points >= low - 1e-9) & (points <= high + 1e-9)).all()
    assert len(points_on(())) == 0


def test_sockets_and_switches_of_the_duplex_are_served_from_their_rooms():
    files = ("duplex/Duplex_A_20110907.ifc", "duplex/Ifc2s3_Duplex_Electrical.ifc")
    building = bn.read_ifc([real_model(name) for name in files])
    task = Task("look", targets=[Rule("IfcFlowTerminal")])
    graph = bn.build_graph(bn.make_environment(building, task, replace(ARM, reach_height=3.0)), cell_size=0.1)
    stops, unreached = graph.stops_from(None)
    assert len(stops) >= 74  # the others are sockets behind a stove, a fridge or a bed, and a board on the facade
    assert all(lost.blocking and lost.miss is not None for lost in unreached)
    assert not list(unserved([stop.at(stand) for stop in stops for stand in stop.candidates], graph.environment))
    party = next(e for e in building.elements if "Party Wall" in e.name).bounds
    for stop in stops:  # nothing is served through the wall between the two flats
        sides = [np.sign(y - party[:, 1].mean()) for y in (stop.end[1], stop.destination[1])]
        near = abs(stop.destination[1] - party[:, 1].mean()) < 0.25
        assert near or sides[0] == sides[1], stop.name


def test_the_judge_refuses_a_stop_behind_a_wall_and_one_too_far_away():
    valve = box("valve", 3.85, 0.5, 0.9, 4.0, 0.7, 1.1, name="Valve")
    building = two_rooms(elements=[valve])
    graph = graph_of(building)
    tour = bn.plan_tour(graph, graph.frame.cell_at(1.0, 2.0))
    assert bn.check_plan(tour).ok

    def kinds(x, y):
        end = (x, y, 0.0)
        wrong = replace(tour.stops[0], cell=graph.frame.cell_at(x, y), end=end, candidates=())
        there = bn.plan_tour(graph, tour.start, [wrong])
        return {violation.kind for violation in bn.check_plan(there).violations}

    assert kinds(4.55, 0.55) == {"hidden"}  # in the other room
    assert kinds(2.05, 0.55) == {"out-of-reach"}
    assert kinds(3.55, 0.95) == set()


def test_zones_lie_under_things_that_hang_and_under_sheets_on_the_floor():
    things = {
        "wet floor": box("wet floor", 1, 0, 0.0, 2, 4, 0.001, name="Wet floor"),
        "projector": box("projector", 3, 0, 2.0, 4, 4, 2.2, name="Projector"),
        "rack": box("rack", 4.2, 0, 0.4, 4.9, 1, 2.0, name="Rack"),
    }
    task = Task("go", avoid=[Rule(words=["wet floor", "projector"], factor=5.0)], restricted=[Rule(words=["rack"])])
    environment = bn.make_environment(room(elements=things.values()), task, bn.Robot(height=0.3))
    assert {zone.global_id: (zone.storey, zone.factor) for zone in environment.zones} == {
        "wet floor": (0, 5.0),
        "projector": (0, 5.0),
        "rack": (0, math.inf),
    }
    graph = bn.build_graph(environment, cell_size=0.1)
    costs = [
        float(graph.cost[graph.frame.cell_at(x, y, storey=0)]) for x, y in ((1.5, 2), (3.5, 2), (0.5, 2), (4.5, 0.5))
    ]
    assert costs == [5.0, 5.0, 1.0, math.inf]
