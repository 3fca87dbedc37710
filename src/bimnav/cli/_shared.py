"""What the commands share: exit codes, arguments with units, printing."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bimnav._wording import printable
from bimnav.detections import parse_length, parse_place, parse_target
from bimnav.errors import BimnavError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

DONE, BUG, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 1, 2, 3, 130


def argument(read: Callable[[str], Any], name: str) -> Callable[[str], Any]:
    def convert(text: str) -> Any:
        try:
            return read(text)
        except BimnavError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    convert.__name__ = name
    return convert


length = argument(parse_length, "length")
place = argument(parse_place, "place")
target = argument(parse_target, "target")


def warn(text: str) -> None:
    """Write a line to standard error."""
    print(f"bimnav: {printable(text)}", file=sys.stderr)  # noqa: T201


def show(text: str) -> None:
    """Print lines; what else would move the cursor of a terminal, or has no place in UTF-8, becomes an escape."""
    print("\n".join(map(printable, text.split("\n"))))  # noqa: T201


def show_json(value: Any) -> None:
    print(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False).encode(errors="replace").decode())  # noqa: T201
