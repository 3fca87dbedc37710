"""Models damaged on purpose: two thousand files, each with a name, equal in every run.

A mutation takes a draft of a sound model and a random generator, and changes the draft or returns the
content of the file itself. Each has a promise to be kept by whoever reads the file.
"""

from __future__ import annotations

import gzip
import io
import random
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from tests.drafts import BASES, Draft, base_text, draft_of, listed

__all__ = ["SHARES", "Case", "cases"]

Promise = Literal["any", "refused", "read", "same"]
Content = str | bytes
Mutation = Callable[[Draft, random.Random], Content | None]

SHARES = {
    "truncate": 190,
    "bytes": 290,
    "token": 440,
    "geometry": 300,
    "entity": 200,
    "cycle": 130,
    "chain": 40,
    "tree": 12,
    "header": 80,
    "string": 90,
    "number": 30,
    "container": 66,
    "splice": 36,
    "bulk": 12,
    "cruel": 84,
}
"""Family to its number of files; two thousand in all."""


@dataclass(frozen=True, slots=True)
class Case:
    """One file.

    Parameters
    ----------
    name
        Mutation, number within the family, and base model.
    promise
        What a reader has to make of it: `any` building or typed error, a typed error about the input
        (`refused`), a building (`read`), or the `same` building as the base model's.
    """

    name: str
    family: str
    base: str
    content: bytes
    promise: Promise
    suffix: str = ".ifc"


@dataclass(frozen=True, slots=True)
class _Kind:
    make: Mutation
    promise: Promise
    suffix: str
    of: str  # the base models whose name begins so


_KINDS: dict[str, list[_Kind]] = {family: [] for family in SHARES}


def _mutation(
    family: str, promise: Promise = "any", suffix: str = ".ifc", of: str = ""
) -> Callable[[Mutation], Mutation]:
    def register(make: Mutation) -> Mutation:
        _KINDS[family].append(_Kind(make, promise, suffix, of))
        return make

    return register


def cases(family: str, number: int | None = None, seed: str = "") -> Iterator[Case]:
    """The files of a family, or the first few; they go through its mutations in turn. Another seed gives others."""
    kinds = _KINDS[family]
    for k in range(SHARES[family] if number is None else number):
        kind = kinds[k % len(kinds)]
        rng = random.Random(f"{family} {k}{seed}")
        base = rng.choice([base for base in BASES if base.startswith(kind.of)])
        draft = draft_of(base)
        content = kind.make(draft, rng)
        content = draft.text() if content is None else content
        content = content.encode("latin-1", "replace") if isinstance(content, str) else content
        name = f"{kind.make.__name__.replace('_', ' ').strip()} {k} of {base}"
        yield Case(name, family, base, content, kind.promise, kind.suffix)


def _pick(draft: Draft, rng: random.Random, *kinds: str) -> int:
    """Pick an entity of some classes, or of any; rare classes as often as common ones."""
    by_class: dict[str, list[int]] = {}
    for number in draft.all(*(kinds or ("*",))):
        by_class.setdefault(draft[number][0], []).append(number)
    return rng.choice(by_class[rng.choice(sorted(by_class))])


def _slot(draft: Draft, rng: random.Random, pattern: str, *kinds: str) -> tuple[list[str], int]:
    """Pick an argument in which a pattern is found."""
    for _ in range(1000):
        entity = draft[_pick(draft, rng, *kinds)]
        places = [k for k, value in enumerate(entity) if k and re.search(pattern, value)]
        if places:
            return entity, rng.choice(places)
    raise LookupError(pattern)


def _replace_one(text: str, pattern: str, new: str, rng: random.Random) -> str:
    found = rng.choice(list(re.finditer(pattern, text)))
    return text[: found.start()] + new + text[found.end() :]


def _ring(draft: Draft, numbers: Sequence[int], argument: int) -> None:
    """Make each of some entities refer to the next, and the last to the first."""
    for one, other in pairwise([*numbers, numbers[0]]):
        draft[one][argument] = f"#{other}"


def _down(draft: Draft, rng: random.Random, patience: float = 1.0) -> list[int]:
    """The way from a product down its placement or representation; it may end before the bottom."""
    trail = [rng.choice(draft.products())]
    while rng.random() < patience and (below := re.findall(r"#(\d+)", ",".join(draft[trail[-1]][-4:]))):
        trail.append(int(rng.choice(below)))
    return trail


def _mapped(draft: Draft, shape: int, times: int = 1) -> list[int]:
    """Mapped items of a representation."""
    origin = draft.first("IFCCARTESIANPOINT")
    target = draft.add("IFCCARTESIANTRANSFORMATIONOPERATOR3D", "$", "$", f"#{origin}", "$", "$")
    source = draft.add("IFCREPRESENTATIONMAP", f"#{draft.first('IFCAXIS2PLACEMENT3D')}", f"#{shape}")
    return [draft.add("IFCMAPPEDITEM", f"#{source}", f"#{target}") for _ in range(times)]


def _map_again(draft: Draft, product: int, layers: int, times: int) -> None:
    """Replace a product's representation by one mapped through some layers, several times in each."""
    for _ in range(layers):
        shape = draft.shape(product)
        items = listed(_mapped(draft, shape, times))
        again = draft.add("IFCSHAPEREPRESENTATION", draft[shape][1], "'Body'", "'MappedRepresentation'", items)
        draft[int(draft[product][7][1:])][3] = f"(#{again})"


def _extrude(draft: Draft, rng: random.Random, curve: int) -> None:
    """Give one of the extrusions another outline."""
    profile = draft.add("IFCARBITRARYCLOSEDPROFILEDEF", ".AREA.", "$", f"#{curve}")
    draft[rng.choice(draft.all("IFCEXTRUDEDAREASOLID"))][1] = f"#{profile}"


def _units(draft: Draft) -> list[str]:
    return draft[draft.first("IFCUNITASSIGNMENT")]


# truncate


@_mutation("truncate", "refused")
def at_a_byte(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    return text[: rng.randrange(text.rindex("END-ISO"))]


@_mutation("truncate", "refused")
def at_a_line(draft: Draft, rng: random.Random) -> Content:
    lines = draft.text().splitlines(keepends=True)
    return "".join(lines[: rng.randrange(1, len(lines))])


@_mutation("truncate", "refused")
def in_the_header(draft: Draft, rng: random.Random) -> Content:
    return draft.head[: rng.randrange(len(draft.head))]


@_mutation("truncate", "refused")
def within_an_entity(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    at = text.index(f"\n#{_pick(draft, rng)}=")
    return text[: rng.randrange(at, text.index(";", at)) + 1]


@_mutation("truncate", "refused")
def near_the_end(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    return text[: text.rindex("END-ISO") + rng.randint(-12, 15)]


@_mutation("truncate", "refused")
def and_filled_with_nothing(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    end = rng.randrange(len(draft.head), text.rindex("END-ISO"))
    return text[:end] + rng.choice("\0 \n") * (len(text) - end)


# bytes


def _edit(content: bytearray, rng: random.Random) -> None:
    at, other = rng.randrange(len(content)), rng.randrange(len(content))
    match rng.randrange(9):
        case 0:
            content[at] ^= 1 << rng.randrange(8)
        case 1:
            content[at:at] = rng.randbytes(rng.randint(1, 8))
        case 2:
            del content[at : at + rng.randint(1, 30)]
        case 3:
            content[at] = 0
        case 4:
            content[at] = rng.randrange(128, 256)
        case 5:
            content[at:at] = content[other : other + rng.randint(1, 400)]
        case 6:
            content[at] = rng.choice(b"();,'#=*$./\"\\ \n")
        case 7:
            content[at], content[other] = content[other], content[at]
        case 8:
            del content[at : at + rng.randint(100, 4000)]


@_mutation("bytes")
def one_edit(draft: Draft, rng: random.Random) -> Content:
    content = bytearray(draft.text(), "latin-1")
    _edit(content, rng)
    return bytes(content)


@_mutation("bytes")
def some_edits(draft: Draft, rng: random.Random) -> Content:
    content = bytearray(draft.text(), "latin-1")
    for _ in range(rng.randint(2, 10)):
        _edit(content, rng)
    return bytes(content)


@_mutation("bytes")
def digits_changed(draft: Draft, rng: random.Random) -> Content:
    text = bytearray(draft.text(), "latin-1")
    digits = [k for k, sign in enumerate(text) if chr(sign).isdigit() and k > len(draft.head)]
    for k in rng.sample(digits, rng.randint(1, 20)):
        text[k] = rng.choice(b"0123456789")
    return bytes(text)


@_mutation("bytes")
def a_sector_of_zeros(draft: Draft, rng: random.Random) -> Content:
    text = bytearray(draft.text(), "latin-1")
    at = rng.randrange(len(text) - 512)
    text[at : at + 512] = bytes(512)
    return bytes(text)


# token

_NUMBER = r"(?<![#\w.'])-?\d+(\.\d*)?(E[+-]?\d+)?(?![\w'])"
_HOSTILE_NUMBERS = (
    *("NAN", "NAN.", "INF", "-INF", "1.E400", "1.E308", "-1.E308", "1.E18", "1.E9", "1.E6", "0.", "-0.", "-1."),
    *("1.E-320", "1.2.3", "1,5", "--1", "0x10", "1.E", ".", "+5", "007", "99999999999999999999", "-2147483649"),
    *("'1.'", "$", "*"),
)
_HOSTILE_VALUES = (
    *("$", "*", "()", "''", "'x'", "#0", "#1", "#999999", "#99999999999", "#-1", "0", "1.5", "-1", "NAN", ".T."),
    *(".U.", ".NOSUCH.", "..", "(1.,2.)", "((1))", "($,$)", "(#1,#1)", "('a',1.,#1)", "IFCLABEL('x')"),
    *("IFCNOSUCH(1.)", "IFCREAL(#1)", '"0F"', "#1=", "/*", "//", "%", "\x80", "IFCWALL", "((((", "))))"),
)


@_mutation("token")
def a_value_replaced(draft: Draft, rng: random.Random) -> None:
    entity = draft[_pick(draft, rng)]
    entity[rng.randrange(1, len(entity))] = rng.choice(_HOSTILE_VALUES)


@_mutation("token")
def a_reference_turned_elsewhere(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, r"#\d+")
    entity[k] = _replace_one(entity[k], r"#\d+", f"#{_pick(draft, rng)}", rng)


@_mutation("token")
def a_reference_to_nothing(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, r"#\d+")
    entity[k] = _replace_one(entity[k], r"#\d+", rng.choice(["#999999", "$", "*", "''"]), rng)


@_mutation("token")
def a_reference_in_a_body_to_nothing(draft: Draft, rng: random.Random) -> None:
    entity = draft[_down(draft, rng, 0.8)[-1]]
    if places := [k for k, value in enumerate(entity) if "#" in value]:
        k = rng.choice(places)
        entity[k] = _replace_one(entity[k], r"#\d+", "#999999", rng)


@_mutation("token")
def a_number_replaced(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, _NUMBER)
    entity[k] = _replace_one(entity[k], _NUMBER, rng.choice(_HOSTILE_NUMBERS), rng)


@_mutation("token")
def arguments_too_many_or_few(draft: Draft, rng: random.Random) -> None:
    entity = draft[_pick(draft, rng)]
    match rng.randrange(4):
        case 0:
            del entity[rng.randrange(1, len(entity))]
        case 1:
            entity.insert(rng.randrange(1, len(entity) + 1), rng.choice(_HOSTILE_VALUES))
        case 2:
            del entity[1:]
        case 3:
            entity += ["$"] * 1000


@_mutation("token")
def arguments_in_another_order(draft: Draft, rng: random.Random) -> None:
    entity = draft[_pick(draft, rng)]
    entity[1:] = rng.sample(entity[1:], len(entity) - 1)


@_mutation("token")
def a_class_replaced(draft: Draft, rng: random.Random) -> None:
    entity, other = draft[_pick(draft, rng)], draft[_pick(draft, rng)]
    names = (other[0], "IFCNOSUCH", "IFCPRODUCT", "IFCREPRESENTATIONITEM", "IFCROOT", "", "IFC" + "X" * 600, "!OWN")
    entity[0] = rng.choice(names)


@_mutation("token")
def a_class_of_a_body_replaced(draft: Draft, rng: random.Random) -> None:
    entity = draft[_down(draft, rng, 0.85)[-1]]
    entity[0] = rng.choice(["IFCNOSUCH", entity[0] + "X", draft[_pick(draft, rng)][0]])


@_mutation("token")
def an_enumeration_replaced(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, r"\.[A-Z_]+\.")
    entity[k] = _replace_one(entity[k], r"\.[A-Z_]+\.", rng.choice([".NOSUCH.", ".F.", "..", "$", "'UNION'", "1"]), rng)


@_mutation("token")
def brackets_without_end(draft: Draft, rng: random.Random) -> None:
    entity = draft[_pick(draft, rng)]
    k = rng.randrange(1, len(entity))
    depth = rng.choice([3, 100, 20_000])
    entity[k] = "(" * depth + entity[k] + ")" * depth


@_mutation("token")
def two_entities_changed_about(draft: Draft, rng: random.Random) -> None:
    one, other = _pick(draft, rng), _pick(draft, rng)
    draft.entities[one], draft.entities[other] = draft[other], draft[one]


# geometry

_SHAPES = (
    *(
        "IFCCARTESIANPOINT",
        "IFCDIRECTION",
        "IFCEXTRUDED*",
        "IFCREVOLVED*",
        "IFCRECTANGLE*",
        "IFCCIRCLE*",
        "IFCPOLYLINE",
    ),
    *("IFCAXIS*", "IFCCARTESIANTRANSFORMATION*", "IFCTRIANGULATED*", "IFCGEOMETRICREPRESENTATIONCONTEXT"),
)
_MAGNITUDES = ("NAN", "INF", "1.E308", "-1.E308", "1.E18", "1.E9", "1.E7", "0.", "-0.", "-1.", "1.E-9", "1.E-320")


@_mutation("geometry")
def one_number_of_a_shape(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, _NUMBER, *_SHAPES)
    entity[k] = _replace_one(entity[k], _NUMBER, rng.choice(_MAGNITUDES), rng)


@_mutation("geometry")
def all_numbers_of_a_shape(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, _NUMBER, *_SHAPES)
    entity[k] = re.sub(_NUMBER, rng.choice(_MAGNITUDES), entity[k])


@_mutation("geometry")
def points_scaled(draft: Draft, rng: random.Random) -> None:
    factor = rng.choice([0.0, -1.0, 1e-9, 1e3, 1e6, 1e9, 1e12, 1e300])
    for number in draft.all("IFCCARTESIANPOINT"):
        if rng.random() < 0.5:
            numbers = re.findall(r"-?[\d.]+(?:E-?\d+)?", draft[number][1])
            draft[number][1] = f"({','.join(f'{float(value) * factor:E}' for value in numbers)})"


@_mutation("geometry")
def directions_without_sense(draft: Draft, rng: random.Random) -> None:
    for number in rng.sample(found := draft.all("IFCDIRECTION"), rng.randint(1, len(found))):
        draft[number][1] = rng.choice(["(0.,0.,0.)", "(1.E-200,0.,0.)", "(1.,1.,1.)", "(0.,1.E300,0.)", "(NAN,0.,1.)"])


@_mutation("geometry", of="zoo")
def outlines_without_sense(draft: Draft, rng: random.Random) -> None:
    entity = draft[_pick(draft, rng, "IFCPOLYLINE", "IFCPOLYLOOP", "IFCCLOSEDSHELL", "IFCCONNECTEDFACESET")]
    corners = re.findall(r"#\d+", entity[1])
    match rng.randrange(6):
        case 0:
            corners = corners[: rng.randrange(4)]
        case 1:
            corners = corners[:1] * len(corners)
        case 2:
            corners = rng.sample(corners, len(corners))
        case 3:
            corners = corners + corners
        case 4:
            del corners[rng.randrange(len(corners)) :: 2]
        case 5:
            corners = corners[::-1] * 100
    entity[1] = f"({','.join(corners)})"


@_mutation("geometry")
def triangles_without_sense(draft: Draft, rng: random.Random) -> None:
    bad = [
        "(0,1,2)",
        "(1,1,1)",
        "(1,2)",
        "(1,2,3,4)",
        "(-1,2,3)",
        "(9,1,2)",
        "(2147483648,1,2)",
        "(1.5,2,3)",
        "()",
        "1",
        "$",
    ]
    points = draft.add("IFCCARTESIANPOINTLIST3D", "((0.,0.,0.),(1.,0.,0.),(0.,1.,0.),(0.,0.,1.))")
    faces = ["(1,3,2)", "(1,2,4)", "(2,3,4)", "(1,4,3)"]
    faces[rng.randrange(4)] = rng.choice(bad)
    item = draft.add("IFCTRIANGULATEDFACESET", f"#{points}", "$", ".T.", f"({','.join(faces)})", "$")
    draft.set_body(rng.choice(draft.products()), item)


@_mutation("geometry")
def a_size_of_a_solid(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, r"^-?\d", "IFCEXTRUDED*", "IFCREVOLVED*", "IFCRECTANGLE*", "IFCCIRCLE*")
    entity[k] = rng.choice(_MAGNITUDES)


@_mutation("geometry")
def one_solid_less_another(draft: Draft, rng: random.Random) -> None:
    one, other = (rng.choice(draft.products()) for _ in range(2))
    operator = rng.choice([".DIFFERENCE.", ".UNION.", ".INTERSECTION.", ".NOSUCH."])
    kind = rng.choice(["IFCBOOLEANRESULT", "IFCBOOLEANCLIPPINGRESULT"])
    draft.set_body(one, draft.add(kind, operator, f"#{draft.body(one)}", f"#{draft.body(other)}"))


@_mutation("geometry")
def a_half_space_without_sense(draft: Draft, rng: random.Random) -> None:
    number = rng.choice(draft.products())
    point = draft.add("IFCCARTESIANPOINT", rng.choice(["(0.,0.,0.)", "(1.E9,0.,0.)", "(NAN,0.,0.)", "(0.,0.)"]))
    normal = draft.add("IFCDIRECTION", rng.choice(["(0.,0.,0.)", "(0.,0.,1.)", "(1.,0.,0.)"]))
    axes = draft.add("IFCAXIS2PLACEMENT3D", f"#{point}", f"#{normal}", f"#{normal}")
    plane = draft.add("IFCPLANE", f"#{axes}")
    half = draft.add("IFCHALFSPACESOLID", f"#{plane}", rng.choice([".T.", ".F.", ".U.", "$"]))
    operands = [f"#{draft.body(number)}", f"#{half}"]
    rng.shuffle(operands)
    draft.set_body(number, draft.add("IFCBOOLEANCLIPPINGRESULT", ".DIFFERENCE.", *operands))


@_mutation("geometry")
def an_outline_without_points(draft: Draft, rng: random.Random) -> None:
    points = rng.choice(["()", f"(#{draft.first('IFCCARTESIANPOINT')})", "$"])
    _extrude(draft, rng, draft.add("IFCPOLYLINE", points))


@_mutation("geometry", of="zoo")
def a_body_of_a_rare_kind(draft: Draft, rng: random.Random) -> None:
    point = draft.add("IFCCARTESIANPOINT", "(0.,0.,0.)")
    axes = draft.add("IFCAXIS2PLACEMENT3D", f"#{point}", "$", "$")
    length = rng.choice(_MAGNITUDES)
    curve = draft.first("IFCPOLYLINE")
    kinds = {
        "IFCBLOCK": (f"#{axes}", "1.", "1.", length),
        "IFCSPHERE": (f"#{axes}", length),
        "IFCRIGHTCIRCULARCYLINDER": (f"#{axes}", "1.", length),
        "IFCRECTANGULARPYRAMID": (f"#{axes}", "1.", "1.", length),
        "IFCSWEPTDISKSOLID": (f"#{curve}", length, "$", "$", "$"),
        "IFCPLANE": (f"#{axes}",),
        "IFCBOUNDINGBOX": (f"#{point}", "1.", "1.", length),
        "IFCGEOMETRICSET": (f"(#{curve})",),
    }
    kind = rng.choice(sorted(kinds))
    draft.set_body(rng.choice(draft.products()), draft.add(kind, *kinds[kind]))


# entity


@_mutation("entity")
def one_dropped(draft: Draft, rng: random.Random) -> None:
    del draft.entities[_pick(draft, rng)]


@_mutation("entity")
def several_dropped(draft: Draft, rng: random.Random) -> None:
    for number in rng.sample(list(draft.entities), rng.randint(2, 20)):
        del draft.entities[number]


@_mutation("entity")
def a_class_dropped(draft: Draft, rng: random.Random) -> None:
    kind = draft[_pick(draft, rng)][0]
    for number in draft.all(kind):
        del draft.entities[number]


@_mutation("entity")
def the_frame_dropped(draft: Draft, rng: random.Random) -> None:
    kinds = ("IFCPROJECT", "IFCUNITASSIGNMENT", "IFCSIUNIT", "IFCGEOMETRICREPRESENTATION*", "IFCBUILDING*", "IFCREL*")
    for number in draft.all(rng.choice(kinds)):
        del draft.entities[number]


@_mutation("entity", "refused")
def one_number_twice(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    line = rng.choice(draft.lines())
    other = line if rng.random() < 0.5 else re.sub(r"=.*", "=" + rng.choice(draft.lines()).partition("=")[2], line)
    return text.replace("ENDSEC;\nEND-ISO", f"{other}\nENDSEC;\nEND-ISO")


@_mutation("entity")
def one_doubled(draft: Draft, rng: random.Random) -> None:
    kinds = (
        "IFCPROJECT",
        "IFCUNITASSIGNMENT",
        "IFCSITE",
        "IFCBUILDING",
        "IFCREL*",
        "IFCLOCALPLACEMENT",
        "IFCSHAPE*",
        "*",
    )
    draft.add(*draft[_pick(draft, rng, rng.choice(kinds))])


@_mutation("entity")
def a_unit_doubled(draft: Draft, rng: random.Random) -> None:
    other = draft.add("IFCSIUNIT", "*", ".LENGTHUNIT.", rng.choice(["$", ".MILLI.", ".CENTI."]), ".METRE.")
    _units(draft)[1] = _units(draft)[1][:-1] + f",#{other})"


@_mutation("entity")
def a_unit_without_sense(draft: Draft, rng: random.Random) -> None:
    prefix = rng.choice(["$", ".EXA.", ".ATTO.", ".MICRO.", ".KILO.", ".NOSUCH.", "'MILLI'", "*"])
    unit = draft.add("IFCSIUNIT", "*", ".LENGTHUNIT.", prefix, rng.choice([".METRE.", ".METRE.", ".GRAM.", "$"]))
    _units(draft)[1] = rng.choice([f"(#{unit})", f"(#{unit})", f"(#{unit},#{unit})", "()", "$"])


@_mutation("entity", "read")
def one_global_id_for_many(draft: Draft, rng: random.Random) -> None:
    products = draft.products()
    for number in rng.sample(products, rng.randint(2, len(products))):
        draft[number][1] = draft[products[0]][1]


@_mutation("entity", "read")
def a_global_id_that_is_none(draft: Draft, rng: random.Random) -> None:
    bad = ["''", "'short'", f"'{'x' * 5000}'", f"'{'!' * 22}'", "$", "'0000000000000000000 01'"]
    for number in rng.sample(draft.products(), 3):
        draft[number][1] = rng.choice(bad)


@_mutation("entity", "same")
def in_another_order(draft: Draft, rng: random.Random) -> None:
    items = list(draft.entities.items())
    rng.shuffle(items)
    draft.entities = dict(items)


@_mutation("entity", "same")
def with_other_numbers(draft: Draft, rng: random.Random) -> Content:
    offset = rng.choice([1, 1000, 123_456_789])
    return (
        draft.head
        + "DATA;"
        + re.sub(
            r"#(\d+)(?=[^']*(?:'[^']*'[^']*)*$)",
            lambda found: f"#{int(found[1]) + offset}",
            draft.text().partition("DATA;")[2],
            flags=re.MULTILINE,
        )
    )


# cycle


@_mutation("cycle", "refused")
def a_placement_in_itself(draft: Draft, rng: random.Random) -> None:
    _ring(draft, [_pick(draft, rng, "IFCLOCALPLACEMENT")], 1)


@_mutation("cycle", "refused")
def placements_in_a_ring(draft: Draft, rng: random.Random) -> None:
    found = draft.all("IFCLOCALPLACEMENT")
    _ring(draft, rng.sample(found, rng.choice([2, 3, len(found)])), 1)


@_mutation("cycle", "refused")
def a_boolean_of_itself(draft: Draft, rng: random.Random) -> None:
    product = rng.choice(draft.products())
    body = f"#{draft.body(product)}"
    item = draft.add("IFCBOOLEANRESULT", rng.choice([".DIFFERENCE.", ".UNION."]), body, body)
    draft[item][rng.choice([2, 3])] = f"#{item}"
    draft.set_body(product, item)


@_mutation("cycle", "refused")
def a_mapped_item_of_itself(draft: Draft, rng: random.Random) -> None:
    shape = draft.shape(rng.choice(draft.products()))
    draft[shape][4] = draft[shape][4][:-1] + f",#{_mapped(draft, shape)[0]})"


@_mutation("cycle", "refused")
def a_curve_of_itself(draft: Draft, rng: random.Random) -> None:
    segment = draft.add("IFCCOMPOSITECURVESEGMENT", ".CONTINUOUS.", ".T.", "$")
    curve = draft.add("IFCCOMPOSITECURVE", f"(#{segment})", ".F.")
    draft[segment][3] = f"#{curve}"
    _extrude(draft, rng, curve)


@_mutation("cycle", "refused")
def a_context_of_itself(draft: Draft, rng: random.Random) -> None:
    _ring(draft, draft.all("IFCGEOMETRICREPRESENTATIONSUBCONTEXT"), 7)


@_mutation("cycle", "refused")
def a_unit_of_itself(draft: Draft, rng: random.Random) -> None:
    measure = draft.add("IFCMEASUREWITHUNIT", "IFCLENGTHMEASURE(2.)", "$")
    unit = draft.add("IFCCONVERSIONBASEDUNIT", "$", rng.choice([".LENGTHUNIT.", ".AREAUNIT."]), "'own'", f"#{measure}")
    draft[measure][2] = f"#{unit}"
    _units(draft)[1] = _units(draft)[1][:-1] + f",#{unit})"


@_mutation("cycle", "refused")
def a_part_of_itself(draft: Draft, rng: random.Random) -> None:
    product = rng.choice(draft.products())
    draft.relate(rng.choice(["IFCRELAGGREGATES", "IFCRELNESTS"]), f"#{product}", f"(#{product})")


@_mutation("cycle", "refused")
def wholes_in_a_ring(draft: Draft, rng: random.Random) -> None:
    ring = rng.sample(draft.products(), rng.randint(2, 6))
    for one, other in pairwise([*ring, ring[0]]):
        draft.relate(rng.choice(["IFCRELAGGREGATES", "IFCRELNESTS"]), f"#{one}", f"(#{other})")


@_mutation("cycle", "refused")
def the_project_in_its_storey(draft: Draft, rng: random.Random) -> None:
    upper = rng.choice(draft.all("IFCPROJECT", "IFCSITE", "IFCBUILDING"))
    draft.relate("IFCRELAGGREGATES", f"#{draft.first('IFCBUILDINGSTOREY')}", f"(#{upper})")


@_mutation("cycle", "refused")
def a_void_of_itself(draft: Draft, rng: random.Random) -> None:
    void = rng.choice(draft.all("IFCOPENINGELEMENT"))
    draft.relate("IFCRELVOIDSELEMENT", f"#{void}", f"#{void}")


@_mutation("cycle", "refused")
def a_wall_that_fills_its_void(draft: Draft, rng: random.Random) -> None:
    relation = draft[rng.choice(draft.all("IFCRELVOIDSELEMENT"))]
    draft.relate("IFCRELFILLSELEMENT", relation[-1], relation[-2])


@_mutation("cycle", "refused")
def a_storey_contained_in_itself(draft: Draft, rng: random.Random) -> None:
    storey = draft.first("IFCBUILDINGSTOREY")
    draft.relate("IFCRELCONTAINEDINSPATIALSTRUCTURE", f"(#{storey})", f"#{storey}")


@_mutation("cycle")
def a_relation_in_disguise(draft: Draft, rng: random.Random) -> Content:
    one, other = rng.sample(draft.products(), 2)
    forms = [
        "#{n}=IfcRelAggregates('{n:022d}',$,$,$,#{a},(#{b}));",
        "#{n} = IFCRELAGGREGATES ( '{n:022d}' , $ , $ , $ , #{a} , ( #{b} ) ) ;",
        "#{n}=IFCRELAGGREGATES('{n:022d}',$,'a,(#1)',$,#{a},(/* ) */#{b}));",
        "#{n}=IFCRELAGGREGATES('{n:022d}',$,$,$,#0{a},(#00{b},$));",
        "#{n}=IFCRELDECOMPOSES('{n:022d}',$,$,$,#{a},(#{b}));",
        "#{n}=IFCRELADHERESTOELEMENT('{n:022d}',$,$,$,#{a},(#{b}));",
        "#{n}=IFCRELREFERENCEDINSPATIALSTRUCTURE('{n:022d}',$,$,$,(#{b}),#{a});",
        "#{n}=IFCRELDEFINESBYOBJECT('{n:022d}',$,$,$,(#{b}),#{a});",
        "#{n}=IFCRELASSIGNSTOPRODUCT('{n:022d}',$,$,$,(#{b}),$,#{a});",
    ]
    form, start = rng.choice(forms), draft.last + 1
    lines = [form.format(n=start, a=one, b=other), form.format(n=start + 1, a=other, b=one)]
    return draft.text().replace("ENDSEC;\nEND-ISO", "\n".join([*lines, "ENDSEC;\nEND-ISO"]))


@_mutation("cycle")
def any_reference_to_an_ancestor(draft: Draft, rng: random.Random) -> None:
    trail = _down(draft, rng)
    entity = next(draft[number] for number in reversed(trail) if "#" in ",".join(draft[number]))
    k = next(k for k, value in enumerate(entity) if "#" in value)
    entity[k] = _replace_one(entity[k], r"#\d+", f"#{rng.choice(trail)}", rng)


# chain

_LENGTHS: tuple[tuple[str, Promise, tuple[int, ...]], ...] = (
    ("long", "any", (50, 300)),
    ("endless", "refused", (2_000, 5_000, 30_000)),
)


def _chain(extend: Callable[[Draft, random.Random, int], None]) -> None:
    for word, promise, lengths in _LENGTHS:

        def make(draft: Draft, rng: random.Random, lengths: Sequence[int] = lengths) -> None:
            extend(draft, rng, rng.choice(lengths))

        make.__name__ = f"{word}_{extend.__name__}"
        _mutation("chain", promise)(make)


@_chain
def placements(draft: Draft, rng: random.Random, length: int) -> None:
    below = draft[rng.choice(draft.products())][6]
    axes = draft[int(below[1:])][2]
    for _ in range(length):
        below = f"#{draft.add('IFCLOCALPLACEMENT', below, axes)}"
    draft[draft.products()[0]][6] = below


@_chain
def booleans(draft: Draft, rng: random.Random, length: int) -> None:
    product = rng.choice(draft.products())
    item = other = draft.body(product)
    for _ in range(length):
        item = draft.add("IFCBOOLEANRESULT", ".UNION.", f"#{item}", f"#{other}")
    draft.set_body(product, item)


@_chain
def mapped_items(draft: Draft, rng: random.Random, length: int) -> None:
    _map_again(draft, rng.choice(draft.products()), layers=length // 3, times=1)


@_chain
def parts(draft: Draft, rng: random.Random, length: int) -> None:
    whole = rng.choice(draft.products())
    for _ in range(length):
        part = draft.add("IFCELEMENTASSEMBLY", f"'{draft.last:022d}'", *["$"] * 9)
        draft.relate("IFCRELAGGREGATES", f"#{whole}", f"(#{part})")
        whole = part


@_chain
def units(draft: Draft, rng: random.Random, length: int) -> None:
    unit = draft.add("IFCSIUNIT", "*", ".LENGTHUNIT.", "$", ".METRE.")
    for _ in range(length // 2):
        measure = draft.add("IFCMEASUREWITHUNIT", "IFCLENGTHMEASURE(1.)", f"#{unit}")
        unit = draft.add("IFCCONVERSIONBASEDUNIT", "$", ".LENGTHUNIT.", "'own'", f"#{measure}")
    _units(draft)[1] = f"(#{unit})"


# tree


@_mutation("tree", of="zoo")
def a_union_doubled(draft: Draft, rng: random.Random) -> None:
    product = rng.choice(draft.products())
    item = draft.body(product)
    for _ in range(rng.randint(14, 24)):
        item = draft.add("IFCBOOLEANRESULT", rng.choice([".UNION.", ".DIFFERENCE."]), f"#{item}", f"#{item}")
    draft.set_body(product, item)


@_mutation("tree", of="zoo")
def mapped_items_eightfold(draft: Draft, rng: random.Random) -> None:
    _map_again(draft, rng.choice(draft.products()), layers=rng.choice([3, 6, 12]), times=8)


@_mutation("tree", of="zoo")
def curves_eightfold(draft: Draft, rng: random.Random) -> None:
    curve = draft.first("IFCPOLYLINE")
    for _ in range(rng.choice([3, 6, 12])):
        segments = [draft.add("IFCCOMPOSITECURVESEGMENT", ".CONTINUOUS.", ".T.", f"#{curve}") for _ in range(8)]
        curve = draft.add("IFCCOMPOSITECURVE", listed(segments), ".F.")
    _extrude(draft, rng, curve)


@_mutation("tree", of="zoo")
def parts_with_many_wholes(draft: Draft, rng: random.Random) -> None:
    kind, nothing = "IFCELEMENTASSEMBLY", ["$"] * 9
    layers = [[draft.add(kind, f"'{draft.last:022d}'", *nothing) for _ in range(4)] for _ in range(12)]
    for upper, lower in pairwise(layers):
        for whole in upper:
            draft.relate("IFCRELAGGREGATES", f"#{whole}", listed(lower))


# header


@_mutation("header", "refused")
def a_schema_that_cannot_be_read(draft: Draft, rng: random.Random) -> None:
    long = "IFC4" + "X" * rng.choice([500, 5_000, 100_000])
    bad = [
        "",
        "IFC5",
        "IFC2X3_NOSUCH",
        "CONFIG_CONTROL_DESIGN",
        "IFC4','IFC2X3",
        "IFC4\\X\\00",
        "../IFC4",
        long,
        "%s%n",
    ]
    draft.head = re.sub(r"FILE_SCHEMA.*", lambda _: f"FILE_SCHEMA(('{rng.choice(bad)}'));", draft.head)


@_mutation("header")
def another_schema(draft: Draft, rng: random.Random) -> None:
    other = rng.choice(["IFC2X3", "IFC4", "IFC4X3", "IFC4X3_ADD2", "ifc4", " IFC4 "])
    draft.head = re.sub(r"FILE_SCHEMA.*", f"FILE_SCHEMA(('{other}'));", draft.head)


@_mutation("header", "refused")
def a_section_missing(draft: Draft, rng: random.Random) -> Content:
    return draft.text().replace(rng.choice(["ISO-10303-21;\n", "DATA;\n", "FILE_SCHEMA", "END-ISO-10303-21;\n"]), "", 1)


@_mutation("header")
def a_section_twice(draft: Draft, rng: random.Random) -> Content:
    head, _, data = draft.text().partition("DATA;\n")
    data = data.removesuffix("END-ISO-10303-21;\n")
    end = "END-ISO-10303-21;\n"
    forms = [
        f"{head}DATA;\n{data}DATA;\n{data}{end}",
        f"{head}DATA;\n{data}DATA;\nENDSEC;\n{end}",
        f"{head}{head}DATA;\n{data}{end}",
        f"{head}DATA;\n{data}{end}{head}DATA;\n{data}{end}",
        f"{head}DATA;\nDATA;\n{data}{end}",
        f"{head}DATA('a',('IFC4'));\n{data}{end}",
    ]
    return rng.choice(forms)


@_mutation("header", "same")
def an_unusual_but_legal_form(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    forms = [
        text.replace("\n", "\r\n"),
        text.replace("\n", "\r"),
        text.replace("\n", " "),
        text.replace(";\n", ";\n/* END-ISO-10303-21; #1=IFCWALL(); */\n"),
        text.replace(",", " ,\t"),
        "\xef\xbb\xbf" + text,
        text + "\n" * 5000,
        text.replace("FILE_SCHEMA", "/* FILE_SCHEMA(('IFC5')); */FILE_SCHEMA"),
        re.sub(
            r"FILE_NAME\(.*?\);", "FILE_NAME('; DATA; it''s','',(''),(''),'','','');", text, count=1, flags=re.DOTALL
        ),
    ]
    return rng.choice(forms)


@_mutation("header")
def a_header_with_a_trap(draft: Draft, rng: random.Random) -> Content:
    traps = [
        ("FILE_SCHEMA((", "FILE_SCHEMA(("),
        ("FILE_SCHEMA((", "FILE_SCHEMA((" * 2000),
        ("FILE_DESCRIPTION((", "FILE_DESCRIPTION((" + "''," * 10_000),
        ("FILE_NAME(", "FILE_NAME('" + "x" * 1_000_000 + "',"),
        ("FILE_NAME(", "FILE_NAME(" + "(" * 20_000),
        ("FILE_DESCRIPTION", "FILE_DESCRIPTIO"),
        ("HEADER;", "HEADER"),
        ("'2;1'", "'9;9'"),
        ("'2;1'", "#1"),
        ("HEADER;", "HEADER;\n" + "FILE_POPULATION('a','b',$);\n" * 10),
        ("ENDSEC;", ""),
        ("FILE_SCHEMA((", "file_schema(("),
    ]
    old, new = rng.choice(traps)
    return draft.text().replace(old, new, 1)


@_mutation("header", "refused")
def another_encoding(draft: Draft, rng: random.Random) -> Content:
    text = draft.text()
    return rng.choice(
        [text.encode("utf-16"), text.encode("utf-16-be"), text.encode("utf-32"), gzip.compress(text.encode(), mtime=0)]
    )


# string

_STRINGS = (
    *("''", "it''s", "; ENDSEC; END-ISO-10303-21;", "/* ", " */", "#1=IFCWALL();", "*", "$", "#5", "null", "NaN", " "),
    *("a\nb", "a\r\nb", "\t\x01\x1b[31m", "\x7f", "\u00e9\xff\xfe", "\u202e", "é".encode().decode("latin-1")),
    *("\\X2\\00E9\\X0\\", "\\X2\\D83DDE00\\X0\\", "\\X2\\D83D\\X0\\", "\\X4\\0001F600\\X0\\"),
    *("\\X\\E9", "\\S\\i", "\\PA\\", "C:\\\\x", "a" * 255, "x" * 70_000, '"', "`", "=1+1", "@x"),
    *("../../x", "<script>alert(1)</script>", "%s%n%x", "${HOME}", "'' OR 1=1"),
)
_BAD_STRINGS = ("\\", "\\X2\\00", "\\X2\\ZZ\\X0\\", "\\X", "\\Q\\", "\0", "a\0b")


@_mutation("string", "read")
def a_hostile_name(draft: Draft, rng: random.Random) -> None:
    for number in rng.sample(draft.products(), 3):
        draft[number][3] = f"'{rng.choice(_STRINGS)}'"


@_mutation("string")
def a_hostile_text_anywhere(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, r"^'")
    entity[k] = f"'{rng.choice(_STRINGS + _BAD_STRINGS)}'"


@_mutation("string")
def a_quote_too_many(draft: Draft, rng: random.Random) -> None:
    entity, k = _slot(draft, rng, r"^'")
    entity[k] = rng.choice([entity[k] + "'", "'" + entity[k], entity[k][:-1], entity[k] + entity[k]])


@_mutation("string", "read")
def names_that_are_stars(draft: Draft, rng: random.Random) -> None:
    for number in rng.sample(draft.products(), 5):
        draft[number][3] = "*"


@_mutation("string")
def a_storey_with_a_hostile_name(draft: Draft, rng: random.Random) -> None:
    for number in draft.all("IFCBUILDINGSTOREY", "IFCPROJECT"):
        draft[number][3] = f"'{rng.choice(_STRINGS)}'"


@_mutation("string")
def a_representation_with_a_hostile_name(draft: Draft, rng: random.Random) -> None:
    shape = draft[_pick(draft, rng, "IFCSHAPEREPRESENTATION")]
    shape[rng.choice([2, 3])] = rng.choice(
        ["'body'", "'Axis'", "'Box'", "''", "$", "*", f"'{rng.choice(_STRINGS)}'", "1"]
    )


# number


@_mutation("number")
def a_number_beyond_all(draft: Draft, rng: random.Random) -> Content:
    old = rng.choice(draft.products())
    new = rng.choice([2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**32 + old, 2**53, 2**63, 2**64 + old, 10**40, 0])
    return re.sub(rf"#{old}\b", f"#{new}", draft.text())


@_mutation("number")
def numbers_far_apart(draft: Draft, rng: random.Random) -> Content:
    offset = rng.choice([2**31 - 5000, 2**32 - 500, 2**62])
    body = draft.text().partition("DATA;")[2]
    return draft.head + "DATA;" + re.sub(r"#(\d+)", lambda found: f"#{int(found[1]) + offset}", body)


@_mutation("number")
def numbers_in_another_form(draft: Draft, rng: random.Random) -> Content:
    old = rng.choice(draft.products())
    new = rng.choice([f"#000{old}", f"# {old}", f"#+{old}", f"#-{old}", f"#{old}.", f"#{old}a", f"##{old}", f"@{old}"])
    return re.sub(rf"#{old}\b", new, draft.text())


# container


def _zip(*members: tuple[str, bytes], level: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", level) as archive:
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content, compress_type=level)
    return file.getvalue()


@_mutation("container", "same", ".ifczip")
def an_archive_of_one(draft: Draft, rng: random.Random) -> Content:
    level = rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
    name = rng.choice(["model.ifc", "MODEL.IFC", "a/b/model.ifc", "../../model.ifc", "/etc/model.ifc", "C:\\model.ifc"])
    extra = rng.choice([(), (("readme.txt", b"x"),), (("__MACOSX/._model.ifc", b"x"),)])
    return _zip((name, draft.text().encode("latin-1")), *extra, level=level)


@_mutation("container", "refused", ".ifczip")
def an_archive_of_none_or_two(draft: Draft, rng: random.Random) -> Content:
    text = draft.text().encode("latin-1")
    forms = [
        (),
        (("a.ifc", text), ("b.ifc", text)),
        (("a.ifc", text), ("A.ifc", b"")),
        (("a.txt", text),),
        (("a.ifc/", b""),),
    ]
    return _zip(*rng.choice(forms)) if rng.random() < 0.9 else _zip(("a.ifczip", _zip(("a.ifc", text))))


@_mutation("container", "any", ".ifczip")
def an_archive_with_damage(draft: Draft, rng: random.Random) -> Content:
    content = bytearray(_zip(("model.ifc", draft.text().encode("latin-1"))))
    for _ in range(rng.randint(1, 4)):
        _edit(content, rng)
    return bytes(content)


@_mutation("container", "refused", ".ifczip")
def an_archive_cut_off(draft: Draft, rng: random.Random) -> Content:
    content = _zip(("model.ifc", draft.text().encode("latin-1")))
    return content[: rng.randrange(len(content) - 1)]


@_mutation("container", "refused", ".ifczip")
def an_archive_with_a_lock(draft: Draft, rng: random.Random) -> Content:
    content = bytearray(_zip(("model.ifc", draft.text().encode("latin-1"))))
    content[content.index(b"PK\x01\x02") + 8] |= 1
    content[6] |= 1
    return bytes(content)


@_mutation("container", "refused", ".ifczip")
def a_bomb(draft: Draft, rng: random.Random) -> Content:
    content = bytearray(_zip(("model.ifc", b" " * rng.choice([70, 200]) * 2**20)))
    if rng.random() < 0.5:  # and the directory lies
        at = content.index(b"PK\x01\x02") + 24
        content[at : at + 4] = (10_000).to_bytes(4, "little")
    return bytes(content)


@_mutation("container", "refused", ".ifczip")
def an_archive_of_thousands(draft: Draft, rng: random.Random) -> Content:
    text = draft.text().encode("latin-1")
    return _zip(("model.ifc", text), *((f"{k}.txt", b"") for k in range(rng.choice([1_500, 20_000]))))


@_mutation("container", "refused")
def a_file_of_another_kind(draft: Draft, rng: random.Random) -> Content:
    bomb = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
    kinds = [
        b"",
        b"\0" * 4096,
        b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n",
        b"<!DOCTYPE html><html><body>404</body></html>",
        b'<?xml version="1.0"?><ifc:ifcXML/>',
        f'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a0 "x">{bomb}]><a>&a9;</a>'.encode(),
        b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]><a>&a;</a>',
        b"%PDF-1.7\n",
        b"\x89PNG\r\n\x1a\n",
        b"SQLite format 3\0" + b"\0" * 100,
        b"[" * 200_000,
        b"{" * 200_000,
        b"\x7fELF" + bytes(100),
        b"ISO-10303-21",
        b"ISO-10303-21;",
        b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
        rng.randbytes(5000),
    ]
    return rng.choice(kinds)


@_mutation("container", "same")
def an_archive_under_a_false_name(draft: Draft, rng: random.Random) -> Content:
    return _zip(("model.ifc", draft.text().encode("latin-1")))


@_mutation("container", "refused", ".ifczip")
def a_model_under_a_false_name(draft: Draft, rng: random.Random) -> Content:
    return draft.text()


# splice


def _other(draft: Draft, rng: random.Random) -> Draft:
    return draft_of(rng.choice([base for base in BASES if base_text(base) != draft.text()]))


@_mutation("splice")
def half_of_each(draft: Draft, rng: random.Random) -> Content:
    one, other = draft.text(), _other(draft, rng).text()
    return one[: rng.randrange(len(one))] + other[rng.randrange(len(other)) :]


@_mutation("splice")
def lines_of_another(draft: Draft, rng: random.Random) -> None:
    other = _other(draft, rng)
    for number in rng.sample(list(other.entities), 50):
        draft.entities[number] = other[number]


@_mutation("splice")
def both_with_other_numbers(draft: Draft, rng: random.Random) -> None:
    offset = draft.last + 1
    for number, parts in _other(draft, rng).entities.items():
        moved = [re.sub(r"#(\d+)", lambda found: f"#{int(found[1]) + offset}", value) for value in parts]
        draft.entities[number + offset] = moved


@_mutation("splice")
def one_line_into_another(draft: Draft, rng: random.Random) -> Content:
    lines = draft.text().splitlines(keepends=True)
    line = rng.choice(draft.lines())
    at = rng.randrange(len(lines))
    lines.insert(at, line[: rng.randrange(len(line))])
    return "".join(lines)


# bulk


@_mutation("bulk", of="zoo")
def two_hundred_openings(draft: Draft, rng: random.Random) -> None:
    relation = draft[draft.first("IFCRELVOIDSELEMENT")]
    void = draft[int(relation[-1][1:])]
    for k in range(200):
        number = draft.add(*void)
        draft[number][1] = f"'{k:021d}V'"
        draft.relate("IFCRELVOIDSELEMENT", relation[-2], f"#{number}")


@_mutation("bulk", of="zoo")
def two_thousand_walls(draft: Draft, rng: random.Random) -> None:
    wall = draft[rng.choice(draft.products())]
    for k in range(2000):
        draft[draft.add(*wall)][1] = f"'{k:021d}W'"


@_mutation("bulk", "read")
def ten_megabytes_of_text(draft: Draft, rng: random.Random) -> None:
    draft[draft.products()[0]][4] = f"'{'x' * 10_000_000}'"


@_mutation("bulk", of="zoo")
def an_outline_of_fifty_thousand_points(draft: Draft, rng: random.Random) -> None:
    numbers = [draft.add("IFCCARTESIANPOINT", f"({k % 251}.{k},{k % 83}.)") for k in range(50_000)]
    _extrude(draft, rng, draft.add("IFCPOLYLINE", listed([*numbers, numbers[0]])))


@_mutation("bulk", of="zoo")
def a_hundred_thousand_entities(draft: Draft, rng: random.Random) -> None:
    for _ in range(100_000):
        draft.add("IFCPROPERTYSINGLEVALUE", "'a'", "$", "IFCREAL(1.)", "$")


@_mutation("bulk", of="zoo")
def thirty_thousand_bad_triangles(draft: Draft, rng: random.Random) -> None:
    corners = ",".join(f"({rng.random():.3f},{rng.random():.3f},{rng.random():.3f})" for _ in range(1000))
    faces = ",".join(f"({rng.randint(1, 1000)},{rng.randint(1, 1000)},{rng.randint(1, 1000)})" for _ in range(30_000))
    points = draft.add("IFCCARTESIANPOINTLIST3D", f"({corners})")
    draft.set_body(
        rng.choice(draft.products()), draft.add("IFCTRIANGULATEDFACESET", f"#{points}", "$", ".T.", f"({faces})", "$")
    )


# cruel: nothing of it is forbidden


@_mutation("cruel", "read")
def a_mirrored_placement(draft: Draft, rng: random.Random) -> None:
    origin = draft.add("IFCCARTESIANPOINT", "(0.,0.,0.)")
    mirror = draft.add("IFCDIRECTION", "(-1.,0.,0.)")
    target = draft.add("IFCCARTESIANTRANSFORMATIONOPERATOR3D", f"#{mirror}", "$", f"#{origin}", "-1.", "$")
    for number in draft.all("IFCMAPPEDITEM"):
        draft[number][2] = f"#{target}"


@_mutation("cruel", "read")
def storeys_at_one_height(draft: Draft, rng: random.Random) -> None:
    [first, *_] = draft.all("IFCBUILDINGSTOREY")
    copies = [draft.add(*draft[first]) for _ in range(3)]
    for number in copies:
        draft[number][1] = f"'{number:022d}'"
        draft[number][-1] = rng.choice(["0.", "-1.E-9", "$", draft[first][-1]])
    draft.relate("IFCRELAGGREGATES", f"#{draft.first('IFCBUILDING')}", listed(copies))


@_mutation("cruel", "read")
def far_from_the_origin(draft: Draft, rng: random.Random) -> None:
    point = draft.add("IFCCARTESIANPOINT", f"({rng.choice([1e5, 5e6, -4.5e7]):.1f},{rng.choice([1e5, 5e6]):.1f},0.)")
    axes = draft.add("IFCAXIS2PLACEMENT3D", f"#{point}", "$", "$")
    for number in draft.all("IFCLOCALPLACEMENT"):
        if draft[number][1] == "$":
            draft[number][2] = f"#{axes}"


@_mutation("cruel", "read")
def true_north_turned(draft: Draft, rng: random.Random) -> None:
    north = draft.add("IFCDIRECTION", "(0.6,0.8)")
    for number in draft.all("IFCGEOMETRICREPRESENTATIONCONTEXT"):
        draft[number][6] = f"#{north}"


@_mutation("cruel", "read")
def elements_in_no_storey(draft: Draft, rng: random.Random) -> None:
    for number in draft.all("IFCRELCONTAINED*"):
        del draft.entities[number]


@_mutation("cruel", "read")
def no_storey_at_all(draft: Draft, rng: random.Random) -> None:
    storeys = draft.all("IFCBUILDINGSTOREY")
    for number in [*storeys, *draft.all("IFCRELCONTAINED*", "IFCRELAGGREGATES")]:
        del draft.entities[number]


@_mutation("cruel", "read")
def every_thing_twice(draft: Draft, rng: random.Random) -> None:
    for number in draft.products():
        copy = draft.add(*draft[number])
        draft[copy][1] = f"'{copy:022d}'"


@_mutation("cruel", "read")
def thin_and_thick(draft: Draft, rng: random.Random) -> None:
    for number in draft.all("IFCRECTANGLEPROFILEDEF"):
        draft[number][rng.choice([4, 5])] = rng.choice(["0.001", "0.00001", "50."])


@_mutation("cruel", "read")
def an_opening_larger_than_its_wall(draft: Draft, rng: random.Random) -> None:
    relation = draft[rng.choice(draft.all("IFCRELVOIDSELEMENT"))]
    void, host = (int(reference[1:]) for reference in (relation[-1], relation[-2]))
    draft[void][7] = draft[host][7]
    draft[void][6] = draft[host][6]


@_mutation("cruel", "read")
def one_opening_in_many_walls(draft: Draft, rng: random.Random) -> None:
    void = draft[draft.first("IFCRELVOIDSELEMENT")][-1]
    for wall in draft.all("IFCWALL"):
        draft.relate("IFCRELVOIDSELEMENT", f"#{wall}", void)


@_mutation("cruel", "read")
def two_containers_and_two_wholes(draft: Draft, rng: random.Random) -> None:
    things = [number for number in draft.products() if draft[number][0] in ("IFCFURNITURE", "IFCFURNISHINGELEMENT")]
    one, other, part = rng.sample(things, 3)
    storey = draft.all("IFCBUILDINGSTOREY")[-1]
    draft.relate("IFCRELCONTAINEDINSPATIALSTRUCTURE", f"(#{part},#{part})", f"#{storey}")
    for whole in (one, other):
        draft.relate("IFCRELAGGREGATES", f"#{whole}", f"(#{part})")


@_mutation("cruel", "read")
def doors_without_size(draft: Draft, rng: random.Random) -> None:
    for number in (n for n in draft.products() if draft[n][0] == "IFCDOOR"):
        draft[number][9:11] = [rng.choice(["$", "0.", "-1.", "1.E30"])] * 2


@_mutation("cruel", "read")
def many_contexts(draft: Draft, rng: random.Random) -> None:
    shapes = draft.all("IFCSHAPEREPRESENTATION")
    for number in shapes:
        context = int(draft[number][1][1:])
        draft[number][1] = f"#{draft.add(*draft[context])}"


@_mutation("cruel", "read")
def bodies_that_are_empty(draft: Draft, rng: random.Random) -> None:
    for number in rng.sample(draft.products(), 2):
        draft[int(draft[number][7][1:])][3] = "()"
