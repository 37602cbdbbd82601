"""The excitation signal that identifies a motor within a lane of floor."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le, MinLen
from numpy.typing import NDArray

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationOptions:
    """Options of the experiment. The defaults fit a Wild Thumper: 1.2 m of free floor ahead and behind."""

    lane_m: Annotated[float, Gt(0.3)] = 1.2  # free floor ahead, and as much behind
    steps_pwm: Annotated[tuple[Annotated[int, Ge(1), Le(255)], ...], MinLen(1)] = (60, 110, 160)
    low_pwm: Annotated[int, Ge(30), Le(255)] = 70
    high_pwm: Annotated[int, Ge(30), Le(255)] = 160
    step_s: Annotated[float, Gt(0)] = 1.2
    pause_s: Annotated[float, Gt(0)] = 0.6
    switching_blocks: Annotated[int, Ge(2)] = 14
    block_s: Annotated[float, Gt(0)] = 1.8
    seed: Annotated[int, Ge(0)] = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """PWM per tick, unsigned; the direction is chosen when the block starts."""

    levels: IntArray
    name: str


def excitation_blocks(options: ExcitationOptions, rate_Hz: float) -> list[Block]:
    """Return steps to each level and back to rest, then random switching between two levels.

    Each comes in both directions. The switching holds a level for 0.1 ... 0.3 s, near the time constants of
    geared motors. It never crosses zero within a block, so friction has one sign there.
    """
    rng = np.random.default_rng(options.seed)
    pause = np.zeros(round(options.pause_s * rate_Hz), dtype=np.int64)
    found = []
    for level in options.steps_pwm:
        step = np.full(round(options.step_s * rate_Hz), level, dtype=np.int64)
        found += [Block(levels=np.concatenate((step, pause)), name=f"PWM {level} on and off")] * 2
    for _ in range(options.switching_blocks):
        levels: list[int] = []
        while len(levels) < options.block_s * rate_Hz:
            hold = round(float(rng.choice((0.1, 0.2, 0.3))) * rate_Hz)
            levels += [options.high_pwm if rng.random() < 0.5 else options.low_pwm] * max(hold, 1)
        found.append(
            Block(
                levels=np.concatenate((np.array(levels, dtype=np.int64), pause[::2])),
                name=f"switching between PWM {options.low_pwm} and {options.high_pwm}",
            )
        )
    return found
