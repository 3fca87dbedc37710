"""The sample office from end to end: two storeys, a lift, stairs, and assets in a circuit."""

from __future__ import annotations

import bimnav as bn


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
