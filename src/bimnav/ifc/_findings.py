"""What was lost or looks wrong in a model, folded to one issue of each kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from bimnav._placeholders import is_placeholder
from bimnav._wording import counted

if TYPE_CHECKING:
    from bimnav.ifc._geometry import Geometry
    from bimnav.ifc._kernel import Entity

__all__ = ["Findings"]

Row = dict[str, Any]

_LEVEL_GAP = 1.0  # metres; storeys closer than this are levels of construction, not floors one above the other
_HEADROOM = 0.1  # metres; a building with storeys is higher
_EXAMPLES = 3
_DESCRIBING = {"Name": "name", "LongName": "long name", "Description": "description", "Phase": "phase"}


class Findings:
    """Collects issues as rows of a `Model`.

    Parameters
    ----------
    ids
        Step id to GlobalId, of all products.
    """

    def __init__(self, ids: Mapping[int, str]) -> None:
        self._ids = ids
        self.rows: list[Row] = []

    def add(
        self,
        code: str,
        message: str,
        found: Iterable[int | str] | None = None,
        *,
        detail: str = "",
        severity: str = "warning",
        hint: str = "",
    ) -> None:
        """Note one issue, its message as of `counted` and then the detail; if nothing is found there is none."""
        global_ids = [self._ids[each] if isinstance(each, int) else each for each in found or ()]
        if found is not None and not global_ids:
            return
        self.rows.append(
            {
                "code": code,
                "message": counted(message, len(global_ids)) + detail,
                "global_ids": global_ids,
                "severity": severity,
                "hint": hint,
            }
        )

    def about_file(
        self,
        renamed: Sequence[int],
        starred: Sequence[Entity],
        circular: Sequence[int],
        malformed: Sequence[int],
        log: Any,
    ) -> None:
        """Note what is wrong with identities, text and relations, and what the parser said."""
        self.add(
            "bad-global-id",
            "{n} [GlobalId is|GlobalIds are] empty, malformed or taken; the products got new ones, listed here.",
            renamed,
            hint="Repair the GlobalIds in the authoring tool; otherwise other files cannot refer to these products.",
        )
        self.add(
            "star-attributes",
            "{n} [product has|products have] names or tags written as *; they were read as empty.",
            [product.id() for product in starred],
            severity="info",
        )
        self.add(
            "part-of-itself",
            "{n} [product is a part|products are parts] of its own parts; the last such statement was dropped.",
            dict.fromkeys(circular),
            hint="Repair the aggregation in the authoring tool.",
        )
        if malformed:
            steps = ", ".join(f"#{step_id}" for step_id in [*dict.fromkeys(malformed)][:_EXAMPLES])
            self.add(
                "malformed-relation",
                f"relations join something else than entities ({steps}); what they say of it was left out.",
                hint="The file may be damaged; export it again.",
            )
        said = [message for message in (log.log_messages() if log else ()) if message.severity >= log.LOG_ERROR]
        errors = [" ".join(str(message.message).split()) for message in said]
        if errors:
            self.add(
                "parser-log",
                counted("{n} [statement|statements] of the file could not be understood: ", len(errors))
                + f"{_fold(errors)}.",
                hint="The file may be damaged; export it again.",
            )

    def about_description(self, described: Iterable[Entity]) -> None:
        """Note where projects, sites and buildings are described by words that say nothing."""
        found = {entity.id(): list(_empty_words(entity)) for entity in described}
        words = dict.fromkeys(word for words in found.values() for word in words)
        if words:
            self.add(
                "placeholder-name",
                f"project, site or building are described by placeholders: {', '.join(words)}.",
                severity="info",
                hint="Fill them in in the authoring tool; reports and task lists show them.",
            )

    def about_geometry(self, geometry: Geometry, lost: Mapping[int, str], left_out: Mapping[int, str]) -> None:
        """Note which bodies are missing or doubtful."""
        self.add(
            "lost-shape",
            "the geometry of {n} [product|products] could not be read, or not all of it",
            lost,
            detail=f": {_fold(lost.values())}.",
            severity="error",
            hint="Export these products with simpler geometry; what is missing blocks nothing.",
        )
        self.add(
            "flawed-shape",
            "{n} [product was|products were] read although the geometry kernel complained",
            geometry.flawed,
            detail=f": {_fold(error for errors in geometry.flawed.values() for error in dict.fromkeys(errors))}.",
            hint="Faces may be missing; look at these products.",
        )
        self.add(
            "open-shape",
            "{n} [body does|bodies do] not close and [blocks|block] what [its|their] faces cover, seen from above.",
            [step_id for step_id in geometry.shapes if geometry.is_open(step_id) and step_id not in left_out],
            severity="info",
        )
        self.add(
            "opening-not-cut",
            "the openings of {n} [product|products] could not be subtracted; their doorways may look closed.",
            geometry.uncut,
            hint="Doors are passable all the same; passages without a door are not.",
        )
        self.add(
            "eaten-by-openings",
            "{n} [product|products] of which the openings leave nothing.",
            geometry.eaten,
            severity="info",
        )
        self.add(
            "no-body",
            "{n} [product has|products have] a representation, but no body: only an axis, a box or a plan symbol.",
            [step_id for step_id, rule in left_out.items() if rule == "no-body"],
            severity="info",
        )

    def about_terrain(self, skipped: Iterable[int], geometry: Geometry, left_out: Mapping[int, str]) -> None:
        """Note which surfaces of the ground could not be read; `skipped` are those that crashed the kernel."""
        self.add(
            "terrain-not-read",
            "the surface of {n} [site|sites] could not be read, or not all of it.",
            sorted({*skipped, *(geometry.lost.keys() & left_out.keys())}),
            severity="info",
            hint="It matters only with outdoors=True.",
        )

    def about_storeys(self, storeys: Sequence[Row], elements: Sequence[Row], spaces: Sequence[Row]) -> None:
        """Note storeys that hold nothing or are only levels, and what lies outside all of them."""
        holding = {row["storey"] for row in (*elements, *spaces)}
        self.add(
            "empty-storey",
            "{n} [storey holds|storeys hold] nothing.",
            [row["global_id"] for row in storeys if row["global_id"] not in holding],
            severity="info",
            hint="They may be levels of reference; their floors come from rooms and slabs, if any.",
        )
        span = storeys[-1]["elevation"] - storeys[0]["elevation"]
        if 0 < span < _HEADROOM:
            self.add(
                "doubtful-unit",
                f"all {len(storeys)} storeys lie within {span:.3g} m: the file may state a wrong length unit.",
                hint="Compare a known length in the authoring tool.",
            )
        close = [
            (lower, upper)
            for lower, upper in pairwise(storeys)
            if upper["elevation"] - lower["elevation"] < _LEVEL_GAP and not 0 < span < _HEADROOM
        ]
        pairs = ", ".join(f"{lower['name']} and {upper['name']}" for lower, upper in close[:_EXAMPLES])
        self.add(
            "level-storey",
            "{n} storeys lie less than a metre apart",
            dict.fromkeys(row["global_id"] for pair in close for row in pair),
            detail=f": {pairs}.",
            severity="info",
            hint="They may be split levels or levels of construction.",
        )
        self.add(
            "outside-storeys",
            "{n} [element belongs|elements belong] to no storey.",
            [row["global_id"] for row in elements if row["storey"] is None and row["shapes"]],
            severity="info",
            hint="They are sorted by their geometry; assign them to storeys in the authoring tool.",
        )

    def about_contents(
        self, elements: Sequence[Row], spaces: Sequence[Row], doors: Sequence[Row], without: Iterable[str]
    ) -> None:
        """Note what a robot would miss: rooms, slabs, openings, and the shapes of elements."""
        shaped = {row["global_id"] for row in elements if row["shapes"]}
        present = shaped | {row["parent"] for row in elements}
        self.add(
            "no-shape",
            "{n} [element has|elements have] neither geometry nor parts, and [blocks|block] nothing.",
            [row["global_id"] for row in elements if row["global_id"] not in present],
            severity="info",
        )
        if shaped:
            self._about_floor(elements, spaces)
        else:
            self.add("no-geometry", "the file has no element with geometry.", hint="Join it to a file that has.")
        self.add(
            "space-without-shape",
            "{n} [room has|rooms have] no geometry.",
            [row["global_id"] for row in spaces if not row["shapes"]],
            hint="Export the bodies of rooms.",
        )
        self.add(
            "door-without-opening",
            "{n} [door fills|doors fill] no opening.",
            [row["global_id"] for row in doors if row["opening"] is None and row["global_id"] in shaped],
            severity="info",
            hint="Their own outline is taken as the doorway.",
        )
        self.add(
            "connector-without-shape",
            "{n} [stair, ramp or lift|stairs, ramps or lifts] without geometry [connects|connect] nothing.",
            without,
        )

    def _about_floor(self, elements: Sequence[Row], spaces: Sequence[Row]) -> None:
        slabs = [row for row in elements if row["ifc_class"].startswith("IfcSlab") and row["shapes"]]
        has_slabs = any(row["predefined_type"] not in ("LANDING", "ROOF") for row in slabs)
        has_rooms = any(row["shapes"] for row in spaces)
        source = "rooms" if has_rooms else "slabs" if has_slabs else "walls, which is a guess"
        if not spaces:
            hint = f"Export rooms; until then the floor is taken from {source}."
            self.add("no-spaces", "the file has no rooms (IfcSpace).", hint=hint)
        if not has_slabs:
            severity = "info" if has_rooms else "warning"
            self.add(
                "no-slabs", "the file has no floor slab.", severity=severity, hint=f"Floor is taken from {source}."
            )


def _empty_words(entity: Entity) -> Iterator[str]:
    kind = str(entity.is_a()).removeprefix("Ifc").lower()
    for name, word in _DESCRIBING.items():
        if is_placeholder(name, value := getattr(entity, name, None)):
            yield f"{kind} {word} {value!r}"
    address = getattr(entity, f"{kind.title()}Address", None)
    lines = getattr(address, "AddressLines", None)
    values = [*(lines if isinstance(lines, tuple) else ()), *(getattr(address, n, None) for n in ("Town", "Country"))]
    yield from (f"{kind} address {value!r}" for value in values if is_placeholder("address", value))


def _fold(messages: Iterable[str]) -> str:
    """Put equal messages together and name the most frequent."""
    common = Counter(message.rstrip(" :.")[:120] for message in messages).most_common()
    folded = [f"{message} ({count}x)" if count > 1 else message for message, count in common]
    return "; ".join(folded[:_EXAMPLES]) + (f"; and {len(folded) - _EXAMPLES} more" if len(folded) > _EXAMPLES else "")
