"""Format a message as one line of text, rounded and with units."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from thumper.board.fault_texts import FAULT_NAMES, STATE_NAMES
from thumper.board.messages import Telemetry
from thumper.camera.frame import jpeg_shape
from thumper.common.geometry import FloatArray, Pose2
from thumper.gps.fix import FixStatus
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.to_json import to_json
from thumper.ros.to_ros import UNKNOWN

EARLIEST_DATE_S = 1e8  # later stamps are date and time, earlier ones simulated time


def message_text(msg: Message) -> str:
    """Return the message's time and content; a type without a formatter is listed field by field."""
    formatter = _FORMATTERS.get(msg.__msgtype__, _fields)
    try:
        text = formatter(msg)
    except ValueError:  # not filled in as the robot does
        text = _fields(msg)
    return f"{_when(msg)}{text}"


def _when(msg: Message) -> str:
    stamped = msg.transforms[0].header if getattr(msg, "transforms", None) else getattr(msg, "header", msg)
    stamp = getattr(stamped, "stamp", None)
    if stamp is None:
        return ""
    time_s = stamp.sec + 1e-9 * stamp.nanosec
    if time_s < EARLIEST_DATE_S:
        return f"{time_s:z.2f} s: "
    return f"{time.strftime('%H:%M:%S', time.localtime(time_s))}.{stamp.nanosec // 10_000_000:02d}: "


def _fields(msg: Message) -> str:
    return ", ".join(_pairs("", to_json(msg)))


def _pairs(prefix: str, value: Any) -> list[str]:
    if isinstance(value, dict):
        inside = f"{prefix}." if prefix else ""
        named = ((name, part) for name, part in value.items() if name not in ("header", "stamp"))
        return [pair for name, part in named for pair in _pairs(inside + name, part)]
    return [f"{prefix}: {value}"]


def _pose_text(pose: Pose2) -> str:
    return f"x {pose.x_m:z.3f} m, y {pose.y_m:z.3f} m, heading {math.degrees(pose.theta_rad):z.1f} deg"


def _pose(msg: Message) -> str:
    """Format a PoseStamped."""
    return _pose_text(from_ros.pose_of(msg.pose))


def _pose_with_covariance(msg: Message) -> str:
    sigma_x_m, sigma_y_m, sigma_rad = np.sqrt(np.asarray(msg.pose.covariance)[[0, 7, 35]])
    deviation = f"; sigma {sigma_x_m:z.3f} m, {sigma_y_m:z.3f} m, {math.degrees(sigma_rad):z.2f} deg"
    return _pose_text(from_ros.pose_of(msg.pose.pose)) + (deviation if sigma_x_m > 0.0 else "")


def _odometry(msg: Message) -> str:
    """Format an Odometry; one of a GPS has neither heading nor speeds."""
    if msg.pose.covariance[35] >= UNKNOWN:
        at, std_m = msg.pose.pose.position, math.sqrt(msg.pose.covariance[0])
        return f"x {at.x:z.3f} m, y {at.y:z.3f} m; sigma {std_m:z.3f} m"
    return f"{_pose_with_covariance(msg)}; {_speeds(msg.twist.twist)}"


def _speeds(twist: Message) -> str:
    speeds = from_ros.twist_of(twist)
    return f"{speeds.v_m_s:z.3f} m/s, {speeds.w_rad_s:z.3f} rad/s"


def _transforms(msg: Message) -> str:
    return "; ".join(
        f"{stamped.header.frame_id} -> {stamped.child_frame_id} "
        f"{_pose_text(from_ros.transform_of(stamped.transform))}"
        for stamped in msg.transforms
    )


def _imu(msg: Message) -> str:
    """Format an Imu; as in ROS, a covariance that begins with -1 marks what is not measured."""
    parts = [f"turn {msg.angular_velocity.z:z.3f} rad/s"]
    if msg.orientation_covariance[0] >= 0.0:
        roll_deg, pitch_deg, yaw_deg = map(math.degrees, from_ros.roll_pitch_yaw_of(msg.orientation))
        parts.append(f"roll {roll_deg:z.1f} deg, pitch {pitch_deg:z.1f} deg, yaw {yaw_deg:z.1f} deg")
    if msg.linear_acceleration_covariance[0] >= 0.0:
        a = msg.linear_acceleration
        parts.append(f"acceleration {a.x:z.2f}, {a.y:z.2f}, {a.z:z.2f} m/s^2")
    return "; ".join(parts)


def _image(msg: Message) -> str:
    """Format a CompressedImage by its size, never by its bytes."""
    text = f"{msg.format}, {1e-3 * msg.data.size:z.1f} kB"
    try:
        height, width = jpeg_shape(from_ros.frame_of(msg).jpeg)
    except ValueError as error:
        return f"{text}; {error}"
    return f"{width} x {height} pixels, {text}"


def _fix(msg: Message) -> str:
    fix = from_ros.fix_of(msg)
    if fix.status is FixStatus.NONE:
        return fix.status.text
    place = f"{fix.latitude_deg:z.7f}, {fix.longitude_deg:z.7f} deg"
    return f"{place}; {fix.status.text}, sigma {fix.std_m:z.2f} m"


def _markers(msg: Message) -> str:
    """List the labels of a MarkerArray."""
    labels = [marker for marker in msg.markers if marker.text]
    return ", ".join(_label(label.text, label.pose.position) for label in labels) or "none"


def _label(text: str, at: Message) -> str:
    return f"{text} ({at.x:z.2f}, {at.y:z.2f})"


def _scan(msg: Message) -> str:
    scan = from_ros.scan_of(msg)
    in_range = (scan.ranges_m >= scan.range_min_m) & (scan.ranges_m <= scan.range_max_m)
    hits = np.flatnonzero(in_range)
    text = f"{hits.size} of {scan.ranges_m.size} beams hit"
    if not hits.size:
        return text
    nearest = hits[np.argmin(scan.ranges_m[hits])]
    bearing_rad = scan.angle_min_rad + nearest * scan.angle_increment_rad
    return f"{text}, nearest at {scan.ranges_m[nearest]:z.3f} m, {math.degrees(bearing_rad):z.0f} deg"


def _grid(msg: Message) -> str:
    grid = from_ros.grid_of(msg)
    rows, columns = grid.cells.shape
    return (
        f"{columns} x {rows} cells of {grid.resolution_m:g} m from x {grid.origin_x_m:z.2f} m, "
        f"y {grid.origin_y_m:z.2f} m; {np.mean(grid.cells >= 0):.0%} known"
    )


def _path(msg: Message) -> str:
    path = from_ros.path_of(msg)
    if not len(path):
        return "no points"
    length_m = float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())
    return f"{len(path)} points, {length_m:z.2f} m to x {path[-1, 0]:z.2f} m, y {path[-1, 1]:z.2f} m"


def _particles(msg: Message) -> str:
    poses = from_ros.poses_of(msg)
    if not len(poses):
        return "none"
    mean: FloatArray = poses.mean(axis=0)
    std: FloatArray = poses.std(axis=0)
    return (
        f"{len(poses)} around x {mean[0]:z.2f} m, y {mean[1]:z.2f} m; "
        f"standard deviation {std[0]:z.3f} m, {std[1]:z.3f} m"
    )


def _wheels(msg: Message) -> str:
    t = from_ros.telemetry_of(msg).telemetry
    fault = f": {FAULT_NAMES[t.fault]}" if t.fault else ""
    sides = f"{_side(t, 'left')}; {_side(t, 'right')}"
    return f"{sides}; {1e-3 * t.battery_mV:.2f} V; {t.state.name.lower()}{fault}"


def _side(t: Telemetry, side: str) -> str:
    def field(name: str) -> int:
        return int(getattr(t, f"{side}_{name}"))

    return (
        f"{side} {1e-3 * field('speed'):z.2f} of {1e-3 * field('setpoint'):z.2f} rad/s, PWM {field('pwm')}, "
        f"{1e-3 * field('current_mA'):z.2f} A"
    )


def _battery(msg: Message) -> str:
    return f"{msg.voltage:z.2f} V, {abs(msg.current):z.2f} A drawn by the motors"


def mode_word(status: Message) -> str:
    """Return what the robot does; an idle robot with a latched fault is not ready."""
    return "fault" if status.fault and status.mode == "idle" else str(status.mode)


def _status(msg: Message) -> str:
    reason = f" ({msg.reason})" if msg.reason else ""
    goal = f", {msg.distance_to_goal_m:z.2f} m to go" if msg.has_goal else ""
    fault = f", {msg.fault_words}: {msg.fault_cure}" if msg.fault else ""
    return (
        f"{mode_word(msg)}{reason}{goal}; board {STATE_NAMES.get(msg.board_state, 'silent')}{fault}; "
        f"loop {1e3 * msg.loop_late_s:z.1f} ms late, busy for {1e3 * msg.loop_busy_s:z.1f} ms"
    )


_FORMATTERS: Mapping[str, Callable[[Message], str]] = {
    "geometry_msgs/msg/PoseArray": _particles,
    "geometry_msgs/msg/PoseStamped": _pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_with_covariance,
    "geometry_msgs/msg/TwistStamped": lambda msg: _speeds(msg.twist),
    "nav_msgs/msg/OccupancyGrid": _grid,
    "nav_msgs/msg/Odometry": _odometry,
    "nav_msgs/msg/Path": _path,
    "rcl_interfaces/msg/Log": lambda msg: f"{msg.name}: {msg.msg}",
    "sensor_msgs/msg/BatteryState": _battery,
    "sensor_msgs/msg/CompressedImage": _image,
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/LaserScan": _scan,
    "sensor_msgs/msg/NavSatFix": _fix,
    "std_msgs/msg/Bool": lambda msg: str(msg.data).lower(),
    "std_msgs/msg/String": lambda msg: str(msg.data),
    "tf2_msgs/msg/TFMessage": _transforms,
    "thumper_msgs/msg/Status": _status,
    "thumper_msgs/msg/Wheels": _wheels,
    "visualization_msgs/msg/MarkerArray": _markers,
}
