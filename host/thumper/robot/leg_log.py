"""Logs what `Robot` drives to: `logging.basicConfig(level=logging.INFO)` in a script shows it."""

import logging

from thumper.runtime.drive.legs import AnyLeg, Leg
from thumper.runtime.drive_result import DriveProgress, DriveResult

log = logging.getLogger("thumper.robot")


class LegLog:
    """A display of a task: one line at the start of each drive to a goal, one at its end."""

    def __init__(self) -> None:
        self._leg: Leg | None = None

    def started(self, leg: AnyLeg) -> None:
        """Log where the robot drives."""
        self._leg = leg if isinstance(leg, Leg) else None
        if self._leg is not None:
            log.info("%s", self._leg.task)

    def progress(self, progress: DriveProgress) -> None:
        """Log nothing."""

    def ended(self, result: DriveResult | None) -> None:
        """Log how the drive has ended."""
        if self._leg is not None and result is not None:
            log.info("%s: %s", self._leg.task, result.reason)
