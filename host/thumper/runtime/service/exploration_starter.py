"""Starts the exploration that a client requests."""

from thumper.common.errors import ThumperError
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.drive.exploration import BACK, NOTHING_LEFT, MapAndPose, explore, home_at
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.drive.tasks import Task
from thumper.runtime.publisher import Publisher
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.preconditions import Preconditions
from thumper.slam.mapper import SwitchesMode

LIMIT_S = 900.0


class ExplorationStarter:
    """Explores from where the robot is, and returns there."""

    def __init__(
        self,
        *,
        footprint: Footprint,
        task_driver: TaskDriver,
        drive_manager: DriveManager,
        now: MapAndPose,
        inputs: SensorInputs,
        publisher: Publisher,
        preconditions: Preconditions,
    ) -> None:
        self._footprint = footprint
        self._task_driver = task_driver
        self._drive_manager = drive_manager
        self._now = now
        self._inputs = inputs
        self._publisher = publisher
        self._preconditions = preconditions

    def start(self) -> str:
        """Start to explore; raise ThumperError if that is impossible now."""
        self._preconditions.require_serving("exploration")
        self._preconditions.require_no_experiment()
        estimator = self._inputs.estimator
        state, mapper = estimator.state(), estimator.mapper
        if state is None or not self._inputs.has_map:
            raise ThumperError("cannot explore yet: there is no map to plan with; is the lidar on?")
        if isinstance(mapper, SwitchesMode) and mapper.is_localizing:
            raise ThumperError("the robot localizes and does not map; switch it with `thumper mode map`")
        home = home_at(state.map_from_base)
        self._task_driver.begin_at_once(self._explore(home))
        return f"exploring, for {LIMIT_S / 60.0:.0f} minutes at most; then back to {home}"

    def _explore(self, home: Goal) -> Task:
        explorer = Explorer(ExplorationOptions(), self._footprint)
        report = self._publisher.publish_event
        result = yield from explore(explorer, self._now, home, limit_s=LIMIT_S, report=report)
        if not result.reached:
            report(f"not {BACK}: {result.reason}")
            return result
        self._drive_manager.reason = result.reason  # instead of the home goal, which no user has set
        # That no frontier is left was reported before the way home.
        report(BACK if result.reason.startswith(NOTHING_LEFT) else result.reason)
        return result
