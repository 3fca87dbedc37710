"""What the files say about a product, file by file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bimnav.building import Building

__all__ = ["facts_of"]


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
