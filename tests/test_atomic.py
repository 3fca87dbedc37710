"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bimnav import _files as _atomic
from bimnav._files import write_bytes, write_text
from bimnav.errors import OutputError


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def refused(path: Path, *words: str) -> OutputError:
    with pytest.raises(OSError) as caught:  # noqa: PT011
        write_bytes(path, b"new")
    assert type(caught.value) is OutputError
    for word in (str(path)[:200], *words):
        assert word in str(caught.value)
    assert len(caught.value.hint) > 8
    return caught.value


def test_what_is_written_is_what_is_read(tmp_path: Path):
    path = tmp_path / "räume.csv"
    assert write_text(path, "a,ü\r\nb\n") == path
    assert path.read_bytes() == "a,ü\r\nb\n".encode()
    write_bytes(path, memoryview(b"\0\xff"))
    assert path.read_bytes() == b"\0\xff"
    assert names(tmp_path) == ["räume.csv"]


def test_a_new_file_has_the_mode_any_new_file_has_and_an_old_one_keeps_its_own(tmp_path: Path):
    plain, ours = tmp_path / "plain", tmp_path / "ours"
    plain.write_bytes(b"")
    write_bytes(ours, b"")
    assert stat.S_IMODE(ours.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)
    ours.chmod(0o600)
    write_bytes(ours, b"secret")
    assert stat.S_IMODE(ours.stat().st_mode) == 0o600


def test_folders_links_pipes_and_devices_are_refused_and_left_alone(tmp_path: Path):
    folder, target, link, pipe = (tmp_path / name for name in ("folder", "target", "link", "pipe"))
    folder.mkdir()
    target.write_text("old")
    link.symlink_to(target)
    refused(folder, "folder")
    refused(link, "link", str(target))
    assert link.is_symlink()
    assert target.read_text() == "old"
    if hasattr(os, "mkfifo"):
        os.mkfifo(pipe)
        refused(pipe, "pipe")
        refused(Path(os.devnull), "device")


def test_places_that_cannot_be_written_are_named_with_a_remedy(tmp_path: Path):
    (tmp_path / "file").write_text("")
    refused(tmp_path / "missing" / "file", "Make the folder first")
    refused(tmp_path / "file" / "inner", "not a folder")
    refused(tmp_path / ("x" * 300), "shorter")
    refused(tmp_path / "a\0b")
    assert names(tmp_path) == ["file"]


def test_a_write_protected_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "file"
    path.write_text("old")
    monkeypatch.setattr(os, "access", lambda *_: False)  # what chmod 0444 means to all but root
    refused(path, "write-protected")
    assert path.read_text() == "old"


def test_text_that_no_encoding_takes_is_a_typed_error(tmp_path: Path):
    with pytest.raises(OutputError, match="UTF-8"):
        write_text(tmp_path / "file", "\ud800")
    assert names(tmp_path) == []


@pytest.mark.parametrize("call", ["os.open", "os.fdopen", "os.fsync", "Path.chmod", "Path.replace"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EIO])
def test_whatever_call_fails_the_old_file_stays_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, number: int
):
    path = tmp_path / "file"
    path.write_text("old")

    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    owner, name = call.split(".")
    with monkeypatch.context() as patch:
        patch.setattr(os if owner == "os" else Path, name, fail)
        refused(path, os.strerror(number))
    assert path.read_text() == "old"
    assert names(tmp_path) == ["file"]


def test_an_interrupted_write_leaves_the_old_file_and_no_litter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "file"
    path.write_text("old")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(path, b"new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["file"]


def test_temporary_files_of_killed_programs_are_swept_and_those_of_others_kept(tmp_path: Path):
    old, fresh, foreign = (tmp_path / name for name in (".bimnav-1.tmp", ".bimnav-2.tmp", "notes.tmp"))
    for path in (old, fresh, foreign):
        path.write_text("")
    os.utime(old, (0, time.time() - _atomic._STALE - 60))
    os.utime(foreign, (0, 0))
    write_bytes(tmp_path / "file", b"")
    assert names(tmp_path) == [".bimnav-2.tmp", "file", "notes.tmp"]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
def test_a_killed_writer_leaves_the_old_file_or_the_new_one(tmp_path: Path):
    path = tmp_path / "file"
    script = (
        "import sys; from bimnav._files import write_bytes\n"
        "while True:\n    for byte in (b'a', b'b'): write_bytes(sys.argv[1], byte * 200_000)"
    )
    for _ in range(4):
        process = subprocess.Popen([sys.executable, "-c", script, str(path)])
        deadline = time.monotonic() + 20
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.05)
        process.kill()
        process.wait()
        assert path.read_bytes() in (b"a" * 200_000, b"b" * 200_000)
