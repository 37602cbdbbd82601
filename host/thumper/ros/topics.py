"""Table of the topics: name, ROS 2 type and direction."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType


class Direction(Enum):
    """Seen from the robot."""

    OUT = "out"
    IN = "in"


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """A named stream of messages of one type."""

    type_name: str
    direction: Direction
    latched: bool = False  # late subscribers receive the newest message
    recorded: bool = True


def _out(type_name: str, *, latched: bool = False, recorded: bool = True) -> Topic:
    return Topic(type_name=type_name, direction=Direction.OUT, latched=latched, recorded=recorded)


def _in(type_name: str) -> Topic:
    return Topic(type_name=type_name, direction=Direction.IN)


PRESENCE = "presence"  # key of the robot's liveliness token on the bus; not a topic

TOPICS: Mapping[str, Topic] = MappingProxyType(
    {
        "scan": _out("sensor_msgs/msg/LaserScan"),
        "imu": _out("sensor_msgs/msg/Imu"),
        "gps": _out("sensor_msgs/msg/NavSatFix"),
        "gps_odom": _out("nav_msgs/msg/Odometry"),
        "camera": _out("sensor_msgs/msg/CompressedImage"),
        "camera_info": _out("sensor_msgs/msg/CameraInfo", latched=True),
        "odom": _out("nav_msgs/msg/Odometry"),
        "pose": _out("geometry_msgs/msg/PoseWithCovarianceStamped"),
        "tf": _out("tf2_msgs/msg/TFMessage"),
        "tf_static": _out("tf2_msgs/msg/TFMessage", latched=True),
        "map": _out("nav_msgs/msg/OccupancyGrid", latched=True),
        # What differs from the map before, for those who have it; a recording holds whole maps.
        "map_changes": _out("thumper_msgs/msg/MapChange", latched=True, recorded=False),
        "local_costmap": _out("nav_msgs/msg/OccupancyGrid"),
        "plan": _out("nav_msgs/msg/Path", latched=True),
        "local_plan": _out("nav_msgs/msg/Path"),
        "particles": _out("geometry_msgs/msg/PoseArray"),
        "cmd_vel": _out("geometry_msgs/msg/TwistStamped"),
        "wheels": _out("thumper_msgs/msg/Wheels"),
        "battery": _out("sensor_msgs/msg/BatteryState"),
        "status": _out("thumper_msgs/msg/Status", latched=True),
        "events": _out("rcl_interfaces/msg/Log"),
        "annotations": _out("std_msgs/msg/String", latched=True),  # zones and places, GeoJSON
        "markers": _out("visualization_msgs/msg/MarkerArray", latched=True),  # the same for RViz and Foxglove
        "objects": _out("visualization_msgs/msg/MarkerArray", latched=True),  # that the detector has seen
        "session": _out("std_msgs/msg/String", latched=True),  # JSON: metadata of the run, for recordings
        "goal": _in("geometry_msgs/msg/PoseStamped"),
        "waypoints": _in("nav_msgs/msg/Path"),
        "initialpose": _in("geometry_msgs/msg/PoseWithCovarianceStamped"),
        "velocity": _in("geometry_msgs/msg/TwistStamped"),  # of another program
        "teleop": _in("geometry_msgs/msg/TwistStamped"),  # has priority over `velocity`
        "gamepad": _in("geometry_msgs/msg/TwistStamped"),  # has priority over `teleop`
        "override": _in("std_msgs/msg/Bool"),  # manual commands may touch obstacles; expires after 0.3 s
        "heartbeat": _in("std_msgs/msg/Header"),
        "estop": _in("std_msgs/msg/Bool"),
        "command": _in("std_msgs/msg/String"),
        "simulator/command": _in("std_msgs/msg/String"),
    }
)
