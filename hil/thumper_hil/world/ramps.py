"""Ramps: rectangles of inclined floor. Gravity acts on the motors there, and the lidar pitches."""

import math

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.world.sills import WHEELS, axles_m


def climb_rad(pose: Pose2, ramps_m: FloatArray) -> float:
    """Return by how much the floor climbs from the rear to the front axle, positive with the front up.

    `ramps_m`, shape (n, 6), has rows x, y, length, width, yaw [deg], rise. A ramp rises along its length, and
    the floor at its upper end is level: while one axle is on it, the robot has a part of its slope.
    """
    line_m = axles_m(pose)
    return math.atan2(sum(_rise_m(line_m, ramp) for ramp in ramps_m), 2.0 * WHEELS.axle_m)


def _rise_m(line_m: FloatArray, ramp: FloatArray) -> float:
    """Return by how much the ramp rises under a line from the first to the second point, shape (2, 2)."""
    x_m, y_m, length_m, width_m, yaw_deg, rise_m = ramp
    middle = Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(yaw_deg))
    start_m, end_m = middle.inverse().apply(line_m)
    step_m = end_m - start_m
    enters, leaves = 0.0, 1.0  # shares of the line (Liang and Barsky 1984)
    for start, step, half in zip(start_m, step_m, (0.5 * length_m, 0.5 * width_m), strict=True):
        if step == 0.0:
            if abs(start) > half:
                return 0.0
            continue
        first, second = sorted(((-half - start) / step, (half - start) / step))
        enters, leaves = max(enters, first), min(leaves, second)
    return float(step_m[0] * max(leaves - enters, 0.0) * rise_m / length_m)
