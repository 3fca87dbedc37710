"""How fast bimnav reads buildings: ratios to plain ways of doing the same, in CPU time.

    python benchmarks/reading.py [--models real|generated|all] [--match TEXT ...] [--only PART ...]
                                 [--largest N] [--json FILE] [--publish]

prints tables in Markdown; `--publish` also puts them into docs/benchmarks/reading.md. Real models are looked for in
the folder that the environment variable BIMNAV_REAL_IFC names.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from building import Plan, write_building, write_hall
from measuring import Job, alone, cpu, environment_of, plain_iteration, tessellation, warm_up
from numpy.typing import NDArray
from peers import boxes_of, sliced, voxelized

import bimnav as bn
from bimnav.errors import BimnavError
from bimnav.grid import GridFrame, rasterize
from bimnav.ifc._text import load

REPOSITORY = Path(__file__).parents[1]
PAGE = REPOSITORY / "docs" / "benchmarks" / "reading.md"
FIGURE = REPOSITORY / "docs" / "figures" / "growth_reading.png"
REAL = Path(os.environ.get("BIMNAV_REAL_IFC", REPOSITORY.parent / "shared" / "ifc"))

MEGABYTE = 1e6  # bytes
SIZES = (1_000, 5_000, 18_000, 50_000, 100_000)  # products
ROUNDS, BUDGET = (3, 12), 4.0  # fewest and most; CPU seconds after which no further round begins
PEERS = ("fm/BasicFM", "houses/SampleHouse4", "houses/231110AC11", "duplex/Duplex_A", "office/Office_A")
RASTERS = ("duplex/Duplex_A", "office/Office_A", "generated")


# --- Measuring.


def fastest(*makers: Callable[[], Job]) -> list[float]:
    """Return the least CPU seconds of jobs that take turns; each is made anew, untimed, in every round."""
    times: list[list[float]] = []
    while len(times) < ROUNDS[0] or (len(times) < ROUNDS[1] and np.sum(times) < BUDGET):
        times.append([cpu(make()) for make in makers])
    return [float(least) for least in np.min(times, axis=0)]


@dataclass(slots=True)
class Table:
    """Rows of one measurement, and what they say about its bars."""

    name: str
    columns: Sequence[str]
    rows: list[Sequence[object]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        ends = ["---" if k == 0 else "---:" for k in range(len(self.columns))]
        lines = [self.columns, ends, *([_text(value) for value in row] for row in self.rows)]
        return "\n".join(["| " + " | ".join(line) + " |" for line in lines] + ["", *self.remarks, ""])

    def judge(self, column: int, least: float, mean: float | None = None) -> None:
        """Say whether a column of ratios keeps its bars: the least, and the geometric mean."""
        ratios = {str(row[0]): float(row[column]) for row in self.rows}  # type: ignore[arg-type]
        found = float(np.exp(np.mean(np.log(list(ratios.values())))))
        missed = [f"{name} ({ratio:.3g})" for name, ratio in ratios.items() if ratio < least]
        text = f"*{self.columns[column]}*: at least {least:g} asked on each"
        text += f", {mean:g} in the geometric mean; mean {found:.3g}" if mean else ""
        verdict = "missed by " + ", ".join(missed) if missed else "kept by all"
        self.remarks.append(f"- {text}; {verdict}.")


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 100 else f"{value:,.0f}"
    return f"{value:,}" if isinstance(value, int) else str(value)


# --- What is measured.


@dataclass(frozen=True, slots=True)
class Model:
    """A file, and the same as bare text where the file is an archive."""

    name: str
    path: Path
    text: Path


def against_kernel(models: Sequence[Model]) -> Table:
    """Compare tessellation, and the way from file to footprints, with B0."""
    columns = ("model", "B0 / tessellation", "B0 / footprints", "products", "B0, s", "tessellation, s", "footprints, s")
    table = Table("kernel", columns)
    for model in models:
        plain, ours, whole = fastest(
            partial(plain_iteration, model.text),
            partial(tessellation, model.text),
            lambda: partial(environment_of, model.path),  # noqa: B023
        )
        products = len(environment_of(model.path).building.ledger.asked)
        table.rows.append((model.name, plain / ours, plain / whole, products, plain, ours, whole))
    table.judge(1, 5, 7)
    table.judge(2, 2.5, 3)
    return table


def copies(folder: Path) -> Table:
    """Compare a hall with many copies of a mapped chair with the hall with one, from file to footprints."""
    numbers = (1, 100, 1000, 5000, 12000)
    paths = [folder / f"hall{number}.ifc" for number in numbers]
    for path, number in zip(paths, numbers, strict=True):
        write_hall(path, number)
    times = fastest(*(partial(partial, environment_of, path) for path in paths))
    table = Table("copies", ("copies", "allowed / taken", "microseconds for each", "footprints, s"))
    for number, taken in zip(numbers[1:], times[1:], strict=True):
        allowed = 1.2 * times[0] + 100e-6 * number
        table.rows.append((number, allowed / taken, (taken - times[0]) / (number - 1) * 1e6, taken))
    table.remarks.append(f"One copy takes {times[0]:.3g} s; allowed are 1.2 times that and 100 microseconds for each.")
    table.judge(1, 1)
    return table


def rasters(models: Sequence[Model]) -> Table:
    """Compare `rasterize` with shapely boxes on trees, on the storey with most obstacles."""
    columns = (
        "model",
        "shapely / bimnav",
        "the same, boxes given",
        "cells",
        "polygons",
        "cells that differ",
        "bimnav, ms",
        "tree of cells, ms",
        "tree of polygons, ms",
        "boxes, ms",
    )
    table = Table("raster", columns)
    for model in models:
        obstacles = environment_of(model.path).obstacles
        storeys = [obstacle.storey for obstacle in obstacles]
        polygons = [o.footprint for o in obstacles if o.storey == max(set(storeys), key=storeys.count)]
        for size in (0.1, 0.05, 0.025):
            frame = GridFrame.covering(shapely.total_bounds(polygons), size)
            if 1e5 <= frame.rows * frame.cols <= 1.5e6:
                table.rows.append((f"{model.name}, {size * 100:g} cm", *_raster(frame, polygons)))
    table.judge(1, 45)
    table.judge(2, 45)
    return table


def _raster(frame: GridFrame, polygons: Sequence[Any]) -> tuple[object, ...]:
    cells = boxes_of(frame)
    ours = rasterize(frame, polygons)
    theirs = np.zeros(cells.size, dtype=np.bool_)
    theirs[shapely.STRtree(cells).query(polygons, predicate="intersects")[1]] = True
    makers: tuple[Job, ...] = (
        lambda: rasterize(frame, polygons),
        lambda: shapely.STRtree(cells).query(polygons, predicate="intersects"),
        lambda: shapely.STRtree(polygons).query(cells, predicate="intersects"),
        lambda: boxes_of(frame),
    )
    own, of_cells, of_polygons, boxes = (1e3 * t for t in fastest(*(lambda job=job: job for job in makers)))
    given = min(of_cells, of_polygons)
    differing = int((ours.ravel() != theirs).sum())
    ratios = (given + boxes) / own, given / own
    return (*ratios, cells.size, len(polygons), differing, own, of_cells, of_polygons, boxes)


def second_open(models: Sequence[Model], folder: Path) -> Table:
    """Compare the first way from file to footprints with the next ones, from the cache."""
    columns = (
        "model",
        "first, apart / same band",
        "first, here / same band",
        "first, here / new band",
        "first, apart, s",
        "first, here, s",
        "same band, s",
        "new band, s",
    )
    table = Table("cache", columns)
    for number, model in enumerate(models):
        fresh = (folder / f"cache{number}-{k}" for k in count())
        warm = folder / f"cache{number}"
        bands = (bn.Robot(height=1.5 + k / 100) for k in count())
        environment_of(model.path, warm)
        times = fastest(
            lambda: partial(environment_of, model.path, next(fresh), isolate=True),  # noqa: B023
            lambda: partial(environment_of, model.path, next(fresh)),  # noqa: B023
            lambda: partial(environment_of, model.path, warm),  # noqa: B023
            lambda: partial(environment_of, model.path, warm, next(bands)),  # noqa: B023
        )
        apart, here, same, new = times
        table.rows.append((model.name, apart / same, here / same, here / new, *times))
    table.judge(1, 30)
    table.judge(2, 30)
    table.judge(3, 2)
    return table


def memory(models: Sequence[Model]) -> Table:
    """Compare the peak of a fresh process, and of caller and worker when they are two, with what is allowed."""
    columns = ("model", "allowed / peak", "file, MB", "peak, MB", "caller, MB", "worker, MB", "allowed, MB")
    table = Table("memory", columns)
    for model in models:
        size = model.path.stat().st_size / MEGABYTE
        allowed = 250 + 12 * size
        here, apart = alone("footprints", model.path), alone("apart", model.path)
        whole, caller, worker = (n / MEGABYTE for n in (here["peak"], apart["peak"], apart["worker_peak"]))
        table.rows.append((model.name, allowed / max(whole, caller, worker), size, whole, caller, worker, allowed))
    table.judge(1, 1)
    return table


def peers(models: Sequence[Model]) -> Table:
    """Compare the way from file to 10 cm cells with two plain scripts, and count what they miss."""
    columns = (
        "model",
        "trimesh / bimnav",
        "voxels / bimnav",
        "obstacle cells",
        "trimesh misses",
        "trimesh adds",
        "voxels miss",
        "voxels add",
        "bimnav, s",
        "trimesh, s",
        "voxels, s",
    )
    table = Table("peers", columns)
    for model in models:
        environment = environment_of(model.path)
        storeys = sorted({obstacle.storey for obstacle in environment.obstacles})
        wanted = {obstacle.global_id for obstacle in environment.obstacles} | set(environment.outside_bands)
        robot = environment.robot
        bands = [(environment.levels[s] + robot.step_height, environment.levels[s] + robot.height) for s in storeys]
        bounds = shapely.total_bounds([obstacle.footprint for obstacle in environment.obstacles])
        frame = GridFrame.covering(bounds, 0.1, margin=2)
        masks: dict[str, NDArray[np.bool_]] = {}

        def run(name: str, job: Callable[[], NDArray[np.bool_]], found: dict[str, Any] = masks) -> float:
            return cpu(lambda: found.update({name: job()}))

        (own,) = fastest(lambda: partial(_cells, model.path, storeys, frame))  # noqa: B023
        masks["bimnav"] = _cells(model.path, storeys, frame)
        slices = run("trimesh", partial(sliced, model.text, wanted, bands, frame))
        cubes = run("voxels", partial(voxelized, model.text, wanted, bands, frame))
        exact = masks["bimnav"]
        counts = [
            int(part.sum())
            for other in (masks["trimesh"], masks["voxels"])
            for part in (exact & ~other, other & ~exact)
        ]
        table.rows.append((model.name, slices / own, cubes / own, int(exact.sum()), *counts, own, slices, cubes))
    table.judge(1, 5)
    table.judge(2, 30)
    return table


def _cells(path: Path, storeys: Sequence[int], frame: GridFrame) -> NDArray[np.bool_]:
    obstacles = environment_of(path).obstacles
    return np.array([rasterize(frame, [o.footprint for o in obstacles if o.storey == storey]) for storey in storeys])


def growth(folder: Path, sizes: Sequence[int] = SIZES) -> Table:
    """Follow time and memory over the number of products."""
    columns = ("products", "B0 / footprints", "file, MB", "footprints, s", "microseconds for each", "B0, s", "peak, MB")
    table = Table("growth", (*columns, "allowed, MB"))
    for size in sizes:
        path = folder / f"growth{size}.ifc"
        products = len(write_building(path, Plan.of_size(size)).products)
        megabytes = path.stat().st_size / MEGABYTE
        own, plain = [], []
        for _ in range(3 if size < 20_000 else 2):
            own.append(alone("footprints", path))
            plain.append(alone("plain", path))
        seconds, base = (min(run["cpu"] for run in runs) for runs in (own, plain))
        top = min(run["peak"] for run in own) / MEGABYTE
        each = seconds / products * 1e6
        table.rows.append((products, base / seconds, megabytes, seconds, each, base, top, 250 + 12 * megabytes))
    table.judge(1, 2.5, 3)
    return table


# --- Which models, and the way out.


def real_models(folder: Path, match: Sequence[str]) -> Iterator[Model]:
    """Find the files with geometry whose names begin with one of some texts, the smaller ones first."""
    for path in sorted(REAL.glob("*/*.ifc*"), key=lambda path: path.stat().st_size):
        name = f"{path.parent.name}/{path.stem}"
        if not name.startswith(tuple(match)):
            continue
        try:
            environment = environment_of(path)
        except BimnavError:
            continue
        if any(element.shapes for element in environment.building.elements):
            text = path
            if path.suffix != ".ifc":
                text = folder / f"{path.stem}.ifc"
                text.write_bytes(load(path))
            yield Model(name, path, text)


def generated_model(folder: Path, products: int = 18_000) -> Model:
    """Write a generated building."""
    path = folder / f"generated{products}.ifc"
    write_building(path, Plan.of_size(products))
    return Model(f"generated, {products:,} products", path, path)


def machine() -> dict[str, str]:
    """Say what was measured with; nothing that names the machine."""
    packages = ("bimnav", "ifcopenshell", "manifold3d", "numba", "numpy", "shapely", "trimesh")
    cores = f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}"
    return {"machine": cores, "Python": platform.python_version(), **{name: version(name) for name in packages}}


def publish(tables: Sequence[Table], about: dict[str, str]) -> None:
    """Put tables into the page, each between its two marks, and draw the figure."""
    page = PAGE.read_text(encoding="utf-8")
    parts = {table.name: str(table) for table in tables}
    parts["machine"] = ", ".join(value if name == "machine" else f"{name} {value}" for name, value in about.items())
    for name, text in parts.items():
        mark = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        page = re.sub(mark, lambda match, text=text: f"{match[1]}\n{text.strip()}\n\n{match[2]}", page, flags=re.DOTALL)
    PAGE.write_text(page, encoding="utf-8")
    for table in tables:
        if table.name == "growth":
            draw_growth(table)


def draw_growth(table: Table) -> None:
    """Plot CPU time and peak memory over the number of products."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = dict(zip(table.columns, zip(*table.rows, strict=True), strict=True))
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    times, memories = figure.subplots(1, 2)
    for ax, names, label in (
        (times, ("B0, s", "footprints, s"), "CPU time, s"),
        (memories, ("allowed, MB", "peak, MB"), "peak memory, MB"),
    ):
        for name, style in zip(names, ("--", "o-"), strict=True):
            ax.loglog(columns["products"], columns[name], style, label=name.split(",")[0])
        ax.set_xlabel("products")
        ax.set_ylabel(label)
        ax.grid(visible=True, alpha=0.3)
        ax.legend()
    FIGURE.parent.mkdir(exist_ok=True)
    figure.savefig(FIGURE, dpi=120, metadata={"Software": None})


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description="Compare bimnav's reading with plain ways of doing the same.")
    parser.add_argument("--models", choices=("real", "generated", "all"), default="all")
    parser.add_argument("--match", nargs="+", default=[""], metavar="TEXT", help="real models whose names begin so")
    parser.add_argument("--only", nargs="+", metavar="PART", help="some of the tables, by name")
    parser.add_argument("--largest", type=int, default=SIZES[-1], metavar="N", help="products to which growth goes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there")
    parser.add_argument("--publish", action="store_true", help=f"put the tables into {PAGE.name}")
    chosen = parser.parse_args()
    warm_up()
    with tempfile.TemporaryDirectory(prefix="bimnav-bench-") as name:
        folder = Path(name)
        models = [*real_models(folder, chosen.match)] if chosen.models != "generated" else []
        models += [generated_model(folder)] if chosen.models != "real" else []
        parts: dict[str, Callable[[], Table]] = {
            "kernel": lambda: against_kernel(models),
            "copies": lambda: copies(folder),
            "raster": lambda: rasters([model for model in models if model.name.startswith(RASTERS)]),
            "cache": lambda: second_open(models, folder),
            "memory": lambda: memory(models),
            "peers": lambda: peers(
                [model for model in models if model.name.startswith(PEERS)] + [generated_model(folder, 1_000)]
            ),
            "growth": lambda: growth(folder, [size for size in SIZES if size <= chosen.largest]),
        }
        tables = []
        for part in chosen.only or parts:
            tables.append(parts[part]())
            print(f"## {part}\n\n{tables[-1]}", flush=True)
            if chosen.publish:
                publish(tables[-1:], machine())
    if chosen.json:
        numbers = {"about": machine(), "tables": [asdict(table) for table in tables]}
        chosen.json.write_text(json.dumps(numbers, indent=1, default=str), encoding="utf-8")


if __name__ == "__main__":
    main()
