"""`bimnav tasks`: list, schema, check, show."""

import json
import re

import pytest

from bimnav.cli import main

TASK = """schema = 1
[tasks.look]
[[tasks.look.targets]]
label = "places to sit"
filter = "IfcFurniture"
words = ["chair", "sofa"]
[[tasks.look.targets]]
label = "furniture"
filter = "IfcFurnishingElement"
priority = 3
[[tasks.look.restricted]]
filter = "IfcSpace"
words = ["sauna"]
"""


@pytest.fixture
def apartment(data_ifc):
    return str(data_ifc / "apartment.ifc")


def file_of(tmp_path, text):
    path = tmp_path / "my.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_file_is_checked_without_a_model(tmp_path, capsys):
    assert main(["tasks", "check", file_of(tmp_path, TASK)]) == 0
    assert capsys.readouterr().out.endswith("my.toml: look: no mistakes\n")


def test_mistakes_of_keys_and_filters_are_told_together_with_exit_code_2(tmp_path, capsys):
    path = file_of(tmp_path, TASK.replace('"IfcSpace"', '"IfcSpacer"').replace("priority", "prority"))
    assert main(["tasks", "check", path]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (f"{path}:10: error: unknown key 'prority' in tasks.look.targets[1]; did you mean 'priority'?")
    assert lines[1].startswith(f"{path}:12: error: tasks.look.restricted[0]: filter 'IfcSpacer' names an unknown class")
    assert lines[1].endswith("Did you mean IfcSpace?")
    assert main(["tasks", "check", path, "--json"]) == 2
    told = json.loads(capsys.readouterr().out)
    assert [(p["severity"], p["line"], p["value"]) for p in told["problems"]] == [
        ("error", 10, "3"),
        ("error", 12, "'IfcSpacer'"),
    ]
    assert main(["tasks", "show", path, "nothing.ifc"]) == 2


def test_with_a_model_it_counts_what_each_rule_picks_and_warns_of_empty_ones(tmp_path, apartment, capsys):
    path = file_of(tmp_path, TASK)
    assert main(["tasks", "check", path, apartment]) == 0
    out = capsys.readouterr().out
    assert "furniture" in out
    assert re.search("warning: nothing; its filter alone picks [1-9]", out)
    assert main(["tasks", "check", path, apartment, "--json"]) == 0
    rules = json.loads(capsys.readouterr().out)["rules"]["look"]
    assert [rule["kind"] for rule in rules] == ["targets", "targets", "restricted"]
    assert rules[1]["found"] == rules[1]["filtered"] > rules[0]["found"] > 0
    assert len(rules[1]["examples"]) == 3
    assert rules[2]["notes"][0]["severity"] == "warning"


def test_a_rule_that_expects_more_than_there_is_is_an_error(tmp_path, apartment, capsys):
    path = file_of(tmp_path, f'{TASK}expect = ">=1"\n')
    assert main(["tasks", "check", path, apartment]) == 2
    assert "finds 0 and expects >=1" in capsys.readouterr().out
    assert main(["tasks", "show", path, apartment]) == 2


def test_what_rules_pick_is_shown_with_the_reason_and_the_rules_that_gave_way(tmp_path, apartment, capsys):
    path = file_of(tmp_path, TASK)
    assert main(["tasks", "show", path, apartment, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    seats, furniture, _ = shown["rules"]
    assert all("has the word" in element["why"] for element in seats["elements"])
    assert {each["global_id"] for each in shown["overruled"]} == {each["global_id"] for each in seats["elements"]}
    assert len(furniture["elements"]) == furniture["found"]
    assert main(["tasks", "show", path, apartment]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("look in ")
    assert sum("has the word" in line for line in lines) >= seats["found"]
    assert any("gives way to rule 'places to sit'" in line for line in lines)


def test_tasks_of_a_folder_are_listed_and_shown(tmp_path, apartment, capsys):
    file_of(tmp_path, TASK)
    assert main(["tasks", "list", "--tasks-path", str(tmp_path)]) == 0
    assert "look" in capsys.readouterr().out.split()
    assert main(["tasks", "--tasks-path", str(tmp_path)]) == 0
    assert main(["tasks", "show", "look", apartment, "--tasks-path", str(tmp_path)]) == 0


def test_the_schema_is_printed(capsys):
    assert main(["tasks", "schema"]) == 0
    assert json.loads(capsys.readouterr().out)["$defs"]["TaskTable"]["properties"]["extends"]["type"] == "string"
