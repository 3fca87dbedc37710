"""One IFC file as a `Model`: the work of the reading process.

The kernel tessellates every product un-cut, in one pass, by its fastest means; openings and roof cuts are
subtracted by our own. That is several times faster than letting the kernel do it, and closes solids it
leaves open. Nothing is lost in silence: every product with a representation is read, left out by a named
rule, or listed as lost with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from bimnav.ifc._extent import extent_of
from bimnav.ifc._findings import Findings
from bimnav.ifc._geometry import Geometry, read_geometry
from bimnav.ifc._georeference import anchor_rows, georeference_row
from bimnav.ifc._kernel import Entity, File, attribute, is_kind
from bimnav.ifc._model import Model, to_building
from bimnav.ifc._products import BodyFinder, identify, is_terrain, left_out_by_class, sanitize, sorted_of
from bimnav.ifc._relations import Relations, open_circles
from bimnav.ifc._semantics import Rows, derived_storey, lowest_floor, storey_rows, text_of
from bimnav.ifc._units import length_unit

__all__ = ["Heartbeat", "extract", "to_building"]

Heartbeat = Callable[[int, int, str], None]

_CRASHED = "it crashed the geometry kernel"
_DAMAGED = "its representation is empty, or holds nothing or something else than the shapes it says"


def _silent(done: int, total: int, global_id: str) -> None:
    """Take no notice."""


def extract(
    file: File,
    text: bytes = b"",
    *,
    heartbeat: Heartbeat = _silent,
    skip: Collection[str] = (),
    thorough: Collection[str] = (),
    careful: bool = False,
    log: Any = None,
) -> Model:
    """Read a whole file.

    The file is changed in memory: text attributes written as `*` are emptied, and helper entities are
    added. Equal files give equal models.

    Parameters
    ----------
    file
        An open file; its placements and representations must be free of circles.
    text
        What it was parsed from; faceted bodies are read from there, which is many times faster.
    heartbeat
        Called with the number of products begun so far, their total, and the GlobalId of the next one
        before the kernel touches it; empty while it touches several, or none.
    skip
        GlobalIds, as given to `heartbeat`, of products that crashed the kernel before; they are lost.
    thorough
        The same of products that crashed the fast kernel; the thorough one reads them.
    careful
        Whether to give the kernel one product at a time, so that there is no doubt which one crashes it.
    log
        The in-memory `ifcopenshell.logger` the file was opened with; its errors become issues.

    Raises
    ------
    IfcStructureError
        If there is no project.
    IfcUnitsError
        If there is not exactly one sensible length unit.
    """
    unit, unit_scale = length_unit(file)
    products = sorted_of(file, "IfcProduct")
    ids, renamed = identify(products)
    relations = Relations.of(file)
    findings = Findings(ids)
    taken_out = [step_id for step_id in open_circles(file, relations.circular) if step_id in ids]
    findings.about_file(renamed, sanitize(products), taken_out, relations.malformed, log)
    findings.about_description(sorted_of(file, "IfcProject", "IfcSite", "IfcBuilding"))
    asked = [product for product in products if attribute(product, "Representation")]
    no_part = left_out_by_class(file)
    solids, contexts, left_out, lost = _sort_out(asked, no_part)
    skipped = {step_id for step_id in solids if ids[step_id] in skip}
    lost |= dict.fromkeys(skipped - left_out.keys(), _CRASHED)
    wanted = [product for product in asked if product.id() in solids and product.id() not in skipped]
    begun: set[int] = set()

    def working_on(step_id: int) -> None:
        if step_id:
            begun.add(step_id)
        heartbeat(max(0, len(begun) - 1), len(wanted), ids.get(step_id, ""))

    distrusted = {step_id for step_id in solids if ids[step_id] in thorough}
    geometry = read_geometry(
        file,
        wanted,
        solids,
        contexts,
        relations.openings_of(),
        working_on,
        text=text,
        unit_scale=unit_scale,
        thorough=distrusted,
        careful=careful,
    )
    heartbeat(len(wanted), len(wanted), "")
    lost |= {step_id: reason for step_id, reason in geometry.lost.items() if step_id not in left_out}
    lost = dict(sorted(lost.items()))
    findings.about_geometry(geometry, lost, left_out)
    findings.about_terrain(skipped & left_out.keys(), geometry, left_out)
    meshes, arrays, shapes = geometry.pack(product.id() for product in wanted)
    rows = Rows(file, ids, relations, geometry.bounds, lambda step_id: shapes.get(step_id, []), unit_scale)
    parts = [product for product in products if product.id() not in no_part]
    tables = {
        "project": text_of(sorted_of(file, "IfcProject")[0].Name),
        "schema": file.schema_identifier,
        "unit": unit,
        "unit_scale": unit_scale,
        "georeference": georeference_row(file, unit_scale, findings),
        "anchors": anchor_rows(file, unit_scale),
        "meshes": meshes,
        "terrain": [rows.element(p) for p in wanted if p.id() in left_out and geometry.shapes[p.id()]],
        **_contents(file, parts, rows, geometry, findings, storey_rows(file, ids, unit_scale)),
        "issues": findings.rows,
        "ledger": _ledger(asked, ids, left_out, lost, unit_scale),
    }
    return Model(tables, arrays)


def _ledger(
    asked: Sequence[Entity],
    ids: Mapping[int, str],
    left_out: Mapping[int, str],
    lost: Mapping[int, str],
    unit_scale: float,
) -> dict[str, Any]:
    """Write down where the products went, with a box around each that was lost where the file tells."""
    boxes = {ids[p.id()]: extent_of(p, unit_scale) for p in asked if p.id() in lost}
    return {
        "asked": [ids[product.id()] for product in asked],
        "left_out": {ids[step_id]: rule for step_id, rule in left_out.items()},
        "lost": {ids[step_id]: reason for step_id, reason in lost.items()},
        "lost_bounds": {global_id: box for global_id, box in boxes.items() if box is not None},
    }


def _sort_out(
    asked: Sequence[Entity], no_part: Mapping[int, str]
) -> tuple[dict[int, list[Entity]], set[int], dict[int, str], dict[int, str]]:
    """Find the solids of each product, their contexts, and which products to leave out or give up, and why.

    Terrain is left out, for it blocks nothing, and has solids.
    """
    finder = BodyFinder()
    solids: dict[int, list[Entity]] = {}
    contexts: set[int] = set()
    left_out: dict[int, str] = {}
    lost: dict[int, str] = {}
    for product in asked:
        step_id = product.id()
        rule = no_part.get(step_id)
        own: list[Entity] = []
        try:
            if rule is None or is_terrain(rule):
                own, where = finder.solids_of(product)
                contexts |= where
        except (AttributeError, RuntimeError, TypeError):
            if rule is None:
                lost[step_id] = _DAMAGED
                continue
        if own:
            solids[step_id] = own
        if rule or not own:
            left_out[step_id] = rule or "no-body"
    return solids, contexts, left_out, lost


def _contents(
    file: File,
    products: Sequence[Entity],
    rows: Rows,
    geometry: Geometry,
    findings: Findings,
    storeys: list[dict[str, Any]],
) -> dict[str, list[dict[str, Any]]]:
    spaces = [product for product in products if is_kind(product, "IfcSpace")]
    voids = [product for product in products if is_kind(product, "IfcFeatureElementSubtraction")]
    apart = {product.id() for product in (*spaces, *voids)}
    others = [product for product in products if product.id() not in apart]
    element_rows = [rows.element(product) for product in others]
    space_rows = [rows.space(space) for space in spaces]
    if storeys:
        findings.about_storeys(storeys, element_rows, space_rows)
    else:
        storeys = [derived_storey(file, lowest_floor(spaces, others, geometry.bounds))]
        for row in (*element_rows, *space_rows):
            row["storey"] = storeys[0]["global_id"]
        findings.add(
            "no-storeys",
            f"the file has no storeys; one was made at {storeys[0]['elevation']:.3f} m, the lowest floor.",
            hint="Export storeys (levels).",
        )
    door_rows = [rows.door(product) for product in others if is_kind(product, "IfcDoor")]
    connector_rows, without = rows.connectors(others)
    findings.about_contents(element_rows, space_rows, door_rows, without)
    return {
        "storeys": storeys,
        "elements": element_rows,
        "spaces": space_rows,
        "openings": [rows.opening(void) for void in voids],
        "doors": door_rows,
        "connectors": connector_rows,
    }
