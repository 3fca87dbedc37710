"""What a replay page holds: the building, the cells, and what happened, as plain values."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from bimnav.errors import InputError
from bimnav.graph import NodeKind

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.building import Building, Element
    from bimnav.environment import IndoorEnvironment
    from bimnav.graph import NavGraph
    from bimnav.sim import SimResult

__all__ = ["scene_of"]

_CATEGORIES = {
    "wall": ("IfcWall", "IfcCurtainWall"),
    "floor": ("IfcSlab", "IfcCovering", "IfcSite", "IfcGeographicElement"),
    "roof": ("IfcRoof",),
    "stair": ("IfcStair", "IfcRamp", "IfcTransportElement"),
    "door": ("IfcDoor",),
    "window": ("IfcWindow", "IfcPlate"),
    "structure": ("IfcColumn", "IfcBeam", "IfcMember", "IfcRailing", "IfcFooting", "IfcPile"),
    "furniture": ("IfcFurn", "IfcSystemFurniture", "IfcBuildingElementProxy"),
    "services": ("IfcFlow", "IfcDistribution", "IfcPipe", "IfcDuct", "IfcCable", "IfcSanitary", "IfcEnergy"),
}
_CUT = 1.4  # metres above the floor at which walls are cut low at first
_MOST_TRIANGLES = 1_500_000  # of the building; beyond, the elements with the most are shown as their boxes
_MOST_FACTS = 2000  # elements whose properties the page carries, those with a role first
_STEPS = 65535  # of a coordinate, over the extent of the building
_BOX = np.array(
    [
        *((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4)),
        *((2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)),
    ]
)  # faces over the eight corners, x fastest


def scene_of(result: SimResult, title: str | None) -> dict[str, Any]:
    """Return the scene of a simulation, ready for JSON."""
    if not result.tracks:
        raise InputError("the simulation kept no history to replay.", "Simulate with history=True.")
    graph = result.tours[0].graph
    environment = graph.environment
    building = None if environment is None else environment.building
    frame = graph.frame
    elements, mesh, origin = _building(building, environment, frame.elevations)
    if not elements:
        origin = np.array([frame.bounds[0], frame.bounds[1], min(frame.elevations)])
    levels = [{"name": name, "z": _mm(z - origin[2])} for name, z in zip(result.storeys, frame.elevations, strict=True)]
    if environment is None:
        heading, subtitle = "Replay", repr(graph)
    else:
        heading = f"{environment.task.name} in {environment.building.name}"
        subtitle = f"{len(result.served)} of {len(result.targets)} targets served, {result.distance:.1f} m driven"
    return {
        "title": title or heading,
        "subtitle": subtitle + _simplified(elements, mesh),
        "origin": origin.tolist(),
        "levels": levels,
        "cut": _CUT if elements else None,
        "elements": elements,
        "mesh": mesh,
        "facts": _facts(building, elements),
        "kinds": [kind.name.lower() for kind in NodeKind],
        "grid": _grid(graph, origin),
        "rooms": _rooms(environment, origin),
        "bodies": _bodies(environment, elements, len(levels), origin),
        "statuses": (statuses := sorted({str(s) for track in result.tracks for s in np.unique(track.statuses)})),
        "robots": [_robot(result, k, statuses, origin) for k in range(len(result.robots))],
        "people": _people(result, origin),
        "targets": _targets(result, origin),
        "events": _events(result),
        "span": [float(result.span[0]), float(result.span[1])],
    }


def _simplified(elements: Sequence[dict[str, Any]], mesh: dict[str, Any]) -> str:
    """Say what the page leaves out of a large building, if it does."""
    boxed, bare = mesh["boxed"], len(elements) - _MOST_FACTS
    told = f"; {boxed} elements with the most triangles are drawn as boxes" if boxed else ""
    return told + (f"; {bare} of {len(elements)} elements carry no properties here" if bare > 0 else "")


def _mm(value: float) -> float:
    return round(float(value), 3)


def _packed(values: ArrayLike, dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=dtype).tobytes()).decode("ascii")


def _category(ifc_class: str, predefined: str) -> str:
    if ifc_class == "IfcSlab" and predefined.upper() == "ROOF":
        return "roof"
    return next((name for name, starts in _CATEGORIES.items() if ifc_class.startswith(starts)), "other")


def _building(
    building: Building | None,
    environment: IndoorEnvironment | None,
    elevations: Sequence[float],
) -> tuple[list[dict[str, Any]], dict[str, Any], NDArray[np.float64]]:
    """Return the elements, their triangles sorted by storey and category, and the lowest corner of all."""
    if building is None or environment is None:
        return [], {"positions": "", "indices": "", "scale": [1, 1, 1], "groups": [], "boxed": 0}, np.zeros(3)
    shown = _shown(building, elevations)
    boxed = _too_fine([element for _, _, element in shown])
    roles, rules = _roles(environment)
    vertices: list[NDArray[np.float64]] = []
    triangles: list[NDArray[np.int64]] = []
    elements: list[dict[str, Any]] = []
    groups: list[dict[str, Any]] = []
    base = first = 0
    for level, category, element in shown:
        count = 0
        for points, faces in _triangles(element, element.global_id in boxed):
            vertices.append(points)
            triangles.append(faces + base)
            base += len(points)
            count += len(faces)
        elements.append(
            {
                "id": element.global_id,
                "name": element.name,
                "class": element.ifc_class,
                "level": level,
                "role": roles.get(element.global_id, ""),
                "rule": rules.get(element.global_id, ""),
                "first": first,
                "count": count,
            }
        )
        if not groups or (groups[-1]["level"], groups[-1]["category"]) != (level, category):
            groups.append({"level": level, "category": category, "first": first, "count": 0})
        groups[-1]["count"] += count
        first += count
    points = np.concatenate(vertices) if vertices else np.zeros((1, 3))
    low = points.min(axis=0)
    extent = np.maximum(points.max(axis=0) - low, 1e-3)
    steps = np.rint((points - low) / extent * _STEPS)
    mesh = {
        "positions": _packed(steps, "<u2"),
        "indices": _packed(np.concatenate([*triangles, np.zeros((0, 3), dtype=np.int64)]), "<u4"),
        "scale": extent.tolist(),
        "groups": groups,
        "boxed": len(boxed),
    }
    return elements, mesh, low


def _shown(building: Building, elevations: Sequence[float]) -> list[tuple[int, str, Element]]:
    """Return everything with a shape, sorted by level and category."""
    products = {element.global_id: element for element in building.elements}
    products |= {door.global_id: door.element for door in building.doors}
    rows = []
    for element in products.values():
        if element.shapes:
            category = _category(element.ifc_class, element.predefined_type)
            rows.append((_level_of(element, category, elevations), category, element))
    order = {name: k for k, name in enumerate([*_CATEGORIES, "other"])}
    return sorted(rows, key=lambda row: (row[0], order[row[1]], row[2].global_id))


def _too_fine(elements: Sequence[Element]) -> set[str]:
    """Return the elements with the most triangles, so that the rest is not too much to draw."""
    counts = sorted(((sum(len(s.mesh.faces) for s in e.shapes), e.global_id) for e in elements), reverse=True)
    total, boxed = sum(count for count, _ in counts), set()
    for count, global_id in counts:
        if total <= _MOST_TRIANGLES:
            break
        boxed.add(global_id)
        total -= count
    return boxed


def _triangles(element: Element, as_box: bool) -> Iterable[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    bounds = element.bounds
    if as_box and bounds is not None:
        corners = np.array([[x, y, z] for z in bounds[:, 2] for y in bounds[:, 1] for x in bounds[:, 0]])
        yield corners, _BOX
        return
    for shape in element.shapes:
        yield shape.world_vertices(), shape.mesh.faces.astype(np.int64)


def _level_of(element: Element, category: str, elevations: Sequence[float]) -> int:
    """Return the level an element is shown with: what it stands on; of slabs, what they carry."""
    bounds = element.bounds
    if bounds is None:
        return 0
    z = bounds[1, 2] + 0.05 if category == "floor" else min(bounds[0, 2] + 0.5, bounds[1, 2])
    below = [k for k, elevation in enumerate(elevations) if elevation <= z]
    return max(below, key=lambda k: elevations[k]) if below else int(np.argmin(elevations))


def _roles(environment: IndoorEnvironment) -> tuple[dict[str, str], dict[str, str]]:
    roles: dict[str, str] = {}
    rules: dict[str, str] = {}
    for global_id, rule in environment.left_out:
        roles[global_id], rules[global_id] = "left out", rule
    for obstacle in environment.obstacles:
        roles[obstacle.global_id], rules[obstacle.global_id] = "obstacle", obstacle.rule
    for door in environment.building.doors:
        roles[door.global_id] = "door"
    for target in environment.targets:
        both = target.global_id in roles and roles[target.global_id] == "obstacle"
        roles[target.global_id] = "target and obstacle" if both else "target"
        rules[target.global_id] = target.rule
    return roles, rules


def _facts(building: Building | None, elements: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return property sets, and the asset cards of targets, by GlobalId."""
    if building is None:
        return {}
    facts: dict[str, Any] = {}
    ranked = sorted(elements, key=lambda e: (not e["role"].startswith("target"), e["role"] != "obstacle", e["id"]))
    for element in ranked[:_MOST_FACTS]:
        global_id = element["id"]
        told: dict[str, dict[str, str]] = {}
        if element["role"].startswith("target") and global_id in building:
            card = building.asset(global_id)
            if not card.is_empty:
                told["asset"] = {name: str(value) for name, value, _ in card.rows()}
        for name, values in building.properties(global_id).items():
            told[name] = {key: str(value) for key, value in values.items()}
        if told:
            facts[global_id] = told
    return facts


def _grid(graph: NavGraph, origin: NDArray[np.float64]) -> dict[str, Any]:
    _, rows, cols = graph.frame.shape
    finite = graph.cost[np.isfinite(graph.cost)]
    is_uniform = not finite.size or bool((finite == 1).all())
    return {
        "rows": rows,
        "cols": cols,
        "size": graph.frame.cell_size,
        "x0": float(graph.frame.bounds[0] - origin[0]),
        "y0": float(graph.frame.bounds[1] - origin[1]),
        "kinds": _packed(graph.kinds, "u1"),
        "cost": None if is_uniform else _packed(graph.cost, "<f4"),
    }


def _rings(shape: BaseGeometry, origin: NDArray[np.float64]) -> list[list[list[float]]]:
    """Return the rings of every polygon, the outer one first, as x, y, x, y ..."""
    return [
        [
            np.round(np.asarray(ring.coords)[:, :2] - origin[:2], 4).ravel().tolist()
            for ring in (p.exterior, *p.interiors)
        ]
        for p in shapely.get_parts(shape)
        if p.geom_type == "Polygon"
    ]


def _rooms(environment: IndoorEnvironment | None, origin: NDArray[np.float64]) -> list[dict[str, Any]]:
    if environment is None:
        return []
    return [
        {"id": region.global_id, "name": region.name, "level": region.storey, "rings": rings}
        for region in environment.regions
        for rings in _rings(region.polygon, origin)
    ]


def _bodies(
    environment: IndoorEnvironment | None, elements: Sequence[dict[str, Any]], levels: int, origin: NDArray[np.float64]
) -> list[list[dict[str, Any]]]:
    """Return for every level the obstacles as the robot's middle meets them."""
    if environment is None:
        return [[] for _ in range(levels)]
    index = {element["id"]: k for k, element in enumerate(elements)}
    return [
        [
            {
                "element": index[obstacle.global_id],
                "rule": obstacle.rule,
                "low": _mm(obstacle.low - origin[2]),
                "high": _mm(obstacle.high - origin[2]),
                "rings": [ring for part in _rings(body, origin) for ring in part],
            }
            for obstacle, body in environment.bodies_on(level)
            if obstacle.global_id in index
        ]
        for level in range(levels)
    ]


def _robot(result: SimResult, k: int, statuses: Sequence[str], origin: NDArray[np.float64]) -> dict[str, Any]:
    robot, track = result.robots[k], result.tracks[k]
    kept = track.kept_rows()
    points = track.points[kept] - origin
    battery = [(row.time, row.battery) for row in result.log if row.robot == robot.name and row.battery is not None]
    lengths = np.linalg.norm(np.diff(track.points, axis=0), axis=1)
    return {
        "name": robot.name,
        "radius": robot.radius,
        "height": robot.height,
        "outline": robot.outline,
        "distance": float(lengths.sum()),
        "t": _packed(track.times[kept], "<f8"),
        "x": _packed(points[:, 0], "<f8"),
        "y": _packed(points[:, 1], "<f8"),
        "z": _packed(points[:, 2], "<f8"),
        "heading": _packed(track.headings[kept], "<f8"),
        "status": _packed(np.searchsorted(statuses, track.statuses[kept]), "u1"),
        "level": _packed(track.storeys[kept], "u1"),
        "battery": {"t": [t for t, _ in battery], "level": [level for _, level in battery]} if battery else None,
        "routes": _routes(points, track.storeys[kept]),
    }


def _routes(points: NDArray[np.float64], storeys: NDArray[np.int32]) -> list[dict[str, Any]]:
    """Return where a robot drove as lines, one after the other, each on the level it begins on."""
    lines: list[dict[str, Any]] = []
    for point, storey in zip(np.round(points, 3).tolist(), storeys.tolist(), strict=True):
        if not lines or lines[-1]["level"] != storey:
            before = lines[-1]["points"][-1:] if lines else []
            lines.append({"level": storey, "points": [*before]})
        if lines[-1]["points"][-1:] != [point]:
            lines[-1]["points"].append(point)
    return [line for line in lines if len(line["points"]) > 1]


def _people(result: SimResult, origin: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Return where everybody walked, twice a second."""
    if not result.people:
        return []
    begin, end = result.span
    times = np.linspace(begin, end, max(2, min(int(2 * (end - begin)) + 1, 20_000)))
    walked: dict[str, dict[str, Any]] = {
        p.name: {"name": p.name, "radius": p.radius, "level": p.storey, "t": [], "x": [], "y": []}
        for p in result.people
    }
    for time in times.tolist():
        for name, (x, y, _) in result.people_at(time).items():
            walked[name]["t"].append(round(time, 3))
            walked[name]["x"].append(_mm(x - origin[0]))
            walked[name]["y"].append(_mm(y - origin[1]))
    return list(walked.values())


def _targets(result: SimResult, origin: NDArray[np.float64]) -> list[dict[str, Any]]:
    graph = result.tours[0].graph
    found: dict[str, dict[str, Any]] = {}

    def add(global_id: str, name: str, level: int, point: Sequence[float], source: str, reason: str = "") -> None:
        x, y, z = (_mm(a - b) for a, b in zip(point, origin, strict=True))
        found.setdefault(
            global_id, {"id": global_id, "name": name, "level": level, "x": x, "y": y, "z": z, "source": source}
        )
        if reason:
            found[global_id]["reason"] = reason

    for target in () if graph.environment is None else graph.environment.targets:
        add(target.global_id, target.name, target.storey, target.destination, target.source)
    for stop in (stop for stops in result.stops for stop in stops):
        add(stop.global_id, stop.name, stop.cell.storey, stop.destination, stop.source)
    for lost in (lost for tour in result.tours for lost in tour.unreached):
        level = graph.frame.storey_at(lost.destination[2]) if lost.cell is None else lost.cell.storey
        add(lost.global_id, lost.name, level, lost.destination, "", lost.reason)
    return list(found.values())


def _events(result: SimResult) -> list[dict[str, Any]]:
    return [
        {
            "t": row.time,
            "robot": row.robot,
            "event": str(row.event),
            "target": row.target,
            "name": row.target_name,
            "cause": row.cause,
        }
        for row in result.log
        if math.isfinite(row.time)
    ]
