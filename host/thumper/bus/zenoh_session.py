"""Zenoh sessions that talk over one TCP address and never look round for others by multicast."""

import json
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import zenoh

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.config.bus import split_address

USER = "thumper"  # the token is what counts
CONNECT_TIMEOUT_S = 2.0
MOST_BATCHES = 16
"""Messages that may wait for one listener, the most that Zenoh takes: a beat of the robot makes about ten,
and on a busy machine Zenoh's thread is late by more. What finds no room within a millisecond is lost."""


def open_listener(address: str, token: str) -> zenoh.Session:
    """Listen at `address` for the robot; with a token, nobody joins without it.

    Raises
    ------
    ThumperError
        The address is taken, or is none of this machine's.
    """
    check_free(address)
    settings: dict[str, Any] = {"mode": "router", "listen/endpoints": [f"tcp/{address}"]}
    with _dictionary(token) as path:
        if path:
            settings["transport/auth/usrpwd/dictionary_file"] = path
        try:
            return zenoh.open(_config(settings, token))
        except zenoh.ZError as error:
            raise ThumperError(f"the bus cannot listen at {address}: {_first_line(error)}") from error


def open_joiner(address: str, token: str) -> zenoh.Session:
    """Join the bus of a robot that runs.

    Raises
    ------
    ThumperError
        Nobody listens there, or the token is not the robot's.
    """
    host, port = split_address(address)
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    try:
        socket.create_connection((host, port), CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise ThumperError(
            f"no robot is running at {address} ({error.strerror or error}); start one with `thumper run`",
            exit_code=EXIT_NOT_THERE,
        ) from error
    settings = {
        "mode": "client",
        "connect/endpoints": [f"tcp/[{host}]:{port}" if ":" in host else f"tcp/{host}:{port}"],
        "connect/timeout_ms": round(1000 * CONNECT_TIMEOUT_S),
    }
    try:
        return zenoh.open(_config(settings, token))
    except zenoh.ZError as error:
        raise ThumperError(
            f"the robot at {address} lets nobody in: it is only just starting or ending (try again), "
            "or wants the token of its configuration ([bus] token)",
            exit_code=EXIT_NOT_THERE,
        ) from error


def _config(settings: dict[str, Any], token: str) -> zenoh.Config:
    config = zenoh.Config()
    settings["scouting/multicast/enabled"] = False
    settings["scouting/gossip/enabled"] = False
    settings["transport/link/tx/queue/size/data"] = MOST_BATCHES
    if token:
        settings["transport/auth/usrpwd/user"] = USER
        settings["transport/auth/usrpwd/password"] = token
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


@contextmanager
def _dictionary(token: str) -> Iterator[str]:
    """The list of users that Zenoh reads when it opens; only its owner may read it, and not for long."""
    if not token:
        yield ""
        return
    handle, path = tempfile.mkstemp(prefix="thumper-")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(f"{USER}:{token}\n")
        yield path
    finally:
        with suppress(OSError):
            Path(path).unlink()


def check_free(address: str) -> None:
    """Raise ThumperError when the address is taken, or none of this machine's: sooner than Zenoh would."""
    host, port = split_address(address)
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        raise ThumperError(
            f"the bus cannot listen at {address}: {error.strerror}; does another robot's process run? "
            "[bus] address in the configuration, or --bus, names another"
        ) from error


def _first_line(error: Exception) -> str:
    return str(error).split(" at /", maxsplit=1)[0].splitlines()[0]
