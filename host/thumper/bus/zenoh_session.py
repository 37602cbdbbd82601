"""Zenoh sessions over one TCP address, without multicast discovery."""

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

USER = "thumper"  # the same for everybody: the token is the secret
CONNECT_TIMEOUT_S = 2.0
MAX_QUEUED_BATCHES = 16
"""Messages that may wait for one client; 16 is Zenoh's maximum. A control cycle makes about ten, and on a
busy machine Zenoh's thread lags by more than a cycle. Zenoh drops what finds no room within 1 ms."""


def open_router(address: str, token: str) -> zenoh.Session:
    """Open the robot's session, which listens at `address`; clients must present the token, if there is one.

    Raises
    ------
    ThumperError
        The address is in use, or does not belong to this machine.
    """
    check_address_free(address)
    settings: dict[str, Any] = {"mode": "router", "listen/endpoints": [f"tcp/{address}"]}
    with _user_file(token) as path:
        if path:
            settings["transport/auth/usrpwd/dictionary_file"] = path
        try:
            return zenoh.open(_config(settings, token))
        except zenoh.ZError as error:
            raise ThumperError(f"the bus cannot listen at {address}: {_first_line(error)}") from error


def open_client(address: str, token: str) -> zenoh.Session:
    """Open a client's session on the bus of a running robot.

    Raises
    ------
    ThumperError
        Nothing listens at the address, or the token is wrong.
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
        "connect/retry": {"period_init_ms": 500, "period_max_ms": 1000, "period_increase_factor": 2},
    }
    try:
        return zenoh.open(_config(settings, token))
    except zenoh.ZError as error:
        raise ThumperError(
            f"the robot at {address} refuses the connection: it is starting or stopping (try again), "
            "or it requires the token of its configuration ([bus] token)",
            exit_code=EXIT_NOT_THERE,
        ) from error


def _config(settings: dict[str, Any], token: str) -> zenoh.Config:
    config = zenoh.Config()
    settings["scouting/multicast/enabled"] = False
    settings["scouting/gossip/enabled"] = False
    settings["transport/link/tx/queue/size/data"] = MAX_QUEUED_BATCHES
    if token:
        settings["transport/auth/usrpwd/user"] = USER
        settings["transport/auth/usrpwd/password"] = token
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


@contextmanager
def _user_file(token: str) -> Iterator[str]:
    """Yield the path of Zenoh's user file, empty without a token.

    Zenoh reads it while it opens; only the owner can read it, and it is deleted afterwards.
    """
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


def check_address_free(address: str) -> None:
    """Raise ThumperError if the address is in use or not of this machine; faster than Zenoh would."""
    host, port = split_address(address)
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        raise ThumperError(
            f"the bus cannot listen at {address}: {error.strerror}; is another robot process running? "
            "Choose another address with [bus] address in the configuration, or with --bus"
        ) from error


def _first_line(error: Exception) -> str:
    return str(error).split(" at /", maxsplit=1)[0].splitlines()[0]
