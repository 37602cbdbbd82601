"""Manual driving: from the stick to motor PWM."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.config.manual_drive import ManualDriveOptions
from thumper.runtime.drive.manual_pwm import PWM_MAX, FeedForward, manual_pwm

DRIVE = DriveGeometry()
FEEL = FeedForward(ks_pwm=19.3, kv_pwm_s=17.12)
WHEEL_MAX_RAD_S = 13.0


def pwm(v_m_s: float, w_rad_s: float, *, feel: FeedForward = FEEL, battery_V: float = 7.4) -> tuple[int, int]:
    twist = Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s)
    return manual_pwm(twist, DRIVE, ManualDriveOptions(), WHEEL_MAX_RAD_S, feel, battery_V)


def test_straight_driving_uses_the_feed_forward_of_the_board() -> None:
    """u = ks + kv omega at 7.4 V."""
    expected = round(19.3 + 17.12 * 0.3 / DRIVE.wheel_radius_m)
    assert pwm(0.3, 0.0) == (expected, expected)


def test_zero_speed_is_zero_pwm() -> None:
    assert pwm(0.0, 0.0) == (0, 0)


def test_rotation_in_place_is_antisymmetric() -> None:
    left, right = pwm(0.0, 1.0)
    assert left == -right < 0


def test_a_lower_battery_voltage_gets_more_pwm() -> None:
    assert pwm(0.3, 0.0, battery_V=6.6)[0] > pwm(0.3, 0.0)[0]


def test_an_unmeasured_battery_counts_as_full() -> None:
    assert pwm(0.3, 0.0, battery_V=0.0) == pwm(0.3, 0.0)


def test_without_feed_forward_the_maximum_speed_is_full_pwm() -> None:
    bare = FeedForward(ks_pwm=0.0, kv_pwm_s=0.0)
    v_m_s = 0.5 * WHEEL_MAX_RAD_S * DRIVE.wheel_radius_m
    assert pwm(v_m_s, 0.0, feel=bare)[0] == pytest.approx(PWM_MAX / 2, abs=1)


@given(v_m_s=st.floats(-5, 5), w_rad_s=st.floats(-20, 20), battery_V=st.floats(0, 9))
def test_pwm_is_limited_and_the_curvature_stays(v_m_s: float, w_rad_s: float, battery_V: float) -> None:
    left, right = pwm(v_m_s, w_rad_s, battery_V=battery_V)
    assert max(abs(left), abs(right)) <= PWM_MAX
    if min(abs(left), abs(right)) > 60:  # clear of friction, whose share is no speed
        volts = 7.4 / battery_V if battery_V > 5.0 else 1.0

        def speed(value: int) -> float:
            return (value / volts - math.copysign(FEEL.ks_pwm, value)) / FEEL.kv_pwm_s

        half = 0.5 * w_rad_s * DRIVE.track_m
        assert speed(left) * (v_m_s + half) == pytest.approx(speed(right) * (v_m_s - half), abs=0.6)


def test_low_battery_slows_both_sides_alike() -> None:
    """Computed: 7.4 V / 6 V; the motors reach (255 / 1.233 - 19.3) / 17.12 = 10.95 rad/s."""
    left, right = pwm(0.8, 1.0, battery_V=6.0)
    half = 0.5 * DRIVE.track_m
    left_rad_s = 10.95 * (0.8 - half) / (0.8 + half)
    assert right == PWM_MAX == 255
    assert left == pytest.approx(7.4 / 6.0 * (19.3 + 17.12 * left_rad_s), abs=1.0)


def test_battery_below_five_volts_is_not_believed() -> None:
    assert pwm(0.3, 0.0, battery_V=5.0) == pwm(0.3, 0.0)
    assert pwm(0.3, 0.0, battery_V=5.1) > pwm(0.3, 0.0)


def test_motor_without_any_reserve_still_turns() -> None:
    """Friction alone takes more than the full PWM: the least speed is 0.1 rad/s, not zero or negative."""
    heavy = FeedForward(ks_pwm=250.0, kv_pwm_s=100.0)
    assert pwm(0.8, 0.0, feel=heavy) == (PWM_MAX, PWM_MAX)
    assert pwm(0.8, 2.0, feel=heavy)[0] > 250


def test_tiny_speeds_stay_tiny() -> None:
    assert pwm(1e-6, 0.0) == (19, 19)
