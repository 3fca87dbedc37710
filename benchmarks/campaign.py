"""Read two thousand damaged models and say what became of them.

    python benchmarks/campaign.py [--families NAME ...] [--number N] [--jobs N]

prints one line for each file that was not met as it should be, and a table of families and outcomes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.mutations import SHARES, cases
from tests.test_campaign import campaign, running_in


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--families", nargs="*", default=list(SHARES), choices=list(SHARES))
    parser.add_argument("--number", type=int)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--verbose", action="store_true")
    args = parser.parse_args()
    table: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory(prefix="campaign-") as name:
        temporary = Path(name) / "temporary"
        temporary.mkdir()
        tempfile.tempdir = str(temporary)
        for family in args.families:
            row = table[family] = Counter()
            for verdict in campaign(cases(family, args.number), Path(name), args.jobs):
                row[verdict.outcome] += 1
                row["wrong"] += bool(verdict.wrong)
                if verdict.wrong or args.verbose:
                    outcome = f"{verdict.outcome} in {verdict.seconds:.1f} s"
                    print(f"{family}: {verdict.case.name}: {outcome} {verdict.wrong}", flush=True)
        left = [path.name for path in temporary.iterdir()], running_in(temporary)
        tempfile.tempdir = None
    show(table)
    print(f"folders left: {len(left[0])}, processes left: {len(left[1])}")


def show(table: dict[str, Counter[str]]) -> None:
    total = sum(table.values(), Counter())
    columns = [name for name, _ in total.most_common() if name != "wrong"]
    print("| family | files |", " | ".join(columns), "| wrong |")
    print("| --- |", " | ".join("---:" for _ in range(len(columns) + 2)), "|")
    for family, row in {**table, "all": total}.items():
        print(
            f"| {family} | {row.total() - row['wrong']} |",
            " | ".join(str(row[name] or "") for name in columns),
            f"| {row['wrong']} |",
        )


if __name__ == "__main__":
    main()
