"""To a stand and off, on every way out."""

from contextlib import suppress

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Command
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper.runtime.sensor_inputs import LATE_CYCLE_S, LATE_CYCLES

STOP_CYCLES = 30  # the firmware's ramp needs two seconds from the fastest speed it takes


def stop_and_disarm(board: Board) -> tuple[list[TelemetrySample], bool]:
    """Zero speed until the wheels stand, then disarm; returns what the board said, and whether it confirmed.

    It never raises. Ctrl-C cuts the ramp short, never the disarming.
    """
    samples: list[TelemetrySample] = []
    confirmed, silent_cycles = False, 0
    try:
        with suppress(KeyboardInterrupt):
            for _ in range(STOP_CYCLES):
                board.set_wheel_speeds(WheelSpeeds())
                heard = board.poll(LATE_CYCLE_S)  # a lost frame must not become a lost link
                samples += heard
                silent_cycles = 0 if heard else silent_cycles + 1
                if silent_cycles > LATE_CYCLES:
                    break
                if heard and heard[-1].telemetry.left_speed == heard[-1].telemetry.right_speed == 0:
                    break
        while not confirmed:
            with suppress(KeyboardInterrupt):
                board.command(Command.DISARM)
                confirmed = True
    except ThumperError:
        pass
    return samples, confirmed
