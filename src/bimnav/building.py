"""The building as values: storeys, spaces, elements, doors, in metres and world coordinates.

Everything after this module works on a `Building` written by hand as well as on one read from IFC.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._shapes import Mesh, Shape, bounds_of
from bimnav.detections import Detection
from bimnav.errors import ModelError, ValueRangeError

if TYPE_CHECKING:
    from bimnav._connectors import Ascent
    from bimnav._georeference import Georeference
    from bimnav.assets import Asset
    from bimnav.readiness import Readiness
    from bimnav.robot import Robot

__all__ = [
    "Building",
    "Classification",
    "Connector",
    "Detection",
    "Door",
    "Element",
    "Facts",
    "Issue",
    "Ledger",
    "Mesh",
    "Opening",
    "Shape",
    "Space",
    "Storey",
]


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """A product of the model: a wall, a chair, a valve.

    Parameters
    ----------
    global_id
        Its IFC GlobalId; its identity from the file to the last log entry.
    ifc_class
        Such as `IfcFurniture`.
    name, type_name, object_type, predefined_type, tag
        As the file says; empty where it says nothing.
    storey, space, parent
        GlobalIds of what the file says contains it, or None. Containers lie: what an element
        blocks is decided by its geometry.
    shapes
        Its solids, openings already subtracted. Empty if it has no geometry.
    """

    global_id: str
    ifc_class: str
    name: str = ""
    type_name: str = ""
    object_type: str = ""
    predefined_type: str = ""
    tag: str = ""
    storey: str | None = None
    space: str | None = None
    parent: str | None = None
    shapes: tuple[Shape, ...] = field(default=(), repr=False)

    @property
    def family(self) -> str:
        """The part of the name before the first colon: the family in models from Revit."""
        return self.name.split(":", 1)[0].strip()

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """Lowest and highest world coordinates, (2, 3) metres; None without geometry."""
        return bounds_of(self.shapes)


@dataclass(frozen=True, slots=True, eq=False)
class Storey:
    """A storey; `elevation` is the world height of its placement in metres."""

    global_id: str
    name: str
    elevation: float


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """A room; `storey` is the GlobalId of its storey, or None.

    It answers to the same descriptive names as an element, so that rules can pick rooms too.
    """

    global_id: str
    name: str
    long_name: str = ""
    storey: str | None = None
    shapes: tuple[Shape, ...] = field(default=(), repr=False)
    type_name: str = ""
    object_type: str = ""
    predefined_type: str = ""
    tag: str = ""
    ifc_class: str = "IfcSpace"

    @property
    def family(self) -> str:
        """The name by which rules know a room: its long name, if it has one."""
        return self.long_name or self.name

    @property
    def label(self) -> str:
        """Number and name, whichever the file gives."""
        if self.long_name and self.long_name not in self.name:
            return f"{self.name} {self.long_name}".strip()
        return self.name or self.global_id

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """Lowest and highest world coordinates, (2, 3) metres; None without geometry."""
        return bounds_of(self.shapes)


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """A void in a wall or slab.

    Parameters
    ----------
    host
        GlobalId of the element it cuts.
    fillings
        GlobalIds of the doors or windows that fill it; empty for a passage.
    """

    global_id: str
    host: str | None = None
    fillings: tuple[str, ...] = ()
    shapes: tuple[Shape, ...] = field(default=(), repr=False)

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """Lowest and highest world coordinates, (2, 3) metres; None without geometry."""
        return bounds_of(self.shapes)


@dataclass(frozen=True, slots=True, eq=False)
class Door:
    """A door: passable because it is one, whatever its leaf looks like.

    Parameters
    ----------
    element
        The door's element.
    opening
        The void it fills; None for a door in a curtain wall.
    width, height
        Overall size in metres as the file says; None where it says nothing.
    clear_width
        Width in metres measured on the opening, else on the leaf, else as the file says.
    sill
        How far, in metres, the bottom of the opening lies above the lower floor at its sides; 0 where it
        reaches the floor. None if nothing tells where the floor is.
    spaces
        GlobalIds of the rooms at its sides: two for an inner door, the same twice for one within a room,
        one for a door to the outside.
    to_outside
        Whether there is a room at one side only, and the door lies near the lowest of those of which that is
        true: it leads to the ground outside, as far as geometry tells, and not to a balcony.

    A building measures what its doors leave open.
    """

    element: Element
    opening: Opening | None = None
    width: float | None = None
    height: float | None = None
    clear_width: float | None = None
    sill: float | None = None
    spaces: tuple[str, ...] = ()
    to_outside: bool = False

    @property
    def global_id(self) -> str:
        """GlobalId of the door."""
        return self.element.global_id

    @property
    def name(self) -> str:
        """Name of the door."""
        return self.element.name


@dataclass(frozen=True, slots=True, eq=False)
class Connector:
    """A stair, ramp or lift.

    Parameters
    ----------
    kind
        `stair`, `ramp` or `lift`.
    parts
        GlobalIds of the elements that make it up.
    low, high
        World height of its lower and upper end in metres.
    """

    global_id: str
    name: str
    kind: Literal["stair", "ramp", "lift"]
    parts: tuple[str, ...]
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Issue:
    """Something that was lost, or looks wrong, in a model.

    Parameters
    ----------
    code
        A stable word to search for, such as `lost-shape`.
    message
        What was found, with the value.
    global_ids
        The elements concerned.
    severity
        `error`: something was lost. `warning`: the answer may be worse than asked. `info`: worth knowing.
    hint
        How to repair it.
    """

    code: str
    message: str
    global_ids: tuple[str, ...] = ()
    severity: Literal["error", "warning", "info"] = "warning"
    hint: str = ""


@dataclass(frozen=True, slots=True)
class Ledger:
    """Where every product of the file went; nothing is lost in silence.

    Parameters
    ----------
    asked
        GlobalIds of all products that have a representation.
    left_out
        GlobalId to the named rule that left it out.
    lost
        GlobalId to the reason why its geometry could not be had.
    lost_bounds
        GlobalId to a box, (2, 3) metres, that holds what was lost, where the file tells.
    """

    asked: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    lost: Mapping[str, str] = field(default_factory=dict)
    lost_bounds: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def read(self) -> tuple[str, ...]:
        """GlobalIds of the products whose geometry was read."""
        return tuple(g for g in self.asked if g not in self.left_out and g not in self.lost)


@dataclass(frozen=True, slots=True)
class Classification:
    """What a product is in a classification system.

    Parameters
    ----------
    system
        As the file names it, such as `Uniformat`; empty where it does not.
    code
        As the file writes it, such as `23-40 20 14 17 24: Coffee Tables`.
    title
        In words; empty where there are none.
    """

    system: str
    code: str
    title: str = ""


@dataclass(frozen=True, slots=True)
class Facts:
    """What a model says of a product beside its names and its geometry.

    Parameters
    ----------
    properties
        Property sets of the product itself, `{set: {property: value}}`, as the file writes them.
    type_properties
        Property sets of its type.
    classifications
        References of the product, then those of its type.
    systems
        Names of the systems it belongs to: name, long name, object type and predefined type of each.
    """

    properties: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    type_properties: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    classifications: tuple[Classification, ...] = ()
    systems: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Building:
    """A building: what one or several models say, as values in SI units.

    Parameters
    ----------
    name
        Name of the project; of the file, where that says nothing, such as `Project Number`.
    storeys
        From the lowest to the highest.
    spaces, elements, doors, openings, connectors
        What the model holds; `elements` are all products with or without geometry but openings and spaces.
    terrain
        The surface of sites: ground outside, and no obstacle. In the ledger it counts as left out.
    issues
        What was lost or looks wrong.
    ledger
        Where every product went.
    schema, unit
        As the file states them, such as `IFC4` and `foot`; empty for a building written by hand.
    detections
        Targets placed by the user.
    sources
        Paths of the files it was read from.
    selector
        Answers `select`: a query to GlobalIds. A building written by hand has a small one of its own.
    property_reader
        Answers `properties`: a GlobalId to property sets.
    property_readers
        The same for each file of several, by its path.
    facts_reader
        Answers `facts`: a GlobalId to what the model says of the product.
    asset_readers
        Answer `asset`, for each file by its path: a GlobalId to what the file says about operating it.
    georeference
        Where on Earth the model lies, if it says so.
    anchors
        GlobalIds of sites, buildings and storeys to their placements, (4, 4) float64, metres.
    """

    name: str
    storeys: tuple[Storey, ...]
    spaces: tuple[Space, ...] = ()
    elements: tuple[Element, ...] = ()
    doors: tuple[Door, ...] = ()
    openings: tuple[Opening, ...] = ()
    connectors: tuple[Connector, ...] = ()
    terrain: tuple[Element, ...] = field(default=(), kw_only=True)
    issues: tuple[Issue, ...] = ()
    ledger: Ledger = field(default_factory=Ledger)
    schema: str = ""
    unit: str = ""
    detections: tuple[Detection, ...] = ()
    sources: tuple[str, ...] = ()
    selector: Callable[[str], Iterable[str]] | None = None
    property_reader: Callable[[str], Mapping[str, Mapping[str, Any]]] | None = None
    property_readers: Mapping[str, Callable[[str], Mapping[str, Mapping[str, Any]]]] = field(default_factory=dict)
    asset_readers: Mapping[str, Callable[[str], Mapping[str, Any]]] = field(default_factory=dict)
    georeference: Georeference | None = None
    anchors: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    facts_reader: Callable[[str], Facts] | None = None

    def __post_init__(self) -> None:
        for name, kind in (("storeys", Storey), ("spaces", Space), ("elements", Element), ("doors", Door)):
            object.__setattr__(self, name, _checks.many(name, getattr(self, name), kind))
        if not self.storeys:
            raise ModelError(f"building {self.name!r} has no storey.", "Give at least one Storey.")
        heights = [storey.elevation for storey in self.storeys]
        if heights != sorted(heights):
            raise ModelError(f"the storeys of {self.name!r} are not ordered by elevation.", "Sort them.")
        object.__setattr__(self, "ledger", self.ledger if self.ledger.asked else self._own_ledger())
        if any(door.clear_width is None for door in self.doors):
            from bimnav._doorways import measured

            object.__setattr__(self, "doors", measured(self))

    def _own_ledger(self) -> Ledger:
        return Ledger(asked=tuple(e.global_id for e in self.elements if e.shapes))

    def __repr__(self) -> str:
        return (
            f"Building({self.name!r}, {len(self.storeys)} storeys, {len(self.spaces)} spaces, "
            f"{len(self.doors)} doors, {len(self.elements)} elements, {len(self.issues)} issues)"
        )

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        from bimnav._cards import card, counted, plan_svg
        from bimnav.footprint import outline

        storeys = (f"{storey.name} ({storey.elevation:.2f} m)" for storey in self.storeys)
        lowest = next((s.storey for s in self.spaces), None)
        rooms = [outline(space.shapes) for space in self.spaces if space.storey == lowest and space.shapes]
        rows = [
            ("schema", f"{self.schema}, length unit {self.unit}"),
            ("storeys", ", ".join(storeys)),
            ("elements", counted(element.ifc_class.removeprefix("Ifc") for element in self.elements)),
            ("spaces, doors", f"{len(self.spaces)}, {len(self.doors)}"),
            ("issues", counted(f"{issue.severity}: {issue.code}" for issue in self.issues if issue.severity != "info")),
        ]
        return card(f"Building {self.name}", rows, plan_svg((room, "#dcd6ca") for room in rooms))

    @cached_property
    def _by_id(self) -> Mapping[str, Element]:
        return {element.global_id: element for element in self.elements}

    def __getitem__(self, global_id: str) -> Element:
        try:
            return self._by_id[global_id]
        except (KeyError, TypeError):  # unknown, or without a hash
            raise ModelError(
                f"no element of {self.name!r} has the GlobalId {global_id!r:.80}.",
                "building.elements lists them all.",
                {"global_id": global_id},
            ) from None

    def __contains__(self, global_id: object) -> bool:
        return isinstance(global_id, str) and global_id in self._by_id

    def __iter__(self) -> Iterator[Element]:
        return iter(self.elements)

    def select(self, query: str) -> tuple[Element | Space, ...]:
        """Return what a query in IfcOpenShell's selector language picks, in model order."""
        _checks.need("query", query, str)
        chosen = set((self.selector or self._select_by_hand)(query))
        products: tuple[Element | Space, ...] = (*self.elements, *self.spaces)
        return tuple(product for product in products if product.global_id in chosen)

    def _select_by_hand(self, query: str) -> Iterable[str]:
        from bimnav._select import select_by_hand

        return select_by_hand((*self.elements, *self.spaces), query)

    def properties(self, global_id: str) -> Mapping[str, Mapping[str, Any]]:
        """Return the property sets of a product, `{set: {property: value}}`, as the file writes them."""
        _checks.need("global_id", global_id, str)
        return {} if self.property_reader is None else self.property_reader(global_id)

    def facts(self, global_id: str) -> Facts:
        """Return what the model says of a product: its own properties and its type's, classifications, systems."""
        _checks.need("global_id", global_id, str)
        if self.facts_reader is not None:
            return self.facts_reader(global_id)
        return Facts(self.properties(global_id))

    def properties_by_source(self, global_id: str) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
        """Return the property sets of a product file by file, `{path: {set: {property: value}}}`."""
        _checks.need("global_id", global_id, str)
        readers = self.property_readers
        if not readers and self.property_reader:
            readers = {self.sources[0] if self.sources else self.name: self.property_reader}
        found = {path: read(global_id) for path, read in readers.items()}
        return {path: sets for path, sets in found.items() if sets}

    def asset(self, global_id: str) -> Asset:
        """Return what the models say about operating and maintaining an element or a room.

        Raises
        ------
        ModelError
            If nothing has this GlobalId.
        """
        from bimnav.assets import read_asset

        return read_asset(self, global_id)

    @cached_property
    def ascents(self) -> tuple[Ascent, ...]:
        """Every connector described: the levels it joins, how steep and wide it is, and the way over it."""
        from bimnav._connectors import describe_connectors

        return describe_connectors(self)

    def readiness(self, robot: Robot | None = None, *, cell_size: float = 0.05) -> Readiness:
        """Say which rooms, doors and floor a robot reaches, and why not the rest; see `readiness`."""
        from bimnav.readiness import readiness

        return readiness(self, robot, cell_size=cell_size)

    def storey_index(self, storey: str | int) -> int:
        """Return the index of a storey given by name, GlobalId or index.

        Raises
        ------
        ModelError
            If there is no such storey; the message lists the names.
        """
        for index, known in enumerate(self.storeys):
            if storey in (known.name, known.global_id):
                return index
        if str(storey).isdecimal() and int(storey) < len(self.storeys):
            return int(storey)
        names = ", ".join(repr(known.name) for known in self.storeys)
        raise ModelError(f"{self.name!r} has no storey {storey!r}.", f"It has {names}.", {"storey": storey})

    def with_targets(self, targets: Iterable[Detection | Mapping[str, Any] | Sequence[Any]]) -> Self:
        """Return the building with targets added: detections, or anything `Detection` takes.

        Examples
        --------
        >>> flat = Building("flat", (Storey("s", "Ground", 0.0),))
        >>> flat.with_targets([("spill", 1.0, 2.0), {"name": "peel", "x": 3, "y": 4}]).detections[1].x
        3.0
        """
        added = []
        for target in _checks.many("targets", targets):
            try:
                if isinstance(target, Mapping):
                    target = Detection(**target)
                elif not isinstance(target, Detection):
                    target = Detection(*target)
            except TypeError as error:
                hint = "Give a Detection, or its name, x and y."
                raise ValueRangeError(f"{target!r:.80} is no target.", hint, {"target": target}) from error
            if target.storey is not None:
                self.storey_index(target.storey)
            added.append(target)
        return replace(self, detections=self.detections + tuple(added))


def product_of(building: Building, global_id: str) -> Element | Space | None:
    """Return the element or room of a GlobalId; None if there is none."""
    if global_id in building:
        return building[global_id]
    return next((space for space in building.spaces if space.global_id == global_id), None)
