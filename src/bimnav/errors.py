"""Every error bimnav raises on purpose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

__all__ = [
    "ArchiveError",
    "BimnavError",
    "BudgetError",
    "CacheError",
    "FileKindError",
    "FileMissingError",
    "FileTooLargeError",
    "GeometryError",
    "GoalBlockedError",
    "GridError",
    "GridTooLargeError",
    "IfcReferenceError",
    "IfcSchemaError",
    "IfcStructureError",
    "IfcSyntaxError",
    "IfcTruncatedError",
    "IfcUnitsError",
    "IncompleteModelError",
    "InputError",
    "MissingExtraError",
    "ModelError",
    "NoPathError",
    "NoTargetError",
    "NothingWalkableError",
    "OutputError",
    "OutsideMapError",
    "PlanningError",
    "ReaderCrashError",
    "ReaderError",
    "ReaderMemoryError",
    "ReaderTimeoutError",
    "RobotError",
    "SelectorError",
    "SimulationError",
    "StartBlockedError",
    "TaskError",
    "UnsafePlanError",
    "ValueRangeError",
]


class BimnavError(Exception):
    """Base of all errors raised on purpose.

    Parameters
    ----------
    message
        What is wrong, with the file or element and the value.
    hint
        What to do about it.
    context
        The parts of the message, for programs.
    """

    code: ClassVar[str] = "BN-000"

    def __init__(self, message: str, hint: str = "", context: Mapping[str, Any] | None = None) -> None:
        super().__init__(message, hint, context)
        self.message = message
        self.hint = hint
        self.context: dict[str, Any] = dict(context or {})

    def __str__(self) -> str:
        return f"{self.message} {self.hint}".strip()

    def __reduce__(self) -> tuple[type[BimnavError], tuple[str, str, dict[str, Any]]]:
        return type(self), (self.message, self.hint, self.context)

    def to_dict(self) -> dict[str, Any]:
        """Return code, message, hint and context as plain values."""
        return {
            "code": self.code,
            "error": type(self).__name__,
            "message": self.message,
            "hint": self.hint,
            "context": self.context,
        }


class InputError(BimnavError, ValueError):
    """Something handed to bimnav cannot be used."""

    code = "BN-INP-000"


class ValueRangeError(InputError):
    """A number is not finite or lies outside its range."""

    code = "BN-INP-001"


class FileMissingError(InputError, FileNotFoundError):
    """There is no such file."""

    code = "BN-FIL-001"


class FileKindError(InputError):
    """The path names a folder, a device, a pipe, or a file of another kind."""

    code = "BN-FIL-002"


class FileTooLargeError(InputError):
    """The file is larger than the stated limit."""

    code = "BN-FIL-003"


class ArchiveError(InputError):
    """An .ifczip archive is damaged, encrypted, too large or holds no single model."""

    code = "BN-FIL-004"


class IfcSyntaxError(InputError):
    """The text is not a STEP file that can be parsed."""

    code = "BN-IFC-001"


class IfcSchemaError(InputError):
    """The file states a schema that cannot be read."""

    code = "BN-IFC-002"


class IfcTruncatedError(InputError):
    """The file is cut off: its end mark is missing."""

    code = "BN-IFC-003"


class IfcStructureError(InputError):
    """The file has no project or no product."""

    code = "BN-IFC-004"


class IfcUnitsError(InputError):
    """The file states no length unit, several, or one that is not a positive number of metres."""

    code = "BN-IFC-005"


class IfcReferenceError(InputError):
    """Entities refer to each other in a circle, too deeply, or to nothing."""

    code = "BN-IFC-006"


class IncompleteModelError(InputError):
    """Obstacles of the model were lost, so that a plan through them could not be trusted."""

    code = "BN-IFC-007"


class GeometryError(InputError):
    """A shape cannot be used: not finite, or out of range."""

    code = "BN-GEO-001"


class ModelError(BimnavError, KeyError):
    """The building has no such element, storey or space."""

    code = "BN-MOD-001"


class TaskError(InputError):
    """A task file or a task name is wrong."""

    code = "BN-TSK-001"


class SelectorError(TaskError):
    """A filter of a task cannot be evaluated."""

    code = "BN-TSK-002"


class RobotError(InputError):
    """A robot file or the name of a robot is wrong."""

    code = "BN-ROB-001"


class ReaderError(BimnavError, RuntimeError):
    """The process that reads the model failed; the calling program is unharmed."""

    code = "BN-RDR-000"


class ReaderCrashError(ReaderError):
    """The reading process died."""

    code = "BN-RDR-001"


class ReaderTimeoutError(ReaderError, TimeoutError):
    """The reading process did not end within its time."""

    code = "BN-RDR-002"


class ReaderMemoryError(ReaderError, MemoryError):
    """The reading process needed more memory than it was allowed."""

    code = "BN-RDR-003"


class GridError(InputError):
    """Arrays and frames do not fit each other, or a cell lies outside its frame."""

    code = "BN-GRD-000"


class BudgetError(BimnavError, ValueError):
    """The work asked for is larger than the stated limit; nothing was started."""

    code = "BN-BUD-000"


class GridTooLargeError(BudgetError):
    """The grid would have more cells than the limit."""

    code = "BN-GRD-001"


class PlanningError(BimnavError):
    """No plan can be made."""

    code = "BN-PLN-000"


class OutsideMapError(PlanningError, ValueError):
    """A point lies on no floor of the building."""

    code = "BN-PLN-001"


class StartBlockedError(PlanningError, ValueError):
    """The start lies inside an obstacle."""

    code = "BN-PLN-002"


class GoalBlockedError(PlanningError, ValueError):
    """The goal lies inside an obstacle."""

    code = "BN-PLN-003"


class NoPathError(PlanningError, LookupError):
    """The goal cannot be reached from the start."""

    code = "BN-PLN-004"


class NoTargetError(PlanningError, LookupError):
    """A job has no target at all."""

    code = "BN-PLN-005"


class NothingWalkableError(PlanningError, LookupError):
    """The building has no cell a robot could stand on."""

    code = "BN-PLN-006"


class UnsafePlanError(PlanningError):
    """A path was refused by the independent check; it is not returned."""

    code = "BN-PLN-007"


class SimulationError(BimnavError, RuntimeError):
    """The simulation cannot go on."""

    code = "BN-SIM-001"


class OutputError(BimnavError, OSError):
    """A file cannot be written; what stood there before is unchanged."""

    code = "BN-OUT-001"


class CacheError(OutputError):
    """The cache folder cannot be used."""

    code = "BN-OUT-003"


class MissingExtraError(BimnavError, ImportError):
    """An optional package is needed; the message names the extra that brings it."""

    code = "BN-EXT-001"
