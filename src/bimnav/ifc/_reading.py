"""From a path to a `Model` in this very process: text, first look, kernel, and the check that nothing was lost."""

from __future__ import annotations

import gc
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from bimnav.errors import GeometryError, IfcSchemaError, IfcStructureError, IfcSyntaxError, IfcUnitsError
from bimnav.ifc._model import Model
from bimnav.ifc._prescan import Prescan, scan
from bimnav.ifc._text import load

__all__ = ["Listener", "open_copy", "read"]

_UNKNOWN = re.compile(r"Entity with name '([^']*)' not found in schema")


class Listener(Protocol):
    """Hears how far a reading is."""

    def stage(self, name: str) -> None:
        """Hear which part of the work begins."""

    def beat(self, done: int, total: int, global_id: str) -> None:
        """Hear which product the kernel touches next; empty if none."""


def read(
    path: Path,
    folder: Path,
    listener: Listener,
    *,
    skip: Collection[str] = (),
    thorough: Collection[str] = (),
    careful: bool = False,
    check: bool = True,
) -> Model:
    """Read one file.

    Parameters
    ----------
    path
        A model, or an archive that holds one.
    folder
        Where to put the text; what is scanned is what the kernel opens, whatever happens to `path`.
    listener
        Told how far the work is.
    skip
        GlobalIds of products the kernel must not touch; they count as lost.
    thorough
        GlobalIds of products the fast kernel must not touch.
    careful
        Whether to give the kernel one product at a time.
    check
        Whether to look through the text first.
    """
    with _uncollected():
        return _read(path, folder, listener, check, {"skip": skip, "thorough": thorough, "careful": careful})


def _read(path: Path, folder: Path, listener: Listener, check: bool, how: dict[str, Any]) -> Model:
    listener.stage("checking")
    text = load(path)
    said = scan(text, path.name, beat=lambda *_: listener.stage("checking")) if check else None
    listener.stage("opening")
    file, log = open_copy(text, folder / "model.ifc", path.name)
    from bimnav.ifc._extract import extract
    from bimnav.ifc._gaps import broken_products, note_lost

    if said is not None:
        _check_parsed(file, log, said, path.name)
    broken = broken_products(file, text, log)
    listener.stage("reading")
    try:
        model = extract(file, text, heartbeat=listener.beat, log=log, **how)
    except (IfcStructureError, IfcUnitsError) as error:  # which do not know the name
        raise type(error)(f"{path.name}: {error.message}", error.hint, {"file": path.name, **error.context}) from error
    except GeometryError as error:  # nobody foresaw it: as good as a crash at the product in hand
        raise RuntimeError(str(error)) from error
    listener.stage("finishing")
    note_lost(model, file, broken, said.shaped if said else {})
    return model


@contextmanager
def _uncollected() -> Iterator[None]:
    """Do not look for circular garbage: a reading makes none, and the search goes through all it has made."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def open_copy(text: bytes, copy: Path, name: str) -> tuple[Any, Any]:
    """Write a model's text to `copy` and open that; return the file and what the parser had to say.

    Raises
    ------
    IfcSchemaError, IfcSyntaxError
        If the parser refuses it; `name` is what the message calls it.
    """
    import ifcopenshell

    kernel: Any = ifcopenshell
    copy.write_bytes(text)
    log = kernel.logger()
    log.output_format(log.FMT_INMEMORY)
    log.verbosity(log.LOG_ERROR)
    try:
        return kernel.open(copy, format=".ifc", logger=log), log
    except kernel.SchemaError as error:
        raise IfcSchemaError(f"{name}: {error}.", "Export it as IFC2X3, IFC4 or IFC4X3.", {"file": name}) from error
    except (kernel.Error, RuntimeError, OSError) as error:
        said = "; ".join(str(message.message)[:200] for message in log.log_messages()[:3]) or str(error)
        raise IfcSyntaxError(
            f"{name} cannot be parsed: {said}.", "The exporter is at fault; ask for a fresh export.", {"file": name}
        ) from error


def _check_parsed(file: Any, log: Any, said: Prescan, name: str) -> None:
    """Refuse a file of which the parser understood less than the text holds."""
    parsed = len(file.entity_names())
    unknown = sum(bool(_UNKNOWN.match(str(message.message))) for message in log.log_messages())
    if parsed + unknown < said.instances:
        raise IfcSyntaxError(
            f"{name} holds {said.instances} entities, of which only {parsed} could be parsed.",
            "The rest would be lost without a word; ask for a fresh export.",
            {"file": name, "entities": said.instances, "parsed": parsed},
        )
