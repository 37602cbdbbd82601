"""Planners and controllers by name. A new one is one file and one line here."""

from collections.abc import Callable, Mapping

from thumper.errors import ThumperError
from thumper.navigation.astar import AStarPlanner
from thumper.navigation.carrot import CarrotPlanner
from thumper.navigation.controller import Controller
from thumper.navigation.dwa import DwaController
from thumper.navigation.footprint import Footprint
from thumper.navigation.lattice import LatticePlanner
from thumper.navigation.mppi import MppiController
from thumper.navigation.navfn import NavfnPlanner
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planner import Planner
from thumper.navigation.pure_pursuit import PurePursuitController
from thumper.navigation.trajectory_rollout import TrajectoryRolloutController

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
    "mppi": lambda options, footprint: MppiController(options.mppi, options.limits, footprint),
}


def make_planner(options: NavigationOptions, footprint: Footprint) -> Planner:
    """Return the planner that the options name. Raises ThumperError for a name that there is none of."""
    if options.planner not in PLANNERS:
        raise ThumperError(f"no planner '{options.planner}': choose one of {', '.join(sorted(PLANNERS))}")
    return PLANNERS[options.planner](options, footprint)


def make_controller(options: NavigationOptions, footprint: Footprint) -> Controller:
    """Return the controller that the options name. Raises ThumperError for a name that there is none of."""
    if options.controller not in CONTROLLERS:
        raise ThumperError(
            f"no controller '{options.controller}': choose one of {', '.join(sorted(CONTROLLERS))}"
        )
    return CONTROLLERS[options.controller](options, footprint)
