"""Why an element, or a cell, is what it is: every element that has to do with it, and the rule that decides."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import shapely

from bimnav import _checks
from bimnav._floors import NEAR
from bimnav.building import Building, Element, Space, product_of
from bimnav.errors import GridError, ModelError
from bimnav.footprint import outline
from bimnav.grid import EROSION, Cell

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bimnav.environment import IndoorEnvironment, Obstacle
    from bimnav.graph import NavGraph
    from bimnav.tasks import Task

__all__ = ["CellExplanation", "Explanation", "Reason", "RulePick", "explain_cell", "explain_element"]

Role: TypeAlias = Literal[
    "obstacle", "left out", "above", "below", "lost", "target", "avoid", "restricted", "floor", "door", "closed"
]

_TALL = 3.0  # metres above the highest floor within which things belong to it


@dataclass(frozen=True, slots=True)
class RulePick:
    """A rule that picks an element.

    Parameters
    ----------
    kind
        The list of the task it stands in, such as `targets`.
    label
        What the rule is about, or its filter.
    source
        Where it is written, as `file:line`; empty for one written by hand.
    why
        What makes it pick the element.
    decides
        Whether it is the first of its list to do so; the others give way to it.
    """

    kind: str
    label: str
    source: str
    why: str
    decides: bool


@dataclass(frozen=True, slots=True)
class Reason:
    """What one element does on one storey.

    Parameters
    ----------
    role
        `obstacle`: it blocks. `left out`: it does not, by a rule or by what it is. `above`, `below`: it lies
        out of the robot's height band. `lost`: its geometry could not be read; this is its box. `target`,
        `avoid`, `restricted`, `floor`, `door`: what it is to the task. `closed`: closed since the graph was built.
    rule
        What decides, in words.
    storey
        Index of the storey; None where it is on none.
    low, high
        World heights, metres: of the part in the robot's height band for an obstacle, else of all of it.
    cost
        What a metre of floor costs for it; inf where it blocks or is never to be entered.
    picked_by
        The rules of the task that pick it, in the order in which they go before each other.
    """

    global_id: str
    name: str
    ifc_class: str
    role: Role
    rule: str
    storey: int | None = None
    low: float | None = None
    high: float | None = None
    cost: float = 1.0
    picked_by: tuple[RulePick, ...] = ()

    def __str__(self) -> str:
        return self.told(f"{self.ifc_class} {self.name!r} ({self.global_id})")

    def told(self, named: str) -> str:
        """Return the reason in words, for an element that is called so; nothing to call it, and the storey stands."""
        where = named if named or self.storey is None else f"storey {self.storey}"
        heights = "" if self.low is None or self.high is None else f"{self.low:.3f} to {self.high:.3f} m"
        cost = "" if self.cost in (1.0, math.inf) else f"cost {self.cost:g}"
        lines = [f"{self.role}: {', '.join(filter(None, (where, heights, cost)))}", f"    {self.rule}"]
        lost = (pick for pick in self.picked_by if not pick.decides)
        lines += [f"    gives way: rule {pick.label!r} ({pick.source or 'of no file'}): {pick.why}" for pick in lost]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; an infinite cost is the text `inf`."""
        values = asdict(self)
        return values | {"cost": _plain(self.cost), "picked_by": [asdict(pick) for pick in self.picked_by]}


@dataclass(frozen=True, slots=True, repr=False)
class Explanation:
    """What an element is to a task, on every storey, and why."""

    global_id: str
    name: str
    ifc_class: str
    reasons: tuple[Reason, ...]

    def __repr__(self) -> str:
        told = _indented(reason.told("") for reason in self.reasons)
        return "\n".join([f"{self.ifc_class} {self.name!r} ({self.global_id})", *told])

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        reasons = [reason.to_dict() for reason in self.reasons]
        return {"global_id": self.global_id, "name": self.name, "ifc_class": self.ifc_class, "reasons": reasons}


@dataclass(frozen=True, slots=True, repr=False)
class CellExplanation:
    """What a cell is, and every element that touches it.

    Parameters
    ----------
    box
        Lowest x and y, highest x and y, metres.
    is_floor
        Whether it lies wholly on walkable floor.
    cost
        Multiplier of the length of a step; inf where a robot cannot be.
    summary
        What decides about the cell, in words.
    reasons
        What touches it: first what decides.
    """

    cell: Cell
    storey: str
    box: tuple[float, float, float, float]
    is_floor: bool
    cost: float
    summary: str
    reasons: tuple[Reason, ...]

    def __repr__(self) -> str:
        x0, y0, x1, y1 = self.box
        head = f"{self.cell} on {self.storey}, x {x0:.3f} to {x1:.3f} m, y {y0:.3f} to {y1:.3f} m: {self.summary}"
        return "\n".join([head, *_indented(map(str, self.reasons))])

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; an infinite cost is the text `inf`."""
        return {
            "cell": list(self.cell),
            "storey": self.storey,
            "box": list(self.box),
            "is_floor": self.is_floor,
            "cost": _plain(self.cost),
            "summary": self.summary,
            "reasons": [reason.to_dict() for reason in self.reasons],
        }


def explain_element(environment: IndoorEnvironment, global_id: str) -> Explanation:
    """Say what an element or room is to the task of an environment, on every storey.

    Raises
    ------
    ModelError
        If the building has neither element, room nor target of this GlobalId.
    """
    building = environment.building
    product = product_of(building, global_id)
    reasons = tuple(_roles(environment, global_id, product))
    if product is None and not reasons:
        raise ModelError(
            f"no element, room or target of {building.name!r} has the GlobalId {global_id!r}.",
            "building.elements and building.spaces list them all.",
            {"global_id": global_id},
        )
    known = reasons[0] if product is None else product
    return Explanation(global_id, known.name, known.ifc_class, reasons)


def _roles(environment: IndoorEnvironment, global_id: str, product: Element | Space | None) -> Iterator[Reason]:
    """Yield everything that an element is to the task."""
    picks = () if product is None else _picks(environment.task, product, environment.building)
    for obstacle in environment.obstacles:
        if obstacle.global_id == global_id:
            yield _blocking(obstacle, _of(picks, "obstacles", "doors"))
    mine = [target for target in environment.targets if target.global_id == global_id]
    name = product.name if product else mine[0].name if mine else ""
    ifc_class = product.ifc_class if product else "detection"
    low, high = _heights(product)

    def reason(role: Role, rule: str, storey: int | None, cost: float = 1.0, kinds: tuple[str, ...] = ()) -> Reason:
        return Reason(global_id, name, ifc_class, role, rule, storey, low, high, cost, _of(picks, *kinds))

    why_not = dict(environment.left_out).get(global_id)
    if why_not:
        yield reason("left out", why_not, None, 1.0, ("ignore", "obstacles"))
    if global_id in environment.outside_bands:
        yield reason("above", "above or below the robot on every walkable storey", None)
    if global_id in environment.building.ledger.lost:
        yield reason("lost", environment.building.ledger.lost[global_id], None)
    for door in environment.doors:
        if door.global_id == global_id:
            yield reason("door", door.rule, None, 1.0, ("doors",))
    for zone in environment.zones:
        if zone.global_id == global_id:
            role: Role = "restricted" if math.isinf(zone.factor) else "avoid"
            yield reason(role, zone.rule, zone.storey, zone.factor, ("restricted", "avoid"))
    for region in environment.regions:
        if region.global_id == global_id:
            yield reason("floor", f"walkable floor of a {region.source}", region.storey)
    for target in mine:
        yield reason("target", target.rule, target.storey, 1.0, ("targets",))


def _blocking(obstacle: Obstacle, picks: tuple[RulePick, ...], aside: str = "") -> Reason:
    return Reason(
        obstacle.global_id,
        obstacle.name,
        obstacle.ifc_class,
        "obstacle",
        obstacle.rule + aside,
        obstacle.storey,
        obstacle.low,
        obstacle.high,
        math.inf,
        picks,
    )


def explain_cell(graph: NavGraph, cell: Cell) -> CellExplanation:
    """Say what a cell is, and name every element that touches it.

    Raises
    ------
    GridError
        If the graph has no such cell.
    """
    cell = Cell(*_checks.cell("cell", cell))
    if cell not in graph.frame:
        raise GridError(f"{cell} is not a cell of a frame of shape {graph.frame.shape}.")
    environment, box = graph.environment, graph.frame.box_of(cell)
    x0, y0, x1, y1 = box
    inner = shapely.box(x0 + EROSION, y0 + EROSION, x1 - EROSION, y1 - EROSION)
    reasons = tuple(_touching(environment, cell.storey, inner)) if environment else ()
    told = {reason.global_id for reason in reasons}
    for target, place in graph.targets if environment else ():
        if place == cell and environment and target.global_id not in told:
            found = _roles(environment, target.global_id, product_of(environment.building, target.global_id))
            reasons += tuple(reason for reason in found if reason.role == "target")
    cost = float(graph.cost[cell])
    storey = environment.storeys[cell.storey].name if environment else f"storey {cell.storey}"
    summary = _summary(graph, cell, cost, reasons)
    return CellExplanation(cell, storey, box, bool(graph.floor[cell]), cost, summary, reasons)


def _summary(graph: NavGraph, cell: Cell, cost: float, reasons: tuple[Reason, ...]) -> str:
    if math.isfinite(cost):
        dear = [reason for reason in reasons if reason.role == "avoid"]
        by = f", because of {', '.join(_named(reason) for reason in dear)}" if dear else ""
        kept = ", kept open for its target though an obstacle shares it" if graph.obstacle[cell] else ""
        return f"free, cost {cost:g}{by}{kept}"
    closing = [reason for reason in reasons if reason.role in ("obstacle", "restricted")]
    if closing:
        return f"blocked by {', '.join(_named(reason) for reason in closing)}"
    if not graph.floor[cell]:
        return "not wholly on walkable floor" if any(r.role == "floor" for r in reasons) else "no floor"
    return "closed since the graph was built"


def _named(reason: Reason) -> str:
    return f"{reason.name or reason.ifc_class} ({reason.global_id})"


def _touching(environment: IndoorEnvironment, storey: int, cell: BaseGeometry) -> Iterator[Reason]:
    """Yield what everything that touches a cell of a storey does there: what blocks first."""
    building, task = environment.building, environment.task
    blocking = set()
    for obstacle, body in environment.bodies_on(storey):
        if body.intersects(cell):
            blocking.add(obstacle.global_id)
            product = product_of(building, obstacle.global_id)
            picks = () if product is None else _of(_picks(task, product, building), "obstacles", "doors")
            under = obstacle.footprint.intersects(cell)
            yield _blocking(obstacle, picks, "" if under else "; the cell lies within the robot's radius of it")
    over = {product.global_id: product for product in _over(environment, storey, cell)}
    for zone in environment.zones:  # those around a thing, too
        if zone.storey == storey and zone.global_id not in over and zone.polygon.intersects(cell):
            found = _roles(environment, zone.global_id, product_of(building, zone.global_id))
            yield from (r for r in found if r.role in ("restricted", "avoid") and r.storey == storey)
    for product in over.values():
        if product.global_id in blocking:
            continue
        told = [r for r in _roles(environment, product.global_id, product) if r.storey in (storey, None)]
        told = [r for r in told if r.role not in ("obstacle", "above")]
        yield from told
        if isinstance(product, Element) and not {r.role for r in told} & {"left out", "lost", "floor"}:
            yield from _out_of_band(environment, product, storey)
    yield from _lost(building, cell)


def _lost(building: Building, cell: BaseGeometry) -> Iterator[Reason]:
    """Yield what was lost somewhere in a box over the cell."""
    for global_id, (low, high) in building.ledger.lost_bounds.items():
        if shapely.box(*low[:2], *high[:2]).intersects(cell):
            product = product_of(building, global_id)
            name, ifc_class = (product.name, product.ifc_class) if product else ("", "lost product")
            rule = f"it lies somewhere in this box: {building.ledger.lost[global_id]}"
            yield Reason(global_id, name, ifc_class, "lost", rule, None, float(low[2]), float(high[2]))


def _over(environment: IndoorEnvironment, storey: int, cell: BaseGeometry) -> Iterator[Element | Space]:
    """Yield the elements and rooms above or below a cell, on this storey."""
    levels = environment.levels
    top = min((level for level in levels if level > levels[storey]), default=levels[storey] + _TALL)
    top = max(top, levels[storey] + environment.robot.height)
    x0, y0, x1, y1 = cell.bounds
    products: tuple[Element | Space, ...] = (*environment.building.elements, *environment.building.spaces)
    for product in products:
        bounds = product.bounds
        if bounds is None or bounds[0, 2] >= top or bounds[1, 2] < levels[storey] - NEAR:
            continue
        is_near = bounds[0, 0] <= x1 and bounds[1, 0] >= x0 and bounds[0, 1] <= y1 and bounds[1, 1] >= y0
        if is_near and outline(product.shapes).intersects(cell):
            yield product


def _out_of_band(environment: IndoorEnvironment, element: Element, storey: int) -> Iterable[Reason]:
    """Say of a solid thing over a cell that it does not block there because of its height."""
    low, high = _heights(element)
    level, robot = environment.levels[storey], environment.robot
    if low is None or high is None:
        return
    role: Role = "below" if high <= level + robot.low else "above"
    if role == "below":
        rule = f"robot {robot.name!r} drives over what is lower than {robot.low:g} m"
    else:
        rule = f"robot {robot.name!r}, {robot.height:g} m tall, meets no part of it over the cell"
    yield Reason(element.global_id, element.name, element.ifc_class, role, rule, storey, low, high)


def _heights(product: Element | Space | None) -> tuple[float | None, float | None]:
    bounds = None if product is None else product.bounds
    return (None, None) if bounds is None else (float(bounds[0, 2]), float(bounds[1, 2]))


def _picks(task: Task, product: Element | Space, building: Building) -> tuple[RulePick, ...]:
    """Return every rule of a task that picks an element."""
    from bimnav.tasks import rules_for

    picks: list[RulePick] = []
    for kind, rule, why in rules_for(task, product, building):
        first = not any(pick.kind == kind for pick in picks)
        picks.append(RulePick(kind, rule.label or rule.filter, rule.source, why, first))
    return tuple(picks)


def _of(picks: tuple[RulePick, ...], *kinds: str) -> tuple[RulePick, ...]:
    return tuple(pick for pick in picks if pick.kind in kinds)


def _indented(texts: Iterable[str]) -> list[str]:
    return [f"  {line}" for text in texts for line in text.split("\n")]


def _plain(cost: float) -> float | str:
    return cost if math.isfinite(cost) else "inf"
