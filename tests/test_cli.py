"""The command line, as a user meets it."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys

import pytest

import bimnav as bn
from bimnav.cli import main
from tests.conftest import real_model

APARTMENT = str(bn.sample("apartment"))


def test_a_run_prints_what_was_done(capsys, tmp_path):
    assert main(["run", APARTMENT, "--cell", "0.5ft", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "4 of 4 targets" in printed
    assert "proved shortest" in printed
    assert "touches no obstacle" in printed
    assert "a point, as in the paper" in printed
    assert str(tmp_path / "plan.png") in printed


def test_a_run_prints_one_json_object(capsys):
    assert main(["run", APARTMENT, "--cell", "1ft", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert {
        "model", "schema", "task", "cell_size", "storeys", "nodes", "targets", "conflicts", "tour", "simulation",
        "issues", "files",
    } <= set(report)  # fmt: skip
    assert report["cell_size"] == 0.3048
    assert {"regular", "obstacle", "target"} <= set(report["nodes"])
    assert all(target["reached"] for target in report["targets"])
    assert len(report["conflicts"]) == 1
    assert report["files"] == []


def test_targets_come_from_options_and_files(capsys, tmp_path):
    seen = tmp_path / "seen.csv"
    seen.write_text("name,x,y\njuice,1.0,13.5\n")
    arguments = ["run", APARTMENT, "--cell", "0.1", "--target", "mud@5,18.5", "--targets", str(seen), "--json"]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert {t["name"] for t in report["targets"] if t["source"] == "user"} == {"mud", "juice"}


def test_how_paths_are_made_is_chosen_by_options(capsys):
    arguments = ["run", APARTMENT, "--cell", "0.1", "--end", "1,17", "--smooth", "--clearance", "30cm"]
    assert main([*arguments, "--objective", "time"]) == 0
    told = capsys.readouterr().out
    assert "along straight legs, proved fastest" in told
    assert "end      (1.000, 17.000)" in told
    assert main([*arguments, "--robot", "inspection", "--objective", "energy", "--json"]) == 0
    tour = json.loads(capsys.readouterr().out)["tour"]
    assert (tour["objective"], tour["is_smooth"], tour["end"][:2]) == ("energy", True, [1.0, 17.0])
    assert tour["cost"] > 100 * tour["length"]  # joules


def test_coordinates_may_be_negative(capsys):
    house = str(real_model("houses/SampleHouse4.ifc"))
    arguments = ["run", house, "--cell", "0.1", "--start", "-3,2", "--target", "spill@-1.5,1", "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["start"]["point"][:2] == [-3.0, 2.0]


def test_some_targets_unreached_is_exit_code_three(capsys):
    duplex = str(real_model("duplex/Duplex_A_20110907.ifc"))
    here, there = "here@3,-2,Level 1", "there@3,-15,Level 1"
    arguments = [
        "run",
        duplex,
        "--cell",
        "0.1",
        "--start",
        "3,-3,Level 1",
        "--target",
        here,
        "--target",
        there,
        "--json",
    ]
    assert main(arguments) == 3
    reached = {t["name"]: t["reached"] for t in json.loads(capsys.readouterr().out)["targets"]}
    assert reached == {"here": True, "there": False}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "no/such.ifc"], "no/such.ifc"),
        (["run", "."], "folder"),
        (["run", APARTMENT, "--task", "clean"], "cleaning"),
        (["run", APARTMENT, "--cell", "0"], "cell size is 0"),
        (["run", APARTMENT, "--cell", "-1"], "cell size is -1"),
        (["run", APARTMENT, "--cell", "nan"], "not a length"),
        (["run", APARTMENT, "--cell", "0.5mm"], "at least"),
        (["run", APARTMENT, "--start", "99,99"], "no floor"),
        (["run", APARTMENT, "--start", "2.8,17.9"], "Round Table"),
        (["run", APARTMENT, "--start", "1,14,Attic"], "Ground Floor"),
        (["run", APARTMENT, "--end", "99,99"], "end (99, 99) lies on no floor"),
        (["run", APARTMENT, "--end", "1,17", "--return"], "both end elsewhere and return"),
        (["run", APARTMENT, "--objective", "money"], "choose from"),
        (["run", APARTMENT, "--objective", "energy"], "draws no power"),
        (["run", APARTMENT, "--clearance", "-1"], "clearance is -1"),
        (["run", APARTMENT, "--target", "spill@99,99"], "spill"),
        (["run", APARTMENT, "--target", "spill"], "NAME@X,Y"),
        (["run", APARTMENT, "--targets", "none.csv"], "none.csv"),
        (["run", APARTMENT, "--radius", "-1"], "radius"),
        (["run", APARTMENT, "--radius", "3"], "Use a smaller robot"),
        (["run", APARTMENT, "--connectivity", "5"], "choose from"),
        (["run"], "MODEL"),
        (["walk"], "invalid choice"),
        (["inspect", "no/such.ifc"], "no/such.ifc"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_two(arguments, says, capsys):
    try:
        code = main(arguments)
    except SystemExit as exit_:
        code = exit_.code
    printed = capsys.readouterr()
    assert code == 2
    assert printed.out == ""
    assert len(printed.err.strip().splitlines()) == 1
    assert says in printed.err


def test_an_out_folder_that_is_a_file_is_refused(capsys, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine")
    assert main(["run", APARTMENT, "--out", str(taken)]) == 2
    assert "taken" in capsys.readouterr().err
    assert taken.read_text() == "mine"


def test_inspect_accounts_for_every_product(capsys):
    assert main(["inspect", APARTMENT, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    ledger = report["ledger"]
    assert set(ledger) == {"asked", "footprinted", "outside_bands", "left_out", "lost"}
    assert ledger["asked"] == sum(count for name, count in ledger.items() if name != "asked") > 0
    (storey,) = report["storeys"]
    assert (storey["spaces"], storey["doors"]) == (5, 6)
    assert main(["inspect", APARTMENT]) == 0
    assert "Ground Floor" in capsys.readouterr().out


def test_inspect_says_what_a_robot_reaches(capsys, tmp_path):
    assert main(["inspect", APARTMENT, "--readiness"]) == 0
    assert "5 of   5 rooms" in capsys.readouterr().out
    page = tmp_path / "ready.html"
    assert main(["inspect", APARTMENT, "--html", str(page), "--radius", "0.6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["share"]["rooms"] < 1
    assert page.read_text().startswith("<!doctype html>")


def test_tasks_are_listed(capsys):
    assert main(["tasks", "list"]) == 0
    assert "cleaning" in capsys.readouterr().out
    assert main(["tasks", "list", "--json"]) == 0
    assert "cleaning" in {task["name"] for task in json.loads(capsys.readouterr().out)}


def test_the_doctor_finds_the_installation_well(capsys):
    assert main(["doctor", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ok"]


def test_importing_bimnav_loads_nothing_heavy():
    heavy = [
        "numpy",
        "scipy",
        "shapely",
        "ifcopenshell",
        "numba",
        "matplotlib",
        "manifold3d",
        "fcl",
        "simpy",
        "pydantic",
    ]
    script = f"import sys, bimnav; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_the_public_names_are_the_same_for_programs_and_type_checkers():
    import ast
    from pathlib import Path

    tree = ast.parse(Path(bn.__file__).read_text())
    (block,) = (n for n in tree.body if isinstance(n, ast.If))
    static = {alias.name: node.module for node in block.body for alias in node.names}
    assert static == bn._HOME
    for name in bn.__all__:
        assert getattr(bn, name) is not None


@pytest.mark.parametrize("command", ["", "run", "inspect", "tasks", "robots", "cache", "doctor", "completion"])
def test_every_help_text_has_examples_and_explains_every_option(command, capsys):
    with pytest.raises(SystemExit):
        main([*command.split(), "--help"])
    text = capsys.readouterr().out
    examples = text.partition("\nexamples:\n")[2].strip().splitlines()
    assert all(line.strip().startswith("bimnav ") for line in examples[:2])
    for option in re.findall(r"^  (--\S+.*(?:\n {10,}.*)*)", text, re.MULTILINE):
        assert re.search(r"\S(?: {2,}|\n +)\S", option), f"nothing is said of {option}"


def test_names_of_any_kind_are_shown_as_they_are_and_break_nothing(capsys, tmp_path):
    names = [r"$\frac{$", "a\nb\x1b[31m", "漏水", "<b>"]
    arguments = [word for name in names for word in ("--target", f"{name}@2,16")]
    assert main(["run", APARTMENT, *arguments, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert r"a\nb\x1b[31m at (2.000, 16.000)" in printed.out
    assert "\x1b" not in printed.out
    assert printed.err == ""
    assert {path.name for path in tmp_path.iterdir()} == {
        "plan.png", "route.csv", "events.csv", "report.json", "replay.html",
    }  # fmt: skip


@pytest.mark.parametrize("wrong", [["--seed", "-5"], ["--out", ""]])
def test_what_cannot_be_used_is_one_line_before_anything_is_read(wrong, capsys):
    assert main(["run", "no such file.ifc", *wrong]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert wrong[0].lstrip("-") in printed.err


def test_targets_with_one_reason_share_a_line(capsys):
    house = str(real_model("houses/231110AC11-FZK-Haus-IFC.ifc"))
    assert main(["run", house, "--task", "inspection_building", "--radius", "0.3", "--cell", "0.2"]) == 3
    told = [line for line in capsys.readouterr().out.splitlines() if "not served" in line]
    assert any(" and " in line and line.split(": ")[1].endswith(" more") for line in told)
    assert len({line.split(": ", 2)[2] for line in told}) == len(told)


def test_many_conflicts_are_a_few_lines(capsys):
    targets = [word for k in range(8) for word in ("--target", f"t{k}@1,16")]
    assert main(["run", APARTMENT, *targets, "--cell", "0.5ft"]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  conflict ")]
    assert len(told) == 6
    assert told[-1].endswith("3 more targets on obstacle cells")


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["ins"], ["inspect"]),
        (["run", "--cl"], ["--clearance"]),
        (["run", "house.ifc", "--objective", "t"], ["time"]),
        (["tasks", "ch"], ["check"]),
        (["inspect", "--ast"], []),
        (["run", "--out", ""], []),  # files
    ],
)
def test_bash_completes_commands_options_and_choices(typed, offered, capsys, tmp_path):
    assert main(["completion", "bash"]) == 0
    words = " ".join(map(shlex.quote, ["bimnav", *typed]))
    script = (
        f'{capsys.readouterr().out}\nCOMP_WORDS=({words}); COMP_CWORD={len(typed)}; _bimnav; echo "${{COMPREPLY[@]}}"'
    )
    told = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert told.stdout.split() == offered
    assert told.stderr == ""


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_told_of_every_command(shell, capsys):
    assert main(["completion", shell]) == 0
    told = capsys.readouterr().out
    assert all(command in told for command in ("run", "inspect", "tasks", "robots", "cache", "doctor"))
    assert "clearance" in told
