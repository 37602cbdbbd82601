"""Convert ROS 2 messages, of any origin, to the package's data types.

Each function raises ValueError if the message holds values that the type cannot.
"""

import math
from dataclasses import fields, replace

import numpy as np

from thumper.board.board import TelemetrySample
from thumper.board.messages import Fault, GyroscopeState, State, Telemetry
from thumper.camera.frame import CameraFrame
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.stamps import NS_PER_S, host_time_s
from thumper.gps.fix import RTK_FIXED_STD_M, Fix, FixStatus
from thumper.imu.sample import ImuSample
from thumper.lidar.scan import Scan
from thumper.maps.cell_changes import CellBox
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid
from thumper.ros.codec import Message
from thumper.ros.status import Status

UNIT_TOLERANCE = 0.01  # of a quaternion's length


def stamp_ns_of(msg: Message) -> int:
    """Return a message's header stamp [ns]."""
    return time_ns_of(msg.header.stamp)


def time_ns_of(msg: Message) -> int:
    """Convert a builtin_interfaces/Time [ns]."""
    return int(msg.sec) * NS_PER_S + int(msg.nanosec)


def scan_of(msg: Message, epoch_ns: int = 0) -> Scan:
    """Convert a LaserScan."""
    if (
        not msg.ranges.size
        or not msg.angle_increment
        or not math.isfinite(msg.angle_min + msg.angle_increment)
    ):
        raise ValueError("the scan has no beams, or no valid beam angles")
    return Scan(
        time_s=host_time_s(stamp_ns_of(msg), epoch_ns),
        ranges_m=msg.ranges.astype(np.float64),
        angle_min_rad=msg.angle_min,
        angle_increment_rad=msg.angle_increment,
        time_increment_s=msg.time_increment,
        range_min_m=msg.range_min,
        range_max_m=msg.range_max,
    )


def telemetry_of(msg: Message, epoch_ns: int = 0) -> TelemetrySample:
    """Convert thumper_msgs/Wheels back to the board's telemetry."""
    telemetry = Telemetry(
        time_us=msg.time_us,
        left_count=msg.left_count,
        left_speed=msg.left_speed_mrad_s,
        left_setpoint=msg.left_setpoint_mrad_s,
        left_pwm=msg.left_pwm,
        left_integral=msg.left_integral,
        right_count=msg.right_count,
        right_speed=msg.right_speed_mrad_s,
        right_setpoint=msg.right_setpoint_mrad_s,
        right_pwm=msg.right_pwm,
        right_integral=msg.right_integral,
        lost_edges=msg.lost_edges,
        battery_mV=msg.battery_mv,
        left_current_mA=msg.left_current_ma,
        right_current_mA=msg.right_current_ma,
        state=State(msg.state),
        fault=Fault(msg.fault),
        warnings=msg.warnings,
        rx_frames=msg.rx_frames,
        rx_errors=msg.rx_errors,
        # Recordings of 0.2.0 have none of these.
        tx_dropped=getattr(msg, "tx_dropped", 0),
        heading=getattr(msg, "gyro_heading", 0),
        gyroscope=GyroscopeState(getattr(msg, "gyroscope", GyroscopeState.OFF)),
    )
    return TelemetrySample(time_s=host_time_s(stamp_ns_of(msg), epoch_ns), telemetry=telemetry)


def imu_of(msg: Message, epoch_ns: int = 0) -> ImuSample:
    """Convert an Imu: its rate about z."""
    rate_rad_s = float(msg.angular_velocity.z)
    if not math.isfinite(rate_rad_s) or msg.angular_velocity_covariance[0] < 0.0:
        raise ValueError("the message has no turn rate")
    return ImuSample(time_s=host_time_s(stamp_ns_of(msg), epoch_ns), yaw_rate_rad_s=rate_rad_s)


def fix_of(msg: Message, epoch_ns: int = 0) -> Fix:
    """Convert a NavSatFix; an unknown status raises ValueError.

    Its status is the same for RTK float and RTK fixed, so the accuracy decides.
    """
    covariance = msg.position_covariance
    if msg.status.status > FixStatus.RTK:
        raise ValueError(f"{msg.status.status} is not a status of a fix")
    fix = Fix(
        time_s=host_time_s(stamp_ns_of(msg), epoch_ns),
        status=FixStatus(msg.status.status),
        latitude_deg=float(msg.latitude),
        longitude_deg=float(msg.longitude),
        altitude_m=float(msg.altitude),
        variances_m2=(float(covariance[0]), float(covariance[4]), float(covariance[8])),
    )
    is_float = fix.status is FixStatus.RTK and fix.std_m >= RTK_FIXED_STD_M
    return replace(fix, status=FixStatus.RTK_FLOAT) if is_float else fix


def frame_of(msg: Message, epoch_ns: int = 0) -> CameraFrame:
    """Convert a CompressedImage; any other format than JPEG raises ValueError."""
    if "jp" not in msg.format:
        raise ValueError(f"an image of format {msg.format!r}")
    return CameraFrame(time_s=host_time_s(stamp_ns_of(msg), epoch_ns), jpeg=msg.data.tobytes())


def pose_of(msg: Message) -> Pose2:
    """Convert a geometry_msgs/Pose to x, y and yaw; refuse values that are not finite or not a rotation."""
    return _planar(msg.position, msg.orientation)


def transform_of(msg: Message) -> Pose2:
    """Convert a geometry_msgs/Transform to x, y and yaw; refuse what `pose_of` refuses."""
    return _planar(msg.translation, msg.rotation)


def _planar(position: Message, q: Message) -> Pose2:
    if not all(map(math.isfinite, (position.x, position.y, position.z, q.x, q.y, q.z, q.w))):
        raise ValueError("the pose is not finite")
    length = math.hypot(q.x, q.y, q.z, q.w)  # unlike the sum of squares it does not overflow
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise ValueError(f"the orientation has length {length:g} instead of 1")
    return Pose2(x_m=position.x, y_m=position.y, theta_rad=roll_pitch_yaw_of(q)[2])


def roll_pitch_yaw_of(q: Message) -> tuple[float, float, float]:
    """Convert a geometry_msgs/Quaternion to the angles of turns about z, then y, then x [rad]."""
    roll_rad = math.atan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x**2 + q.y**2))
    pitch_rad = math.asin(max(-1.0, min(1.0, 2.0 * (q.w * q.y - q.z * q.x))))
    yaw_rad = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    return roll_rad, pitch_rad, yaw_rad


def twist_of(msg: Message) -> Twist2:
    """Convert a geometry_msgs/Twist to forward and turning speed; refuse values that are not finite."""
    if not (math.isfinite(msg.linear.x) and math.isfinite(msg.angular.z)):
        raise ValueError("the speed is not finite")
    return Twist2(v_m_s=msg.linear.x, w_rad_s=msg.angular.z)


def path_of(msg: Message) -> FloatArray:
    """Convert a Path to x, y, theta; shape (n, 3)."""
    poses = [pose_of(stamped.pose) for stamped in msg.poses]
    return np.array([(p.x_m, p.y_m, p.theta_rad) for p in poses], dtype=np.float64).reshape(-1, 3)


def poses_of(msg: Message) -> FloatArray:
    """Convert a PoseArray to x, y, theta; shape (n, 3)."""
    poses = [pose_of(pose) for pose in msg.poses]
    return np.array([(p.x_m, p.y_m, p.theta_rad) for p in poses], dtype=np.float64).reshape(-1, 3)


def grid_of(msg: Message) -> OccupancyGrid:
    """Convert an OccupancyGrid message; refuse one that is rotated against its frame."""
    info = msg.info
    origin = pose_of(info.origin)
    if origin.theta_rad != 0.0:
        raise ValueError("the grid is rotated against its frame")
    if msg.data.size != info.width * info.height:
        raise ValueError(f"{msg.data.size} cells for {info.width} x {info.height}")
    if not 0.0 < info.resolution < math.inf:
        raise ValueError(f"cells of {info.resolution} m")
    return OccupancyGrid(
        cells=msg.data.astype(np.int8).reshape(info.height, info.width),
        resolution_m=_shortest_decimal(info.resolution),
        origin_x_m=origin.x_m,
        origin_y_m=origin.y_m,
    )


def map_change_of(msg: Message) -> tuple[CellBox, CellArray]:
    """Return box and cells of a MapChange."""
    if msg.data.size != msg.rows * msg.columns:
        raise ValueError(f"{msg.data.size} cells for {msg.rows} x {msg.columns}")
    box = CellBox(msg.row, msg.column, msg.row + msg.rows, msg.column + msg.columns)
    return box, msg.data.astype(np.int8).reshape(msg.rows, msg.columns)


def status_of(msg: Message, epoch_ns: int = 0) -> Status:
    """Convert thumper_msgs/Status."""
    content = {field.name: getattr(msg, field.name) for field in fields(Status) if field.name != "time_s"}
    return Status(time_s=host_time_s(stamp_ns_of(msg), epoch_ns), **content)


def _shortest_decimal(resolution: float) -> float:
    """Return the shortest decimal of a float32: 0.05 arrives as 0.0500000007."""
    return float(str(np.float32(resolution)))
