"""The cache under several processes, kills and a limit of size; what it promises one process is with the reading."""

from __future__ import annotations

import hashlib
import logging
import os
import random
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bimnav.ifc._model import Model
from bimnav.ifc._store import Cache, cache_info, clear_cache, pack, unpack
from tests.ifc_text import box, model

posix = pytest.mark.skipif(os.name != "posix", reason="needs signals")


def packed(size: int, mark: int) -> bytes:
    """A model of one mesh; all its numbers are the mark."""
    arrays = {
        "vertices": np.full((size, 3), float(mark)),
        "faces": np.zeros((0, 3), np.int32),
        "vertex_offsets": np.array([0, size]),
        "face_offsets": np.array([0, 0]),
        "shape_mesh": np.zeros(0, np.int32),
        "placements": np.zeros((0, 4, 4)),
    }
    return pack(Model({"mark": mark}, arrays))


def key(number: int) -> str:
    return hashlib.sha256(str(number).encode()).hexdigest()


def script(tmp_path: Path, name: str, text: str) -> Callable[..., subprocess.Popen[str]]:
    """Write a program and return what starts it."""
    path = tmp_path / f"{name}.py"
    path.write_text(textwrap.dedent(text))
    root = Path(__file__).parents[1]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(root / "src"), str(root)])}

    def start(*arguments: object) -> subprocess.Popen[str]:
        command = [sys.executable, str(path), *map(str, arguments)]
        return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    return start


# size


def test_beyond_its_limit_the_cache_forgets_what_was_not_used_for_longest(tmp_path: Path):
    data = packed(1000, 1)
    cache = Cache(tmp_path, limit=3 * len(data))
    for number in range(3):
        cache.put(key(number), data)
        os.utime(tmp_path / f"{key(number)}.bimnav", (number, number))
    assert cache.get(key(0)) is not None  # and so it is used
    cache.put(key(3), data)
    assert [cache.get(key(number)) is not None for number in range(4)] == [True, False, True, True]
    assert cache_info(tmp_path).size <= cache.limit


def test_what_is_larger_than_the_cache_drives_nothing_out(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    small, large = packed(10, 1), packed(10_000, 2)
    cache = Cache(tmp_path, limit=2 * len(small))
    cache.put(key(1), small)
    cache.put(key(2), large)
    assert "not cached" in caplog.text
    assert cache.get(key(1)) is not None
    assert cache_info(tmp_path).models == 1


# several processes


def test_one_of_four_processes_reads_and_the_others_wait_for_it(tmp_path: Path):
    house = tmp_path / "house.ifc"
    house.write_text(model(box(200)))
    read = script(
        tmp_path,
        "reader",
        """
        import sys
        from bimnav.ifc import read_ifc
        told = []
        building = read_ifc(sys.argv[1], cache=sys.argv[2], progress=lambda done, total, text: told.append(text))
        print(len(building.elements), "opening" in told)
        """,
    )
    readers = [read(house, tmp_path / "cache") for _ in range(4)]
    answers = [process.communicate(timeout=60) for process in readers]
    assert sorted(out.split() for out, _ in answers) == [["2", "False"]] * 3 + [["2", "True"]], answers


def test_who_waits_too_long_goes_on_alone(tmp_path: Path):
    hold = script(
        tmp_path,
        "holder",
        """
        import sys, time
        from pathlib import Path
        from bimnav.ifc._store import Cache
        with Cache(Path(sys.argv[1])).alone(sys.argv[2], 0.0, print):
            print("held", flush=True)
            time.sleep(60)
        """,
    )
    cache = Cache(tmp_path / "cache")
    with hold(tmp_path / "cache", key(1)) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        told: list[str] = []
        start = time.monotonic()
        with cache.alone(key(2), 10.0, lambda: told.append("another model")) as has_waited:
            assert not has_waited
        with cache.alone(key(1), 0.3, lambda: told.append("waits")) as has_waited:
            assert has_waited
        assert 0.3 <= time.monotonic() - start < 5.0
        assert set(told) == {"waits"}
        holder.kill()
        holder.wait()
        with cache.alone(key(1), 10.0, lambda: None) as has_waited:  # the dead hold no lock
            assert not has_waited


def test_processes_that_write_read_and_clear_one_cache_never_meet_a_damaged_model(tmp_path: Path):
    work = script(
        tmp_path,
        "worker",
        """
        import logging, random, sys
        from pathlib import Path
        from bimnav.errors import CacheError
        from bimnav.ifc._store import Cache, clear_cache
        from tests.test_cache import key, packed
        folder, seed = Path(sys.argv[1]), int(sys.argv[2])
        logging.basicConfig(level=logging.WARNING)
        rng, models = random.Random(seed), [packed(20_000, mark) for mark in range(3)]
        cache, found = Cache(folder, limit=2 * len(models[0])), 0
        for _ in range(20):
            mark = rng.randrange(3)
            cache.put(key(mark), models[mark])
            mark = rng.randrange(3)
            model = cache.get(key(mark))
            if model is not None:
                assert model.tables["mark"] == mark and (model.arrays["vertices"] == mark).all()
                found += 1
            if rng.random() < 0.1:
                clear_cache(folder)
        print(found)
        """,
    )
    workers = [work(tmp_path / "cache", seed) for seed in range(4)]
    answers = [process.communicate(timeout=60) for process in workers]
    assert all(process.returncode == 0 for process in workers), answers
    assert all(stderr == "" for _, stderr in answers), answers
    assert sum(int(out) for out, _ in answers) > 0
    clear_cache(tmp_path / "cache")
    assert sorted(entry.name for entry in (tmp_path / "cache").iterdir()) in ([], ["locks"])


# kills


@posix
def test_a_kill_at_any_moment_leaves_the_old_model_or_the_new_one(
    tmp_path: Path, full: bool, caplog: pytest.LogCaptureFixture
):
    write = script(
        tmp_path,
        "writer",
        """
        import sys
        from pathlib import Path
        from bimnav.ifc._store import Cache
        from tests.test_cache import key, packed
        cache, models = Cache(Path(sys.argv[1])), [packed(100_000, mark) for mark in range(2)]
        print("ready", flush=True)
        while True:
            for data in models:
                cache.put(key(1), data)
        """,
    )
    rng, folder = random.Random(1), tmp_path / "cache"
    cache = Cache(folder)
    for _ in range(1000 if full else 20):
        with write(folder) as writer:
            assert writer.stdout is not None
            assert writer.stdout.readline() == "ready\n"
            time.sleep(rng.random() * 0.05)
            writer.send_signal(signal.SIGKILL)
        with caplog.at_level(logging.WARNING):
            kept = cache.get(key(1))
        assert kept is None or (kept.arrays["vertices"] == kept.tables["mark"]).all()
    assert caplog.text == ""
    for entry in folder.iterdir():  # what was being written goes with the next writing, once it is old
        os.utime(entry, (0, 0))
    cache.put(key(2), packed(10, 5))
    assert {entry.suffix for entry in folder.iterdir()} <= {".bimnav", ""}
    assert unpack((folder / f"{key(2)}.bimnav").read_bytes()).tables == {"mark": 5}
