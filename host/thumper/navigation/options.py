"""All options of navigation: the `[navigation]` table of the robot's TOML."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt

from thumper.navigation.controllers.dwa import DwaOptions
from thumper.navigation.controllers.mppi import MppiOptions
from thumper.navigation.controllers.pure_pursuit import PurePursuitOptions
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions
from thumper.navigation.controllers.tight_passage import TightPassageOptions
from thumper.navigation.controllers.trajectory_tracker import TrajectoryTrackerOptions
from thumper.navigation.costmap.costmap import CostmapOptions
from thumper.navigation.costmap.filters import CostmapFilterOptions
from thumper.navigation.costmap.obstacle_memory import ObstacleMemoryOptions
from thumper.navigation.planners.lattice import LatticeOptions
from thumper.navigation.planners.replanning import ReplanningOptions
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.recovery.behaviors import RecoveryOptions
from thumper.navigation.recovery.progress_checker import ProgressOptions
from thumper.navigation.safety.collision_monitor import CollisionMonitorOptions
from thumper.navigation.safety.dynamic_obstacles import DynamicObstacleOptions
from thumper.navigation.speed_limits import SpeedLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationOptions:
    """Which planner and controller drive, and the options of every part."""

    # Global planner: astar, navfn, lattice or carrot.
    planner: str = "astar"
    # Controller: dwa, trajectory_rollout, pure_pursuit, cascade or mppi.
    controller: str = "dwa"
    # Follows the path where it has room on both sides: "cascade", the trajectory tracker; "" for none.
    tracker: Literal["cascade", ""] = "cascade"
    # Time without a safe motion or a path after which a recovery begins [s]. A robot stationary for this long
    # within the goal's tolerance has arrived.
    patience_s: Annotated[float, Gt(0)] = 2.0
    # Margin round the footprint in all planned motion [m]: the map has coarse cells and noise.
    padding_m: Annotated[float, Ge(0)] = 0.01
    # Lowest speed of the approach to the goal [m/s]; below some speed a base sticks.
    approach_m_s: Annotated[float, Gt(0)] = 0.06
    limits: SpeedLimits = field(default_factory=SpeedLimits)
    costmap: CostmapOptions = field(default_factory=CostmapOptions)
    masks: CostmapFilterOptions = field(default_factory=CostmapFilterOptions)
    memory: ObstacleMemoryOptions = field(default_factory=ObstacleMemoryOptions)
    traversal: TraversalCostOptions = field(default_factory=TraversalCostOptions)
    lattice: LatticeOptions = field(default_factory=LatticeOptions)
    route: ReplanningOptions = field(default_factory=ReplanningOptions)
    rotate_in_place: RotateInPlaceOptions = field(default_factory=RotateInPlaceOptions)
    dwa: DwaOptions = field(default_factory=DwaOptions)
    pure_pursuit: PurePursuitOptions = field(default_factory=PurePursuitOptions)
    cascade: TrajectoryTrackerOptions = field(default_factory=TrajectoryTrackerOptions)
    mppi: MppiOptions = field(default_factory=MppiOptions)
    manoeuvre: TightPassageOptions = field(default_factory=TightPassageOptions)
    monitor: CollisionMonitorOptions = field(default_factory=CollisionMonitorOptions)
    traffic: DynamicObstacleOptions = field(default_factory=DynamicObstacleOptions)
    progress: ProgressOptions = field(default_factory=ProgressOptions)
    recovery: RecoveryOptions = field(default_factory=RecoveryOptions)
