"""The first look at a model: everything that is refused, everything that must not be, and how fast."""

from __future__ import annotations

import gzip
import os
import random
import re
import time
import zipfile
from pathlib import Path

import pytest

from bimnav.errors import (
    ArchiveError,
    BimnavError,
    FileKindError,
    FileMissingError,
    FileTooLargeError,
    IfcReferenceError,
    IfcSchemaError,
    IfcStructureError,
    IfcSyntaxError,
    IfcTruncatedError,
    IfcUnitsError,
    InputError,
)
from bimnav.ifc import _prescan, _survey, _text
from bimnav.ifc._prescan import Prescan, scan
from bimnav.ifc._text import load
from tests.conftest import REAL_IFC, real_model
from tests.ifc_text import FRAME, box, model, product

REAL_MODELS = sorted(path.relative_to(REAL_IFC).as_posix() for path in REAL_IFC.glob("*/*.ifc*"))


def scanned(text: str) -> Prescan:
    return scan(text.encode(), "model.ifc")


def prescan(path: Path) -> Prescan:
    return scan(load(path), path.name)


def refusal(kind: type[BimnavError], text: str | bytes, *words: str) -> BimnavError:
    """Check that a text is refused by one kind of error, whose message has the file, the words and a next step."""
    with pytest.raises(InputError) as caught:
        scan(text if isinstance(text, bytes) else text.encode(), "model.ifc")
    assert type(caught.value) is kind, caught.value
    assert_tells(caught.value, "model.ifc", *words)
    return caught.value


def assert_tells(error: BimnavError, *words: str) -> None:
    for word in words:
        assert word in str(error)
    assert len(error.hint) > 8
    assert len(str(error)) < 500


def with_units(*units: str) -> str:
    """A model whose units are given: the assignment #2 lists #3, and #3 on are free."""
    return model(frame=[*(line for line in FRAME if not line.startswith(("#2=", "#3="))), *units])


# what kind of file it is


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "empty"),
        (b"\0" * 100, "empty"),
        (b" \r\n ", "empty"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n", "git lfs pull"),
        (b'<?xml version="1.0"?><ifcXML/>', "XML"),
        (b"<!DOCTYPE html><html></html>", "web page"),
        (b"<html><body>404</body></html>", "web page"),
        (b"%PDF-1.7 ...", "PDF"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (gzip.compress(b"ISO-10303-21;", mtime=0), "gzip"),
        (model().encode("utf-16"), "UTF-16"),
        (b'{"type": "ifcJSON"}', "JSON"),
        (b"SQLite format 3\0", "SQLite"),
        (b"x,y\n1,2\n", "ISO-10303-21"),
    ],
)
def test_a_file_of_another_kind_is_called_by_its_name(tmp_path: Path, content: bytes, word: str):
    path = tmp_path / "model.ifc"
    path.write_bytes(content)
    with pytest.raises(FileKindError) as caught:
        prescan(path)
    assert_tells(caught.value, "model.ifc", word)


def test_a_missing_file_is_named_with_the_nearest_one(tmp_path: Path):
    (tmp_path / "model.ifc").write_text(model())
    with pytest.raises(FileNotFoundError) as caught:
        prescan(tmp_path / "modle.ifc")
    assert type(caught.value) is FileMissingError
    assert_tells(caught.value, "modle.ifc", "Did you mean 'model.ifc'?")
    with pytest.raises(FileMissingError):
        prescan(tmp_path / "no folder" / "model.ifc")


def test_folders_pipes_and_devices_are_refused_without_waiting(tmp_path: Path):
    places = {tmp_path: "folder"}
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.ifc")
        places |= {tmp_path / "pipe.ifc": "pipe", Path(os.devnull): "device"}
    for path, word in places.items():
        with pytest.raises(FileKindError, match=word):
            prescan(path)


def test_paths_that_cannot_be_opened_are_typed_errors(tmp_path: Path):
    (tmp_path / "loop.ifc").symlink_to(tmp_path / "loop.ifc")
    for path in (tmp_path / "loop.ifc", Path("a\0b.ifc"), tmp_path / ("x" * 300)):
        with pytest.raises(FileKindError) as caught:
            prescan(path)
        assert_tells(caught.value, "cannot be opened")


def test_a_file_above_the_limit_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_text, "FILE_LIMIT", 100)
    path = tmp_path / "model.ifc"
    path.write_text(model())
    with pytest.raises(FileTooLargeError) as caught:
        prescan(path)
    assert_tells(caught.value, "model.ifc", "100")


# archives


def archive(path: Path, **members: str | bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("_ifc", ".ifc"), content)
    return path


@pytest.mark.parametrize("name", ["model.ifczip", "MODEL.IFCZIP", "model.ifcZip", "model.ifc", "model.zip"])
def test_an_archive_of_one_model_is_read_whatever_its_name(tmp_path: Path, name: str):
    assert prescan(archive(tmp_path / name, model_ifc=model())).products == {"IFCBUILDINGELEMENTPROXY": 1}


def test_an_archive_must_hold_exactly_one_model(tmp_path: Path):
    for members, found in (({"a_ifc": "", "b_ifc": ""}, "'a.ifc', 'b.ifc'"), ({"readme": ""}, "none")):
        with pytest.raises(ArchiveError) as caught:
            prescan(archive(tmp_path / "model.ifczip", **members))
        assert_tells(caught.value, "model.ifczip", found)


def test_an_archive_with_thousands_of_files_is_refused(tmp_path: Path):
    with pytest.raises(ArchiveError, match="1001 files"):
        prescan(archive(tmp_path / "model.ifczip", **{f"f{k}": "" for k in range(1001)}))


def test_damaged_encrypted_and_false_archives_are_refused(tmp_path: Path):
    path = tmp_path / "model.ifczip"
    whole = archive(path, model_ifc=model()).read_bytes()
    encrypted = bytearray(whole)
    for mark, offset in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        encrypted[whole.index(mark) + offset] |= 1
    flipped = bytearray(whole)
    flipped[60] ^= 0xFF
    for content, word in ((whole[:200], "sound"), (b"no zip", "sound"), (encrypted, "encrypted"), (flipped, "sound")):
        path.write_bytes(content)
        with pytest.raises(ArchiveError) as caught:
            prescan(path)
        assert_tells(caught.value, "model.ifczip", word)


def test_a_bomb_is_refused_by_its_header_and_when_the_header_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_text, "_RATIO_FROM", 1000)
    path = archive(tmp_path / "model.ifczip", model_ifc=b"0" * 10**6)
    with pytest.raises(ArchiveError, match="would unpack to more than"):
        prescan(path)
    whole = path.read_bytes()
    directory = whole.index(b"PK\x01\x02")
    path.write_bytes(whole[: directory + 24] + (900).to_bytes(4, "little") + whole[directory + 28 :])
    with pytest.raises(ArchiveError):
        prescan(path)


def test_names_in_an_archive_lead_nowhere(tmp_path: Path):
    path = tmp_path / "in" / "model.ifczip"
    path.parent.mkdir()
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("../../escaped.ifc", model())
    assert prescan(path).instances == 16
    assert [entry.name for entry in tmp_path.rglob("*.ifc*")] == ["model.ifczip"]


# header and end


@pytest.mark.parametrize(
    "schema", ["IFC2X_FINAL", "IFC2X2_FINAL", "IFC4X1", "IFC4X3_RC4", "IFC4','IFC2X3", "IFC" + "X" * 600]
)
def test_a_schema_that_cannot_be_read_is_named(schema: str):
    error = refusal(IfcSchemaError, model(schema=schema), "IFC2X3, IFC4")
    if "'" not in schema:
        assert schema[:40] in str(error)


def test_a_file_without_schema_is_refused():
    refusal(IfcSchemaError, model().replace("FILE_SCHEMA(('IFC4'));\n", ""), "no schema")


def test_the_name_ifc4x3_is_read_as_its_addendum(tmp_path: Path):
    path = tmp_path / "model.ifc"
    path.write_text(model(schema="IFC4X3"))
    assert prescan(path).schema == "IFC4X3_ADD2"


def test_a_file_cut_off_is_refused_and_the_last_entity_named():
    error = refusal(IfcTruncatedError, model(end=False), "#104", "cut off")
    assert isinstance(error, ValueError)


def test_a_file_cut_anywhere_before_its_end_mark_is_refused():
    text = model(box(200, name="it''s; #5=")).encode()
    for length in range(20, text.rindex(b"END-ISO")):
        with pytest.raises((IfcTruncatedError, IfcSyntaxError)):
            scan(text[:length], "model.ifc")


# syntax


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("#6=IFC", "\t*//* #6=IFC", "#5"),
        ("#6=IFC", "stray #6=IFC", "stray"),
        ("#6=IFC", "/* open #6=IFC", "#5"),
        ("'house'", "'house", "#"),
        ("#5=IFCAXIS2PLACEMENT3D(#6,$,$);", "#5=IFCAXIS2PLACEMENT3D(#6,$,$)", "#4"),
        ("#6=IFCCARTESIANPOINT((0.,0.,0.));", "#6=(IFCPOINT()IFCCARTESIANPOINT((0.,0.,0.)));", "#5"),
        ("#10=", "ENDSEC;\nDATA;\n#10=", "#9"),
        ("#10=", "#=", "#9"),
    ],
)
def test_text_that_would_end_the_model_early_is_refused(old: str, new: str, word: str):
    refusal(IfcSyntaxError, model().replace(old, new), word, "line")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("'house'", "'it''s; a #5=IFCX(); /* house */'"),
        ("#6=IFC", "/* a comment; 'with' #1=IFCX(); */ #6 = IFC"),
        ("#6,$,$", "#6,/* none; */$,$"),
        ("\n", "\r\n"),
        ("\n", "\r"),
        ("\n", ""),
        ("IFCCARTESIANPOINT", "IfcCartesianPoint"),
        ("'house'", "'two\nlines'"),
        ("END-ISO-10303-21;\n", "END-ISO-10303-21;\n\0\0\0"),
        ("END-ISO-10303-21;\n", "END-ISO-10303-21"),
        ("ISO-10303-21;\nHEADER", "\n /* first */ ISO-10303-21;\nHEADER"),
    ],
)
def test_unusual_but_legal_text_is_accepted(old: str, new: str):
    assert scanned(model().replace(old, new)).instances == 16


def test_a_byte_order_mark_is_no_obstacle(tmp_path: Path):
    path = tmp_path / "model.ifc"
    path.write_bytes(b"\xef\xbb\xbf" + model().encode())
    assert prescan(path).instances == 16


# references


def test_two_entities_with_one_number_are_refused():
    refusal(IfcReferenceError, model("#6=IFCCARTESIANPOINT((1.,1.,1.));"), "#6", "line 24")


@pytest.mark.parametrize(
    "lines",
    [
        ["#20=IFCLOCALPLACEMENT(#20,#5);"],
        ["#20=IFCLOCALPLACEMENT(#21,#5);", "#21=IFCLOCALPLACEMENT(#20,#5);"],
        ["#20=IFCMAPPEDITEM(#21,$);", "#21=IFCREPRESENTATIONMAP(#5,#22);", "#22=IFCSHAPEREPRESENTATION(#4,$,$,(#20));"],
        ["#20=IFCBOOLEANRESULT(.DIFFERENCE.,#104,#20);"],
        ["#20=IFCCOMPOSITECURVE((#21),.F.);", "#21=IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,#20);"],
        ["#20=IFCCONVERSIONBASEDUNIT($,.PLANEANGLEUNIT.,'x',#21);", "#21=IFCMEASUREWITHUNIT(IFCREAL(1.),#20);"],
        ["#20=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('a','b',*,*,*,*,#20,$,.MODEL_VIEW.,$);"],
        ["#20=IFCRELAGGREGATES('0000000000000000000020',$,$,$,#7,(#1));"],
        ["#20=IFCRELNESTS('0000000000000000000020',$,'a (b',$,#100,(#7,#100));"],
        ["#20=IFCRELVOIDSELEMENT('0000000000000000000020',$,$,$,#100,#100);"],
        [
            "#20=IFCRELVOIDSELEMENT('0000000000000000000020',#1,$,$,#100,#7);",
            "#21=IFCRELFILLSELEMENT('0000000000000000000021',#1,$,$,#7,#100);",
        ],
        ["#20=IFCRELCONTAINEDINSPATIALSTRUCTURE('0000000000000000000020',$,$,$,(#100,#7),#7);"],
    ],
)
def test_a_circle_of_references_is_refused_and_shown(lines: list[str]):
    error = refusal(IfcReferenceError, model(lines), "circular", "->")
    assert re.search(r"#\d+ -> .*#\d+", str(error))


def test_space_boundaries_may_refer_to_each_other():
    tail = "$,$,#7,#100,$,.PHYSICAL.,.INTERNAL.,$,{});"
    pair = [
        "#20=IFCRELSPACEBOUNDARY2NDLEVEL('0000000000000000000020',$," + tail.format("#21"),
        "#21=IFCRELSPACEBOUNDARY2NDLEVEL('0000000000000000000021',$," + tail.format("#20"),
    ]
    assert scanned(model(pair)).instances == 18


@pytest.mark.parametrize("forward", [False, True])
@pytest.mark.parametrize(("length", "legal"), [(400, True), (600, False), (100_000, False)])
def test_chains_may_be_long_but_not_endless(length: int, legal: bool, forward: bool):
    numbers = range(1000, 1000 + length)
    chain = [f"#{n}=IFCLOCALPLACEMENT(#{n + 1 if forward else n - 1},#5);" for n in numbers]
    text = model(f"#{1000 + length if forward else 999}=IFCLOCALPLACEMENT($,#5);", chain)
    if legal:
        assert scanned(text).instances == 17 + length
    else:
        refusal(IfcReferenceError, text, "500", "IFCLOCALPLACEMENT")


def test_a_placement_relative_to_nothing_is_refused():
    refusal(IfcReferenceError, model("#20=IFCLOCALPLACEMENT(#999,#5);"), "#20", "#999")


def test_above_a_size_references_are_not_followed_but_the_end_mark_is_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_prescan, "REFERENCES_UP_TO", 100)
    loop = "#20=IFCLOCALPLACEMENT(#20,#5);"
    assert scanned(model(loop)).products == {"IFCBUILDINGELEMENTPROXY": 1}
    refusal(IfcTruncatedError, model(loop, end=False), "#20")


# project and units


def test_a_model_without_project_is_refused():
    refusal(IfcStructureError, model(frame=[line for line in FRAME if "IFCPROJECT" not in line]), "IfcProject")


LISTED = "#2=IFCUNITASSIGNMENT((#3));"
FOOT = (
    LISTED,
    "#3=IFCCONVERSIONBASEDUNIT(#20,.LENGTHUNIT.,'FOOT',#21);",
    "#20=IFCDIMENSIONALEXPONENTS(1,0,0,0,0,0,0);",
    "#21=IFCMEASUREWITHUNIT(IFCLENGTHMEASURE(0.3048),#22);",
    "#22=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);",
)
METRE = "#3=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);"


@pytest.mark.parametrize(
    ("units", "scale"),
    [
        ((LISTED, METRE), 1.0),
        ((LISTED, METRE.replace("$", ".MILLI.")), 0.001),
        ((LISTED, METRE.replace("$", ".CENTI.")), 0.01),
        ((LISTED, METRE.replace("$", ".KILO.")), 1000.0),
        (("#2=IFCUNITASSIGNMENT((#9,#3));", METRE), 1.0),
        (FOOT, 0.3048),
        (tuple(line.replace("0.3048", "3.048E-1") for line in FOOT), 0.3048),
        (tuple(line.replace("IFCLENGTHMEASURE(0.3048)", "0.3048") for line in FOOT), 0.3048),
        ((LISTED, FOOT[1].replace("UNIT(", "UNITWITHOFFSET(").replace("#21", "#21,0."), *FOOT[2:]), 0.3048),
        ((*FOOT[:4], "#22=IFCSIUNIT(*,.LENGTHUNIT.,.CENTI.,.METRE.);"), 0.003048),
    ],
)
def test_a_length_unit_is_told_in_metres(units: tuple[str, ...], scale: float):
    assert scanned(with_units(*units)).unit_scale == pytest.approx(scale, rel=1e-12)


@pytest.mark.parametrize(
    ("units", "word"),
    [
        ((), "no length unit"),
        (("#2=IFCUNITASSIGNMENT(());",), "no length unit"),
        ((LISTED, "#3=IFCSIUNIT(*,.AREAUNIT.,$,.SQUARE_METRE.);"), "no length unit"),
        (("#2=IFCUNITASSIGNMENT((#3,#20));", METRE, METRE.replace("#3", "#20").replace("$", ".MILLI.")), "#3 and #20"),
        (("#2=IFCUNITASSIGNMENT((#3,#3));", METRE.replace("$", ".MILLI.")), "2 length units"),
        ((LISTED, METRE.replace("$", ".EXA.")), "1e+18"),
        ((LISTED, METRE.replace("$", ".NANO.")), "1e-09"),
        ((LISTED, METRE.replace("$", ".FEET.")), "#3"),
        ((LISTED, METRE.replace("METRE", "GRAM")), "#3"),
        ((LISTED, "#3=IFCCONTEXTDEPENDENTUNIT(#4,.LENGTHUNIT.,'cubit');"), "#3"),
        *(
            (tuple(line.replace("0.3048", bad) for line in FOOT), "#")
            for bad in ("0.", "-1.", "NAN", "1E400", "abc", "")
        ),
        (FOOT[:3], "#21"),
        (FOOT[:4], "#22"),
    ],
)
def test_a_length_unit_that_is_none_or_two_or_nonsense_is_refused(units: tuple[str, ...], word: str):
    refusal(IfcUnitsError, with_units(*units), word)


def test_projects_in_different_units_are_refused():
    second = "#30=IFCPROJECT('0000000000000000000030',$,'annex',$,$,$,$,(#4),#31);"
    units = ("#31=IFCUNITASSIGNMENT((#32));", METRE.replace("#3=", "#32="))
    assert scanned(model(second, units)).unit_scale == 1.0
    refusal(IfcUnitsError, model(second, units[0], units[1].replace("$", ".MILLI.")), "different")


# products


def test_products_are_counted_by_class_if_they_have_a_representation():
    lines = [
        *box(200, ifc_class="IFCWALL"),
        *box(300, name="it''s (1, 2), #5", ifc_class="IFCWALL"),
        *product(400, "#404=IFCEXTRUDEDAREASOLID(#11,$,#10,1.);", name="*", ifc_class="IfcFurniture"),
        "#500=IFCWALL('0000000000000000000500',$,$,$,$,#8,$,$,$);",
        "#600=IFCFURNITURETYPE('0000000000000000000600',$,$,$,$,$,(#601),$,$,.CHAIR.,$);",
        "#601=IFCREPRESENTATIONMAP(#5,#103);",
        "#700=IFCTASK('0000000000000000000700',$,$,$,$,$,$,$,$,.F.,$,$,$);",
    ]
    assert scanned(model(lines)).products == {"IFCBUILDINGELEMENTPROXY": 1, "IFCFURNITURE": 1, "IFCWALL": 2}


def test_a_product_whose_representation_is_missing_counts_too():
    assert scanned(model("#500=IFCWALL('0000000000000000000500',$,$,$,$,#8,#999,$,$);")).products["IFCWALL"] == 1


# laws


def test_whatever_the_damage_the_answer_is_a_typed_error_or_none():
    rng = random.Random(7)
    whole = model(box(200), FRAME[0].replace("#1=", "#30=")).encode()
    tokens = b"$ * #1 ' /* */ ; ( ) = \0 \xff ENDSEC; DATA; #99999999999999999999".split()
    for _ in range(2000):
        text = bytearray(whole)
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(text))
            copied = text[(other := rng.randrange(len(text))) : other + 50]
            text[at : at + rng.randrange(6)] = rng.choice([*tokens, bytes([rng.randrange(256)]), copied])
        try:
            scan(bytes(text), "model.ifc")
        except InputError as error:
            assert_tells(error, "model.ifc")


def test_hostile_repetition_takes_no_time():
    start = time.process_time()
    for text in ("#1=(/*" * 200_000, "/*" * 500_000, "'" * 999_999, "#" * 10**6, "\n" * 10**6 + "x"):
        with pytest.raises(InputError):
            scanned(model().replace("#10=", text))
    assert time.process_time() - start < 5.0


@pytest.mark.parametrize("name", REAL_MODELS)
def test_real_models_are_accepted_and_counted_as_the_kernel_counts(name: str):
    import ifcopenshell

    path = real_model(name)
    if path.name == "errorfile.ifc":
        with pytest.raises(IfcSyntaxError, match=r"errorfile\.ifc .*#14.*line 15"):
            prescan(path)
        return
    said = prescan(path)
    file = ifcopenshell.open(path)
    shaped = [product for product in file.by_type("IfcProduct") if product.Representation]
    assert said.schema == file.schema_identifier
    assert said.instances == len(file.entity_names())
    assert sum(said.products.values()) == len(shaped)
    assert set(said.products) == {product.is_a().upper() for product in shaped}


def test_ten_megabytes_take_less_than_a_second():
    text = _text.load(real_model("houses/231110AC11-FZK-Haus-IFC.ifc"))
    start = time.process_time()
    scan(text, "house.ifc")
    assert len(text) / (time.process_time() - start) > 10e6


# The compiled look must say what the plain one says; it may only leave things to it.


def _outcome(text: bytes) -> object:
    try:
        found = scan(text, "m.ifc")
    except BimnavError as error:
        return type(error), str(error), error.context
    return found, list(found.shaped.items())


def _damaged(text: bytes, rng: random.Random) -> bytes:
    for _ in range(rng.choice((1, 1, 2, 5))):
        numbers = list(re.finditer(rb"#\d+", text))
        at = rng.randrange(max(text.find(b"DATA;"), 0), len(text))
        number, other = rng.choice(numbers), rng.choice(numbers)[0]
        lines = text.splitlines(keepends=True)
        line, place = rng.randrange(len(lines)), rng.randrange(len(lines))
        kind = rng.randrange(7)
        if kind == 0:
            text = text[:at] + text[at + 1 :]
        elif kind == 1:
            text = text[:at] + bytes([rng.choice(b"'#();=/*,!$ \n\t\0\x85aB07")]) + text[at:]
        elif kind == 2:
            text = text[: number.start()] + other + text[number.end() :]
        elif kind == 3:
            text = (
                text[: number.start()]
                + b"#%d" % rng.choice((0, 7, 10**6, 10**17, 10**18, 10**19, 2**64))
                + text[number.end() :]
            )
        elif kind == 4:
            text = b"".join(lines[:line] + lines[line + 1 :])
        elif kind == 5:
            text = b"".join([*lines[:place], lines[line], *lines[place:]])
        else:
            piece = rng.choice((b"''", b"'a;'", b"/* #1 */", b" ( ", b"''''", b"#1", b"ENDSEC;", b"IFCWALL(", b"'#1'"))
            text = text[:at] + piece + text[at:]
    return text


def _in_both_ways(text: bytes, monkeypatch: pytest.MonkeyPatch) -> tuple[object, object]:
    swift = _outcome(text)
    with monkeypatch.context() as patch:
        patch.setattr(_prescan, "_compiled", lambda: None)
        return swift, _outcome(text)


def test_the_compiled_look_and_the_plain_one_agree_on_damaged_models(monkeypatch):
    parts = (
        box(200, "it''s, #12; (a) chair", "IFCFURNITURE"),
        "#300=IFCRELAGGREGATES('0000000000000000000300',$,$,$,#100,(#200));",
        "#301=IFCLOCALPLACEMENT(#101,#5);",
        "#302=IFCRELCONTAINEDINSPATIALSTRUCTURE('0000000000000000000302',$,$,$,(#100,#200),#7);",
    )
    sound = model(*parts).encode()
    assert _survey.survey(sound, sound.index(b"DATA;") + 5) is not None
    rng = random.Random(7)
    for _ in range(600):
        text = _damaged(sound, rng)
        swift, plain = _in_both_ways(text, monkeypatch)
        assert swift == plain, text


@pytest.mark.parametrize("name", ["duplex/Duplex_A_20110907.ifc", "nasty/House.ifc", "houses/SampleHouse4.ifc"])
def test_the_compiled_look_and_the_plain_one_agree_on_real_models(name, monkeypatch):
    text = _text.load(real_model(name))
    assert _survey.survey(text, text.index(b"DATA;") + 5) is not None
    swift, plain = _in_both_ways(text, monkeypatch)
    assert swift == plain


@pytest.mark.parametrize("length", [499, 500, 501, 502])
@pytest.mark.parametrize("is_backward", [True, False])
def test_the_compiled_look_and_the_plain_one_agree_on_how_deep_is_too_deep(length, is_backward, monkeypatch):
    numbers = range(1000, 1000 + length)
    chain = [f"#{n}=IFCLOCALPLACEMENT(#{n + 1},$);" for n in numbers] + [f"#{1000 + length}=IFCLOCALPLACEMENT($,$);"]
    text = model(*(reversed(chain) if is_backward else chain)).encode()
    swift, plain = _in_both_ways(text, monkeypatch)
    assert swift == plain
    assert isinstance(plain[0], type) is (length > 500)
