"""Read two thousand damaged models and say what became of them.

    python benchmarks/campaign.py [--families NAME ...] [--number N] [--seed TEXT] [--jobs N]

prints a line for every file that was not met as it should be, and a table of families and outcomes.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.mutations import SHARES, cases
from tests.test_campaign import campaign, running_in

WRONG = "wrong"


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--families", nargs="*", default=list(SHARES), choices=list(SHARES))
    parser.add_argument("--number", type=int, help="files of each family; all of them if not given")
    parser.add_argument("--seed", default="", help="any text gives another two thousand files")
    parser.add_argument("--jobs", type=int, default=2, help="files at a time")
    parser.add_argument("--verbose", action="store_true", help="name every file")
    args = parser.parse_args()
    logging.disable()  # each product set aside is a warning
    table: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory(prefix="campaign-") as name:
        temporary = Path(name) / "temporary"
        temporary.mkdir()
        tempfile.tempdir = str(temporary)
        for family in args.families:
            row = table[family] = Counter()
            for verdict in campaign(cases(family, args.number, args.seed), Path(name), args.jobs):
                row[verdict.outcome] += 1
                row[WRONG] += bool(verdict.wrong)
                if verdict.wrong or args.verbose:
                    said = f"{verdict.outcome} in {verdict.seconds:.1f} s"
                    print(f"{family}: {verdict.case.name}: {said}: {verdict.wrong or 'as it should be'}", flush=True)
        folders, processes = list(temporary.iterdir()), running_in(temporary)
        tempfile.tempdir = None
    show(table)
    print(f"folders left: {len(folders)}, processes left: {len(processes)}")


def show(table: dict[str, Counter[str]]) -> None:
    """Print outcomes by family."""
    total = sum(table.values(), Counter())
    outcomes = [outcome for outcome, _ in total.most_common() if outcome != WRONG]
    print("| family | files |", " | ".join(outcomes), "| wrong |")
    print("| --- |", " | ".join("---:" for _ in range(len(outcomes) + 2)), "|")
    for family, row in {**table, "all": total}.items():
        cells = [row.total() - row[WRONG], *(row[outcome] or "" for outcome in outcomes), row[WRONG]]
        print(f"| {family} |", " | ".join(map(str, cells)), "|")


if __name__ == "__main__":
    main()
