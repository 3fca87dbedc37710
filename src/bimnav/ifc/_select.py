"""Queries and properties of a model that was read before; it is opened again when first asked."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bimnav.building import Facts
from bimnav.errors import FileMissingError, InputError
from bimnav.ifc._model import Model
from bimnav.ifc._reading import open_copy
from bimnav.ifc._text import digest, load

__all__ = ["Selector", "selector_for"]


def selector_for(path: Path, sha256: str, model: Model) -> Selector:
    """Return what answers for the elements and spaces of a model that was read from `path`."""
    rows = (*model.tables["elements"], *model.tables["spaces"])
    ids = {row["step_id"]: row["global_id"] for row in rows}
    classes = {row["global_id"]: (row.get("ifc_class", "IfcSpace"), row["type_class"]) for row in rows}
    return Selector(path.absolute(), sha256, ids, classes, model.tables["schema"])


class Selector:
    """Answers for one model; it is opened again when first asked, if it is still the one that was read.

    Parameters
    ----------
    path
        The file.
    sha256
        Its digest when it was read.
    ids
        Step id to GlobalId of every product there is an answer about; two products with one GlobalId in
        the file have two here.
    classes
        GlobalId to class and class of the type, of the same products.
    schema
        Of the file.
    """

    def __init__(
        self, path: Path, sha256: str, ids: Mapping[int, str], classes: Mapping[str, tuple[str, str]], schema: str
    ) -> None:
        self._path, self._sha256, self._ids = path, sha256, dict(ids)
        self._classes, self._schema = dict(classes), schema
        self._step_ids = {global_id: step_id for step_id, global_id in self._ids.items()}
        self._answers: dict[str, tuple[str, ...]] = {}
        self._known: dict[str, Facts] = {}
        self._opened: Any = None
        self._read_facts: Any = None
        self._assets: Any = None

    def __reduce__(self) -> tuple[type[Selector], tuple[Path, str, dict[int, str], dict[str, tuple[str, str]], str]]:
        return type(self), (self._path, self._sha256, self._ids, self._classes, self._schema)

    def select(self, query: str) -> tuple[str, ...]:
        """Return the GlobalIds of what a query picks; each distinct query is evaluated once.

        A query for classes alone is answered without opening the file.

        Raises
        ------
        SelectorError
            If the query cannot be parsed or evaluated, or names what does not exist.
        InputError
            If the file is gone or has changed.
        """
        if query not in self._answers:
            from bimnav.ifc._query import checked, evaluate, of_classes

            found = of_classes(checked(query, self._schema), self._classes, self._schema)
            self._answers[query] = evaluate(self._file, self._ids, query) if found is None else found
        return self._answers[query]

    def properties(self, global_id: str) -> dict[str, dict[str, Any]]:
        """Return the property sets of a product, those of its type included, as the file writes them."""
        from bimnav.ifc._query import properties_of

        if global_id not in self._step_ids:
            return {}
        return properties_of(self._file.by_id(self._step_ids[global_id]))

    def facts(self, global_id: str) -> Facts:
        """Return what the file says of a product; each product is read once."""
        if global_id not in self._known:
            self._known[global_id] = self._facts_of(global_id)
        return self._known[global_id]

    def _facts_of(self, global_id: str) -> Facts:
        from bimnav.ifc._facts import FactsReader

        if global_id not in self._step_ids:
            return Facts()
        if self._read_facts is None:
            self._read_facts = FactsReader()
        facts: Facts = self._read_facts(self._file.by_id(self._step_ids[global_id]))
        return facts

    def assets(self, global_id: str) -> dict[str, Any]:
        """Return what the file says about operating and maintaining a product; see `AssetIndex.facts`."""
        if self._assets is None:
            from bimnav.ifc._assets import AssetIndex

            self._assets = AssetIndex(self._file, self._ids)
        facts: dict[str, Any] = self._assets.facts(global_id)
        return facts

    @property
    def _file(self) -> Any:
        if self._opened is None:
            try:
                found = digest(self._path)
            except FileMissingError as error:
                raise FileMissingError(
                    f"{self._path} is gone; queries and properties need it.", "Put it back.", error.context
                ) from error
            if found != self._sha256:
                raise InputError(
                    f"{self._path} has changed since it was read.", "Read it again.", {"path": str(self._path)}
                )
            with tempfile.TemporaryDirectory(prefix="bimnav-", ignore_cleanup_errors=True) as folder:
                self._opened, _ = open_copy(load(self._path), Path(folder) / "model.ifc", self._path.name)
        return self._opened
