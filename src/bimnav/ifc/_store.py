"""A `Model` as bytes, and the cache of models that were read before.

The bytes are a SHA-256 and an npz archive without pickles; the tables lie in it as JSON. The same bytes
cross the border of the reading process and lie in the cache, one file a model.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import logging
import os
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from bimnav._files import write_bytes
from bimnav.errors import CacheError, OutputError
from bimnav.ifc._model import Model

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

__all__ = [
    "SIZE_LIMIT",
    "Cache",
    "CacheInfo",
    "cache_folder",
    "cache_info",
    "clear_cache",
    "key_of",
    "pack",
    "unpack",
]

SIZE_LIMIT = 2 * 1024**3
"""Bytes a cache may take; the models of some hundred large buildings."""

_LOG = logging.getLogger(__name__)
_DIGEST = hashlib.sha256().digest_size
_SUFFIX = ".bimnav"
_LOCKS = "locks"
_POLL = 0.05  # seconds
_LOCKABLE = 2**31 - 1  # bytes of a file, on Windows
_TABLES = "tables"
_DECIDING = ("bimnav", "ifcopenshell", "manifold3d", "numpy")  # packages that decide what a model becomes
_ARRAYS = {  # name: kind of its numbers and its shape without the first axis
    "vertices": ("f", (3,)),
    "faces": ("i", (3,)),
    "vertex_offsets": ("i", ()),
    "face_offsets": ("i", ()),
    "shape_mesh": ("i", ()),
    "placements": ("f", (4, 4)),
}


def pack(model: Model) -> bytes:
    """Write a model as bytes; equal models give equal bytes."""
    text = json.dumps(model.tables, allow_nan=False, separators=(",", ":")).encode()
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **{_TABLES: np.frombuffer(text, np.uint8)}, **model.arrays)
    payload = archive.getvalue()
    return hashlib.sha256(payload).digest() + payload


def unpack(data: bytes) -> Model:
    """Read a model back.

    Raises
    ------
    ValueError
        If the bytes are damaged, or are no model.
    """
    payload = memoryview(data)[_DIGEST:]
    if hashlib.sha256(payload).digest() != data[:_DIGEST]:
        raise ValueError("the checksum does not fit")
    try:
        with zipfile.ZipFile(io.BytesIO(payload)) as archive:
            if sum(member.file_size for member in archive.infolist()) > len(payload):
                raise ValueError("an array claims more bytes than there are")
        with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
            tables = json.loads(arrays[_TABLES].tobytes())
            model = Model(tables, {name: arrays[name] for name in arrays.files if name != _TABLES})
    except (zipfile.BadZipFile, KeyError, EOFError, MemoryError, RecursionError) as error:
        raise ValueError(f"not a model: {error!r}") from error
    _check(model)
    return model


def _check(model: Model) -> None:
    arrays = model.arrays
    for name, (kind, shape) in _ARRAYS.items():
        if name not in arrays or arrays[name].dtype.kind != kind or arrays[name].shape[1:] != shape:
            raise ValueError(f"array {name!r} is missing or of another shape")
    for items, offsets in (("vertices", "vertex_offsets"), ("faces", "face_offsets")):
        ends: Any = arrays[offsets]
        if not len(ends) or ends[0] != 0 or ends[-1] != len(arrays[items]) or (np.diff(ends) < 0).any():
            raise ValueError(f"array {offsets!r} does not fit {items!r}")
    meshes, shapes = len(arrays["vertex_offsets"]) - 1, len(arrays["placements"])
    mesh: Any = arrays["shape_mesh"]
    if len(arrays["face_offsets"]) - 1 != meshes or len(mesh) != shapes:
        raise ValueError("the arrays do not fit each other")
    if shapes and not (mesh.min() >= 0 and mesh.max() < meshes):
        raise ValueError("a shape refers to no mesh")


@dataclass(frozen=True, slots=True)
class CacheInfo:
    """What lies in the cache.

    Parameters
    ----------
    folder
        Where it is; it need not exist.
    models
        Number of models.
    size
        Bytes they take.
    """

    folder: Path
    models: int
    size: int


def cache_folder() -> Path:
    """Return the folder of the cache: `BIMNAV_CACHE` if set, else where the system keeps caches.

    Raises
    ------
    CacheError
        If the system tells no home folder.
    """
    if own := os.environ.get("BIMNAV_CACHE"):
        return Path(own)
    if xdg := os.environ.get("XDG_CACHE_HOME"):
        return Path(xdg) / "bimnav"
    try:
        home = Path.home()
    except RuntimeError as error:
        raise CacheError("there is no home folder for the cache.", "Set BIMNAV_CACHE to a folder.") from error
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "bimnav" / "cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "bimnav"
    return home / ".cache" / "bimnav"


def cache_info(folder: Path | None = None) -> CacheInfo:
    """Count what lies in the cache."""
    folder = folder or cache_folder()
    entries = _entries(folder)
    return CacheInfo(folder, len(entries), sum(entry.size for entry in entries))


def clear_cache(folder: Path | None = None) -> int:
    """Remove all models from the cache and return how many there were.

    Raises
    ------
    CacheError
        If one cannot be removed.
    """
    paths = list((folder or cache_folder()).glob(f"*{_SUFFIX}"))
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise CacheError(f"{path} cannot be removed: {error.strerror}.", "Check the folder's rights.") from error
    return len(paths)


def key_of(sha256: str, **settings: Any) -> str:
    """Name a reading: the file's SHA-256, the settings, and every version that decides the result."""
    text = json.dumps([sha256, settings, _versions()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _versions() -> tuple[str, ...]:
    here = Path(__file__).parent  # a changed reader never meets what an older one left
    sources = sorted([*here.glob("*.py"), *here.parent.glob("*.py")])
    code = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    return (code, *(version(package) for package in _DECIDING))


@dataclass(frozen=True, slots=True, order=True)
class _Entry:
    used: float
    path: Path
    size: int


def _entries(folder: Path) -> list[_Entry]:
    """List the models of a cache; other processes may add and remove some meanwhile."""
    found = []
    for path in folder.glob(f"*{_SUFFIX}"):
        with contextlib.suppress(FileNotFoundError):
            stat = path.stat()
            found.append(_Entry(stat.st_mtime, path, stat.st_size))
    return found


class Cache:
    """A folder of models; whatever goes wrong with it costs time, never a result.

    Parameters
    ----------
    folder
        Where it is; made when first written to.
    limit
        Bytes it may take; beyond them the models go that were not used for the longest time.
    """

    def __init__(self, folder: Path, limit: int = SIZE_LIMIT) -> None:
        self.folder, self.limit = folder, limit

    def get(self, key: str) -> Model | None:
        """Return a model, or None if there is none; a damaged one counts as none, with one warning."""
        path = self._path(key)
        try:
            data = path.read_bytes()
        except OSError:
            return None
        try:
            model = unpack(data)
        except ValueError as error:
            _LOG.warning("the cached model %s is damaged (%s); it is read again", path, error)
            return None
        with contextlib.suppress(OSError):
            os.utime(path)
        return model

    def put(self, key: str, data: bytes) -> None:
        """Keep a packed model; if that fails, say so in the log and go on."""
        if len(data) > self.limit:
            _LOG.warning("the model is not cached: it has %d bytes, and the cache %d", len(data), self.limit)
            return
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._make_room(len(data))
            write_bytes(self._path(key), data)
        except (OSError, OutputError) as error:
            _LOG.warning("the model is not cached: %s", error)

    @contextlib.contextmanager
    def alone(self, key: str, patience: float, waiting: Callable[[], None]) -> Iterator[bool]:
        """Keep other processes from reading the same model meanwhile; yield whether one did before.

        Parameters
        ----------
        patience
            Seconds to wait for another process that does; after them it goes on all the same.
        waiting
            Called now and then while it waits.
        """
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            handle = os.open(self.folder / _LOCKS, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:  # a cache that cannot be written to either; `put` says so
            yield False
            return
        try:
            has_waited = False
            deadline = time.monotonic() + patience
            while not _has_locked(handle, int(key[:15], 16) % _LOCKABLE) and time.monotonic() < deadline:
                has_waited = True
                waiting()
                time.sleep(_POLL)
            yield has_waited
        finally:
            os.close(handle)  # and the lock is gone, as it is when the process is killed

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{_SUFFIX}"

    def _make_room(self, size: int) -> None:
        entries = sorted(_entries(self.folder))
        excess = sum(entry.size for entry in entries) + size - self.limit
        for entry in entries:
            if excess <= 0:
                break
            entry.path.unlink(missing_ok=True)
            excess -= entry.size


def _has_locked(handle: int, byte: int) -> bool:
    """Lock one byte of a file, which need not be so long, for this process; tell whether no other has it."""
    try:
        if sys.platform == "win32":
            os.lseek(handle, byte, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
    except OSError as error:
        return error.errno not in (errno.EACCES, errno.EAGAIN)  # else this disk knows no locks
    return True
