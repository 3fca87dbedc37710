"""The JSON Schema of robot files, from the fields of a robot."""

from __future__ import annotations

import math
import re
from dataclasses import MISSING, fields
from typing import Any

from bimnav.robot import RANGES, Robot

__all__ = ["robot_schema"]

_TEXT = {"type": "string", "pattern": r"\S"}
_CORNER = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}


def robot_schema() -> dict[str, Any]:
    """Return the JSON Schema of robot files; editors complete and check with it."""
    told = _descriptions()
    known = {
        field.name: _entry(field.name, field.default) | {"description": told.get(field.name, field.name)}
        for field in fields(Robot)
        if field.default is not MISSING and field.name != "name"
    }
    robot = {
        "type": "object",
        "title": "Robot",
        "description": "A robot; lengths in metres, times in seconds, angles in radians, power in watts.",
        "additionalProperties": False,
        "properties": {
            "description": {"type": "string", "description": "What the robot is, in a line."},
            "extends": {"type": "string", "description": "Name of the robot whose values hold where none are given."},
            **known,
        },
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "RobotFile",
        "description": "A file of robots for bimnav.",
        "type": "object",
        "required": ["schema", "robots"],
        "additionalProperties": False,
        "properties": {
            "schema": {"const": 1, "description": "Version of this layout."},
            "robots": {
                "type": "object",
                "description": "One table for each robot, by its name.",
                "minProperties": 1,
                "propertyNames": {"pattern": r"\S"},
                "additionalProperties": {"$ref": "#/$defs/Robot"},
            },
        },
        "$defs": {"Robot": robot},
    }


def _entry(name: str, default: Any) -> dict[str, Any]:
    """Return what a field may hold."""
    if name == "outline":
        return {"type": "array", "items": _CORNER, "minItems": 3}
    if isinstance(default, bool):
        return {"type": "boolean", "default": default}
    if isinstance(default, tuple):
        return {"type": "array", "items": _TEXT, "default": list(default)}
    low, high = RANGES[name]
    entry: dict[str, Any] = {"type": "number", "minimum": low}
    if math.isfinite(high):
        entry["maximum"] = high
    if default is not None and math.isfinite(default):
        entry["default"] = default
    return entry


def _descriptions() -> dict[str, str]:
    """Return what the documentation of a robot says of its fields; nothing where Python was told to drop it."""
    found: dict[str, str] = {}
    for names, lines in re.findall(r"^    (\w[\w, ]*)\n((?: {8}.*\n)+)", Robot.__doc__ or "", re.MULTILINE):
        text = " ".join(lines.split())
        found |= dict.fromkeys(names.split(", "), text)
    return found
