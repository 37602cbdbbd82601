"""The lidar's true mounting: a bracket is set with a ruler, so it differs from the robot's TOML."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import Pose2
from thumper_hil.effects.preset import MountEffects


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """Where the lidar really is: its pose in `base_link`, and its tilt, positive with the front down."""

    base_from_laser: Pose2
    tilt_rad: float = 0.0


def true_mounting(nominal: Pose2, effects: MountEffects, seed: int) -> Mounting:
    """Return the mounting of the robot with this seed: uniform errors within the preset's bounds."""
    x, y, yaw, tilt = np.random.default_rng([seed, 0x303]).uniform(-1.0, 1.0, 4)
    return Mounting(
        base_from_laser=Pose2(
            x_m=nominal.x_m + effects.offset_m * x,
            y_m=nominal.y_m + effects.offset_m * y,
            theta_rad=nominal.theta_rad + math.radians(effects.yaw_deg) * yaw,
        ),
        tilt_rad=math.radians(effects.tilt_deg) * tilt,
    )
