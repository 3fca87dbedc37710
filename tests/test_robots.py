"""Robots from files."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tomllib
from dataclasses import fields
from importlib.resources import files

import pytest
from hypothesis import given, settings, strategies as st

import bimnav as bn
from bimnav.cli import main
from bimnav.errors import FileMissingError, RobotError
from bimnav.robots import VARIABLE, list_robots, load_robot, robot_named, robot_schema
from tests.conftest import REPOSITORY


@pytest.fixture
def write(tmp_path):
    def written(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text("schema = 1\n" + text, encoding="utf-8")
        return path

    return written


def test_the_profiles_are_robots_that_differ_from_each_other():
    known = list_robots()
    names = [info.name for info in known]
    assert {"point", "small_cleaner", "delivery", "inspection", "telepresence", "legged"} <= set(names)
    robots = [bn.load_robot(name) for name in names]
    assert [robot.name for robot in robots] == names
    assert len({(r.radius, r.height, r.speed, r.reach, r.reach_height) for r in robots}) == len(robots)
    assert all(info.description.endswith(".") for info in known)
    assert bn.load_robot("point") == bn.Robot("point")
    assert bn.load_robot("inspection").reach == 1.0
    assert [r.name for r in robots if r.max_riser > 0] == ["legged"]
    assert all(math.isfinite(r.battery_wh) for r in robots if r.name != "point")


def test_a_robot_of_ones_own_builds_on_another(write):
    path = write('[robots.scout]\nextends = "legged"\nspeed = 2\n[robots.tall]\nextends = "scout"\nheight = 1.5\n')
    tall = load_robot(path, "tall")
    legged = load_robot("legged")
    assert (tall.name, tall.speed, tall.height, tall.outline) == ("tall", 2, 1.5, legged.outline)
    assert load_robot(f"{path}#scout").height == legged.height


def test_a_radius_of_its_own_replaces_the_outline_of_the_base(write):
    path = write('[robots.round]\nextends = "legged"\nradius = 0.2\n')
    robot = load_robot(path)
    assert (robot.outline, robot.radius) == (None, 0.2)


def test_all_mistakes_are_told_at_once_with_their_lines(write):
    path = write(
        """
[robots.a]
radios = 0.2
speed = "fast"
radius = 20
height = -1
uses_lifts = 1
keys = "front"
outline = [[0, 0], [1]]
[robots.b]
extends = "legs"
[robots.c]
extends = "d"
[robots.d]
extends = "c"
[robots.e]
step_height = 0.9
height = 0.5
[robot]
"""
    )
    with pytest.raises(RobotError) as refused:
        load_robot(path, "a")
    lines = {(p["line"], p["key"]) for p in refused.value.context["problems"]}
    assert {
        (4, "robots.a.radios"),
        (5, "robots.a.speed"),
        (6, "robots.a.radius"),
        (7, "robots.a.height"),
        (8, "robots.a.uses_lifts"),
        (9, "robots.a.keys"),
        (10, "robots.a.outline"),
        (12, "robots.b.extends"),
        (18, "robots.e.step_height"),
        (20, "robot"),
    } <= lines
    text = str(refused.value)
    assert f"{path}:4: unknown key 'radios' in robots.a; did you mean 'radius'?" in text
    assert "robots.a.radius = 20: Give a number from 0 to 10." in text
    assert "there is no such robot; did you mean 'legged'?" in text
    assert "goes round: 'c' extends 'd' extends 'c'" in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "a robot file holds tables"),
        ("robots = 3", "a robot file holds tables"),
        ("[robots.a]\nspeed = ", ":3: "),
        ("[robots.a]\nspeed = 1\nspeed = 2", ":4: "),
        ('[robots.""]\nspeed = 1', "should be a table with a name"),
    ],
)
def test_files_that_are_none_are_refused(write, text, said):
    with pytest.raises(RobotError) as refused:
        load_robot(write(text))
    assert said in str(refused.value)


def test_a_file_without_its_version_is_refused(tmp_path):
    path = tmp_path / "old.toml"
    path.write_text("[robots.a]\n")
    with pytest.raises(RobotError, match=r"old\.toml:1: begin with schema = 1"):
        load_robot(path)
    path.write_bytes(b"schema = 1\n# \xff\n")
    with pytest.raises(RobotError, match=r"old\.toml:2: this is not UTF-8"):
        load_robot(path)
    with pytest.raises(FileMissingError):
        load_robot(tmp_path / "none.toml")


def test_a_file_of_several_robots_needs_a_name(write):
    path = write("[robots.a]\n[robots.b]\n")
    with pytest.raises(RobotError, match=r"holds 2 robots\. Say which, as in .*#a"):
        load_robot(path)
    with pytest.raises(RobotError, match="there is no robot 'c'"):
        load_robot(path, "c")


def test_folders_of_ones_own_are_known_by_name(write, monkeypatch, tmp_path):
    write("[robots.scout]\n")
    assert load_robot("scout", robots_path=[tmp_path]).name == "scout"
    monkeypatch.setenv(VARIABLE, os.pathsep.join([str(tmp_path), ""]))
    assert load_robot("scout").name == "scout"
    assert "scout" in [info.name for info in list_robots()]
    write("[robots.legged]\n", "other.toml")
    with pytest.raises(RobotError, match="there is a robot 'legged' already, in built-in"):
        list_robots()
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    with pytest.raises(FileMissingError, match="does not exist"):
        list_robots()


def test_an_unknown_name_names_the_nearest():
    with pytest.raises(RobotError, match=r"there is no robot 'leged' in the list of robots\. Did you mean 'legged'"):
        load_robot("leged")
    assert robot_named("Rosie") == bn.Robot("Rosie")
    assert robot_named("delivery") == load_robot("delivery")


@settings(max_examples=50, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["radius", "speed", "outline", "keys", "opens_doors", "extends", "nonsense"]),
        st.sampled_from(["1", "-1", "inf", "nan", "true", '"x"', "[]", "[[1, 2]]", '["a"]', "{}", "1979-05-27"]),
    )
)
def test_any_table_is_a_robot_or_one_error(tmp_path_factory, table):
    path = tmp_path_factory.mktemp("robots") / "any.toml"
    path.write_text("schema = 1\n[robots.a]\n" + "".join(f"{key} = {value}\n" for key, value in table.items()))
    problems = []
    try:
        robot = load_robot(path)
    except RobotError as error:
        problems = error.context["problems"]
    assert all(problem["line"] >= 1 for problem in problems)
    assert problems or robot.name == "a"


def run_cli(*arguments):
    command = [sys.executable, "-m", "bimnav.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=REPOSITORY)


def test_the_command_lists_and_shows_robots():
    listed = json.loads(run_cli("robots", "--json").stdout)
    assert {"name", "description", "source"} == set(listed[0])
    shown = json.loads(run_cli("robots", "show", "legged", "--json").stdout)
    assert (shown["max_riser"], shown["keys"]) == (0.2, [])
    assert "max_riser        0.2" in run_cli("robots", "show", "legged").stdout
    wrong = run_cli("robots", "show", "leged")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)


def test_run_takes_a_profile_and_explicit_sizes_go_before_it(write):
    path = write('[robots.mini]\nextends = "small_cleaner"\nspeed = 0.25\n')
    model = bn.sample("apartment")
    job = run_cli("run", model, "--robot", f"{path}#mini", "--cell", "0.1", "--radius", "0.1", "--json")
    assert job.returncode == 0, job.stderr
    report = json.loads(job.stdout)
    assert report["tour"]["duration"] >= report["tour"]["length"] / 0.3
    wrong = run_cli("run", model, "--robot", f"{path}#maxi")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    assert "there is no robot 'maxi'" in wrong.stderr


def test_the_schema_of_robot_files_takes_what_is_taken_and_refuses_what_is_refused(write):
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(run_cli("robots", "schema").stdout)
    assert schema == robot_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    judge = jsonschema.Draft202012Validator(schema)
    judge.validate(tomllib.loads(files("bimnav.robots").joinpath("library.toml").read_text(encoding="utf-8")))
    known = schema["$defs"]["Robot"]["properties"]
    assert {"description", "extends"} | {f.name for f in fields(bn.Robot)} == {*known, "name"}
    assert all(len(entry["description"]) > 10 for entry in known.values())
    for line in (
        "radius = -1",
        "radius = 11",
        "speed = 0",
        'height = "tall"',
        "uses_lifts = 1",
        "keys = 'A'",
        "outline = [[0, 0], [1]]",
        "raech = 1",
        "extends = 3",
        "abilities = [' ']",
    ):
        text = f"[robots.a]\n{line}\n"
        assert not judge.is_valid(tomllib.loads("schema = 1\n" + text)), line
        with pytest.raises(RobotError):
            load_robot(write(text))
    for line in ("battery_wh = inf", "outline = [[1, 0], [0, 1], [-1, 0]]", "keys = ['A']", "turn_rate = 1"):
        text = f"[robots.a]\n{line}\n"
        judge.validate(tomllib.loads("schema = 1\n" + text))
        load_robot(write(text))


@pytest.mark.parametrize(("wrong", "meant"), [("scruber", "scrubber"), ("cleanerr", "small_cleaner")])
def test_a_name_that_is_nearly_a_profile_is_taken_with_a_warning(capsys, wrong, meant):
    assert main(["run", str(bn.sample("apartment")), "--robot", wrong, "--json"]) == 0
    captured = capsys.readouterr()
    assert f"did you mean {meant!r}" in captured.err
    assert f'"name": "{wrong}"' in captured.out
