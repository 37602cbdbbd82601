"""One control cycle: sense, handle requests, decide and act, publish."""

import time
from contextlib import suppress
from dataclasses import dataclass, field

from thumper.board.board import TelemetrySample
from thumper.common.signals import raise_lost_interrupt
from thumper.navigation.navigator import NavigationOutput
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.object_finder import ObjectFinder
from thumper.runtime.publisher import LoopTiming, Publisher
from thumper.runtime.real_time_rate import RealTimeRate
from thumper.runtime.safe_stop import StopResult, stop_and_disarm
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.request_handler import RequestHandler


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """What a control cycle brought."""

    alive: bool  # the board sent telemetry
    output: NavigationOutput | None  # None if the navigator did not run


@dataclass(kw_only=True)
class ControlCycle:
    """The parts of the robot in the order in which a cycle uses them."""

    inputs: SensorInputs
    request_handler: RequestHandler
    drive_manager: DriveManager
    publisher: Publisher
    rate: RealTimeRate
    object_finder: ObjectFinder | None = None
    _timing: LoopTiming = field(default_factory=LoopTiming)

    @raise_lost_interrupt()
    def step(self) -> StepResult:
        """Run one cycle."""
        alive = self.inputs.read(self.drive_manager.resend_command)
        started_s, late_s = time.perf_counter(), self._late_s()
        self.request_handler.process_pending()
        output = self._decide_and_act() if alive else None
        self.publish(output)
        if self.object_finder is not None:
            self.object_finder.update()
        if alive:
            self.request_handler.board_jobs.run_for(self.inputs.now_s)
        self._timing = LoopTiming(late_s=late_s, busy_s=time.perf_counter() - started_s)
        return StepResult(alive=alive, output=output)

    @raise_lost_interrupt()
    def step_lent(self, samples: list[TelemetrySample]) -> None:
        """Run one cycle while an experiment drives the board: all but decide and act."""
        self.inputs.add_telemetry(samples)
        self.inputs.read_scans()
        self.request_handler.process_pending()
        self.publish()
        if samples:
            self.request_handler.board_jobs.run_for(self.inputs.now_s)
        self.rate.wait()

    def process_requests(self) -> None:
        """Handle the requests that have arrived."""
        self.request_handler.process_pending()

    @raise_lost_interrupt()
    def step_without_board(self, reason: str) -> None:
        """Run one cycle while the board is lost: publish, and refuse all requests with `reason`."""
        self.inputs.samples, self.inputs.scans = [], self.inputs.lidar.poll()
        self.publish()
        self.request_handler.refuse(reason)

    def stop(self, reason: str = "") -> StopResult:
        """Stop and disarm. Never raises, and depends on nothing but the board until that has stopped.

        A `reason` replaces the one of the last drive.
        """
        result = stop_and_disarm(self.inputs.board)
        with suppress(Exception):  # an error here must not hide how the drive ended
            self.inputs.add_telemetry(result.samples)
            self.inputs.read_scans()  # a stop takes up to 3 s: without its scans the lidar would seem lost
            self.publish()  # a recording contains the stop as well
        self.drive_manager.on_stopped(reason)
        return result

    def publish(self, output: NavigationOutput | None = None) -> None:
        """Publish the state of the robot."""
        self.publisher.publish(self.inputs, self.drive_manager, output, self._timing)

    def _decide_and_act(self) -> NavigationOutput | None:
        estimator, telemetry = self.inputs.estimator, self.inputs.telemetry
        state = estimator.state()
        if state is None or telemetry is None:
            return None
        return self.drive_manager.step(telemetry, state, estimator.mapper.grid)

    def _late_s(self) -> float:
        """Return how much later than its telemetry a cycle starts."""
        state = self.inputs.estimator.state()
        return self.inputs.now_s() - state.time_s if state else 0.0
