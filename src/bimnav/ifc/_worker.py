"""The reading process: `python -m bimnav.ifc._worker JOB`, one file per life.

It talks in lines of JSON on what was its standard output: `stage` (what it begins), `beat` (done, total,
GlobalId of the product it is about to touch), and at the end `done` or `error`. The model goes to a file
in the folder that the caller made for it.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any

from bimnav.errors import BimnavError
from bimnav.ifc._text import FILE_LIMIT

__all__ = ["MODEL", "main"]

MODEL = "model.bimnav"
"""Name of the file the model is written to."""

_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)
_NEARLY = 0.8  # of the memory allowed: a failure beyond it is one of memory, whatever it calls itself


class _Line:
    """The way to the caller."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    def send(self, **message: Any) -> None:
        line = json.dumps(message, default=str).encode() + b"\n"
        while line:
            line = line[os.write(self._handle, line) :]

    def stage(self, name: str) -> None:
        self.send(stage=name)

    def beat(self, done: int, total: int, global_id: str) -> None:
        self.send(beat=[done, total, global_id])


def main() -> None:
    """Do the job given as JSON in the first argument."""
    line = _Line(os.dup(1))
    os.dup2(2, 1)  # what native code prints must not reach the caller
    job = json.loads(sys.argv[1])
    _restrict(job)
    try:
        line.stage("starting")
        from bimnav.ifc._reading import read
        from bimnav.ifc._store import pack

        folder = Path(job["folder"])
        how = {name: job[name] for name in ("skip", "thorough", "careful", "check")}
        model = read(Path(job["path"]), folder, line, **how)
        (folder / MODEL).write_bytes(pack(model))
        line.send(done=True)
    except BimnavError as error:
        line.send(error={**error.to_dict(), "error": "ReaderMemoryError"} if _is_short(job) else error.to_dict())
    except BaseException as error:
        kind = "ReaderMemoryError" if isinstance(error, MemoryError) or _is_short(job) else "ReaderCrashError"
        said = f"{type(error).__name__}: {error}"[:300]
        line.send(error={"error": kind, "message": said, "context": {"traceback": traceback.format_exc()[-4000:]}})
    sys.stderr.flush()
    os._exit(0)  # native destructors have nothing to add but crashes


def _restrict(job: dict[str, Any]) -> None:
    """Take away what a reader does not need, as far as the system can."""
    if sys.platform == "linux":
        import ctypes
        import signal

        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
        with contextlib.suppress(OSError):  # if the machine runs out of memory, this process has to go
            Path("/proc/self/oom_score_adj").write_text("1000")
    try:
        import resource
    except ImportError:  # Windows: the caller's clock is the only limit
        return
    limits = {
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_FSIZE: FILE_LIMIT,
        resource.RLIMIT_CPU: job["seconds"],
        resource.RLIMIT_AS: job["memory"],
    }
    for what, limit in limits.items():
        if limit is not None:
            with contextlib.suppress(OSError, ValueError):  # the system allows less already
                resource.setrlimit(what, (limit, limit))


def _is_short(job: dict[str, Any]) -> bool:
    """Tell whether the memory allowed is all but used up."""
    if job["memory"] is None:
        return False
    with contextlib.suppress(OSError, LookupError, ValueError):
        status = Path("/proc/self/status").read_text()
        return bool(int(status.split("VmPeak:")[1].split()[0]) * 1024 > _NEARLY * job["memory"])
    return False


if __name__ == "__main__":
    main()
