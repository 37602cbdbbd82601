"""A board whose DTR line pulls its reset pin: opening its port starts it anew, through its boot loader."""

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
    """The robot's other port: while it is open, the robot stays."""
    port = open_port(f"sim://{NAME}/lidar?reset_on_open=1", baud=BAUD, name="lidar").raw
    assert isinstance(port, Serial)
    yield port
    port.close()


def first_telemetry_s(url: str) -> float:
    """How long after opening a port a host that only listens hears telemetry [s]."""
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


def test_each_opening_goes_through_the_boot_loader(lidar_port: Serial) -> None:
    """It waits more than a second for a new program before it starts the one that is there."""
    resets = simulation(NAME).chip.resets
    for opened in (1, 2):
        assert 1.0 < first_telemetry_s(f"sim://{NAME}/board") < 3.0
        assert simulation(NAME).chip.resets == resets + opened


def test_without_the_option_a_board_runs_on() -> None:
    assert first_telemetry_s("sim://reset-test-plain/board") < 0.3


def test_the_host_gets_through_and_finds_a_board_that_has_just_started(lidar_port: Serial) -> None:
    """What it had armed is disarmed: it must not drive on by itself."""
    board = Board.open(f"sim://{NAME}/board", baud=BAUD)
    board.command(Command.ARM)
    board.port.close()  # as if the program had died
    board = Board.open(f"sim://{NAME}/board", baud=BAUD)
    try:
        assert board.identity.reset_cause is ResetCause.EXTERNAL
        assert board.poll(0.5)[-1].telemetry.state is State.DISARMED
    finally:
        board.close()


def test_dtr_resets_when_it_is_raised_not_when_it_stays(lidar_port: Serial) -> None:
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


def test_a_wrong_value_is_told() -> None:
    with pytest.raises(ThumperError, match="reset_on_open=maybe: give 0 or 1"):
        open_port("sim://reset-test-wrong/board?reset_on_open=maybe", baud=BAUD, name="board")
