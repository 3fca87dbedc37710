"""Elements whose geometry was lost: no way leads through them unless one says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bimnav as bn
from bimnav.errors import IncompleteModelError
from bimnav.testing import room


def with_lost_column(bounds=((2.0, -0.5, 0.0), (2.4, 3.5, 2.5))):
    """Build a room of 5 x 4 m with a column in its middle whose shape was lost; the spill lies behind it."""
    column = bn.Element("column", "IfcColumn", "Column")
    building = room(5, 4, elements=[column]).with_targets([("spill", 4.5, 1.0)])
    boxes = {} if bounds is None else {"column": np.array(bounds)}
    ledger = bn.Ledger((*building.ledger.asked, "column"), {}, {"column": "crashed the geometry kernel"}, boxes)
    return replace(building, ledger=ledger)


def test_a_way_through_the_place_of_a_lost_element_is_refused_by_name():
    with pytest.raises(IncompleteModelError, match=r"IfcColumn Column \(column\): crashed.*--lost box"):
        bn.run(with_lost_column(), start=(0.5, 1.0), cell_size=0.25)


def test_a_way_elsewhere_is_not_refused():
    building = with_lost_column(((0.0, 3.0, 0.0), (0.5, 4.0, 2.5)))
    assert bn.run(building, start=(0.5, 1.0), cell_size=0.25).is_complete


def test_what_lies_above_the_robot_does_not_matter():
    building = with_lost_column(((2.0, -0.5, 2.0), (2.4, 3.5, 2.5)))
    assert bn.run(building, start=(0.5, 1.0), cell_size=0.25).is_complete


@pytest.mark.parametrize("how", ["box", {"column": "box"}])
def test_its_box_becomes_an_obstacle_when_asked(how):
    mission = bn.run(with_lost_column(), start=(0.5, 1.0), cell_size=0.25, lost=how)
    (column,) = (o for o in mission.environment.obstacles if o.global_id == "column")
    assert column.quality == "hull"
    assert column.footprint.area == pytest.approx(0.4 * 4.0, abs=1e-6)
    assert mission.check.ok
    assert mission.tour.length > 6  # around its end, not through


def test_it_is_left_out_when_asked():
    mission = bn.run(with_lost_column(), start=(0.5, 1.0), cell_size=0.25, lost={"column": "ignore"})
    assert mission.tour.length == pytest.approx(4.0)


def test_without_any_extent_only_leaving_it_out_goes_on():
    building = with_lost_column(None)
    for how in ("abort", "box"):
        with pytest.raises(IncompleteModelError):
            bn.run(building, start=(0.5, 1.0), cell_size=0.25, lost=how)
    assert bn.run(building, start=(0.5, 1.0), cell_size=0.25, lost="ignore").is_complete
