"""Table of the ROS topics: name, type, QoS, and the topic of the bus that it carries."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from thumper.ros2.wire import BEST_EFFORT, TRANSIENT_LOCAL, Qos

LATCHED = Qos(durability=TRANSIENT_LOCAL, depth=1)
SENSOR_DATA = Qos(reliability=BEST_EFFORT, depth=5)  # the profile of that name
TRANSFORMS = Qos(depth=100)  # as tf2's broadcasters
DEFAULT = Qos()


@dataclass(frozen=True, slots=True, kw_only=True)
class RosTopic:
    """A topic of the node; `/name` is absolute, `name` lies in the node's namespace."""

    name: str
    qos: Qos = DEFAULT


OUT: Mapping[str, RosTopic] = MappingProxyType(  # by the topic of the bus, whose type and bytes they have
    {
        "scan": RosTopic(name="scan", qos=SENSOR_DATA),
        "imu": RosTopic(name="imu/data", qos=SENSOR_DATA),
        "gps": RosTopic(name="gps/fix", qos=SENSOR_DATA),
        "gps_odom": RosTopic(name="odometry/gps"),  # the name of robot_localization
        "camera": RosTopic(name="camera/image_raw/compressed", qos=SENSOR_DATA),
        "camera_info": RosTopic(name="camera/camera_info", qos=LATCHED),
        "odom": RosTopic(name="odom"),
        "pose": RosTopic(name="pose"),
        "tf": RosTopic(name="tf", qos=TRANSFORMS),
        "tf_static": RosTopic(name="tf_static", qos=LATCHED),
        "map": RosTopic(name="map", qos=LATCHED),
        "local_costmap": RosTopic(name="local_costmap/costmap"),
        "plan": RosTopic(name="plan", qos=LATCHED),
        "local_plan": RosTopic(name="local_plan"),
        "particles": RosTopic(name="particlecloud"),
        "cmd_vel": RosTopic(name="cmd_vel_out"),  # `cmd_vel` is the input, as with twist_mux
        "wheels": RosTopic(name="wheels"),
        "battery": RosTopic(name="battery_state"),
        "markers": RosTopic(name="zones", qos=LATCHED),
        "objects": RosTopic(name="objects", qos=LATCHED),
        "status": RosTopic(name="status", qos=LATCHED),
        "events": RosTopic(name="/rosout", qos=Qos(durability=TRANSIENT_LOCAL, depth=100)),
    }
)

NAVIGATION = ("local_costmap", "plan", "local_plan", "goal")  # topics of the bus that Nav2 has of its own

DESCRIPTION = RosTopic(name="robot_description", qos=LATCHED)  # std_msgs/String: URDF
DIAGNOSTICS = RosTopic(name="/diagnostics")  # diagnostic_msgs/DiagnosticArray
CLOCK = RosTopic(name="/clock", qos=Qos(reliability=BEST_EFFORT, depth=1))  # rosgraph_msgs/Clock

# Inputs: topic of the bus, its type on the ROS side.
IN: tuple[tuple[RosTopic, str, str], ...] = (
    (RosTopic(name="cmd_vel"), "geometry_msgs/msg/Twist", "velocity"),
    (RosTopic(name="cmd_vel"), "geometry_msgs/msg/TwistStamped", "velocity"),
    (RosTopic(name="initialpose"), "geometry_msgs/msg/PoseWithCovarianceStamped", "initialpose"),
    (RosTopic(name="goal_pose"), "geometry_msgs/msg/PoseStamped", "goal"),
)
