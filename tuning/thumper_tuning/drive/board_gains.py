"""A board at work under an experiment: beats of telemetry, checked; motors stop first, whatever ends it."""

from collections.abc import Iterator
from contextlib import contextmanager

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Command, Fault, State
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper_tuning.design.fixed_point import BoardGains

ROLLS_OUT_S = 2.0
BEAT_TIMEOUT_S = 0.5


@contextmanager
def armed(board: Board) -> Iterator[None]:
    """Arm the board; on every way out stop the motors at once and disarm."""
    board.poll(BEAT_TIMEOUT_S)
    board.command(Command.ARM)
    try:
        yield
    finally:
        try:
            board.command(Command.DISARM)
        except ThumperError:
            board.set_motor_pwm(0, 0)  # the board stops by itself 0.3 s after the last command anyway


def beat(board: Board, state: State) -> TelemetrySample:
    """Wait for the next telemetry.

    Raises
    ------
    ThumperError
        None comes, or the board has left the state: the message tells its fault.
    """
    samples = board.poll(BEAT_TIMEOUT_S)
    if not samples:
        raise ThumperError(
            "the board sends no telemetry any more; is the cable loose?", exit_code=EXIT_NOT_THERE
        )
    sample = samples[-1]
    if sample.telemetry.fault != Fault.NONE:
        raise ThumperError(
            f"the board has stopped the motors: {sample.telemetry.fault.name.lower()}; cure that first"
        )
    if sample.telemetry.state != state and state is State.CLOSED_LOOP:
        raise ThumperError(f"the board went to {sample.telemetry.state.name}; is somebody else driving?")
    return sample


def wait_for_rest(board: Board) -> None:
    """Wait until the wheels stand: from full speed a board that coasts at PWM 0 rolls for a second."""
    for _ in range(round(ROLLS_OUT_S * board.identity.control_rate_Hz)):
        telemetry = beat(board, State.DISARMED).telemetry
        if telemetry.left_speed == 0 and telemetry.right_speed == 0:
            return


def read_gains(board: Board) -> BoardGains:
    """What the board works with now."""
    names = ("kp", "ki", "ks", "kv", "ka", "acceleration")
    return BoardGains(**{name: board.get_parameter(name) for name in names})


def write_gains(board: Board, gains: BoardGains) -> None:
    """Set all control parameters; they hold until the board's next reset, unless saved."""
    for name, value in gains.items():
        board.set_parameter(name, value)
