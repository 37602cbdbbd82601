"""The parts of a navigator, made from its options."""

from collections.abc import Callable
from dataclasses import dataclass

from thumper.common.kinematics import DriveGeometry
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.controllers.controller import Controller
from thumper.navigation.controllers.final_approach import FinalApproach
from thumper.navigation.controllers.goal_checker import GoalChecker
from thumper.navigation.controllers.goal_manoeuvre import GoalManoeuvre
from thumper.navigation.controllers.move_ahead import MoveAhead
from thumper.navigation.controllers.path_follower import PathFollower
from thumper.navigation.controllers.speed_limiter import SpeedLimiter
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower
from thumper.navigation.costmap.local_model import LocalModel
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.replanning import PathManager
from thumper.navigation.recovery.motion_watchdog import MotionWatchdog
from thumper.navigation.recovery.recovery_policy import RecoveryPolicy
from thumper.navigation.registry import make_controller, make_planner
from thumper.navigation.safety.command_filter import CommandFilter


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveGoal:
    """A goal and the parts of the navigator that last as long as it."""

    goal: Goal
    checker: GoalChecker
    recovery: RecoveryPolicy


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorParts:
    """What one navigator consists of."""

    planner: Planner
    controller: Controller
    model: LocalModel
    path: PathManager
    follower: PathFollower
    speed_limiter: SpeedLimiter
    command_filter: CommandFilter
    watchdog: MotionWatchdog
    activate: Callable[[Goal], ActiveGoal]

    @classmethod
    def build(
        cls,
        options: NavigationOptions,
        footprint: Footprint,
        drive: DriveGeometry | None,
        view: FieldOfView,
    ) -> "NavigatorParts":
        """Build the parts. Raises ThumperError, exit code 2, for an unknown name."""
        padded, limits = footprint.grown(options.padding_m), options.limits
        planner, controller = make_planner(options, padded), make_controller(options, padded)
        # A search of its own: the path's may go on at the same time.
        reachability_planner = make_planner(options, padded)
        lattice = LatticePlanner(options.lattice, options.traversal, padded)

        def activate(goal: Goal) -> ActiveGoal:
            recovery = RecoveryPolicy(
                goal,
                patience_s=options.patience_s,
                progress=options.progress,
                recovery=options.recovery,
                limits=limits,
                footprint=padded,
                planner=reachability_planner,
                controller=controller,
            )
            return ActiveGoal(goal=goal, checker=GoalChecker(goal), recovery=recovery)

        return cls(
            planner=planner,
            controller=controller,
            model=LocalModel(options.costmap, options.memory, footprint, padded, view),
            path=PathManager(planner, options.route, padded),
            follower=PathFollower(
                controller,
                PoseSequenceFollower(options.manoeuvre, limits, padded, lattice),
                FinalApproach(limits, padded, approach_m_s=options.approach_m_s),
                MoveAhead(limits, padded),
                GoalManoeuvre(PoseSequenceFollower(options.manoeuvre, limits, padded, lattice), padded),
                window_m=options.costmap.window_m,
            ),
            speed_limiter=SpeedLimiter(limits, approach_m_s=options.approach_m_s),
            command_filter=CommandFilter(
                limits=limits,
                monitor=options.monitor,
                dynamic_obstacles=options.traffic,
                footprint=footprint,
                padded=padded,
                drive=drive,
                view=view,
            ),
            watchdog=MotionWatchdog(options.progress),
            activate=activate,
        )
