"""From a path to the text of a model: what kind of file it is, and what an archive holds."""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import stat
import zipfile
from pathlib import Path
from typing import BinaryIO

from bimnav.errors import ArchiveError, FileKindError, FileMissingError, FileTooLargeError, InputError

__all__ = ["FILE_LIMIT", "digest", "load", "open_regular"]

FILE_LIMIT = 2 * 1024**3
"""The most bytes a model may have, in the file or out of an archive."""

_RATIO_LIMIT = 100  # IFC text shrinks 5 to 30 times; an archive beyond this is a bomb
_RATIO_FROM = 64 * 1024**2  # bytes; below this no ratio hurts
_MEMBER_LIMIT = 1000
_CHUNK = 1024**2
_NO_WAIT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)

_EXPORT = "Export the model as IFC (a STEP text)."
_KINDS = (  # how a file begins, what it is, what to do
    (b"version https://git-lfs", "a Git LFS pointer, not the model", "Run: git lfs pull."),
    (b"%PDF", "a PDF", _EXPORT),
    (b"\x89PNG", "a PNG picture", _EXPORT),
    (b"\xff\xd8\xff", "a JPEG picture", _EXPORT),
    (b"\x1f\x8b", "compressed by gzip", "Unpack it first: gunzip."),
    (b"7z\xbc\xaf", "a 7z archive", "Unpack it first."),
    (b"Rar!", "a RAR archive", "Unpack it first."),
    (b"SQLite format 3", "an SQLite database", _EXPORT),
    (b"\xd0\xcf\x11\xe0", "a Revit or Office file", _EXPORT),
    (b"AC10", "an AutoCAD drawing", _EXPORT),
    (b"\xff\xfe", "text in UTF-16", "Save it as plain text (UTF-8)."),
    (b"\xfe\xff", "text in UTF-16", "Save it as plain text (UTF-8)."),
    (b"{", "JSON", _EXPORT),
)
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_SCHEMA_4X3 = re.compile(rb"(FILE_SCHEMA\s*\(\s*\(\s*'IFC4X3)(?=')", re.IGNORECASE)  # the kernel's IFC4X3_ADD2
_HEAD = 1 << 16


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading; never block on a pipe, never touch a device.

    Raises
    ------
    FileMissingError
        If there is no such file.
    FileKindError
        If it is a folder, a pipe or a device, or may not be read.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            handle = open(path, "rb", opener=lambda name, flags: os.open(name, flags | _NO_WAIT))  # noqa: SIM115
            mode = os.fstat(handle.fileno()).st_mode  # it may have been replaced since
            if stat.S_ISREG(mode):
                return handle
            handle.close()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise FileMissingError(f"{path}: there is no such file.", _nearest(path), {"path": str(path)}) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileKindError(
            f"{path!s:.200} cannot be opened: {reason}.",
            "Check the path and the rights of the file.",
            {"path": str(path)},
        ) from error
    kind = "a folder" if stat.S_ISDIR(mode) else "a pipe" if stat.S_ISFIFO(mode) else "a device or a socket"
    raise FileKindError(f"{path} is {kind}, not a file.", "Give the path of an IFC file.", {"path": str(path)})


def _nearest(path: Path) -> str:
    try:
        names = [entry.name for entry in os.scandir(path.parent) if entry.is_file()]
    except OSError:
        return f"There is no folder {str(path.parent)!r} either."
    close = difflib.get_close_matches(path.name, names, n=1)
    return f"Did you mean {close[0]!r}?" if close else "Check the path."


def digest(path: Path) -> str:
    """Return the SHA-256 of a file; errors as of `open_regular`."""
    with open_regular(path) as handle:
        hashed = hashlib.sha256()
        while chunk := handle.read(_CHUNK):
            hashed.update(chunk)
        return hashed.hexdigest()


def load(path: Path) -> bytes:
    """Read the text of a model, out of its archive where it is in one, as the kernel wants it.

    Raises
    ------
    FileMissingError, FileKindError, FileTooLargeError, ArchiveError
        If there is no IFC text to be had; the message names the file and what to do.
    """
    with open_regular(path) as handle:
        size = os.fstat(handle.fileno()).st_size
        if size > FILE_LIMIT:
            raise FileTooLargeError(
                f"{path.name} has {size:,} bytes; the limit is {FILE_LIMIT:,}.",
                "Split the model by discipline or storey.",
                {"path": str(path), "bytes": size},
            )
        head = handle.read(2)
        handle.seek(0)
        is_archive = head == b"PK" or path.suffix.lower() == ".ifczip"
        text = _unpacked(handle, path) if is_archive else handle.read(size)
    text = text.removeprefix(_BYTE_ORDER_MARK)
    _check_kind(text[:4096].lstrip(), path)
    return _SCHEMA_4X3.sub(rb"\1_ADD2", text[:_HEAD], count=1) + text[_HEAD:] if b"IFC4X3'" in text[:_HEAD] else text


def _check_kind(head: bytes, path: Path) -> None:
    what, hint = "", ""
    if not head.strip(b"\0"):
        what, hint = "empty", "The export or the download failed; repeat it."
    elif head.startswith(b"<"):
        lower = head.lower()
        if b"<html" in lower or b"<!doctype html" in lower:
            what, hint = "a web page saved under that name", "Download the file itself."
        else:
            what, hint = "XML (ifcXML is not read)", _EXPORT
    else:
        for magic, kind, remedy in _KINDS:
            if head.startswith(magic):
                what, hint = kind, remedy
                break
        else:
            if b"ISO-10303-21" not in head:
                what, hint = "not an IFC text: it does not begin with ISO-10303-21", _EXPORT
    if what:
        raise FileKindError(f"{path.name} is {what}.", hint, {"path": str(path)})


def _unpacked(handle: BinaryIO, path: Path) -> bytes:
    def refusal(what: str, hint: str) -> InputError:
        return ArchiveError(f"{path.name} {what}.", hint, {"path": str(path)})

    try:
        with zipfile.ZipFile(handle) as archive:
            members = archive.infolist()
            if len(members) > _MEMBER_LIMIT:
                raise refusal(f"holds {len(members)} files", "Put the one model into an archive of its own.")
            models = [m for m in members if m.filename.lower().endswith(".ifc") and "__MACOSX" not in m.filename]
            if len(models) != 1:
                names = ", ".join(repr(m.filename[:80]) for m in models[:5]) or "none"
                raise refusal(f"must hold exactly one .ifc file; found {names}", "Unpack it and give the model itself.")
            [model] = models
            if model.flag_bits & 1:
                raise refusal(f"is encrypted ({model.filename[:80]!r})", "Unpack it with its password first.")
            limit = FILE_LIMIT
            if model.file_size > _RATIO_FROM:
                limit = min(limit, _RATIO_LIMIT * model.compress_size)
            too_large = refusal(
                f"would unpack to more than {limit:,} bytes ({model.filename[:80]!r})",
                "Unpack it yourself if you trust it.",
            )
            if model.file_size > limit:
                raise too_large
            text = bytearray()
            with archive.open(model) as stream:
                while chunk := stream.read(_CHUNK):
                    text += chunk
                    if len(text) > limit:  # the header lied
                        raise too_large
            return bytes(text)
    except InputError:
        raise
    except Exception as error:  # zipfile and its codecs raise eight kinds for one thing
        raise refusal(f"is not a sound zip archive: {error}", "Pack or download it again.") from error
