"""Fuse wheel odometry and a gyroscope in an extended Kalman filter with the gyro's bias as a state.

The gyroscope predicts the rotation of each step, and the wheels measure the same rotation. Both observe an
increment and not the heading itself, so the update uses the covariance between the increment and the state
(Roumeliotis, Burdick, "Stochastic cloning", ICRA 2002). The wheels of a stationary robot measure a rotation
of zero, so the filter estimates the bias at every stop.
"""

import math
from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.common.kinematics import DriveGeometry
from thumper.odometry.imu import ImuOptions, ImuSample
from thumper.odometry.wheel_odometry import OdometryOptions, OdometrySample, advance, count_delta

STATIONARY_STD_RAD = 1e-4  # of a step in which no wheel has counted
# Page's cumulative sum test ("Continuous inspection schemes", Biometrika 41, 1954) on the difference between
# the rotation of the wheels and that of the gyroscope: it sums what exceeds the allowance, and a sum at the
# limit is a slip.
SLIP_ALLOWANCE, SLIP_LIMIT = 0.75, 9.0  # standard deviations
LARGEST_GAP_S = 0.1  # ignore a gyroscope without samples for longer than this


class GyroEkf:
    """The interface of `WheelOdometry` plus `add_imu`; without samples it uses the wheels alone."""

    def __init__(
        self,
        geometry: DriveGeometry,
        options: OdometryOptions | None = None,
        imu: ImuOptions | None = None,
    ) -> None:
        self._geometry = geometry
        self._options, self._imu = options or OdometryOptions(), imu or ImuOptions()
        self._counts: tuple[int, int] | None = None
        self._samples: deque[ImuSample] = deque(maxlen=1000)
        self._pose, self._time_s, self._twist = Pose2(), 0.0, Twist2()
        self.bias_rad_s = 0.0
        self.covariance: FloatArray = np.diag([0.0, 0.0, 0.0, self._imu.bias_rad_s**2])  # x, y, theta, bias
        self._disagreement = [0.0, 0.0]  # cumulative sums, counter-clockwise and clockwise
        self._slipping = False
        self.slips = 0  # number of periods in which wheels and gyroscope disagreed

    def add_imu(self, sample: ImuSample) -> None:
        """Queue a sample for the next `update`. Drops samples that are out of order or not finite."""
        if not math.isfinite(sample.yaw_rate_rad_s) or not math.isfinite(sample.time_s):
            return
        if self._samples and sample.time_s <= self._samples[-1].time_s:
            return
        self._samples.append(sample)

    def update(self, time_s: float, left_count: int, right_count: int) -> OdometrySample:
        """Add one reading of both encoders (int32, may wrap); the first one defines the origin."""
        geometry, left_m, right_m = self._geometry, 0.0, 0.0
        if self._counts is not None:
            left_m = (
                count_delta(self._counts[0], left_count) * geometry.rad_per_count * geometry.left_radius_m
            )
            right_m = (
                count_delta(self._counts[1], right_count) * geometry.rad_per_count * geometry.right_radius_m
            )
        arc_m, wheels_rad = 0.5 * (left_m + right_m), (right_m - left_m) / geometry.track_m
        dt_s, rate_rad_s = time_s - self._time_s, self._rate(self._time_s, time_s)
        if self._counts is not None:
            if rate_rad_s is None or dt_s <= 0.0:
                turn_rad = wheels_rad
                self._step(arc_m, turn_rad, self._wheels_var(arc_m, wheels_rad), 0.0)
            else:
                turn_rad = self._fuse(
                    arc_m, rate_rad_s, dt_s, wheels_rad, moves=left_m != 0.0 or right_m != 0.0
                )
            if dt_s > 0.0:
                self._twist = Twist2(v_m_s=arc_m / dt_s, w_rad_s=turn_rad / dt_s)
        self._counts, self._time_s = (left_count, right_count), time_s
        return OdometrySample(
            time_s=time_s,
            odom_from_base=self._pose,
            twist=self._twist,
            covariance=self.covariance[:3, :3].copy(),
        )

    def _rate(self, start_s: float, end_s: float) -> float | None:
        """Return the mean rate over the step, or None without recent samples."""
        while self._samples and self._samples[0].time_s <= start_s:
            self._samples.popleft()
        rates = [sample.yaw_rate_rad_s for sample in self._samples if sample.time_s <= end_s]
        if not rates or end_s - self._samples[len(rates) - 1].time_s > LARGEST_GAP_S:
            return None
        return sum(rates) / len(rates)

    def _fuse(self, arc_m: float, rate_rad_s: float, dt_s: float, wheels_rad: float, *, moves: bool) -> float:
        """Predict with the gyroscope, update with the wheels; return the fused rotation [rad]."""
        imu = self._imu
        turn_rad = (rate_rad_s - self.bias_rad_s) * dt_s
        heading_rad = self._pose.theta_rad
        # Covariance of the rotation's error with the state before the step: both contain the bias.
        before = -dt_s * self.covariance[:, 3]
        noise_var = imu.noise_rad_s**2 * dt_s
        jacobian = self._step(arc_m, turn_rad, noise_var, dt_s)
        self.covariance[3, 3] += imu.bias_walk_rad_s**2 * dt_s
        turn_var = noise_var - dt_s * before[3]
        cross = before.copy()
        cross[0] += -arc_m * math.sin(heading_rad + 0.5 * turn_rad) * before[2] + jacobian[0] * turn_var
        cross[1] += arc_m * math.cos(heading_rad + 0.5 * turn_rad) * before[2] + jacobian[1] * turn_var
        cross[2] += turn_var
        # Use the larger rotation: noise that hides a rotation must not look like certainty.
        largest_rad = max(abs(wheels_rad), abs(turn_rad))
        wheels_var = self._wheels_var(arc_m, largest_rad) if moves else STATIONARY_STD_RAD**2
        innovation, innovation_var = wheels_rad - turn_rad, turn_var + wheels_var
        sigmas = innovation / math.sqrt(innovation_var)
        self._update_slip(max(-imu.slip_sigmas, min(imu.slip_sigmas, sigmas)))
        if self._slipping or abs(sigmas) > imu.slip_sigmas:
            return turn_rad
        gain = cross / innovation_var
        x_m, y_m, theta_rad, bias = gain * innovation
        self._pose = Pose2(
            x_m=self._pose.x_m + float(x_m),
            y_m=self._pose.y_m + float(y_m),
            theta_rad=wrap_angle(self._pose.theta_rad + float(theta_rad)),
        )
        self.bias_rad_s += float(bias)
        self.covariance -= np.outer(gain, cross)
        return float(turn_rad + turn_var / innovation_var * innovation)

    def _update_slip(self, sigmas: float) -> None:
        """Add the step's disagreement [standard deviations]. A slip ends when both sums are 0 again."""
        sums = [
            min(SLIP_LIMIT, max(0.0, previous + sign * sigmas - SLIP_ALLOWANCE))
            for previous, sign in zip(self._disagreement, (1.0, -1.0), strict=True)
        ]
        self._disagreement = sums
        if max(sums) >= SLIP_LIMIT:
            self.slips += not self._slipping
            self._slipping = True
        elif max(sums) == 0.0:
            self._slipping = False

    def _wheels_var(self, arc_m: float, turn_rad: float) -> float:
        options = self._options
        return options.turn_noise**2 * abs(turn_rad) + options.drift_noise**2 * abs(arc_m)

    def _step(self, arc_m: float, turn_rad: float, turn_var: float, dt_s: float) -> FloatArray:
        """Predict along the arc, P' = F P F^T + G Q G^T; return d(x, y, theta)/d(turn), shape (3,)."""
        heading_rad = self._pose.theta_rad + 0.5 * turn_rad
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        by_turn = np.array([-0.5 * arc_m * sin, 0.5 * arc_m * cos, 1.0])
        state = np.eye(4)
        state[0, 2], state[1, 2] = -arc_m * sin, arc_m * cos
        state[:3, 3] = -dt_s * by_turn
        self.covariance = state @ self.covariance @ state.T
        self.covariance[:3, :3] += turn_var * np.outer(by_turn, by_turn)
        along = np.array([cos, sin])
        self.covariance[:2, :2] += self._options.distance_noise**2 * abs(arc_m) * np.outer(along, along)
        self._pose = advance(self._pose, arc_m, turn_rad)
        return by_turn
