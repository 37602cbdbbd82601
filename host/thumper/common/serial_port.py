"""Open a serial port by URL: `/dev/ttyUSB0`, `socket://host:port`, or a protocol that a plug-in registers."""

import os
import time
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

import serial

from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE, ThumperError


def open_port(url: str, *, baud: int, name: str) -> serial.Serial:
    """Open `url`; `name` says in errors what should be on it ("board", "lidar").

    Raises
    ------
    ThumperError
        The port is missing, not permitted or busy; the message names the cure.
    """
    _register_plugins()
    options: dict[str, Any] = {"baudrate": baud, "timeout": 0.02, "write_timeout": 0.1}
    if "://" not in url:
        options["exclusive"] = True  # two programs on one motor board would be dangerous
    try:
        return serial.serial_for_url(url, **options)
    except (serial.SerialException, ValueError, OSError) as error:
        raise ThumperError(
            f"cannot open the {name} port {url}: {_cause_and_cure(error, name)}", exit_code=_exit_code(error)
        ) from error


def port_clock(port: serial.Serial) -> Callable[[], float]:
    """Return the clock [s] of the world that the port lives in: a simulated port brings its own."""
    clock: Callable[[], float] = getattr(port, "clock_s", time.monotonic)
    return clock


def has_simulated_clock(port: serial.Serial) -> bool:
    """Whether the port leads into a simulated world, whose time passes only while somebody reads."""
    return hasattr(port, "clock_s")


def is_simulated(port: serial.Serial) -> bool:
    """Whether what is behind the port is simulated: in this process, or at the other end of a terminal."""
    return has_simulated_clock(port) or os.path.realpath(port.port or "").startswith("/dev/pts/")


def _register_plugins() -> None:
    for plugin in entry_points(group="thumper.serial_protocols"):
        if plugin.value not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append(plugin.value)


def _exit_code(error: Exception) -> int:
    """2 for a URL that no port can have, else 3; a simulated port knows itself what is wrong."""
    if isinstance(error.__cause__, ThumperError):
        return error.__cause__.exit_code
    return EXIT_USAGE if "unknown protocol" in str(error) or "invalid URL" in str(error) else EXIT_NOT_THERE


def _cause_and_cure(error: Exception, name: str) -> str:
    text = str(error)
    if isinstance(error, FileNotFoundError) or "No such file" in text:
        return (
            "there is no such port; is it plugged in? `ls /dev/ttyUSB* /dev/ttyACM*` shows what is there, "
            f"and sim://robot/{name} is a simulated one"
        )
    if isinstance(error, PermissionError) or "Permission denied" in text:
        return "not permitted; add yourself to its group: sudo usermod -aG dialout $USER, then log in again"
    if "exclusively lock" in text or "busy" in text:
        return "another program has it open; close that program first"
    if any(words in text for words in ("Inappropriate ioctl", "not a tty", "Is a directory")):
        return "it is no serial port; `ls /dev/ttyUSB* /dev/ttyACM*` shows which there are"
    if "unknown protocol" in text or "invalid URL" in text:
        return "no such kind of port; give a device such as /dev/ttyUSB0 or a URL such as sim://robot/board"
    return " ".join(text.split())
