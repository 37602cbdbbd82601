"""Fuse GPS positions with odometry in an extended Kalman filter: the robot's pose in the plane of a datum.

State: x (east), y (north) and heading from east. Odometry predicts, and each position of the antenna
corrects. A GPS shows no heading, so the filter starts once the robot has driven far enough to align its track
with that of the GPS. Positions that do not fit (chi-square test of the innovation, Bar-Shalom et al.,
Estimation with Applications to Tracking and Navigation, 5.4) are rejected, because a reflected signal shifts
them by metres.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.gps.alignment import Alignment
from thumper.gps.fix import RTK_FIXED_STD_M, Fix, FixStatus
from thumper.gps.local_plane import MAX_DISTANCE_M, EastNorth, LatLon, LocalPlane

START_STD_RAD = 0.2
# Positions closer in time share most of their error, so together they weigh as one: minutes for reflections
# and the atmosphere, which RTK removes.
CORRELATION_S, RTK_CORRELATION_S = 60.0, 1.0
GATE = 13.8  # chi-square with 2 degrees of freedom: 0.1 % of the true positions are above
LOST_S = 20.0  # after rejecting everything for so long, the filter is wrong and not the GPS
NOISE_PER_M = 0.02**2  # of the odometry, variance per metre along and across [m^2/m]
TURN_NOISE_PER_M = 0.01**2  # [rad^2/m], in addition to what the odometry reports
FAR_M = 0.5 * MAX_DISTANCE_M  # from the datum: no robot drives there
MIN_STD_M = 0.01  # of a position: receivers report less than 1 cm


class NavsatFilter:
    """Call `predict` with each odometry pose, and `correct` with each fix."""

    def __init__(self, base_from_antenna: Pose2, datum: LatLon | None = None) -> None:
        """Without a `datum`, the first position becomes it; the next one, if that was far from here."""
        self._base_from_antenna = base_from_antenna
        self._has_fixed_datum = datum is not None
        self.plane = None if datum is None else LocalPlane(datum)
        self._alignment = Alignment()  # of the odometry
        self._odom_from_base = Pose2()
        self._odom_var_rad2 = 0.0
        self._state: Pose2 | None = None
        self.covariance: FloatArray = np.zeros((3, 3))
        self._used_s = -math.inf
        self._rejected_since_s = math.inf
        self.fixes, self.rejected = 0, 0  # with a position; of them, those that did not fit

    @property
    def enu_from_base(self) -> Pose2 | None:
        """The robot's pose: x east, y north; None until it has driven far enough to know its heading."""
        return self._state

    @property
    def enu_from_odom(self) -> Pose2 | None:
        """The transform from the odometry's frame; None as long as there is no pose."""
        return None if self._state is None else self._state @ self._odom_from_base.inverse()

    @property
    def std_m(self) -> float:
        """Standard deviation of the position along its worst direction [m]; infinite without a pose."""
        if self._state is None:
            return math.inf
        return math.sqrt(max(0.0, float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1])))

    def predict(self, odom_from_base: Pose2, heading_var_rad2: float) -> None:
        """Move by the odometry; `heading_var_rad2` is the variance of its heading so far."""
        step = self._odom_from_base.inverse() @ odom_from_base
        turn_var = max(heading_var_rad2 - self._odom_var_rad2, 0.0)
        self._odom_from_base, self._odom_var_rad2 = odom_from_base, heading_var_rad2
        if self._state is None:
            return
        before, self._state = self._state, self._state @ step
        jacobian = np.eye(3)
        jacobian[0, 2] = -(self._state.y_m - before.y_m)
        jacobian[1, 2] = self._state.x_m - before.x_m
        distance_m = math.hypot(step.x_m, step.y_m)
        position_var = NOISE_PER_M * distance_m
        noise = np.diag([position_var, position_var, turn_var + TURN_NOISE_PER_M * distance_m])
        self.covariance = jacobian @ self.covariance @ jacobian.T + noise

    def correct(self, fix: Fix, odom_at_fix: Pose2) -> EastNorth | None:
        """Add a fix, with the odometry at its time; return its position, None if rejected or without one."""
        if fix.status is FixStatus.NONE or not np.isfinite(fix.variances_m2[:2]).all():
            return None
        place = LatLon(fix.latitude_deg, fix.longitude_deg)
        if self.plane is None:
            self.plane = LocalPlane(place)
        seen, variance_m2 = self.plane.to_plane(place), max(fix.std_m, MIN_STD_M) ** 2
        self.fixes += 1
        if self._state is None and math.hypot(*seen) > FAR_M:
            self.rejected += 1
            if not self._has_fixed_datum:
                self.plane, self._alignment = None, Alignment()
            return None
        if self._state is None:
            self._align(fix.time_s, odom_at_fix, seen, variance_m2)
            return seen
        return seen if self._fuse(fix.time_s, odom_at_fix, seen, variance_m2) else None

    def _align(self, time_s: float, odom_at_fix: Pose2, seen: EastNorth, variance_m2: float) -> None:
        """Collect positions until they show the heading."""
        self._alignment.add(time_s, odom_at_fix @ self._base_from_antenna, seen, variance_m2)
        std_rad = self._alignment.std_rad
        if std_rad > START_STD_RAD:
            return
        self._state = self._alignment.enu_from_frame() @ self._odom_from_base
        std_m = self._alignment.std_m(self._odom_from_base)
        self.covariance = np.diag([std_m**2, std_m**2, std_rad**2])
        self._used_s, self._rejected_since_s = time_s, math.inf

    def _fuse(self, time_s: float, odom_at_fix: Pose2, seen: EastNorth, variance_m2: float) -> bool:
        """Correct the state; return False if the position is rejected."""
        assert self._state is not None
        antenna = self._odom_from_base.inverse() @ odom_at_fix @ self._base_from_antenna
        expected = self._state @ antenna
        jacobian = np.eye(2, 3)
        jacobian[0, 2] = -(expected.y_m - self._state.y_m)
        jacobian[1, 2] = expected.x_m - self._state.x_m
        innovation = np.array([seen.east_m - expected.x_m, seen.north_m - expected.y_m])
        spread = jacobian @ self.covariance @ jacobian.T
        distance = innovation @ np.linalg.solve(spread + variance_m2 * np.eye(2), innovation)
        if distance > GATE:
            self.rejected += 1
            self._rejected_since_s = min(self._rejected_since_s, time_s)
            if time_s - self._rejected_since_s > LOST_S:
                self._state, self._alignment = None, Alignment()
            return False
        self._rejected_since_s = math.inf
        correlation_s = RTK_CORRELATION_S if variance_m2 < RTK_FIXED_STD_M**2 else CORRELATION_S
        share = min(1.0, max(time_s - self._used_s, 0.0) / correlation_s)
        self._used_s = time_s
        if share > 0.0:
            noise = variance_m2 / share * np.eye(2)
            gain = np.linalg.solve(spread + noise, jacobian @ self.covariance).T
            change = gain @ innovation
            self.covariance -= gain @ jacobian @ self.covariance
            self._state = Pose2(
                x_m=self._state.x_m + float(change[0]),
                y_m=self._state.y_m + float(change[1]),
                theta_rad=wrap_angle(self._state.theta_rad + float(change[2])),
            )
        return True
