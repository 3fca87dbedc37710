"""The main job, end to end, on the sample flat in its three forms and on real houses."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest
import shapely

import bimnav as bn
from bimnav.errors import (
    GoalBlockedError,
    InputError,
    NoTargetError,
    OutsideMapError,
    StartBlockedError,
    TaskError,
    ValueRangeError,
)
from bimnav.testing import box, room, two_rooms
from tests.conftest import real_model

FOOT = 0.3048
VARIANTS = ("apartment", "apartment_ifc2x3_mm", "apartment_ifc4x3_m")


@pytest.fixture(scope="module")
def flat():
    return bn.read_ifc(bn.sample("apartment"))


def test_at_one_foot_a_target_shares_its_cell_with_the_round_table(flat):
    mission = bn.run(flat, cell_size=FOOT)
    (conflict,) = mission.graph.conflicts
    assert conflict.name.startswith("Water Spill")
    assert [flat[g].name.split(":")[0] for g in conflict.obstacles] == ["Round Table"]
    (stop,) = (s for s in mission.tour.stops if s.approach == "standing")
    assert stop.global_id == conflict.global_id
    assert 0 < stop.distance < 2 * FOOT
    assert mission.is_complete
    assert mission.check.ok


def test_at_half_a_foot_nothing_is_in_conflict_and_refining_finds_that_by_itself(flat):
    assert bn.run(flat, cell_size=FOOT / 2).graph.conflicts == ()
    refined = bn.run(flat, cell_size=FOOT, refine="auto")
    assert refined.graph.frame.cell_size == FOOT / 2
    assert {stop.approach for stop in refined.tour.stops} == {"center"}


def test_the_best_order_is_found_and_proved(flat):
    mission = bn.run(flat, cell_size=FOOT / 2)
    cells = [mission.start.cell, *(stop.cell for stop in mission.tour.stops)]
    metres = bn.distance_matrix(mission.graph, cells)
    shortest = min(
        metres[0, order[0]] + sum(metres[a, b] for a, b in pairwise(order)) for order in permutations(range(1, 5))
    )
    assert mission.tour.is_optimal
    assert mission.tour.length == pytest.approx(shortest, abs=1e-9)


def test_the_papers_rule_reaches_the_cell_or_steps_aside_but_never_touches(flat):
    mission = bn.run(flat, cell_size=FOOT, on_conflict="reach")
    assert mission.is_complete
    assert mission.check.ok


@pytest.mark.parametrize("cell_size", [FOOT, FOOT / 2, 0.1])
@pytest.mark.parametrize("connectivity", [4, 8])
def test_three_schemas_and_units_give_one_answer(cell_size, connectivity):
    missions = [bn.run(bn.sample(name), cell_size=cell_size, connectivity=connectivity, seed=3) for name in VARIANTS]
    first, *others = missions
    for other in others:
        assert (other.graph.kinds == first.graph.kinds).all()
        assert [s.global_id for s in other.tour.stops] == [s.global_id for s in first.tour.stops]
        assert other.result.log.to_csv() == first.result.log.to_csv()


@pytest.mark.parametrize("radius", [0.0, 0.15, 0.25])
def test_no_leg_touches_a_footprint_by_shapely_alone(flat, radius):
    mission = bn.run(flat, cell_size=0.05, connectivity=8, robot=bn.Robot(radius=radius))
    way = shapely.union_all([shapely.LineString(leg[:, :2]) for leg in mission.tour.route if len(leg) > 1])
    distance = min(way.distance(obstacle.footprint) for obstacle in mission.environment.obstacles)
    assert distance >= radius
    assert distance > 0


def test_a_run_writes_its_figure_tables_and_report(flat, tmp_path):
    mission = bn.run(flat, cell_size=FOOT / 2, out=tmp_path)
    names = [path.name for path in mission.files]
    assert names == ["plan.png", "route.csv", "events.csv", "replay.html", "report.json"]
    with (tmp_path / "route.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["x", "y", "storey", "time"]
    times = [float(row["time"]) for row in rows]
    assert times == sorted(times)
    last = mission.tour.stops[-1].end
    assert (float(rows[-1]["x"]), float(rows[-1]["y"])) == pytest.approx(last[:2], abs=1e-6)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["nodes"]["target"] == 4
    assert len(report["targets"]) == 4
    assert report["simulation"]["makespan"] == pytest.approx(report["tour"]["duration"] + 4 * mission.task.service_time)


def test_equal_runs_write_equal_bytes(flat, tmp_path):
    for name in ("one", "two"):
        bn.run(flat, cell_size=FOOT, out=tmp_path / name, seed=5)
    for file in ("plan.png", "route.csv", "events.csv"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


def test_litter_is_gone_once_it_was_cleaned(flat):
    result = bn.run(flat, cell_size=FOOT / 2).result
    removed = [row for row in result.log if row.event == "remove"]
    assert len(removed) == 4
    assert len(result.present_targets(removed[0].time)) == 3
    assert result.present_targets(math.inf) == ()


def test_a_start_inside_an_obstacle_names_it_and_a_free_point(flat):
    with pytest.raises(StartBlockedError, match=r"Round Table.*nearest free point"):
        bn.run(flat, start=(9.2 * FOOT, 58.7 * FOOT))


def test_a_start_outside_is_refused(flat):
    with pytest.raises(OutsideMapError, match="lies on no floor"):
        bn.run(flat, start=(100, 100))


def test_a_target_outside_is_refused_by_name(flat):
    with pytest.raises(OutsideMapError, match="moon rock"):
        bn.run(flat, targets=[("moon rock", 100, 100)])


def test_a_job_without_targets_names_the_remedy():
    with pytest.raises(NoTargetError, match="--target"):
        bn.run(room())


def test_an_unknown_task_names_the_known_ones(flat):
    with pytest.raises(TaskError, match="cleaning"):
        bn.run(flat, task="claening")


def test_a_target_in_another_part_is_listed_and_the_rest_is_done():
    building = two_rooms(door_width=None).with_targets([("here", 1, 1), ("there", 6, 1)])
    mission = bn.run(building, cell_size=0.25, start=(2, 2))
    assert [stop.name for stop in mission.tour.stops] == ["here"]
    (lost,) = mission.tour.unreached
    assert lost.name == "there"
    assert "another part" in lost.reason


def test_a_start_that_is_clear_but_in_a_blocked_cell_is_used_as_given():
    building = room(4, 4, elements=[box("crate", 1.0, 1.0, 0, 2.0, 2.0, 1.0)]).with_targets([("spill", 3, 3)])
    mission = bn.run(building, cell_size=0.3, start=(2.05, 1.5))
    assert mission.tour.start_point[:2] == (2.05, 1.5)
    assert mission.check.ok


@pytest.mark.parametrize(
    ("name", "targets", "served"),
    [
        ("houses/SampleHouse4.ifc", [("spill", -3.0, 2.0), ("peel", 5.0, 0.0), ("crumbs", 2.5, 3.5)], 3),
        ("duplex/Duplex_A_20110907.ifc", [("spill", 3.0, -2.0, "Level 1"), ("peel", 3.0, -15.0, "Level 1")], 1),
    ],
)
def test_targets_placed_in_a_real_house(name, targets, served):
    start = (*targets[0][1:3], *targets[0][3:])
    mission = bn.run(real_model(name), targets=targets, cell_size=0.1, start=start)
    assert len(mission.tour.stops) == served
    assert len(mission.tour.unreached) == len(targets) - served
    assert mission.check.ok
    footprints = [o for o in mission.environment.obstacles if o.storey == mission.start.cell.storey]
    for leg in mission.tour.route:
        if len(leg) > 1:
            line = shapely.LineString(np.asarray(leg)[:, :2])
            assert min(line.distance(o.footprint) for o in footprints) > 0


def test_a_job_does_not_begin_in_a_pocket_between_things():
    # a ring of furniture around the middle of the room: the robot fits inside it, and nowhere out
    ring = [(1.5, 1.0, 3.5, 1.2), (1.5, 2.8, 3.5, 3.0), (1.5, 1.2, 1.7, 2.8), (3.3, 1.2, 3.5, 2.8)]
    things = [box(f"thing{k}", x0, y0, 0, x1, y1, 0.5) for k, (x0, y0, x1, y1) in enumerate(ring)]
    environment = bn.make_environment(room(elements=things), bn.Task("look"), bn.Robot(radius=0.2))
    graph = bn.build_graph(environment, cell_size=0.1)
    start = bn.find_start(graph)
    assert not (1.5 < start.point[0] < 3.5 and 1.0 < start.point[1] < 3.0)
    assert start.source == "near the middle of space"


def test_a_mission_ends_where_it_is_told_along_straight_legs_that_keep_away(flat):
    plain = bn.run(flat, cell_size=FOOT / 2)
    x, y = plain.start.point[0] + 0.03, plain.start.point[1] - 0.02  # no middle of a cell
    mission = bn.run(flat, cell_size=FOOT / 2, end=(x, y), smooth="any_angle", clearance=0.3, objective="time")
    assert mission.is_complete
    assert mission.check.ok
    assert mission.tour.end == mission.graph.frame.cell_at(x, y)
    assert mission.tour.end_point[:2] == (x, y)
    at = mission.result.state_at(mission.result.makespan)
    assert (at.x, at.y) == pytest.approx((x, y))
    assert bn.run(flat, cell_size=FOOT / 2, end=(x, y)).tour.route[-1][-1][:2].tolist() == [x, y]
    assert all(leg.legs is not None for leg in mission.tour.legs)
    assert mission.graph.clearances == ((0.3, 4.0),)
    assert mission.graph.objective == "time"
    assert mission.check.clearance > plain.check.clearance
    told = mission.report()["tour"]
    assert (told["objective"], told["is_smooth"], told["end"]) == ("time", True, list(mission.tour.end_point))
    assert plain.report()["tour"]["end"] is None


def test_an_end_that_cannot_be_reached_or_is_no_place_is_refused(flat):
    with pytest.raises(GoalBlockedError, match=r"end \(2\.8, 17\.9\) is blocked: its cell touches Round Table"):
        bn.run(flat, end=(2.8, 17.9))
    with pytest.raises(OutsideMapError, match=r"end \(99, 99\) lies on no floor"):
        bn.run(flat, end=(99, 99))
    with pytest.raises(InputError, match="both end elsewhere and return"):
        bn.run(flat, end=(1, 17), return_to_start=True)
    with pytest.raises(ValueRangeError, match="draws no power"):
        bn.run(flat, objective="energy")


def test_a_visit_to_a_charger_is_told_apart_from_the_targets():
    dock = box("dock", 0.2, 0.2, 0.0, 0.5, 0.5, 0.3, name="Charging dock")
    building = room(20.0, 2.0, elements=[dock]).with_targets([("near", 12.0, 1.5), ("far", 1.0, 1.5)])
    task = bn.Task("t", docks=[bn.Rule("IfcBuildingElementProxy")])
    tired = bn.Robot("R1", speed=1.0, drive_power=3600.0, battery_wh=20 / 0.9, charge_power=3600.0)
    mission = bn.run(building, task=task, robot=tired, start=(6.0, 1.0), end=(19.0, 1.0))
    report = mission.report()
    assert {*report["tour"]["order"]} == {target["global_id"] for target in report["targets"]}
    assert [charge["name"] for charge in report["tour"]["charges"]] == ["Charging dock"]


def test_the_judge_knows_where_a_tour_is_to_end(flat):
    mission = bn.run(flat, cell_size=FOOT / 2, end=(1.0, 17.0))
    assert mission.check.ok
    assert "missing-leg" in {v.kind for v in bn.check_plan(replace(mission.tour, end=None)).violations}
    cut = replace(mission.tour, legs=mission.tour.legs[:-1])
    assert {v.kind for v in bn.check_plan(cut).violations} == {"missing-leg"}
