"""Two thousand damaged files: whatever is in them, the answer is a whole building or an error that tells."""

from __future__ import annotations

import re
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

import bimnav.errors
from bimnav.building import Building
from bimnav.errors import BimnavError, InputError
from bimnav.ifc import read_ifc
from tests.drafts import arguments, base_text
from tests.mutations import SHARES, Case, cases

TIMEOUT = 20.0  # seconds for a file
GRACE = 2.0
MEMORY = 3 * 1024**3
SAMPLE = dict.fromkeys(SHARES, 7) | {"tree": 2, "chain": 6, "bulk": 5}  # in every run; `--full` takes all

BY_CLASS = re.compile(
    r"IFC(ANNOTATION|GRID|(DISTRIBUTION)?PORT|SITE|BUILDING|BUILDINGSTOREY|FACILITY\w*|BRIDGE\w*|ROAD\w*|RAILWAY\w*|MARINE\w*"
    r"|EXTERNALSPATIAL\w*|SPATIALZONE|VIRTUALELEMENT|STRUCTURAL\w*|ALIGNMENT\w*|LINEARPOSITIONING\w*|LINEAR\w*|REFERENT"
    r"|POSITIONING\w*|SURFACEFEATURE|GEOGRAPHICELEMENT)"
)
SOLID = re.compile(
    r"IFC(EXTRUDED|REVOLVED|FACETED|BOOLEAN|TRIANGULATED|POLYGONALFACESET|BLOCK|SPHERE|RIGHTCIRC|RECTANGULARPYRAMID|SWEPTDISK"
    r"|FACEBASED|SHELLBASED|PLANE|ADVANCEDBREP)"
)
NO_BODY = {"annotation", "axis", "boundary", "box", "clearance", "cog", "footprint", "plan", "profile", "reference"}


# what a text says, read by other means than ours


class Said:
    """The entities of a text, by simple means: step id to class and arguments."""

    def __init__(self, text: str) -> None:
        self.strings: list[str] = []
        plain = re.sub(r"'[^']*'|/\*.*?\*/", self._keep, text, flags=re.DOTALL)
        found = re.finditer(r"#\s*(\d+)\s*=\s*(\w+)\s*\(([^;]*)\)\s*;", plain)
        self.entities = {int(match[1]): (match[2].upper(), match[3]) for match in found}

    def _keep(self, match: re.Match[str]) -> str:
        if match[0].startswith("/"):
            return " "
        self.strings.append(match[0])
        return f"'{len(self.strings) - 1}'"

    def text(self, argument: str) -> str:
        """The text that an argument is; empty if it is something else."""
        kept = re.fullmatch(r"\s*'(\d+)'\s*", argument)
        return self.strings[int(kept[1])][1:-1] if kept else ""

    @property
    def products(self) -> dict[int, int]:
        """Step id of a product to that of its representation."""
        found = {}
        for number, (kind, inner) in self.entities.items():
            values = arguments(inner) if kind in product_classes() else []
            if len(values) > 6 and (shape := re.fullmatch(r"\s*#\s*(\d+)\s*", values[6])):
                found[number] = int(shape[1])
        return found

    def has_body(self, shape: int) -> bool:
        """Tell whether a representation holds, or should hold, a solid that is more than an axis or a box."""
        seen, waiting = set(), [shape]
        while waiting:
            number = waiting.pop()
            if number in seen:
                continue
            seen.add(number)
            if number not in self.entities:
                return True
            kind, inner = self.entities[number]
            values = arguments(inner)
            if kind not in known_classes() or SOLID.match(kind):
                return True
            if kind == "IFCSHAPEREPRESENTATION":
                if self.text(values[1]).lower() in NO_BODY:
                    continue
                values = values[3:]
            if kind != "IFCGEOMETRICSET":
                waiting += map(int, re.findall(r"#\s*(\d+)", ",".join(values)))
        return False


@cache
def known_classes() -> frozenset[str]:
    import ifcopenshell

    schemas = (ifcopenshell.schema_by_name(name) for name in ("IFC2X3", "IFC4", "IFC4X3_ADD2"))
    return frozenset(entity.name().upper() for schema in schemas for entity in schema.entities())


@cache
def product_classes() -> frozenset[str]:
    import ifcopenshell

    found = set()
    for name in ("IFC2X3", "IFC4", "IFC4X3_ADD2"):
        waiting = [ifcopenshell.schema_by_name(name).declaration_by_name("IfcProduct")]
        while waiting:
            found.add(waiting[-1].name().upper())
            waiting += waiting.pop().subtypes()
    return frozenset(found)


# the judge


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a file, and what is wrong with that; empty if nothing."""

    case: Case
    outcome: str
    wrong: str = ""
    seconds: float = 0.0


def judge(case: Case, folder: Path) -> Verdict:
    """Read a file and look at the answer."""
    path = folder / f"{case.family}-{case.name.replace(' ', '-')}{case.suffix}"
    path.write_bytes(case.content)
    start = time.monotonic()
    try:
        answer: Building | BaseException = read_ifc(path, cache=False, timeout=TIMEOUT, memory=MEMORY)
    except Exception as error:  # whatever it is, it is looked at
        answer = error
    seconds = time.monotonic() - start
    path.unlink()
    if isinstance(answer, Building):
        outcome = "lost, named" if answer.ledger.lost else "read"
        wrong = "; ".join(faults_of(answer, case))
    else:
        outcome = type(answer).__name__
        wrong = "; ".join(faults_of_error(answer, case, path))
    if seconds > TIMEOUT + GRACE:
        wrong += f"; it took {seconds:.0f} s"
    return Verdict(case, outcome, wrong, seconds)


def faults_of_error(error: BaseException, case: Case, path: Path) -> Iterator[str]:
    if not isinstance(error, BimnavError) or type(error).__subclasses__() or type(error) is BimnavError:
        yield f"untyped: {error!r:.300}"
        return
    if path.name not in str(error):
        yield f"the file is not named: {error!s:.300}"
    if not error.hint or len(str(error)) > 1500:
        yield f"no hint, or too long: {error!s:.300}"
    if type(error).__name__ not in bimnav.errors.__all__:
        yield f"not public: {error!r:.300}"
    if case.promise in ("read", "same") or (case.promise == "refused" and not isinstance(error, InputError)):
        yield f"promised {case.promise}: {error!s:.300}"


def faults_of(building: Building, case: Case) -> Iterator[str]:
    if case.promise == "refused":
        yield f"promised refused: {building!r}, lost {len(building.ledger.lost)}"
    if case.promise == "same" and (wrong := differences(building, base_building(case.base))):
        yield f"not the same: {wrong}"
    yield from silent_losses(building, text_of(case))


def silent_losses(building: Building, text: str) -> Iterator[str]:
    """Every product of the text must be read, left out by a rule that fits, or lost with a reason."""
    ledger, said = building.ledger, Said(text)
    shapes = said.products
    asked = set(ledger.asked)
    if len(asked) < len(ledger.asked) or not asked >= {*ledger.left_out, *ledger.lost}:
        yield "the ledger does not add up"
    if not 0 <= len(asked) - len(shapes) <= len(ledger.lost) + len(ledger.left_out):
        yield f"silent: {len(shapes)} products in the text, {len(asked)} asked"
    ids = {}
    for number in shapes:
        ids.setdefault(said.text(said.entities[number][1].split(",")[0]), []).append(number)
    for global_id, numbers in ids.items():
        if re.fullmatch(r"[\w$]{22}", global_id, re.ASCII) and global_id not in asked:
            yield f"silent: {global_id} was not asked"
        rule = ledger.left_out.get(global_id)
        if rule == "no-body" and len(numbers) == 1 and said.has_body(shapes[numbers[0]]):
            yield f"silent: #{numbers[0]} left out as {rule}"
        if rule and rule != "no-body" and not any(BY_CLASS.match(said.entities[n][0]) for n in numbers):
            yield f"silent: #{numbers[0]} {said.entities[numbers[0]][0]} left out as {rule}"
    if not all(reason for reason in (*ledger.left_out.values(), *ledger.lost.values())):
        yield "lost without a reason"
    eaten = {g for issue in building.issues if issue.code == "eaten-by-openings" for g in issue.global_ids}
    shaped = {each.global_id for each in (*building.elements, *building.spaces, *building.openings) if each.shapes}
    if gone := set(ledger.read) - shaped - eaten:
        yield f"silent: {sorted(gone)[:3]} count as read and have no shape"


def text_of(case: Case) -> str:
    content = case.content
    if content[:2] == b"PK":
        import io
        import zipfile

        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            [name] = (n for n in archive.namelist() if n.lower().endswith(".ifc") and "__MACOSX" not in n)
            content = archive.read(name)
    return content.decode("latin-1")


def differences(one: Building, other: Building) -> str:
    """Where two buildings differ as to what stands where."""
    found = Counter(_things(one))
    found.subtract(Counter(_things(other)))
    return ", ".join(f"{thing} {number:+}" for thing, number in found.items() if number)[:300]


def _things(building: Building) -> Iterable[str]:
    for each in (*building.elements, *building.spaces):
        bounds = each.bounds.round(6).tolist() if each.shapes else None
        yield f"{type(each).__name__} {each.global_id} {each.name} {each.storey} {bounds}"


_lock = threading.Lock()


def base_building(base: str) -> Building:
    with _lock:
        return _base_building(base)


@cache
def _base_building(base: str) -> Building:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "base.ifc"
        path.write_text(base_text(base))
        return read_ifc(path, cache=False)


def campaign(chosen: Iterable[Case], folder: Path, jobs: int = 2) -> Iterator[Verdict]:
    """Judge files, some at a time; good and bad ones share the process that asks."""
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(lambda case: judge(case, folder), chosen)


# tests


def test_there_are_two_thousand_files_with_names_of_their_own_and_equal_in_every_run():
    assert sum(SHARES.values()) == 2000
    for family in SHARES:
        made = list(cases(family, SAMPLE[family]))
        assert made == list(cases(family, SAMPLE[family]))
        assert len({case.name for case in made}) == len(made)


@pytest.mark.parametrize("family", SHARES)
def test_no_damaged_file_harms_the_host_or_loses_a_product_in_silence(
    family: str, full: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    verdicts = list(campaign(cases(family, None if full else SAMPLE[family]), tmp_path))
    assert [f"{v.case.name}: {v.outcome}: {v.wrong}" for v in verdicts if v.wrong] == []
    assert list(temporary.iterdir()) == []
    assert running_in(temporary) == []


def running_in(folder: Path) -> list[str]:
    """Command lines of processes that have to do with a folder; needs /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = path.read_bytes()
        except OSError:
            continue
        if str(folder).encode() in line:
            found.append(line.decode("utf-8", "replace"))
    return found
