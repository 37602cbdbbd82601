"""The last stretch to the dock, by the tag: follow the axis of the dock at low speed, stop at its end. Pure.

The path law is that of Kanayama et al. 1990, eq. 8, with both gains scaled by the speed, so that the path
over the ground does not depend on it: critically damped in the distance driven.
"""

import math
from collections.abc import Callable

from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.speed_limits import SpeedLimits
from thumper.runtime.drive.motions import Axis, Motion, MotionEnd
from thumper.runtime.state_estimator import RobotState

GAIN_PER_M = 7.0  # the distance from the axis fades as (1 + 7 s) exp(-7 s), s the way in metres
HEADING_ONLY_M = 0.2  # from here on the heading counts more and more, so that the robot ends straight
MAX_OFFSET_M = 0.06  # counted of the distance from the axis: beyond it the camera would lose the tag
SLOWEST_M_S = 0.03
STILL_M_S, TOLERANCE_M = 0.005, 0.003
LOST_S = 1.0


def approach(
    docked_from_base: Callable[[], Pose2 | None],
    tag_age_s: Callable[[], float],
    *,
    speed_m_s: float,
    limits: SpeedLimits,
) -> Motion:
    """Return the motion to the origin of `docked_from_base`, along its x axis.

    `tag_age_s` is the time since the tag was seen last.
    """
    axis = Axis(
        speed=speed_m_s,
        accel=min(limits.v_accel_m_s2, 0.1),
        slowest=min(SLOWEST_M_S, speed_m_s),
        latency_s=limits.latency_s,
        still=STILL_M_S,
        tolerance=TOLERANCE_M,
    )

    def next_command(state: RobotState) -> Twist2 | MotionEnd:
        at = docked_from_base()
        if at is None or tag_age_s() > LOST_S:
            return MotionEnd(done=False, reason="lost sight of the dock's tag")
        v_m_s = axis.next_speed(-at.x_m, state.twist.v_m_s)
        if v_m_s is None:
            return MotionEnd(done=True, reason="at the dock")
        offset_m = math.copysign(min(abs(at.y_m), MAX_OFFSET_M), at.y_m)
        fading = min(1.0, abs(at.x_m) / HEADING_ONLY_M)
        offset_gain = fading * math.copysign(GAIN_PER_M**2, v_m_s)
        heading_gain = (3.0 - fading) * GAIN_PER_M
        w_rad_s = abs(v_m_s) * (-heading_gain * at.theta_rad - offset_gain * offset_m)
        return Twist2(v_m_s=v_m_s, w_rad_s=min(max(w_rad_s, -limits.w_max_rad_s), limits.w_max_rad_s))

    return next_command
