"""How short the tours are: published cases with known optima, and OR-tools on the same matrices.

    python benchmarks/tours.py [--quick] [--publish]

prints tables in Markdown; `--publish` also writes docs/benchmarks/tours.md. The cases are looked for in the
folder that the environment variable BIMNAV_BENCH names. OR-tools is left out where it is not installed.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bimnav as bn

REPOSITORY = Path(__file__).parents[1]
PAGE = REPOSITORY / "docs" / "benchmarks" / "tours.md"
CASES = Path(os.environ.get("BIMNAV_BENCH", REPOSITORY.parent / "shared" / "bench"))

LIMITS = (0.1, 1.0)  # seconds
LARGEST = 200  # rows
GROUPED = {"M-n101-k10-C34-V4": 458, "M-n151-k12-C51-V4": 483, "M-n200-k16-C67-V6": 605}  # proved, Freitas et al. 2023

Matrix = NDArray[np.float64]


def sections(path: Path) -> tuple[dict[str, str], dict[str, list[list[float]]]]:
    """Read a file of TSPLIB or of its relatives: the head, and the rows of numbers of every section."""
    head: dict[str, str] = {}
    rows: dict[str, list[list[float]]] = {}
    current = ""
    for line in path.read_text().splitlines():
        words = line.replace(":", " ").split()
        if not words or words[0] == "EOF":
            continue
        if words[0].endswith("SECTION"):
            current = words[0].removesuffix("_SECTION")
            rows[current] = []
        elif current:
            rows[current].append([float(word) for word in words])
        else:
            head[words[0]] = " ".join(words[1:])
    return head, rows


def rounded(head: dict[str, str], rows: dict[str, list[list[float]]]) -> Matrix:
    xy = np.array([row[1:3] for row in rows["NODE_COORD"]])
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return np.ceil(distance / math.sqrt(10)) if head["EDGE_WEIGHT_TYPE"] == "ATT" else np.floor(distance + 0.5)


def with_ortools(cost: Matrix, seconds: float) -> float:
    """Return the round trip of OR-tools: cheapest arc, then guided local search."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    whole = cost.astype(int).tolist()
    manager = pywrapcp.RoutingIndexManager(len(whole), 1, 0)
    routing = pywrapcp.RoutingModel(manager)
    transit = routing.RegisterTransitCallback(lambda a, b: whole[manager.IndexToNode(a)][manager.IndexToNode(b)])
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    options = pywrapcp.DefaultRoutingSearchParameters()
    options.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    options.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    options.time_limit.FromMilliseconds(int(1000 * seconds))
    return float(routing.SolveWithParameters(options).ObjectiveValue())


def timed(job: Callable[[], float]) -> tuple[float, float]:
    begun = time.perf_counter()
    return job(), time.perf_counter() - begun


def table(*columns: str) -> Iterator[str]:
    yield "| " + " | ".join(columns) + " |"
    yield "|" + " --- |" * len(columns)


def round_trips(*, quick: bool) -> Iterator[str]:
    try:
        import ortools  # noqa: F401

        has_peer = not quick
    except ImportError:
        has_peer = False
    with (CASES / "tsp" / "optima.csv").open() as file:
        optima = {row["instance"]: float(row["optimal_tour_length"]) for row in csv.DictReader(file)}
    yield from table("case", "optimum", "0.1 s", "1 s", "all the work", "bound", "OR-tools, 1 s")
    gaps = []
    for name, optimum in sorted(optima.items()):
        head, rows = sections(CASES / "tsp" / f"{name}.tsp")
        if int(head["DIMENSION"]) > (60 if quick else LARGEST):
            continue
        cost = rounded(head, rows)
        found = [bn.order_stops(cost, return_to_start=True, time_limit=limit) for limit in (*LIMITS, None)]
        gaps.append([order.length / optimum - 1 for order in found])
        peer = f"{with_ortools(cost, 1.0) / optimum - 1:.2%}" if has_peer else "–"
        cells = [*(f"{gap:.2%}" for gap in gaps[-1]), f"{1 - found[-1].bound / optimum:.2%} below", peer]
        yield f"| {name} | {optimum:g} | " + " | ".join(cells) + " |"
    yield "| **mean** | | " + " | ".join(f"{gap:.3%}" for gap in np.mean(gaps, axis=0)) + " | | |"


def grouped(*, quick: bool) -> Iterator[str]:
    yield from table("case", "robots", "best known", "found", "gap", "seconds")
    for name, best in GROUPED.items():
        if quick and name != "M-n101-k10-C34-V4":
            continue
        head, rows = sections(CASES / "vrp" / f"{name}.vrp")
        group = np.zeros(int(head["DIMENSION"]), dtype=int)
        for number, *members in rows["MUTUALLY_EXCLUSIVE_GROUP"]:
            group[np.array(members, dtype=int) - 1] = number
        robots = int(head["VEHICLES"])
        costs, demands = rounded(head, rows), [row[1] for row in rows["DEMAND"]]
        limits = [float(head["CAPACITY"])] * robots

        def job() -> float:
            return bn.assign_stops(
                costs,  # noqa: B023
                [0] * robots,  # noqa: B023
                return_to_start=True,
                groups=group,  # noqa: B023
                demands=demands,  # noqa: B023
                capacities=limits,  # noqa: B023
                time_limit=1.0,
            ).total

        found, seconds = timed(job)
        yield f"| {name} | {robots} | {best} | {found:g} | {found / best - 1:.2%} | {seconds:.2f} |"


def page(*, quick: bool) -> str:
    lines = [
        "### Round trips",
        "",
        "Published cases of up to 200 places with proved optima (TSPLIB95, Reinelt 1991). `order_stops` with a time "
        "limit, and without one: then it stops when a fixed amount of work is done, and equal inputs give equal "
        "orders. The bound is what it proves that no order is shorter than.",
        "",
        *round_trips(quick=quick),
        "",
        "### One of several places, and several robots",
        "",
        "`assign_stops` on generalised routing cases: each robot has a capacity, and one place of every group is "
        "visited, as with a target that can be served from several cells. One second each.",
        "",
        *grouped(quick=quick),
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the smallest cases, without OR-tools")
    parser.add_argument("--publish", action="store_true", help="write docs/benchmarks/tours.md")
    options = parser.parse_args()
    if not CASES.exists():
        sys.exit(f"{CASES} does not exist: set BIMNAV_BENCH")
    bn.order_stops(np.ones((20, 20)))  # compiles
    text = page(quick=options.quick)
    print(text)
    if options.publish:
        PAGE.write_text(text)


if __name__ == "__main__":
    main()
