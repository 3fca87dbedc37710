"""What a model holds, where its products went, and what is wrong with it."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import Any

from bimnav._connectors import describe_connectors
from bimnav._report import issues_as_values
from bimnav.building import Building
from bimnav.environment import IndoorEnvironment, make_environment
from bimnav.footprint import unite
from bimnav.robot import Robot
from bimnav.tasks import Task

__all__ = ["inspect", "ledger_of"]


def inspect(building: Building, robot: Robot | None = None) -> dict[str, Any]:
    """Describe a building in plain values.

    Parameters
    ----------
    building
        As read.
    robot
        Its height band decides what counts as an obstacle; the default is the paper's point, 1 m tall.

    Returns
    -------
    report
        `name, schema, unit, storeys [{name, elevation, floor_area, floor_from, spaces, doors}], elements,
        classes, connectors, ledger {asked, footprinted, outside_bands, left_out, lost}, left_out, lost,
        issues`. Metres and square metres; `floor_from` is the area by what says that there is floor. The
        counts of the ledger add up: asked is the sum of the other four.
    """
    environment = make_environment(building, Task("inspect", "everything that blocks"), robot)
    ledger = ledger_of(environment)
    spaces, doors = Counter[int](), Counter[int]()
    for region in environment.regions:
        spaces[region.storey] += region.source == "space"
        doors[region.storey] += region.source == "door"
    storeys = [
        {
            "name": storey.name,
            "global_id": storey.global_id,
            "elevation": storey.elevation,
            "floor_level": level,
            "floor_area": unite(r.polygon for r in environment.regions if r.storey == k).area,
            "floor_from": _by_source(environment, k),
            "spaces": spaces[k],
            "doors": doors[k],
        }
        for k, (storey, level) in enumerate(zip(environment.storeys, environment.levels, strict=True))
    ]
    return {
        "name": building.name,
        "schema": building.schema,
        "unit": building.unit,
        "storeys": storeys,
        "spaces": len(building.spaces),
        "doors": len(building.doors),
        "elements": len(building.elements),
        "classes": dict(sorted(Counter(element.ifc_class for element in building.elements).items())),
        "connectors": [asdict(connector) for connector in describe_connectors(building)],
        "ledger": {"asked": sum(len(entry) for entry in ledger.values())}
        | {name: len(entry) for name, entry in ledger.items()},
        "left_out": ledger["left_out"],
        "lost": ledger["lost"],
        "issues": issues_as_values((*building.issues, *environment.issues)),
    }


def _by_source(environment: IndoorEnvironment, storey: int) -> dict[str, float]:
    """Return the area of the floor of a storey by its source, square metres."""
    regions = [region for region in environment.regions if region.storey == storey]
    sources = sorted({region.source for region in regions})
    return {source: unite(r.polygon for r in regions if r.source == source).area for source in sources}


def ledger_of(environment: IndoorEnvironment) -> dict[str, dict[str, str]]:
    """Say where every product with a representation went: GlobalId to reason, in four groups.

    `footprinted` blocks on some storey, `outside_bands` on none, `left_out` was left out by a named
    rule, and `lost` should have been read and was not.
    """
    ledger = environment.building.ledger
    rules = dict(environment.left_out)
    footprinted = {o.global_id: o.rule for o in environment.obstacles}
    groups: dict[str, dict[str, str]] = {"footprinted": {}, "outside_bands": {}, "left_out": {}, "lost": {}}
    for global_id in ledger.asked:
        if global_id in ledger.lost:
            groups["lost"][global_id] = ledger.lost[global_id]
        elif global_id in ledger.left_out:
            groups["left_out"][global_id] = ledger.left_out[global_id]
        elif global_id in rules:
            groups["left_out"][global_id] = rules[global_id]
        elif global_id in footprinted:
            groups["footprinted"][global_id] = footprinted[global_id]
        elif global_id in environment.building:
            groups["outside_bands"][global_id] = "above or below the robot on every walkable storey"
        else:
            groups["left_out"][global_id] = "it is a space or an opening, not an element"
    return groups
