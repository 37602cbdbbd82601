"""Serve the simulated robot on two pseudo-terminals in real time, for programs that expect hardware."""

import errno
import os
import select
import termios
import time
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.pty_board import BAUD_BY_SPEED

STEP_S = 0.002
"""Period of the byte transfer, similar to that of a USB adapter."""

BOOT_S = 0.05
"""The firmware gets this long to start before the ports appear."""

LONGEST_STEP_S = 0.1
"""A board that runs for longer without bytes from its host would stop its motors."""

CHUNK_BYTES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    """Both ends of a pseudo-terminal, and the device behind it."""

    master: int
    slave: int
    to_device: Callable[[bytes], None]
    from_device: Callable[[], bytes]


def serve(board_pty: Path, lidar_pty: Path, options: Mapping[str, str]) -> None:
    """Serve a simulated robot until Ctrl-C; `options` are those of a `sim://` URL.

    Symbolic links to the two terminals exist at the paths while it runs. Clients can connect and disconnect;
    the robot keeps running, and bytes without a reader are lost, as on a wire. With the option
    `reset_on_open`, opening the board's port restarts the board through its boot loader.

    Raises
    ------
    ThumperError
        A path exists or cannot be created, an option is invalid, or the firmware crashed.
    """
    parsed = BenchOptions.parse(options)
    bench = Bench(parsed)
    bench.advance(BOOT_S)
    with ExitStack() as stack:
        board_ends = stack.enter_context(_terminal(board_pty, keep_open=not parsed.reset_on_open))
        lidar_ends = stack.enter_context(_terminal(lidar_pty))
        lines = (
            _Line(
                master=board_ends[0],
                slave=board_ends[1],
                to_device=bench.board_write,
                from_device=lambda: bench.board_read(CHUNK_BYTES),
            ),
            _Line(
                master=lidar_ends[0],
                slave=lidar_ends[1],
                to_device=lambda data: bench.sensor_write("lidar", data),
                from_device=lambda: bench.sensor_read("lidar", CHUNK_BYTES),
            ),
        )
        print(
            f"board {board_pty}, lidar {lidar_pty}, preset {parsed.preset}. Press Ctrl-C to stop.", flush=True
        )
        try:
            _transfer(bench, lines, reset_on_open=parsed.reset_on_open)
        except KeyboardInterrupt:
            print("stopped")


class PacedClock:
    """Maps real time to simulated time. After a delay the simulation does not catch up."""

    def __init__(self, wall_s: float, simulated_s: float) -> None:
        self._wall_from_simulated_s = wall_s - simulated_s

    def due_s(self, wall_s: float, simulated_s: float) -> float:
        """Return the simulated time to advance to: at most `LONGEST_STEP_S` after `simulated_s`."""
        late_s = wall_s - self._wall_from_simulated_s - simulated_s
        self._wall_from_simulated_s += max(late_s - LONGEST_STEP_S, 0.0)
        return wall_s - self._wall_from_simulated_s


def _transfer(bench: Bench, lines: tuple[_Line, ...], *, reset_on_open: bool) -> None:
    """Run the simulation in real time and transfer bytes in both directions, forever."""
    clock = PacedClock(time.monotonic(), bench.time_s)
    was_open = True
    while True:
        if reset_on_open:
            is_open = not _hung_up(lines[0].master)
            if is_open and not was_open:
                bench.assert_dtr()
            was_open = is_open
        bench.advance(clock.due_s(time.monotonic(), bench.time_s))
        for line in lines:
            if data := line.from_device():
                _write(line, data)
        readable, _, _ = select.select([line.master for line in lines], [], [], STEP_S)
        # Now, not before the wait: a client sets its rate and sends at once.
        bench.chip.set_host_baud(_baud(lines[0].slave))
        bench.set_baud("lidar", _baud(lines[1].slave))
        if not was_open:
            time.sleep(STEP_S)  # a terminal without a client is always "readable"
        for line in lines:
            if line.master in readable and (data := _read(line.master)):
                line.to_device(data)


@contextmanager
def _terminal(path: Path, *, keep_open: bool = True) -> Iterator[tuple[int, int]]:
    """Create a pseudo-terminal with a link at `path`; yield its master and the end that has its settings.

    With `keep_open` it keeps its settings and never hangs up. Otherwise the master sees clients open and
    close it.
    """
    if path.is_symlink() and not path.exists():
        path.unlink()  # left over from a killed run, whose terminal no longer exists
    elif path.is_symlink() or path.exists():
        raise ThumperError(
            f"{path} exists; stop the program that uses it, delete it, or choose another path",
            exit_code=EXIT_USAGE,
        )
    master, slave = os.openpty()
    try:
        # Raw on both ends before a client opens it: no echo, no translation, no line buffer.
        for end in (master, slave):
            tty.setraw(end, termios.TCSANOW)
        os.set_blocking(master, False)
        try:
            path.symlink_to(os.ttyname(slave))
        except OSError as error:
            raise ThumperError(
                f"{path}: cannot create the link ({error.strerror}); choose another path",
                exit_code=EXIT_USAGE,
            ) from error
        if not keep_open:
            os.close(slave)
            slave = master
        try:
            yield master, slave
        finally:
            path.unlink(missing_ok=True)
    finally:
        for end in {master, slave}:
            os.close(end)


def _hung_up(master: int) -> bool:
    poll = select.poll()
    poll.register(master, select.POLLIN)
    return any(events & select.POLLHUP for _, events in poll.poll(0))


def _baud(slave: int) -> int:
    """Return the client's baud rate, which a pseudo-terminal ignores but a wire does not."""
    return BAUD_BY_SPEED.get(termios.tcgetattr(slave)[4], 0)


def _read(master: int) -> bytes:
    try:
        return os.read(master, CHUNK_BYTES)
    except OSError as error:
        if error.errno in (errno.EIO, errno.EAGAIN):
            return b""
        raise


def _write(line: _Line, data: bytes) -> None:
    try:
        os.write(line.master, data)
    except BlockingIOError:  # no client reads and the buffer is full: discard the old bytes
        termios.tcflush(line.slave, termios.TCIFLUSH)
