"""Reading models: the process border, what crosses it, what dies behind it, and the cache."""

from __future__ import annotations

import logging
import os
import random
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import bimnav.ifc._watch as watch
from bimnav.errors import (
    BimnavError,
    CacheError,
    FileKindError,
    FileMissingError,
    IfcReferenceError,
    IfcSyntaxError,
    IfcTruncatedError,
    InputError,
    OutputError,
    ReaderCrashError,
    ReaderError,
    ReaderMemoryError,
    ReaderTimeoutError,
    ValueRangeError,
)
from bimnav.ifc import cache_info, clear_cache, read_ifc
from bimnav.ifc._store import cache_folder, key_of, pack, unpack
from bimnav.ifc._watch import Limits, read_apart
from tests.conftest import real_model
from tests.ifc_text import box, crasher, model, product, staller
from tests.test_prescan import REAL_MODELS

posix = pytest.mark.skipif(os.name != "posix", reason="needs signals and process groups")


@pytest.fixture(autouse=True)
def _own_places(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Give each test a cache and a folder for temporary files, and see that nothing stays in the latter."""
    monkeypatch.setenv("BIMNAV_CACHE", str(tmp_path_factory.mktemp("cache")))
    temporary = tmp_path_factory.mktemp("temporary")
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    yield
    assert list(temporary.iterdir()) == []


@pytest.fixture
def house(tmp_path: Path) -> Path:
    path = tmp_path / "house.ifc"
    path.write_text(model(box(200, "second")))
    return path


def written(tmp_path: Path, *lines: list[str] | str) -> Path:
    path = tmp_path / "model.ifc"
    path.write_text(model(*lines))
    return path


def no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(subprocess, "Popen", refuse)


def processes_about(text: str) -> list[int]:
    """Process ids whose command line holds a text; needs /proc."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if text.encode() in entry.read_bytes():
                found.append(int(entry.parent.name))
        except OSError:
            continue
    return found


def until(condition: object, seconds: float = 20.0) -> bool:
    deadline = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


# reading


@pytest.mark.parametrize("isolate", [True, False])
def test_a_model_becomes_a_building(house: Path, isolate: bool):
    building = read_ifc(house, isolate=isolate)
    assert [element.name for element in building] == ["box", "second"]
    assert building.name == "house"
    assert building.sources == (str(house),)
    np.testing.assert_allclose(building.elements[0].bounds, [[-0.5, -0.5, 0], [0.5, 0.5, 1]], atol=1e-9)
    assert building.select("Name=second") == (building.elements[1],)
    assert len(building.ledger.asked) == 2
    assert not building.ledger.lost


def test_a_file_is_needed():
    with pytest.raises(InputError, match="no file"):
        read_ifc()


def test_two_readings_are_equal_to_the_last_byte_in_whatever_process(house: Path):
    first, second = read_apart(house), read_apart(house)
    assert first.packed == second.packed == watch.read_here(house, lambda *_: None).packed


@pytest.mark.parametrize("isolate", [True, False])
@pytest.mark.parametrize(
    ("text", "kind", "word"),
    [
        (model(end=False), IfcTruncatedError, "#104"),
        (model("#20=IFCLOCALPLACEMENT(#20,#5);"), IfcReferenceError, "#20"),
        (model("#20=IFCCARTESIANPOINT((1.,2.,1.2.3));"), IfcSyntaxError, "cannot be parsed"),
        ("<html>", FileKindError, "web page"),
    ],
)
def test_a_refusal_is_the_same_on_both_sides_of_the_border(
    tmp_path: Path, text: str, kind: type[BimnavError], word: str, isolate: bool
):
    path = tmp_path / "bad.ifc"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_ifc(path, isolate=isolate)
    assert type(caught.value) is kind
    assert "bad.ifc" in str(caught.value)
    assert word in str(caught.value)
    assert caught.value.hint
    assert caught.value.context
    assert cache_info().models == 0


def test_what_is_no_file_is_refused_before_any_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    no_process(monkeypatch)
    with pytest.raises(FileMissingError):
        read_ifc(tmp_path / "missing.ifc")
    with pytest.raises(FileKindError):
        read_ifc(tmp_path)


def test_a_product_of_a_class_the_schema_lacks_is_lost(tmp_path: Path):
    building = read_ifc(written(tmp_path, box(200, ifc_class="IFCHOLOGRAM")))
    lost = f"{200:022d}"
    assert building.ledger.lost == {lost: "IFC4 has no class IFCHOLOGRAM"}
    assert len(building.ledger.asked) == 2
    [issue] = [issue for issue in building.issues if issue.code == "damaged-text"]
    assert issue.severity == "error"
    assert issue.global_ids == (lost,)


@pytest.mark.parametrize("number", [201, 202, 203, 204])
def test_a_product_whose_body_or_place_refers_to_nothing_is_lost(tmp_path: Path, number: int):
    lines = [line for line in box(200) if not line.startswith(f"#{number}=")]
    building = read_ifc(written(tmp_path, lines))
    lost = f"{200:022d}"
    assert building.ledger.lost == {lost: f"it refers to #{number}, which is not there or cannot be read"}
    assert lost in building.ledger.asked
    assert lost not in building.ledger.left_out
    assert building.ledger.read == (f"{100:022d}",)


@pytest.mark.parametrize(
    ("line", "torn"),
    [
        ("#206=IFCPOLYLINE((#6,$,#20,#21,#6));", True),
        ("#206=IFCPOLYLINE((#6,*,#20,#21,#6));", True),
        ("#206=IFCPOLYLINE((#6,12,#20,#21,#6));", True),
        ("#206=IFCPOLYLINE((#6,(#6),#20,#21,#6));", True),
        ("#206=IFCPOLYLINE(/* $ */(#6,#20, /* $ */ #21,#6));", False),
        ("#206=IFCCOMPOSITECURVE((#30,#31,#32),.U.);", False),
        ("#20=IFCCARTESIANPOINT((1.,$,0.));", True),
        ("#20=IFCCARTESIANPOINT((1.,'a',0.));", True),
        ("#20=IFCCARTESIANPOINT((1,0.,0.));", False),
    ],
)
def test_a_list_of_which_the_parser_drops_members_makes_its_product_lost(tmp_path: Path, line: str, torn: bool):
    outline = {
        number: f"#{number}={text};"
        for number, text in {
            20: "IFCCARTESIANPOINT((1.,0.))",
            21: "IFCCARTESIANPOINT((0.,1.))",
            30: "IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,#40)",
            31: "IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,#41)",
            32: "IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,#42)",
            40: "IFCPOLYLINE((#6,#20))",
            41: "IFCTRIMMEDCURVE(#43,(#20,IFCPARAMETERVALUE(0.)),(#21,IFCPARAMETERVALUE(1.)),.T.,.PARAMETER.)",
            42: "IFCPOLYLINE((#21,#6))",
            43: "IFCLINE(#20,#44)",
            44: "IFCVECTOR(#45,1.)",
            45: "IFCDIRECTION((-1.,1.))",
            206: "IFCPOLYLINE((#6,#20,#21,#6))",
        }.items()
    }
    outline[int(line[1 : line.index("=")])] = line
    lines = product(
        200, "#204=IFCEXTRUDEDAREASOLID(#205,$,#10,1.);", "#205=IFCARBITRARYCLOSEDPROFILEDEF(.AREA.,$,#206);"
    )
    building = read_ifc(written(tmp_path, lines, outline.values()), isolate=False, cache=False)
    assert (f"{200:022d}" in building.ledger.lost) == torn
    assert f"{100:022d}" in building.ledger.read


@pytest.mark.parametrize(
    "relation",
    [
        "#20=IFCRELAGGREGATES('0000000000000000000020',$,$,$,'a',(#100));",
        "#20=IFCRELAGGREGATES('0000000000000000000020',$,$,$,#7,('a','b'));",
        "#20=IFCRELCONTAINEDINSPATIALSTRUCTURE('0000000000000000000020',$,$,$,#7,(#100));",
        "#20=IFCRELDEFINESBYTYPE('0000000000000000000020',$,$,$,#100,'a');",
    ],
)
def test_a_relation_that_joins_something_else_than_entities_is_left_out_and_named(tmp_path: Path, relation: str):
    building = read_ifc(written(tmp_path, relation), isolate=False, cache=False)
    assert {*building.ledger.read, *building.ledger.lost} == {f"{100:022d}"}  # the kernel may stumble over it
    [issue] = [issue for issue in building.issues if issue.code == "malformed-relation"]
    assert "#20" in issue.message


def test_a_corner_that_is_missing_deep_in_a_body_makes_it_lost_but_not_its_neighbors(tmp_path: Path):
    brep = ["#205=IFCCLOSEDSHELL((#206));", "#206=IFCFACE((#207));", "#207=IFCFACEOUTERBOUND(#208,.T.);"]
    lines = product(200, "#204=IFCFACETEDBREP(#205);", *brep, "#208=IFCPOLYLOOP((#6,#6,#777));")
    building = read_ifc(written(tmp_path, lines, box(300)))
    assert list(building.ledger.lost) == [f"{200:022d}"]
    assert "#777" in building.ledger.lost[f"{200:022d}"]


def test_an_entity_the_parser_drops_is_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from bimnav.ifc import _reading

    path = written(tmp_path)
    honest = _reading.scan

    def counting_one_more(*args: object, **kwargs: object) -> object:
        said = honest(*args, **kwargs)  # type: ignore[arg-type]
        return type(said)(said.schema, said.unit_scale, said.instances + 1, said.products)

    monkeypatch.setattr(_reading, "scan", counting_one_more)
    with pytest.raises(IfcSyntaxError, match=r"model\.ifc holds 17 entities, of which only 16"):
        read_ifc(path, isolate=False)


def test_a_file_that_changes_while_it_is_read_is_refused(house: Path):
    def change(done: int, total: int, text: str) -> None:
        if text == "reading":
            house.write_text(model(box(300)))

    with pytest.raises(InputError, match="changed while it was read"):
        read_ifc(house, progress=change)
    assert cache_info().models == 0


def test_a_script_needs_no_guard_and_its_folder_shadows_nothing(tmp_path: Path, house: Path):
    for name in ("numpy", "ifcopenshell", "json", "svg", "bimnav"):
        (tmp_path / f"{name}.py").write_text(f"open('{name} was imported', 'w')")
    script = tmp_path / "scripts" / "script.py"
    script.parent.mkdir()
    script.write_text(f"import bimnav.ifc\nprint(bimnav.ifc.read_ifc({str(house)!r}))\n")
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout.count("2 elements") == 1, done.stderr
    assert list(tmp_path.glob("*was imported")) == []


# crashes and stalls


@posix
def test_a_product_that_crashes_the_kernel_is_lost_and_the_rest_is_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    path = written(tmp_path, crasher(500), box(600, "last"))
    building = read_ifc(path)
    assert building.ledger.lost == {f"{500:022d}": "crashed the geometry kernel"}
    assert [element.name for element in building if element.shapes] == ["box", "last"]
    assert f"{500:022d} crashed the geometry kernel" in caplog.text
    assert any(f"{500:022d}" in issue.global_ids and issue.severity == "error" for issue in building.issues)
    with caplog.at_level(logging.WARNING):
        caplog.clear()
        assert read_ifc(path).ledger.lost == building.ledger.lost  # from the cache
        assert caplog.text == ""


@posix
@pytest.mark.parametrize("number", [50, 500])
def test_the_first_product_and_the_last_may_crash_as_well(tmp_path: Path, number: int):
    building = read_ifc(written(tmp_path, crasher(number), box(200)), cache=False)
    assert list(building.ledger.lost) == [f"{number:022d}"]
    assert {element.name for element in building if element.shapes} == {"box"}


@posix
def test_too_many_crashes_are_an_error_that_names_the_product(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(watch, "_QUARANTINE_LIMIT", 1)
    with pytest.raises(ReaderCrashError) as caught:
        read_ifc(written(tmp_path, crasher(500), crasher(600)))
    assert "model.ifc crashed the reader (SIG" in str(caught.value)
    assert f"at product {600:022d} (2 of 2)" in str(caught.value)
    assert "unharmed" in str(caught.value)
    assert isinstance(caught.value, RuntimeError)


@posix
def test_terrain_that_crashes_the_kernel_is_left_out_and_blocks_nothing(tmp_path: Path):
    terrain = [line.replace("IFCBUILDINGELEMENTPROXY", "IFCSITE") for line in crasher(500)]
    building = read_ifc(written(tmp_path, terrain), cache=False)
    assert building.ledger.lost == {}
    assert building.ledger.left_out == {f"{500:022d}": "site"}
    assert building.terrain == ()
    [issue] = [issue for issue in building.issues if issue.code == "terrain-not-read"]
    assert issue.global_ids == (f"{500:022d}",)


@pytest.mark.parametrize("error", [ReaderCrashError, ReaderTimeoutError])
def test_a_product_is_lost_only_if_the_thorough_kernel_fails_as_well(
    house: Path, monkeypatch: pytest.MonkeyPatch, error: type[ReaderError]
):
    packed = read_apart(house).packed
    asked: list[dict[str, Any]] = []
    beyond_both = f"{100:022d}"

    def attempt(*_: object, **how: Any) -> SimpleNamespace:
        asked.append({name: list(value) if isinstance(value, list) else value for name, value in how.items()})

        def run() -> bytes:
            for suspect in (f"{200:022d}", beyond_both):
                if suspect not in (*how["skip"], *(g for g in how["thorough"] if g != beyond_both)):
                    raise error("it failed", "hint", {"stage": "reading", "suspect": suspect})
            return packed

        return SimpleNamespace(run=run)

    monkeypatch.setattr(watch, "_Attempt", attempt)
    reading = read_apart(house)
    assert list(reading.lost) == [beyond_both]
    assert reading.is_repeatable == (error is ReaderCrashError)
    assert [how["careful"] for how in asked] == [False, True, True, True]
    assert asked[-1]["thorough"] == [f"{200:022d}", beyond_both]
    assert asked[-1]["skip"] == [beyond_both]


@posix
def test_circles_that_no_first_look_saw_stay_behind_the_border(tmp_path: Path):
    loop = [line.replace("#8,#5", "#502,#5") for line in box(500)]
    loop[2] = "#502=IFCLOCALPLACEMENT(#501,#5);"
    path = written(tmp_path, [line.replace("#502,$,$)", "#102,$,$)") for line in loop])
    with pytest.raises(IfcReferenceError):
        read_apart(path)
    assert f"{500:022d}" in read_apart(path, check=False, limits=Limits(silence=3.0)).lost


@posix
def test_a_product_that_stalls_the_kernel_is_lost_and_that_is_not_cached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = written(tmp_path, staller(500))
    reading = read_apart(path, limits=Limits(silence=4.0))
    assert reading.lost == reading.model.tables["ledger"]["lost"] == {f"{500:022d}": "stalled the geometry kernel"}
    assert unpack(reading.packed).tables == reading.model.tables
    assert not reading.is_repeatable
    monkeypatch.setattr(watch, "read_apart", lambda *_, **__: reading)
    assert read_ifc(path).ledger.lost
    assert cache_info().models == 0


@posix
def test_a_reading_ends_at_its_time(tmp_path: Path):
    start = time.monotonic()
    with pytest.raises(TimeoutError) as caught:
        read_ifc(written(tmp_path, staller(500)), timeout=3.0)
    assert type(caught.value) is ReaderTimeoutError
    assert time.monotonic() - start < 8.0
    assert "model.ifc was not read within 3 s" in str(caught.value)
    assert "timeout=" in caught.value.hint


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit on address space that holds")
def test_a_reading_that_needs_too_much_memory_says_so(house: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(watch, "_LEAST_MEMORY", 0)
    with pytest.raises(MemoryError) as caught:
        read_ifc(house, memory=150 * 10**6)
    assert type(caught.value) is ReaderMemoryError
    assert "house.ifc needs more memory" in str(caught.value)
    assert "memory=" in caught.value.hint


@pytest.mark.parametrize(
    "limits", [{"timeout": 0.0}, {"timeout": float("nan")}, {"timeout": -1}, {"memory": 10}, {"memory": float("nan")}]
)
def test_limits_without_sense_are_refused(house: Path, limits: dict[str, float]):
    with pytest.raises(ValueRangeError) as caught:
        read_ifc(house, **limits)
    assert next(iter(limits)) in str(caught.value)


@posix
@pytest.mark.parametrize(
    ("number", "kind", "word"),
    [(signal.SIGKILL, ReaderMemoryError, "memory"), (signal.SIGSEGV, ReaderCrashError, "SIGSEGV")],
)
def test_a_killed_process_is_a_typed_error(
    house: Path, monkeypatch: pytest.MonkeyPatch, number: int, kind: type[BimnavError], word: str
):
    started: list[subprocess.Popen[bytes]] = []

    class Noted(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, *args: object, **kwargs: object) -> None:
            super().__init__(*args, **kwargs)  # type: ignore[call-overload]
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Noted)
    with pytest.raises(ReaderError) as caught:
        read_ifc(house, progress=lambda *_: os.kill(started[-1].pid, number))
    assert type(caught.value) is kind
    assert word in str(caught.value)


@pytest.mark.parametrize(
    "talk",
    [
        'print("hello")',
        'print("{}")',
        'print("[" * 60000)',
        'print("x" * 200000)',
        'print(\'{"beat": ["a", 1, 2]}\')',
        'print(\'{"error": {"error": "KeyboardInterrupt", "message": "m"}}\')',
        'print(\'{"error": {"error": "__doc__", "message": "m"}}\')',
        'print(\'{"done": true}\'); pathlib.Path("model.bimnav").write_bytes(b"junk" * 20)',
        "print('{\"done\": true}')",
        "",
    ],
)
def test_a_process_that_talks_nonsense_is_a_crash(house: Path, monkeypatch: pytest.MonkeyPatch, talk: str):
    real = subprocess.Popen

    def other(command: list[str], **kwargs: object) -> object:
        return real([sys.executable, "-c", f"import pathlib, sys; sys.stdout.reconfigure(); {talk}"], **kwargs)  # type: ignore[call-overload]

    monkeypatch.setattr(subprocess, "Popen", other)
    with pytest.raises(ReaderCrashError) as caught:
        read_ifc(house)
    assert "house.ifc" in str(caught.value)


def test_a_process_that_cannot_start_is_a_typed_error(house: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    with pytest.raises(ReaderError, match="isolate=False"):
        read_ifc(house)


def test_without_a_place_for_temporary_files_there_is_a_typed_error(house: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(**_: object) -> None:
        raise FileNotFoundError(2, "no usable folder")

    with monkeypatch.context() as patch:
        patch.setattr(tempfile, "TemporaryDirectory", refuse)
        for isolate in (True, False):
            with pytest.raises(OutputError, match="TMPDIR"):
                read_ifc(house, isolate=isolate)


# stopping

READER = """
    import sys
    from bimnav.ifc._watch import Limits, read_apart
    from pathlib import Path
    read_apart(Path(sys.argv[1]), report=lambda *told: print(*told, flush=True))
"""


def listen() -> None:
    """Take signals as a program in the foreground does; a shell tells those in the background to ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def stalled_reader(path: Path) -> subprocess.Popen[str]:
    """Start a program that reads a file, and wait until the reader stalls."""
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(READER), str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=listen,
    )
    assert process.stdout is not None
    for line in process.stdout:
        if f"{500:022d}" in line:
            break
    assert until(lambda: len(processes_about(str(path))) == 2)
    return process


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_ctrl_c_ends_the_process_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    path = written(tmp_path, staller(500))
    with stalled_reader(path) as process:
        assert len(list(temporary.iterdir())) == 1
        start = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=20)
        assert time.monotonic() - start < 3.0  # 0.2 s on an idle machine
    assert "KeyboardInterrupt" in stderr
    assert until(lambda: processes_about(str(path)) == [])
    assert list(temporary.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_ctrl_c_on_the_command_line_is_one_line_and_an_exit_code(tmp_path: Path):
    path = written(tmp_path, staller(500))
    command = [sys.executable, "-m", "bimnav.cli", "inspect", str(path)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, preexec_fn=listen)
    assert until(lambda: len(processes_about(str(path))) == 2)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=20)
    assert (process.returncode, stderr) == (130, b"bimnav: stopped\n")
    assert until(lambda: processes_about(str(path)) == [])


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_killed_caller_takes_the_process_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # a killed program cannot tidy up
    path = written(tmp_path, staller(500))
    with stalled_reader(path) as process:
        process.kill()
    assert until(lambda: processes_about(str(path)) == [])


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_an_exception_of_the_caller_ends_the_process(tmp_path: Path):
    path = written(tmp_path, staller(500))

    def give_up(done: int, total: int, text: str) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        read_ifc(path, progress=give_up)
    assert processes_about(str(path.absolute())) == []


# progress


@pytest.mark.parametrize("isolate", [True, False])
def test_progress_is_told(house: Path, isolate: bool):
    told: list[tuple[int, int, str]] = []
    read_ifc(house, progress=lambda *beat: told.append(beat), isolate=isolate)
    stages = [text for done, total, text in told if total == 0]
    assert stages[-4:] == ["checking", "opening", "reading", "finishing"]
    assert (0, 2, f"reading {100:022d}") in told
    assert (1, 2, f"reading {200:022d}") in told


def test_progress_is_shown_on_standard_error_and_wiped(house: Path, capsys: pytest.CaptureFixture[str]):
    read_ifc(house, progress=True)
    shown = capsys.readouterr().err
    assert "house.ifc: " in shown
    assert shown.endswith(" \r")
    read_ifc(house, progress=None, cache=False)
    read_ifc(house, progress=False, cache=False)
    assert capsys.readouterr().err == ""


# cache


def test_what_was_read_once_comes_from_the_cache(house: Path, monkeypatch: pytest.MonkeyPatch):
    first = read_ifc(house)
    assert cache_info().models == 1
    assert cache_info().size > 1000
    no_process(monkeypatch)
    second = read_ifc(house)
    assert [element.global_id for element in second] == [element.global_id for element in first]
    np.testing.assert_array_equal(second.elements[1].bounds, first.elements[1].bounds)
    assert second.issues == first.issues
    assert second.ledger == first.ledger


def test_the_cache_can_be_left_out_moved_and_cleared(house: Path, tmp_path: Path):
    read_ifc(house, cache=False)
    assert cache_info().models == 0
    read_ifc(house, cache=tmp_path / "mine")
    assert cache_info(tmp_path / "mine").models == 1
    read_ifc(house)
    assert clear_cache() == 1
    assert clear_cache() == cache_info().models == 0
    assert cache_info(tmp_path / "mine").models == 1


def test_the_content_counts_not_the_name(house: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    read_ifc(house)
    copy = tmp_path / "copy.ifc"
    copy.write_bytes(house.read_bytes())
    house.write_text(model())
    assert len(read_ifc(house).elements) == 1
    no_process(monkeypatch)
    assert read_ifc(copy).sources == (str(copy),)


def test_damage_is_noticed_and_mended_with_one_warning(house: Path, caplog: pytest.LogCaptureFixture):
    expected = [element.name for element in read_ifc(house)]
    [entry] = cache_info().folder.glob("*.bimnav")
    whole = entry.read_bytes()
    for position in random.Random(3).sample(range(len(whole)), 3):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << position % 8
        entry.write_bytes(damaged)
        caplog.clear()
        assert [element.name for element in read_ifc(house, isolate=False)] == expected
        assert [record.levelname for record in caplog.records] == ["WARNING"]
        assert "damaged" in caplog.text
        assert entry.read_bytes() == whole


def test_no_damage_at_all_passes_the_checksum(house: Path):
    whole = watch.read_here(house, lambda *_: None).packed
    for length in range(0, len(whole), 97):
        with pytest.raises(ValueError, match="checksum"):
            unpack(whole[:length])
    rng = random.Random(5)
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        with pytest.raises(ValueError, match="checksum"):
            unpack(bytes(damaged))


def test_arrays_that_do_not_fit_are_no_model(house: Path):
    reading = watch.read_here(house, lambda *_: None)
    for name, array in (
        ("vertices", np.zeros((3, 2))),
        ("faces", np.zeros((1, 3))),
        ("vertex_offsets", np.array([0, 3])),
        ("vertex_offsets", np.array([], dtype=np.int64)),
        ("face_offsets", np.array([0, 99])),
        ("shape_mesh", np.array([7, 7], dtype=np.int32)),
        ("placements", np.zeros((1, 4, 4))),
        ("placements", np.array([object()])),
    ):
        reading.model.arrays, arrays = reading.model.arrays | {name: array}, reading.model.arrays
        try:
            with pytest.raises(ValueError):  # noqa: PT011
                unpack(pack(reading.model))
        finally:
            reading.model.arrays = arrays
    assert unpack(pack(reading.model)).tables == reading.model.tables


def test_a_cache_that_cannot_be_written_costs_time_only(
    house: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "file").write_text("")
    assert len(read_ifc(house, cache=tmp_path / "file", isolate=False).elements) == 2
    assert "not cached" in caplog.text
    caplog.clear()
    monkeypatch.delenv("BIMNAV_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def homeless(*_: object) -> None:
        raise RuntimeError("no home")

    monkeypatch.setattr(Path, "home", homeless)
    with pytest.raises(CacheError, match="BIMNAV_CACHE"):
        cache_folder()
    assert len(read_ifc(house, isolate=False).elements) == 2
    assert "nothing is cached" in caplog.text


def test_the_folder_of_the_cache_follows_the_system(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("BIMNAV_CACHE", "/a")
    assert cache_folder() == Path("/a")
    monkeypatch.delenv("BIMNAV_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/b")
    assert cache_folder() == Path("/b/bimnav")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(Path, "home", lambda: Path("/c"))
    for platform, folder in {
        "linux": "/c/.cache/bimnav",
        "darwin": "/c/Library/Caches/bimnav",
        "win32": "/c/AppData/Local/bimnav/cache",
    }.items():
        monkeypatch.setattr(sys, "platform", platform)
        assert cache_folder() == Path(folder)


def test_settings_and_content_make_the_key():
    assert key_of("a") == key_of("a")
    assert len({key_of("a"), key_of("b"), key_of("a", deflection=1), key_of("a", deflection=2)}) == 4


# real models


@pytest.mark.parametrize("name", REAL_MODELS)
def test_real_models_are_read_and_their_ledgers_close(name: str, full: bool):
    if not full and not any(word in name for word in ("demo2", "errorfile", "Handover", "Library")):
        pytest.skip("part of the whole campaign: --full")
    path = real_model(name)
    if path.name == "errorfile.ifc":
        with pytest.raises(IfcSyntaxError, match=r"errorfile\.ifc"):
            read_ifc(path)
        return
    building = read_ifc(path)
    assert "damaged-text" not in {issue.code for issue in building.issues}
    assert building.ledger.lost == {}
    for element in building:
        assert element.global_id in building


def test_a_second_opening_is_thirty_times_faster():
    path = real_model("houses/SampleHouse4.ifc")

    def seconds() -> float:
        start = time.perf_counter()
        read_ifc(path)
        return time.perf_counter() - start

    first = seconds()
    assert first > 30 * min(seconds() for _ in range(3))
