"""A chip that runs avr/bridge.c, which sets the bridges and reports the encoder counts."""

from dataclasses import dataclass
from pathlib import Path

from thumper_hil.chip.chip import CPU_HZ, Chip
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.robot_params import RobotParams

REPLY_BYTES = 5


def run_for(chip: Chip, seconds: float) -> None:
    """Advance time by `seconds`."""
    chip.run(chip.cycle + round(seconds * CPU_HZ))


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """The firmware's encoder counts, modulo 2**16, and its number of edges of unknown direction."""

    left: int
    right: int
    lost: int


class Rig:
    """The simulated robot under direct command."""

    def __init__(self, elf: Path, params: RobotParams, seed: int = 1) -> None:
        self.chip = FaultyChip(elf, params=params, seed=seed)
        run_for(self.chip, 0.001)

    def set(self, left_pwm: int, right_pwm: int, *, brake: bool = False) -> Counts:
        """Command both bridges, -255...255 (brake: 0...255), and return the counts so far."""
        flags = (left_pwm >= 0) | (right_pwm >= 0) << 1 | brake << 2 | brake << 3
        self.chip.send(bytes((abs(left_pwm), abs(right_pwm), flags)))
        assert self.chip.run(self.chip.cycle + CPU_HZ // 100, bytes_wanted=REPLY_BYTES)
        reply = self.chip.receive(REPLY_BYTES)
        return Counts(
            left=int.from_bytes(reply[0:2], "little"),
            right=int.from_bytes(reply[2:4], "little"),
            lost=reply[4],
        )

    def run_for(self, seconds: float) -> None:
        """Advance time by `seconds`."""
        run_for(self.chip, seconds)
