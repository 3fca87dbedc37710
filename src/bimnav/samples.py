"""The sample models that ship with bimnav."""

from __future__ import annotations

from pathlib import Path

from bimnav.errors import InputError

__all__ = ["list_samples", "sample"]


def _folder() -> Path:
    installed = Path(__file__).parent / "data" / "ifc"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "data" / "ifc"  # an editable checkout


def list_samples() -> tuple[str, ...]:
    """List the names that `sample` takes, in alphabetical order."""
    return tuple(sorted(path.stem for path in _folder().glob("*.ifc")))


def sample(name: str) -> Path:
    """Return the path of a sample model.

    Parameters
    ----------
    name
        One of `list_samples()`, such as `apartment`.

    Returns
    -------
    path
        Of an IFC file; it belongs to the installation, so write results elsewhere.

    Raises
    ------
    InputError
        If there is no such sample.
    """
    names = list_samples()
    if name not in names:
        raise InputError(
            f"there is no sample model {name!r}.", f"Choose one of: {', '.join(names)}.", {"name": name, "names": names}
        )
    return _folder() / f"{name}.ifc"
