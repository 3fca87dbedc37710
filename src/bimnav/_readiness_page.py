"""The readiness report as one page: no script, no network, every word from the model escaped."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.building import Issue
    from bimnav.readiness import Plan, Readiness, RoomCheck, StoreyCheck

__all__ = ["page"]

# Okabe and Ito's palette, which people with any color vision tell apart; unreached rooms are hatched as well
_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1c1c1c; background: #fff; max-width: 70rem;
       margin: 2rem auto; padding: 0 1.25rem; }
h1 { font-size: 1.6rem; margin: 0; } h2 { font-size: 1.2rem; margin: 2.5rem 0 .5rem; }
h3 { font-size: 1rem; margin: 1.5rem 0 .25rem; } p { margin: .25rem 0; }
.quiet, .id { color: #5b5b5b; } .id { font: .8rem ui-monospace, monospace; }
.tiles { display: flex; flex-wrap: wrap; gap: 1rem; margin: 1.25rem 0; }
.tile { border: 1px solid #d5d5d5; border-radius: 6px; padding: .6rem 1rem; min-width: 9rem; }
.tile b { display: block; font-size: 1.5rem; }
table { border-collapse: collapse; width: 100%; margin: .5rem 0 1rem; }
th { text-align: left; font-weight: 600; border-bottom: 2px solid #c4c4c4; }
td { border-bottom: 1px solid #e4e4e4; vertical-align: top; } th, td { padding: .3rem .8rem .3rem 0; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg { width: 100%; max-height: 34rem; background: #fff; border: 1px solid #e4e4e4; border-radius: 6px; }
.key { display: flex; flex-wrap: wrap; gap: .25rem 1.25rem; font-size: .85rem; } .key svg { width: 1.1rem;
       height: .8rem; border: 1px solid #777; border-radius: 0; margin-right: .35rem; vertical-align: baseline; }
.yes { fill: #9fd3f0; } .no { fill: url(#hatch); } .ground { fill: #e6e3db; } .wall { fill: #333; }
.thing { fill: #b9b3a6; } .opens { fill: #009e73; } .shut { fill: #d55e00; }
.room { stroke: #fff; stroke-width: 4; } .hatch { fill: #f3cf82; } .line { stroke: #b56b00; stroke-width: 6; }
svg.defs { position: absolute; width: 0; height: 0; border: 0; }
.name { font-family: system-ui, sans-serif; text-anchor: middle; fill: #1c1c1c; }
.error, .warning, .info { font-weight: 600; } .error { color: #a33c00; } .warning { color: #7a5200; }
.info { color: #005f99; }
@media print { body { margin: 0; max-width: none; } h2 { break-after: avoid; } tr { break-inside: avoid; } }
"""
_HATCH = (
    '<svg class="defs" aria-hidden="true">'
    '<pattern id="hatch" width="30" height="30" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    '<rect class="hatch" width="30" height="30"/><path class="line" d="M0 0V30"/></pattern></svg>'
)
_KEY = (
    ("yes", "reached room"),
    ("no", "room not reached"),
    ("ground", "other floor"),
    ("wall", "wall, window, column"),
    ("thing", "other obstacle"),
    ("opens", "door that lets the robot through"),
    ("shut", "door that does not"),
)
_LETTERS, _SMALLEST = 80, 26  # letters are as high as this part of a plan, and at least so many centimetres
_SLIM = 0.6  # width of a letter, in heights
_MARGIN = 0.3  # metres around a plan
_MANY = 4  # GlobalIds shown of an issue


def page(report: Readiness) -> str:
    """Return the page of a report."""
    title, style = f"Robot readiness of {escape(report.building)}", hashlib.sha256(_STYLE.encode()).digest()
    policy = f"default-src 'none'; style-src 'sha256-{base64.b64encode(style).decode()}'"
    head = (
        "<!doctype html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title>",
        f"<style>{_STYLE}</style>",
        "</head>",
        "<body>",
        _HATCH,
        f"<h1>{title}</h1>",
    )
    body = [*_summary(report)]
    for k, storey in enumerate(report.storeys):
        body += _level(storey, report.plans[k], [room for room in report.unreached if room.storey == k])
    lost = [room for room in report.unreached if room.storey is None]
    body += ["<h2>Rooms on no level</h2>", _rooms(lost)] if lost else []
    body += [*_doors(report), *_connectors(report), *_issues(report.issues)]
    return "\n".join((*head, *body, "</body>", "</html>", ""))


def _summary(report: Readiness) -> Iterable[str]:
    robot, shares = report.robot, report.to_dict()["share"]
    yield (
        f'<p class="quiet">Robot {escape(robot.name)}: {2 * robot.radius:.2f} m wide, {robot.height:.2f} m high, '
        f"climbs {robot.step_height:.2f} m. Cells of {report.cell_size:g} m. On every level it starts in the largest "
        "part of the floor; it takes no stairs, ramps or lifts.</p>"
    )
    tiles = zip((shares["rooms"], shares["floor"], shares["doors"]), ("rooms", "floor", "doors"), strict=True)
    tile = '<div class="tile"><b>{}</b>of the {}</div>'
    yield f'<div class="tiles">{"".join(tile.format(_percent(share), name) for share, name in tiles)}</div>'
    head = ("Level", "Height", "Rooms", "Floor", "Doors", "Ways to other levels")
    yield _table(head, (_storey_row(storey, report) for storey in report.storeys), numbers=(1, 2, 3, 4))


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.0f} %"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: Sequence[int] = ()) -> str:
    """Return a table of cells that are HTML already; columns of numbers are aligned at their right."""
    kinds = [' class="number"' if k in numbers else "" for k in range(len(head))]

    def line(tag: str, cells: Sequence[str]) -> str:
        row = (f"<{tag}{kind}>{cell}</{tag}>" for kind, cell in zip(kinds, cells, strict=True))
        return f"<tr>{''.join(row)}</tr>"

    return "\n".join(["<table>", line("th", head), *(line("td", row) for row in rows), "</table>"])


def _called(name: str, global_id: str) -> str:
    return f'{escape(name) or "without a name"}<br><span class="id">{escape(global_id)}</span>'


def _storey_row(storey: StoreyCheck, report: Readiness) -> tuple[str, ...]:
    kinds = sorted(way.kind for way in report.connectors if way.global_id in storey.connectors)
    counted = {kind: kinds.count(kind) for kind in kinds}
    return (
        escape(storey.name),
        f"{storey.level:.2f} m",
        f"{storey.rooms_reached} of {storey.rooms}" if storey.rooms else "–",
        f"{storey.reached_area:.0f} of {storey.floor_area:.0f} m²" if storey.floor_area else "–",
        f"{storey.doors_connecting} of {storey.doors}" if storey.doors else "–",
        ", ".join(f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in counted.items()),
    )


def _level(storey: StoreyCheck, plan: Plan, unreached: Sequence[RoomCheck]) -> list[str]:
    if not (storey.floor_area or unreached):
        return []
    key = (
        f'<span><svg viewBox="0 0 60 45"><rect class="{kind}" width="60" height="45"/></svg>{words}</span>'
        for kind, words in _KEY
    )
    return [
        f"<h2>{escape(storey.name)}</h2>",
        _drawing(plan, storey.name),
        f'<p class="key">{"".join(key)}</p>',
        _rooms(unreached) if unreached else '<p class="quiet">No room is out of reach.</p>',
    ]


def _rooms(rooms: Iterable[RoomCheck]) -> str:
    """Return a table of rooms out of reach; those with the same reason share a row."""
    alike: dict[tuple[str, str], list[RoomCheck]] = {}
    for room in rooms:
        alike.setdefault((room.detail, room.hint), []).append(room)
    rows = (
        (
            "<br>".join(_called(room.name, room.global_id) for room in same),
            f"{sum(room.area for room in same):.1f} m²",
            escape(detail),
            escape(hint),
        )
        for (detail, hint), same in alike.items()
    )
    return _table(("Not reached", "Floor", "Why", "What helps"), rows, numbers=(1,))


def _drawing(plan: Plan, name: str) -> str:
    """Draw a level to scale, in centimetres."""
    layers: list[tuple[str, str, BaseGeometry]] = [("", "ground", plan.floor)]
    layers += [(label, "room yes" if reached else "room no", polygon) for label, polygon, reached in plan.rooms]
    layers += [("", "thing", plan.furniture), ("", "wall", plan.walls)]
    layers += [(label, "opens" if connects else "shut", polygon) for label, polygon, connects in plan.doors]
    layers = [layer for layer in layers if not layer[2].is_empty]
    if not layers:
        return ""
    x0, y0, x1, y1 = shapely.total_bounds([polygon for *_, polygon in layers])
    left, top = x0 - _MARGIN, y1 + _MARGIN
    width, height = _cm(x1 - left + _MARGIN), _cm(top - y0 + _MARGIN)
    lines = [f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="Plan of {escape(name)}">']
    for label, kind, polygon in layers:
        title = f"<title>{escape(label)}</title>" if label else ""
        lines.append(f'<path class="{kind}" fill-rule="evenodd" d="{_path(polygon, left, top)}">{title}</path>')
    size = max(width // _LETTERS, _SMALLEST)
    for label, polygon, _ in plan.rooms:
        letters = int(_cm(polygon.bounds[2] - polygon.bounds[0]) / (_SLIM * size))
        short = label if len(label) <= letters else label[: max(letters - 1, 0)] + "…"
        if len(short) > 2:
            x, y = shapely.get_coordinates(polygon.representative_point())[0]
            at = f'x="{_cm(x - left)}" y="{_cm(top - y)}" font-size="{size}"'
            lines.append(f'<text class="name" {at}>{escape(short)}</text>')
    return "\n".join([*lines, "</svg>"])


def _cm(metres: float) -> int:
    return round(100 * metres)


def _path(polygon: BaseGeometry, left: float, top: float) -> str:
    rings = []
    for part in shapely.get_parts(polygon):
        for ring in (part.exterior, *part.interiors) if part.geom_type == "Polygon" else ():
            points = np.round((shapely.get_coordinates(ring)[:-1] * (1, -1) + (-left, top)) * 100).astype(int)
            rings.append("M" + "L".join(f"{x} {y}" for x, y in points.tolist()) + "Z")
    return "".join(rings)


def _doors(report: Readiness) -> list[str]:
    shut = [door for door in report.doors if not door.connects]
    if not report.doors:
        return []
    head = f"<h2>Doors</h2><p>{len(report.doors) - len(shut)} of {len(report.doors)} let the robot through.</p>"
    rows = (
        (
            _called(door.name, door.global_id),
            "" if door.width is None else f"{door.width:.2f} m",
            "" if door.sill is None else f"{door.sill:.2f} m",
            escape(door.detail),
        )
        for door in shut
    )
    return [head, *([_table(("Door", "Width", "Sill", "Why not"), rows, numbers=(1, 2))] if shut else [])]


def _connectors(report: Readiness) -> list[str]:
    if not report.connectors:
        return []
    rows = []
    for way in report.connectors:
        about = [
            f"{way.steps} steps of {way.riser:.3f} m" if way.steps and way.riser else "",
            f"slope {100 * way.slope:.0f} %" if way.slope is not None else "",
            f"{way.width:.2f} m wide" if way.width is not None else "",
            f"{way.length:.1f} m long" if way.length is not None else "",
        ]
        heights = " to ".join(f"{level:.2f}" for level in way.levels)
        rows.append((_called(f"{way.kind} {way.name}", way.global_id), f"{heights} m", ", ".join(filter(None, about))))
    return ["<h2>Ways between levels</h2>", _table(("Way", "From and to", "Form"), rows)]


def _issues(issues: Sequence[Issue]) -> list[str]:
    if not issues:
        return ["<h2>The model</h2>", '<p class="quiet">Nothing looks wrong.</p>']
    rank = {"error": 0, "warning": 1, "info": 2}
    rows = (
        (
            f'<span class="{issue.severity}">{issue.severity}</span>',
            f'{escape(issue.message)}<br><span class="id">{escape(_some(issue.global_ids))}</span>',
            escape(issue.hint),
        )
        for issue in sorted(issues, key=lambda issue: rank[issue.severity])
    )
    return ["<h2>The model</h2>", _table(("", "What looks wrong", "Repair"), rows)]


def _some(global_ids: Sequence[str]) -> str:
    more = f" and {len(global_ids) - _MANY} more" if len(global_ids) > _MANY else ""
    return ", ".join(global_ids[:_MANY]) + more
