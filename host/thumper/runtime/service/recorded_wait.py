"""Records the robot while it waits at a waypoint."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from thumper.runtime.publisher import Publisher


@contextmanager
def recorded_wait(publisher: Publisher, run_command: Callable[[str], str]) -> Iterator[None]:
    """Record during the context; a recording that is under way goes on, and after it too.

    Raises
    ------
    ThumperError
        The robot cannot record.
    """
    if publisher.is_recording:
        yield
        return
    run_command("record_start")
    try:
        yield
    finally:
        run_command("record_stop")
