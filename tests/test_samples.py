"""The sample models: what is promised of them, judged without bimnav's own reader and grid."""

from __future__ import annotations

import itertools
import os
import runpy
import subprocess
import sys
import zipfile
from collections import deque
from functools import cache
from pathlib import Path

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.classification
import ifcopenshell.util.element
import ifcopenshell.util.unit
import ifcopenshell.validate
import numpy as np
import pytest
import shapely

from bimnav.errors import InputError
from bimnav.samples import list_samples, sample
from tests.conftest import REPOSITORY

FOOT = 0.3048
BAND = 0.05, 1.0  # metres above the floor, where a robot's body is
APARTMENTS = "apartment", "apartment_ifc2x3_mm", "apartment_ifc4x3_m"
ROOMS = {  # x0, y0, x1, y1 in feet
    "Living Room": (0, 51, 11, 63),
    "Bedroom": (11.5, 51, 22, 63),
    "Kitchen": (0, 41, 11, 50.5),
    "Hall": (11.5, 41, 16, 50.5),
    "Bathroom": (16.5, 41, 22, 50.5),
}
TARGETS = {  # designated destinations, feet
    "Banana Peel:Banana Peel:345678": (1.25, 55.75),
    "Banana Peel:Banana Peel:345679": (9.75, 61.75),
    "Water Spill:Water Spill - Small:345680": (7.25, 58.25),
    "Water Spill:Water Spill - Large:345681": (5.75, 61.75),
}
DOCK = "Charging Dock:Robot Dock:345308"
NO_OBSTACLES = "IfcSpace", "IfcSlab", "IfcOpeningElement", "IfcDoor", "IfcWindow"

every_apartment = pytest.mark.parametrize("name", APARTMENTS)


@cache
def model(name):
    return ifcopenshell.open(sample(name))


@cache
def triangles(name):
    """World triangles in metres, (n, 3, 3), of every product that has a shape, by GlobalId."""
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    shapes = {}
    for shape in ifcopenshell.geom.iterate(settings, model(name)):
        assert shape.guid not in shapes
        vertices = np.reshape(shape.geometry.verts, (-1, 3))
        shapes[shape.guid] = vertices[np.reshape(shape.geometry.faces, (-1, 3))]
    return shapes


def extents(name):
    points = np.concatenate([shape.reshape(-1, 3) for shape in triangles(name).values()])
    return np.array([points.min(axis=0), points.max(axis=0)])


def section(shape, height):
    """Cut triangles at a height; the outlines of the flat's solids have no holes."""
    segments = []
    for triangle in shape:
        edges = [(a, b) for a, b in itertools.permutations(triangle, 2) if a[2] < height < b[2]]
        if edges:
            cut = [(a + (b - a) * (height - a[2]) / (b[2] - a[2]))[:2] for a, b in edges]
            segments.append(shapely.LineString(cut))
    return shapely.union_all(shapely.polygonize([shapely.union_all(segments, grid_size=1e-9)]).geoms)


def footprint(shape):
    """Project what lies in the band, feet; upright prisms change only at the heights of their vertices."""
    low, high = BAND
    heights = np.unique(shape[..., 2].round(9))
    cuts = [low, *heights[(heights > low) & (heights < high)], high]
    area = shapely.union_all([section(shape, (a + b) / 2) for a, b in itertools.pairwise(cuts)])
    return shapely.transform(area, lambda points: points / FOOT)


@cache
def obstacles(name):
    products = [p for p in model(name).by_type("IfcElement") if p.is_a() not in NO_OBSTACLES]
    prints = {p.Name: footprint(triangles(name)[p.GlobalId]) for p in products}
    return {name: area for name, area in prints.items() if not area.is_empty}


def cell(point, size):
    """(i, j) of Xu and Gao: one cell holds one point."""
    return int(point[0] // size), int(point[1] // size)


def cells(name, size):
    """Obstacle cells, with the names of what they share area with."""
    found = {}
    for obstacle, area in obstacles(name).items():
        x0, y0, x1, y1 = np.floor(np.array(area.bounds) / size).astype(int)
        for i, j in itertools.product(range(x0, x1 + 1), range(y0, y1 + 1)):
            slack = 1e-5  # feet
            box = shapely.box(i * size + slack, j * size + slack, (i + 1) * size - slack, (j + 1) * size - slack)
            if box.intersects(area):
                found.setdefault((i, j), set()).add(obstacle)
    return found


def steps(name, size, start):
    """Steps from a cell to every cell inside the walls that can be reached over edges, not corners.

    Start and targets may be obstacle cells, as in the paper; no way leads through one.
    """
    blocked = cells(name, size)
    distance, queue = {start: 0}, deque([start])
    while queue:
        i, j = here = queue.popleft()
        for to in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if to not in distance and to not in blocked and 0 <= to[0] * size < 22 and 41 <= to[1] * size < 63:
                distance[to] = distance[here] + 1
                queue.append(to)
    return distance


def center(shape):
    return (shape.reshape(-1, 3).min(axis=0) + shape.reshape(-1, 3).max(axis=0))[:2] / 2 / FOOT


def test_a_sample_is_a_path_by_name():
    assert list_samples() == (*APARTMENTS, "office")
    assert sample("apartment").name == "apartment.ifc"
    assert all(sample(name).is_file() for name in list_samples())


def test_an_unknown_sample_is_an_error_that_lists_the_names():
    with pytest.raises(InputError, match=r"'house'.*apartment, apartment_ifc2x3_mm, apartment_ifc4x3_m, office"):
        sample("house")


def test_the_samples_are_the_bytes_their_script_writes(data_ifc: Path, tmp_path: Path):
    written = runpy.run_path(str(data_ifc / "make_samples.py"))["write_samples"](tmp_path)
    assert [path.name for path in written] == [f"{name}.ifc" for name in APARTMENTS]
    for path in written:
        assert path.read_bytes() == (data_ifc / path.name).read_bytes()
        assert path.stat().st_size < 300_000


def test_the_office_is_the_bytes_its_script_writes(data_ifc: Path, tmp_path: Path, monkeypatch):
    monkeypatch.syspath_prepend(data_ifc)  # it shares code with the script beside it
    runpy.run_path(str(data_ifc / "make_office.py"))["write_office"](tmp_path / "office.ifc")
    assert (tmp_path / "office.ifc").read_bytes() == (data_ifc / "office.ifc").read_bytes()


def test_every_sample_has_a_line_in_the_readme(data_ifc: Path):
    lines = (data_ifc / "README.md").read_text(encoding="utf-8").splitlines()
    assert all(any(line.startswith(f"| `{name}.ifc` |") for line in lines) for name in list_samples())


@pytest.mark.parametrize(
    ("name", "schema", "scale"),
    [
        ("apartment", "IFC4", FOOT),
        ("apartment_ifc2x3_mm", "IFC2X3", 0.001),
        ("apartment_ifc4x3_m", "IFC4X3_ADD2", 1.0),
    ],
)
def test_a_sample_has_its_schema_and_unit(name, schema, scale):
    assert model(name).schema_identifier == schema
    assert ifcopenshell.util.unit.calculate_unit_scale(model(name)) == pytest.approx(scale, rel=1e-15)


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the rules are read from a file that is left open
@pytest.mark.parametrize("name", [*APARTMENTS, "office"])
def test_a_sample_is_valid_with_all_rules_of_its_schema(name):
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(ifcopenshell.open(sample(name)), log, express_rules=True)
    assert log.statements == []


@every_apartment
def test_the_three_files_are_one_flat(name):
    def named(file):
        return {root.GlobalId: root.Name for root in file.by_type("IfcRoot")}

    assert len(named(model(name))) == len(model(name).by_type("IfcRoot"))
    assert named(model(name)) == named(model("apartment"))
    assert np.abs(extents(name) - extents("apartment")).max() < 1e-9
    assert extents(name) / FOOT == pytest.approx(np.array([[-0.5, 40.5, -0.5], [22.5, 63.5, 9.0]]))


@every_apartment
def test_every_product_has_its_shape(name):
    expected = {p.GlobalId for p in model(name).by_type("IfcProduct") if p.is_a() not in ("IfcSite", "IfcBuilding")}
    expected -= {storey.GlobalId for storey in model(name).by_type("IfcBuildingStorey")}
    assert set(triangles(name)) == expected
    assert all(len(shape) for shape in triangles(name).values())


@every_apartment
def test_the_rooms_lie_where_the_paper_has_them(name):
    for room in model(name).by_type("IfcSpace"):
        points = triangles(name)[room.GlobalId].reshape(-1, 3) / FOOT
        assert [*points.min(axis=0)[:2], *points.max(axis=0)[:2]] == pytest.approx(ROOMS[room.LongName])
    assert len(model(name).by_type("IfcSpace")) == len(ROOMS)


@every_apartment
def test_doors_are_closed_leaves_in_openings_three_feet_wide(name):
    doors = model(name).by_type("IfcDoor")
    assert len(doors) == 6
    for door in doors:
        opening = door.FillsVoids[0].RelatingOpeningElement
        void, leaf = (triangles(name)[g].reshape(-1, 3) / FOOT for g in (opening.GlobalId, door.GlobalId))
        assert sorted(np.ptp(void, axis=0)) == pytest.approx([0.5, 3.0, 7.0])
        assert leaf.min(axis=0) == pytest.approx(void.min(axis=0))
        assert leaf.max(axis=0) == pytest.approx(void.max(axis=0))
        along = int(np.ptp(void, axis=0).argmin() == 0)
        assert void.min(axis=0)[along] == pytest.approx(round(void.min(axis=0)[along]))


@every_apartment
def test_four_chairs_share_one_geometry(name):
    chairs = [p for p in model(name).by_type("IfcFurnishingElement") if p.Name.startswith("Dining Chair:")]
    items = [chair.Representation.Representations[0].Items[0] for chair in chairs]
    assert len(items) == 4
    assert all(item.is_a("IfcMappedItem") for item in items)
    assert len({item.MappingSource.id() for item in items}) == 1


@every_apartment
def test_the_fridge_and_the_dock_come_with_their_papers(name):
    for tag, maker in (("345505", "Polarbrook"), ("345308", "Marten Robotics")):
        element = next(e for e in model(name).by_type("IfcElement") if e.Tag == tag)
        sets = ifcopenshell.util.element.get_psets(element)
        assert sets["Pset_ManufacturerTypeInformation"]["Manufacturer"] == maker
        assert sets["Pset_ManufacturerOccurrence"]["SerialNumber"]
        assert sets["Pset_Warranty"]["WarrantyStartDate"].startswith("202")
        assert len(ifcopenshell.util.classification.get_references(element)) == 1


@every_apartment
def test_targets_and_dock_are_low_and_free_of_furniture(name):
    named = {e.Name: triangles(name)[e.GlobalId] for e in model(name).by_type("IfcElement")}
    assert center(named[DOCK]) == pytest.approx((10.25, 52.25))
    for target, destination in TARGETS.items():
        assert center(named[target]) == pytest.approx(destination)
        gaps = [shapely.Point(destination).distance(area) for area in obstacles(name).values()]
        assert min(gaps) > 0.25  # half a peel
    assert all(np.ptp(named[low][..., 2]) < BAND[0] for low in (*TARGETS, DOCK))


@every_apartment
def test_on_a_one_foot_grid_the_small_spill_conflicts_with_the_round_table(name):
    blocked = cells(name, 1.0)
    conflicts = {
        target: (cell(p, 1.0), blocked[cell(p, 1.0)]) for target, p in TARGETS.items() if cell(p, 1.0) in blocked
    }
    assert conflicts == {"Water Spill:Water Spill - Small:345680": ((7, 58), {"Round Table:36 in Diameter:345301"})}
    assert (6, 58) not in blocked  # a robot can stand beside it


@every_apartment
def test_on_a_half_foot_grid_no_target_conflicts(name):
    assert not {cell(p, 0.5) for p in TARGETS.values()} & set(cells(name, 0.5))


@every_apartment
@pytest.mark.parametrize("size", [1.0, 0.5])
def test_the_dock_leads_to_every_room_and_beside_every_target(name, size):
    reached = steps(name, size, cell((10.25, 52.25), size))
    assert cell((10.25, 52.25), size) not in cells(name, size)
    for x0, y0, x1, y1 in ROOMS.values():
        assert any(x0 <= i * size < x1 - size and y0 <= j * size < y1 - size for i, j in reached)
    for i, j in (cell(p, size) for p in TARGETS.values()):
        assert {(i, j), (i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)} & set(reached)


def test_going_to_the_nearest_target_first_is_not_the_shortest_tour():
    size, start = 0.5, cell((10.25, 52.25), 0.5)
    stops = [cell(p, size) for p in TARGETS.values()]
    distance = {here: steps("apartment", size, here) for here in (start, *stops)}

    def length(order):
        return sum(distance[a][b] for a, b in itertools.pairwise((start, *order)))

    greedy = [start]
    while left := [stop for stop in stops if stop not in greedy]:
        greedy.append(min(left, key=distance[greedy[-1]].__getitem__))
    assert min(map(length, itertools.permutations(stops))) < length(greedy[1:])


def test_the_ways_between_targets_bend_around_furniture():
    furniture = shapely.union_all([a for n, a in obstacles("apartment").items() if not n.startswith("Basic Wall:")])
    points = [(10.25, 52.25), *TARGETS.values()]
    blocked = [shapely.LineString(pair).intersects(furniture) for pair in itertools.combinations(points, 2)]
    assert sum(blocked) >= 4


def test_the_upper_cabinets_hang_above_the_robot():
    assert not any(name.startswith("Upper Cabinet:") for name in obstacles("apartment"))


def test_the_wheel_brings_the_samples(tmp_path):
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(REPOSITORY)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "installed")
    ask = "import bimnav as bn; print(bn.sample('apartment').is_relative_to('.'), bn.sample('apartment').exists())"
    found = subprocess.run(
        [sys.executable, "-P", "-c", ask.replace("'.'", repr(str(tmp_path)))],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "installed")},
    )
    assert found.stdout == "True True\n"
