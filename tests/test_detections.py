"""Targets from the command line and from files."""

from __future__ import annotations

import json

import pytest

import bimnav as bn
from bimnav.detections import parse_length, parse_place, parse_target
from bimnav.errors import FileKindError, FileMissingError, InputError, ModelError, ValueRangeError
from bimnav.testing import room


@pytest.mark.parametrize(
    ("text", "metres"), [("2", 2.0), ("1ft", 0.3048), ("30 cm", 0.3), ("-5mm", -0.005), ("12in", 0.3048), ("1e2", 100)]
)
def test_lengths_may_say_their_unit(text, metres):
    assert parse_length(text) == pytest.approx(metres, abs=1e-12)


@pytest.mark.parametrize("text", ["", "ft", "1 yard", "nan", "inf", "1,5", "0x10"])
def test_what_is_no_length_is_refused(text):
    with pytest.raises(InputError, match="not a length"):
        parse_length(text)


def test_a_storeys_name_may_hold_commas_and_at_signs():
    assert parse_place("-1,2,Level 1, east @ dock") == (-1.0, 2.0, "Level 1, east @ dock")
    target = parse_target("cup @ desk@-1.5,2ft,Level 1, east")
    assert (target.name, target.x, target.y, target.storey) == ("cup @ desk", -1.5, 0.6096, "Level 1, east")


@pytest.mark.parametrize("text", ["spill", "spill@1", "@1,2", "spill@a,b", "1,2"])
def test_what_is_no_target_is_refused(text):
    with pytest.raises(InputError, match=r"NAME@X,Y|not a length"):
        parse_target(text)


def test_a_target_has_the_same_id_in_every_run_and_another_elsewhere():
    one, again, other = bn.Detection("spill", 1, 2), bn.Detection("spill", 1.0, 2.0), bn.Detection("spill", 1, 2.5)
    assert len(one.global_id) == 22
    assert one.global_id == again.global_id != other.global_id


def test_csv_and_json_say_the_same(tmp_path):
    table = tmp_path / "seen.csv"
    table.write_text(
        "name,x,y,storey,z,size,class\nspill,1,2ft,Ground floor,,0.4,\nbox,3,-1,,0.5,0.3 x 0.2,IfcFurniture\n"
    )
    values = tmp_path / "seen.json"
    values.write_text(
        json.dumps(
            [
                {"name": "spill", "x": 1, "y": 0.6096, "storey": "Ground floor", "size": 0.4},
                {"name": "box", "x": 3, "y": -1, "z": 0.5, "size": [0.3, 0.2], "class": "IfcFurniture"},
            ]
        )
    )
    assert bn.read_targets(table) == bn.read_targets(values)
    assert bn.read_targets(table)[1].size == (0.3, 0.2)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x,y\n1,2\n", "column 'name'"),
        ("name,x,y\nspill,1\n", "line 2"),
        ("name,x,y\nspill,one,2\n", "line 2: x is 'one'"),
        ("name,x,y,story\nspill,1,2,L1\n", "Did you mean 'storey'"),
        ("name,x,y\nspill,,2\n", "x is missing"),
        ("name,x,y,size\nspill,1,2,a x b\n", "size"),
    ],
)
def test_a_bad_csv_is_refused_with_its_place(tmp_path, text, says):
    path = tmp_path / "seen.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        bn.read_targets(path)
    assert "seen.csv" in str(caught.value)


@pytest.mark.parametrize("text", ["{", '{"name": "spill"}', "[1, 2]", "[" * 100_000])
def test_a_bad_json_is_refused(tmp_path, text):
    path = tmp_path / "seen.json"
    path.write_text(text)
    with pytest.raises(FileKindError, match=r"seen\.json"):
        bn.read_targets(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(FileMissingError, match="does not exist"):
        bn.read_targets(tmp_path / "none.csv")
    with pytest.raises(FileKindError, match="not a file"):
        bn.read_targets(tmp_path)


def test_an_unknown_storey_is_refused_with_the_names_there_are():
    with pytest.raises(ModelError, match="It has 'Ground floor'"):
        room().with_targets([("spill", 1, 1, "Attic")])


def test_a_point_that_is_not_finite_is_refused():
    with pytest.raises(ValueRangeError, match="x is nan"):
        room().with_targets([("spill", float("nan"), 1)])
