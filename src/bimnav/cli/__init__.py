"""The command line: `bimnav run`, `inspect`, `tasks`, `robots`, `cache`, `doctor` and `completion`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

import bimnav as bn
from bimnav._wording import printable
from bimnav.cli import _cache, _completion, _doctor, _inspect, _robots, _run, _tasks
from bimnav.cli._shared import BAD_INPUT, BUG, DONE, INTERRUPTED
from bimnav.errors import BimnavError, UnsafePlanError

__all__ = ["main"]

_SIGNED = (
    "--start",
    "--end",
    "--clearance",
    "--target",
    "--cell",
    "--radius",
    "--height",
    "--speed",
)  # their values may begin with a minus

_EXAMPLES = """\
examples:
  bimnav inspect house.ifc
  bimnav run house.ifc --task cleaning --cell 10cm --out out
  bimnav COMMAND --help
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message} (try {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options = _parser().parse_args(_joined(sys.argv[1:] if arguments is None else list(arguments)))
    try:
        command: Callable[[argparse.Namespace], int] = options.command
        return command(options)
    except BimnavError as error:
        print("\n".join(map(printable, f"bimnav: {error.code} {error}".split("\n"))), file=sys.stderr)  # noqa: T201
        return BUG if isinstance(error, UnsafePlanError) else BAD_INPUT
    except KeyboardInterrupt:
        print("bimnav: stopped", file=sys.stderr)  # noqa: T201
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone, as in `bimnav ... | head`
        sys.stderr.close()
        return DONE


def _joined(arguments: list[str]) -> list[str]:
    """Join options to values that begin with a minus, which argparse would take for options."""
    joined: list[str] = []
    for argument in arguments:
        if (
            joined
            and joined[-1] in _SIGNED
            and argument[:1] == "-"
            and argument[1:2].isdigit() | (argument[1:2] == ".")
        ):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="bimnav",
        description="From IFC building models to robot tasks, routes and simulation.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bimnav {bn.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for room in (_run, _inspect, _tasks, _robots, _cache, _doctor, _completion):
        room.add_to(commands)
    return parser
