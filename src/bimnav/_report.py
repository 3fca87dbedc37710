"""A mission as plain values and as files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bimnav.building import Issue
from bimnav.errors import OutputError
from bimnav.graph import NodeKind

if TYPE_CHECKING:
    from bimnav.mission import Mission

__all__ = ["issues_as_values", "report_of", "write_mission"]


def issues_as_values(issues: Iterable[Issue]) -> list[dict[str, Any]]:
    """Return issues as plain values."""
    return [
        {
            "code": issue.code,
            "severity": issue.severity,
            "message": issue.message,
            "global_ids": list(issue.global_ids),
            "hint": issue.hint,
        }
        for issue in issues
    ]


def report_of(mission: Mission) -> dict[str, Any]:
    building, graph, tour = mission.building, mission.graph, mission.tour
    environment, result = mission.environment, mission.result
    counts = graph.counts
    return {
        "model": " + ".join(building.sources) or building.name,
        "schema": building.schema,
        "task": mission.task.name,
        "robot": environment.robot.to_dict(),
        "cell_size": graph.frame.cell_size,
        "connectivity": graph.connectivity,
        "storeys": [
            {"name": storey.name, "global_id": storey.global_id, "floor": level}
            for storey, level in zip(environment.storeys, environment.levels, strict=True)
        ],
        "nodes": {kind.name.lower(): counts[kind] for kind in NodeKind},
        "start": {
            "cell": list(mission.start.cell),
            "point": list(mission.start.point),
            "source": mission.start.source,
        },
        "targets": _targets(mission),
        "conflicts": [
            {
                "global_id": conflict.global_id,
                "name": conflict.name,
                "cell": list(conflict.cell),
                "obstacles": [{"global_id": g, "name": building[g].name} for g in conflict.obstacles],
                "curable": conflict.curable,
            }
            for conflict in graph.conflicts
        ],
        "tour": {
            "order": [stop.global_id for stop in tour.stops if stop.kind == "target"],
            "length": tour.length,
            "objective": graph.objective,
            "cost": tour.cost,
            "duration": result.distance / environment.robot.speed,
            "is_optimal": tour.is_optimal,
            "lower_bound": tour.lower_bound,
            "returns": tour.return_to_start,
            "end": None if tour.end is None else list(tour.end_point),
            "is_smooth": any(leg.legs is not None for leg in tour.legs),
            "charges": [asdict(charge) for charge in tour.charges],
        },
        "check": {
            "ok": mission.check.ok,
            "clearance": mission.check.clearance if math.isfinite(mission.check.clearance) else None,
            "length": mission.check.checked_length,
        },
        "simulation": {
            "events": len(result.log.rows),
            "makespan": result.makespan,
            "distance": result.distance,
        },
        "issues": issues_as_values((*building.issues, *environment.issues)),
        "files": [str(path) for path in mission.files],
    }


def _targets(mission: Mission) -> list[dict[str, Any]]:
    stops = {stop.global_id: stop for stop in mission.tour.stops}
    unreached = {lost.global_id: lost for lost in mission.tour.unreached}
    rows = []
    for target, cell in mission.graph.targets:
        stop = stops.get(target.global_id)
        place = stop.cell if stop else cell
        row: dict[str, Any] = {
            "global_id": target.global_id,
            "name": target.name,
            "source": target.source,
            "rule": target.rule,
            "cell": None if place is None else list(place),
            "destination": list(target.destination),
            "reached": stop is not None,
        }
        if stop is not None:
            row |= {"approach": stop.approach, "end": list(stop.end), "distance": stop.distance}
            row["heading"] = stop.heading
        else:
            lost = unreached[target.global_id]
            row |= {"reason": lost.reason, "miss": lost.miss, "blocking": list(lost.blocking)}
        rows.append(row)
    return rows


def write_mission(mission: Mission, folder: Path) -> Mission:
    """Write figures, tables and the report of a mission into a folder."""
    from bimnav._files import write_bytes, write_text
    from bimnav.plot import save_tour
    from bimnav.sim.log import csv_text

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made a folder: {error.strerror}.", "Name another with --out.") from error
    passed = (np.unique(leg.indices[:, 0]).tolist() for leg in mission.tour.legs)
    storeys = sorted({mission.start.cell.storey, *chain(*passed)})
    files = []
    for storey in storeys:
        name = "plan.png" if len(storeys) == 1 else f"plan-{_slug(mission.environment.storeys[storey].name)}.png"
        if folder / name in files:
            name = f"plan-{storey}.png"
        write_bytes(folder / name, save_tour(mission.tour, storey=storey))
        files.append(folder / name)
    route = csv_text(("x", "y", "storey", "time"), mission.result.route_rows())
    write_text(folder / "route.csv", route)
    write_text(folder / "events.csv", mission.result.log.to_csv())
    mission.result.to_html(folder / "replay.html")
    files += [folder / name for name in ("route.csv", "events.csv", "replay.html", "report.json")]
    mission = replace(mission, files=tuple(files))
    text = json.dumps(mission.report(), indent=2, ensure_ascii=False, allow_nan=False)
    write_text(folder / "report.json", text + "\n")
    return mission


def _slug(name: str) -> str:
    return re.sub(r"[^\w.-]+", "_", name).strip("._")[:60] or "storey"
