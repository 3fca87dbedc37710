"""What is measured, and how; run as a script it does one measurement in a process of its own.

    python benchmarks/measuring.py footprints|apart|plain FILE

Nothing is imported here but what the measured needs, for it counts into the memory of the process.
"""

from __future__ import annotations

import gc
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import bimnav as bn

__all__ = ["Job", "alone", "cpu", "environment_of", "plain_iteration", "tessellation", "warm_up"]

Job = Callable[[], object]

_UNIT = 1 if sys.platform == "darwin" else 1024  # bytes, of `ru_maxrss`


def cpu(job: Job) -> float:
    """Return the CPU seconds of a job, all threads of this process and of those it started together."""
    gc.collect()
    start = time.process_time() + _of_children()
    job()
    return time.process_time() + _of_children() - start


def _of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def peak() -> int:
    """Return the most memory this process has held, bytes."""
    try:  # the counter of `resource` begins with what the parent held
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) * 1024
    except (OSError, IndexError):
        return _UNIT * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def plain_iteration(path: Path) -> Job:
    """B0: ifcopenshell's iterator with its defaults, one thread, local coordinates, annotations excluded."""
    import ifcopenshell.geom

    file: Any = ifcopenshell.open(path)

    def job() -> int:
        settings: Any = ifcopenshell.geom.settings()
        iterator: Any = ifcopenshell.geom.iterator(settings, file, 1, exclude=["IfcAnnotation"])
        count, going = 0, iterator.initialize()
        while going:
            iterator.get()
            count += 1
            going = iterator.next()
        return count

    return job


def tessellation(path: Path) -> Job:
    """`read_geometry` as `extract` calls it: tessellate, clip, retry, close, orient, cut openings."""
    import ifcopenshell

    from bimnav.ifc import _extract

    read_geometry = _extract.read_geometry
    reached: list[Job] = []

    def stop(*arguments: object, **named: object) -> Any:
        reached.append(partial(read_geometry, *arguments, **named))
        raise InterruptedError

    _extract.read_geometry = stop
    try:
        _extract.extract(ifcopenshell.open(path), path.read_bytes())
    except InterruptedError:
        pass
    finally:
        _extract.read_geometry = read_geometry
    return reached[0]


def environment_of(
    path: Path, cache: bool | Path = False, robot: bn.Robot | None = None, *, isolate: bool = False
) -> bn.IndoorEnvironment:
    """Open a file and find the footprints of all storeys, for a task that wants nothing."""
    from bimnav.tasks import Task

    building = bn.read_ifc(path, isolate=isolate, cache=cache)
    return bn.make_environment(building, Task("nothing"), robot or bn.Robot())


def warm_up() -> None:
    """Load what is compiled, so that no measurement does."""
    environment_of(bn.sample("apartment"))


def alone(what: str, path: Path) -> dict[str, Any]:
    """Measure in a fresh process; see `main`."""
    command = [sys.executable, __file__, what, str(path)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main(what: str, path: Path) -> None:
    """Print CPU seconds and peak memory: `plain` is B0, `apart` reads in a worker process, whose peak is told too."""
    if what == "footprints":
        warm_up()
    job = plain_iteration(path) if what == "plain" else partial(environment_of, path, isolate=what == "apart")
    seconds = cpu(job)
    worker = _UNIT * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(json.dumps({"cpu": seconds, "peak": peak(), "worker_peak": worker}))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
