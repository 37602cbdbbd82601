"""What tests of programs at work have in common: a port of their own, and patience on a busy machine."""

import random
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any


def free_port() -> int:
    """A port of this machine that nobody listens at just now.

    It lies below those that the system gives to connections: none of them takes it before its user does.
    """
    while True:
        port = random.SystemRandom().randint(20_000, 32_000)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def until(holds: Callable[[], Any], timeout_s: float = 120.0) -> Any:
    """Wait until `holds()` is true and return it; the test fails when that never comes about."""
    end_s = time.monotonic() + timeout_s
    while not (value := holds()):
        assert time.monotonic() < end_s, "it did not come about in time"
        time.sleep(0.02)
    return value
