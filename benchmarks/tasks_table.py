"""What every task of the library finds in real models, against counts made by hand.

    python benchmarks/tasks_table.py [--publish]

prints the table in Markdown; `--publish` writes it to docs/tasks/table.md, and the part of each task to
docs/tasks/found/. Real models are looked for in the folder that the environment variable BIMNAV_REAL_IFC names.
The counts, and why they are what they are, stand in tests/task_counts.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bimnav as bn
from bimnav.building import Building
from bimnav.tasks import match

REPOSITORY = Path(__file__).parents[1]
REAL = Path(os.environ.get("BIMNAV_REAL_IFC", REPOSITORY.parent / "shared" / "ifc"))
COUNTS = REPOSITORY / "tests" / "task_counts.csv"
PAGES = REPOSITORY / "docs" / "tasks"
OBSTACLES = "obstacles"  # stands for a task in the counts
ROBOT = bn.Robot(name="robot", radius=0.25)

HEAD = """# What is found in real models

Each number is what the rules of a task find; where someone who read the model counts another one, it stands in
brackets. Tasks that find nothing in a model, as they should, are left out, unless the model has things that look like
their targets. `python benchmarks/tasks_table.py --publish` writes this page.
"""


@dataclass(frozen=True, slots=True)
class Row:
    """A task in a model: what was counted by hand and why, and what is found."""

    model: str
    task: str
    counted: int | None
    why: str
    found: int

    @property
    def told(self) -> str:
        """The number found, and in brackets the number counted if it is another."""
        return str(self.found) if self.counted in (self.found, None) else f"{self.found} ({self.counted})"


def rows() -> Iterator[Row]:
    """Yield what is found wherever there is something to find, or to be mistaken about."""
    with COUNTS.open(encoding="utf-8") as file:
        listed = {(row["model"], row["task"]): row for row in csv.DictReader(file)}
    models = list(dict.fromkeys(model for model, _ in listed))
    tasks = [*(info.name for info in bn.list_tasks()), OBSTACLES]
    for model in models:
        building = bn.read_ifc(REAL / model)
        for task in tasks:
            found, row = found_by(task, building), listed.get((model, task))
            if row is not None or found:
                counted = 0 if row is None else int(row["count"]) if row["count"] else None
                yield Row(model, task, counted, row["why"] if row else "", found)


def found_by(task: str, building: Building) -> int:
    """Count the targets of a task, or what blocks a robot whatever its task."""
    if task == OBSTACLES:
        environment = bn.make_environment(building, bn.Task("look"), ROBOT)
        return len({obstacle.global_id for obstacle in environment.obstacles})
    rules = bn.load_task(task).targets
    return len({hit.element.global_id for rule in rules for hit in match(rule, building)})


def table(listed: Iterable[Row], first: str) -> str:
    """Return a table whose first column is the `model` or the `task`."""
    lines = [f"| {first} | found | what it is |", "| --- | ---: | --- |"]
    lines += [f"| {getattr(row, first)} | {row.told} | {row.why} |" for row in listed]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the tables, or write them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--publish", action="store_true", help="write the pages of the documentation")
    listed = list(rows())
    by_model, by_task = defaultdict(list), defaultdict(list)
    for row in listed:
        by_model[row.model].append(row)
        by_task[row.task].append(row)
    page = "\n".join([HEAD, *(f"## {model}\n\n{table(found, 'task')}" for model, found in by_model.items())])
    if not parser.parse_args().publish:
        print(page)
        return
    (PAGES / "table.md").write_text(page, encoding="utf-8")
    (PAGES / "found").mkdir(exist_ok=True)
    for task, found in by_task.items():
        if task != OBSTACLES:
            (PAGES / "found" / f"{task}.md").write_text(table(found, "model"), encoding="utf-8")


if __name__ == "__main__":
    main()
