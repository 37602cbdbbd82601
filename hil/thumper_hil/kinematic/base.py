"""A base without chip and motors: the firmware's ramp at the wheels, and the body of the full simulator."""

import math
from collections import deque

import numpy as np

from thumper.common.geometry import Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp
from thumper_hil.bench.hardware import robot_params
from thumper_hil.bench.options import BenchOptions
from thumper_hil.effects.preset import load_preset

TICK_S = 0.02
BOARD_DELAY_S = 0.04
"""From a command until the wheels respond: about half a control tick of 0.1 s."""

DELAY_S = 0.16
"""The same, and the age that a scan has in the full simulator; here scans are new."""


class KinematicBase:
    """Moves as the simulated robot of the same preset, with other random numbers for the same seed.

    Wheel radius, effective track and centre of rotation are those of `chip/wild_thumper.toml` and the preset
    (`chip/native/drive_train.cpp`, `MoveBody`). The host knows none of them: it measures the wheels.
    """

    def __init__(
        self, start: Pose2, *, preset: str = "nominal", seed: int = 0, delay_s: float = DELAY_S
    ) -> None:
        self.pose = start
        self._rng = np.random.default_rng([seed, 0xBA5E])
        self._drive = DriveGeometry()
        self._ramp = WheelRamp.from_drive(SpeedLimits(), self._drive)
        self._body = body = robot_params(BenchOptions(preset=preset, seed=seed), load_preset(preset)).body
        spread = self._rng.standard_normal(4)
        self._radii_m = body.wheel_radius_m * (1.0 + body.radius_spread_ratio * spread[:2])
        self._track_m = body.track_m * (1.0 + body.track_spread_ratio * spread[2])
        self._centre_m = body.centre_offset_m * spread[3]
        self._track_noise = _CorrelatedNoise(body.track_noise_ratio, body.track_noise_time_s)
        self._centre_noise = _CorrelatedNoise(body.centre_wander_m, body.centre_time_s)
        self._rims_m_s = [0.0, 0.0]  # left and right, as the host measures them
        self._queue = deque([Twist2()] * round(delay_s / TICK_S))

    @property
    def twist(self) -> Twist2:
        """The twist that the wheels show."""
        left, right = self._rims_m_s
        return Twist2(v_m_s=0.5 * (left + right), w_rad_s=(right - left) / self._drive.track_m)

    def step(self, command: Twist2) -> None:
        """Queue a command and move for one tick by the oldest one."""
        self._queue.append(command)
        delayed = self._queue.popleft()
        turn_m_s = self._ramp.half_track_m * delayed.w_rad_s
        targets = (delayed.v_m_s - turn_m_s, delayed.v_m_s + turn_m_s)
        self._rims_m_s = [
            self._ramp.step(rim, to, TICK_S) for rim, to in zip(self._rims_m_s, targets, strict=True)
        ]
        left_rad, right_rad = (rim * TICK_S / self._drive.wheel_radius_m for rim in self._rims_m_s)
        left_m, right_m = self._radii_m * (left_rad, right_rad)
        yaw_rad_s = abs(right_rad - left_rad) / TICK_S * self._body.wheel_radius_m / self._body.track_m
        growth = self._body.track_growth_s * yaw_rad_s + self._track_noise.step(self._rng)
        turn_rad = float(right_m - left_m) / (self._track_m * (1.0 + growth))
        centre_m = self._centre_m + self._centre_noise.step(self._rng)
        moved = Pose2(x_m=0.5 * float(left_m + right_m), y_m=-centre_m * turn_rad)
        half_turn = Pose2(theta_rad=0.5 * turn_rad)
        self.pose = self.pose @ half_turn @ moved @ half_turn


class _CorrelatedNoise:
    """An Ornstein-Uhlenbeck process, as in `chip/native/random.hpp`."""

    def __init__(self, sigma: float, time_s: float) -> None:
        self._keep = math.exp(-TICK_S / time_s)
        self._fresh = sigma * math.sqrt(1.0 - self._keep**2)
        self._value = 0.0

    def step(self, rng: np.random.Generator) -> float:
        self._value = self._keep * self._value + self._fresh * float(rng.standard_normal())
        return self._value
