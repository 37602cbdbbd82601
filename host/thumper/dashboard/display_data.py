"""Convert messages of the bus to what a page draws: values for a packet's header, arrays for its body.

Each function raises ValueError if a message holds invalid values.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from thumper.board.messages import State, Telemetry
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.dashboard.binary_packet import grid_png
from thumper.dashboard.map_image import grid_info
from thumper.dashboard.pose_history import PoseHistory
from thumper.gps.fix import FixStatus
from thumper.maps.annotations import annotations_of
from thumper.ros.codec import Message
from thumper.ros.from_ros import (
    fix_of,
    frame_of,
    grid_of,
    pose_of,
    roll_pitch_yaw_of,
    scan_of,
    stamp_ns_of,
    status_of,
    telemetry_of,
)
from thumper.ros.markers import objects_of

INTEGRAL_STEPS_PER_PWM = 64.0
LOG_LEVELS = {10: "debug", 20: "info", 30: "warning", 40: "error", 50: "error"}  # rcl_interfaces/Log

Row = tuple[float | None, ...]


def stamped_pose(message: Message) -> tuple[float, Pose2]:
    """Return time [s] and pose of a PoseWithCovarianceStamped."""
    return 1e-9 * stamp_ns_of(message), pose_of(message.pose.pose)


def pose_list(pose: Pose2) -> list[float]:
    """Return a pose for the header: x and y [m], heading [rad]."""
    return [round(pose.x_m, 4), round(pose.y_m, 4), round(pose.theta_rad, 5)]


def scan_points(message: Message, base_from_laser: Pose2, track: PoseHistory) -> FloatArray:
    """Return the hits of a LaserScan in the map, shape (n, 2) [m], corrected for the robot's motion."""
    scan = scan_of(message)
    ranges_m = scan.ranges_m
    with np.errstate(invalid="ignore"):
        rays = np.flatnonzero((ranges_m >= scan.range_min_m) & (ranges_m <= scan.range_max_m))
    angles_rad = scan.angle_min_rad + rays * scan.angle_increment_rad
    hits_in_laser = ranges_m[rays, None] * np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
    times_s = np.asarray(scan.time_s + rays * scan.time_increment_s, dtype=np.float64)
    return track.in_map(base_from_laser.apply(hits_in_laser), times_s)


def grid_data(message: Message) -> tuple[dict[str, Any], bytes]:
    """Return position and size of an OccupancyGrid, and its cells as a PNG."""
    grid = grid_of(message)
    return grid_info(grid), grid_png(grid.cells)


def wheel_row(message: Message) -> Row:
    """Return a thumper_msgs/Wheels as a row of the charts.

    Time [s], then for the left and the right side: set-point and speed [rad/s], PWM, the integral part of
    the PWM, current [A]. If the host sets the PWM, there is no set-point: None.
    """
    sample = telemetry_of(message)
    t = sample.telemetry
    has_setpoint = t.state is not State.MANUAL
    left, right = (t.left_setpoint, t.right_setpoint) if has_setpoint else (None, None)
    return (
        round(sample.time_s, 3),
        *_side(left, t.left_speed, t.left_pwm, t.left_integral, t.left_current_mA),
        *_side(right, t.right_speed, t.right_pwm, t.right_integral, t.right_current_mA),
    )


def open_loop_row(time_s: float, left: Sequence[int], right: Sequence[int]) -> Row:
    """Return a row of the charts, as `wheel_row`, of wheels whose PWM the host sets.

    `left` and `right` are speed [mrad/s], PWM and current [mA].
    """
    left_speed, left_pwm, left_mA = left
    right_speed, right_pwm, right_mA = right
    return (
        round(time_s, 3),
        *_side(None, left_speed, left_pwm, 0, left_mA),
        *_side(None, right_speed, right_pwm, 0, right_mA),
    )


def board(message: Message) -> dict[str, Any]:
    """Return battery, state, fault, counts and gyroscope of a thumper_msgs/Wheels."""
    t: Telemetry = telemetry_of(message).telemetry
    return {
        "battery_V": t.battery_mV / 1000.0,
        "battery_low": bool(t.warnings & 1),
        "state": t.state.name,
        "fault": t.fault.name,
        "counts": [t.left_count, t.right_count],
        "gyroscope": t.gyroscope.name,
        "gyro_heading_rad": _rounded(t.heading * 2.0 * math.pi / 65536.0),
    }


def status(message: Message) -> dict[str, Any]:
    """Return a thumper_msgs/Status as a dictionary, with None for NaN, which JSON does not have."""
    fields = asdict(status_of(message))
    return {name: _json_number(value) for name, value in fields.items() if name != "time_s"}


def imu(message: Message) -> dict[str, Any]:
    """Return turn rate [rad/s], roll and pitch [rad] and acceleration [m/s^2] of an Imu; None: not measured.

    As in ROS, the first element of a covariance is -1 if the device does not measure the quantity.
    """
    values: dict[str, Any] = {"yaw_rate_rad_s": _rounded(message.angular_velocity.z)}
    if message.orientation_covariance[0] >= 0.0:
        roll_rad, pitch_rad, _ = roll_pitch_yaw_of(message.orientation)
        values |= {"roll_rad": _rounded(roll_rad), "pitch_rad": _rounded(pitch_rad)}
    if message.linear_acceleration_covariance[0] >= 0.0:
        a = message.linear_acceleration
        values["acceleration_m_s2"] = [_rounded(a.x), _rounded(a.y), _rounded(a.z)]
    return values


def gps(message: Message) -> dict[str, Any]:
    """Return kind of fix, accuracy [m], latitude, longitude [degrees] and altitude [m] of a NavSatFix."""
    fix = fix_of(message)
    if fix.status is FixStatus.NONE:
        return {"fix": fix.status.text}
    return {
        "fix": fix.status.text,
        "std_m": _rounded(fix.std_m),
        "latitude_deg": round(fix.latitude_deg, 8),
        "longitude_deg": round(fix.longitude_deg, 8),
        "altitude_m": _rounded(fix.altitude_m),
    }


def gps_in_map(message: Message) -> list[float | None]:
    """Return x, y and the standard deviation [m] of a position by GPS, an Odometry."""
    at = message.pose.pose.position
    return [_rounded(at.x), _rounded(at.y), _rounded(math.sqrt(message.pose.covariance[0]))]


def camera(message: Message) -> tuple[dict[str, Any], bytes]:
    """Return time [s] and JPEG of a CompressedImage."""
    frame = frame_of(message)
    return {"time_s": round(frame.time_s, 3)}, frame.jpeg


def annotations(message: Message) -> dict[str, Any]:
    """Return zones and places, a std_msgs/String, as a GeoJSON FeatureCollection."""
    try:
        return annotations_of(json.loads(message.data)).to_geojson()
    except ThumperError as error:
        raise ValueError(str(error)) from error


def objects(message: Message) -> list[list[Any]]:
    """Return label, x and y [m] of each detected object, of a MarkerArray."""
    return [[label, _rounded(x_m), _rounded(y_m)] for label, x_m, y_m in objects_of(message)]


def event(message: Message) -> dict[str, Any]:
    """Return an rcl_interfaces/Log as a line of the log."""
    return {
        "time_s": message.stamp.sec + 1e-9 * message.stamp.nanosec,
        "level": LOG_LEVELS.get(int(message.level), "info"),
        "text": str(message.msg),
    }


def _side(setpoint_mrad_s: int | None, speed_mrad_s: int, pwm: int, integral: int, current_mA: int) -> Row:
    return (
        None if setpoint_mrad_s is None else setpoint_mrad_s / 1000.0,
        speed_mrad_s / 1000.0,
        float(pwm),
        round(integral / INTEGRAL_STEPS_PER_PWM, 2),
        current_mA / 1000.0,
    )


def _rounded(value: float) -> float | None:
    """Round for the header; None if it is not finite, which JSON does not have."""
    return round(float(value), 4) if math.isfinite(value) else None


def _json_number(value: Any) -> Any:
    return _rounded(value) if isinstance(value, float) else value
