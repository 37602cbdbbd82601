"""While the base may be tilted, far beams count for nothing."""

import math

import numpy as np
import pytest

from thumper.lidar.floor_echoes import SETTLING_S, FloorEchoFilter
from thumper.lidar.scan import Scan

BRAKED_S = 1.2
RANGES_M = (0.3, 2.4, 2.6, 3.8, math.inf, math.nan)


def ranges_at(time_s: float, braking_m_s2: float) -> list[float]:
    """Return the ranges of a scan that begins then; the robot brakes between 1.1 and 1.2 s."""
    floor_echoes = FloorEchoFilter()
    for tick in range(1, 40):
        speed_m_s = 0.4 - braking_m_s2 * 0.1 * (tick > 11)
        floor_echoes.add_speed(0.1 * tick, speed_m_s)
    scan = Scan(
        time_s=time_s,
        ranges_m=np.array(RANGES_M),
        angle_min_rad=-math.pi / 2,
        angle_increment_rad=math.pi / 5,
    )
    return list(floor_echoes.filter(scan).ranges_m)


@pytest.mark.parametrize("braking_m_s2", [1.5, -1.5])
@pytest.mark.parametrize("after_s", [-0.1, 0.0, SETTLING_S - 0.01])
def test_far_beams_are_invalid_at_hard_braking_and_until_the_springs_rest(
    braking_m_s2: float, after_s: float
) -> None:
    assert ranges_at(BRAKED_S + after_s, braking_m_s2) == pytest.approx(
        [0.3, 2.4, math.nan, math.nan, math.nan, math.nan], nan_ok=True
    )


@pytest.mark.parametrize(("after_s", "braking_m_s2"), [(SETTLING_S + 0.01, 1.5), (0.0, 0.5), (0.0, 0.0)])
def test_all_beams_count_later_and_in_normal_driving(after_s: float, braking_m_s2: float) -> None:
    assert ranges_at(BRAKED_S + after_s, braking_m_s2) == pytest.approx(list(RANGES_M), nan_ok=True)
