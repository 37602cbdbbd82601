"""Shows the progress of a task, leg by leg."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from thumper.runtime.drive.legs import AnyLeg
from thumper.runtime.drive_result import DriveProgress, DriveResult


class Display(Protocol):
    """Receives what happens to the legs of a task."""

    def started(self, leg: AnyLeg) -> None:
        """A leg starts."""
        ...

    def progress(self, progress: DriveProgress) -> None:
        """The navigator has run; called once per cycle."""
        ...

    def ended(self, result: DriveResult | None) -> None:
        """The leg has ended; None if it was refused before anything moved."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class NoDisplay:
    """Calls `on_progress`, if there is one, and shows nothing."""

    on_progress: Callable[[DriveProgress], None] = lambda _progress: None

    def started(self, leg: AnyLeg) -> None:
        """Do nothing."""

    def progress(self, progress: DriveProgress) -> None:
        """Pass on the progress."""
        self.on_progress(progress)

    def ended(self, result: DriveResult | None) -> None:
        """Do nothing."""
