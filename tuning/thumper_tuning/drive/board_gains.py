"""The board during an experiment: arm it, read its telemetry, stop its motors, read and write its gains."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from thumper.board.board import Board, TelemetrySample
from thumper.board.fault_texts import FAULT_NAMES
from thumper.board.messages import Command, Fault, State
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper_tuning.design.fixed_point import BoardGains

MAX_COASTING_S = 2.0
TELEMETRY_TIMEOUT_S = 0.5


@contextmanager
def armed(board: Board) -> Iterator[None]:
    """Arm the board; at the end stop the motors at once and disarm, also after an error.

    A board that cannot read its saved parameters is armed with the defaults: tuning saves new ones.
    """
    samples = board.poll(TELEMETRY_TIMEOUT_S)
    if samples and samples[-1].telemetry.fault is Fault.BAD_PARAMETERS:
        board.command(Command.CLEAR_FAULT)
    board.command(Command.ARM)
    try:
        yield
    finally:
        try:
            board.command(Command.DISARM)
        except ThumperError:
            board.set_motor_pwm(0, 0)  # in any case the board stops 0.3 s after the last command


def next_sample(board: Board, state: State) -> TelemetrySample:
    """Wait for the next telemetry and return it.

    Raises
    ------
    ThumperError
        No telemetry arrives, or the board has left the state; the message names its fault.
    """
    samples = board.poll(TELEMETRY_TIMEOUT_S)
    if not samples:
        raise ThumperError(
            "the board has stopped sending telemetry; check the cable", exit_code=EXIT_NOT_THERE
        )
    sample = samples[-1]
    if sample.telemetry.fault != Fault.NONE:
        raise ThumperError(
            f"the board has stopped the motors: {FAULT_NAMES[sample.telemetry.fault]}; fix that first"
        )
    if sample.telemetry.state != state and state is State.CLOSED_LOOP:
        raise ThumperError(
            f"the board switched to {sample.telemetry.state.name}; check that no other program drives it"
        )
    return sample


def wait_until_stopped(board: Board) -> None:
    """Wait until the wheels have stopped; a board that coasts at PWM 0 rolls for a second at full speed."""
    for _ in range(round(MAX_COASTING_S * board.identity.control_rate_Hz)):
        telemetry = next_sample(board, State.DISARMED).telemetry
        if telemetry.left_speed == 0 and telemetry.right_speed == 0:
            return


def read_gains(board: Board) -> BoardGains:
    """Return the board's current gains."""
    names = ("kp", "ki", "ks", "kv", "ka", "acceleration")
    return BoardGains(**{name: board.get_parameter(name) for name in names})


def write_gains(board: Board, gains: BoardGains) -> None:
    """Set all control parameters. The board forgets them at its next reset, unless they are saved."""
    for name, value in gains.items():
        board.set_parameter(name, value)


@contextmanager
def original_gains(board: Board) -> Iterator[BoardGains]:
    """Yield the board's gains, and restore them after any error."""
    gains = read_gains(board)
    try:
        yield gains
    except BaseException:  # Ctrl-C, too: perhaps the robot shakes with the new gains
        with suppress(ThumperError):
            write_gains(board, gains)
        raise
