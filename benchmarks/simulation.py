"""How fast the simulation is: events a second beside bare simpy, and a large shift in a tall building.

    python benchmarks/simulation.py [--quick] [--publish]

prints a table in Markdown; `--publish` also writes docs/benchmarks/simulation.md.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
import simpy

import bimnav as bn
from bimnav.graph import NavGraph
from bimnav.grid import Cell
from bimnav.stops import Stop

REPOSITORY = Path(__file__).parents[1]
PAGE = REPOSITORY / "docs" / "benchmarks" / "simulation.md"
SHIFT = 8 * 3600.0
NAMES = (
    "`simulate`, log and track kept",
    "`simulate(history=False)`",
    "`simulate`, a robot that accelerates and turns",
    "the same with `history=False`",
    "the same, every leg another",
    "the same among three people, doors that open and a battery",
)


class Rounds:
    """A tour from one end of a corridor to the other, many times over, without a planner.

    Parameters
    ----------
    differ
        Whether every leg is another: rounds are worked out once.
    """

    def __init__(self, count: int, *, differ: bool = False) -> None:
        self.graph = NavGraph.from_mask(np.ones((1, 12), dtype=bool))
        cells = [Cell(0, 0, 10), Cell(0, 0, 0)]
        shift = 0.4 / count if differ else 0.0
        ends = [(0.5, 0.5, 0.0), *((10.5 - 10 * (k % 2) + k * shift, 0.5, 0.0) for k in range(count))]
        self.stops = [Stop(f"s{k}", f"s{k}", cells[k % 2], end, end) for k, end in enumerate(ends[1:])]
        self.route = [np.array(pair) for pair in pairwise(ends)]
        self.start, self.start_point, self.unreached, self.return_to_start = cells[1], ends[0], (), False


def bare(events: int) -> float:
    """Return the events of one simpy process that does nothing but wait, in a second of processor time."""

    def wait(clock):
        for _ in range(events):
            yield clock.timeout(1.0)

    clock = simpy.Environment()
    clock.process(wait(clock))
    begin = time.process_time()
    clock.run()
    return events / (time.process_time() - begin)


def ours(stops: int, *, differ: bool = False, **more) -> tuple[float, int]:
    """Return the events of a simulation in a second of processor time, and their number."""
    tour, seen = Rounds(stops, differ=differ), [0]

    def count(_):
        seen[0] += 1

    begin = time.process_time()
    bn.simulate(tour, service_time=30.0, on_event=count, **more)
    return seen[0] / (time.process_time() - begin), seen[0]


def hotel(storeys: int, size: int = 60) -> tuple[NavGraph, list[list[Cell]]]:
    """Make storeys of rooms along corridors, joined by a lift, and list the cells of the rooms."""
    floor = np.zeros((size, size), dtype=bool)
    floor[size // 2 - 2 : size // 2 + 2] = True
    rooms = []
    for col in range(0, size - 6, 6):
        for low, door in ((size // 2 - 12, size // 2 - 3), (size // 2 + 3, size // 2 + 2)):
            floor[low : low + 9, col : col + 5] = True
            floor[door, col + 2] = True
            rooms.append((low + 4, col + 2))
    mask = np.repeat(floor[None], storeys, axis=0)
    graph = NavGraph.from_mask(mask, cell_size=0.5)
    return graph, [[Cell(storey, row, col) for row, col in rooms] for storey in range(storeys)]


def shift(robots: int, storeys: int) -> dict[str, float]:
    """Play a shift: every robot serves the rooms of its storey, over and over, with doors, people and a battery."""
    graph, rooms = hotel(storeys)
    begin = time.perf_counter()
    tours, fleet = [], []
    for k in range(robots):
        cells = rooms[k % storeys]
        order = np.random.default_rng(k).permutation(len(cells)).tolist()
        start, stops = cells[order[0]], []
        rounds = int(SHIFT / (len(cells) * 75)) + 1
        one = bn.plan_tour(graph, start, [stop_in(graph, cells[i], f"r{k}-{i}") for i in order], return_to_start=True)
        for lap in range(rounds):
            stops += [Stop(f"{s.global_id}.{lap}", s.name, s.cell, s.destination, s.end) for s in one.stops]
        tours.append(Laps(one, stops, rounds))
        fleet.append(
            bn.Robot(f"R{k + 1}", speed=0.5, radius=0.2, acceleration=0.5, battery_wh=150, drive_power=60,
                     work_power=40, idle_power=10, charge_power=300)
        )  # fmt: skip
    chargers = [
        bn.Charger(f"dock {s}-{c}", Cell(s, 29, c), graph.frame.center_of(Cell(s, 29, c)))
        for s in range(storeys)
        for c in (0, 59)
    ]
    doors = [
        bn.SimDoor(f"door {s}-{col}", "automatic", 3.0, polygon=shapely.box(col / 2 + 0.8, 13.3, col / 2 + 1.7, 14.2),
                   storey=s)
        for s in range(storeys)
        for col in range(0, 54, 6)
    ]  # fmt: skip
    people = [bn.Person(f"guest {k}", storey=k % storeys) for k in range(storeys)]
    planned, busy = time.perf_counter(), time.process_time()
    result = bn.simulate(
        tours,
        robots=fleet,
        chargers=chargers,
        doors=doors,
        people=people,
        service_time=bn.Chance("normal", (45, 10), "s"),
        until=SHIFT,
    )
    done, rested = time.perf_counter(), time.process_time()
    took = {"plan": planned - begin, "seconds": done - planned, "processor": rested - busy}
    return {"served": len(result.served), "distance": result.distance, "events": len(result.log)} | took


class Laps:
    """A tour that is done several times."""

    def __init__(self, tour, stops, rounds: int) -> None:
        self.graph, self.start, self.start_point = tour.graph, tour.start, tour.start_point
        self.stops, self.unreached, self.return_to_start = stops, (), False
        lap = list(tour.route)
        home, first = lap[-1], lap[0]
        self.route = lap[:-1] + [leg for _ in range(rounds - 1) for leg in (np.vstack([home, first[1:]]), *lap[1:-1])]


def stop_in(graph: NavGraph, cell: Cell, name: str) -> Stop:
    point = graph.frame.center_of(cell)
    return Stop(name, name, cell, point, point)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--publish", action="store_true")
    given = parser.parse_args()
    count = 2_000 if given.quick else 5_000
    floor = max(bare(5 * count) for _ in range(3))
    careful = bn.Robot("R1", acceleration=0.5, turn_rate=1.0)
    quiet = {"robot": careful, "history": False}
    tired = bn.Robot("R1", acceleration=0.5, turn_rate=1.0, radius=0.2, battery_wh=1e6, drive_power=60, work_power=40)
    busy = {
        "robot": tired,
        "people": [
            bn.Person(f"guest {k}", route=((3.0 * k, -4.0), (3.0 * k, 5.0)), speed=0.6 + 0.2 * k, back_and_forth=True)
            for k in (1, 2, 3)
        ],
        "doors": [bn.SimDoor("door", "automatic", 3.0, polygon=shapely.box(5.0, 0.0, 5.5, 1.0))],
    }
    kinds = (
        {},
        {"history": False},
        {"robot": careful},
        quiet,
        quiet | {"differ": True},
        quiet | busy | {"differ": True},
    )
    rates = [max(ours(count, **more)[0] for _ in range(3)) for more in kinds]
    lines = [
        "| | events in a second of processor time | of bare simpy |",
        "| --- | --- | --- |",
        f"| simpy, one process that waits | {floor:,.0f} | 1.000 |",
        *(f"| {name} | {rate:,.0f} | {rate / floor:.3f} |" for name, rate in zip(NAMES, rates, strict=True)),
        "",
    ]
    tracemalloc.start()
    peaks = []
    for stops in (count, 2 * count):
        tracemalloc.reset_peak()
        ours(stops, history=False)
        peaks.append(tracemalloc.get_traced_memory()[1] / 1e6)
    tracemalloc.stop()
    lines += [
        f"Memory without history, the tour itself included: {peaks[0]:.1f} MB for {count:,} stops, "
        f"{peaks[1]:.1f} MB for twice as many.",
        "",
    ]
    sizes = [(5, 2)] if given.quick else [(10, 2), (50, 10)]
    lines += [
        "| robots | storeys | hours | events | stops served | km driven | planning, s | simulation, s | processor, s |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    print("\n".join(lines), flush=True)
    for robots, storeys in sizes:
        found = shift(robots, storeys)
        lines.append(
            f"| {robots} | {storeys} | 8 | {found['events']:,} | {found['served']:,} | {found['distance'] / 1000:.1f} "
            f"| {found['plan']:.1f} | {found['seconds']:.1f} | {found['processor']:.1f} |"
        )
        print(lines[-1], flush=True)
    text = "\n".join(lines) + "\n"
    if given.publish:
        head = "### Simulation\n\nAn event is a row of the log. The shift has doors that open, people who walk around, "
        head += "batteries and chargers on every storey, and draws every service time. "
        head += "One process on two cores that others used, too.\n\n"
        PAGE.write_text(head + text)


if __name__ == "__main__":
    main()
