"""How long the rules of all built-in tasks take, against reading the geometry of the same model, in CPU time.

    python benchmarks/tasks.py [MODEL.ifc ...] [--generated PRODUCTS] [--publish]

prints a table in Markdown; `--publish` also puts it into docs/benchmarks/tasks.md. Without a model, those of the
folder that BIMNAV_REAL_IFC names are taken, the largest first. Every building is read anew for every task, so that
nothing is known of it before. The bar: the rules of a task in less time than reading the model takes.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from building import Plan, write_building
from measuring import cpu, warm_up

import bimnav as bn
from bimnav.building import Building
from bimnav.tasks import Task, check_rules, entourage
from bimnav.tasks._task import RULE_LISTS

REAL = Path(os.environ.get("BIMNAV_REAL_IFC", Path(__file__).parents[1].parent / "shared" / "ifc"))
PAGE = Path(__file__).parents[1] / "docs" / "benchmarks" / "tasks.md"
LARGEST = 8


def models(options: argparse.Namespace, folder: Path) -> Iterator[Path]:
    """Yield the models to measure."""
    yield from options.models or sorted(REAL.glob("*/*.ifc"), key=lambda path: -path.stat().st_size)[:LARGEST]
    if options.generated:
        path = folder / f"generated {options.generated}.ifc"
        write_building(path, Plan.of_size(options.generated))
        yield path


def seconds_of(building: Building, tasks: list[Task]) -> tuple[float, int]:
    """Return the CPU seconds of all rules of some tasks, and how often a filter was evaluated."""
    select, asked = building.selector, []

    def counted(query: str) -> Iterable[str]:
        asked.append(query)
        return select(query) if select else ()

    watched = replace(building, selector=counted)
    return cpu(lambda: [check_rules(task, watched) for task in tasks]), len(asked)


def row_of(path: Path, tasks: list[Task]) -> str:
    """Measure one model."""
    geometry = cpu(lambda: bn.read_ifc(path, cache=False, isolate=False))
    alone = {task.name: seconds_of(bn.read_ifc(path), [task])[0] for task in tasks}
    dearest = max(alone, key=lambda name: alone[name])
    building = bn.read_ifc(path)
    whole, asked = seconds_of(building, tasks)
    filters = len({rule.filter for task in tasks for kind in RULE_LISTS for rule in getattr(task, kind)})
    products = len(building.elements) + len(building.spaces)
    return (
        f"| {path.stem[:32]} | {products} | {geometry:.2f} | {alone[dearest]:.2f} ({dearest}) | {whole:.2f} | "
        f"{whole / geometry:.2f} | {asked} of {filters} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--generated", type=int, metavar="PRODUCTS")
    parser.add_argument("--publish", action="store_true")
    options = parser.parse_args()
    warm_up()
    tasks = [*(bn.load_task(info.name) for info in bn.list_tasks()), entourage()]
    lines = [
        "| model | products | reading, s | dearest task, s | all tasks, s | all tasks / reading | filters evaluated |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    with tempfile.TemporaryDirectory() as folder:
        lines += [row_of(path, tasks) for path in models(options, Path(folder))]
    told = "\n".join([*lines, "", f"{len(tasks)} tasks."])
    print(told)
    if options.publish:
        PAGE.write_text(f"{told}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
