"""An environment cut into cells: which are floor, which are blocked, what they cost, where the targets lie."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.errors import NothingWalkableError, OutsideMapError
from bimnav.grid import EROSION, Cell, GridFrame, cells_within, rasterize

if TYPE_CHECKING:
    from bimnav.environment import IndoorEnvironment, Target

__all__ = ["FINEST", "Conflict", "Cut", "conflict_at", "cut", "zone_factor"]

FINEST = 0.01
"""Edge in metres of the smallest cells that `refine` tries."""


@dataclass(frozen=True, slots=True, eq=False)
class Conflict:
    """A target whose cell is also an obstacle cell.

    Parameters
    ----------
    obstacles
        GlobalIds of the elements that touch the cell.
    curable
        Whether smaller cells would resolve it: the destination itself is clear of obstacles.
    """

    global_id: str
    name: str
    cell: Cell
    obstacles: tuple[str, ...]
    curable: bool


class Cut(NamedTuple):
    """The cells of an environment; see `NavGraph`."""

    frame: GridFrame
    cost: NDArray[np.float32]
    obstacle: NDArray[np.bool_]
    floor: NDArray[np.bool_]
    targets: tuple[tuple[Target, Cell | None], ...]
    conflicts: tuple[Conflict, ...]


def cut(environment: IndoorEnvironment, cell_size: float, on_conflict: Literal["approach", "reach"]) -> Cut:
    """Cut an environment into cells."""
    floors = [environment.floor(storey) for storey in range(len(environment.levels))]
    bounds = np.array([floor.bounds for floor in floors if not floor.is_empty])
    if not len(bounds):
        raise NothingWalkableError(
            f"{environment.building.name!r} has no floor that robot {environment.robot.name!r} could stand on.",
            "Use a smaller robot." if environment.regions else "No space, slab or wall of it has a shape.",
        )
    frame = GridFrame.covering(
        (*bounds[:, :2].min(axis=0), *bounds[:, 2:].max(axis=0)),
        cell_size,
        elevations=environment.levels,
        ground=environment.ground,
    )
    obstacle = np.zeros(frame.shape, dtype=np.bool_)
    walkable = np.zeros(frame.shape, dtype=np.bool_)
    cost = np.ones(frame.shape, dtype=np.float32)
    for storey, floor in enumerate(floors):
        if floor.is_empty:
            continue
        walkable[storey] = cells_within(frame, floor)
        obstacle[storey] = rasterize(frame, [body for _, body in environment.bodies_on(storey)])
        for zone in environment.zones:
            if zone.storey == storey:
                touched = rasterize(frame, zone.polygon)
                cost[storey][touched] = np.maximum(cost[storey][touched], np.float32(zone.factor))
    targets = tuple(_targets_in(frame, environment))
    conflicts = tuple(
        conflict_at(frame, environment, target, cell) for target, cell in targets if cell is not None and obstacle[cell]
    )
    reached = tuple(np.array([conflict.cell for conflict in conflicts], dtype=int).reshape(-1, 3).T)
    kept = cost[reached]
    cost[obstacle | ~walkable] = np.inf
    if on_conflict == "reach":
        cost[reached] = kept
    return Cut(frame, cost, obstacle, walkable, targets, conflicts)


def zone_factor(frame: GridFrame, environment: IndoorEnvironment, cell: Cell) -> float:
    """Return the multiplier that the zones give to a cell."""
    storey, row, col = cell
    alone = replace(frame, first_row=frame.first_row + row, first_col=frame.first_col + col, rows=1, cols=1)
    zones = (zone for zone in environment.zones if zone.storey == storey)
    return max((zone.factor for zone in zones if rasterize(alone, zone.polygon).any()), default=1.0)


def _targets_in(frame: GridFrame, environment: IndoorEnvironment) -> Iterable[tuple[Target, Cell | None]]:
    for target in environment.targets:
        x, y, _ = target.destination
        try:
            yield target, frame.cell_at(x, y, storey=target.storey)
        except OutsideMapError as error:
            if target.source == "model":  # on the outside of a wall; it may be in reach even so
                yield target, None
                continue
            raise OutsideMapError(
                f"target {target.name!r} ({target.global_id}) at ({x:.3f}, {y:.3f}) lies outside the map.",
                error.hint,
                {"global_id": target.global_id, "name": target.name, "x": x, "y": y},
            ) from error


def conflict_at(frame: GridFrame, environment: IndoorEnvironment, target: Target, cell: Cell) -> Conflict:
    """Describe the conflict of a target whose cell is blocked."""
    x0, y0, x1, y1 = frame.box_of(cell)
    box = shapely.box(x0 + EROSION, y0 + EROSION, x1 - EROSION, y1 - EROSION)
    touching = [(o, body) for o, body in environment.bodies_on(cell.storey) if body.intersects(box)]
    point = shapely.Point(target.destination[:2])
    return Conflict(
        target.global_id,
        target.name,
        cell,
        tuple(dict.fromkeys(obstacle.global_id for obstacle, _ in touching)),
        curable=all(body.distance(point) > FINEST for _, body in touching),
    )
