"""Links: how a robot gets from the cells of one storey to those of another, over stairs and ramps and in lifts."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav import _checks
from bimnav._indoors import part_in
from bimnav._kept import Kept
from bimnav.environment import grown
from bimnav.errors import ValueRangeError
from bimnav.grid import Cell, GridFrame

if TYPE_CHECKING:
    from bimnav._connectors import Ascent
    from bimnav.building import Element
    from bimnav.environment import IndoorEnvironment
    from bimnav.robot import Robot

__all__ = ["ConnectorKind", "Link", "RefusedConnector", "is_near_connector", "join_connectors"]

ConnectorKind: TypeAlias = Literal["stair", "ramp", "lift"]

_REACH = 1.0  # metres from where one gets on to the cell a link begins in
_POCKET = 0.5  # square metres; fewer free cells that lead nowhere are a pocket
_AROUND = 2.0  # metres around it in which cells are told from pockets
_LIFT_SPEED = 1.0  # metres per second; passenger lifts of few storeys run at 0.6 to 1.6
_LIFT_CALL = 20.0  # seconds to call a lift, and for its doors to open and close at both ends
_SLICE = 0.1  # metres of height in which what hangs over a stair is looked for
_FLUSH = 0.02  # metres between a tread and a floor that are one height
_SKIN = 1e-3  # metres; meshes of round things stray from the truth by this
_NO_POINTS = np.empty((0, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Link(Kept):
    """A way between cells of two storeys, open in both directions.

    Parameters
    ----------
    begin, end
        The cells it joins.
    length
        Metres in space.
    seconds
        How long the ride or climb takes; None for the robot's time over the length.
    kind
        `stair`, `ramp` or `lift`.
    global_id, name
        Of the connector.
    points : (n, 3) float64
        The way from the middle of one cell to that of the other, world metres; empty for a straight one.
    factor
        Multiplier of its cost, at least 1.

    Raises
    ------
    ValueRangeError
        If a number is out of range, or both cells lie on one storey.
    """

    begin: Cell
    end: Cell
    length: float
    seconds: float | None = None
    kind: ConnectorKind = "stair"
    global_id: str = ""
    name: str = ""
    points: NDArray[np.float64] = field(default_factory=lambda: _NO_POINTS)
    factor: float = 1.0

    def __post_init__(self) -> None:
        for name in ("begin", "end"):
            object.__setattr__(self, name, Cell(*_checks.cell(f"{name} of a link", getattr(self, name))))
        if self.kind not in get_args(ConnectorKind):
            raise ValueRangeError(f"kind of a link is {self.kind!r}.", "Give 'stair', 'ramp' or 'lift'.")
        if self.begin.storey == self.end.storey:
            raise ValueRangeError(
                f"link {self.name or self.global_id!r} begins and ends on storey {self.end.storey}.",
                "A link joins two storeys.",
            )
        for name, value, least in (
            ("length", self.length, 0),
            ("seconds", self.seconds or 0, 0),
            ("factor", self.factor, 1),
        ):
            if not _checks.number(f"{name} of a link", value) < math.inf or value < least:
                raise ValueRangeError(f"{name} of a link is {value}.", f"Give a finite number of at least {least}.")
        points = _checks.numbers("points of a link", self.points)
        if points.size and (points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all()):
            raise ValueRangeError(f"points of a link have shape {points.shape}.", "Give finite x, y and z of each.")
        points = points.reshape(-1, 3)
        points.flags.writeable = False
        object.__setattr__(self, "points", points)

    def __repr__(self) -> str:
        return f"Link({self.kind} {self.name or self.global_id!r}, {self.begin} to {self.end}, {self.length:.2f} m)"

    def points_from(self, cell: Cell) -> NDArray[np.float64]:
        """Return the points of the way that begins in one of its two cells."""
        return self.points if cell == self.begin else self.points[::-1]


@dataclass(frozen=True, slots=True)
class RefusedConnector:
    """A stair, ramp or lift that the robot does not use, and why."""

    global_id: str
    name: str
    kind: ConnectorKind
    reason: str


def is_near_connector(environment: IndoorEnvironment, frame: GridFrame, cells: NDArray[np.int64]) -> bool:
    """Tell whether any of some cells, as flat indexes, matters to where a connector is joined."""
    ascents = environment.building.ascents
    if not ascents or not len(cells):
        return False
    points = frame.centers_of(np.column_stack(np.unravel_index(cells, frame.shape)))
    ends = np.concatenate(
        [ascent.line(radius=environment.robot.radius) for ascent in ascents if ascent.way] or [_NO_POINTS]
    )[:, :2]
    low, high = points[:, :2].min(axis=0) - _AROUND, points[:, :2].max(axis=0) + _AROUND
    margin = 2 * frame.cell_size
    return bool(((ends >= low - margin) & (ends <= high + margin)).all(axis=1).any())


def join_connectors(
    environment: IndoorEnvironment, frame: GridFrame, free: NDArray[np.bool_], known: Iterable[Link] = ()
) -> tuple[tuple[Link, ...], tuple[RefusedConnector, ...]]:
    """Join the connectors of a building to the cells at their ends.

    A connector is used if the robot can climb or ride it, if nothing stands in the way, and if at two of
    its levels there is a free cell within a metre of where one gets on, with a straight way to it.

    Parameters
    ----------
    known
        Links found before among other free cells; those that still hold are taken over.
    """
    links: list[Link] = []
    refused: list[RefusedConnector] = []
    joints = _Joints(environment, frame, free, known)
    for ascent in environment.building.ascents:
        found = _why_unfit(ascent, environment.robot) or joints.links_of(ascent)
        if isinstance(found, str):
            refused.append(RefusedConnector(ascent.global_id, ascent.name, ascent.kind, found))
        else:
            links += found
    return tuple(links), tuple(refused)


def _why_unfit(ascent: Ascent, robot: Robot) -> str:
    """Say why a robot cannot use a connector, whatever stands on it; empty if it can."""
    if ascent.kind == "lift":
        if not robot.uses_lifts:
            return "the robot does not ride in lifts"
        if not ascent.way:
            return "no doors of it were found"
    elif not ascent.way:
        return "its geometry shows no treads" if ascent.kind == "stair" else "its geometry shows no slope"
    elif ascent.kind == "stair":
        if not robot.max_riser:
            return "the robot climbs no stairs"
        if ascent.riser is None or ascent.riser > robot.max_riser:
            riser = "unknown" if ascent.riser is None else f"{ascent.riser:.3f} m"
            return f"its risers are {riser}; the robot climbs {robot.max_riser:g} m"
    elif ascent.slope is None or ascent.slope > robot.max_slope:
        slope = "unknown" if ascent.slope is None else f"{ascent.slope:.3f}"
        return f"its slope is {slope}; the robot drives up to {robot.max_slope:g}"
    half = _half_width(ascent, robot)
    if half and (ascent.width is None or ascent.width < 2 * half):
        width = "of unknown width" if ascent.width is None else f"{ascent.width:.2f} m wide"
        return f"it is {width}; the robot is {2 * half:.2f} m"
    return ""


def _half_width(ascent: Ascent, robot: Robot) -> float:
    """Return how far a robot reaches to the sides on a connector: where it has to turn, as far as anywhere."""
    return robot.half_width if ascent.is_straight else robot.radius


class _Joints:
    """Where connectors meet the cells of a graph."""

    def __init__(
        self,
        environment: IndoorEnvironment,
        frame: GridFrame,
        free: NDArray[np.bool_],
        known: Iterable[Link],
    ) -> None:
        self.environment, self.frame, self.free = environment, frame, free
        self.parts = {connector.global_id: connector.parts for connector in environment.building.connectors}
        self.known = {(link.global_id, link.begin, link.end): link for link in known}

    @cached_property
    def solids(self) -> list[tuple[Element, NDArray[np.float64]]]:
        """What may stand in the way, with its box."""
        left_out = {global_id for global_id, _ in self.environment.left_out}
        return [
            (element, bounds)
            for element in self.environment.building.elements
            if element.global_id not in left_out and (bounds := element.bounds) is not None
        ]

    def links_of(self, ascent: Ascent) -> list[Link] | str:
        """Return the links of a connector, or why there are none."""
        own = {ascent.global_id, *self.parts[ascent.global_id], *ascent.doors}
        factor = max((zone.factor for zone in self.environment.zones if zone.global_id in own), default=1.0)
        if factor == math.inf:
            return "the task restricts it"
        links: list[Link] = []
        reasons: list[str] = []
        for way, begin, end in self._ways(ascent, reasons):
            known = self.known.get((ascent.global_id, begin, end))
            blocking = [] if known else self._blocking(ascent, way, own)
            if known:
                links.append(known)
            elif blocking:
                names = ", ".join(f"{e.name or e.ifc_class} ({e.global_id})" for e in blocking[:3])
                reasons.append(f"blocked by {names}")
            else:
                links.append(self._link(ascent, way, begin, end, factor))
        return links or "; ".join(dict.fromkeys(reasons))

    def _ways(self, ascent: Ascent, reasons: list[str]) -> Iterator[tuple[NDArray[np.float64], Cell, Cell]]:
        """Yield the ways between neighboring stops of a connector, of a lift between any two, and their cells."""
        radius = self.environment.robot.radius
        if ascent.kind == "lift":
            entries = [ascent.line(k, k, radius=radius)[0] for k in range(len(ascent.levels))]
            cells = [self._cell_near(ascent, entry, reasons) for entry in entries]
            for first, last in combinations(range(len(cells)), 2):
                begin, end = cells[first], cells[last]
                if begin is not None and end is not None:
                    way = ascent.line(first, last, radius=radius)
                    yield self._leveled(way, begin, end), begin, end
            return
        line = ascent.line(radius=radius)
        between = np.abs(line[:, 2:] - self.environment.levels).min(axis=1) <= _FLUSH
        between &= (line[:, 2] > line[0, 2] + _FLUSH) & (line[:, 2] < line[-1, 2] - _FLUSH)
        stops = [(0, self._cell_near(ascent, line[0], reasons))]
        stops += [(k, self._cell_near(ascent, line[k], [])) for k in np.flatnonzero(between).tolist()]
        stops += [(len(line) - 1, self._cell_near(ascent, line[-1], reasons))]
        joined = [(k, cell) for k, cell in stops if cell is not None]
        for (first, begin), (last, end) in pairwise(joined):
            yield self._leveled(line[first : last + 1], begin, end), begin, end

    def _leveled(self, way: NDArray[np.float64], begin: Cell, end: Cell) -> NDArray[np.float64]:
        """Return a way whose ends lie on the floors of their cells."""
        way = way.copy()
        levels = self.environment.levels
        low, high = way[0, 2], way[-1, 2]
        way[np.abs(way[:, 2] - low) <= _SKIN, 2] = levels[begin.storey]
        way[np.abs(way[:, 2] - high) <= _SKIN, 2] = levels[end.storey]
        return way

    def _cell_near(self, ascent: Ascent, entry: NDArray[np.float64], reasons: list[str]) -> Cell | None:
        """Return the nearest free cell from which a straight way leads to where one gets on."""
        robot, levels = self.environment.robot, np.asarray(self.environment.levels)
        step = robot.step_height if ascent.kind != "stair" else max(robot.step_height, robot.max_riser)
        x, y, z = entry.tolist()
        for storey in np.argsort(np.abs(levels - z), kind="stable").tolist():
            if abs(levels[storey] - z) > step + _FLUSH:
                break
            if not self.environment.is_clear(storey, (x, y)):
                continue
            for cell in self._cells_around(storey, x, y):
                if self.environment.is_clear(storey, self.frame.center_of(cell), (x, y)):
                    return cell
        reasons.append(
            f"no free cell with a straight way lies within {_REACH:g} m of its end at ({x:.2f}, {y:.2f}, {z:.2f})"
        )
        return None

    def _cells_around(self, storey: int, x: float, y: float) -> Iterator[Cell]:
        """Yield the free cells within reach of a point, the nearest first; those in pockets come last."""
        from scipy import ndimage

        frame, d = self.frame, self.frame.cell_size
        row, col = y / d - frame.first_row, x / d - frame.first_col
        low = np.floor(np.array([row, col]) - _AROUND / d).astype(int)
        high = np.ceil(np.array([row, col]) + _AROUND / d).astype(int)
        (row0, col0), (row1, col1) = np.maximum(low, 0).tolist(), np.maximum(high, 0).tolist()
        labels, _ = ndimage.label(self.free[storey, row0:row1, col0:col1])
        if not labels.size:
            return
        rim = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
        is_pocket = ~np.isin(np.arange(labels.max() + 1), rim)
        is_pocket &= np.bincount(labels.ravel()) * d**2 < _POCKET
        rows, cols = np.nonzero(labels)
        away = np.hypot(rows + row0 + 0.5 - row, cols + col0 + 0.5 - col) * d
        near = np.flatnonzero(away <= _REACH)
        # nanometres of difference are rounding
        keys = cols[near], rows[near], np.round(away[near], 9), is_pocket[labels[rows, cols]][near]
        for k in near[np.lexsort(keys)].tolist():
            yield Cell(storey, row0 + int(rows[k]), col0 + int(cols[k]))

    def _blocking(self, ascent: Ascent, way: NDArray[np.float64], own: Collection[str]) -> list[Element]:
        """Return what stands on a way, or hangs so low over it that the robot meets it."""
        robot = self.environment.robot
        slope = 0.0 if ascent.kind == "lift" else ascent.slope or 0.0
        foot = robot.low + (ascent.riser or 0.0) + slope * robot.radius
        foot = min(foot, robot.height / 2)
        low = way.min(axis=0) - robot.radius
        high = way.max(axis=0) + np.array([robot.radius, robot.radius, robot.height])
        near = [e for e, b in self.solids if (b[0] < high).all() and (b[1] > low).all() and e.global_id not in own]
        found: dict[str, Element] = {}
        for a, b in pairwise(_sliced(way, is_lift=ascent.kind == "lift")) if near else ():
            if ascent.kind == "lift" and a[2] != b[2]:
                continue  # the car goes where it goes
            line = shapely.LineString([a[:2], b[:2]]) if (a[:2] != b[:2]).any() else shapely.Point(a[:2])
            body = grown(line, _half_width(ascent, robot))
            bottom, top = min(a[2], b[2]) + foot, max(a[2], b[2]) + robot.height
            for element in near:
                if element.global_id not in found and part_in(element.shapes, bottom, top).intersects(body):
                    found[element.global_id] = element
        return list(found.values())

    def _link(self, ascent: Ascent, way: NDArray[np.float64], begin: Cell, end: Cell, factor: float) -> Link:
        points = np.vstack([self.frame.center_of(begin), way, self.frame.center_of(end)])
        legs = np.diff(points, axis=0)
        length, speed = float(np.linalg.norm(legs, axis=1).sum()), self.environment.robot.speed
        seconds = length / speed
        if ascent.kind == "lift":
            rise = abs(self.environment.levels[end.storey] - self.environment.levels[begin.storey])
            seconds = (length - rise) / speed + rise / _LIFT_SPEED + _LIFT_CALL
        return Link(
            begin, end, length, seconds, ascent.kind, ascent.global_id, ascent.name, points=points, factor=factor
        )


def _sliced(way: NDArray[np.float64], *, is_lift: bool) -> NDArray[np.float64]:
    """Return a way in pieces that rise by a slice at most; that of a lift as it is."""
    pieces = [way[:1]]
    for a, b in pairwise(way):
        count = 1 if is_lift else max(math.ceil(abs(b[2] - a[2]) / _SLICE), 1)
        pieces.append(a + (b - a) * np.arange(1, count + 1)[:, None] / count)
    return np.vstack(pieces)
