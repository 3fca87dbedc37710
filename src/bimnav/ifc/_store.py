"""A `Model` as bytes, and the cache of models that were read before.

The bytes are a SHA-256 and an npz archive without pickles; the tables lie in it as JSON. The same bytes
cross the border of the reading process and lie in the cache, one file a model.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import sys
import zipfile
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from bimnav._files import write_bytes
from bimnav.errors import CacheError, OutputError
from bimnav.ifc._model import Model

__all__ = ["Cache", "CacheInfo", "cache_folder", "cache_info", "clear_cache", "key_of", "pack", "unpack"]

_LOG = logging.getLogger(__name__)
_DIGEST = hashlib.sha256().digest_size
_SUFFIX = ".bimnav"
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
    sizes = [path.stat().st_size for path in folder.glob(f"*{_SUFFIX}")]
    return CacheInfo(folder, len(sizes), sum(sizes))


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


class Cache:
    """A folder of models; whatever goes wrong with it costs time, never a result.

    Parameters
    ----------
    folder
        Where it is; made when first written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, key: str) -> Model | None:
        """Return a model, or None if there is none; a damaged one counts as none, with one warning."""
        path = self.folder / f"{key}{_SUFFIX}"
        try:
            data = path.read_bytes()
        except OSError:
            return None
        try:
            return unpack(data)
        except ValueError as error:
            _LOG.warning("the cached model %s is damaged (%s); it is read again", path, error)
            return None

    def put(self, key: str, data: bytes) -> None:
        """Keep a packed model; if that fails, say so in the log and go on."""
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_bytes(self.folder / f"{key}{_SUFFIX}", data)
        except (OSError, OutputError) as error:
            _LOG.warning("the model is not cached: %s", error)
