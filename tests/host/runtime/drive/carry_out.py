"""Carries out a task with a function in the place of the robot."""

from collections.abc import Callable

from thumper.common.errors import ThumperError
from thumper.runtime.drive.legs import AnyLeg
from thumper.runtime.drive.running_task import RunningTask
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_result import DriveResult


def carry_out(task: Task, drive: Callable[[AnyLeg], DriveResult]) -> DriveResult:
    """Pass the legs of a task to `drive`, one after another, and return its result."""
    running = RunningTask(task)
    while running.leg is not None:
        try:
            result = drive(running.leg)
        except ThumperError as refusal:
            running.leg_refused(refusal)
        else:
            running.leg_ended(result)
    return running.result()
