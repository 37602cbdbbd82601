"""`pytest hil --port /dev/ttyUSB0`: tests for a real board whose wheels are off the ground."""

from collections.abc import Iterator

import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault
from thumper.common.errors import ThumperError

BAUD = 500_000
CONSENT = (
    "\nThe wheels of the robot on {port} will turn in both directions, at up to 5 rad/s.\n"
    "Put the robot on a block so that no wheel touches anything. Type yes to start: "
)
NEEDS_THE_SIMULATOR = (
    "low battery",
    "broken, swapped or disturbed encoder wires, dead, swapped or shorted motors, blocked wheels",
    "noise on the serial line",
    "hanging firmware",
    "lost edges at full speed against the true count",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --port and --yes."""
    parser.addoption("--port", default="", help="the board's serial port; its wheels must be off the ground")
    parser.addoption("--clear-fault", action="store_true", help="clear a fault that the board has latched")
    parser.addoption("--yes", action="store_true", help="skip the prompt: the wheels are off the ground")


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker `provokes`."""
    config.addinivalue_line("markers", "provokes(fault): the test ends in this fault, which is then cleared")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Ask for consent before anything moves."""
    port = session.config.getoption("--port")
    if not port or session.config.getoption("--yes"):
        return
    capture = session.config.pluginmanager.getplugin("capturemanager")
    capture.suspend_global_capture(in_=True)
    try:
        answer = input(CONSENT.format(port=port))
    except EOFError:
        answer = ""
    finally:
        capture.resume_global_capture()
    if answer.strip().lower() != "yes":
        pytest.exit("nothing has moved; type yes, or pass --yes", returncode=2)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """List what this run does not cover."""
    if config.getoption("--port"):
        terminalreporter.section("not tested on a real board")
        terminalreporter.write_line("; ".join(NEEDS_THE_SIMULATOR) + ". `pytest tests/hil` tests these.")


@pytest.fixture(scope="session")
def opened_board(request: pytest.FixtureRequest) -> Iterator[Board]:
    """Open the board on --port."""
    port = request.config.getoption("--port")
    if not port:
        pytest.skip("no board: pass --port, with the wheels off the ground")
    try:
        board = Board.open(port, baud=BAUD)
    except ThumperError as error:
        pytest.exit(str(error), returncode=error.exit_code)
    try:
        fault = latched_fault(board)
        if fault is not Fault.NONE and not request.config.getoption("--clear-fault"):
            pytest.exit(
                f"the board has latched the fault {fault.name}; nothing has moved. "
                "Find its cause, then pass --clear-fault",
                returncode=4,
            )
        if fault is not Fault.NONE:
            board.command(Command.CLEAR_FAULT)
        yield board
    finally:
        board.close()


@pytest.fixture
def board(opened_board: Board, request: pytest.FixtureRequest) -> Iterator[Board]:
    """Yield the board, disarmed and without a fault; afterwards clear only the fault the test provokes."""
    fault = latched_fault(opened_board)
    if fault is not Fault.NONE:
        pytest.fail(f"an earlier test left the unexpected fault {fault.name}; find its cause")
    opened_board.command(Command.DISARM)
    yield opened_board
    opened_board.command(Command.DISARM)
    marker = request.node.get_closest_marker("provokes")
    if marker is not None and latched_fault(opened_board) is marker.args[0]:
        opened_board.command(Command.CLEAR_FAULT)


def latched_fault(board: Board) -> Fault:
    """Return the fault in the newest telemetry."""
    board.poll(0.0)  # discard old telemetry
    samples = board.poll(1.0)
    if not samples:
        pytest.fail("the board sends no telemetry")
    return samples[-1].telemetry.fault
