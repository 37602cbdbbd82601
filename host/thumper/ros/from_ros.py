"""ROS 2 messages back to the product's data; whoever sent them, what comes out is checked for its shape.

Each function raises ValueError when the message holds what the data cannot be.
"""

import math
from dataclasses import fields

import numpy as np

from thumper.board.board import TelemetrySample
from thumper.board.messages import Fault, State, Telemetry
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.stamps import NS_PER_S, host_time_s
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.ros.codec import Message
from thumper.ros.status import Status

UNIT_TOLERANCE = 0.01  # of a quaternion's length


def stamp_ns_of(of: Message) -> int:
    """A message's header stamp [ns]."""
    stamp = of.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def scan_of(of: Message, epoch_ns: int = 0) -> Scan:
    """LaserScan to Scan."""
    if not of.ranges.size or not of.angle_increment or not math.isfinite(of.angle_min + of.angle_increment):
        raise ValueError("a scan without beams or without their directions")
    return Scan(
        time_s=host_time_s(stamp_ns_of(of), epoch_ns),
        ranges_m=of.ranges.astype(np.float64),
        angle_min_rad=of.angle_min,
        angle_increment_rad=of.angle_increment,
        time_increment_s=of.time_increment,
        range_min_m=of.range_min,
        range_max_m=of.range_max,
    )


def telemetry_of(of: Message, epoch_ns: int = 0) -> TelemetrySample:
    """thumper_msgs/Wheels to the telemetry that it was."""
    telemetry = Telemetry(
        time_us=of.time_us,
        left_count=of.left_count,
        left_speed=of.left_speed_mrad_s,
        left_setpoint=of.left_setpoint_mrad_s,
        left_pwm=of.left_pwm,
        left_integral=of.left_integral,
        right_count=of.right_count,
        right_speed=of.right_speed_mrad_s,
        right_setpoint=of.right_setpoint_mrad_s,
        right_pwm=of.right_pwm,
        right_integral=of.right_integral,
        lost_edges=of.lost_edges,
        battery_mV=of.battery_mv,
        left_current_mA=of.left_current_ma,
        right_current_mA=of.right_current_ma,
        state=State(of.state),
        fault=Fault(of.fault),
        warnings=of.warnings,
        rx_frames=of.rx_frames,
        rx_errors=of.rx_errors,
    )
    return TelemetrySample(time_s=host_time_s(stamp_ns_of(of), epoch_ns), telemetry=telemetry)


def pose_of(of: Message) -> Pose2:
    """geometry_msgs/Pose to the plane; one that is not finite or leaves the plane is refused."""
    return _planar(of.position, of.orientation)


def transform_of(of: Message) -> Pose2:
    """geometry_msgs/Transform to the plane; refused as `pose_of` does."""
    return _planar(of.translation, of.rotation)


def _planar(at: Message, q: Message) -> Pose2:
    if not all(map(math.isfinite, (at.x, at.y, at.z, q.x, q.y, q.z, q.w))):
        raise ValueError("a pose that is not finite")
    length = math.hypot(q.x, q.y, q.z, q.w)  # whose squares may be beyond any float
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise ValueError(f"an orientation of length {length:g}, not 1")
    yaw_rad = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    return Pose2(x_m=at.x, y_m=at.y, theta_rad=yaw_rad)


def twist_of(of: Message) -> Twist2:
    """geometry_msgs/Twist to what a robot on wheels can do; one that is not finite is refused."""
    if not (math.isfinite(of.linear.x) and math.isfinite(of.angular.z)):
        raise ValueError("a speed that is not finite")
    return Twist2(v_m_s=of.linear.x, w_rad_s=of.angular.z)


def path_of(of: Message) -> FloatArray:
    """Path to x, y, theta; shape (n, 3)."""
    poses = [pose_of(stamped.pose) for stamped in of.poses]
    return np.array([(p.x_m, p.y_m, p.theta_rad) for p in poses], dtype=np.float64).reshape(-1, 3)


def poses_of(of: Message) -> FloatArray:
    """PoseArray to x, y, theta; shape (n, 3)."""
    poses = [pose_of(pose) for pose in of.poses]
    return np.array([(p.x_m, p.y_m, p.theta_rad) for p in poses], dtype=np.float64).reshape(-1, 3)


def grid_of(of: Message) -> OccupancyGrid:
    """OccupancyGrid message to grid; one that lies askew is refused."""
    info = of.info
    origin = pose_of(info.origin)
    if origin.theta_rad != 0.0:
        raise ValueError("a grid that is turned against its frame")
    if of.data.size != info.width * info.height or not info.resolution > 0.0:
        raise ValueError(f"{of.data.size} cells for {info.width} x {info.height}")
    return OccupancyGrid(
        cells=of.data.astype(np.int8).reshape(info.height, info.width),
        resolution_m=_short(info.resolution),
        origin_x_m=origin.x_m,
        origin_y_m=origin.y_m,
    )


def status_of(of: Message, epoch_ns: int = 0) -> Status:
    """thumper_msgs/Status to Status."""
    content = {field.name: getattr(of, field.name) for field in fields(Status) if field.name != "time_s"}
    return Status(time_s=host_time_s(stamp_ns_of(of), epoch_ns), **content)


def _short(resolution: float) -> float:
    """The decimal number that a float32 was: 0.05 comes over as 0.0500000007."""
    return float(str(np.float32(resolution)))
