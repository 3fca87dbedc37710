"""Why no route: what would have to go, or by how much a way is too narrow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav._why import why_unreachable
from bimnav.errors import NoPathError
from bimnav.testing import box, grid_from_text, room, two_rooms, two_storeys
from tests.conftest import real_model

TASK = bn.Task("task")


def graph_of(building, radius=0.25, *, cell_size=0.1, **robot):
    environment = bn.make_environment(building, TASK, bn.Robot(radius=radius, **robot))
    return bn.build_graph(environment, cell_size=cell_size)


def why(graph, begin=(1.0, 2.0), end=(7.0, 2.0), storeys=(0, 0)):
    cells = [graph.frame.cell_at(*point, storey=k) for point, k in zip((begin, end), storeys, strict=True)]
    return why_unreachable(graph, *cells)


def row_of_crates(*spans, x=2.5, ifc_class="IfcFurniture"):
    """Crates across the room at x, from y to y."""
    return [
        box(f"crate-{k}", x, low, 0, x + 0.4, high, 1.0, ifc_class=ifc_class, name=f"Crate {k}")
        for k, (low, high) in enumerate(spans)
    ]


def test_where_a_route_leads_there_is_nothing_to_explain():
    assert why(graph_of(two_rooms())) is None


def test_a_closed_door_is_named():
    found = why(graph_of(two_rooms()).close_door("door"))
    assert (found.reason, found.global_ids) == ("blocked", ("door",))
    assert found.message == "blocked by Door (door)"


def test_the_one_crate_is_named_whose_removal_opens_the_way():
    crates = row_of_crates((0, 1.4), (1.4, 2.6), (2.6, 4.0))
    wardrobe = box("wardrobe", 6.0, 0, 0, 6.4, 4.0, 2.0, ifc_class="IfcFurniture", name="Wardrobe")
    found = why(graph_of(two_rooms(elements=[*crates, wardrobe])))
    assert found.reason == "blocked"
    assert found.global_ids[-1] == "wardrobe"
    assert len(found.global_ids) == 2


def test_a_door_too_narrow_by_centimetres_is_measured():
    found = why(graph_of(two_rooms(door_width=0.6), radius=0.35, cell_size=0.05))
    assert found.reason == "narrow"
    assert found.width == pytest.approx(0.6, abs=1e-6)
    assert found.shortage == pytest.approx(0.1, abs=1e-6)
    assert "too narrow by 10 cm" in found.message
    assert found.point[:2] == pytest.approx((4.1, 2.0), abs=0.15)


def test_a_gap_beside_a_crate_is_measured_and_the_crate_is_named():
    crates = row_of_crates((0.0, 3.6))
    found = why(graph_of(two_rooms(elements=crates), radius=0.3))
    assert (found.reason, found.global_ids) == ("blocked", ("crate-0",))
    assert found.width == pytest.approx(0.4, abs=1e-6)
    assert "beside it the way is 20 cm too narrow" in found.message


def test_cells_too_large_to_show_a_way_are_blamed_themselves():
    found = why(graph_of(two_rooms(door_width=0.7), cell_size=0.5))
    assert found.reason == "cells"
    assert found.width == pytest.approx(0.7, abs=1e-6)


def test_rooms_without_a_door_are_apart_and_the_wall_is_named():
    found = why(graph_of(two_rooms(door_width=None)))
    assert (found.reason, found.global_ids) == ("apart", ("wall-between",))


def test_a_stair_that_the_robot_does_not_climb_is_named_with_the_reason():
    found = why(graph_of(two_storeys()), (1, 3), (1, 3), (0, 1))
    assert (found.reason, found.global_ids) == ("climb", ("connector",))
    assert found.message == "the way leads over stair Stair (connector): the robot climbs no stairs"


def test_a_lift_that_the_robot_does_not_use_is_no_obstacle_to_remove():
    found = why(graph_of(two_storeys("lift"), uses_lifts=False), (1, 3), (1, 3), (0, 1))
    assert found.message == "the way leads over lift Lift (connector): the robot does not ride in lifts"


def test_closed_cells_and_restricted_zones_are_named():
    graph = graph_of(two_rooms())
    storey, _, _ = graph.frame.cell_at(1, 2)
    closed = graph.block(bn.Cell(storey, row, col) for row in range(graph.frame.rows) for col in range(28, 30))
    assert why(closed).message == "blocked by cells that were blocked"
    space = replace(two_rooms(), spaces=two_rooms().spaces)
    task = bn.Task("task", restricted=(bn.Rule("IfcFurniture"),), ignore=(bn.Rule("IfcFurniture"),))
    (mat,) = row_of_crates((0.0, 4.0))
    environment = bn.make_environment(replace(space, elements=(*space.elements, mat)), task, bn.Robot())
    found = why(bn.build_graph(environment, cell_size=0.1))
    assert (found.reason, found.global_ids) == ("blocked", ("crate-0",))


def test_the_error_of_find_path_says_why():
    graph = graph_of(two_rooms()).close_door("door")
    a, b = graph.frame.cell_at(1, 2), graph.frame.cell_at(7, 2)
    with pytest.raises(NoPathError, match=r"blocked by Door \(door\)") as caught:
        bn.find_path(graph, a, b)
    assert caught.value.context["global_ids"] == ["door"]


def test_a_target_that_is_not_reached_says_why():
    building = two_rooms(door_width=0.6).with_targets([("here", 1, 1), ("there", 6, 1), ("too", 7, 1)])
    mission = bn.run(building, robot=bn.Robot(radius=0.35), cell_size=0.1, start=(2, 2))
    assert [lost.name for lost in mission.tour.unreached] == ["there", "too"]
    assert all("too narrow by 10 cm" in lost.reason for lost in mission.tour.unreached)


def test_a_mask_tells_how_large_the_parts_are():
    graph = bn.NavGraph.from_mask(grid_from_text("..#.\n..#."))
    found = why_unreachable(graph, bn.Cell(0, 0, 0), bn.Cell(0, 0, 3))
    assert found.message == "no floor joins the 4 cells around the one and the 2 around the other"


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_is_named_opens_a_way_and_no_cheaper_set_does(seed):
    rng = np.random.default_rng(seed)
    boxes = []
    for k in range(7):
        x, y = rng.uniform(0.8, 3.6), rng.uniform(-0.2, 3.2)
        w, h = rng.uniform(0.2, 0.5), rng.uniform(0.8, 2.6)
        boxes.append(box(f"c{k}", x, max(y, 0), 0, min(x + w, 4.2), min(y + h, 4.0), 1.0, ifc_class="IfcFurniture"))
    building = room(5, 4)

    def reachable(elements):
        graph = graph_of(replace(building, elements=(*building.elements, *elements)), 0.15, cell_size=0.15)
        a, b = graph.frame.cell_at(0.4, 2.0), graph.frame.cell_at(4.6, 2.0)
        return graph, a, b, graph.components[a] == graph.components[b]

    graph, a, b, joined = reachable(boxes)
    found = why_unreachable(graph, a, b)
    assert joined == (found is None)
    if found is None or found.reason == "cells":
        return
    left = [element for element in boxes if element.global_id not in found.global_ids]
    assert reachable(left)[3]
    for one in boxes if len(found.global_ids) == 2 else ():
        assert not reachable([element for element in boxes if element is not one])[3]


def test_a_real_model_names_the_door_that_was_closed():
    building = bn.read_ifc(real_model("houses/SampleHouse4.ifc"))
    graph = bn.build_graph(bn.make_environment(building, TASK, bn.Robot(radius=0.2)), cell_size=0.1)
    main = np.bincount(graph.components[graph.components > 0]).argmax()
    for door in building.doors:
        try:
            closed = graph.close_door(door.global_id)
        except bn.BimnavError:
            continue
        labels = np.unique(closed.components[(graph.components == main) & closed.free])
        if len(labels) > 1:
            cells = [bn.Cell(*np.argwhere(closed.components == label)[0].tolist()) for label in labels[:2]]
            found = why_unreachable(closed, *cells)
            assert found.reason == "blocked"
            assert found.global_ids == (door.global_id,)
            return
    pytest.fail("no door parts the house")
