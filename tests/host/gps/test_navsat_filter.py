"""The filter finds its heading, keeps to centimetres with RTK, rejects a jump, and starts again if lost."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.gps.fix import Fix, FixStatus
from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane
from thumper.gps.navsat_filter import NavsatFilter

DATUM = LatLon(48.2625, 11.6680)
PLANE = LocalPlane(DATUM)
ANTENNA = Pose2(x_m=-0.05)
STD_M = 0.01
SPEED_M_S, PERIOD_S = 0.5, 0.2
START = Pose2(x_m=3.0, y_m=-2.0, theta_rad=math.radians(100.0))  # of the odometry in the plane
TURN_RAD_S = 0.1


class Drive:
    """A circle of 5 m, with exact odometry and positions by RTK."""

    def __init__(self, seed: int = 1, std_m: float = STD_M) -> None:
        self.filter = NavsatFilter(ANTENNA, DATUM)
        self.odom = Pose2()
        self.time_s = 0.0
        self._std_m = std_m
        self._rng = np.random.default_rng(seed)

    def step(self, east_m: float = 0.0) -> bool:
        """Drive to the next fix, shifted by `east_m`; return whether the filter takes it."""
        step = Pose2(x_m=SPEED_M_S * PERIOD_S, theta_rad=TURN_RAD_S * PERIOD_S)
        self.odom @= step
        self.time_s += PERIOD_S
        self.filter.predict(self.odom, 0.0)
        antenna = self.truth @ ANTENNA
        noise_m = self._std_m * self._rng.standard_normal(2)
        seen = EastNorth(antenna.x_m + noise_m[0] + east_m, antenna.y_m + noise_m[1])
        place = PLANE.to_earth(seen)
        variance_m2 = self._std_m**2
        fix = Fix(
            time_s=self.time_s,
            status=FixStatus.RTK,
            latitude_deg=place.latitude_deg,
            longitude_deg=place.longitude_deg,
            variances_m2=(variance_m2, variance_m2, 4.0 * variance_m2),
        )
        return self.filter.correct(fix, self.odom) is not None

    def settle(self) -> None:
        for _ in range(100):
            self.step()

    @property
    def truth(self) -> Pose2:
        return START @ self.odom

    @property
    def error_m(self) -> float:
        at = self.filter.enu_from_base
        return math.inf if at is None else at.distance_m(self.truth)


@pytest.mark.parametrize(("std_m", "least_m", "most_m"), [(STD_M, 0.3, 0.5), (1.0, 9.0, 11.0)])
def test_it_starts_after_a_way_that_shows_the_heading(std_m: float, least_m: float, most_m: float) -> None:
    drive, distance_m = Drive(std_m=std_m), 0.0
    while drive.filter.enu_from_base is None:
        drive.step()
        distance_m += SPEED_M_S * PERIOD_S
        assert distance_m <= most_m
    assert distance_m >= least_m


def test_it_does_not_start_at_rest() -> None:
    drive = Drive()
    fix_of_rest = Fix(
        time_s=0.0,
        status=FixStatus.RTK,
        latitude_deg=DATUM.latitude_deg,
        longitude_deg=DATUM.longitude_deg,
        variances_m2=(1e-4, 1e-4, 4e-4),
    )
    for _ in range(100):
        drive.filter.correct(fix_of_rest, Pose2())
    assert drive.filter.enu_from_base is None
    assert drive.filter.std_m == math.inf


@pytest.mark.parametrize("seed", range(5))
def test_with_rtk_the_error_stays_below_5_cm(seed: int) -> None:
    drive = Drive(seed)
    drive.settle()
    for _ in range(300):
        drive.step()
        assert drive.error_m < 0.05
    at = drive.filter.enu_from_base
    assert at is not None
    assert math.remainder(at.theta_rad - drive.truth.theta_rad, math.tau) == pytest.approx(0.0, abs=0.05)
    assert drive.error_m < 4.0 * drive.filter.std_m
    assert drive.filter.rejected < 0.01 * drive.filter.fixes


def test_a_jump_of_5_m_is_rejected_and_moves_nothing() -> None:
    drive = Drive()
    drive.settle()
    rejected = drive.filter.rejected
    for _ in range(50):  # 10 s
        assert not drive.step(east_m=5.0)
        assert drive.error_m < 0.05
    assert drive.filter.rejected == rejected + 50
    assert drive.step()


def test_after_20_s_of_rejections_it_starts_again_where_the_positions_are() -> None:
    drive = Drive()
    drive.settle()
    lost_s = drive.time_s
    while drive.filter.enu_from_base is not None:
        drive.step(east_m=5.0)
    assert drive.time_s - lost_s == pytest.approx(20.0, abs=2.5 * PERIOD_S)
    for _ in range(100):
        drive.step(east_m=5.0)
    assert drive.error_m == pytest.approx(5.0, abs=0.05)


def test_one_good_position_ends_the_doubt() -> None:
    drive = Drive()
    drive.settle()
    for _ in range(3):
        for _ in range(75):  # 15 s
            drive.step(east_m=5.0)
        assert drive.step()
    assert drive.error_m < 0.05
