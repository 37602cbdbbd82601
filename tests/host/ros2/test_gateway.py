"""The gateway between the bus and an independent ROS client, over a router in its own process."""

import time
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from benchmarks.shared.live import until
from zenoh_ros2_sdk import (
    ROS2Publisher,
    ROS2Subscriber,
    ZenohSession,
    get_service_names_and_types,
    get_topic_info,
    get_topic_names_and_types,
)
from zenoh_ros2_sdk.qos import QosDurability, QosProfile, QosReliability

from tests.host.bus.test_bus import GRID, M
from tests.host.ros2.conftest import Gateway
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.config.robot import RobotConfig
from thumper.config.ros import RosOptions, overridden
from thumper.gps.options import GpsOptions
from thumper.lidar.scan import Scan
from thumper.ros.codec import Message
from thumper.ros.from_ros import pose_of
from thumper.ros.status import Status
from thumper.ros2.urdf import urdf
from thumper.runtime.requests import GoTo, SetPose, TeleopSource, Velocity

LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
SCAN = Scan(
    time_s=3.0,
    ranges_m=np.linspace(0.5, 2.0, 10),
    angle_min_rad=-1.0,
    angle_increment_rad=0.2,
    time_increment_s=0.01,
    range_min_m=0.02,
    range_max_m=4.0,
)


def listen(topic: str, type_name: str, qos: QosProfile | None = None) -> list[Any]:
    received: list[Any] = []
    ROS2Subscriber(topic, type_name, received.append, domain_id=7, qos=qos)
    return received


def echo(gateway: Gateway, listened: list[Any], topic: str, message: Message) -> Any:
    """Publish on the bus until the ROS client has received it."""

    def is_received() -> bool:
        gateway.robot.server.publish(topic, 0.0, message)
        time.sleep(0.02)
        return bool(listened)

    until(is_received, 20.0)
    return listened[-1]


def vector(x: float, z: float) -> Any:
    return ZenohSession.get_instance().store.types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=z)


def test_graph_lists_the_topics_with_types_and_qos(gateway: Gateway) -> None:
    listed = dict(get_topic_names_and_types(domain_id=7))
    assert listed["/scan"] == ["sensor_msgs/msg/LaserScan"]
    assert listed["/map"] == ["nav_msgs/msg/OccupancyGrid"]
    assert listed["/battery_state"] == ["sensor_msgs/msg/BatteryState"]
    assert listed["/rosout"] == ["rcl_interfaces/msg/Log"]
    assert listed["/cmd_vel"] == ["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"]
    assert "/clock" not in listed  # not simulated
    scan = get_topic_info("/scan", domain_id=7, verbose=True)
    assert (scan.publisher_count, scan.subscriber_count) == (1, 0)
    assert (scan.publishers[0].node_name, scan.publishers[0].node_namespace) == ("r1", "/")
    assert QosProfile.decode(scan.publishers[0].qos).reliability is QosReliability.BEST_EFFORT
    for topic in ("map", "tf_static", "robot_description"):
        info = get_topic_info(f"/{topic}", domain_id=7, verbose=True)
        assert QosProfile.decode(info.publishers[0].qos).durability is QosDurability.TRANSIENT_LOCAL, topic


def test_namespace_is_that_of_node_and_topics(router: int) -> None:
    gateway = Gateway(router, "/fleet/a")
    info = until(lambda: get_topic_info("/fleet/a/tf", domain_id=7, verbose=True), 20.0)
    assert (info.publishers[0].node_name, info.publishers[0].node_namespace) == ("r1", "/fleet/a")
    assert get_topic_info("/tf", domain_id=7) is None
    scan = echo(gateway, listen("/fleet/a/scan", "sensor_msgs/msg/LaserScan"), "scan", M.scan(SCAN))
    assert scan.ranges.size == 10
    gateway.close()


def test_base_for_nav2_leaves_its_names_to_it(router: int) -> None:
    """Nav2 has goals, plans and costmaps of its own: two servers of one name would both answer."""
    gateway = Gateway(router, "/base", navigates=False)
    until(lambda: get_topic_info("/base/cmd_vel", domain_id=7), 20.0)
    topics = {name for name, _ in get_topic_names_and_types(domain_id=7) if name.startswith("/base/")}
    services = {name for name, _ in get_service_names_and_types(domain_id=7) if name.startswith("/base/")}
    for name in ("scan", "odom", "tf", "tf_static", "map", "cmd_vel", "initialpose", "robot_description"):
        assert f"/base/{name}" in topics
    assert not {name for name in topics | services if "goal" in name or "plan" in name or "costmap" in name}
    assert "/base/r1/arm" in services
    gateway.close()


def test_node_leaves_the_graph_with_its_topics(gateway: Gateway) -> None:
    until(lambda: get_topic_info("/odom", domain_id=7), 20.0)
    gateway.node.close()
    until(lambda: get_topic_info("/odom", domain_id=7) is None, 20.0)


def test_scan_arrives_unchanged(gateway: Gateway) -> None:
    scan = echo(gateway, listen("/scan", "sensor_msgs/msg/LaserScan"), "scan", M.scan(SCAN))
    assert scan.header.frame_id == "laser"
    assert scan.header.stamp.sec == 3
    assert scan.ranges.tolist() == pytest.approx(SCAN.ranges_m)


def test_late_subscriber_receives_the_map_and_the_description(gateway: Gateway) -> None:
    echo(gateway, listen("/map", "nav_msgs/msg/OccupancyGrid"), "map", M.grid(0.0, GRID))
    (late,) = listen("/map", "nav_msgs/msg/OccupancyGrid", LATCHED)
    assert (late.info.width, late.info.height) == (4, 3)
    assert late.data.tolist() == list(range(12))
    (description,) = listen("/robot_description", "std_msgs/msg/String", LATCHED)
    robot = ElementTree.fromstring(description.data)
    links = {link.get("name") for link in robot.iter("link")}
    assert links == {"base_link", "laser", "left_wheel_link", "right_wheel_link"}


def test_static_transforms_place_every_link_of_the_description(gateway: Gateway) -> None:
    listened = listen("/tf_static", "tf2_msgs/msg/TFMessage")
    message = echo(gateway, listened, "tf_static", M.fixed_transforms(1.0, Pose2(x_m=0.12)))
    children = {one.child_frame_id: one for one in message.transforms}
    assert set(children) == {"laser", "left_wheel_link", "right_wheel_link"}
    assert {one.header.frame_id for one in message.transforms} == {"base_link"}
    assert children["left_wheel_link"].transform.translation.y == pytest.approx(0.12)


def test_description_has_the_antenna_if_there_is_a_gps() -> None:
    gps = GpsOptions(enabled=True, x_m=-0.1, y_m=0.05)
    robot = ElementTree.fromstring(urdf(RobotConfig(name="r1", gps=gps)))
    joint = robot.find("joint[@name='gps_joint']")
    assert joint is not None
    assert [part.attrib for part in joint] == [
        {"link": "base_link"},
        {"link": "gps"},
        {"xyz": "-0.1 0.05 0", "rpy": "0 0 0"},
    ]


def test_clock_and_diagnostics_of_a_simulated_robot(gateway: Gateway) -> None:
    clocks = listen("/clock", "rosgraph_msgs/msg/Clock")
    diagnostics = listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    status = Status(
        time_s=12.5,
        robot="r1",
        simulated=True,
        fault=4,
        fault_words="low battery",
        fault_cure="charge it",
        scan_age_s=0.1,
        pose_lost="carried away",
    )
    clock = echo(gateway, clocks, "status", M.status(status))
    assert (clock.clock.sec, clock.clock.nanosec) == (12, 500_000_000)
    until(lambda: diagnostics, 20.0)
    parts = {part.name: part for part in diagnostics[-1].status}
    assert set(parts) == {"r1: board", "r1: lidar", "r1: localization", "r1: control loop"}
    assert (parts["r1: board"].level, parts["r1: board"].message) == (2, "low battery: charge it")
    assert parts["r1: lidar"].level == 0
    assert (parts["r1: localization"].level, parts["r1: localization"].message) == (
        1,
        "pose lost: carried away",
    )


def test_cmd_vel_of_both_types_becomes_a_manual_command(gateway: Gateway) -> None:
    types = ZenohSession.get_instance().store.types
    twist = ROS2Publisher("/cmd_vel", "geometry_msgs/msg/Twist", domain_id=7)
    stamped = ROS2Publisher("/cmd_vel", "geometry_msgs/msg/TwistStamped", domain_id=7)
    header = M.header(0.0, "base_link")

    def send() -> None:
        twist.publish(linear=vector(0.2, 0.0), angular=vector(0.0, 0.5))
        inner = types["geometry_msgs/msg/Twist"](linear=vector(0.1, 0.0), angular=vector(0.0, -0.5))
        stamped.publish(header=header, twist=inner)

    wanted = {Twist2(v_m_s=0.2, w_rad_s=0.5), Twist2(v_m_s=0.1, w_rad_s=-0.5)}
    received: list[Any] = []

    def is_received() -> bool:
        send()
        time.sleep(0.05)
        received.extend(gateway.robot.pending_requests())
        return wanted <= {request.twist for request in received if isinstance(request, Velocity)}

    until(is_received, 20.0)
    assert {request.channel for request in received} == {TeleopSource.VELOCITY}


def test_goal_and_initial_pose_become_requests(gateway: Gateway) -> None:
    pose = M.goal(0.0, Pose2(x_m=1.0, y_m=-0.5, theta_rad=0.5))
    goals = ROS2Publisher("/goal_pose", "geometry_msgs/msg/PoseStamped", domain_id=7)
    starts = ROS2Publisher("/initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped", domain_id=7)
    wanted = M.pose(0.0, Pose2(x_m=2.0))
    received: list[Any] = []

    def is_received() -> bool:
        goals.publish(header=pose.header, pose=pose.pose)
        starts.publish(header=wanted.header, pose=wanted.pose)
        time.sleep(0.1)
        received.extend(gateway.robot.pending_requests())
        return {type(request) for request in received} == {GoTo, SetPose}

    until(is_received, 20.0)
    goal = next(request for request in received if isinstance(request, GoTo)).goals[0]
    assert (goal.x_m, goal.y_m) == (1.0, -0.5)
    assert goal.theta_rad == pytest.approx(0.5)
    start = next(request for request in received if isinstance(request, SetPose))
    assert start.map_from_base == pose_of(wanted.pose.pose)


def test_what_is_no_twist_is_reported_and_not_passed_on(gateway: Gateway) -> None:
    gateway.gateway.on_twist(b"\0\1\0\0 nonsense")
    assert "cmd_vel: not a valid geometry_msgs/msg/Twist" in gateway.reported[0]
    assert gateway.robot.pending_requests() == []


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"router": "nonsense"}, "--router: 'nonsense' is not an address"),
        ({"namespace": "robot 1"}, "--namespace: 'robot 1' is not a namespace; use a slash"),
        ({"domain_id": 233}, "--domain_id: "),
    ],
)
def test_wrong_options_are_named(given: dict[str, Any], problem: str) -> None:
    with pytest.raises(ThumperError, match=problem):
        overridden(RosOptions(), **({"router": "", "domain_id": None, "namespace": None} | given))


def test_a_router_on_the_network_needs_keys_or_a_token() -> None:
    with pytest.raises(ValueError, match="without tls, set a token"):
        RosOptions(router="192.168.1.5:7447", tls="none")
    assert RosOptions(router="192.168.1.5:7447").tls == ""  # the keys of `thumper bus keys`
    assert RosOptions(router="192.168.1.5:7447", tls="none", token="correct horse").token
