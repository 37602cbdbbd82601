"""A task under way: asks it for its legs, one after another. Pure."""

from collections.abc import Callable
from dataclasses import replace

from thumper.common.errors import ThumperError
from thumper.runtime.drive.legs import AnyLeg
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_result import DriveResult


class RunningTask:
    """The only place that resumes a task. `leg` is the present leg, None once the task is over."""

    def __init__(self, task: Task) -> None:
        """Take the first leg."""
        self.leg: AnyLeg | None = None
        self.is_over = False
        self._task = task
        self._total: DriveResult | None = None  # of the legs so far
        self._result: DriveResult | None = None
        self._refusal: ThumperError | None = None
        self._resume(lambda: next(task))

    def leg_ended(self, result: DriveResult) -> None:
        """Pass on the result of the present leg and take the next leg, if there is one."""
        self._total = result.after(self._total)
        self._resume(lambda: self._task.send(result))

    def leg_refused(self, refusal: ThumperError) -> None:
        """Pass on why the present leg was refused; a task that does not handle it is over."""
        self._resume(lambda: self._task.throw(refusal))

    def end(self, reason: str, *, interrupted: bool = False) -> None:
        """End the task between two legs, with the result of those that were driven."""
        self._task.close()
        self.leg, self.is_over = None, True
        if self._total is None:
            self._refusal = ThumperError(reason)
        else:
            self._result = replace(self._total, reached=False, interrupted=interrupted, reason=reason)

    @property
    def has_result(self) -> bool:
        """Whether at least one leg was driven and the task is over."""
        return self._result is not None

    def result(self) -> DriveResult:
        """Return the result of a task that is over; raise the ThumperError that refused it."""
        if self._refusal is not None:
            raise self._refusal
        assert self._result is not None
        return self._result

    def mark_interrupted(self) -> None:
        """Note that Ctrl-C came while the last leg stopped; what was reached stays reached."""
        if self._result is not None:
            self._result = replace(self._result, interrupted=True)

    def _resume(self, resume: Callable[[], AnyLeg]) -> None:
        self.leg = None  # until the task has decided; Ctrl-C may come meanwhile
        try:
            self.leg = resume()
        except StopIteration as end:
            self._result, self.is_over = end.value, True
        except ThumperError as refusal:
            self._refusal, self.is_over = refusal, True
        except Exception as error:  # the map of the legs so far is worth more than a traceback
            self.end(f"internal error: {type(error).__name__}: {error}")
