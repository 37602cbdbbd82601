"""A failing port raises PortError, whatever pyserial raises for it; closing it never raises."""

import os
import resource
import tty
from collections.abc import Callable, Iterator

import pytest

from tests.host.lidar.test_ld19_protocol import PUBLISHED
from thumper.board.board import Board
from thumper.board.framing import encode_frame
from thumper.board.messages import SCHEMA_HASH, Identity
from thumper.common.errors import EXIT_NOT_THERE
from thumper.common.serial_port import PortError, SerialPort, open_port
from thumper.lidar.ld19 import Ld19Driver
from thumper.lidar.urg04lx import Urg04LxDriver

FD_SETSIZE = 1024


class PseudoTerminal:
    """A port on a pseudo-terminal, whose other end can send bytes and be unplugged."""

    def __init__(self) -> None:
        self._device, terminal = os.openpty()
        tty.setraw(terminal)
        self.port = open_port(os.ttyname(terminal), baud=500_000, name="board")
        os.close(terminal)
        self._is_plugged = True

    def send(self, data: bytes) -> None:
        os.write(self._device, data)

    def unplug(self) -> None:
        if self._is_plugged:
            os.close(self._device)
        self._is_plugged = False


@pytest.fixture
def terminal() -> Iterator[PseudoTerminal]:
    terminal = PseudoTerminal()
    yield terminal
    terminal.port.close()
    terminal.unplug()


USES: dict[str, Callable[[SerialPort], object]] = {
    "poll": lambda port: port.read_available(),
    "wait": lambda port: port.read_available(0.05),
    "write": lambda port: port.write(b"x"),
    "discard": lambda port: port.discard_output(),
}


@pytest.fixture
def full_process() -> Iterator[None]:
    """Let this process have so many open files that pyserial, which calls `select`, cannot wait for more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard < 2 * FD_SETSIZE:
        pytest.skip("the system permits too few open files")
    resource.setrlimit(resource.RLIMIT_NOFILE, (2 * FD_SETSIZE, hard))
    files = [os.open(os.devnull, os.O_RDONLY)]
    while files[-1] < FD_SETSIZE:
        files.append(os.dup(files[0]))
    yield
    for file in files:
        os.close(file)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.usefixtures("full_process")
def test_a_port_in_a_process_with_too_many_open_files_is_a_port_error() -> None:
    terminal = PseudoTerminal()
    with terminal.port, pytest.raises(PortError):
        terminal.port.read_available(0.05)
    terminal.unplug()


@pytest.mark.parametrize("use", USES)
def test_every_use_of_an_unplugged_port_is_a_port_error(terminal: PseudoTerminal, use: str) -> None:
    terminal.unplug()
    with pytest.raises(
        PortError, match=r"the board's port /dev/pts/.* failed .*; is the cable loose"
    ) as caught:
        USES[use](terminal.port)
    assert caught.value.exit_code == EXIT_NOT_THERE
    assert "\n" not in str(caught.value)
    terminal.port.close()


@pytest.mark.parametrize("use", USES)
def test_every_use_of_a_closed_port_is_a_port_error(terminal: PseudoTerminal, use: str) -> None:
    terminal.port.close()
    terminal.port.close()
    with pytest.raises(PortError, match="not open"):
        USES[use](terminal.port)


@pytest.mark.parametrize("driver", [Board, Ld19Driver, Urg04LxDriver])
def test_no_driver_starts_on_an_unplugged_port(
    terminal: PseudoTerminal, driver: Callable[[SerialPort], object]
) -> None:
    terminal.unplug()
    with pytest.raises(PortError, match="is the cable loose"):
        driver(terminal.port)


def test_a_board_unplugged_while_it_runs(terminal: PseudoTerminal) -> None:
    identity = SCHEMA_HASH.to_bytes(4, "little") + bytes((0, 2, 0, 1, 10, 1)) + bytes(19)
    terminal.send(encode_frame(Identity.ID, 0, identity))
    board = Board(terminal.port)
    terminal.unplug()
    with pytest.raises(PortError):
        board.poll(0.05)
    with pytest.raises(PortError):
        board.emergency_stop()
    board.close()


def test_a_lidar_unplugged_while_it_streams_counts_port_errors(terminal: PseudoTerminal) -> None:
    terminal.send(PUBLISHED)
    lidar = Ld19Driver(terminal.port)
    terminal.unplug()
    assert lidar.poll() == []
    assert lidar.counters.port_errors == 1
    lidar.close()
