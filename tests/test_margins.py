"""Rules with a margin: floor around what they pick is closed, or dear."""

from __future__ import annotations

from dataclasses import replace

import pytest

import bimnav as bn
from bimnav.errors import TaskError
from bimnav.tasks import Rule, Task, task_schema
from bimnav.testing import box, room


def test_a_margin_makes_rules_about_solid_things_matter():
    server = box("server", 2.0, 2.0, 0.0, 3.0, 3.0, 2.0, name="Server rack")
    rule = Rule("IfcBuildingElementProxy", label="racks")

    def graph_with(**lists):
        return bn.build_graph(bn.make_environment(room(5, 5, elements=[server]), Task("t", **lists)), cell_size=0.1)

    plain, tight = graph_with(), graph_with(restricted=[rule])
    assert (plain.free == tight.free).all()
    closed = graph_with(restricted=[replace(rule, margin=0.5)])
    assert not closed.free[closed.frame.cell_at(2.5, 1.55)]
    assert closed.free[closed.frame.cell_at(2.5, 1.35)]
    assert closed.free[closed.frame.cell_at(1.55, 1.55)]  # 0.64 m from the corner
    slow = graph_with(avoid=[replace(rule, factor=3.0, margin=0.5)])
    assert slow.cost[slow.frame.cell_at(2.5, 1.55)] == 3.0
    assert slow.cost[slow.frame.cell_at(2.5, 1.35)] == 1.0
    told = repr(slow.explain(slow.frame.cell_at(2.5, 1.55)))
    assert "racks" in told
    assert "0.5 m around it" in told
    path = bn.find_path(closed, closed.frame.cell_at(0.5, 2.5), closed.frame.cell_at(4.5, 2.5), smooth="any_angle")
    assert bn.check_path(path.waypoints, closed.environment).ok
    assert not bn.check_path([(0.5, 1.8, 0.0), (4.5, 1.8, 0.0)], closed.environment).ok


def test_a_margin_stands_in_task_files_of_what_is_avoided_or_closed_alone(tmp_path):
    path = tmp_path / "t.toml"
    text = "schema = 1\n[[tasks.t.avoid]]\nmargin = 0.3\n[[tasks.t.restricted]]\nmargin = 1\n"
    path.write_text(text)
    task = bn.load_task(path)
    assert (task.avoid[0].margin, task.restricted[0].margin) == (0.3, 1.0)
    path.write_text(text + "[[tasks.t.ignore]]\nmargin = 1\n[[tasks.t.restricted]]\nmargin = -1\n")
    with pytest.raises(TaskError, match=r"7: unknown key 'margin' in tasks\.t\.ignore") as caught:
        bn.load_task(path)
    assert "9: tasks.t.restricted[1].margin = -1: should be greater than or equal to 0" in str(caught.value)
    with pytest.raises(TaskError, match="margin is nan"):
        Rule(margin=float("nan"))
    known = task_schema()["$defs"]
    assert "margin" in known["AvoidTable"]["properties"]
    assert "margin" in known["RestrictedTable"]["properties"]
    assert "margin" not in known["RuleTable"]["properties"]


@pytest.mark.parametrize("sample", ["apartment", "apartment_ifc2x3_mm", "apartment_ifc4x3_m"])
def test_rules_of_ours_are_silent_about_classes_that_a_schema_lacks_and_those_of_users_are_told(sample, caplog):
    building = bn.read_ifc(bn.sample(sample))
    environment = bn.make_environment(building, bn.load_task("cleaning"))
    assert caplog.records == []
    assert [issue for issue in environment.issues if issue.code == "filter" and issue.severity != "info"] == []
    own = Task("t", ignore=[Rule("IfcGeographicElement, IfcVehicle")])
    told = [i for i in bn.make_environment(building, own).issues if i.code == "filter" and i.severity == "warning"]
    assert bool(told) == (building.schema in ("IFC2X3", "IFC4"))
