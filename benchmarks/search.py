"""Search against what pip installs: the same queries in one process, in turns, the least of five rounds each.

    python benchmarks/search.py [--only PART ...] [--queries N] [--json FILE] [--publish] [--tiny]

prints a table in Markdown; `--publish` writes docs/benchmarks/search.md and its figure. Published maps are looked
for in the folder that the environment variable BIMNAV_BENCH names, else in ../shared/bench; where there are none,
as with `--tiny`, generated rooms take their place.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import rustworkx
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import bimnav as bn
from bimnav import search

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("BIMNAV_BENCH", ROOT.parent / "shared" / "bench")) / "grid2d"
PAGE = ROOT / "docs" / "benchmarks" / "search.md"
FIGURE = ROOT / "docs" / "figures" / "search-growth.png"
MAPS = (
    "rooms/8room_000", "rooms/32room_003", "mazes/maze512-16-0", "dao/orz900d", "dao/brc202d", "bg512/AR0012SR",
    "da2/ht_mansion_n", "cities/Berlin_0_1024", "random/random512-20-0",
)  # fmt: skip
ROUNDS = 5
Query = tuple[bn.Cell, bn.Cell]


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    peer: str
    found: str
    bar: str
    met: bool | None
    note: str = ""


@dataclass(frozen=True)
class World:
    """A map and queries on it."""

    name: str
    free: NDArray[np.bool_]
    queries: Sequence[Query]


def rooms(side: int, room: int = 24, seed: int = 0) -> NDArray[np.bool_]:
    """Draw a building: a lattice of rooms with a door in every wall, and a pillar or table here and there."""
    rng = np.random.default_rng(seed)
    free = np.ones((side, side), dtype=np.bool_)
    free[::room] = free[:, ::room] = False
    for line in range(0, side, room):
        for at in range(0, side - room + 1, room):
            door = at + int(rng.integers(2, room - 4))
            free[line, door : door + 3] = free[door : door + 3, line] = True
    for row, col in rng.integers(0, side - 4, (side * side // 400, 2)):
        free[row : row + 3, col : col + 2] = False
    free[0] = free[-1] = free[:, 0] = free[:, -1] = False
    return free


def worlds(names: Iterable[str], count: int, tiny: bool) -> list[World]:
    """Load maps with the first `count` of a fixed choice of their published queries."""
    rng = np.random.default_rng(0)
    if tiny or not DATA.exists():
        free = rooms(96 if tiny else 1024)
        labels = search.components(free[None])[0]
        cells = np.argwhere(labels == np.bincount(labels.ravel())[1:].argmax() + 1)
        pairs = cells[rng.integers(len(cells), size=(count, 2))].tolist()
        return [World("generated rooms", free, [(bn.Cell(0, *a), bn.Cell(0, *b)) for a, b in pairs])]
    found = []
    for name in names:
        lines = (DATA / f"{name}.map").read_text().splitlines()[4:]
        free = np.array([[letter in ".G" for letter in line] for line in lines if line])
        rows = [line.split() for line in (DATA / f"{name}.map.scen").read_text().splitlines()[1:] if line]
        chosen = [rows[k] for k in rng.permutation(len(rows))[:count]]
        numbers = [[int(value) for value in row[-5:-1]] for row in chosen]
        found.append(World(name, free, [(bn.Cell(0, y, x), bn.Cell(0, b, a)) for x, y, a, b in numbers]))
    return found


def least(*jobs: Callable[[], object], rounds: int = ROUNDS) -> list[float]:
    """Return the least CPU seconds of each job; they take turns."""
    found = [math.inf] * len(jobs)
    for _ in range(rounds):
        for k, job in enumerate(jobs):
            start = time.thread_time()
            job()
            found[k] = min(found[k], time.thread_time() - start)
    return found


def points_of(graph: bn.NavGraph, start: bn.Cell, goal: bn.Cell) -> NDArray[np.float64]:
    """Find a path as a user does, coordinates included."""
    return bn.find_path(graph, start, goal).points


def mean_ratio(ratios: Iterable[float]) -> float:
    """Return the geometric mean."""
    return math.exp(float(np.mean(np.log(list(ratios)))))


def sparse(graph: bn.NavGraph) -> Any:
    """Write a graph out for scipy."""
    a, b, weight = graph.edges()
    count = graph.cost.size
    return coo_array((np.tile(weight, 2), (np.r_[a, b], np.r_[b, a])), shape=(count, count)).tocsr()


def uniform(count: int, tiny: bool) -> Row:
    """One query as a user calls it, with its coordinates, against pyastar2d with four neighbors."""
    import pyastar2d

    each = {}
    for world in worlds(MAPS, count, tiny):
        graph = bn.NavGraph.from_mask(world.free)
        weights = np.where(world.free, 1, np.inf).astype(np.float32)
        ours = theirs = 0.0
        for start, goal in world.queries:
            found = least(
                partial(points_of, graph, start, goal),
                partial(pyastar2d.astar_path, weights, start[1:], goal[1:], allow_diagonal=False),
            )
            ours, theirs = ours + found[0], theirs + found[1]
        each[world.name] = theirs / ours
    ratio = mean_ratio(each.values())
    note = ", ".join(f"{name.split('/')[-1]} {value:.1f}x" for name, value in each.items())
    return Row(
        "one shortest path, equal costs, 8 neighbors, coordinates included", "pyastar2d, 4 neighbors",
        f"{ratio:.1f}x as fast", "14x", ratio >= 14, note,
    )  # fmt: skip


def lambdas(count: int, tiny: bool) -> Row:
    """The same against rustworkx with Python callables, on the written graph."""
    each = []
    for world in worlds(("rooms/32room_003", "cities/Berlin_0_1024"), max(2, count // 25), tiny):
        graph = bn.NavGraph.from_mask(world.free)
        explicit = graph.to_rustworkx()
        cols = world.free.shape[1]

        def theirs(start: bn.Cell, goal: bn.Cell, cols: int = cols, explicit: Any = explicit) -> object:
            end, row, col = goal.row * cols + goal.col, goal.row, goal.col

            def to_go(node: int) -> float:
                a, b = abs(node // cols - row), abs(node % cols - col)
                return max(a, b) + (math.sqrt(2) - 1) * min(a, b)

            begin = start.row * cols + start.col
            return rustworkx.astar_shortest_path(explicit, begin, lambda n: n == end, lambda w: w, to_go)

        for start, goal in world.queries:
            if start != goal:
                ours = least(partial(points_of, graph, start, goal))[0]
                each.append(least(partial(theirs, start, goal), rounds=1)[0] / ours)
    ratio = mean_ratio(each)
    return Row("the same", "rustworkx A*, Python lambdas", f"{ratio:,.0f}x as fast", "1000x", ratio >= 1000)


def weighted(count: int, tiny: bool) -> Row:
    """A* over clearance costs with four neighbors, equal cost."""
    import pyastar2d

    each = []
    for world in worlds(("rooms/32room_003", "dao/orz900d"), max(3, count // 5), tiny):
        away = search.clearances(world.free[None])[0]
        cost = np.where(world.free, 1 + 4 * np.exp(-(away - 1) / 3), np.inf).astype(np.float32)
        graph = bn.NavGraph.from_mask(world.free, connectivity=4).with_cost(cost)
        for start, goal in world.queries:
            found = least(
                partial(points_of, graph, start, goal),
                partial(pyastar2d.astar_path, cost, start[1:], goal[1:], allow_diagonal=False),
            )
            each.append(found[0] / found[1])
    ratio = mean_ratio(each)
    return Row(
        "one cheapest path, clearance costs, 4 neighbors", "pyastar2d", f"{ratio:.2f} of its time", "at most 1.3",
        ratio <= 1.3, "it charges a cell on entry, bimnav the mean of both cells",
    )  # fmt: skip


def fields(_: int, tiny: bool) -> list[Row]:
    """Distance fields, search only, against scipy."""
    rows = []
    for kind, bar in (("equal costs", 8), ("clearance costs", 8)):
        each = {}
        for world in worlds(MAPS[:-1:2] + MAPS[-2:-1] + MAPS[-1:], 1, tiny):
            graph = bn.NavGraph.from_mask(world.free)
            graph = graph.with_clearance(4.0) if kind != "equal costs" else graph
            matrix, source = sparse(graph), world.queries[0][0]
            index = source.row * world.free.shape[1] + source.col
            found = least(
                lambda graph=graph, source=source: bn.distance_field(graph, source),
                lambda matrix=matrix, index=index: dijkstra(matrix, directed=False, indices=index),
            )
            each[world.name] = found[1] / found[0]
        ratio = mean_ratio(each.values())
        note = ", ".join(f"{name.split('/')[-1]} {value:.1f}x" for name, value in each.items())
        rows.append(
            Row(f"distance to all cells, {kind}", "scipy dijkstra, search only", f"{ratio:.1f}x as fast", f"{bar}x",
                ratio >= bar, note)
        )  # fmt: skip
    return rows


def matrix(_: int, tiny: bool) -> Row:
    """All distances between 50 cells of a map of a million."""
    (world,) = worlds(("cities/Berlin_0_1024",), 50 if not tiny else 5, tiny)
    cells = [start for start, _ in world.queries]
    graph = bn.NavGraph.from_mask(world.free)
    flat = [cell.row * world.free.shape[1] + cell.col for cell in cells]
    (ours,) = least(lambda: bn.distance_matrix(graph, cells))
    few = min(5, len(flat))
    explicit = sparse(graph)
    build, some = least(
        partial(sparse, graph), partial(dijkstra, explicit, directed=False, indices=flat[:few]), rounds=1
    )
    theirs = build + some * len(flat) / few
    ratio = theirs / ours
    return Row(
        f"{len(cells)} x {len(cells)} matrix on {world.free.size:,} cells", "scipy dijkstra, one graph build",
        f"{ratio:.0f}x as fast", "8x", ratio >= 8,
    )  # fmt: skip


def building(_: int, tiny: bool) -> Row:
    """A graph with costs, parts and clearance from layers, against the same written out in rustworkx."""
    free = rooms(96 if tiny else 1000)
    factor = np.broadcast_to(np.where(np.arange(free.shape[1]) % 50 < 10, 2.0, 1.0), free.shape)
    number = np.arange(free.size).reshape(free.shape)
    written: list[tuple[int, int, float]] = []

    def ours() -> object:
        return bn.NavGraph.from_mask(free).with_cost(factor).with_clearance(3.0).components

    def edges() -> Iterable[tuple[int, int, float]]:
        away = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
        cost = factor * (1 + 4 * np.clip(1 - (away - 0.5) / 3, 0, 1) ** 2)
        low, high, left, right, whole = slice(None, -1), slice(1, None), slice(None, -1), slice(1, None), slice(None)
        for a, b, length in (
            ((whole, left), (whole, right), 1), ((low, whole), (high, whole), 1),
            ((low, left), (high, right), math.sqrt(2)), ((low, right), (high, left), math.sqrt(2)),
        ):  # fmt: skip
            is_open = free[a] & free[b]
            if length > 1:
                is_open &= free[low, left] & free[low, right] & free[high, left] & free[high, right]
            weight = length * (cost[a] + cost[b])[is_open] / 2
            yield from zip(number[a][is_open].tolist(), number[b][is_open].tolist(), weight.tolist(), strict=True)

    def add(triples: Iterable[tuple[int, int, float]]) -> Any:
        graph: Any = rustworkx.PyGraph(multigraph=False)
        graph.add_nodes_from(range(free.size))
        graph.add_edges_from(triples)
        return graph

    written += edges()
    a, b, c = least(ours, lambda: rustworkx.connected_components(add(edges())), lambda: add(written))
    return Row(
        f"graph with costs, parts and clearance, {free.size:,} cells",
        "rustworkx: edges from numpy and scipy, added, connected components", f"{b / a:.0f}x as fast", "100x",
        b / a >= 100, f"{c / a:.0f}x as fast as adding edges that were listed before",
    )  # fmt: skip


def dilation(_: int, tiny: bool) -> Row:
    """Blocked cells grown by a turned rectangle of 191 cells."""
    y, x = np.mgrid[-12:13, -12:13]
    c, s = math.cos(0.35), math.sin(0.35)
    footprint = (abs(x * c + y * s) <= 8.4) & (abs(y * c - x * s) <= 5.6)
    mask = ~rooms(96 if tiny else 1024)
    same = bool((search.dilate(mask, footprint) == ndimage.binary_dilation(mask, footprint)).all())
    a, b = least(lambda: search.dilate(mask, footprint), lambda: ndimage.binary_dilation(mask, footprint))
    return Row(
        f"growing by a footprint of {int(footprint.sum())} cells, {mask.size:,} cells", "scipy binary_dilation",
        f"{b / a:.0f}x as fast, {'identical' if same else 'NOT identical'}", "20x", same and b / a >= 20,
    )  # fmt: skip


def transform(_: int, tiny: bool) -> Row:
    """The exact Euclidean distance transform."""
    free = rooms(96 if tiny else 1024)
    same = bool((search.clearances(free[None])[0] == ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]).all())
    a, b = least(lambda: search.clearances(free[None]), lambda: ndimage.distance_transform_edt(free))
    found = f"{b / a:.1f}x as fast, {'identical' if same else 'NOT identical'}"
    return Row(
        f"exact distance transform, {free.size:,} cells", "scipy distance_transform_edt", found, "3x", b / a >= 3
    )


def any_angle(_: int, tiny: bool) -> Row:
    """Straight paths against the published Euclidean optima, and their time against a path over cells."""
    what = "straight paths: mean length over the optimum"
    reference = DATA / "euclid_reference.csv"
    rows: list[dict[str, str]] = []
    if reference.exists() and not tiny:
        with reference.open() as file:
            rows = list(csv.DictReader(file))
    over, times = [], []
    for name in sorted({row["map"] for row in rows}):
        (world,) = worlds((name,), 1, tiny)
        mesh, face = search.mesh_of_mask(world.free)
        graph = bn.NavGraph.from_mask(world.free)
        for row in [row for row in rows if row["map"] == name]:
            x, y, a, b = (int(row[key]) for key in ("start_x", "start_y", "goal_x", "goal_y"))
            found = least(
                lambda m=mesh, f=face, p=(x, y, a, b): search.find_taut(
                    m, p[:2], int(f[p[1], p[0]]), p[2:], int(f[p[3], p[2]])
                ),
                lambda g=graph, p=(x, y, a, b): bn.find_path(g, bn.Cell(0, p[1], p[0]), bn.Cell(0, p[3], p[2])),
                rounds=2,
            )
            taut = search.find_taut(mesh, (x, y), int(face[y, x]), (a, b), int(face[b, a]))
            over.append(math.inf if taut is None else taut.length / float(row["euclid_optimal"]))
            times.append(found[0] / found[1])
    if not rows:
        return Row(what, "published optima", "no reference at hand", "1.010", None)
    mean, worst = float(np.mean(over)), float(np.max(over))
    note = f"{len(rows)} queries, worst {worst:.8f}; {mean_ratio(times):.1f} times as long as a path over cells takes"
    return Row(what, "published optima", f"{mean:.7f}", "1.010", mean <= 1.01, note)


def eased(count: int, tiny: bool) -> Row:
    """Straight paths over clearance costs, against the path over cells they are drawn from."""
    rng = np.random.default_rng(0)
    free = rooms(96 if tiny else 512)
    graph = bn.NavGraph.from_mask(free).with_clearance(6.0)
    cells = np.argwhere(graph.components[0] == np.bincount(graph.components.ravel())[1:].argmax() + 1)
    costs, times = [], []
    for _ in range(count):
        start, goal = (bn.Cell(0, *cell) for cell in rng.choice(cells, 2, replace=False).tolist())
        plain, smooth = bn.find_path(graph, start, goal), bn.find_path(graph, start, goal, smooth="any_angle")
        costs.append(smooth.cost / plain.cost)
        found = least(
            lambda s=start, g=goal: bn.find_path(graph, s, g, smooth="any_angle"),
            lambda s=start, g=goal: bn.find_path(graph, s, g),
            rounds=2,
        )
        times.append(found[0] / found[1])
    note = f"worst {max(costs):.3f}; {mean_ratio(times):.1f} times as long as the path over cells takes"
    what = "straight paths, clearance costs: mean cost"
    return Row(what, "the path over cells", f"{np.mean(costs):.3f}", "", None, note)


def repair(count: int, tiny: bool) -> Row:
    """Closing and opening 3 x 3 cells on a path, against the whole field."""
    rng = np.random.default_rng(1)
    ratios, shares = [], []
    for world in worlds(("rooms/32room_003", "rooms/8room_000", "dao/orz900d", "cities/Berlin_0_1024"), 1, tiny):
        cols = world.free.shape[1]
        cost = np.where(world.free, 1, np.inf).astype(np.float32)[None]
        layout, labels = search.Layout(cost), search.components(world.free[None]).ravel()
        free = np.flatnonzero(labels == np.bincount(labels)[1:].argmax() + 1)
        for _ in range(max(3, count // 5)):
            source, goal = rng.choice(free, 2).tolist()
            field = search.Field(layout, [source])
            path = search.find(layout, source, goal)
            assert path is not None
            _, row, col = path.indices[len(path.indices) // 2].tolist()
            block = np.array([(row + i) * cols + col + j for i in (-1, 0, 1) for j in (-1, 0, 1)])
            block = block[np.isfinite(cost.ravel()[np.clip(block, 0, cost.size - 1)]) & (block != source)]
            before = field.distances(1.0)
            close, open_, whole = least(
                lambda f=field, b=block: f.update(b, np.inf),
                lambda f=field, b=block: f.update(b, 1.0),
                lambda f=field: f._recompute(),
            )
            field.update(block, np.inf)
            share = float((field.distances(1.0) != before).sum() / len(free))
            ratios += [whole / close, whole / open_]
            shares += [share, share]
    small = [ratio for ratio, share in zip(ratios, shares, strict=True) if share < 0.01]
    median = float(np.median(small)) if small else math.nan
    note = f"all changes: median {np.median(ratios):.1f}x; under 1 % changes in {len(small)} of {len(ratios)}"
    return Row(
        "field after a door closes or opens", "the whole field", f"median {median:.0f}x where under 1 % changes, "
        f"worst {min(ratios):.2f}x", "20x; never under 0.75x", median >= 20 and min(ratios) >= 0.75, note,
    )  # fmt: skip


def memory(_: int, tiny: bool) -> Row:
    """Bytes a cell of a graph holds, without what is made when first asked for."""
    graph = bn.NavGraph.from_mask(rooms(96 if tiny else 1000))
    held = sum(array.nbytes for array in (graph.cost, graph.obstacle, graph.floor)) / graph.cost.size
    layout = search.Layout(graph.cost)
    layout.stops  # noqa: B018  # made when first asked for
    cache = sum(a.nbytes for a in vars(layout).values() if isinstance(a, np.ndarray)) / graph.cost.size
    note = f"what the search keeps besides: {cache:.1f} bytes"
    return Row("memory of a graph", "", f"{held:.0f} bytes a cell", "8 bytes", held <= 8, note)


# numba imports its typed containers and scipy.linalg at the first call of any kernel
FIRST = """
import time, json
begin = time.process_time()
import numba, numba.typed, scipy.linalg, scipy.ndimage, shapely
imported = time.process_time() - begin
begin = time.process_time(); import numpy as np, bimnav as bn
graph = bn.NavGraph.from_mask(np.ones((64, 64), dtype=bool)); bn.find_path(graph, bn.Cell(0, 0, 0), bn.Cell(0, 63, 63))
first = time.process_time() - begin
begin = time.process_time(); from bimnav import search; search.warmup(); rest = time.process_time() - begin
print(json.dumps([imported, first, rest]))
"""


def first_plan(_: int, tiny: bool) -> Row:
    """The first path of a process, kernels compiled before and not."""

    def run(cache: str | None) -> list[float]:
        environment = {**os.environ, **({"NUMBA_CACHE_DIR": cache} if cache else {})}
        command = [sys.executable, "-c", FIRST]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=environment)
        found: list[float] = json.loads(done.stdout.splitlines()[-1])
        return found

    with tempfile.TemporaryDirectory(prefix="bimnav-numba-") as folder:
        cold = run(folder)
        warm = [min(times) for times in zip(*(run(folder) for _ in range(1 if tiny else ROUNDS)), strict=True)]
    found = f"{warm[1]:.2f} s cached, {cold[1]:.1f} s when it must compile"
    note = f"all kernels of the package compile in {cold[1] + cold[2]:.0f} s, once for each machine"
    return Row(
        "first path, imports of numba and scipy aside", "", found, "0.3 s; 15 s", warm[1] <= 0.3 and cold[1] <= 15, note
    )


def growth(tiny: bool) -> list[dict[str, float]]:
    """Time and memory over cells, on generated buildings."""
    found = []
    for side in (30, 60) if tiny else (100, 316, 1000, 3162):
        free = rooms(side)
        labels = search.components(free[None])[0]
        cells = np.argwhere(labels == np.bincount(labels.ravel())[1:].argmax() + 1)
        start, goal = bn.Cell(0, *cells[0].tolist()), bn.Cell(0, *cells[-1].tolist())
        graph = bn.NavGraph.from_mask(free)

        def first(free: NDArray[np.bool_] = free, start: bn.Cell = start, goal: bn.Cell = goal) -> object:
            return bn.find_path(bn.NavGraph.from_mask(free), start, goal)

        times = least(
            first,
            lambda g=graph, s=start, e=goal: bn.find_path(g, s, e).points,
            lambda g=graph, s=start, e=goal: bn.find_path(g, s, e, smooth="any_angle"),
            lambda g=graph, s=start: bn.distance_field(g, s),
        )
        layout = search.Layout(graph.cost)
        layout.stops  # noqa: B018  # made when first asked for
        held = [graph.cost, graph.obstacle, graph.floor, *vars(layout).values()]
        megabytes = sum(a.nbytes for a in held if isinstance(a, np.ndarray)) / 1e6
        names = ("graph and first path", "path", "straight path", "field")
        found.append({"cells": free.size, **dict(zip(names, times, strict=True)), "megabytes": megabytes})
    return found


def draw(numbers: Sequence[dict[str, float]]) -> None:
    """Plot growth."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    times, held = figure.subplots(1, 2)
    cells = [row["cells"] for row in numbers]
    for name in numbers[0]:
        if name not in ("cells", "megabytes"):
            times.loglog(cells, [1e3 * row[name] for row in numbers], "o-", label=name)
    times.set(xlabel="cells", ylabel="milliseconds")
    times.legend(frameon=False, fontsize="small")
    held.loglog(cells, [row["megabytes"] for row in numbers], "o-", color="black")
    held.set(xlabel="cells", ylabel="graph and search, MB")
    for ax in (times, held):
        ax.grid(alpha=0.3)
    figure.savefig(FIGURE, dpi=150)


PARTS: dict[str, Callable[[int, bool], Row | list[Row]]] = {
    "uniform": uniform, "lambdas": lambdas, "weighted": weighted, "fields": fields, "matrix": matrix,
    "building": building, "dilation": dilation, "transform": transform, "any_angle": any_angle, "eased": eased,
    "repair": repair, "memory": memory, "first_plan": first_plan,
}  # fmt: skip


def table(rows: Iterable[Row]) -> str:
    """Write rows in Markdown."""
    lines = ["| what | against | found | bar | met |", "| --- | --- | --- | --- | --- |"]
    for row in rows:
        met = "" if row.met is None else "yes" if row.met else "**no**"
        note = f" ({row.note})" if row.note else ""
        lines.append(f"| {row.what} | {row.peer} | {row.found}{note} | {row.bar} | {met} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Measure, print, and publish if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=[*PARTS, "growth"], help="measure only these")
    parser.add_argument("--queries", type=int, default=100, help="queries a map")
    parser.add_argument("--json", type=Path, help="write the numbers there")
    parser.add_argument("--publish", action="store_true", help=f"write {PAGE.name} and its figure")
    parser.add_argument("--tiny", action="store_true", help="a generated map of 96 x 96 cells for everything")
    chosen = parser.parse_args(arguments)
    search.warmup()
    rows: list[Row] = []
    for name, part in PARTS.items():
        if not chosen.only or name in chosen.only:
            found = part(chosen.queries, chosen.tiny)
            rows += found if isinstance(found, list) else [found]
            print(*table(found if isinstance(found, list) else [found]).splitlines()[2:], sep="\n", flush=True)
    numbers = growth(chosen.tiny) if not chosen.only or "growth" in chosen.only else []
    packages = ("numba", "numpy", "scipy", "rustworkx", "pyastar2d")
    about = ", ".join(
        [
            platform.machine(),
            f"Python {platform.python_version()}",
            *(f"{p} {version(p)}" for p in packages if find_spec(p)),
        ]
    )
    if chosen.json:
        chosen.json.write_text(json.dumps({"about": about, "rows": [asdict(row) for row in rows], "growth": numbers}))
    if chosen.publish:
        PAGE.write_text(PAGE_TEXT.format(table=table(rows), about=about, queries=chosen.queries), encoding="utf-8")
        draw(numbers)
    return rows


PAGE_TEXT = """\
What each engine is for:

- `find_path` with its defaults is for everything: jump points where all cells cost the same and have eight
  neighbors, A* where they do not. It searches the arrays of the graph; nothing is written out.
- `engine="rustworkx"` searches the graph written out, with callables that run no Python code. It is the second
  opinion: the same costs, hundreds of times slower.
- `to_rustworkx()` and `to_networkx()` are for algorithms that bimnav does not have.
- `distance_field` and `distance_matrix` are for many goals at once; `LiveField` keeps a field right while doors
  open and close.
- `smooth="any_angle"` is exact on masks: no shorter path exists for a point between those cells where all floor
  costs the same. Around footprints it is exact but for the chords that stand for arcs, half a percent of the radius.

{table}

CPU time, the least of five rounds, in turns, on two cores that others used too; geometric means over maps. The maps
are those of the Moving AI Lab, with {queries} of their published queries each, chosen once.
pyastar2d with four neighbors solves an easier problem than bimnav with eight; it is here because it is the fastest
that one can install. {about}.

![time and memory over cells](figures/search-growth.png)

Regenerate this page with `python benchmarks/search.py --publish`.
"""

if __name__ == "__main__":
    main()
