"""The event log: one row for everything that happened, a table that equal runs repeat byte for byte."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, TypeAlias

from bimnav._files import write_text
from bimnav._wording import printable
from bimnav.errors import MissingExtraError
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    import pandas

__all__ = ["Event", "EventKind", "EventLog", "csv_text", "new_event"]

EventKind: TypeAlias = Literal[
    "start",
    "unreached",
    "depart",
    "arrive",
    "begin_service",
    "end_service",
    "remove",
    "finish",
    "wait",
    "resume",
    "open_door",
    "call_lift",
    "board_lift",
    "leave_lift",
    "charge",
    "charged",
    "sense",
    "contact",
    "replan",
    "block",
    "give_up",
    "fail",
    "recover",
    "assign",
    "change",
    "emergency",
    "park",
    "end",
]

_LIVE = tuple("=+-@\t\r")  # a spreadsheet takes a cell that begins like this for a formula


class Event(NamedTuple):
    """Something that happened to a robot, or to the world.

    Parameters
    ----------
    time
        Seconds.
    robot
        Name of the robot; empty for a change of the world.
    event
        What happened.
    status
        Of the robot, from this moment on; empty for a change of the world.
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
    battery
        What is left in it, as a share of a full one; None for a robot that never tires.
    asset
        Maker, model and the like of the target, on arrival at a stop.
    """

    time: float
    robot: str
    event: EventKind
    status: RobotStatus | Literal[""]
    storey: str
    x: float
    y: float
    z: float
    target: str = ""
    target_name: str = ""
    cause: str = ""
    leg_distance: float = 0.0
    battery: float | None = None
    asset: str = ""


new_event = partial(tuple.__new__, Event)
"""Make an event from a tuple of all its columns, in half the time that keywords and defaults take."""

_OPTIONAL = {"battery": None, "asset": ""}  # columns, and what they hold where they say nothing


@dataclass(frozen=True, slots=True)
class EventLog:
    """All events of a simulation, in the order they happened.

    Parameters
    ----------
    rows
        The events.
    """

    columns: ClassVar[tuple[str, ...]] = Event._fields

    rows: tuple[Event, ...]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Event]:
        return iter(self.rows)

    def __repr__(self) -> str:
        return f"EventLog({len(self)} events)"

    def to_records(self) -> list[dict[str, Any]]:
        """Return one dictionary per event, with the columns as keys."""
        return [row._asdict() for row in self.rows]

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """Write the log as comma-separated values; see `csv_text`.

        The columns `battery` and `asset` are left out if no row says anything in them.

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
        silent = {
            name for name, nothing in _OPTIONAL.items() if all(getattr(row, name) == nothing for row in self.rows)
        }
        columns = [column for column in self.columns if column not in silent]
        text = csv_text(columns, ([getattr(row, column) for column in columns] for row in self.rows))
        if path is not None:
            write_text(path, text)
        return text

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the log as a pandas data frame.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        return dataframe_of(self.to_records(), columns=list(self.columns))


def dataframe_of(rows: Any, columns: list[str] | None = None) -> pandas.DataFrame:
    """Return records, or an array of them, as a pandas data frame.

    Raises
    ------
    MissingExtraError
        If pandas is not installed.
    """
    try:
        import pandas
    except ImportError as error:
        raise MissingExtraError("to_dataframe needs pandas.", "pip install 'bimnav[dataframe]'") from error
    return pandas.DataFrame.from_records(rows, columns=columns)


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[float | str | None]]) -> str:
    r"""Write a table as comma-separated values, the same bytes for the same table everywhere.

    Numbers have six decimals; None is empty. In texts, line ends and control characters become escapes such as `\n`, so
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


def _cell(value: float | str | None) -> str:
    if value is None:
        return ""
    if not isinstance(value, str):
        return f"{round(value, 6) + 0.0:.6f}"  # the sum turns -0.0 into 0.0
    text = printable(value)
    return f"'{text}" if text.startswith(_LIVE) else text
