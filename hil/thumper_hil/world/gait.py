"""Where the legs of a walking person are.

At the lidar's height, two legs pass each other: one rests on the floor while the other swings at twice the
walking speed (Arras et al., "Using Boosted Features for the Detection of People in 2D Range Data", ICRA 2007,
track such legs).
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray

STEP_M = 0.65
HALF_STANCE_M = 0.10


def legs_m(
    position_m: tuple[float, float], heading_rad: float, walked_m: float, radius_m: float
) -> FloatArray:
    """Return both legs as circles, shape (2, 3): x y radius."""
    phase_m = walked_m % (2.0 * STEP_M)
    swing_m = abs(phase_m - STEP_M) - 0.5 * STEP_M
    along = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    left = np.array([-along[1], along[0]])
    feet = [np.array(position_m) + side * (swing_m * along + HALF_STANCE_M * left) for side in (1.0, -1.0)]
    return np.column_stack([np.array(feet), np.full(2, radius_m)])
