"""From the bus's messages to what a page draws: small values for a packet's header, arrays for its body.

Each function raises ValueError when a message holds what the product's data cannot be.
"""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from thumper.board.messages import Telemetry
from thumper.common.geometry import FloatArray, Pose2
from thumper.dashboard.binary_packet import grid_png
from thumper.dashboard.pose_track import PoseTrack
from thumper.ros.codec import Message
from thumper.ros.from_ros import grid_of, pose_of, scan_of, stamp_ns_of, status_of, telemetry_of

INTEGRAL_STEPS_PER_PWM = 64.0
LOG_LEVELS = {10: "debug", 20: "info", 30: "warning", 40: "error", 50: "error"}  # rcl_interfaces/Log

Row = tuple[float, ...]


def stamped_pose(message: Message) -> tuple[float, Pose2]:
    """PoseWithCovarianceStamped as time [s] and pose."""
    return 1e-9 * stamp_ns_of(message), pose_of(message.pose.pose)


def triple(pose: Pose2) -> list[float]:
    """A pose for the header: x and y [m], heading [rad]."""
    return [round(pose.x_m, 4), round(pose.y_m, 4), round(pose.theta_rad, 5)]


def scan_points(message: Message, base_from_laser: Pose2, track: PoseTrack) -> FloatArray:
    """LaserScan's hits in the map, shape (n, 2) [m], each from where the robot was at its ray's time."""
    scan = scan_of(message)
    ranges_m = scan.ranges_m
    with np.errstate(invalid="ignore"):
        rays = np.flatnonzero((ranges_m >= scan.range_min_m) & (ranges_m <= scan.range_max_m))
    angles_rad = scan.angle_min_rad + rays * scan.angle_increment_rad
    hits_in_laser = ranges_m[rays, None] * np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
    times_s = np.asarray(scan.time_s + rays * scan.time_increment_s, dtype=np.float64)
    return track.in_map(base_from_laser.apply(hits_in_laser), times_s)


def grid(message: Message) -> tuple[dict[str, Any], bytes]:
    """OccupancyGrid: where it lies, and its cells as a PNG."""
    known = grid_of(message)
    rows, columns = known.cells.shape
    place = {
        "resolution_m": known.resolution_m,
        "origin": [known.origin_x_m, known.origin_y_m],
        "columns": columns,
        "rows": rows,
    }
    return place, grid_png(known.cells)


def wheel_row(message: Message) -> Row:
    """thumper_msgs/Wheels as a row of the charts: time [s], then of the left and the right side set-point and
    speed [rad/s], PWM, its integral part [PWM], current [A]."""
    sample = telemetry_of(message)
    t = sample.telemetry
    return (
        round(sample.time_s, 3),
        *_side(t.left_setpoint, t.left_speed, t.left_pwm, t.left_integral, t.left_current_mA),
        *_side(t.right_setpoint, t.right_speed, t.right_pwm, t.right_integral, t.right_current_mA),
    )


def board(message: Message) -> dict[str, Any]:
    """What else thumper_msgs/Wheels tells: battery, state and fault of the board."""
    t: Telemetry = telemetry_of(message).telemetry
    return {
        "battery_V": t.battery_mV / 1000.0,
        "battery_low": bool(t.warnings & 1),
        "state": t.state.name,
        "fault": t.fault.name,
        "counts": [t.left_count, t.right_count],
    }


def status(message: Message) -> dict[str, Any]:
    """thumper_msgs/Status as it is; None where it has no number, for JSON knows no NaN."""
    return {name: _plain(value) for name, value in asdict(status_of(message)).items() if name != "time_s"}


def event(message: Message) -> dict[str, Any]:
    """rcl_interfaces/Log as a line of the log."""
    return {
        "time_s": message.stamp.sec + 1e-9 * message.stamp.nanosec,
        "level": LOG_LEVELS.get(int(message.level), "info"),
        "text": str(message.msg),
    }


def _side(setpoint_mrad_s: int, speed_mrad_s: int, pwm: int, integral: int, current_mA: int) -> Row:
    return (
        setpoint_mrad_s / 1000.0,
        speed_mrad_s / 1000.0,
        float(pwm),
        round(integral / INTEGRAL_STEPS_PER_PWM, 2),
        current_mA / 1000.0,
    )


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(float(value), 4) if math.isfinite(value) else None
    return value
