"""`bimnav tasks`: the tasks there are."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bimnav.cli._shared import DONE, show, show_json

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    tasks = commands.add_parser("tasks", help="list the tasks there are")
    tasks.add_argument("action", nargs="?", choices=("list", "schema"), default="list")
    tasks.add_argument("--json", action="store_true")
    tasks.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    from bimnav.tasks import list_tasks, task_schema

    if options.action == "schema":
        show_json(task_schema())
        return DONE
    known = list_tasks()
    if options.json:
        show_json([{"name": t.name, "description": t.description, "source": t.source} for t in known])
    else:
        show("\n".join(f"{task.name:<20} {task.description}" for task in known))
    return DONE
