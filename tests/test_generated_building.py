"""The generated building of the benchmarks: what is read equals what was drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from benchmarks.building import Drawing, Plan, write_building, write_hall
from benchmarks.peers import boxes_of

import bimnav as bn
from bimnav.grid import GridFrame, rasterize
from bimnav.tasks import Task

PLAN = Plan(storeys=2, rooms=12)


@dataclass(frozen=True)
class Generated:
    drawing: Drawing
    building: bn.Building
    environment: bn.IndoorEnvironment


@pytest.fixture(scope="module")
def generated(tmp_path_factory) -> Generated:
    path = tmp_path_factory.mktemp("generated") / "building.ifc"
    drawing = write_building(path, PLAN)
    building = bn.read_ifc(path, isolate=False, cache=False)
    return Generated(drawing, building, bn.make_environment(building, Task("nothing"), bn.Robot()))


def test_equal_plans_give_equal_bytes(tmp_path):
    folders = [tmp_path / name for name in ("one", "other")]
    for folder in folders:
        folder.mkdir()
        write_building(folder / "building.ifc", Plan(1, 2))
    one, other = (folder.joinpath("building.ifc").read_bytes() for folder in folders)
    assert one == other


@pytest.mark.parametrize("products", [1_000, 18_000, 100_000])
def test_a_plan_of_a_size_has_about_so_many_products(products):
    plan = Plan.of_size(products)
    assert plan.storeys * plan.rooms * 30 == pytest.approx(products, rel=0.05)
    assert products != 18_000 or plan == Plan()


def test_every_wall_covers_its_drawn_rectangle_minus_its_door_openings(generated):
    drawing, obstacles = generated.drawing, generated.environment.obstacles
    found = {o.global_id: o for o in obstacles if o.global_id in drawing.walls}
    assert found.keys() == drawing.walls.keys()
    for global_id, rectangle in drawing.walls.items():
        drawn = shapely.difference(rectangle, shapely.union_all(drawing.doorways.get(global_id, [])))
        assert shapely.symmetric_difference(drawn, found[global_id].footprint).area <= 1e-6
        assert found[global_id].quality == "exact"


def test_every_wall_blocks_its_own_storey_alone(generated):
    drawing, environment = generated.drawing, generated.environment
    assert environment.levels == pytest.approx(drawing.levels, abs=1e-9)
    walls = [o.global_id for o in environment.obstacles if o.ifc_class == "IfcWall"]
    assert len(walls) == len(set(walls)) == len(drawing.walls)


def test_the_ledger_closes(generated):
    ledger, environment = generated.building.ledger, generated.environment
    assert sorted(ledger.asked) == sorted(generated.drawing.products)
    assert not ledger.left_out
    assert not ledger.lost
    shaped = {element.global_id for element in generated.building.elements if element.shapes}
    blocking = {obstacle.global_id for obstacle in environment.obstacles}
    left_out = {global_id for global_id, _ in environment.left_out}
    assert shaped == blocking | set(environment.outside_bands) | left_out
    assert len(shaped) == len(blocking) + len(environment.outside_bands) + len(left_out & shaped)


@pytest.mark.parametrize("size", [0.05, 0.1, 0.3048])
def test_the_raster_of_a_whole_storey_is_that_of_shapely(generated, size):
    polygons = [o.footprint for o in generated.environment.obstacles if o.storey == 1]
    frame = GridFrame.covering(shapely.total_bounds(polygons), size)
    boxes = boxes_of(frame)
    expected = np.zeros(boxes.size, dtype=bool)
    expected[shapely.STRtree(boxes).query(polygons, predicate="intersects")[1]] = True
    assert (rasterize(frame, polygons).ravel() == expected).all()


def test_copies_of_a_chair_share_one_mesh(tmp_path):
    write_hall(tmp_path / "hall.ifc", 50)
    building = bn.read_ifc(tmp_path / "hall.ifc", isolate=False, cache=False)
    chairs = building.select("IfcFurniture")
    assert len(chairs) == 50
    assert len({id(shape.mesh) for chair in chairs for shape in chair.shapes}) == 1
