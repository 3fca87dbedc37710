"""The sample office from end to end: two storeys, a lift, stairs, and assets in a circuit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import bimnav as bn
from bimnav.sim.egress import egress_cells, egress_distances


def mission(**options):
    return bn.run(bn.sample("office"), cell_size=0.1, connectivity=8, **options)


def test_the_litter_of_both_storeys_is_collected_by_lift():
    done = mission(robot=bn.Robot(radius=0.2))
    assert done.is_complete
    assert {stop.cell.storey for stop in done.tour.stops} == {0, 1}
    assert done.check.ok
    assert done.start.source.startswith("charging dock")


def test_a_robot_that_climbs_takes_the_stairs_if_it_rides_in_no_lift():
    done = mission(robot=bn.Robot(radius=0.2, uses_lifts=False, max_riser=0.2, step_height=0.2))
    assert done.is_complete
    heights = {round(float(z), 2) for leg in done.tour.route for z in leg[:, 2]}
    assert 1.65 in heights  # the landing


def test_a_robot_that_neither_climbs_nor_rides_stays_below_and_says_why():
    done = mission(robot=bn.Robot(radius=0.2, uses_lifts=False))
    assert not done.is_complete
    assert {stop.cell.storey for stop in done.tour.stops} == {0}
    assert len(done.tour.unreached) == 2
    assert all(lost.reason for lost in done.tour.unreached)


def test_the_plant_is_inspected_and_every_asset_has_its_card():
    done = mission(task="inspection_mep", robot=bn.Robot(radius=0.2))
    names = " ".join(stop.name for stop in done.tour.stops)
    assert all(word in names for word in ("Boiler", "Pump", "Valve", "Distribution Board"))
    boiler = next(element for element in done.building.elements if element.ifc_class == "IfcBoiler")
    card = done.building.asset(boiler.global_id)
    assert (card.maker, card.serial_number) == ("Kestrel Heating", "C60-24-00817")


def test_a_leak_is_traced_to_the_valve_before_it():
    building = bn.read_ifc(bn.sample("office"))
    pipes = [element for element in building.elements if element.ifc_class == "IfcPipeSegment"]
    last = max(pipes, key=lambda pipe: pipe.bounds[0, 0])
    (valve, *_) = building.asset(last.global_id).find_upstream("valve")
    assert building.properties(valve.global_id)["Pset_ManufacturerOccurrence"]["SerialNumber"] == "BV40-102"


@pytest.fixture(scope="module")
def two_to_go_up():
    """Two robots on the ground floor, each with litter to fetch upstairs."""
    robot = bn.Robot(radius=0.2)
    environment = bn.make_environment(bn.read_ifc(bn.sample("office")), bn.load_task("cleaning"), robot)
    graph = bn.build_graph(environment, cell_size=0.1, connectivity=8)
    starts = bn.Cell(0, 21, 14), bn.Cell(0, 21, 28)
    above = [stop for stop in bn.plan_tour(graph, starts[0]).stops if stop.cell.storey == 1]
    tours = [bn.plan_tour(graph, start, [stop]) for start, stop in zip(starts, above, strict=True)]
    return graph, tours, [bn.Robot(name, radius=0.2) for name in "AB"]


def test_two_robots_share_the_lift_one_after_the_other(two_to_go_up):
    graph, tours, robots = two_to_go_up
    (link,) = graph.connectors
    result = bn.simulate(tours, robots=robots)
    assert set(result.served) == {tour.stops[0].global_id for tour in tours}
    rides = [(row.event, row.robot, row.time) for row in result.log if row.event in ("board_lift", "leave_lift")]
    assert [event for event, *_ in rides] == ["board_lift", "leave_lift"] * 2
    first, second = [(rides[k][2], rides[k + 1][2]) for k in (0, 2)]
    assert [end - begin for begin, end in (first, second)] == pytest.approx([link.seconds] * 2)
    assert second[0] == pytest.approx(first[1] + 3.3)  # the cabin comes down again
    ways = [np.diff(leg, axis=0) for tour in tours for leg in tour.route]
    assert result.distance == pytest.approx(sum(np.hypot(way[:, 0], way[:, 1]).sum() for way in ways))
    x, y, _ = link.points[np.abs(np.diff(link.points[:, 2])).argmax()].tolist()
    for time in np.arange(0.0, result.makespan, 0.25).tolist():  # never two in the shaft, and nobody who waits
        inside = [state for state in result.states_at(time) if np.hypot(state.x - x, state.y - y) < 1.0]
        assert len(inside) <= 1
        assert all(begin <= time <= end for s in inside for begin, end in [first if s.robot == rides[0][1] else second])


@pytest.mark.parametrize("moment", [5.0, 15.0, 45.0])
def test_in_an_emergency_robots_leave_the_ways_out_of_the_office_free(two_to_go_up, moment):
    graph, tours, robots = two_to_go_up
    distance = egress_distances(graph)
    assert np.isfinite(distance[graph.free]).mean() > 0.9
    assert distance[1][graph.free[1]].min() > distance[0][graph.free[0]].min() == 0.0
    result = bn.simulate(tours, robots=robots, events=[bn.Emergency(moment, "fire")])
    assert set(result.given_up) == {tour.stops[0].global_id for tour in tours}
    assert [row.robot for row in result.log if row.event == "park"] == [
        row.robot for row in result.log if row.event == "finish"
    ]
    needed = egress_cells(graph, distance, 1.2 + 2 * 0.2)
    names = [storey.name for storey in graph.environment.storeys]
    for state in result.states_at(result.span[1]):
        assert not needed[graph.frame.cell_at(state.x, state.y, storey=names.index(state.storey))]
    for a, b in pairwise(result.log):
        assert a.time <= b.time
