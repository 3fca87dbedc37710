"""What the files say about a product, file by file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bimnav.building import Building, Element, Space
from bimnav.errors import ModelError

__all__ = ["facts_of", "product_of"]


def product_of(building: Building, global_id: str) -> Element | Space:
    if global_id in building:
        return building[global_id]
    for space in building.spaces:
        if space.global_id == global_id:
            return space
    raise ModelError(
        f"no element or room of {building.name!r} has the GlobalId {global_id!r}.",
        "building.elements and building.spaces list them all; upper and lower case count.",
        {"global_id": global_id},
    )


def facts_of(building: Building, global_id: str) -> list[tuple[str, Mapping[str, Any]]]:
    """Return what every file says, with its name; a building without files has its properties only."""
    readers = building.asset_readers
    if readers:
        return [(Path(path).name, told) for path, read in readers.items() if (told := read(global_id))]
    rows = [
        {"level": "occurrence", "set": pset, "name": name, "value": value, "measure": "", "unit": "", "description": ""}
        for pset, values in building.properties(global_id).items()
        for name, value in values.items()
    ]
    return [(building.name, {"properties": rows})] if rows else []
