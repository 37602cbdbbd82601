"""Fuse wheel odometry and a gyroscope in an extended Kalman filter with the gyroscope's bias as a state.

The gyroscope predicts the turn of each step, and the wheels measure it. The turn of the step is a state until
the wheels have corrected it, so that both measurements of one turn correlate as they should (Roumeliotis,
Burdick, "Stochastic cloning", ICRA 2002). The wheels of a stationary robot measure a turn of zero, so the
filter estimates the bias at every stop. The wheels of a moving robot count only once a few curves have shown
how much of their turn is true: a skid-steered base turns by less than its geometry says.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.common.kinematics import DriveGeometry
from thumper.imu.options import ImuOptions
from thumper.imu.sample import ImuSample
from thumper.odometry.track_estimator import TrackEstimator
from thumper.odometry.turn_buffer import TurnBuffer
from thumper.odometry.turn_slip import TurnSlip
from thumper.odometry.wheel_odometry import OdometryOptions, OdometrySample, advance, count_delta

BIAS, TURN = 3, 4  # columns of the state: x, y, theta, bias, turn of the step
STATIONARY_S = 0.3  # without a count, because a slow wheel does not count in every step
# At each stop the bias becomes as uncertain as this: wheels of unequal size and a body that still swings
# when the wheels have stopped shift it, and a device may be worse than its data sheet.
STOP_DOUBT_RAD_S = 1e-3
MAX_BIAS_RAD_S = 0.1  # a robot at rest that turns faster is being turned
SETTLED_S = 1.0  # after the last count the body does not swing any more
DOUBT_S = 2.0  # at rest with a wrong bias, until the filter learns it again
STATIONARY_STD_RAD = 1e-4  # of the turn of a step of a stationary robot
SILENT_S = 2.0  # of silence, in all, are reported


class GyroEkf:
    """The interface of `WheelOdometry` plus `add_imu`; without samples it uses the wheels alone."""

    def __init__(
        self,
        geometry: DriveGeometry,
        options: OdometryOptions | None = None,
        imu: ImuOptions | None = None,
    ) -> None:
        self._geometry = geometry
        self._options, imu = options or OdometryOptions(), imu or ImuOptions()
        self._noise, self._slip_sigmas = imu.noise, imu.slip_sigmas
        self._counts: tuple[int, int] | None = None
        self._turns = TurnBuffer()
        self._pose, self._time_s, self._twist = Pose2(), 0.0, Twist2()
        self._moved_s = -math.inf  # when a wheel counted last
        self._is_stationary = False
        self.bias_rad_s = 0.0
        self.covariance: FloatArray = np.diag([0.0, 0.0, 0.0, self._noise.bias_rad_s**2])  # x, y, theta, bias
        self._silent_s = 0.0  # time without the gyroscope
        self.slip = TurnSlip()
        self.track = TrackEstimator(geometry.track_m)

    def add_imu(self, sample: ImuSample) -> None:
        """Add a sample, before the `update` for its time. Drops one that is out of order or not finite."""
        self._turns.add(sample)

    def update(
        self, time_s: float, left_count: int, right_count: int, *, gyro_rad: float | None = None
    ) -> OdometrySample:
        """Add one reading of both encoders (int32, may wrap); the first one defines the origin.

        `gyro_rad` is the turn since the last update, from a gyroscope that measures with the counts.
        """
        if gyro_rad is None:
            gyro_rad = self._turns.turn_until(time_s)
        if self._counts is not None:
            left, right = count_delta(self._counts[0], left_count), count_delta(self._counts[1], right_count)
            self._advance(time_s, left, right, gyro_rad)
        self._counts, self._time_s = (left_count, right_count), time_s
        return OdometrySample(
            time_s=time_s,
            odom_from_base=self._pose,
            twist=self._twist,
            covariance=self.covariance[:3, :3].copy(),
        )

    def warnings(self) -> dict[str, str]:
        """Return what the gyroscope found so far: one line per kind."""
        warnings = {}
        if self.slip.slips:
            warnings["TURN_SLIP"] = f"{self.slip.slips} times wheels and gyroscope disagreed: the wheels slip"
        if self.slip.stuck:
            warnings["STUCK"] = f"stuck {self.slip.stuck} times: the wheels turned, the robot did not"
        if self._silent_s > SILENT_S:
            warnings["GYROSCOPE"] = (
                f"no rate from the gyroscope for {self._silent_s:.0f} s: its cable? The wheels alone go on"
            )
        if offer := self.track.offer():
            warnings["TRACK"] = offer
        return warnings

    def _advance(self, time_s: float, left: int, right: int, gyro_rad: float | None) -> None:
        geometry, dt_s = self._geometry, time_s - self._time_s
        left_m = left * geometry.rad_per_count * geometry.left_radius_m
        right_m = right * geometry.rad_per_count * geometry.right_radius_m
        arc_m, wheels_rad = 0.5 * (left_m + right_m), (right_m - left_m) / geometry.track_m
        if left or right:
            self._moved_s = time_s
        self._silent_s += max(dt_s, 0.0) if gyro_rad is None else 0.0
        if gyro_rad is None or dt_s <= 0.0:
            turn_rad = self._turn_ratio * wheels_rad
            self._predict(arc_m, turn_rad, self._wheels_var(arc_m, turn_rad))
        else:
            turn_rad = gyro_rad - self.bias_rad_s * dt_s
            self._predict(arc_m, turn_rad, self._noise.rate_rad_s**2 * dt_s, dt_s)
            stationary_s = time_s - self._moved_s
            if stationary_s >= STATIONARY_S:
                if not self._is_stationary:
                    self.covariance[BIAS, BIAS] += STOP_DOUBT_RAD_S**2
                creep_var = self._count_var * (dt_s / stationary_s) ** 2
                turn_rad += self._correct_at_rest(
                    turn_rad, dt_s, stationary_s, STATIONARY_STD_RAD**2 + creep_var
                )
            elif self.track.ratio is not None:
                seen_rad = self._turn_ratio * wheels_rad
                # Use the larger rotation: noise that hides a rotation must not look like certainty.
                variance = self._wheels_var(arc_m, max(abs(seen_rad), abs(turn_rad))) + self._count_var
                turn_rad += self._correct(seen_rad, turn_rad, variance)
            self._is_stationary = stationary_s >= STATIONARY_S
            self.track.add(turn_rad, wheels_rad)
            self.covariance[BIAS, BIAS] += self._noise.bias_walk_rad_s**2 * dt_s
        self.covariance = self.covariance[:TURN, :TURN]
        if dt_s > 0.0:
            self._twist = Twist2(v_m_s=arc_m / dt_s, w_rad_s=turn_rad / dt_s)

    def _predict(self, arc_m: float, turn_rad: float, turn_var: float, dt_s: float = 0.0) -> None:
        """Move along the arc; add the turn to the covariance as its last row, which depends on the bias."""
        heading_rad = self._pose.theta_rad + 0.5 * turn_rad
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        by_turn = np.array([-0.5 * arc_m * sin, 0.5 * arc_m * cos, 1.0, 0.0, 1.0])
        jacobian = np.eye(5, 4)
        jacobian[0, 2], jacobian[1, 2] = -arc_m * sin, arc_m * cos
        jacobian[:, BIAS] -= dt_s * by_turn
        self.covariance = jacobian @ self.covariance @ jacobian.T + turn_var * np.outer(by_turn, by_turn)
        along = np.array([cos, sin])
        self.covariance[:2, :2] += self._options.distance_noise**2 * abs(arc_m) * np.outer(along, along)
        self._pose = advance(self._pose, arc_m, turn_rad)

    def _correct(self, seen_rad: float, turn_rad: float, seen_var: float) -> float:
        """Correct the state by the turn of the wheels unless they slip; return the change of the turn."""
        gain = self.covariance[:, TURN].copy()
        innovation, variance = seen_rad - turn_rad, float(gain[TURN]) + seen_var
        sigmas = innovation / math.sqrt(variance)
        self.slip.add(max(-self._slip_sigmas, min(self._slip_sigmas, sigmas)), seen_rad, turn_rad)
        if self.slip.is_slipping or abs(sigmas) > self._slip_sigmas:
            return 0.0
        return self._fuse(innovation, seen_var)

    def _fuse(self, innovation: float, seen_var: float) -> float:
        """Correct the state by a turn that is seen; return the change of the turn."""
        gain = self.covariance[:, TURN].copy()
        variance = float(gain[TURN]) + seen_var
        change = gain * (innovation / variance)
        self.covariance -= np.outer(gain, gain) / variance
        self._pose = Pose2(
            x_m=self._pose.x_m + float(change[0]),
            y_m=self._pose.y_m + float(change[1]),
            theta_rad=wrap_angle(self._pose.theta_rad + float(change[2])),
        )
        self.bias_rad_s += float(change[BIAS])
        return float(change[TURN])

    def _correct_at_rest(self, turn_rad: float, dt_s: float, stationary_s: float, seen_var: float) -> float:
        """Correct the state by a turn of zero; return the change of the turn.

        A small rate that lasts and that the bias does not explain is a wrong bias. Doubt the bias until it
        explains the rate, or every later rest would be rejected as a slip. A faster rate is a robot that is
        being turned.
        """
        if stationary_s <= SETTLED_S or abs(turn_rad) >= MAX_BIAS_RAD_S * dt_s:
            return self._correct(0.0, turn_rad, seen_var)
        explained_rad = self._slip_sigmas * math.sqrt(float(self.covariance[TURN, TURN]) + seen_var)
        if abs(turn_rad) > explained_rad:
            self.covariance[BIAS, BIAS] += (turn_rad / dt_s) ** 2 * dt_s / DOUBT_S
            return 0.0
        return self._fuse(-turn_rad, seen_var)

    @property
    def _turn_ratio(self) -> float:
        return 1.0 if self.track.ratio is None else self.track.ratio.ratio

    @property
    def _count_var(self) -> float:
        """Variance of the turn from whole counts: up to one wrong at both ends of each side [rad^2]."""
        geometry = self._geometry
        return (geometry.rad_per_count * geometry.wheel_radius_m / geometry.track_m) ** 2 / 3.0

    def _wheels_var(self, arc_m: float, turn_rad: float) -> float:
        options, found = self._options, self.track.ratio
        per_rad = options.turn_noise**2 if found is None else max(options.turn_noise, found.noise_rad) ** 2
        return per_rad * abs(turn_rad) + options.drift_noise**2 * abs(arc_m)
