"""A first look at a model before the kernel's: refuses what would crash, hang or mislead the kernel.

The kernel opens damaged files without a word and dies on circular ones. One pass over the text finds
both, names the place, and counts the products independently of the kernel.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from bimnav.errors import (
    BimnavError,
    IfcReferenceError,
    IfcSchemaError,
    IfcStructureError,
    IfcSyntaxError,
    IfcTruncatedError,
    IfcUnitsError,
)

__all__ = ["DEPTH_LIMIT", "REFERENCES_UP_TO", "SCHEMAS", "Prescan", "scan"]

SCHEMAS = ("IFC2X3", "IFC4", "IFC4X3_ADD2")
"""Schemas that are read, as the kernel names them."""

DEPTH_LIMIT = 500
"""The longest chain of references; real models reach 60, the kernel's stack ends at some 20,000."""

REFERENCES_UP_TO = 200 * 1024**2
"""Bytes of text above which numbers and references are not compared; that takes as much memory again."""

_BEAT_EVERY = 1 << 15  # statements
_METRES = (1e-7, 1e5)  # plausible metres per unit: a micrometre to more than a mile

_GAP = rb"\s*+(?:/\*.*?\*/\s*+)*+"
_STATEMENT = re.compile(
    # spaces and comments, then `#12=IFCWALL(...);` or, if it is anything else, the one byte where it fails
    _GAP + rb"(?:\#\s*+(\d++)\s*+=\s*+(!?\w++)\s*+(\((?:[^';/=]++|'[^']*+'|/\*.*?\*/)*+)(?<=[)\s]);|(?s:.|\Z))",
    re.DOTALL,
)
_HEADER = re.compile(_GAP + rb"(\w[\w-]*+)\s*+((?:[^';/]++|'[^']*+'|/\*.*?\*/)*+);", re.DOTALL)
_SCHEMA = re.compile(rb"\(\s*\(\s*'([^']*)'\s*\)\s*\)\s*")
_END = re.compile(_GAP + rb"ENDSEC\s*+;" + _GAP + rb"END-ISO-10303-21\b", re.DOTALL)
_COMMENT = re.compile(rb"/\*.*?\*/", re.DOTALL)
_NAMES_AND_COMMENTS = re.compile(rb"'[^']*'|/\*.*?\*/", re.DOTALL)
_REFERENCE = re.compile(rb"#\s*(\d+)")
_SEVENTH = re.compile(rb"\(\s*'([^']*)'\s*,(?:\s*(?:'(?:[^']|'')*'|[^,'()]*)\s*,){5}\s*#(\d+)")
_WHOLE_AND_PARTS = re.compile(rb"#(\d+)\s*,\s*\(?([#\d\s,]*)\)?\s*\)\s*$")
_PARTS_AND_WHOLE = re.compile(rb"\(([#\d\s,]*)\)\s*,\s*#(\d+)\s*\)\s*$")
_LAST = re.compile(rb"#(\d+)\s*\)\s*$")
_SI_METRE = re.compile(rb"\(\s*[*$]?\s*,\s*\.LENGTHUNIT\.\s*,\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)\s*$")
_MEASURE = re.compile(rb"\(\s*(?:\w+\s*\(\s*)?([^(),]*?)\s*\)?\s*,\s*#(\d+)\s*\)\s*$")

# Entities that hold plain values or end in them; half of a model, and nothing can come back to them.
_FLAT = frozenset(
    b"IFCCARTESIANPOINT IFCDIRECTION IFCPOLYLOOP IFCFACE IFCFACEBOUND IFCFACEOUTERBOUND IFCPROPERTYSINGLEVALUE "
    b"IFCPROPERTYSET IFCINDEXEDPOLYGONALFACE".split()
)
_PART_OF = {
    b"IFCRELAGGREGATES": _WHOLE_AND_PARTS,
    b"IFCRELNESTS": _WHOLE_AND_PARTS,
    b"IFCRELVOIDSELEMENT": _WHOLE_AND_PARTS,
    b"IFCRELFILLSELEMENT": _WHOLE_AND_PARTS,
    b"IFCRELCONTAINEDINSPATIALSTRUCTURE": _PARTS_AND_WHOLE,
}
_OF_UNITS = frozenset(
    b"IFCPROJECT IFCUNITASSIGNMENT IFCSIUNIT IFCCONVERSIONBASEDUNIT IFCCONVERSIONBASEDUNITWITHOFFSET "
    b"IFCCONTEXTDEPENDENTUNIT IFCMEASUREWITHUNIT".split()
)
_REPRESENTATIONS = frozenset([b"IFCPRODUCTDEFINITIONSHAPE", b"IFCPRODUCTREPRESENTATION"])
_PREFIXES = {
    name: 10.0**power
    for name, power in zip(
        b"EXA PETA TERA GIGA MEGA KILO HECTO DECA DECI CENTI MILLI MICRO NANO PICO FEMTO ATTO".split(),
        (18, 15, 12, 9, 6, 3, 2, 1, -1, -2, -3, -6, -9, -12, -15, -18),
        strict=True,
    )
}


@dataclass(frozen=True, slots=True)
class Prescan:
    """What the text of a model says before any kernel has seen it.

    Parameters
    ----------
    schema
        As the kernel names it: `IFC2X3`, `IFC4` or `IFC4X3_ADD2`.
    unit_scale
        Metres per length unit.
    instances
        Number of entity instances.
    shaped
        Step id to class name in capitals and GlobalId, of every product that has a representation.
    """

    schema: str
    unit_scale: float
    instances: int
    shaped: Mapping[int, tuple[str, str]] = field(default_factory=dict)

    @property
    def products(self) -> dict[str, int]:
        """Class name in capitals to the number of its instances that have a representation."""
        return dict(sorted(Counter(kind for kind, _ in self.shaped.values()).items()))


def scan(text: bytes, name: str, *, beat: Callable[[int, int], None] | None = None) -> Prescan:
    """Look through the text of a model.

    Parameters
    ----------
    text
        The whole text.
    name
        The file's name, for messages.
    beat
        Called now and then with the bytes done and their total.

    Raises
    ------
    IfcSyntaxError, IfcTruncatedError, IfcSchemaError, IfcStructureError, IfcUnitsError, IfcReferenceError
        If the kernel would lose a part of the model, die of it or mistake its size.
    """
    return _Scan(text, name).run(beat)


class _Scan:
    """The state of one pass."""

    def __init__(self, text: bytes, name: str) -> None:
        self.text, self.name = text, name
        self.follow = len(text) <= REFERENCES_UP_TO
        self.depth: dict[int, int] = {}  # of every instance whose references are all known
        self.pending: dict[int, list[int]] = {}  # references of the others: they point forward
        self.parts: dict[int, list[int]] = {}
        self.units: dict[int, tuple[bytes, bytes]] = {}
        self.shapes: set[int] = set()
        self.candidates: list[tuple[int, bytes, bytes, int]] = []  # number, class, GlobalId and seventh attribute
        self.placements: list[int] = []  # those in pending

    def run(self, beat: Callable[[int, int], None] | None) -> Prescan:
        schema, start = self._header()
        instances = self._if_plain_and_sound(start)
        if instances is None:
            instances = self._statements(start, beat)
            self._check_placements()
            self._check_chains(self.pending, self.depth, "refers to itself")
        self._check_chains(self.parts, {}, "is a part of itself")
        scale = self._unit_scale()
        shaped = {
            number: (kind.decode("ascii", "replace"), global_id.decode("ascii", "replace"))
            for number, kind, global_id, shape in self.candidates
            if shape in self.shapes or (self.follow and shape not in self.depth and shape not in self.pending)
        }
        return Prescan(schema, scale, instances, shaped)

    def _if_plain_and_sound(self, start: int) -> int | None:
        """Do what `_statements` and the checks after it do, many times faster; None for what these should look at.

        Only products that have a representation become candidates.
        """
        compiled = _compiled()
        found = compiled.survey(self.text, start) if compiled and self.follow else None
        if not compiled or found is None or not _END.match(self.text, found.end):
            return None
        order = np.argsort(found.numbers, kind="stable")
        ordered = found.numbers[order]
        if (np.diff(ordered) <= 0).any():
            return None
        names = [self.text[begin:end] for begin, end in found.names.tolist()]
        roles = np.array([_role_of(name, compiled) for name in names], dtype=np.int64)[found.kinds]
        if compiled.has_loops_or_gaps(_rows_of(found.references, ordered, order), found.firsts, roles, DEPTH_LIMIT):
            return None

        def entity(row: int) -> tuple[int, bytes, bytes]:
            begin, end = found.bodies[row].tolist()
            return int(found.numbers[row]), names[found.kinds[row]], self.text[begin:end]

        is_shape = np.array([name in _REPRESENTATIONS for name in names], dtype=np.bool_)
        is_unit = np.array([name in _OF_UNITS for name in names], dtype=np.bool_)
        joins = np.array([name in _PART_OF for name in names], dtype=np.bool_)
        is_other = np.array([name not in _FLAT and name[:6] != b"IFCREL" for name in names], dtype=np.bool_)
        is_other &= ~(is_shape | is_unit)
        self.shapes.update(found.numbers[is_shape[found.kinds]].tolist())
        for row in np.flatnonzero(is_unit[found.kinds] | (joins[found.kinds] & found.has_text)).tolist():
            self._note(*entity(row))
        rows = np.flatnonzero(is_other[found.kinds] & (found.sevenths >= 0))
        shapes = _rows_of(found.sevenths[rows], ordered, order)
        rows = rows[(shapes < 0) | is_shape[found.kinds[shapes]]]  # one that is not there is for the reader to miss
        columns = (found.numbers[rows], found.kinds[rows], found.marks[rows], found.sevenths[rows])
        for number, kind, (begin, end), shape in zip(*(column.tolist() for column in columns), strict=True):
            self.candidates.append((number, names[kind], self.text[begin:end], shape))
        return len(found.numbers)

    # header

    def _header(self) -> tuple[str, int]:
        schema, end, keyword = b"", 0, b""
        while keyword != b"DATA":
            match = _HEADER.match(self.text, end)
            if match is None:
                if not self.text.rstrip(b"\0 \r\n\t").endswith((b";", b"END-ISO-10303-21")):
                    self._truncated("within its header")
                self._refuse(IfcSyntaxError, "has a header that cannot be parsed", "Export it again.", at=end)
            end, keyword = match.end(), match[1].upper()
            if keyword == b"FILE_SCHEMA":
                body = _COMMENT.sub(b"", match[2])
                found = _SCHEMA.fullmatch(body)
                schema = found[1].strip().upper() if found else body
        shown = schema[:40].decode("ascii", "replace")
        if shown in SCHEMAS and len(schema) <= 40:
            return shown, end
        said = f"states the schema {shown!r}" if schema else "states no schema"
        return self._refuse(IfcSchemaError, said, "Export it as IFC2X3, IFC4 or IFC4X3_ADD2.", schema=shown)

    # statements

    def _statements(self, start: int, beat: Callable[[int, int], None] | None) -> int:
        depth, pending, follow = self.depth, self.pending, self.follow
        known = depth.get
        end, count = start, 0
        for match in _STATEMENT.finditer(self.text, start):
            digits, kind, body = match.groups()
            if digits is None:
                break
            end = match.end()
            count += 1
            if beat is not None and not count % _BEAT_EVERY:
                beat(end, len(self.text))
            number = int(digits)
            if not follow:
                self._note(number, kind.upper(), body)
                continue
            if number in depth or number in pending:
                self._refuse(
                    IfcReferenceError,
                    f"has two entities numbered #{number}",
                    "The exporter is at fault; ask for a fresh export.",
                    at=match.start(1),
                    entity=f"#{number}",
                )
            if kind in _FLAT:
                depth[number] = 0
                continue
            kind = kind.upper()
            if b"'" in body or b"/" in body:
                self._note(number, kind, body)
                body = _strip(body)
            elif kind in _OF_UNITS or kind in _REPRESENTATIONS:
                self._note(number, kind, body)
            if kind[:6] == b"IFCREL":  # nothing refers to these but space boundaries, which may do so mutually
                depth[number] = 0
                continue
            below = 0
            references = [int(digits) for digits in _REFERENCE.findall(body)]
            for reference in references:
                deep = known(reference)
                if deep is None:
                    pending[number] = references
                    if kind == b"IFCLOCALPLACEMENT":
                        self.placements.append(number)
                    break
                if deep >= below:
                    below = deep + 1
            else:
                depth[number] = below
        self._check_end(end)
        return count

    def _note(self, number: int, kind: bytes, body: bytes) -> None:
        if kind in _OF_UNITS:
            self.units[number] = kind, body
        elif kind in _REPRESENTATIONS:
            self.shapes.add(number)
        elif kind[:6] == b"IFCREL":
            self._note_parts(kind, body)
        elif shape := _SEVENTH.match(body):
            self.candidates.append((number, kind, shape[1], int(shape[2])))

    def _note_parts(self, kind: bytes, body: bytes) -> None:
        pattern = _PART_OF.get(kind)
        found = pattern.search(_strip(body)) if pattern else None
        if found and self.follow:
            whole, parts = found.groups() if pattern is _WHOLE_AND_PARTS else found.groups()[::-1]
            self.parts.setdefault(int(whole), []).extend(map(int, _REFERENCE.findall(parts)))

    def _check_end(self, end: int) -> None:
        if _END.match(self.text, end):
            return
        last = self._last_entity(end)
        if self.text.find(b"END-ISO-10303-21", end) < 0:
            self._truncated(f"after {last}" if last else "before its first entity")
        rest = self.text[end : end + 200].lstrip()
        found = b" ".join(rest.split())[:40].decode("ascii", "replace")
        self._refuse(
            IfcSyntaxError,
            f"cannot be parsed after {last or 'DATA;'}: found {found!r}",
            "The rest of the model would be lost without a word; export it again.",
            at=self.text.find(rest, end),
            entity=last,
        )

    def _truncated(self, where: str) -> NoReturn:
        self._refuse(
            IfcTruncatedError,
            f"is cut off {where}: the end mark is missing",
            "A part of the model would be lost; ask for a fresh export or repeat the download.",
        )

    def _last_entity(self, end: int) -> str:
        """Name the entity that ends at `end`, such as `#12`; empty if there is none."""
        start = max(0, end - (1 << 20))
        found = re.findall(rb"#\s*(\d+)\s*=", self.text[start:end])
        return f"#{int(found[-1])}" if found else ""

    # references

    def _check_placements(self) -> None:
        for number in self.placements:
            for reference in self.pending[number]:
                if reference not in self.depth and reference not in self.pending:
                    self._refuse(
                        IfcReferenceError,
                        f"places #{number} relative to #{reference}, which is not in the file",
                        "Elements would move without a word; export it again.",
                        entity=f"#{number}",
                    )

    def _check_chains(self, graph: Mapping[int, list[int]], known: Mapping[int, int], what: str) -> None:
        """Refuse loops and chains that are too deep; `known` holds the depth of what lies outside `graph`."""
        deepest = max(known, key=known.__getitem__, default=None)
        if deepest is not None and known[deepest] > DEPTH_LIMIT:
            self._too_deep(deepest)
        depth: dict[int, int] = {}
        for root in graph:
            if root in depth:
                continue
            trail = {root: iter(graph[root])}  # from the root to where we are, in order
            while trail:
                number, references = next(reversed(trail.items()))
                for reference in references:
                    if reference in trail:
                        loop = [*list(trail)[list(trail).index(reference) :], reference]
                        self._refuse_loop(loop, what)
                    if reference in graph and reference not in depth:
                        trail[reference] = iter(graph[reference])
                        break
                else:
                    del trail[number]
                    depth[number] = 1 + max((depth.get(r, known.get(r, 0)) for r in graph[number]), default=0)
                    if depth[number] > DEPTH_LIMIT:
                        self._too_deep(number)

    def _refuse_loop(self, loop: list[int], what: str) -> NoReturn:
        shown = loop if len(loop) <= 6 else [*loop[:3], None, *loop[-2:]]
        self._refuse(
            IfcReferenceError,
            f"is circular: {self._kind_of(loop[0])} #{loop[0]} {what} "
            f"({' -> '.join('...' if n is None else f'#{n}' for n in shown)})",
            "The exporter is at fault; nothing was read. Ask for a fresh export.",
            entity=f"#{loop[0]}",
        )

    def _too_deep(self, number: int) -> NoReturn:
        self._refuse(
            IfcReferenceError,
            f"nests more than {DEPTH_LIMIT} entities below {self._kind_of(number)} #{number}",
            "The exporter is at fault; nothing was read. Ask for a fresh export.",
            entity=f"#{number}",
        )

    def _kind_of(self, number: int) -> str:
        found = re.search(rb"#\s*0*%d\s*=\s*(\w+)" % number, self.text)
        return found[1].decode("ascii", "replace") if found else "entity"

    # units

    def _unit_scale(self) -> float:
        projects = [(n, body) for n, (kind, body) in self.units.items() if kind == b"IFCPROJECT"]
        if not projects:
            self._refuse(
                IfcStructureError, "has no IfcProject", "Export the whole model, not a selection or a library."
            )
        scales = {self._scale_of_project(number, body) for number, body in projects}
        if len(scales) > 1:
            self._refuse(
                IfcUnitsError, "holds projects in different length units", "Export each as a model of its own."
            )
        return scales.pop()

    def _scale_of_project(self, number: int, body: bytes) -> float:
        assigned = _LAST.search(_strip(body))
        _, units = self.units.get(int(assigned[1]), (b"", b"")) if assigned else (b"", b"")
        lengths = [n for n in _references(units) if b".LENGTHUNIT." in self.units.get(n, (b"", b""))[1]]
        if len(lengths) != 1:
            said = " and ".join(f"#{n}" for n in lengths[:4])
            self._refuse(
                IfcUnitsError,
                f"states {len(lengths)} length units ({said})" if lengths else "states no length unit",
                "Its size cannot be told. Set exactly one length unit in the exporter.",
                entity=f"#{number}",
            )
        scale = self._metres(lengths[0], 0)
        if not _METRES[0] < scale < _METRES[1]:
            self._bad_unit(lengths[0], f"is {scale:g} metres")
        return scale

    def _metres(self, number: int, steps: int) -> float:
        """Return how many metres a unit, or a measure with a unit, is."""
        kind, body = self.units.get(number, (b"", b""))
        if kind == b"IFCSIUNIT":
            metre = _SI_METRE.match(body)
            if metre and (not metre[1] or metre[1] in _PREFIXES):
                return _PREFIXES.get(metre[1], 1.0)
        elif kind.startswith(b"IFCCONVERSIONBASEDUNIT") and steps < 20:
            factor = _references(body)
            if factor:
                return self._metres(factor[-1], steps + 1)
        elif kind == b"IFCMEASUREWITHUNIT" and (measure := _MEASURE.match(body)):
            try:
                return float(measure[1]) * self._metres(int(measure[2]), steps + 1)
            except ValueError as error:
                if isinstance(error, BimnavError):
                    raise
        return self._bad_unit(number, "is not stated in metres")

    def _bad_unit(self, number: int, what: str) -> NoReturn:
        self._refuse(
            IfcUnitsError,
            f"states a length unit that {what} (#{number})",
            "Its size cannot be told. Set the length unit in the exporter.",
            entity=f"#{number}",
        )

    def _refuse(
        self, error: type[BimnavError], what: str, hint: str, *, at: int | None = None, **context: Any
    ) -> NoReturn:
        if at is not None:
            newline = b"\n" if b"\n" in self.text[:4096] else b"\r"
            context["line"] = self.text.count(newline, 0, at) + 1
            what += f" (line {context['line']})"
        raise error(f"{self.name} {what}.", hint, {"file": self.name, **context})


def _compiled() -> Any:
    """Return the compiled look, or None if it cannot be loaded: it takes a lot of memory."""
    try:
        from bimnav.ifc import _survey
    except (ImportError, MemoryError, OSError):
        return None
    return _survey


def _role_of(name: bytes, compiled: Any) -> int:
    if name in _FLAT or name[:6] == b"IFCREL":
        return int(compiled.FLAT)
    return int(compiled.PLACEMENT if name == b"IFCLOCALPLACEMENT" else compiled.FOLLOWED)


def _rows_of(numbers: NDArray[np.int64], ordered: NDArray[np.int64], order: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the rows of entities by their numbers; -1 where there is none."""
    if not len(ordered):
        return np.full(len(numbers), -1)
    places = np.minimum(np.searchsorted(ordered, numbers), len(ordered) - 1)
    return np.where(ordered[places] == numbers, order[places], -1)


def _strip(body: bytes) -> bytes:
    return _NAMES_AND_COMMENTS.sub(b"", body)


def _references(body: bytes) -> list[int]:
    return [int(digits) for digits in _REFERENCE.findall(_strip(body))]
