"""Plans played in simulated time. The only package that imports simpy.

`simulate` plays a tour. Its result is an event log and the track of the robot: where it was, and what it
did, at every moment.
"""

from bimnav.sim.log import Event, EventLog
from bimnav.sim.simulation import ServiceTime, SimResult, simulate
from bimnav.sim.track import RobotState, RobotStatus, Track

__all__ = [
    "Event",
    "EventLog",
    "RobotState",
    "RobotStatus",
    "ServiceTime",
    "SimResult",
    "Track",
    "simulate",
]
