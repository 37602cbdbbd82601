"""Planners and controllers by name. A new one is one file and one line here."""

from collections.abc import Callable, Mapping

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.navigation.controllers.controller import Controller
from thumper.navigation.controllers.dwa import DwaController, TrajectoryRolloutController
from thumper.navigation.controllers.mppi import MppiController
from thumper.navigation.controllers.pure_pursuit import PurePursuitController
from thumper.navigation.controllers.trajectory_tracker import SwitchingController, TrajectoryTracker
from thumper.navigation.footprint import Footprint
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.carrot import CarrotPlanner
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner

PLANNERS: Mapping[str, Callable[[NavigationOptions, Footprint], Planner]] = {
    "carrot": lambda _options, footprint: CarrotPlanner(footprint),
    "navfn": lambda options, _footprint: NavfnPlanner(options.navfn),
    "astar": lambda options, _footprint: AStarPlanner(options.astar),
    "lattice": lambda options, footprint: LatticePlanner(options.lattice, footprint),
}
CONTROLLERS: Mapping[str, Callable[[NavigationOptions, Footprint], Controller]] = {
    "dwa": lambda options, footprint: DwaController(options.dwa, options.limits, footprint),
    "trajectory_rollout": lambda options, footprint: TrajectoryRolloutController(
        options.trajectory_rollout, options.limits, footprint
    ),
    "pure_pursuit": lambda options, footprint: PurePursuitController(
        options.pure_pursuit, options.limits, footprint
    ),
    "cascade": lambda options, footprint: TrajectoryTracker(options.cascade, options.limits, footprint),
    "mppi": lambda options, footprint: MppiController(options.mppi, options.limits, footprint),
}


def check_names(options: NavigationOptions) -> None:
    """Raise ThumperError, with exit code 2, for a planner or controller that there is none of."""
    for kind, name, known in (
        ("planner", options.planner, PLANNERS),
        ("controller", options.controller, CONTROLLERS),
    ):
        if name not in known:
            raise ThumperError(
                f"no {kind} '{name}': choose one of {', '.join(sorted(known))}", exit_code=EXIT_USAGE
            )


def make_planner(options: NavigationOptions, footprint: Footprint) -> Planner:
    """Return the planner that the options name. Raises as `check_names`."""
    check_names(options)
    return PLANNERS[options.planner](options, footprint)


def make_controller(options: NavigationOptions, footprint: Footprint) -> Controller:
    """Return the controller that the options name, with the tracker before it. Raises as `check_names`."""
    check_names(options)
    chosen = CONTROLLERS[options.controller](options, footprint)
    if options.tracker in ("", options.controller):
        return chosen
    tracker = TrajectoryTracker(options.cascade, options.limits, footprint)
    return SwitchingController(tracker, chosen, options.cascade, footprint)
