"""Plans played in simulated time. The only package that imports simpy.

`simulate` plays tours. Its result is an event log and the tracks of the robots: where each was, and what it
did, at every moment.
"""

from bimnav.sim.areas import Passage, SpeedLimit
from bimnav.sim.chance import Chance
from bimnav.sim.changes import (
    DoorLocks,
    DoorUnlocks,
    Emergency,
    ObstacleAppears,
    ObstacleRemoved,
    RobotFails,
    Sensing,
    TargetReported,
    ZoneHazardous,
)
from bimnav.sim.clearance import Encounter
from bimnav.sim.doors import SimDoor
from bimnav.sim.egress import egress_cells, egress_distances
from bimnav.sim.lifts import Lift
from bimnav.sim.log import Event, EventLog
from bimnav.sim.passages import find_passages
from bimnav.sim.people import Person
from bimnav.sim.result import SimResult, Tally
from bimnav.sim.setting import Charger, Policy, ServiceTime
from bimnav.sim.simulation import simulate
from bimnav.sim.track import RobotState, RobotStatus, Track

__all__ = [
    "Chance",
    "Charger",
    "DoorLocks",
    "DoorUnlocks",
    "Emergency",
    "Encounter",
    "Event",
    "EventLog",
    "Lift",
    "ObstacleAppears",
    "ObstacleRemoved",
    "Passage",
    "Person",
    "Policy",
    "RobotFails",
    "RobotState",
    "RobotStatus",
    "Sensing",
    "ServiceTime",
    "SimDoor",
    "SimResult",
    "SpeedLimit",
    "Tally",
    "TargetReported",
    "Track",
    "ZoneHazardous",
    "egress_cells",
    "egress_distances",
    "find_passages",
    "simulate",
]
