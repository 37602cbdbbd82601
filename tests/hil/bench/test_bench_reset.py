"""A board whose DTR line pulls its reset pin: opening its port restarts it through its boot loader."""

from collections.abc import Iterator

import pytest

from thumper.board.board import Board
from thumper.board.framing import FrameDecoder
from thumper.board.messages import Command, ResetCause, State, Telemetry
from thumper.common.errors import ThumperError
from thumper.common.serial_port import open_port
from thumper_hil.bench import simulation
from thumper_hil.bench.protocol_sim import Serial

NAME = "reset-test"
BAUD = 500_000


@pytest.fixture
def lidar_port() -> Iterator[Serial]:
    """Open the robot's other port, which keeps the simulation alive."""
    port = open_port(f"sim://{NAME}/lidar?reset_on_open=1", baud=BAUD, name="lidar").raw
    assert isinstance(port, Serial)
    yield port
    port.close()


def first_telemetry_s(url: str) -> float:
    """Return the time from opening the port to the first telemetry, without sending anything [s]."""
    port = open_port(url, baud=BAUD, name="board").raw
    assert isinstance(port, Serial)
    port.timeout = 0.01
    start_s, decoder = port.clock_s(), FrameDecoder()
    while port.clock_s() < start_s + 4.0:
        if any(frame.message_id == Telemetry.ID for frame in decoder.feed(port.read(200))):
            break
    took_s = port.clock_s() - start_s
    port.close()
    return took_s


def test_opening_the_port_runs_the_boot_loader(lidar_port: Serial) -> None:
    """The boot loader waits over a second for a new program before it starts the installed one."""
    resets = simulation(NAME).chip.resets
    for opened in (1, 2):
        assert 1.0 < first_telemetry_s(f"sim://{NAME}/board") < 3.0
        assert simulation(NAME).chip.resets == resets + opened


def test_opening_does_not_reset_without_the_option() -> None:
    assert first_telemetry_s("sim://reset-test-plain/board") < 0.3


def test_reconnected_board_is_disarmed_after_its_reset(lidar_port: Serial) -> None:
    """The restarted board is disarmed, so that it cannot drive on by itself."""
    board = Board.open(f"sim://{NAME}/board", baud=BAUD)
    board.command(Command.ARM)
    board.port.close()  # as if the program had crashed
    board = Board.open(f"sim://{NAME}/board", baud=BAUD)
    try:
        assert board.identity.reset_cause is ResetCause.EXTERNAL
        assert board.poll(0.5)[-1].telemetry.state is State.DISARMED
    finally:
        board.close()


def test_only_a_rising_dtr_resets_the_board(lidar_port: Serial) -> None:
    port = open_port(f"sim://{NAME}/board", baud=BAUD, name="board").raw
    chip = simulation(NAME).chip
    resets = chip.resets
    port.dtr = True
    assert chip.resets == resets
    port.dtr = False
    assert chip.resets == resets
    port.dtr = True
    assert chip.resets == resets + 1
    port.close()


def test_invalid_option_value_is_reported() -> None:
    with pytest.raises(ThumperError, match="reset_on_open=maybe: give 0 or 1"):
        open_port("sim://reset-test-wrong/board?reset_on_open=maybe", baud=BAUD, name="board")
