"""The velocity smoother keeps the acceleration limits."""

import pytest

from thumper.common.geometry import Twist2
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits


def test_smoother_keeps_the_acceleration_limits() -> None:
    limits, twist = SpeedLimits(), Twist2()
    for _ in range(30):
        after = smooth_velocity(Twist2(v_m_s=9.0, w_rad_s=-9.0), twist, limits, 0.1)
        assert after.v_m_s - twist.v_m_s <= limits.v_accel_m_s2 * 0.1 + 1e-12
        assert twist.w_rad_s - after.w_rad_s <= limits.w_accel_rad_s2 * 0.1 + 1e-12
        twist = after
    assert (twist.v_m_s, twist.w_rad_s) == (limits.v_max_m_s, -limits.w_max_rad_s)
    assert smooth_velocity(Twist2(v_m_s=0.001), Twist2(), limits, 0.1) == Twist2()


@pytest.mark.parametrize(("v_m_s", "w_rad_s"), [(0.0019, 0.0), (-0.0019, 0.0049), (0.0, -0.0049)])
def test_speeds_that_would_only_make_the_motors_hum_are_zero(v_m_s: float, w_rad_s: float) -> None:
    wanted = Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s)
    assert smooth_velocity(wanted, Twist2(), SpeedLimits(), 0.1) == Twist2()


@pytest.mark.parametrize("twist", [Twist2(v_m_s=0.0021), Twist2(w_rad_s=-0.0051), Twist2(v_m_s=-0.003)])
def test_slow_speeds_pass(twist: Twist2) -> None:
    assert smooth_velocity(twist, Twist2(), SpeedLimits(), 0.1) == twist
