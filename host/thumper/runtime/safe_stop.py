"""Stops the wheels and disarms the board; every exit path uses it."""

from dataclasses import dataclass

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Command
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper.runtime.sensor_inputs import LATE_CYCLE_S, LATE_CYCLES

STOP_CYCLES = 30  # the firmware's ramp needs 2 s from the maximum speed


@dataclass(frozen=True, slots=True, kw_only=True)
class StopResult:
    """What the board sent while it stopped, and whether it confirmed that the motors are off."""

    samples: list[TelemetrySample]
    confirmed: bool
    interrupted: bool  # Ctrl-C came meanwhile


def stop_and_disarm(board: Board) -> StopResult:
    """Command zero speed until the wheels stop, then disarm. Never raises.

    Ctrl-C cuts the ramp short, but never the disarming.
    """
    samples: list[TelemetrySample] = []
    confirmed, silent_cycles, interrupts = False, 0, _InterruptCounter()
    try:
        with interrupts:
            for _ in range(STOP_CYCLES):
                board.set_wheel_speeds(WheelSpeeds())
                received = board.poll(LATE_CYCLE_S)  # a lost frame must not become a lost link
                samples += received
                silent_cycles = 0 if received else silent_cycles + 1
                if silent_cycles > LATE_CYCLES:
                    break
                if received and received[-1].telemetry.left_speed == received[-1].telemetry.right_speed == 0:
                    break
        while not confirmed:
            with interrupts:
                board.command(Command.DISARM)
                confirmed = True
    except ThumperError:
        pass
    return StopResult(samples=samples, confirmed=confirmed, interrupted=interrupts.count > 0)


class _InterruptCounter:
    """Suppresses and counts KeyboardInterrupt."""

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> None:
        """Do nothing."""

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> bool:
        is_interrupt = kind is KeyboardInterrupt
        self.count += is_interrupt
        return is_interrupt
