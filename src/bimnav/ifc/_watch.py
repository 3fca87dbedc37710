"""Reading a file in a process of its own, which may crash, hang or eat memory without harm to this one."""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import queue
import re
import signal
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NoReturn

import bimnav.errors
from bimnav.errors import (
    BimnavError,
    OutputError,
    ReaderCrashError,
    ReaderError,
    ReaderMemoryError,
    ReaderTimeoutError,
    ValueRangeError,
)
from bimnav.ifc._model import Model
from bimnav.ifc._store import pack, unpack
from bimnav.ifc._text import FILE_LIMIT, open_regular
from bimnav.ifc._worker import MODEL

__all__ = ["Limits", "Reading", "read_apart", "read_here"]

_LOG = logging.getLogger(__name__)
_QUARANTINE_LIMIT = 8
_PATIENT = 4  # stalls that a reading has time for, with a rest to read the file without what stalls
_LONGEST_LINE = 1 << 16
_TICK = 0.5  # seconds; on Windows Ctrl-C does not interrupt a wait
_LEAST_SILENCE = 5.0  # seconds; a busy machine may take as long to start the process
_LEAST_MEMORY = 1024**3
_NEARLY = 0.5  # of the memory allowed, resident at death: it died of memory
_UNWANTED = {"PYTHONINSPECT", "PYTHONSTARTUP", "PYTHONWARNINGS"}  # meant for the caller's main program
_ALLOCATION = re.compile(r"bad_alloc|memory allocation|allocate memory|out of memory", re.IGNORECASE)
_SAFE = "Your program is unharmed."
_REPORT = "Export it again with simpler geometry, and report the file."

Report = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class Limits:
    """What a reading process may use.

    Parameters
    ----------
    timeout
        Seconds for the whole reading.
    silence
        Seconds for any one product, at most a quarter of `timeout`; more for a large file, which takes
        longer to open.
    memory
        Bytes of address space, where the system can limit it; None for what the machine has.
    """

    timeout: float = 1800.0
    silence: float = 60.0
    memory: int | None = None

    def __post_init__(self) -> None:
        if not (0 < self.timeout < math.inf and 0 < self.silence < math.inf):
            raise ValueRangeError(f"timeout is {self.timeout} s.", "Give a number of seconds above 0.")
        patience = max(self.timeout / _PATIENT, _LEAST_SILENCE)
        object.__setattr__(self, "silence", min(self.silence, patience))
        if self.memory is not None and not self.memory >= _LEAST_MEMORY:
            hint = f"Allow at least {_LEAST_MEMORY}; the reader alone needs half of that."
            raise ValueRangeError(f"memory is {self.memory} bytes.", hint)


@dataclass(slots=True)
class Reading:
    """A model that was read apart.

    Parameters
    ----------
    model, packed
        The model, and the same as bytes.
    lost
        GlobalId to the reason, of products that crashed or stalled the kernel and were left alone.
    is_repeatable
        Whether another reading would give the same; a product that stalled might not do so again.
    """

    model: Model
    packed: bytes
    lost: dict[str, str] = field(default_factory=dict)
    is_repeatable: bool = True


def read_apart(
    path: Path, *, limits: Limits | None = None, report: Report = lambda *_: None, check: bool = True
) -> Reading:
    """Read a file in a process of its own.

    If a product crashes or stalls the geometry kernel, the file is read again: the products one at a time,
    so that there is no doubt which one does, and that one by the thorough kernel alone. If that fails as
    well, the product is set aside and listed in the ledger as lost; up to eight may be.

    Parameters
    ----------
    path
        A model, or an archive that holds one.
    limits
        What the process may use.
    report
        Called with products done, their total, and what is being worked on.
    check
        Whether to look through the text first.

    Raises
    ------
    InputError
        If the file cannot be read; the same error as reading in this process gives.
    ReaderCrashError, ReaderTimeoutError, ReaderMemoryError
        If the process failed.
    """
    limits = limits or Limits()
    deadline = time.monotonic() + limits.timeout
    lost: dict[str, str] = {}
    thorough: list[str] = []
    repeatable = True
    careful = False
    while True:
        try:
            packed = _Attempt(
                path, limits, deadline, report, skip=list(lost), thorough=thorough, careful=careful, check=check
            ).run()
        except (ReaderCrashError, ReaderTimeoutError) as error:
            suspect = error.context.get("suspect")
            is_reading = suspect is not None and error.context["stage"] == "reading"
            if not is_reading or suspect in lost or (careful and not suspect):
                raise
            stalled = isinstance(error, ReaderTimeoutError)
            repeatable = repeatable and not stalled
            if careful and suspect in thorough:
                if len(lost) == _QUARANTINE_LIMIT:
                    raise
                lost[suspect] = f"{'stalled' if stalled else 'crashed'} the geometry kernel"
                _LOG.warning("%s: product %s %s; reading again without it", path.name, suspect, lost[suspect])
            else:
                thorough += [suspect] if suspect else []
                _LOG.info("%s: reading again, one product at a time: %s", path.name, error)
            careful = True
        else:
            return _reading_of(path, packed, lost, repeatable)


def _reading_of(path: Path, packed: bytes, lost: dict[str, str], repeatable: bool) -> Reading:
    """Unpack an answer, and write down in its ledger why products were set aside."""
    try:
        model = unpack(packed)
        if lost:
            known = model.tables["ledger"]["lost"]
            known.update({global_id: reason for global_id, reason in lost.items() if global_id in known})
            packed = pack(model)
    except (ValueError, LookupError, AttributeError, TypeError) as error:
        raise ReaderCrashError(
            f"{path.name}: the reading process gave a bad answer: {error}.",
            f"{_SAFE} The file may be hostile; do not use it.",
            {"path": str(path)},
        ) from error
    return Reading(model, packed, lost, repeatable)


def read_here(path: Path, report: Report) -> Reading:
    """Read a file in this process; what native code does to it, it does.

    Raises
    ------
    InputError
        If the file cannot be read.
    ReaderCrashError
        If the reader fails in a way nobody foresaw.
    """
    from bimnav.ifc._reading import read

    try:
        with _private_folder() as folder:
            model = read(path, folder, _Teller(report))
    except BimnavError:
        raise
    except Exception as error:  # of any kind: the kernel raises RuntimeError for most things
        raise ReaderCrashError(
            f"{path.name} made the reader fail: {type(error).__name__}: {error}.",
            "Report the file.",
            {"path": str(path)},
        ) from error
    return Reading(model, pack(model))


@contextlib.contextmanager
def _private_folder() -> Iterator[Path]:
    try:
        folder = tempfile.TemporaryDirectory(prefix="bimnav-", ignore_cleanup_errors=True)
    except OSError as error:
        raise OutputError(
            f"there is no folder for temporary files: {error.strerror}.", "Set TMPDIR to a folder you may write to."
        ) from error
    with folder as name:
        yield Path(name)


class _Teller:
    """Hears a reading in this process and reports it."""

    def __init__(self, report: Report) -> None:
        self._report, self._stage = report, ""

    def stage(self, name: str) -> None:
        self._stage = name
        self._report(0, 0, name)

    def beat(self, done: int, total: int, global_id: str) -> None:
        self._report(done, total, f"{self._stage} {global_id}".strip())


class _Attempt:
    """One process and what is heard from it."""

    def __init__(
        self,
        path: Path,
        limits: Limits,
        deadline: float,
        report: Report,
        **how: Any,
    ) -> None:
        self.path, self.limits, self.deadline, self.report = path, limits, deadline, report
        self.job = how | {
            "path": str(path.absolute()),
            "seconds": math.ceil(limits.timeout) + 5,  # of one processor; meant for a worker that lost its caller
            "memory": _physical_memory() if limits.memory is None else int(limits.memory),
        }
        with open_regular(path) as handle:
            self.silence = limits.silence + os.fstat(handle.fileno()).st_size / 1e6
        self.stage, self.suspect, self.done, self.total = "starting", "", 0, 0

    def run(self) -> bytes:
        """Return the packed model."""
        with _private_folder() as folder, self._process(folder) as (process, lines):
            self._follow(process, lines, folder)
            answer = folder / MODEL
            size = answer.stat().st_size if answer.is_file() else 0
            if not 0 < size <= FILE_LIMIT:
                self._fail(ReaderCrashError, f"made the reading process answer with {size} bytes")
            return answer.read_bytes()

    @contextlib.contextmanager
    def _process(self, folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], queue.SimpleQueue[bytes | None]]]:
        command = [sys.executable, "-P", "-m", "bimnav.ifc._worker", json.dumps(self.job | {"folder": str(folder)})]
        with (folder / "stderr").open("wb") as stderr:
            try:
                process = subprocess.Popen(  # noqa: S603
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=stderr,
                    cwd=folder,  # not the caller's: a file named numpy.py there must stay unread
                    env=_environment(),
                    start_new_session=True,
                    creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
                )
            except (OSError, ValueError) as error:
                raise ReaderError(
                    f"{self.path.name}: the reading process cannot be started: {error}.",
                    "isolate=False reads in this process.",
                    {"path": str(self.path)},
                ) from error
        lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        assert process.stdout is not None  # noqa: S101
        listener = threading.Thread(target=_pass_on, args=(process.stdout, lines), daemon=True)
        listener.start()
        try:
            yield process, lines
        finally:
            _reap(process)
            listener.join()
            process.stdout.close()

    def _follow(self, process: subprocess.Popen[bytes], lines: queue.SimpleQueue[bytes | None], folder: Path) -> None:
        """Listen until the process is done; raise what it raises, or what became of it."""
        heard = time.monotonic()
        while True:
            now = time.monotonic()
            left, patience = self.deadline - now, heard + self.silence - now
            if left <= 0:
                self._fail(
                    ReaderTimeoutError,
                    f"was not read within {self.limits.timeout:.4g} s",
                    "Allow more time (timeout=), or split the model.",
                )
            if patience <= 0:
                self._fail(ReaderTimeoutError, f"kept the reader silent for {self.silence:.0f} s", suspect=self.suspect)
            try:
                line = lines.get(timeout=min(left, patience, _TICK))
            except queue.Empty:
                continue
            heard = time.monotonic()
            if line is None:
                self._died(*_reap(process), folder)
            match _parsed(line):
                case {"stage": str(stage)}:
                    self.stage, self.suspect = stage, ""
                    self.report(0, 0, stage)
                case {"beat": [int(done), int(total), str(global_id)]}:
                    self.suspect, self.done, self.total = global_id, done, total
                    self.report(done, total, f"{self.stage} {global_id}".strip())
                case {"error": {"error": str(kind), "message": str(message)} as said}:
                    self._pass_on(kind, message, said)
                case {"done": True}:
                    return
                case _:
                    self._fail(ReaderCrashError, "made the reading process talk nonsense")

    def _pass_on(self, kind: str, message: str, said: dict[str, Any]) -> NoReturn:
        """Raise an error of the process here."""
        leaf = getattr(bimnav.errors, kind, None)
        if kind == ReaderMemoryError.__name__:
            self._fail(ReaderMemoryError, "needs more memory than the reader may use", said=message)
        if kind == ReaderCrashError.__name__ or not (isinstance(leaf, type) and issubclass(leaf, BimnavError)):
            self._fail(ReaderCrashError, f"made the reader fail ({message})", suspect=self.suspect, said=said)
        raise leaf(message, str(said.get("hint", "")), dict(said.get("context") or {}))

    def _died(self, status: int, peak: int, folder: Path) -> NoReturn:
        stderr = (folder / "stderr").read_bytes()[-2000:].decode("utf-8", "replace")
        name = _name_of(status)
        memory = self.job["memory"]
        if name == "SIGXCPU":
            self._fail(ReaderTimeoutError, f"used up {self.limits.timeout:.4g} s", "Allow more time (timeout=).")
        if name == "SIGKILL" or _ALLOCATION.search(stderr) or (isinstance(memory, int) and peak > _NEARLY * memory):
            self._fail(ReaderMemoryError, "needs more memory than the reader may use", signal=name, stderr=stderr)
        self._fail(ReaderCrashError, f"crashed the reader ({name})", suspect=self.suspect, signal=name, stderr=stderr)

    def _fail(self, error: type[ReaderError], what: str, hint: str = "", **context: Any) -> NoReturn:
        where = f"while {self.stage}"
        if self.suspect:
            where = f"at product {self.suspect} ({self.done + 1} of {self.total})"
        if not hint:
            hint = {
                ReaderMemoryError: "Allow more (memory=), or split the model.",
                ReaderTimeoutError: "Export what it was working on with simpler geometry.",
            }.get(error, _REPORT)
        raise error(
            f"{self.path.name} {what} {where}.",
            f"{_SAFE} {hint}",
            {"path": str(self.path), "stage": self.stage, "done": self.done, "total": self.total, **context},
        )


def _pass_on(pipe: IO[bytes], lines: queue.SimpleQueue[bytes | None]) -> None:
    while line := pipe.readline(_LONGEST_LINE):
        lines.put(line)
    lines.put(None)


def _parsed(line: bytes) -> Any:
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None


def _reap(process: subprocess.Popen[bytes]) -> tuple[int, int]:
    """Kill a process with all its group, unless it is gone; return its exit status and peak memory in bytes."""
    if process.returncode is not None:
        return process.returncode, 0
    if not hasattr(os, "wait4"):
        process.kill()
        return process.wait(), 0
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    try:
        _, status, usage = os.wait4(process.pid, 0)
    except ChildProcessError:  # the caller ignores SIGCHLD, and the system reaped it
        process.returncode = 0
        return 0, 0
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _name_of(status: int) -> str:
    try:
        return signal.Signals(-status).name
    except ValueError:
        return f"exit code {status}"


def _environment() -> dict[str, str]:
    """Return the caller's environment, so changed that the same packages are imported and nothing else."""
    environment = {name: value for name, value in os.environ.items() if name not in _UNWANTED}
    home = str(Path(bimnav.errors.__file__).parents[1])
    paths = [path for path in environment.pop("PYTHONPATH", "").split(os.pathsep) if Path(path).is_absolute()]
    if home not in sysconfig.get_paths().values():  # site-packages before the standard library would shadow it
        paths.insert(0, home)
    if paths:
        environment["PYTHONPATH"] = os.pathsep.join(paths)
    return environment | {"PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def _physical_memory() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None
