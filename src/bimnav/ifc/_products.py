"""Which products have a body, who they are, and what the file says belongs together."""

from __future__ import annotations

import re
import uuid
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import ifcopenshell.guid

from bimnav.ifc._kernel import Entity, File

__all__ = [
    "BodyFinder",
    "Relations",
    "derived_id",
    "identify",
    "is_body",
    "left_out_by_class",
    "open_circles",
    "sanitize",
    "sorted_of",
]

_RULES = {
    "annotation": ("IfcAnnotation",),
    "grid": ("IfcGrid",),
    "port": ("IfcPort",),
    "site": ("IfcSite",),
    "spatial-structure": (
        "IfcBuilding",
        "IfcBuildingStorey",
        "IfcExternalSpatialStructureElement",
        "IfcFacility",
        "IfcFacilityPart",
        "IfcSpatialZone",
    ),
    "virtual-element": ("IfcVirtualElement",),
    "structural-analysis": ("IfcStructuralActivity", "IfcStructuralItem"),
    "alignment": ("IfcLinearElement", "IfcPositioningElement"),
    "surface-feature": ("IfcSurfaceFeature",),
}
_NO_BODY = frozenset(
    [
        "annotation",
        "axis",
        "boundary",
        "box",
        "clearance",
        "cog",
        "footprint",
        "lighting",
        "plan",
        "profile",
        "reference",
        "surveypoints",
        "walkingline",
    ]
)
_SOLIDS = (
    "IfcSolidModel",
    "IfcBooleanResult",
    "IfcTessellatedItem",
    "IfcFaceBasedSurfaceModel",
    "IfcShellBasedSurfaceModel",
    "IfcCsgPrimitive3D",
    "IfcSurface",
    "IfcSectionedSpine",
)
_GLOBAL_ID = re.compile(r"[0-9A-Za-z_$]{22}")


def sorted_of(file: File, *classes: str) -> list[Entity]:
    """Return all instances of classes in the order of their step ids; none of a class the schema lacks."""
    found: dict[int, Entity] = {}
    for name in classes:
        try:
            found |= {entity.id(): entity for entity in file.by_type(name)}
        except RuntimeError:  # the schema has no such class
            continue
    return [found[key] for key in sorted(found)]


def sanitize(products: Iterable[Entity]) -> list[Entity]:
    """Empty the text attributes that are written as `*`; return the products that had any.

    Renga writes them so; the geometry kernel then drops the product without a word.
    """
    starred = []
    for product in products:
        if "*" not in str(product):
            continue
        stars = [name for name in ("Name", "Description", "ObjectType", "Tag") if getattr(product, name, "") is None]
        for name in stars:
            setattr(product, name, None)
        if stars:
            starred.append(product)
    return starred


def derived_id(text: str) -> str:
    """Return the GlobalId that follows from a text: the same in every run."""
    return str(ifcopenshell.guid.compress(uuid.uuid5(uuid.NAMESPACE_OID, f"bimnav {text}").hex))


def identify(products: Sequence[Entity]) -> tuple[dict[int, str], list[int]]:
    """Give every product a GlobalId of its own.

    The first product keeps an id that several share; the others, and those whose id is not 22 characters
    of the IFC alphabet, get one that follows from their class and step id.

    Returns
    -------
    ids
        Step id to GlobalId.
    renamed
        Step ids of the products that got another GlobalId than the file gives.
    """
    ids: dict[int, str] = {}
    for product in products:
        written = str(product.GlobalId)
        if _GLOBAL_ID.fullmatch(written):
            ids.setdefault(product.id(), written)
    first: dict[str, int] = {}
    for step_id, written in ids.items():
        first.setdefault(written, step_id)
    renamed = []
    for product in products:
        step_id = product.id()
        if first.get(ids.get(step_id, "")) == step_id:
            continue
        text = f"{product.is_a()} #{step_id}"
        while (new := derived_id(text)) in first:
            text += "'"
        first[new] = step_id
        ids[step_id] = new
        renamed.append(step_id)
    return ids, renamed


def left_out_by_class(file: File) -> dict[int, str]:
    """Return step id to rule of all products whose class is no part of the building's body."""
    rules: dict[int, str] = {}
    for rule, classes in _RULES.items():
        for product in sorted_of(file, *classes):
            rules.setdefault(product.id(), rule)
    for product in sorted_of(file, "IfcGeographicElement"):
        if product.PredefinedType == "TERRAIN":
            rules.setdefault(product.id(), "terrain")
    return rules


def is_body(identifier: str | None) -> bool:
    """Tell whether a representation of this name is a body, as opposed to an axis, a box or a plan symbol."""
    return (identifier or "").casefold() not in _NO_BODY


class BodyFinder:
    """Finds what the bodies of products consist of; a mapped representation is looked into once."""

    def __init__(self) -> None:
        self._mapped: dict[int, list[Entity]] = {}
        self._is_solid: dict[str, bool] = {}  # by class: `is_a` is too slow to ask for every item

    def solids_of(self, product: Entity) -> tuple[list[Entity], set[int]]:
        """Return the solids and surfaces of a product's bodies, and the step ids of the contexts they are in."""
        solids: list[Entity] = []
        contexts: set[int] = set()
        for representation in product.Representation.Representations if product.Representation else ():
            if is_body(representation.RepresentationIdentifier):
                found = list(self._solid_items(representation))
                solids += found
                if found and representation.ContextOfItems is not None:
                    contexts.add(representation.ContextOfItems.id())
        return solids, contexts

    def _solid_items(self, representation: Entity) -> Iterator[Entity]:
        for item in representation.Items or ():
            name = item.is_a()
            if name == "IfcMappedItem":
                source = item.MappingSource.MappedRepresentation
                if source.id() not in self._mapped:
                    self._mapped[source.id()] = list(self._solid_items(source))
                yield from self._mapped[source.id()]
                continue
            if name not in self._is_solid:
                self._is_solid[name] = any(item.is_a(solid) for solid in _SOLIDS)
            if self._is_solid[name]:
                yield item


@dataclass(slots=True)
class Relations:
    """What the file says belongs together, by step id; of two statements the first in the file holds.

    Parameters
    ----------
    container
        Product to the storey, space, building or site that contains it.
    whole
        Part to the whole it is aggregated or nested in; spaces and storeys too.
    voids
        Opening to the element it cuts.
    fills
        Door or window to the opening it fills.
    kind
        Product to its type object.
    parts
        Whole to its parts.
    circular
        Relations, with the product, that would make a product a part of itself; they do not count.
    """

    container: dict[int, int] = field(default_factory=dict)
    whole: dict[int, int] = field(default_factory=dict)
    voids: dict[int, int] = field(default_factory=dict)
    fills: dict[int, int] = field(default_factory=dict)
    kind: dict[int, Entity] = field(default_factory=dict)
    parts: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    circular: list[tuple[Entity, Entity]] = field(default_factory=list)
    _up: dict[int, set[int]] = field(default_factory=lambda: defaultdict(set))

    @classmethod
    def of(cls, file: File) -> Relations:
        """Read the relations of a file."""
        self = cls()
        for relation in sorted_of(file, "IfcRelContainedInSpatialStructure"):
            self._join(self.container, relation, relation.RelatedElements, relation.RelatingStructure)
        for name in ("IfcRelAggregates", "IfcRelNests"):
            for relation in sorted_of(file, name):
                self._join(self.whole, relation, relation.RelatedObjects, relation.RelatingObject)
        for relation in sorted_of(file, "IfcRelVoidsElement"):
            self._join(self.voids, relation, [relation.RelatedOpeningElement], relation.RelatingBuildingElement)
        for relation in sorted_of(file, "IfcRelFillsElement"):
            self._join(self.fills, relation, [relation.RelatedBuildingElement], relation.RelatingOpeningElement)
        for relation in sorted_of(file, "IfcRelDefinesByType"):
            for product in relation.RelatedObjects or ():
                if relation.RelatingType is not None:
                    self.kind.setdefault(product.id(), relation.RelatingType)
        for part in sorted(self.whole):
            self.parts[self.whole[part]].append(part)
        return self

    def _join(self, into: dict[int, int], relation: Entity, many: Iterable[Entity] | None, one: Entity | None) -> None:
        if one is None:
            return
        above = self._all_above(one.id())
        for each in many or ():
            if each is None:
                continue
            if each.id() in above:
                self.circular.append((relation, each))
                continue
            self._up[each.id()].add(one.id())
            into.setdefault(each.id(), one.id())

    def _all_above(self, step_id: int) -> set[int]:
        seen, waiting = set(), [step_id]
        while waiting:
            current = waiting.pop()
            if current not in seen:
                seen.add(current)
                waiting += self._up.get(current, ())
        return seen

    def above(self, step_id: int) -> Iterator[int]:
        """Yield what holds a product, from the nearest to the farthest: wholes, hosts, spaces, storeys."""
        ways = (self.container, self.whole, self.fills, self.voids)
        while held_by := next((way[step_id] for way in ways if step_id in way), None):
            yield held_by
            step_id = held_by

    def wholes(self, step_id: int) -> Iterator[int]:
        """Yield the whole of a part, the whole of that, and so on."""
        while whole := self.whole.get(step_id):
            yield whole
            step_id = whole

    def below(self, step_id: int) -> Iterator[int]:
        """Yield the parts of a whole, their parts, and so on."""
        for part in self.parts.get(step_id, ()):
            yield part
            yield from self.below(part)

    def openings_of(self) -> dict[int, list[int]]:
        """Return the openings that cut each element: its own, and those of the wholes it is a part of."""
        own: dict[int, list[int]] = defaultdict(list)
        for opening, host in sorted(self.voids.items()):
            own[host].append(opening)
        cut = {host: list(openings) for host, openings in own.items()}
        for host in sorted(own):
            for part in self.below(host):
                cut.setdefault(part, []).extend(own[host])
        return cut


def open_circles(file: File, circular: Iterable[tuple[Entity, Entity]]) -> list[int]:
    """Take products out of the relations that make them their own whole; the kernel would walk round for ever.

    Returns
    -------
    step_ids
        The products taken out.
    """
    taken = []
    removed: set[int] = set()
    for relation, product in circular:
        if relation.id() in removed:
            continue
        taken.append(product.id())
        name = next((name for name in ("RelatedObjects", "RelatedElements") if hasattr(relation, name)), "")
        if others := [other for other in getattr(relation, name, ()) if other != product]:
            setattr(relation, name, others)
        else:
            removed.add(relation.id())
            file.remove(relation)
    return taken
