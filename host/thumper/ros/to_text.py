"""A message in one line for people: what it says, rounded and with units."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from thumper.board.messages import Telemetry
from thumper.common.geometry import FloatArray, Pose2
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.to_json import to_json

A_DATE_S = 1e8  # a stamp beyond is the date, one before it a simulation's time


def message_text(of: Message) -> str:
    """Return its time and what it says; of what is said nowhere else here, each field with its name."""
    say = _WORDS.get(of.__msgtype__, _fields)
    try:
        text = say(of)
    except ValueError:  # not as the robot would fill it in
        text = _fields(of)
    return f"{_when(of)}{text}"


def _when(of: Message) -> str:
    stamped = of.transforms[0].header if getattr(of, "transforms", None) else getattr(of, "header", of)
    stamp = getattr(stamped, "stamp", None)
    if stamp is None:
        return ""
    time_s = stamp.sec + 1e-9 * stamp.nanosec
    if time_s < A_DATE_S:
        return f"{time_s:.2f} s: "
    return f"{time.strftime('%H:%M:%S', time.localtime(time_s))}.{stamp.nanosec // 10_000_000:02d}: "


def _fields(of: Message) -> str:
    return ", ".join(_pairs("", to_json(of)))


def _pairs(prefix: str, value: Any) -> list[str]:
    if isinstance(value, dict):
        inside = f"{prefix}." if prefix else ""
        named = ((name, part) for name, part in value.items() if name not in ("header", "stamp"))
        return [pair for name, part in named for pair in _pairs(inside + name, part)]
    return [f"{prefix}: {value}"]


def _place(pose: Pose2) -> str:
    return f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, heading {math.degrees(pose.theta_rad):.1f} deg"


def _pose(of: Message) -> str:
    """PoseStamped."""
    return _place(from_ros.pose_of(of.pose))


def _pose_with_covariance(of: Message) -> str:
    sigma_x_m, sigma_y_m, sigma_rad = np.sqrt(np.asarray(of.pose.covariance)[[0, 7, 35]])
    known = f"; sigma {sigma_x_m:.3f} m, {sigma_y_m:.3f} m, {math.degrees(sigma_rad):.2f} deg"
    return _place(from_ros.pose_of(of.pose.pose)) + (known if sigma_x_m > 0.0 else "")


def _odometry(of: Message) -> str:
    return f"{_pose_with_covariance(of)}; {_speeds(of.twist.twist)}"


def _speeds(twist: Message) -> str:
    speeds = from_ros.twist_of(twist)
    return f"{speeds.v_m_s:.3f} m/s, {speeds.w_rad_s:.3f} rad/s"


def _transforms(of: Message) -> str:
    each = (
        f"{one.header.frame_id} -> {one.child_frame_id} {_place(from_ros.transform_of(one.transform))}"
        for one in of.transforms
    )
    return "; ".join(each)


def _scan(of: Message) -> str:
    scan = from_ros.scan_of(of)
    in_range = (scan.ranges_m >= scan.range_min_m) & (scan.ranges_m <= scan.range_max_m)
    seen = np.flatnonzero(in_range)
    text = f"{seen.size} of {scan.ranges_m.size} beams see something"
    if not seen.size:
        return text
    nearest = seen[np.argmin(scan.ranges_m[seen])]
    bearing_rad = scan.angle_min_rad + nearest * scan.angle_increment_rad
    return f"{text}, the nearest at {scan.ranges_m[nearest]:.3f} m, {math.degrees(bearing_rad):.0f} deg"


def _grid(of: Message) -> str:
    grid = from_ros.grid_of(of)
    rows, columns = grid.cells.shape
    return (
        f"{columns} x {rows} cells of {grid.resolution_m:g} m from x {grid.origin_x_m:.2f} m, "
        f"y {grid.origin_y_m:.2f} m; {np.mean(grid.cells >= 0):.0%} known"
    )


def _path(of: Message) -> str:
    path = from_ros.path_of(of)
    if not len(path):
        return "no points"
    length_m = float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())
    return f"{len(path)} points, {length_m:.2f} m to x {path[-1, 0]:.2f} m, y {path[-1, 1]:.2f} m"


def _particles(of: Message) -> str:
    poses = from_ros.poses_of(of)
    if not len(poses):
        return "none"
    mean: FloatArray = poses.mean(axis=0)
    spread: FloatArray = poses.std(axis=0)
    return (
        f"{len(poses)} round x {mean[0]:.2f} m, y {mean[1]:.2f} m, with a spread of {spread[0]:.3f} m, "
        f"{spread[1]:.3f} m"
    )


def _wheels(of: Message) -> str:
    t = from_ros.telemetry_of(of).telemetry
    fault = f", fault {t.fault.name.lower()}" if t.fault else ""
    return (
        f"{_side(t, 'left')}; {_side(t, 'right')}; {1e-3 * t.battery_mV:.2f} V; {t.state.name.lower()}{fault}"
    )


def _side(t: Telemetry, side: str) -> str:
    def of(name: str) -> int:
        return int(getattr(t, f"{side}_{name}"))

    return (
        f"{side} {1e-3 * of('speed'):.2f} of {1e-3 * of('setpoint'):.2f} rad/s, PWM {of('pwm')}, "
        f"{1e-3 * of('current_mA'):.2f} A"
    )


def _battery(of: Message) -> str:
    return f"{of.voltage:.2f} V, {abs(of.current):.2f} A drawn by the motors"


def _status(of: Message) -> str:
    why = f" ({of.reason})" if of.reason else ""
    goal = f", {of.distance_to_goal_m:.2f} m to go" if of.has_goal else ""
    fault = f", {of.fault_words}: {of.fault_cure}" if of.fault else ""
    return (
        f"{of.mode}{why}{goal}; board {of.board_state.lower()}{fault}; "
        f"loop {1e3 * of.loop_late_s:.1f} ms late, busy for {1e3 * of.loop_busy_s:.1f} ms"
    )


_WORDS: Mapping[str, Callable[[Message], str]] = {
    "geometry_msgs/msg/PoseArray": _particles,
    "geometry_msgs/msg/PoseStamped": _pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_with_covariance,
    "geometry_msgs/msg/TwistStamped": lambda of: _speeds(of.twist),
    "nav_msgs/msg/OccupancyGrid": _grid,
    "nav_msgs/msg/Odometry": _odometry,
    "nav_msgs/msg/Path": _path,
    "rcl_interfaces/msg/Log": lambda of: f"{of.name}: {of.msg}",
    "sensor_msgs/msg/BatteryState": _battery,
    "sensor_msgs/msg/LaserScan": _scan,
    "std_msgs/msg/Bool": lambda of: str(of.data).lower(),
    "std_msgs/msg/String": lambda of: str(of.data),
    "tf2_msgs/msg/TFMessage": _transforms,
    "thumper_msgs/msg/Status": _status,
    "thumper_msgs/msg/Wheels": _wheels,
}
