"""How a robot heeds what it is told: to stand still, to get out of a zone, to make room, to stop for good."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bimnav.sim.dispatch import hand_over
from bimnav.sim.errands import Errand, Process, Step
from bimnav.sim.knowledge import Closure
from bimnav.sim.refuge import parking_for, way_out
from bimnav.sim.track import RobotStatus

if TYPE_CHECKING:
    from bimnav.sim.agents import RobotAgent

__all__ = ["obey"]


def obey(agent: RobotAgent) -> Process:
    """Heed the orders that came, in the order in which they came."""
    orders, agent.orders = agent.orders, []
    for order in orders:
        if agent.is_over:
            return
        if order.kind == "fail":
            yield from _fail(agent, order.cause, order.seconds)
        elif order.kind == "leave" and order.closure is not None:
            yield from _leave(agent, order.closure)
        elif order.kind == "park":
            yield from _park(agent, order.cause)
        elif order.kind == "end":
            _stop_work(agent, order.cause)


def _fail(agent: RobotAgent, cause: str, repair: float) -> Process:
    """Stand still; hand over what is left, and go on after a repair."""
    agent.become(RobotStatus.FAILED)
    agent.note("fail", agent.agenda[0].stop if agent.agenda else None, cause)
    agent.record()
    body = agent.world.stranded(agent)
    if math.isinf(repair):
        agent.is_over = True
    hand_over(agent, cause)
    if agent.is_over:
        return
    yield agent.world.pass_time(repair)
    agent.battery.level = max(agent.battery.level, 0.0)
    agent.become(RobotStatus.IDLE)
    agent.note("recover", None, f"repaired after {repair:g} s")
    agent.world.open_up(body, f"{agent.robot.name} works again")


def _leave(agent: RobotAgent, zone: Closure) -> Process:
    """Get out of a zone by the shortest way."""
    errand = way_out(agent, [zone])
    if errand is None:
        return
    errand.purpose = f"leaves {zone.name}"
    yield from _follow_freely(agent, errand)


def _park(agent: RobotAgent, cause: str) -> Process:
    """Give everything up, and stand where nobody wants to pass."""
    for errand in tuple(agent.agenda):
        agent.give_up(errand, cause)
    agent.home = None
    agent.become(RobotStatus.IDLE)
    aside = parking_for(agent)
    if aside is None:
        agent.note("park", None, f"{cause}: in nobody's way")
        agent.record()
        return
    aside.purpose = cause
    arrived = yield from _follow_freely(agent, aside)
    agent.note("park", None, f"{cause}: off the way out" if arrived else f"{cause}: stopped on the way")
    agent.record()


def _follow_freely(agent: RobotAgent, errand: Errand) -> Step:
    """Follow a line although it leads over closed floor."""
    assert errand.leg is not None  # noqa: S101 - made with a way
    errand.is_begun = False
    while errand.leg is not None and not any(order.kind in ("fail", "end") for order in agent.orders):
        later, agent.orders = [order for order in agent.orders if order.kind != "look"], []
        arrived = yield from agent.follow(errand, errand.leg)
        agent.orders = later + agent.orders
        if arrived:
            return True
    return False


def _stop_work(agent: RobotAgent, cause: str) -> None:
    """Leave everything that is left undone; nothing more happens."""
    for errand in tuple(agent.agenda):
        agent.give_up(errand, cause)
    if agent.status is not RobotStatus.FAILED:
        agent.become(RobotStatus.IDLE)
    agent.note("end", None, cause)
    agent.record()
    agent.is_over = True
