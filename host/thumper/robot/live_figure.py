"""Keeps a picture in a notebook current while the robot drives."""

import threading
import time
from collections.abc import Callable

from IPython.core.getipython import get_ipython
from IPython.display import DisplayHandle, Image, display

from thumper.robot.figure import RobotFigure

Draw = Callable[[], RobotFigure]
PERIOD_S = 1.0


class LiveFigure:
    """Draws in a thread of its own: a drawing takes 0.2 s, and the board stops the motors after 0.3 s."""

    def __init__(self, snapshot: Callable[[], Draw]) -> None:
        """Show the first picture. `snapshot` takes what there is now, and returns what draws it later."""
        self._snapshot = snapshot
        self._handle = DisplayHandle()
        self._thread: threading.Thread | None = None
        self._next_s = 0.0
        display(_png(snapshot()), display_id=self._handle.display_id)

    def refresh(self) -> None:
        """Start a drawing if the last one is done and a second old. Call it after each control cycle."""
        now_s = time.monotonic()
        if now_s < self._next_s or (self._thread is not None and self._thread.is_alive()):
            return
        self._next_s = now_s + PERIOD_S
        self._thread = threading.Thread(target=self._draw, args=(self._snapshot(),), daemon=True)
        self._thread.start()

    def finish(self) -> None:
        """Draw the present state; return when it is shown."""
        if self._thread is not None:
            self._thread.join()
        self._draw(self._snapshot())

    def _draw(self, draw: Draw) -> None:
        self._handle.update(_png(draw))


def in_notebook() -> bool:
    """Return whether this process is a notebook's kernel, which can show pictures."""
    return hasattr(get_ipython(), "kernel")


def _png(draw: Draw) -> Image:
    return Image(data=draw().png())
