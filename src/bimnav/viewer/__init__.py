"""The replay: one self-contained page that shows a building and what robots did in it, in three dimensions.

The page needs no server and asks nothing of a network; it opens from disk. Its script is bundled from
`viewer/` in the repository.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from bimnav.viewer._scene import scene_of

if TYPE_CHECKING:
    from bimnav.sim import SimResult

__all__ = ["replay_page"]


def replay_page(result: SimResult, *, title: str | None = None) -> str:
    """Return the replay of a simulation as a page of HTML.

    Parameters
    ----------
    result
        What happened; it must have kept its history.
    title
        The default is the task and the model.

    Returns
    -------
    page
        Equal results give equal pages, to the byte.
    """
    scene = scene_of(result, title)
    text = json.dumps(scene, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    packed = base64.b64encode(gzip.compress(text.encode("ascii"), compresslevel=6, mtime=0)).decode("ascii")
    script, style = _asset("replay.js"), _asset("replay.css")
    policy = "; ".join(
        [
            "default-src 'none'",
            f"script-src '{_hash_of(script)}'",
            f"style-src '{_hash_of(style)}'",
            "img-src data: blob:",
            "connect-src 'none'",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )
    parts = {
        "policy": html.escape(policy, quote=False),
        "title": html.escape(scene["title"]),
        "style": style,
        "scene": packed,
        "script": script,
    }
    return re.sub(r"\{(policy|title|style|scene|script)\}", lambda found: parts[found[1]], _PAGE)


@cache
def _asset(name: str) -> str:
    return files("bimnav.viewer").joinpath(name).read_text(encoding="utf-8")


def _hash_of(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


_PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<header><h1 id="title"></h1><span id="subtitle"></span><button id="help-open" title="keys">?</button></header>
<aside id="left">
<h2>Storeys</h2>
<ul id="levels"></ul>
<h2>View</h2>
<div class="row" title="height above the floor at which the building is cut">cut
<input id="cut" type="range" min="0.2" max="5" step="0.1"><span id="cut-value" class="dim"></span></div>
<div class="row" id="explode-row" title="lift the storeys apart">apart
<input id="explode" type="range" min="0" max="12" step="0.5" value="0">
<span id="explode-value" class="dim">0 m</span></div>
<label class="row"><input id="routes" type="checkbox" checked> routes</label>
<label class="row"><input id="grid" type="checkbox"> cells</label>
<label class="row"><input id="plan" type="checkbox"> plan view</label>
<button id="fit">show everything</button>
<h2>Cells</h2>
<ul>
<li><span class="swatch swatch-regular"></span> a robot can be here</li>
<li><span class="swatch swatch-obstacle"></span> obstacle</li>
<li><span class="swatch swatch-target"></span> target</li>
</ul>
</aside>
<main id="stage">
<canvas id="canvas" tabindex="0" aria-label="the building and its robots"></canvas>
<div id="legend">
<span><i class="swatch round swatch-waiting"></i>waiting</span>
<span><i class="swatch round swatch-serving"></i>being served</span>
<span><i class="swatch round swatch-served"></i>served</span>
<span><i class="swatch round swatch-unreached"></i>not served</span>
</div>
<section id="card" hidden><button id="card-close" aria-label="close">×</button><div id="card-body"></div></section>
<div id="loading">loading</div>
</main>
<aside id="right">
<h2>Robots</h2>
<ul id="robots"></ul>
<h2>Targets <span id="target-count"></span></h2>
<ul id="targets"></ul>
<h2>Events <span id="event-count"></span></h2>
<ol id="events"></ol>
</aside>
<footer>
<button id="play" aria-label="play">▶</button>
<div id="track"><div id="marks"></div>
<input id="scrub" type="range" min="0" max="1" step="any" value="0" aria-label="time"></div>
<span id="clock"></span>
<select id="speed" aria-label="speed"></select>
</footer>
<dialog id="help"><h2>Keys</h2>
<p><kbd>space</kbd> play or pause · <kbd>←</kbd> <kbd>→</kbd> event before or after · <kbd>+</kbd> <kbd>-</kbd> speed ·
<kbd>home</kbd> <kbd>end</kbd></p>
<p><kbd>1</kbd>–<kbd>9</kbd> one storey alone · <kbd>0</kbd> all · <kbd>g</kbd> cells · <kbd>r</kbd> routes ·
<kbd>p</kbd> plan view · <kbd>f</kbd> show everything · <kbd>esc</kbd> close</p>
<p>Click an element, a target or a robot to see what it is; with cells shown, click one to see why it is blocked.</p>
<form method="dialog"><button>close</button></form></dialog>
<script type="application/octet-stream" id="scene">{scene}</script>
<script>{script}</script>
</body>
</html>
"""
