"""What a reading process hands back: tables of plain values and arrays, nothing else.

A `Model` crosses the process border and lies in the cache as one JSON text and one npz archive;
`to_building` turns it into the values the rest of the library works on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bimnav._georeference import Georeference
from bimnav._placeholders import names_nothing
from bimnav.building import (
    Building,
    Connector,
    Door,
    Element,
    Facts,
    Issue,
    Ledger,
    Mesh,
    Opening,
    Shape,
    Space,
    Storey,
)

__all__ = ["Model", "to_building"]

_APART = ("step_id", "shapes", "type_class")  # columns that become no fields


@dataclass(slots=True)
class Model:
    """One IFC file, read.

    Parameters
    ----------
    tables
        JSON values:

        - `project`: name; `schema`; `unit`: name of the length unit; `unit_scale`: metres per unit
        - `georeference`: what `Georeference` takes, or None
        - `anchors`: `{global_id: placement}` of sites, buildings and storeys, (4, 4) metres
        - `storeys`: `[{global_id, name, elevation}]`, lowest first
        - `meshes`: `[{quality}]`, one per mesh of the arrays
        - `elements`: `[{global_id, ifc_class, name, type_name, type_class, object_type, predefined_type, tag,
          storey, space, parent, step_id, shapes: [index of a shape, ...]}]`
        - `terrain`: the same of surfaces of the ground
        - `spaces`: `[{global_id, name, long_name, type_name, type_class, object_type, predefined_type, storey, step_id,
          shapes}]`
        - `openings`: `[{global_id, host, fillings: [global_id], shapes}]`
        - `doors`: `[{global_id, opening, width, height}]`
        - `connectors`: `[{global_id, name, kind, parts, low, high}]`
        - `issues`: `[{code, message, global_ids, severity, hint}]`
        - `ledger`: `{asked: [global_id], left_out: {global_id: rule}, lost: {global_id: reason},
          lost_bounds: {global_id: [[x, y, z], [x, y, z]]}}`
    arrays
        - `vertices` (n, 3) float64 metres and `faces` (m, 3) int32, all meshes one after the other;
          faces count from their own mesh's first vertex
        - `vertex_offsets`, `face_offsets` (meshes + 1,) int64
        - `shape_mesh` (shapes,) int32 and `placements` (shapes, 4, 4) float64
    """

    tables: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, NDArray[np.generic]] = field(default_factory=dict)


def to_building(
    model: Model,
    *,
    sources: Sequence[str] = (),
    selector: Callable[[str], Iterable[str]] | None = None,
    property_reader: Callable[[str], Mapping[str, Mapping[str, Any]]] | None = None,
    facts_reader: Callable[[str], Facts] | None = None,
    asset_readers: Mapping[str, Callable[[str], Mapping[str, Any]]] | None = None,
) -> Building:
    """Turn tables and arrays into the values the rest of the library works on.

    Parameters
    ----------
    sources
        Paths of the files the model was read from.
    selector, property_reader, facts_reader, asset_readers
        As in `Building`.
    """
    tables = model.tables
    shapes = _shapes_of(model)

    def with_shapes(row: Mapping[str, Any]) -> dict[str, Any]:
        known = {name: value for name, value in row.items() if name not in _APART}
        return known | {"shapes": tuple(shapes[index] for index in row["shapes"])}

    elements = {row["global_id"]: Element(**with_shapes(row)) for row in tables["elements"]}
    openings = {
        row["global_id"]: Opening(**with_shapes(row) | {"fillings": tuple(row["fillings"])})
        for row in tables["openings"]
    }
    ledger = tables["ledger"]
    return Building(
        name=_name_of(tables["project"], sources),
        storeys=tuple(Storey(**row) for row in tables["storeys"]),
        spaces=tuple(Space(**with_shapes(row)) for row in tables["spaces"]),
        elements=tuple(elements.values()),
        doors=tuple(
            Door(elements[row["global_id"]], openings.get(row["opening"]), row["width"], row["height"])
            for row in tables["doors"]
        ),
        openings=tuple(openings.values()),
        connectors=tuple(Connector(**row | {"parts": tuple(row["parts"])}) for row in tables["connectors"]),
        terrain=tuple(Element(**with_shapes(row)) for row in tables["terrain"]),
        issues=tuple(Issue(**row | {"global_ids": tuple(row["global_ids"])}) for row in tables["issues"]),
        ledger=Ledger(
            tuple(ledger["asked"]),
            dict(ledger["left_out"]),
            dict(ledger["lost"]),
            {global_id: np.array(box) for global_id, box in ledger["lost_bounds"].items()},
        ),
        schema=tables["schema"],
        unit=tables["unit"],
        georeference=Georeference(**tables["georeference"]) if tables.get("georeference") else None,
        anchors={global_id: np.array(placement) for global_id, placement in tables.get("anchors", {}).items()},
        sources=tuple(sources),
        selector=selector,
        property_reader=property_reader,
        facts_reader=facts_reader,
        asset_readers=asset_readers or {},
    )


def _shapes_of(model: Model) -> list[Shape]:
    arrays: dict[str, NDArray[Any]] = model.arrays
    vertex, face = arrays["vertex_offsets"], arrays["face_offsets"]
    meshes = [
        Mesh(
            arrays["vertices"][vertex[i] : vertex[i + 1]],
            arrays["faces"][face[i] : face[i + 1]],
            row["quality"],
        )
        for i, row in enumerate(model.tables["meshes"])
    ]
    shapes: list[Shape] = [None] * len(arrays["shape_mesh"])  # type: ignore[list-item]
    order = np.argsort(arrays["shape_mesh"], kind="stable")
    ends = np.searchsorted(arrays["shape_mesh"][order], np.arange(len(meshes) + 1)).tolist()
    for mesh, begin, end in zip(meshes, ends[:-1], ends[1:], strict=True):
        which = order[begin:end]
        for index, shape in zip(which.tolist(), Shape.copies(mesh, arrays["placements"][which]), strict=True):
            shapes[index] = shape
    return shapes


def _name_of(project: str, sources: Sequence[str]) -> str:
    """Return the name of a project; the file's, where the project's says nothing."""
    stem = Path(sources[0]).stem if sources else ""
    return stem if stem and names_nothing(project or "") else project or stem
