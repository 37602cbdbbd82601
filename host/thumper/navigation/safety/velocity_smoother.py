"""The velocity smoother: no command changes the speed faster than the acceleration limits allow."""

from thumper.common.geometry import Twist2
from thumper.navigation.speed_limits import SpeedLimits, step_toward

DEADBAND_M_S, DEADBAND_RAD_S = 0.002, 0.005  # below this the motors would only hum


def smooth_velocity(wanted: Twist2, last: Twist2, limits: SpeedLimits, period_s: float) -> Twist2:
    """Return the twist nearest to the wanted one that can follow `last` after one period."""
    v_m_s = step_toward(last.v_m_s, wanted.v_m_s, limits.v_accel_m_s2 * period_s)
    w_rad_s = step_toward(last.w_rad_s, wanted.w_rad_s, limits.w_accel_rad_s2 * period_s)
    v_m_s = min(max(v_m_s, -limits.v_max_m_s), limits.v_max_m_s)
    w_rad_s = min(max(w_rad_s, -limits.w_max_rad_s), limits.w_max_rad_s)
    return Twist2(
        v_m_s=0.0 if abs(v_m_s) < DEADBAND_M_S else v_m_s,
        w_rad_s=0.0 if abs(w_rad_s) < DEADBAND_RAD_S else w_rad_s,
    )
