"""`bimnav cache`: what reading has kept."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bimnav.cli._shared import DONE, show, show_json

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands

_EXAMPLES = """\
examples:
  bimnav cache
  bimnav cache clear
"""


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    cache = commands.add_parser(
        "cache",
        help="show or clear what reading has kept",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    cache.add_argument("action", nargs="?", choices=("show", "clear"), default="show")
    cache.add_argument("--json", action="store_true", help="print JSON for machines")
    cache.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    from bimnav.ifc import cache_info, clear_cache

    if options.action == "clear":
        count = clear_cache()
        show_json({"removed": count}) if options.json else show(f"removed {count} models")
        return DONE
    info = cache_info()
    if options.json:
        show_json({"folder": str(info.folder), "models": info.models, "bytes": info.size})
    else:
        show(f"{info.models} models, {info.size / 1e6:.1f} MB in {info.folder}")
    return DONE
