"""Convert the package's data to ROS 2 messages; `thumper.ros.from_ros` is the inverse."""

import math
from dataclasses import asdict, dataclass

import numpy as np

from thumper.board.board import TelemetrySample
from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.stamps import NS_PER_S, stamp_ns
from thumper.gps.fix import Fix, FixStatus
from thumper.imu.sample import ImuSample
from thumper.lidar.scan import Scan
from thumper.maps.cell_changes import NO_CELLS, CellBox
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap
from thumper.odometry.wheel_odometry import OdometrySample
from thumper.ros.codec import Message, message
from thumper.ros.status import Status

MAP, ODOM, BASE, LASER, GPS, CAMERA = "map", "odom", "base_link", "laser", "gps", "camera_optical_frame"
UNKNOWN = 1e6  # a variance
GPS_SERVICE, DIAGONAL_KNOWN, UNKNOWN_TYPE = 1, 2, 0  # of NavSatStatus and NavSatFix
INFO, WARN, ERROR = 20, 30, 40  # levels of rcl_interfaces/Log

# As in ROS's costmap publisher: 0 free, 1...98 inflated, 99 inscribed, 100 obstacle, -1 unknown.
_PERCENT_OF_COST = np.array(
    [0, *(1 + 97 * (cost - 1) // 251 for cost in range(1, 253)), 99, 100, -1], dtype=np.int8
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Messages:
    """Builds the messages of one run; all times are seconds of the host's clock."""

    epoch_ns: int = 0  # ROS time at zero of the host's clock

    def time(self, time_s: float) -> Message:
        """Build a builtin_interfaces/Time."""
        sec, nanosec = divmod(stamp_ns(time_s, self.epoch_ns), NS_PER_S)
        return message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def header(self, time_s: float, frame: str = "") -> Message:
        """Build a std_msgs/Header."""
        return message("std_msgs/msg/Header", stamp=self.time(time_s), frame_id=frame)

    def scan(self, scan: Scan) -> Message:
        """Build a LaserScan, stamped at beam 0."""
        last_rad = scan.angle_min_rad + scan.angle_increment_rad * (scan.ranges_m.size - 1)
        revolution_s = abs(math.tau / scan.angle_increment_rad) * scan.time_increment_s
        return message(
            "sensor_msgs/msg/LaserScan",
            header=self.header(scan.time_s, LASER),
            angle_min=scan.angle_min_rad,
            angle_max=last_rad,
            angle_increment=scan.angle_increment_rad,
            time_increment=scan.time_increment_s,
            scan_time=revolution_s,
            range_min=scan.range_min_m,
            range_max=scan.range_max_m,
            ranges=scan.ranges_m.astype(np.float32),
            intensities=np.empty(0, dtype=np.float32),
        )

    def imu(self, sample: ImuSample) -> Message:
        """Build an Imu. What the device does not measure has -1 as the first element of its covariance.

        Only the rate about z is measured: the variance of the other two is `UNKNOWN`.
        """
        x_m_s2, y_m_s2, z_m_s2 = sample.acceleration_m_s2 or (0.0, 0.0, 0.0)
        angles_rad = (sample.roll_rad, sample.pitch_rad, sample.yaw_rad)
        has_angles = not math.isnan(sample.yaw_rad)
        unknown = np.diag([-1.0, 0.0, 0.0]).reshape(-1)
        return message(
            "sensor_msgs/msg/Imu",
            header=self.header(sample.time_s, BASE),
            orientation=_rotation(*angles_rad) if has_angles else _rotation(0.0, 0.0, 0.0),
            orientation_covariance=np.zeros(9) if has_angles else unknown,
            angular_velocity=message("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=sample.yaw_rate_rad_s),
            angular_velocity_covariance=np.diag([UNKNOWN, UNKNOWN, sample.yaw_rate_std_rad_s**2]).reshape(-1),
            linear_acceleration=message("geometry_msgs/msg/Vector3", x=x_m_s2, y=y_m_s2, z=z_m_s2),
            linear_acceleration_covariance=unknown if sample.acceleration_m_s2 is None else np.zeros(9),
        )

    def fix(self, fix: Fix) -> Message:
        """Build a NavSatFix, in the frame of the antenna; it has NaN without a fix."""
        return message(
            "sensor_msgs/msg/NavSatFix",
            header=self.header(fix.time_s, GPS),
            status=message(
                "sensor_msgs/msg/NavSatStatus", status=min(fix.status, FixStatus.RTK), service=GPS_SERVICE
            ),
            latitude=fix.latitude_deg,
            longitude=fix.longitude_deg,
            altitude=fix.altitude_m,
            position_covariance=np.diag(fix.variances_m2).reshape(-1),
            position_covariance_type=DIAGONAL_KNOWN if fix.status is not FixStatus.NONE else UNKNOWN_TYPE,
        )

    def fix_in_map(self, fix: Fix, x_m: float, y_m: float) -> Message:
        """Build an Odometry of the antenna in the map; only its position is known.

        The variance of x and y is that of the fix along its worse axis.
        """
        return message(
            "nav_msgs/msg/Odometry",
            header=self.header(fix.time_s, MAP),
            child_frame_id=GPS,
            pose=_pose_with_covariance(
                Pose2(x_m=x_m, y_m=y_m), np.diag([fix.std_m**2, fix.std_m**2, UNKNOWN])
            ),
            twist=message(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=_twist(Twist2()),
                covariance=np.zeros(36),
            ),
        )

    def image(self, frame: CameraFrame) -> Message:
        """Build a CompressedImage, in the camera's optical frame."""
        return message(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(frame.time_s, CAMERA),
            format="jpeg",
            data=np.frombuffer(frame.jpeg, np.uint8),
        )

    def camera_info(self, time_s: float, camera: CameraOptions) -> Message:
        """Build a CameraInfo with the intrinsics of the options."""
        matrix = camera.matrix()
        return message(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(time_s, CAMERA),
            width=camera.width_px,
            height=camera.height_px,
            distortion_model="plumb_bob",
            d=np.array(camera.distortion),
            k=matrix.reshape(-1),
            r=np.eye(3).reshape(-1),
            p=np.column_stack([matrix, np.zeros(3)]).reshape(-1),
            binning_x=0,
            binning_y=0,
            roi=message(
                "sensor_msgs/msg/RegionOfInterest",
                x_offset=0,
                y_offset=0,
                height=0,
                width=0,
                do_rectify=False,
            ),
        )

    def odometry(self, sample: OdometrySample) -> Message:
        """Build an Odometry (odom to base_link); only the planar covariance terms are set."""
        return message(
            "nav_msgs/msg/Odometry",
            header=self.header(sample.time_s, ODOM),
            child_frame_id=BASE,
            pose=_pose_with_covariance(sample.odom_from_base, sample.covariance),
            twist=message(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=_twist(sample.twist),
                covariance=np.zeros(36),
            ),
        )

    def pose(self, time_s: float, map_from_base: Pose2, covariance: FloatArray | None = None) -> Message:
        """Build a PoseWithCovarianceStamped in the map; `covariance` of (x, y, theta), shape (3, 3)."""
        return message(
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            header=self.header(time_s, MAP),
            pose=_pose_with_covariance(map_from_base, np.zeros((3, 3)) if covariance is None else covariance),
        )

    def goal(self, time_s: float, map_from_goal: Pose2) -> Message:
        """Build a PoseStamped in the map."""
        return message(
            "geometry_msgs/msg/PoseStamped",
            header=self.header(time_s, MAP),
            pose=pose_message(map_from_goal.x_m, map_from_goal.y_m, map_from_goal.theta_rad),
        )

    def transforms(self, time_s: float, map_from_odom: Pose2, odom_from_base: Pose2) -> Message:
        """Build a TFMessage with the transforms map to odom and odom to base_link."""
        return message(
            "tf2_msgs/msg/TFMessage",
            transforms=[
                self._transform(time_s, MAP, ODOM, map_from_odom),
                self._transform(time_s, ODOM, BASE, odom_from_base),
            ],
        )

    def fixed_transforms(
        self,
        time_s: float,
        base_from_laser: Pose2,
        base_from_gps: Pose2 | None = None,
        camera: CameraOptions | None = None,
    ) -> Message:
        """Build a TFMessage with the mounting poses of the lidar, and of GPS and camera if present."""
        transforms = [self._transform(time_s, BASE, LASER, base_from_laser)]
        if base_from_gps is not None:
            transforms.append(self._transform(time_s, BASE, GPS, base_from_gps))
        if camera is not None:
            mounted = self._transform(time_s, BASE, CAMERA, Pose2(x_m=camera.x_m, y_m=camera.y_m))
            mounted.transform.translation.z = camera.z_m
            roll_rad, yaw_rad = (
                -0.5 * math.pi - math.radians(camera.pitch_deg),
                math.radians(camera.yaw_deg),
            )
            mounted.transform.rotation = _rotation(roll_rad, 0.0, yaw_rad - 0.5 * math.pi)
            transforms.append(mounted)
        return message("tf2_msgs/msg/TFMessage", transforms=transforms)

    def grid(self, time_s: float, grid: OccupancyGrid) -> Message:
        """Build an OccupancyGrid in the map."""
        return self._cells(time_s, grid.cells, grid.resolution_m, grid.origin_x_m, grid.origin_y_m)

    def costmap(self, time_s: float, costmap: Costmap) -> Message:
        """Build an OccupancyGrid in the map with the costs as percent."""
        cells = _PERCENT_OF_COST[costmap.costs]
        return self._cells(time_s, cells, costmap.resolution_m, costmap.origin_x_m, costmap.origin_y_m)

    def path(self, time_s: float, path: FloatArray) -> Message:
        """Build a Path in the map from x, y and optionally theta, shape (n, 2) or (n, 3).

        Without theta each heading points to the next point.
        """
        headings = path[:, 2] if path.shape[1] > 2 else _headings(path)
        stamp = self.header(time_s, MAP)
        poses = [
            message("geometry_msgs/msg/PoseStamped", header=stamp, pose=pose_message(x_m, y_m, theta_rad))
            for (x_m, y_m), theta_rad in zip(path[:, :2].tolist(), headings.tolist(), strict=True)
        ]
        return message("nav_msgs/msg/Path", header=stamp, poses=poses)

    def particles(self, time_s: float, poses: FloatArray) -> Message:
        """Build a PoseArray in the map from x, y, theta, shape (n, 3)."""
        return message(
            "geometry_msgs/msg/PoseArray",
            header=self.header(time_s, MAP),
            poses=[pose_message(*row) for row in poses.tolist()],
        )

    def twist(self, time_s: float, twist: Twist2) -> Message:
        """Build a TwistStamped in base_link."""
        return message(
            "geometry_msgs/msg/TwistStamped", header=self.header(time_s, BASE), twist=_twist(twist)
        )

    def wheels(self, sample: TelemetrySample) -> Message:
        """Build a thumper_msgs/Wheels: the telemetry as on the wire."""
        t = sample.telemetry
        return message(
            "thumper_msgs/msg/Wheels",
            header=self.header(sample.time_s, BASE),
            time_us=t.time_us,
            left_count=t.left_count,
            right_count=t.right_count,
            left_setpoint_mrad_s=t.left_setpoint,
            right_setpoint_mrad_s=t.right_setpoint,
            left_speed_mrad_s=t.left_speed,
            right_speed_mrad_s=t.right_speed,
            left_pwm=t.left_pwm,
            right_pwm=t.right_pwm,
            left_integral=t.left_integral,
            right_integral=t.right_integral,
            lost_edges=t.lost_edges,
            battery_mv=t.battery_mV,
            left_current_ma=t.left_current_mA,
            right_current_ma=t.right_current_mA,
            state=int(t.state),
            fault=int(t.fault),
            warnings=t.warnings,
            rx_frames=t.rx_frames,
            rx_errors=t.rx_errors,
            tx_dropped=t.tx_dropped,
            gyro_heading=t.heading,
            gyroscope=int(t.gyroscope),
        )

    def battery(self, sample: TelemetrySample) -> Message:
        """Build a BatteryState: voltage and the motors' total current; fields without a sensor are NaN."""
        t = sample.telemetry
        nothing = np.empty(0, dtype=np.float32)
        return message(
            "sensor_msgs/msg/BatteryState",
            header=self.header(sample.time_s, BASE),
            voltage=1e-3 * t.battery_mV,
            temperature=math.nan,
            current=-1e-3 * (abs(t.left_current_mA) + abs(t.right_current_mA)),  # negative while discharging
            charge=math.nan,
            capacity=math.nan,
            design_capacity=math.nan,
            percentage=math.nan,
            power_supply_status=2,  # discharging
            power_supply_health=0,
            power_supply_technology=3,  # LiPo
            present=t.battery_mV > 0,
            cell_voltage=nothing,
            cell_temperature=nothing,
            location="",
            serial_number="",
        )

    def status(self, status: Status) -> Message:
        """Build a thumper_msgs/Status."""
        fields = asdict(status)
        return message("thumper_msgs/msg/Status", header=self.header(fields.pop("time_s")), **fields)

    def event(self, time_s: float, level: int, text: str, name: str = "thumper") -> Message:
        """Build an rcl_interfaces/Log with one line of text; `level` is INFO, WARN or ERROR."""
        return message(
            "rcl_interfaces/msg/Log",
            stamp=self.time(time_s),
            level=level,
            name=name,
            msg=text,
            file="",
            function="",
            line=0,
        )

    def _transform(self, time_s: float, parent: str, child: str, parent_from_child: Pose2) -> Message:
        return transform(self.header(time_s, parent), child, parent_from_child)

    def _cells(
        self, time_s: float, cells: np.ndarray, resolution_m: float, x_m: float, y_m: float
    ) -> Message:
        rows, columns = cells.shape
        return message(
            "nav_msgs/msg/OccupancyGrid",
            header=self.header(time_s, MAP),
            info=message(
                "nav_msgs/msg/MapMetaData",
                map_load_time=self.time(time_s),
                resolution=resolution_m,
                width=columns,
                height=rows,
                origin=pose_message(x_m, y_m, 0.0),
            ),
            data=np.ascontiguousarray(cells, dtype=np.int8).reshape(-1),
        )


def map_change(before: Message | None, new: Message, changed: CellBox | None) -> Message:
    """Build a MapChange: the cells in which the OccupancyGrid `new` differs from `before`.

    `changed` is None if it is not known where they differ: the message then changes no map.
    """
    box = changed or NO_CELLS
    cells = new.data.reshape(new.info.height, new.info.width)[box.window]
    stamp = message("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    if before is not None and changed is not None:
        stamp = before.header.stamp
    return message(
        "thumper_msgs/msg/MapChange",
        header=new.header,
        before=stamp,
        row=box.top,
        column=box.left,
        rows=cells.shape[0],
        columns=cells.shape[1],
        data=np.ascontiguousarray(cells).reshape(-1),
    )


def transform(header: Message, child: str, parent_from_child: Pose2) -> Message:
    """Build a TransformStamped; the header names the parent frame."""
    pose = pose_message(parent_from_child.x_m, parent_from_child.y_m, parent_from_child.theta_rad)
    position = pose.position
    return message(
        "geometry_msgs/msg/TransformStamped",
        header=header,
        child_frame_id=child,
        transform=message(
            "geometry_msgs/msg/Transform",
            translation=message("geometry_msgs/msg/Vector3", x=position.x, y=position.y, z=position.z),
            rotation=pose.orientation,
        ),
    )


def text(content: str) -> Message:
    """Build a std_msgs/String, the type of commands."""
    return message("std_msgs/msg/String", data=content)


def flag(value: bool) -> Message:
    """Build a std_msgs/Bool, the type of the emergency stop."""
    return message("std_msgs/msg/Bool", data=value)


def pose_message(x_m: float, y_m: float, theta_rad: float) -> Message:
    """Build a Pose on the floor."""
    half_rad = 0.5 * theta_rad
    return message(
        "geometry_msgs/msg/Pose",
        position=message("geometry_msgs/msg/Point", x=float(x_m), y=float(y_m), z=0.0),
        orientation=message(
            "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half_rad), w=math.cos(half_rad)
        ),
    )


def _rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Message:
    """Build a Quaternion from angles that are applied in the order yaw, pitch, roll."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in (roll_rad, pitch_rad, yaw_rad)
    )
    return message(
        "geometry_msgs/msg/Quaternion",
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def _twist(twist: Twist2) -> Message:
    def vector(x: float, z: float) -> Message:
        return message("geometry_msgs/msg/Vector3", x=float(x), y=0.0, z=float(z))

    return message(
        "geometry_msgs/msg/Twist", linear=vector(twist.v_m_s, 0.0), angular=vector(0.0, twist.w_rad_s)
    )


def _pose_with_covariance(pose: Pose2, covariance: FloatArray) -> Message:
    """Embed the 3x3 covariance of x, y, yaw in ROS's 6x6 one (x, y, z, roll, pitch, yaw)."""
    full = np.zeros((6, 6))
    full[np.ix_((0, 1, 5), (0, 1, 5))] = covariance
    return message(
        "geometry_msgs/msg/PoseWithCovariance",
        pose=pose_message(pose.x_m, pose.y_m, pose.theta_rad),
        covariance=full.reshape(-1),
    )


def _headings(path: FloatArray) -> FloatArray:
    """Return the direction to the next point; the last point repeats the one before it."""
    if len(path) < 2:
        return np.zeros(len(path))
    steps = np.diff(path[:, :2], axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    return np.append(headings, headings[-1])
