"""Which doors of real models connect their two sides, for a robot 0.5 m wide on cells of 5 cm, and why not the others.

    python benchmarks/doors.py [MODEL.ifc ...]

prints the table of docs/readiness.md; without models it takes all of `BIMNAV_REAL_IFC`.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from pathlib import Path

import bimnav as bn
from bimnav.errors import InputError
from bimnav.readiness import doors_of

REAL = Path(os.environ.get("BIMNAV_REAL_IFC", Path(__file__).parents[2] / "shared" / "ifc"))
LOW = 0.05  # metres; a sill below this stops no robot
ROBOT = bn.Robot(radius=0.25)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    models = parser.parse_args().models or sorted(REAL.glob("*/*.ifc*"))
    total: Counter[str] = Counter()
    print("| model | doors | inner | outer | connect | fill an opening, sill under 5 cm | the others |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | --- |")
    for path in models:
        try:
            building = bn.read_ifc(path)
        except InputError:
            continue
        if any(door.element.shapes for door in building.doors):
            counts, others = doors_in(building)
            total += counts
            show(path.stem, counts, "; ".join(others))
    show("**together**", total, f"{total['fitting that connect'] / max(total['fitting'], 1):.1%}")


def doors_in(building: bn.Building) -> tuple[Counter[str], list[str]]:
    """Count the doors of a building, and say what is the matter with those that do not connect."""
    checks = doors_of(bn.make_environment(building, bn.Task("look", "doors"), ROBOT), cell_size=0.05)
    counts: Counter[str] = Counter(doors=len(checks))
    reasons: Counter[str] = Counter()
    for door, check in zip(building.doors, checks, strict=True):
        fits = door.opening is not None and door.opening.shapes and door.sill is not None and door.sill < LOW
        counts["inner"] += check.leads == "inside"
        counts["outer"] += check.leads == "outside"
        counts["connect"] += check.connects
        counts["fitting"] += bool(fits)
        counts["fitting that connect"] += bool(fits) and check.connects
        if not check.connects:
            reasons[f"{check.reason}: {check.detail}"] += 1
    return counts, [f"{reason} ({number})" for reason, number in reasons.most_common()]


def show(name: str, counts: Counter[str], others: str) -> None:
    """Print one row."""
    fitting = f"{counts['fitting that connect']} of {counts['fitting']}"
    cells = [counts[column] for column in ("doors", "inner", "outer", "connect")]
    print(f"| {name} |", " | ".join(map(str, cells)), f"| {fitting} | {others} |", flush=True)


if __name__ == "__main__":
    main()
