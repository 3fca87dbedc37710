"""Cards: how values show themselves in a notebook, as a small table with a plan."""

from __future__ import annotations

import html
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from shapely.geometry.base import BaseGeometry

__all__ = ["ROBOTS", "card", "counted", "plan_svg"]

ROBOTS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f3c8d", "#5d6d1e")  # one after the other

_SIDE = 200.0  # pixels of the longer side of a plan
_STYLE = (
    "border:1px solid #ddd8cf;border-radius:6px;padding:.5em .9em;display:inline-flex;flex-wrap:wrap;gap:1.2em;"
    "max-width:min(52em,100%);box-sizing:border-box"
)


def card(title: str, rows: Iterable[tuple[str, Any]], picture: str = "") -> str:
    """Return a card as HTML; what comes from the model is text in it, never markup.

    Parameters
    ----------
    title
        What it is.
    rows
        Names and values; values that are None or empty are left out.
    picture
        A plan as SVG.
    """
    lines = "".join(
        f"<tr><td style='color:#77716a;text-align:left;padding:0 .8em 0 0;vertical-align:top'>{html.escape(name)}</td>"
        f"<td style='text-align:left'>{html.escape(str(value))}</td></tr>"
        for name, value in rows
        if value not in (None, "", ())
    )
    table = f"<b>{html.escape(title)}</b><table style='border:0;margin:.3em 0 0'>{lines}</table>"
    return f"<div style='{_STYLE}'><div style='flex:1 1 16em'>{table}</div>{picture}</div>"


def counted(values: Iterable[str], most: int = 6) -> str:
    """Return the commonest of values with their numbers: `12 wall, 3 door and 4 others`."""
    names, counts = np.unique(np.array(list(values), dtype=str), return_counts=True)
    order = np.lexsort((names, -counts))
    told = [f"{counts[k]} {names[k]}" for k in order[:most]]
    rest = int(counts[order[most:]].sum())
    return ", ".join(told) + (f" and {rest} others" if rest else "")


def plan_svg(areas: Iterable[tuple[BaseGeometry, str]], lines: Iterable[tuple[ArrayLike, str]] = ()) -> str:
    """Return a small plan as SVG.

    Parameters
    ----------
    areas
        Polygons in metres, each with its color, the lowest first.
    lines
        Polylines, (n, 2) or (n, 3) in metres, each with its color.
    """
    shown = [(area, color) for area, color in areas if not area.is_empty]
    if not shown:
        return ""
    x0, y0, x1, y1 = shapely.total_bounds([area for area, _ in shown]).tolist()
    scale = _SIDE / max(x1 - x0, y1 - y0, 1e-9)

    def points(values: ArrayLike) -> str:
        flat = (np.asarray(values, dtype=np.float64)[:, :2] - (x0, y1)) * (scale, -scale)
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in flat.tolist())

    parts = []
    for area, color in shown:
        rings = [
            f"M{points(ring.coords)}Z"
            for polygon in shapely.get_parts(shapely.simplify(area, 0.5 / scale))
            if polygon.geom_type == "Polygon" and not polygon.is_empty
            for ring in (polygon.exterior, *polygon.interiors)
        ]
        parts.append(f'<path d="{"".join(rings)}" fill="{color}" fill-rule="evenodd"/>')
    for line, color in lines:
        parts.append(f'<polyline points="{points(line)}" fill="none" stroke="{color}" stroke-width="2"/>')
    width, height = (x1 - x0) * scale, (y1 - y0) * scale
    style = "flex:none;max-width:100%"
    return (
        f'<svg style="{style}" width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.1f} {height:.1f}">'
        f"{''.join(parts)}</svg>"
    )
