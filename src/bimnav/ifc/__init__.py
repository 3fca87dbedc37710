"""Reading IFC models."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from bimnav import _checks
from bimnav._progress import Display, Progress
from bimnav.errors import CacheError, InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bimnav.building import Building
    from bimnav.ifc._model import Model
    from bimnav.ifc._store import Cache, CacheInfo
    from bimnav.ifc._watch import Limits, Reading

__all__ = ["cache_info", "clear_cache", "read_ifc"]

_LOG = logging.getLogger(__name__)


def read_ifc(
    *paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    offsets: Sequence[ArrayLike | None] | None = None,
    cache: bool | str | PathLike[str] = True,
    isolate: bool = True,
    progress: bool | Progress | None = None,
    timeout: float | None = None,
    memory: int | None = None,
) -> Building:
    """Read a building from an IFC file, or from several that describe it together.

    A file is read in a process of its own, so that one that crashes the geometry kernel is an error and
    not the end of the program. A product that crashes or stalls the kernel is set aside and listed in
    `building.ledger.lost`. What was read once is kept in a cache.

    Parameters
    ----------
    paths
        IFC files (STEP text: IFC2X3, IFC4 or IFC4X3), or .ifczip that hold one, one by one or as a list.
        Several are joined as by `federate`: architecture, services, O&M data.
    offsets
        For each file what to add to its coordinates, (3,) metres, or None to find that out.
    cache
        Whether to use the cache, or the folder of another one. See `cache_info`.
    isolate
        Whether to read in a process of its own. Without it a bad file can crash or stall this one, and
        `timeout` and `memory` do not hold.
    progress
        Whether to show on standard error how far the reading is, or a function to call with products
        done, their total, and what is being worked on. None shows it on a terminal, or in a notebook, if it takes long.
    timeout
        Seconds after which to give up; half an hour if not given.
    memory
        Bytes the reading process may use, where the system can limit it.

    Returns
    -------
    building
        In metres and world coordinates.

    Raises
    ------
    InputError
        If the file cannot be read; its leaves tell a missing file from a damaged one, and so on.
    ReaderError
        If the reading process crashed, took too long or needed too much memory.
    """
    from bimnav.ifc._federate import checked_offsets, federate
    from bimnav.ifc._text import digest
    from bimnav.ifc._watch import Limits

    try:
        wanted = [Path(path) for given in paths for path in ([given] if isinstance(given, (str, PathLike)) else given)]
    except TypeError as error:
        told = ", ".join(f"{given!r:.80}" for given in paths)
        raise InputError(f"read_ifc was given {told}, which is no path.", "Give the path of an IFC file.") from error
    if not wanted:
        raise InputError("read_ifc was given no file.", "Give the path of an IFC file.")
    limits = Limits() if timeout is None else Limits(timeout=timeout)
    limits = replace(limits, memory=memory)
    checked_offsets(offsets, len(wanted))
    store = _cache_at(cache)
    files = [(path, digest(path)) for path in wanted]
    buildings = [_building_of(path, sha256, store, limits if isolate else None, progress) for path, sha256 in files]
    return buildings[0] if len(buildings) == 1 and offsets is None else federate(buildings, offsets=offsets)


def _building_of(
    path: Path, sha256: str, cache: Cache | None, limits: Limits | None, progress: bool | Progress | None
) -> Building:
    from bimnav.ifc._model import to_building
    from bimnav.ifc._select import selector_for

    with Display(path.name, progress) as report:
        model = _model_of(path, sha256, cache, limits, report)
    selector = selector_for(path, sha256, model)
    return to_building(
        model,
        sources=(str(path),),
        selector=selector.select,
        property_reader=selector.properties,
        facts_reader=selector.facts,
        asset_readers={str(path): selector.assets},
    )


def cache_info(folder: Path | None = None) -> CacheInfo:
    """Return where the cache is and what lies in it."""
    from bimnav.ifc import _store

    return _store.cache_info(folder)


def clear_cache(folder: Path | None = None) -> int:
    """Remove all models from the cache and return how many there were."""
    from bimnav.ifc import _store

    return _store.clear_cache(folder)


def _cache_at(cache: bool | str | PathLike[str]) -> Cache | None:
    from bimnav.ifc._store import Cache, cache_folder

    if cache is False:
        return None
    try:
        return Cache(cache_folder() if cache is True else _checks.path("cache", cache))
    except CacheError as error:
        _LOG.warning("nothing is cached: %s", error)
        return None


def _model_of(path: Path, sha256: str, cache: Cache | None, limits: Limits | None, report: Progress) -> Model:
    """Take a model from the cache, else read it and keep it there."""
    from bimnav.ifc._store import key_of

    if cache is None:
        return _read(path, sha256, limits, report).model
    key = key_of(sha256)
    if model := cache.get(key):
        return model
    start = time.monotonic()
    patience = limits.timeout / 2 if limits else math.inf
    with cache.alone(key, patience, lambda: report(0, 0, "waiting for another process that reads it")) as has_waited:
        if has_waited and (model := cache.get(key)):
            return model
        if has_waited and limits:
            limits = replace(limits, timeout=limits.timeout - (time.monotonic() - start))
        reading = _read(path, sha256, limits, report)
        if reading.is_repeatable:
            cache.put(key, reading.packed)
    return reading.model


def _read(path: Path, sha256: str, limits: Limits | None, report: Progress) -> Reading:
    from bimnav.ifc._text import digest
    from bimnav.ifc._watch import read_apart, read_here

    reading = read_here(path, report) if limits is None else read_apart(path, limits=limits, report=report)
    if digest(path) != sha256:
        raise InputError(f"{path.name} changed while it was read.", "Read it again.", {"path": str(path)})
    return reading
