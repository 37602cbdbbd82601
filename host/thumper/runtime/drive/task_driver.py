"""Carries out a task: starts its legs, one after another, and passes their results back to it."""

from contextlib import suppress

from thumper.common.errors import ThumperError
from thumper.navigation.navigator import NavigationOutput
from thumper.runtime.drive.display import Display, NoDisplay
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode, DriveOutcome
from thumper.runtime.drive.goal_limits import GoalLimits
from thumper.runtime.drive.leg_run import DONE, LegRun
from thumper.runtime.drive.legs import AnyLeg, Wait
from thumper.runtime.drive.running_task import RunningTask
from thumper.runtime.drive.tasks import Task
from thumper.runtime.sensor_inputs import SensorInputs


class TaskDriver:
    """At most one task is under way: the program's own, or the newest that a client has sent."""

    def __init__(self, inputs: SensorInputs, drive_manager: DriveManager, goal_limits: GoalLimits) -> None:
        self.task: RunningTask | None = None
        self._inputs = inputs
        self._drive_manager = drive_manager
        self._goal_limits = goal_limits
        self._leg: LegRun | None = None
        self._display: Display = NoDisplay()

    def begin(self, task: RunningTask, display: Display) -> None:
        """Make `task` the present one; its first leg starts as soon as the robot is ready."""
        self.task, self._leg, self._display = task, None, display

    def begin_at_once(self, task: Task) -> None:
        """Start the first leg of a client's task, which replaces the present one.

        If the task first waits, the robot stops: nothing may continue the motion that was replaced.

        Raises
        ------
        ThumperError
            The leg is refused; the present task goes on.
        """
        running = RunningTask(task)
        assert running.leg is not None  # each task has a leg
        if isinstance(running.leg, Wait) and self._drive_manager.mode is not DriveMode.IDLE:
            self._drive_manager.stop("replaced by another task")
        leg = self._leg_run(running.leg)
        try:
            leg.start()
        except ThumperError:
            task.close()  # now: its mission's number is free for the next
            raise
        if self.task is not None:
            self.task.end("replaced by another goal")
        self.task, self._leg, self._display = running, leg, NoDisplay()

    def clear(self) -> None:
        """Forget the task, which is over."""
        self.task, self._leg, self._display = None, None, NoDisplay()

    @property
    def leg_has_started(self) -> bool:
        """Whether a leg is under way."""
        return self._leg is not None and self._leg.has_started

    @property
    def leg_moves(self) -> bool:
        """Whether the leg under way drives the wheels."""
        return self._leg is not None and self._leg.moves

    def start_leg(self) -> bool:
        """Start the next leg if there is one and the robot is ready; return False if it is over already."""
        if self.task is None or self.task.leg is None:
            return True
        if self._leg is None:
            self._leg = self._leg_run(self.task.leg)
            self._display.started(self.task.leg)
        try:
            self._leg.start_if_ready()
        except ThumperError as refusal:
            self._refuse(refusal)
            return False
        if self._leg.is_done_at_once:
            self.end_leg(DONE)
            return False
        return True

    def follow_up(self, output: NavigationOutput | None) -> DriveOutcome | None:
        """After a cycle, show the progress of the leg; return how it ended, once it has."""
        leg = self._leg
        if leg is None or not leg.has_started:
            return None
        if output is not None:
            self._inputs.log_plan(output.plan)
        is_driving = output is not None or self._drive_manager.is_waiting
        if is_driving and (progress := leg.progress()):
            self._display.progress(progress)
        return leg.outcome()

    def end_leg(self, outcome: DriveOutcome) -> None:
        """Pass the result of the leg under way to the task; the motors are off, or the board is lost."""
        assert self.task is not None
        assert self._leg is not None
        result = self._leg.result(outcome)
        with suppress(OSError):  # the terminal may be gone
            self._display.ended(result)
        self._leg = None
        self.task.leg_ended(result)

    def fail(self, error: ThumperError, *, before_start: ThumperError) -> None:
        """End the present leg because the robot failed; a leg that has not started is refused."""
        if self.task is None or self.task.is_over:
            return
        if self.leg_has_started:
            self.end_leg(DriveOutcome(reached=False, reason=str(error)))
        else:
            self._refuse(before_start)

    def interrupt(self, unconfirmed: str = "") -> None:
        """End the task because of Ctrl-C; raise KeyboardInterrupt if it has no result yet.

        `unconfirmed` says that the board did not confirm the stop.
        """
        task = self.task
        if task is None:
            return
        if task.is_over:
            task.mark_interrupted()
        elif self.leg_has_started and task.leg is not None:
            reason = f"interrupted; {unconfirmed}" if unconfirmed else "interrupted"
            self.end_leg(DriveOutcome(reached=False, reason=reason, by_user=True))
        if not task.is_over:
            task.end("interrupted", interrupted=True)
        if not task.has_result:
            raise KeyboardInterrupt

    def _refuse(self, refusal: ThumperError) -> None:
        assert self.task is not None
        self._display.ended(None)
        self._leg = None
        self.task.leg_refused(refusal)

    def _leg_run(self, leg: AnyLeg) -> LegRun:
        return LegRun(leg, self._inputs, self._drive_manager, self._goal_limits)
