"""`pytest hil --port /dev/ttyUSB0`: the tests that a real board can take, with its wheels off the ground."""

from collections.abc import Iterator

import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault
from thumper.common.errors import ThumperError

BAUD = 500_000
CONSENT = (
    "\nThe wheels of the robot on {port} will turn, both ways, at up to 5 rad/s.\n"
    "Put it on a block so that no wheel touches anything. Type yes to start: "
)
NEEDS_THE_SIMULATOR = (
    "a battery that runs low",
    "broken, exchanged or disturbed encoder wires, dead, exchanged or shorted motors, blocked wheels",
    "noise on the line",
    "a firmware that hangs",
    "lost edges at full speed against the true count",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --port and --yes."""
    parser.addoption("--port", default="", help="the board's serial port; its wheels must be off the ground")
    parser.addoption("--clear-fault", action="store_true", help="clear a fault that the board has latched")
    parser.addoption("--yes", action="store_true", help="the wheels are off the ground: do not ask")


def pytest_configure(config: pytest.Config) -> None:
    """Name the marker."""
    config.addinivalue_line("markers", "provokes(fault): the test ends in this fault, which is cleared again")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Ask before anything moves; without a yes nothing does."""
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
        pytest.exit("nothing was moved; say yes, or give --yes", returncode=2)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what this run does not cover."""
    if config.getoption("--port"):
        terminalreporter.section("not tested on a real board")
        terminalreporter.write_line("; ".join(NEEDS_THE_SIMULATOR) + ": `pytest tests/hil` does")


@pytest.fixture(scope="session")
def opened_board(request: pytest.FixtureRequest) -> Iterator[Board]:
    """The board on --port."""
    port = request.config.getoption("--port")
    if not port:
        pytest.skip("no board: give --port, with the wheels off the ground")
    try:
        board = Board.open(port, baud=BAUD)
    except ThumperError as error:
        pytest.exit(str(error), returncode=error.exit_code)
    try:
        fault = latched_fault(board)
        if fault is not Fault.NONE and not request.config.getoption("--clear-fault"):
            pytest.exit(
                f"the board has latched the fault {fault.name}; nothing was moved. "
                "Look for its cause, then give --clear-fault",
                returncode=4,
            )
        if fault is not Fault.NONE:
            board.command(Command.CLEAR_FAULT)
        yield board
    finally:
        board.close()


@pytest.fixture
def board(opened_board: Board, request: pytest.FixtureRequest) -> Iterator[Board]:
    """The board, without a fault and disarmed. Only the fault that a test provokes is cleared after it."""
    fault = latched_fault(opened_board)
    if fault is not Fault.NONE:
        pytest.fail(f"an earlier test left the fault {fault.name}, which nobody provoked; look for its cause")
    opened_board.command(Command.DISARM)
    yield opened_board
    opened_board.command(Command.DISARM)
    marker = request.node.get_closest_marker("provokes")
    if marker is not None and latched_fault(opened_board) is marker.args[0]:
        opened_board.command(Command.CLEAR_FAULT)


def latched_fault(board: Board) -> Fault:
    """The fault of the newest telemetry."""
    board.poll(0.0)  # what came before is old
    samples = board.poll(1.0)
    if not samples:
        pytest.fail("the board sends no telemetry")
    return samples[-1].telemetry.fault
