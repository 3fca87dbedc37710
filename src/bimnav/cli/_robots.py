"""`bimnav robots`: the robots there are."""

from __future__ import annotations

import argparse
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from bimnav.cli._shared import DONE, show, show_json

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands
    from bimnav.robot import Robot

_EXAMPLES = """\
examples:
  bimnav robots
  bimnav robots show inspection
  bimnav robots show robots.toml#scout --json

robots of your own are known by name if BIMNAV_ROBOTS lists their folder.
"""


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    robots = commands.add_parser(
        "robots",
        help="list the robots there are, show one, or print the schema of their files",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    robots.add_argument(
        "action",
        nargs="?",
        choices=("list", "show", "schema"),
        default="list",
        help="schema: the JSON Schema of robot files, for editors",
    )
    robots.add_argument("robot", nargs="?", metavar="NAME|FILE#NAME", help="with show: which one")
    robots.add_argument("--json", action="store_true", help="print JSON for machines")
    robots.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    from bimnav.errors import RobotError
    from bimnav.robots import list_robots, load_robot, robot_schema

    if options.action == "schema":
        show_json(robot_schema())
        return DONE
    if options.action == "show":
        if options.robot is None:
            raise RobotError("no robot is named.", "Name one, as in bimnav robots show inspection.")
        values = _plain(load_robot(options.robot))
        if options.json:
            show_json(values)
        else:
            show("\n".join(f"{name:<16} {_told(value)}" for name, value in values.items()))
        return DONE
    known = list_robots()
    if options.json:
        show_json([each._asdict() for each in known])
    else:
        show("\n".join(f"{robot.name:<16} {robot.description}" for robot in known))
    return DONE


def _plain(robot: Robot) -> dict[str, Any]:
    """Return the fields of a robot; None where there is no limit."""
    return {name: None if value == math.inf else value for name, value in asdict(robot).items()}


def _told(value: Any) -> str:
    if value is None or value == ():
        return "-"
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
