"""The event log: one row for everything that happened, a table that equal runs repeat byte for byte."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

from bimnav._files import write_text
from bimnav.errors import MissingExtraError
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    import pandas

__all__ = ["Event", "EventKind", "EventLog", "csv_text"]

EventKind: TypeAlias = Literal[
    "start", "unreached", "depart", "arrive", "begin_service", "end_service", "remove", "finish"
]

_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")  # what breaks a line, a terminal or UTF-8
_LIVE = tuple("=+-@\t\r")  # a spreadsheet takes a cell that begins like this for a formula


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a robot.

    Parameters
    ----------
    time
        Seconds.
    robot
        Name of the robot.
    event
        What happened.
    status
        Of the robot, from this moment on.
    storey
        Name of the storey the robot is on.
    x, y, z
        World point of the robot, metres.
    target
        GlobalId of the target concerned; empty if there is none.
    target_name
        Its name.
    cause
        Why it happened.
    leg_distance
        Metres driven since the robot last departed.
    """

    time: float
    robot: str
    event: EventKind
    status: RobotStatus
    storey: str
    x: float
    y: float
    z: float
    target: str = ""
    target_name: str = ""
    cause: str = ""
    leg_distance: float = 0.0


@dataclass(frozen=True, slots=True)
class EventLog:
    """All events of a simulation, in the order they happened.

    Parameters
    ----------
    rows
        The events.
    """

    columns: ClassVar[tuple[str, ...]] = tuple(column.name for column in fields(Event))

    rows: tuple[Event, ...]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Event]:
        return iter(self.rows)

    def __repr__(self) -> str:
        return f"EventLog({len(self)} events)"

    def to_records(self) -> list[dict[str, Any]]:
        """Return one dictionary per event, with the columns as keys."""
        return [{column: getattr(row, column) for column in self.columns} for row in self.rows]

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """Write the log as comma-separated values; see `csv_text`.

        Parameters
        ----------
        path
            File to write, in UTF-8; None to write none.

        Returns
        -------
        text
            The header and one line per event.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        text = csv_text(self.columns, ([getattr(row, column) for column in self.columns] for row in self.rows))
        if path is not None:
            write_text(Path(path), text)
        return text

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the log as a pandas data frame.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise MissingExtraError("to_dataframe needs pandas.", "pip install 'bimnav[dataframe]'") from error
        return pandas.DataFrame.from_records(self.to_records(), columns=list(self.columns))


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[float | str]]) -> str:
    r"""Write a table as comma-separated values, the same bytes for the same table everywhere.

    Numbers have six decimals. In texts, line ends and control characters become escapes such as `\n`, so
    that one row is one line; a text that a spreadsheet would take for a formula begins with an apostrophe.

    Examples
    --------
    >>> print(csv_text(["x", "name"], [(0.5, "=SUM(A1)"), (-2, "bed,\nroom")]), end="")
    x,name
    0.500000,'=SUM(A1)
    -2.000000,"bed,\nroom"
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: float | str) -> str:
    if not isinstance(value, str):
        return f"{round(value, 6) + 0.0:.6f}"  # the sum turns -0.0 into 0.0
    text = _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), value)
    return f"'{text}" if text.startswith(_LIVE) else text
