"""All options of navigation, as the `[navigation]` table of the robot's TOML holds them."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt

from thumper.navigation.controllers.dwa import DwaOptions
from thumper.navigation.controllers.mppi import MppiOptions
from thumper.navigation.controllers.pure_pursuit import PurePursuitOptions
from thumper.navigation.controllers.tight_passage import TightPassageOptions
from thumper.navigation.controllers.trajectory_tracker import TrajectoryTrackerOptions
from thumper.navigation.costmap.costmap import CostmapOptions
from thumper.navigation.costmap.filters import CostmapFilterOptions
from thumper.navigation.costmap.obstacle_memory import ObstacleMemoryOptions
from thumper.navigation.planners.astar import AStarOptions
from thumper.navigation.planners.lattice import LatticeOptions
from thumper.navigation.planners.navfn import NavfnOptions
from thumper.navigation.planners.replanning import ReplanningOptions
from thumper.navigation.recovery.behaviors import RecoveryOptions
from thumper.navigation.recovery.progress_checker import ProgressOptions
from thumper.navigation.safety.collision_monitor import CollisionMonitorOptions
from thumper.navigation.safety.dynamic_obstacles import DynamicObstacleOptions
from thumper.navigation.speed_limits import SpeedLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationOptions:
    """Which planner and controller, and the options of every part."""

    # Global planner by name; see `thumper.navigation.registry`.
    planner: str = "astar"
    # Local controller by name.
    controller: str = "dwa"
    # Who follows a path with room on both sides: "cascade", the trajectory tracker, or "" for the controller.
    tracker: Literal["cascade", ""] = "cascade"
    # Time without any safe motion or path before a recovery begins, and of standing before the robot is taken
    # to be as near to its goal as it gets [s].
    patience_s: Annotated[float, Gt(0)] = 2.0
    # Space kept round the footprint in all planned motion [m]: the map is as coarse as its cells and noisy.
    padding_m: Annotated[float, Ge(0)] = 0.01
    # Slowest speed of the approach to the goal [m/s]; a base sticks below some speed.
    approach_m_s: Annotated[float, Gt(0)] = 0.06
    limits: SpeedLimits = field(default_factory=SpeedLimits)
    costmap: CostmapOptions = field(default_factory=CostmapOptions)
    masks: CostmapFilterOptions = field(default_factory=CostmapFilterOptions)
    astar: AStarOptions = field(default_factory=AStarOptions)
    navfn: NavfnOptions = field(default_factory=NavfnOptions)
    lattice: LatticeOptions = field(default_factory=LatticeOptions)
    dwa: DwaOptions = field(default_factory=DwaOptions)
    trajectory_rollout: DwaOptions = field(default_factory=DwaOptions)
    pure_pursuit: PurePursuitOptions = field(default_factory=PurePursuitOptions)
    cascade: TrajectoryTrackerOptions = field(default_factory=TrajectoryTrackerOptions)
    mppi: MppiOptions = field(default_factory=MppiOptions)
    memory: ObstacleMemoryOptions = field(default_factory=ObstacleMemoryOptions)
    manoeuvre: TightPassageOptions = field(default_factory=TightPassageOptions)
    route: ReplanningOptions = field(default_factory=ReplanningOptions)
    monitor: CollisionMonitorOptions = field(default_factory=CollisionMonitorOptions)
    traffic: DynamicObstacleOptions = field(default_factory=DynamicObstacleOptions)
    progress: ProgressOptions = field(default_factory=ProgressOptions)
    recovery: RecoveryOptions = field(default_factory=RecoveryOptions)
