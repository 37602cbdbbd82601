"""pyserial's handler for `sim://NAME/board` and its sensors: ports to a simulated robot.

Simulated time passes only during a blocking `read`; `clock_s` returns it. Otherwise the ports behave like
real ones: a read returns the received bytes when its timeout has passed, and a write returns at once.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, urlsplit

from serial.serialutil import PortNotOpenError, SerialBase, SerialException

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_hil.bench.bench import Bench, load_world_for
from thumper_hil.bench.options import BenchOptions
from thumper_hil.bench.page_controls import PageControls
from thumper_hil.bench.registry import close_device, open_device
from thumper_hil.faults.switches import DEVICES

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class Serial(SerialBase):
    """The host's end of a simulated serial line, created by `serial.serial_for_url`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Set up a closed port; takes the arguments of `serial.Serial`."""
        self._bench: Bench | None = None
        self._name = self._device = ""
        self._dtr_was = False
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Open the simulated device.

        Raises
        ------
        SerialException
            The URL is invalid, the firmware is not built, or the device is already open.
        """
        if self.is_open:
            raise SerialException("the port is already open")
        try:
            self._name, self._device, options = _parse(self.portstr or "")
            self._bench = open_device(self._name, self._device, options)
        except ThumperError as error:
            raise SerialException(str(error)) from error
        self.is_open = True
        self._reconfigure_port()
        self._dtr_was = False
        self._update_dtr_state()

    def check_url(self) -> None:
        """Raise SerialException, as `open` would, if the URL, an option, the world or the start is wrong."""
        try:
            load_world_for(BenchOptions.parse(_parse(self.portstr or "")[2]))
        except ThumperError as error:
            raise SerialException(str(error)) from error

    def close(self) -> None:
        """Close the device. Simulated time stops unless another port advances it."""
        if self.is_open:
            self.is_open = False
            close_device(self._name, self._device)

    def clock_s(self) -> float:
        """Return the simulated time [s], also after `close`."""
        if self._bench is None:
            raise PortNotOpenError
        if self.is_open:
            with self._host_call(self._bench):
                pass
        return self._bench.time_s

    @property
    def simulator(self) -> PageControls:
        """The simulator's commands: faults and pillars."""
        return PageControls(self._world())

    @property
    def in_waiting(self) -> int:
        """Number of bytes that `read` would return at once."""
        with self._host_call(self._world()) as bench:
            return self._waiting(bench)

    def read(self, size: int = 1, /) -> bytes:
        """Return `size` bytes, or those received until the timeout [simulated s]; None waits forever."""
        with self._host_call(self._world(), reads=True) as bench:
            until_s = math.inf if self.timeout is None else bench.time_s + max(self.timeout, 0.0)
            started_s = bench.time_s
            while self._waiting(bench) < size and bench.time_s < until_s:
                self._world()  # raises if the device has gone meanwhile
                # At most one second per step, so that Ctrl-C can interrupt an endless wait.
                step_s = min(until_s, bench.time_s + 1.0)
                if self._device == "board":
                    bench.advance(step_s, board_bytes=size)
                else:
                    bench.advance_for_sensor(self._device, step_s, size)
            if bench.time_s > started_s:
                bench.advance(bench.time_s + bench.host.wake_up_s())
            if self._device == "board":
                return bench.board_read(size)
            return bench.sensor_read(self._device, size)

    def write(self, data: "ReadableBuffer", /) -> int:
        """Queue bytes; no time passes here, they are transmitted at line rate later."""
        sent = bytes(data)
        with self._host_call(self._world()) as bench:
            if self._device == "board":
                bench.board_write(sent)
            else:
                bench.sensor_write(self._device, sent)
        return len(sent)

    def flush(self) -> None:
        """Do nothing: written bytes are already queued."""
        self._world()

    def reset_input_buffer(self) -> None:
        """Discard the received bytes."""
        self._world()
        waiting = self.in_waiting
        if waiting and self._device == "board":
            self._world().chip.receive(waiting)
        elif waiting:
            self._world().sensor_read(self._device, waiting)

    def reset_output_buffer(self) -> None:
        """Do nothing: no bytes wait on the host's side."""
        self._world()

    @property
    def out_waiting(self) -> int:
        """Number of bytes that wait on the host's side: always 0."""
        return 0

    # Of the modem lines only DTR is wired. It runs the motor of some lidars; with `reset_on_open` it pulls
    # the board's reset pin.
    @property
    def cts(self) -> bool:
        """Clear to send."""
        return True

    @property
    def dsr(self) -> bool:
        """Data set ready."""
        return True

    @property
    def ri(self) -> bool:
        """Ring indicator."""
        return False

    @property
    def cd(self) -> bool:
        """Carrier detect."""
        return True

    def _reconfigure_port(self) -> None:
        if self._bench is not None and self.is_open:
            if self._device == "board":
                self._bench.chip.set_host_baud(self.baudrate)
            else:
                self._bench.set_baud(self._device, self.baudrate)

    def _update_break_state(self) -> None: ...

    def _update_rts_state(self) -> None: ...

    def _update_dtr_state(self) -> None:
        if self._bench is not None and self._device == "board" and self.dtr and not self._dtr_was:
            self._bench.assert_dtr()
        if self._bench is not None and self._device != "board":
            self._bench.set_dtr(self._device, self.dtr)
        self._dtr_was = self.dtr

    def _waiting(self, bench: Bench) -> int:
        return bench.chip.available if self._device == "board" else bench.sensor_available(self._device)

    @contextmanager
    def _host_call(self, bench: Bench, *, reads: bool = False) -> Iterator[Bench]:
        """Let the time pass that the host has computed since its last call."""
        try:
            if computed_s := bench.host.entered(reads=reads):
                bench.advance(bench.time_s + computed_s)
            yield bench
        except ThumperError as error:
            raise SerialException(str(error)) from error
        finally:
            bench.host.left()

    def _world(self) -> Bench:
        if self._bench is None or not self.is_open:
            raise PortNotOpenError
        if not self._bench.is_plugged(self._device):
            raise SerialException("the device has gone")  # as a real port does when it is unplugged
        return self._bench


def _parse(url: str) -> tuple[str, str, dict[str, str]]:
    parts = urlsplit(url)
    device = parts.path.strip("/")
    if not parts.netloc or device not in DEVICES:
        raise ThumperError(
            f"{url}: not a simulated device; use sim://NAME/{', sim://NAME/'.join(DEVICES)}",
            exit_code=EXIT_USAGE,
        )
    options: dict[str, str] = {}
    for name, value in parse_qsl(parts.query, keep_blank_values=True):
        if name in options:
            raise ThumperError(f"{url}: option {name} is given twice; delete one", exit_code=EXIT_USAGE)
        options[name] = value
    return parts.netloc, device, options
