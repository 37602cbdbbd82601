"""Zenoh sessions over one TCP or TLS address, without multicast discovery."""

import json
import os
import socket
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import zenoh

from thumper.bus.keys import BusKeys, keys_for
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.config.bus import BusOptions, split_address
from thumper.ros.topics import TOPICS, Direction

USER = "thumper"  # the same for everybody: the token is the secret
CONNECT_TIMEOUT_S = 2.0
MAX_QUEUED_BATCHES = 16
"""Messages that may wait for one client; 16 is Zenoh's maximum. A control cycle makes about ten, and on a
busy machine Zenoh's thread lags by more than a cycle. Zenoh drops what finds no room within 1 ms."""


OUTGOING = (
    *("put", "delete", "query", "reply", "declare_subscriber", "declare_queryable"),
    *("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
)
MAX_REQUEST_BYTES = 256 * 1024  # that the robot reads; the largest valid one has 64 KiB
MAX_CLIENTS = 100
MAX_SILENT, SILENT_S = 400, 3.0
"""Connections that may wait for their first message, and for how long: silent ones must not keep clients out
for long. Together with `MAX_CLIENTS` fewer than the 1024 files of a process."""
MAX_REPLY_BYTES = 64 * 1024 * 1024  # that a client reads: maps, reports

_lock = threading.Lock()
_sessions: list[zenoh.Session] = []  # closed ones are dropped when the next one opens


def open_router(robot: str, options: BusOptions) -> zenoh.Session:
    """Open the robot's session, which listens at the address of `options`.

    Clients must present the token, if there is one, and the clients' certificate, if the bus is encrypted.
    They may send requests and receive. Only the robot publishes its topics and answers queries.

    Raises
    ------
    ThumperError
        The address is in use or does not belong to this machine, or keys are missing.
    """
    address, keys = options.address, keys_for("robot", options.address, options.tls)
    check_address_free(address)
    settings: dict[str, Any] = {
        "mode": "router",
        "listen/endpoints": [_endpoint(address, keys)],
        "transport/link/rx/max_message_size": MAX_REQUEST_BYTES,
        "transport/unicast/max_sessions": MAX_CLIENTS,
        "transport/unicast/accept_pending": MAX_SILENT,
        "transport/unicast/accept_timeout": round(1000 * SILENT_S),
        "access_control": access_rules(robot),
    }
    if keys:
        settings |= {
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/root_ca_certificate": str(keys.authority),
            "transport/link/tls/listen_certificate": str(keys.certificate),
            "transport/link/tls/listen_private_key": str(keys.key),
        }
    with _user_file(options.token) as path:
        if path:
            settings["transport/auth/usrpwd/dictionary_file"] = path
        try:
            return _open_session(_config(settings, options.token))
        except zenoh.ZError as error:
            raise ThumperError(
                f"the bus cannot listen at {address}: {_first_line(error)}", exit_code=EXIT_NOT_THERE
            ) from error


def open_client(address: str, token: str, tls: str = "") -> zenoh.Session:
    """Open a client's session on the bus of a running robot; `tls` is as in `[bus]`.

    Raises
    ------
    ThumperError
        Nothing listens at the address, the token or a key is wrong, or keys are missing.
    """
    try:
        # The authority signs this robot's certificate only, so the name adds nothing; addresses change.
        settings = _client_settings(address, keys_for("client", address, tls), verify_name=False)
        return _open_session(_config(settings, token))
    except OSError as error:
        raise ThumperError(
            f"no robot is running at {address} ({error.strerror or error}); start one with `thumper run`. "
            "Without a robot, `thumper run --board sim://` simulates one",
            exit_code=EXIT_NOT_THERE,
        ) from error
    except zenoh.ZError as error:
        raise ThumperError(
            f"the robot at {address} refuses the connection: it is starting or stopping (try again), "
            "or it requires the token of its configuration ([bus] token) or its keys ([bus] tls)",
            exit_code=EXIT_NOT_THERE,
        ) from error


def open_ros_client(router: str, token: str, tls: str = "") -> zenoh.Session:
    """Open a session on the Zenoh router of a ROS 2 network; `tls` is as in `[ros]`.

    Raises
    ------
    ThumperError
        Nothing listens at the address, the token or a key is wrong, or keys are missing.
    """
    try:
        settings = _client_settings(router, keys_for("client", router, tls), verify_name=True)
        settings["timestamping/enabled"] = True  # the cache of latched topics needs it
        settings["transport/link/rx/max_message_size"] = MAX_REQUEST_BYTES
        return _open_session(_config(settings, token))
    except OSError as error:
        raise ThumperError(
            f"no ROS 2 router at {router} ({error.strerror or error}); start it with "
            "`ros2 run rmw_zenoh_cpp rmw_zenohd`, or choose another with --router",
            exit_code=EXIT_NOT_THERE,
        ) from error
    except zenoh.ZError as error:
        raise ThumperError(
            f"the ROS 2 router at {router} refuses the connection: it is not a Zenoh router, or it requires "
            "a password ([ros] token) or keys ([ros] tls)",
            exit_code=EXIT_NOT_THERE,
        ) from error


def _open_session(config: zenoh.Config) -> zenoh.Session:
    """Open a session that is closed when the main thread ends, if nobody has closed it before.

    Without this a program that fails never ends: Python waits for Zenoh's threads before it closes anything.
    """
    session = zenoh.open(config)
    with _lock:
        if not _sessions:
            threading.Thread(target=_close_at_exit, name="bus-exit").start()  # Python waits for it
        _sessions[:] = [*(other for other in _sessions if not other.is_closed()), session]
    return session


def _close_at_exit() -> None:
    threading.main_thread().join()
    with _lock:
        for session in _sessions:
            with suppress(zenoh.ZError):  # the others must be closed, too
                session.close()  # type: ignore[no-untyped-call]


def _client_settings(address: str, keys: BusKeys | None, *, verify_name: bool) -> dict[str, Any]:
    """Return the settings of a client's session; raises OSError if nothing listens at the address."""
    host, port = split_address(address)
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    socket.create_connection((host, port), CONNECT_TIMEOUT_S).close()
    settings: dict[str, Any] = {
        "mode": "client",
        "connect/endpoints": [_endpoint(f"[{host}]:{port}" if ":" in host else f"{host}:{port}", keys)],
        "connect/timeout_ms": round(1000 * CONNECT_TIMEOUT_S),
        "connect/retry": {"period_init_ms": 500, "period_max_ms": 1000, "period_increase_factor": 2},
        "transport/link/rx/max_message_size": MAX_REPLY_BYTES,
    }
    if keys:
        settings |= {
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/verify_name_on_connect": verify_name,
            "transport/link/tls/root_ca_certificate": str(keys.authority),
            "transport/link/tls/connect_certificate": str(keys.certificate),
            "transport/link/tls/connect_private_key": str(keys.key),
        }
    return settings


def access_rules(robot: str) -> dict[str, Any]:
    """Return Zenoh's access rules: what is not listed, the robot neither accepts nor passes on."""
    prefix = f"thumper/{robot}/"
    requests = [prefix + name for name, topic in TOPICS.items() if topic.direction is Direction.IN]
    latched = [prefix + name for name, topic in TOPICS.items() if topic.latched]
    rules = {
        "requests": ("ingress", ["put"], requests),
        "queries": ("ingress", ["query"], [f"{prefix}ask/**", *latched]),
        "subscriptions": (
            "ingress",
            ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"],
            [f"{prefix}**"],
        ),
        "robot": ("egress", OUTGOING, ["**"]),
    }
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}
            for name, (flow, messages, keys) in rules.items()
        ],
        "subjects": [{"id": "client"}],  # every client
        "policies": [{"rules": list(rules), "subjects": ["client"]}],
    }


def _endpoint(address: str, keys: BusKeys | None) -> str:
    return f"{'tls' if keys else 'tcp'}/{address}"


def _config(settings: dict[str, Any], token: str) -> zenoh.Config:
    config = zenoh.Config()
    settings["scouting/multicast/enabled"] = False
    settings["scouting/gossip/enabled"] = False
    settings["scouting/delay"] = 0  # else a router waits 0.5 s for others
    settings["transport/shared_memory/enabled"] = False  # it would bypass the limit of the message size
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
            "Choose another address with [bus] address in the configuration, or with --bus",
            exit_code=EXIT_NOT_THERE,
        ) from error


def _first_line(error: Exception) -> str:
    return str(error).split(" at /", maxsplit=1)[0].splitlines()[0]
