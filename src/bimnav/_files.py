"""Writing files so that a reader finds the old one or the new one, whole, and never anything else."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
import time
from collections.abc import Iterator
from pathlib import Path

from bimnav import _checks
from bimnav.errors import OutputError

__all__ = ["write_bytes", "write_text"]

_PREFIX, _SUFFIX = ".bimnav-", ".tmp"
_STALE = 3600.0  # seconds; an older temporary file was left by a program that was killed
_BINARY = getattr(os, "O_BINARY", 0)
_REMEDIES = {
    errno.ENOSPC: "The disk is full; make room or write elsewhere.",
    errno.EDQUOT: "Your share of the disk is used up; make room or write elsewhere.",
    errno.EFBIG: "The file would be larger than allowed; write elsewhere.",
    errno.EROFS: "The disk is read-only; write elsewhere.",
    errno.EACCES: "You may not write there; choose another folder.",
    errno.EPERM: "You may not write there; choose another folder.",
    errno.ENOENT: "Make the folder first.",
    errno.ENOTDIR: "Its folder is not a folder; choose another.",
    errno.ENAMETOOLONG: "Choose a shorter name.",
}


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write text in UTF-8, line ends as given; see `write_bytes`."""
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        raise OutputError(
            f"{path}: the text holds a character that UTF-8 cannot write: {error}.", "Replace it.", {"path": str(path)}
        ) from error
    return write_bytes(path, data)


def write_bytes(path: str | os.PathLike[str], data: bytes | memoryview) -> Path:
    """Write a file, whole or not at all.

    The bytes go to a temporary file in the same folder, onto the disk, and only then under the name.
    A file that stood there keeps its mode.

    Returns
    -------
    path
        What was written.

    Raises
    ------
    OutputError
        If the path names a folder, a link, a pipe or a device, or the file cannot be written; what stood
        there before is unchanged and no temporary file stays behind.
    """
    path = _checks.path("path", path)
    try:
        mode = _mode_of(path)
        _remove_stale(path.parent)
        with _temporary(path.parent) as (handle, temporary):
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if mode is not None:
                temporary.chmod(mode)
            temporary.replace(path)
        _sync_folder(path.parent)
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        remedy = _REMEDIES.get(getattr(error, "errno", None) or 0, "Choose another path.")
        raise OutputError(f"{path!s:.300} cannot be written: {reason}.", remedy, {"path": str(path)}) from error
    return path


def _mode_of(path: Path) -> int | None:
    """Return the mode of the file at `path`, None if there is none; refuse all that is no plain file."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISREG(mode):
        if not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, "it is write-protected")
        return stat.S_IMODE(mode)
    if stat.S_ISLNK(mode):
        kind, remedy = "a link", f"Write to its target instead: {path.resolve()}."
    elif stat.S_ISDIR(mode):
        kind, remedy = "a folder", "Add a file name."
    else:
        kind, remedy = "a pipe or a device", "Give the path of a plain file."
    raise OutputError(f"{path} is {kind}; it was left as it is.", remedy, {"path": str(path)})


@contextlib.contextmanager
def _temporary(folder: Path) -> Iterator[tuple[int, Path]]:
    path = folder / f"{_PREFIX}{secrets.token_hex(8)}{_SUFFIX}"
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, 0o666)
    try:
        yield handle, path
    finally:
        path.unlink(missing_ok=True)


def _remove_stale(folder: Path) -> None:
    for old in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
        with contextlib.suppress(OSError):
            if time.time() - old.lstat().st_mtime > _STALE:
                old.unlink()


def _sync_folder(folder: Path) -> None:
    with contextlib.suppress(OSError):  # not on every system; the file itself is safe
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
