"""What the file says belongs together: parts and wholes, rooms and what is in them, openings and their hosts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from ifcopenshell import entity_instance

from bimnav.ifc._kernel import Entity, File
from bimnav.ifc._products import sorted_of

__all__ = ["Relations", "open_circles"]

_INSTANCE: Any = entity_instance


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
    malformed
        Step ids of relations that join something else than entities; what they say of it does not count.
    """

    container: dict[int, int] = field(default_factory=dict)
    whole: dict[int, int] = field(default_factory=dict)
    voids: dict[int, int] = field(default_factory=dict)
    fills: dict[int, int] = field(default_factory=dict)
    kind: dict[int, Entity] = field(default_factory=dict)
    parts: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    circular: list[tuple[Entity, Entity]] = field(default_factory=list)
    malformed: list[int] = field(default_factory=list)
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
            self._join(self.voids, relation, (relation.RelatedOpeningElement,), relation.RelatingBuildingElement)
        for relation in sorted_of(file, "IfcRelFillsElement"):
            self._join(self.fills, relation, (relation.RelatedBuildingElement,), relation.RelatingOpeningElement)
        for relation in sorted_of(file, "IfcRelDefinesByType"):
            kind = relation.RelatingType
            for product in self._entities(relation, relation.RelatedObjects):
                if isinstance(kind, _INSTANCE) and kind.is_a("IfcTypeObject"):
                    self.kind.setdefault(product.id(), kind)
        for part in sorted(self.whole):
            self.parts[self.whole[part]].append(part)
        return self

    def _join(self, into: dict[int, int], relation: Entity, many: object, one: object) -> None:
        if not (ones := self._entities(relation, (one,))):
            return
        whole = ones[0].id()
        above = self._all_above(whole)
        for each in self._entities(relation, many):
            if each.id() in above:
                self.circular.append((relation, each))
                continue
            self._up[each.id()].add(whole)
            into.setdefault(each.id(), whole)

    def _entities(self, relation: Entity, values: object) -> list[Entity]:
        """Return what a relation joins; a damaged one may hold texts and numbers."""
        found = [each for each in values if isinstance(each, _INSTANCE)] if isinstance(values, tuple) else []
        if not isinstance(values, tuple) or len(found) < len(values):
            self.malformed.append(relation.id())
        return found

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
        waiting = list(self.parts.get(step_id, ()))
        while waiting:
            part = waiting.pop()
            yield part
            waiting += self.parts.get(part, ())

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
