"""Serial ports by URL: `/dev/ttyUSB0`, `socket://host:port`, or a protocol that a plug-in registers."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import serial

from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE, ThumperError

# What pyserial lets through when a port fails: SerialException is an OSError, termios.error is none.
_FAILURES: tuple[type[Exception], ...] = (OSError,)
with suppress(ModuleNotFoundError):  # Windows
    import termios

    _FAILURES = (OSError, termios.error)
_OPEN_FAILURES: tuple[type[Exception], ...] = (ValueError, *_FAILURES)


_before_wait: Callable[[], None] | None = None


@contextmanager
def called_before_waits(call: Callable[[], None]) -> Iterator[None]:
    """Call `call` before each wait for bytes of any port, so that opening one device starves no other.

    It may raise to end the wait. For one thread.
    """
    global _before_wait  # noqa: PLW0603 - a driver that starts does not know the other devices
    _before_wait = call
    try:
        yield
    finally:
        _before_wait = None


@runtime_checkable
class HasClock(Protocol):
    """A simulated port: it brings the clock of its own world, whose time only passes while somebody reads."""

    def clock_s(self) -> float:
        """Return the simulated time [s]."""
        ...


@runtime_checkable
class ChecksUrl(Protocol):
    """A port that knows whether its URL is right before it is opened."""

    def check_url(self) -> None:
        """Raise SerialException if the URL is wrong."""
        ...


class PortError(ThumperError):
    """A port failed while it was open, or was used after it was closed."""


class SerialPort(Closable):
    """A serial port on which every failure is a `PortError`. `close` never raises."""

    def __init__(self, port: serial.Serial, *, url: str = "", device: str = "device") -> None:
        """Wrap an open port; `url` and `device` (such as "board") appear in error messages."""
        self.raw = port
        self.url = url or str(port.port)
        self.device = device
        self._is_closed = False
        self._clock_s: Callable[[], float] = port.clock_s if isinstance(port, HasClock) else time.monotonic

    @property
    def baud(self) -> int:
        """Line rate [baud]."""
        return int(self.raw.baudrate)

    @property
    def has_simulated_clock(self) -> bool:
        """Whether the port leads into a simulation, whose time only passes while somebody reads."""
        return isinstance(self.raw, HasClock)

    @property
    def is_simulated(self) -> bool:
        """Whether the device is simulated: in this process, or behind a pseudo-terminal."""
        return self.has_simulated_clock or os.path.realpath(self.raw.port or "").startswith("/dev/pts/")

    def now_s(self) -> float:
        """Return the time [s] on the clock of the world that the port lives in."""
        return self._clock_s()

    def read_available(self, timeout_s: float | None = None) -> bytes:
        """Return the bytes that have arrived; with a timeout [s], wait that long for the first byte."""
        if timeout_s is not None and _before_wait is not None:
            _before_wait()
        with self._failures_explained():
            if timeout_s is None:
                return self.raw.read(self.raw.in_waiting)
            self.raw.timeout = max(timeout_s, 0.0)
            return self.raw.read(max(1, self.raw.in_waiting))

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        with self._failures_explained():
            self.raw.write(data)

    def set_baud(self, baud: int) -> None:
        """Change the line rate."""
        with self._failures_explained():
            self.raw.baudrate = baud

    def set_dtr(self, level: bool) -> None:
        """Set the line DTR, where the port has one; a port that has gone fails at the next use."""
        with suppress(*_FAILURES):
            self.raw.dtr = level

    def discard_output(self) -> None:
        """Drop the bytes that were written but not sent yet."""
        with self._failures_explained():
            self.raw.reset_output_buffer()

    def close(self) -> None:
        """Close the port, even if the device is gone."""
        self._is_closed = True
        with suppress(*_FAILURES):
            self.raw.close()

    @contextmanager
    def _failures_explained(self) -> Iterator[None]:
        try:
            if self._is_closed:  # pyserial would raise a TypeError
                raise serial.PortNotOpenError
            yield
        except _OPEN_FAILURES as error:  # ValueError: with 1024 open files, pyserial cannot wait for a port
            raise PortError(
                f"the {self.device}'s port {self.url} failed ({error}); is the cable loose?",
                exit_code=EXIT_NOT_THERE,
            ) from error


def open_port(url: str, *, baud: int, name: str) -> SerialPort:
    """Open `url`; `name` is the device expected there ("board", "lidar"), for error messages.

    Raises
    ------
    ThumperError
        The port does not exist, is busy, or access is denied; the message says how to fix it.
    """
    _register_plugins()
    options: dict[str, Any] = {"baudrate": baud, "timeout": 0.02, "write_timeout": 0.1}
    if "://" not in url:
        options["exclusive"] = True  # two programs that drive one motor board are dangerous
    try:
        return SerialPort(serial.serial_for_url(url, **options), url=url, device=name)
    except _OPEN_FAILURES as error:
        raise _open_error(url, name, error) from error


def check_port(url: str, name: str) -> None:
    """Refuse a device that is not there or a wrong URL, before anything that takes long.

    Raises
    ------
    ThumperError
        There is no such port.
    """
    if "://" not in url:
        if Path(url).is_file() or Path(url).is_dir():
            raise ThumperError(
                f"{url}: a file or folder, not the {name} port; `thumper doctor` lists the ports",
                exit_code=EXIT_USAGE,
            )
        if Path(url).exists():
            return
        if url.startswith("sim"):
            raise ThumperError(f"{url}: no such port; did you mean 'sim://'?", exit_code=EXIT_USAGE)
        raise _open_error(url, name, FileNotFoundError())
    _register_plugins()
    try:
        port = serial.serial_for_url(url, do_not_open=True)
        if isinstance(port, ChecksUrl):
            port.check_url()
    except _OPEN_FAILURES as error:
        raise _open_error(url, name, error) from error


def no_such_port(url: str, name: str) -> ThumperError:
    """Return the error for a device that is not there."""
    where = "`ls /dev/video*` lists the cameras" if name == "camera" else "`thumper doctor` lists the ports"
    return ThumperError(
        f"cannot open the {name} port {url}: there is no such port; is it plugged in? {where}",
        exit_code=EXIT_NOT_THERE,
    )


@cache  # it reads the metadata of all installed packages
def _register_plugins() -> None:
    for plugin in entry_points(group="thumper.serial_protocols"):
        if plugin.value not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append(plugin.value)


def _open_error(url: str, name: str, error: Exception) -> ThumperError:
    if isinstance(error, FileNotFoundError) or "No such file" in str(error):
        simulated = ", and sim:// simulates a robot" if name == "board" else ""
        return ThumperError(f"{no_such_port(url, name)}{simulated}", exit_code=EXIT_NOT_THERE)
    if isinstance(error.__cause__, ThumperError):  # of a simulated port; nobody typed its whole URL
        return ThumperError(f"cannot simulate the {name}: {error.__cause__}", exit_code=_exit_code(error))
    return ThumperError(f"cannot open the {name} port {url}: {_explain(error)}", exit_code=_exit_code(error))


def _exit_code(error: Exception) -> int:
    """Return 2 for an invalid URL, else 3; the error of a simulated port carries its own."""
    if isinstance(error.__cause__, ThumperError):
        return error.__cause__.exit_code
    return EXIT_USAGE if "unknown protocol" in str(error) or "invalid URL" in str(error) else EXIT_NOT_THERE


def _explain(error: Exception) -> str:
    """Return the cause of a failed open and how to fix it."""
    text = str(error)
    if isinstance(error, PermissionError) or "Permission denied" in text:
        return (
            "permission denied; add yourself to its group: sudo usermod -aG dialout $USER, then log in again"
        )
    if "exclusively lock" in text or "busy" in text:
        return "another program has it open; close that program first"
    if any(words in text for words in ("Inappropriate ioctl", "not a tty", "Is a directory")):
        return "it is not a serial port; `thumper doctor` lists the ports"
    if "unknown protocol" in text or "invalid URL" in text:
        return "no such kind of port; use a device such as /dev/ttyUSB0 or a URL such as sim://robot/board"
    return " ".join(text.split())
