"""The same building told in another way is the same building."""

from __future__ import annotations

import random
import re

import pytest

import bimnav as bn
from tests.conftest import real_model


def retold(text: str, seed: int) -> str:
    """Give every entity of a STEP text another number and another place, so that storeys change order too."""
    head, data, tail = re.fullmatch(r"(.*?\nDATA;\s*\n)(.*)(\nENDSEC;.*)", text, re.DOTALL).groups()
    entities = re.findall(r"#\d+\s*=.*?;[ \t]*(?=\r?\n|$)", data, re.DOTALL)
    numbers = [int(re.match(r"#(\d+)", entity)[1]) for entity in entities]
    chance = random.Random(seed)
    fresh = dict(zip(numbers, chance.sample(range(1, 9 * len(numbers)), len(numbers)), strict=True))
    chance.shuffle(entities)
    strings = re.compile(r"'(?:[^']|'')*'|#(\d+)")
    renumber = lambda m: f"#{fresh[int(m[1])]}" if m[1] else m[0]  # noqa: E731 - a text may hold a # of its own
    return head + "\n".join(strings.sub(renumber, entity) for entity in entities) + tail


def assert_same_building(path, tmp_path, **job) -> None:
    text = path.read_text(encoding="latin-1")
    missions = [bn.run(path, **job)]
    for seed in (1, 2):
        other = tmp_path / f"{seed}.ifc"
        other.write_text(retold(text, seed), encoding="latin-1")
        missions.append(bn.run(other, **job))
    first, *others = missions
    for other in others:
        assert [s.name for s in other.environment.storeys] == [s.name for s in first.environment.storeys]
        assert (other.graph.kinds == first.graph.kinds).all()
        assert other.tour.length == pytest.approx(first.tour.length, abs=1e-9)
        assert {s.global_id for s in other.tour.stops} == {s.global_id for s in first.tour.stops}
        assert set(other.building.ledger.asked) == set(first.building.ledger.asked)


def test_numbers_and_order_of_entities_do_not_matter_in_the_flat(tmp_path):
    assert_same_building(bn.sample("apartment"), tmp_path, cell_size=0.1)


@pytest.mark.parametrize(
    ("name", "target"),
    [("houses/SampleHouse4.ifc", ("spill", -3.0, 2.0)), ("duplex/Duplex_A_20110907.ifc", ("spill", 3, -2, "Level 1"))],
)
def test_numbers_and_order_of_entities_do_not_matter_in_a_real_house(name, target, tmp_path):
    start = (target[1] + 0.5, target[2], *target[3:])
    assert_same_building(real_model(name), tmp_path, cell_size=0.1, targets=[target], start=start)
