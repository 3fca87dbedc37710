"""From IFC building models to robot tasks: targets, obstacles, routes, simulation and figures.

Names load their module when first used; importing bimnav alone is cheap.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bimnav._door_access import DoorAccess as DoorAccess
    from bimnav._explain import CellExplanation as CellExplanation, Explanation as Explanation, Reason as Reason
    from bimnav._georeference import Georeference as Georeference
    from bimnav._oriented import PosePath as PosePath, find_poses as find_poses
    from bimnav._start import Start as Start, find_start as find_start
    from bimnav._study import Study as Study, study as study
    from bimnav._topology import Topology as Topology, topology as topology
    from bimnav._why import NoRoute as NoRoute, why_unreachable as why_unreachable
    from bimnav.adaptive import (
        AdaptiveGraph as AdaptiveGraph,
        AdaptivePath as AdaptivePath,
        adaptive_graph as adaptive_graph,
    )
    from bimnav.assets import Asset as Asset
    from bimnav.building import (
        Building as Building,
        Classification as Classification,
        Connector as Connector,
        Detection as Detection,
        Door as Door,
        Element as Element,
        Facts as Facts,
        Issue as Issue,
        Ledger as Ledger,
        Mesh as Mesh,
        Opening as Opening,
        Shape as Shape,
        Space as Space,
        Storey as Storey,
    )
    from bimnav.detections import read_targets as read_targets
    from bimnav.environment import (
        IndoorEnvironment as IndoorEnvironment,
        Obstacle as Obstacle,
        Region as Region,
        Target as Target,
        Zone as Zone,
        make_environment as make_environment,
    )
    from bimnav.errors import BimnavError as BimnavError
    from bimnav.graph import (
        Conflict as Conflict,
        NavGraph as NavGraph,
        NodeKind as NodeKind,
        build_graph as build_graph,
    )
    from bimnav.grid import Cell as Cell, GridFrame as GridFrame, rasterize as rasterize
    from bimnav.ifc import read_ifc as read_ifc
    from bimnav.ifc._federate import federate as federate
    from bimnav.inspection import inspect as inspect
    from bimnav.links import Link as Link, RefusedConnector as RefusedConnector
    from bimnav.live import LiveField as LiveField
    from bimnav.mission import Mission as Mission, run as run
    from bimnav.plan import (
        Assignment as Assignment,
        Charge as Charge,
        Path as Path,
        StopOrder as StopOrder,
        TeamPlan as TeamPlan,
        Tour as Tour,
        assign_stops as assign_stops,
        distance_field as distance_field,
        distance_matrix as distance_matrix,
        find_path as find_path,
        order_stops as order_stops,
        plan_tour as plan_tour,
        plan_tours as plan_tours,
    )
    from bimnav.plot import (
        animate as animate,
        plot_building as plot_building,
        plot_environment as plot_environment,
        plot_field as plot_field,
        plot_fleet as plot_fleet,
        plot_graph as plot_graph,
        plot_study as plot_study,
        plot_timeline as plot_timeline,
        plot_tour as plot_tour,
    )
    from bimnav.readiness import (
        DoorCheck as DoorCheck,
        Readiness as Readiness,
        RoomCheck as RoomCheck,
        StoreyCheck as StoreyCheck,
        doors_of as doors_of,
    )
    from bimnav.replan import Replan as Replan, Replanner as Replanner
    from bimnav.robot import Robot as Robot
    from bimnav.robots import list_robots as list_robots, load_robot as load_robot
    from bimnav.samples import list_samples as list_samples, sample as sample
    from bimnav.sim import (
        Chance as Chance,
        Charger as Charger,
        DoorLocks as DoorLocks,
        DoorUnlocks as DoorUnlocks,
        Emergency as Emergency,
        Lift as Lift,
        ObstacleAppears as ObstacleAppears,
        ObstacleRemoved as ObstacleRemoved,
        Passage as Passage,
        Person as Person,
        RobotFails as RobotFails,
        Sensing as Sensing,
        SimDoor as SimDoor,
        SimResult as SimResult,
        SpeedLimit as SpeedLimit,
        TargetReported as TargetReported,
        ZoneHazardous as ZoneHazardous,
        egress_distances as egress_distances,
        find_passages as find_passages,
        simulate as simulate,
    )
    from bimnav.stops import Stand as Stand, Stop as Stop, Unreached as Unreached
    from bimnav.tasks import (
        Overruled as Overruled,
        Rule as Rule,
        Standoff as Standoff,
        Task as Task,
        list_tasks as list_tasks,
        load_task as load_task,
    )
    from bimnav.verify import (
        Check as Check,
        check_path as check_path,
        check_plan as check_plan,
        check_poses as check_poses,
    )

__version__ = "0.1.0"

_HOMES = {
    "bimnav.building": (
        "Building Classification Connector Detection Door Element Facts Issue Ledger Mesh Opening Shape Space Storey"
    ),
    "bimnav.assets": "Asset",
    "bimnav.detections": "read_targets",
    "bimnav.environment": "IndoorEnvironment Obstacle Region Target Zone make_environment",
    "bimnav.errors": "BimnavError",
    "bimnav.graph": "Conflict NavGraph NodeKind build_graph",
    "bimnav.stops": "Stand Stop Unreached",
    "bimnav.grid": "Cell GridFrame rasterize",
    "bimnav.ifc": "read_ifc",
    "bimnav.inspection": "inspect",
    "bimnav._door_access": "DoorAccess",
    "bimnav._explain": "CellExplanation Explanation Reason",
    "bimnav._georeference": "Georeference",
    "bimnav._why": "NoRoute why_unreachable",
    "bimnav._oriented": "PosePath find_poses",
    "bimnav.adaptive": "AdaptiveGraph AdaptivePath adaptive_graph",
    "bimnav._start": "Start find_start",
    "bimnav.ifc._federate": "federate",
    "bimnav.links": "Link RefusedConnector",
    "bimnav.live": "LiveField",
    "bimnav.mission": "Mission run",
    "bimnav.plan": (
        "Assignment Charge Path StopOrder TeamPlan Tour assign_stops distance_field distance_matrix find_path "
        "order_stops plan_tour plan_tours"
    ),
    "bimnav.plot": (
        "animate plot_building plot_environment plot_field plot_fleet plot_graph plot_study plot_timeline plot_tour"
    ),
    "bimnav.readiness": "DoorCheck Readiness RoomCheck StoreyCheck doors_of",
    "bimnav.replan": "Replan Replanner",
    "bimnav.robot": "Robot",
    "bimnav.robots": "list_robots load_robot",
    "bimnav.samples": "list_samples sample",
    "bimnav.sim": (
        "Chance Charger DoorLocks DoorUnlocks Emergency Lift ObstacleAppears ObstacleRemoved Passage Person RobotFails "
        "Sensing SimDoor SimResult SpeedLimit TargetReported ZoneHazardous egress_distances find_passages simulate"
    ),
    "bimnav._study": "Study study",
    "bimnav.tasks": "Overruled Rule Standoff Task list_tasks load_task",
    "bimnav._topology": "Topology topology",
    "bimnav.verify": "Check check_path check_plan check_poses",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'bimnav' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
