"""Planners and controllers by name. A new one is one file and one line here."""

from collections.abc import Callable, Mapping

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.texts import choice_hint
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
    "carrot": lambda _, footprint: CarrotPlanner(footprint),
    "navfn": lambda options, _: NavfnPlanner(options.traversal),
    "astar": lambda options, _: AStarPlanner(options.traversal),
    "lattice": lambda options, footprint: LatticePlanner(options.lattice, options.traversal, footprint),
}
CONTROLLERS: Mapping[str, Callable[[NavigationOptions, Footprint], Controller]] = {
    "dwa": lambda o, footprint: DwaController(o.dwa, o.rotate_in_place, o.limits, footprint),
    "trajectory_rollout": lambda o, footprint: TrajectoryRolloutController(
        o.dwa, o.rotate_in_place, o.limits, footprint
    ),
    "pure_pursuit": lambda o, footprint: PurePursuitController(o.pure_pursuit, o.limits, footprint),
    "cascade": lambda o, footprint: TrajectoryTracker(o.cascade, o.rotate_in_place, o.limits, footprint),
    "mppi": lambda o, footprint: MppiController(o.mppi, o.rotate_in_place, o.limits, footprint),
}


def check_names(options: NavigationOptions) -> None:
    """Raise ThumperError, with exit code 2, for an unknown planner or controller."""
    for kind, name, known in (
        ("planner", options.planner, PLANNERS),
        ("controller", options.controller, CONTROLLERS),
    ):
        if name not in known:
            raise ThumperError(
                f"unknown {kind} {name!r}; {choice_hint(name, sorted(known))}", exit_code=EXIT_USAGE
            )


def make_planner(options: NavigationOptions, footprint: Footprint) -> Planner:
    """Return the configured planner. Raises as `check_names`."""
    check_names(options)
    return PLANNERS[options.planner](options, footprint)


def make_controller(options: NavigationOptions, footprint: Footprint) -> Controller:
    """Return the configured controller, with the tracker in front of it. Raises as `check_names`."""
    check_names(options)
    controller = CONTROLLERS[options.controller](options, footprint)
    if options.tracker in ("", options.controller):
        return controller
    tracker = TrajectoryTracker(options.cascade, options.rotate_in_place, options.limits, footprint)
    return SwitchingController(tracker, controller, options.cascade, footprint)
