"""`bimnav doctor`: versions and a self-test."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bimnav.cli._shared import BUG, DONE, show, show_json

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands

_EXAMPLES = """\
examples:
  bimnav doctor
  bimnav doctor --json > doctor.json
"""


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    doctor = commands.add_parser(
        "doctor",
        help="print versions and test the installation",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    doctor.add_argument("--json", action="store_true", help="print JSON for machines")
    doctor.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    from bimnav.doctor import examine

    report = examine()
    if options.json:
        show_json(report)
    else:
        lines = [f"{name:<14} {version}" for name, version in report["versions"].items()]
        lines += [f"{'ok' if row['ok'] else 'FAILED':<14} {row['test']}{row['why']}" for row in report["tests"]]
        show("\n".join(lines))
    return DONE if report["ok"] else BUG
