"""What blocks a robot, by meaning: whatever is solid, unless a reason with a name speaks against it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bimnav.building import Building, Element

if TYPE_CHECKING:
    from bimnav.tasks import Choice, Overruled, Task

__all__ = ["NOT_LISTED", "Blocking", "what_blocks"]

NOT_LISTED = "no obstacle rule of the task matches"
"""Why an element does not block in a task that lists its obstacles."""

_SOLID = "solid in the robot's height band"
_DOOR = "a door is passable because it is a door"
_NEVER = {
    "IfcAnnotation": "an annotation is no body",
    "IfcDoor": _DOOR,
    "IfcDoorStandardCase": _DOOR,
    "IfcGrid": "a grid is no body",
    "IfcOpeningElement": "an opening is empty",
    "IfcOpeningStandardCase": "an opening is empty",
    "IfcSite": "terrain is not an element of a storey",
    "IfcSpace": "a room is empty",
    "IfcSpatialZone": "a zone is empty",
    "IfcVirtualElement": "a virtual element has no body",
}


@dataclass(frozen=True, slots=True)
class Blocking:
    """What may block, and what does not.

    Parameters
    ----------
    candidates
        Elements with a body, each with the reason that lets it block where it meets the robot.
    left_out
        GlobalId to the reason why an element does not block.
    overruled
        Rules that others go before.
    """

    candidates: tuple[tuple[Element, str], ...]
    left_out: Mapping[str, str]
    overruled: tuple[Overruled, ...]


def what_blocks(task: Task, building: Building, targets: Mapping[str, Choice]) -> Blocking:
    """Decide for every element of a building whether it may block.

    What speaks first, in this order, decides: that it is no body (a door, an opening, a room, an annotation);
    a rule to ignore it; that it is a target the robot takes away; a rule that makes it an obstacle; that it is
    entourage; that the task lists its obstacles and it is none of them. Otherwise it may block.
    """
    from bimnav.tasks import Overruled, choose

    ignored, overruled = choose(task, "ignore", building)
    chosen, more = choose(task, "obstacles", building)
    overruled += more
    figures = _entourage(building) if task.entourage == "ignore" else {}
    parts = _parts_of_doors(building)
    candidates, left_out = [], {}
    for element in building.elements:
        global_id = element.global_id
        wanted = chosen.get(global_id)
        why_not = _NEVER.get(element.ifc_class) or parts.get(global_id, "")
        if not why_not and global_id in ignored:
            why_not = f"ignored: {ignored[global_id].why}"
        if not why_not and task.removes_targets and global_id in targets:
            why_not = f"target, taken away: {targets[global_id].why}"
        if wanted and why_not:
            overruled.append(Overruled(global_id, f"obstacle: {wanted.why}", why_not))
        if wanted and not why_not and global_id in figures:
            overruled.append(Overruled(global_id, f"entourage: {figures[global_id]}", f"obstacle: {wanted.why}"))
        if not why_not and not wanted and global_id in figures:
            why_not = f"entourage: {figures[global_id]}"
        if not why_not and not wanted and task.obstacles:
            why_not = NOT_LISTED
        if why_not:
            left_out[global_id] = why_not
        elif element.shapes:
            candidates.append((element, wanted.why if wanted else _SOLID))
    overruled += [
        Overruled(global_id, f"obstacle: {choice.why}", "a room is empty; `restricted` closes it")
        for global_id, choice in chosen.items()
        if global_id not in building
    ]
    return Blocking(tuple(candidates), left_out, tuple(overruled))


def _parts_of_doors(building: Building) -> dict[str, str]:
    """Return the frames, leaves and panes that a door is made of."""
    doors = {element.global_id for element in building.elements if _NEVER.get(element.ifc_class) == _DOOR}
    found: dict[str, str] = {}
    for element in building.elements if doors else ():
        whole = _whole(element, building, doors)
        if whole:
            found[element.global_id] = f"a part of the door {building[whole].name or whole}"
    return found


def _whole(element: Element, building: Building, wanted: Collection[str]) -> str:
    seen = set()
    parent = element.parent
    while parent and parent not in seen and parent in building:
        if parent in wanted:
            return parent
        seen.add(parent)
        parent = building[parent].parent
    return ""


def _entourage(building: Building) -> dict[str, str]:
    """Return what stands in a model for the picture, and why it is taken for that."""
    from bimnav.tasks import entourage, match

    found = {
        element.global_id: "its type is ENTOURAGE"
        for element in building.elements
        if element.predefined_type.upper() == "ENTOURAGE"
    }
    for rule in entourage().ignore:
        for product, why in match(rule, building):
            found.setdefault(product.global_id, why)
    return found
