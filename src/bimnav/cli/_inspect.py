"""`bimnav inspect`: what a model holds."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import bimnav as bn
from bimnav.cli._shared import DONE, length, show, show_json

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands

_EXAMPLES = """\
examples:
  bimnav inspect house.ifc
  bimnav inspect architecture.ifc electrical.ifc --json
  bimnav inspect house.ifc --readiness --radius 30cm --html readiness.html
  bimnav inspect house.ifc --asset 2O2Fr$t4X7Zf8NOew3FNr2 --upstream valve
"""


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    inspect = commands.add_parser(
        "inspect",
        help="say what a model holds, and what is wrong with it",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    inspect.add_argument("models", nargs="+", metavar="MODEL.ifc", help="one file, or several of one building")
    inspect.add_argument("--readiness", action="store_true", help="say which rooms and doors a robot reaches")
    inspect.add_argument("--html", metavar="FILE", help="write the readiness report as a page")
    inspect.add_argument("--radius", type=length, default=0.25, help="of that robot (default: 0.25)")
    inspect.add_argument("--height", type=length, default=1.0, help="of that robot (default: 1)")
    inspect.add_argument("--asset", metavar="GLOBAL_ID", help="print the asset card of an element or a room")
    inspect.add_argument("--upstream", metavar="KIND", help="with --asset: the way to the first valve, breaker, ...")
    inspect.add_argument("--json", action="store_true", help="print JSON for machines")
    inspect.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    building = bn.read_ifc(options.models)
    if options.asset is not None:
        return _asset(building, options)
    if options.readiness or options.html:
        return _readiness(building, options)
    report = bn.inspect(building)
    if options.json:
        show_json(report)
        return DONE
    ledger = report["ledger"]
    lines = [f"{report['name']}: {report['schema']}, length unit {report['unit']}"]
    lines += [
        f"  {storey['name']:<24} floor at {storey['floor_level']:8.3f} m  {storey['floor_area']:9.1f} m2  "
        f"{storey['spaces']:3d} spaces  {storey['doors']:3d} doors"
        for storey in report["storeys"]
    ]
    lines.append("  elements " + ", ".join(f"{count} {name}" for name, count in report["classes"].items()))
    lines.append("  ledger   " + ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in ledger.items()))
    for issue in report["issues"]:
        some = ", ".join(issue["global_ids"][:3]) + (" ..." if len(issue["global_ids"]) > 3 else "")
        lines.append(
            f"  {issue['severity']}: {issue['message']} {issue['hint']} {f'[{some}]' if some else ''}".rstrip()
        )
    show("\n".join(lines))
    return DONE


def _asset(building: bn.Building, options: argparse.Namespace) -> int:
    asset = building.asset(options.asset)
    way = asset.find_upstream(options.upstream) if options.upstream else ()
    if options.json:
        card = asset.to_dict()
        show_json(card | {"way_upstream": [each._asdict() for each in way]} if options.upstream else card)
        return DONE
    show(repr(asset))
    if options.upstream:
        steps = " > ".join(f"{each.name or each.ifc_class} ({each.global_id})" for each in way)
        show(f"  first {options.upstream} upstream: {steps or 'none is connected'}")
    return DONE


def _readiness(building: bn.Building, options: argparse.Namespace) -> int:
    from bimnav._files import write_text

    ready = building.readiness(bn.Robot(radius=options.radius, height=options.height))
    if options.html:
        write_text(options.html, ready.to_html())
    if options.json:
        show_json(ready.to_dict())
    else:
        show(_readiness_summary(ready))
        if options.html:
            show(f"  wrote    {options.html}")
    return DONE


def _readiness_summary(ready: bn.Readiness) -> str:
    lines = [f"{ready.building}, for a robot of radius {ready.robot.radius:g} m and height {ready.robot.height:g} m"]
    lines += [
        f"  {storey.name:<24} {storey.rooms_reached:3d} of {storey.rooms:3d} rooms  "
        f"{storey.reached_area:8.1f} of {storey.floor_area:8.1f} m2  "
        f"{storey.doors_connecting:3d} of {storey.doors:3d} doors"
        for storey in ready.storeys
        if storey.floor_area
    ]
    lines += [
        f"  not reached: {room.name} ({room.global_id}): {room.detail.rstrip('.')}. {room.hint}"
        for room in ready.unreached
    ]
    return "\n".join(lines)
