"""Helpers that run programs: a free network port, waiting on a busy machine, and no orphans."""

import random
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

END_WITH_PARENT = ("setpriv", "--pdeathsig", "TERM")
"""Prefix of a command: it ends, as by Ctrl-C, when the program that started it ends in any way.

A test that is killed runs no cleanup. Without this prefix its simulators would run for ever.
"""


def free_port() -> int:
    """Return a network port that is free now.

    It lies below the ephemeral range, so that no outgoing connection takes it first.
    """
    while True:
        port = random.SystemRandom().randint(20_000, 32_000)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def until(condition: Callable[[], Any], timeout_s: float = 120.0) -> Any:
    """Wait until `condition()` is true and return its value; fail the test after `timeout_s`."""
    end_s = time.monotonic() + timeout_s
    while not (value := condition()):
        assert time.monotonic() < end_s, "the condition did not become true in time"
        time.sleep(0.02)
    return value
