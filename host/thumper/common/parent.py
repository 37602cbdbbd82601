"""Ends a process when the one that started it ends in whatever way.

The child's standard input is a pipe whose writing end the parent holds open and never writes to.
"""

import os
import signal
import sys
import threading
import time

VARIABLE = "THUMPER_END_WITH_PARENT_S"


def parent_environment(end_timeout_s: float) -> dict[str, str]:
    """Return the variable of a child that calls `end_with_parent`; it has `end_timeout_s` to end."""
    return {VARIABLE: f"{end_timeout_s:g}"}


def end_with_parent() -> None:
    """End this process with its parent, if that has set the variable of `parent_environment`."""
    end_timeout_s = os.environ.pop(VARIABLE, "")  # the children of this process do not inherit it
    if not end_timeout_s:
        return

    def wait() -> None:
        while os.read(sys.stdin.fileno(), 4096):
            pass
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for output in (1, 2):  # perhaps pipes to the parent: the next line would raise
            os.dup2(nowhere, output)
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(float(end_timeout_s))
        os._exit(1)

    threading.Thread(target=wait, name="parent", daemon=True).start()
