"""Drive a simulated robot from rclpy over ROS 2's own rmw_zenoh_cpp: `python3 tests/host/ros2/with_rclpy.py`.

No test of the suite, because it needs a ROS 2 Jazzy with rmw_zenoh_cpp and nav2_msgs. Start rmw_zenohd,
`thumper run --board sim://r/board --lidar sim://r/lidar` and `thumper ros` first. Prints a line per check;
the first one that does not hold ends it with an error. The robot drives about 1 m to and fro.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav2_msgs.action import ComputePathToPose, FollowWaypoints, NavigateToPose
from nav2_msgs.srv import ClearEntireCostmap
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.srv import GetMap
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.action import ActionClient
from rclpy.action.graph import get_action_names_and_types
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from std_srvs.srv import Trigger

WAIT_S = 60.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS = {  # name: type, reliability, durability
    "/scan": ("sensor_msgs/msg/LaserScan", "BEST_EFFORT", "VOLATILE"),
    "/odom": ("nav_msgs/msg/Odometry", "RELIABLE", "VOLATILE"),
    "/tf": ("tf2_msgs/msg/TFMessage", "RELIABLE", "VOLATILE"),
    "/tf_static": ("tf2_msgs/msg/TFMessage", "RELIABLE", "TRANSIENT_LOCAL"),
    "/map": ("nav_msgs/msg/OccupancyGrid", "RELIABLE", "TRANSIENT_LOCAL"),
    "/robot_description": ("std_msgs/msg/String", "RELIABLE", "TRANSIENT_LOCAL"),
}
ACTIONS = {
    "/navigate_to_pose": "nav2_msgs/action/NavigateToPose",
    "/follow_waypoints": "nav2_msgs/action/FollowWaypoints",
    "/compute_path_to_pose": "nav2_msgs/action/ComputePathToPose",
}


class Check:
    """A node that waits for what must come."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("thumper_check")
        self.odometry: list[Any] = []
        self.node.create_subscription(Odometry, "/odom", self.odometry.append, 10)

    def until(self, what: str, found: Callable[[], Any]) -> Any:
        """Return what `found` returns once that is true."""
        end_s = time.monotonic() + WAIT_S
        while not (result := found()):
            assert time.monotonic() < end_s, f"{what}: not within {WAIT_S:.0f} s"
            rclpy.spin_once(self.node, timeout_sec=0.05)
        print(f"ok: {what}")
        return result

    def first(self, kind: Any, topic: str, qos: Any) -> Any:
        """Return the first message of a new subscriber."""
        received: list[Any] = []
        subscription = self.node.create_subscription(kind, topic, received.append, qos)
        message = self.until(f"{topic} arrives", lambda: received)[0]
        self.node.destroy_subscription(subscription)
        return message

    def call(self, kind: Any, name: str, **fields: Any) -> Any:
        """Call a service and return its response."""
        client = self.node.create_client(kind, name)
        self.until(f"{name} is there", client.service_is_ready)
        return self.result(f"{name} answers", client.call_async(kind.Request(**fields)))

    def result(self, what: str, future: Any) -> Any:
        """Wait for a future."""
        self.until(what, future.done)
        return future.result()

    def drive(self, kind: Any, command: Any) -> None:
        """Send a velocity until odometry shows 0.2 m of it."""
        publisher = self.node.create_publisher(kind, "/cmd_vel", 10)
        start_m = self.odometry[-1].pose.pose.position.x, self.odometry[-1].pose.pose.position.y

        def has_moved() -> bool:
            publisher.publish(command)
            now = self.odometry[-1].pose.pose.position
            return bool((now.x - start_m[0]) ** 2 + (now.y - start_m[1]) ** 2 > 0.2**2)

        self.until(f"/cmd_vel drives: {kind.__name__}", has_moved)
        self.node.destroy_publisher(publisher)
        time.sleep(1.0)  # the last command is valid for 0.3 s, and replaces a goal


def pose(check: Check, ahead_m: float) -> PoseStamped:
    """Return a pose ahead of where the robot is, along the map's x axis."""
    goal = PoseStamped()
    goal.header.frame_id = check.call(GetMap, "/map_server/map").map.header.frame_id
    goal.pose = check.odometry[-1].pose.pose
    goal.pose.position.x += ahead_m
    return goal


def check_graph(check: Check) -> None:
    """`ros2 node list`, `topic info`, `service list` and `action list` read the same functions."""
    node = check.node
    check.until("node list", lambda: ("thumper", "/") in node.get_node_names_and_namespaces())
    for topic, expected in TOPICS.items():
        (info,) = check.until(f"topic info {topic}", partial(node.get_publishers_info_by_topic, topic))
        qos = info.qos_profile
        assert (info.topic_type, qos.reliability.name, qos.durability.name) == expected, info
    services = dict(node.get_service_names_and_types_by_node("thumper", "/"))
    assert services["/thumper/arm"] == ["std_srvs/srv/Trigger"]
    assert services["/map_server/map"] == ["nav_msgs/srv/GetMap"]
    assert {name: kinds[0] for name, kinds in get_action_names_and_types(node)} == ACTIONS


def check_actions(check: Check) -> None:
    """Each action: feedback and result; a cancelled goal; a goal that another one replaces."""
    navigate = ActionClient(check.node, NavigateToPose, "/navigate_to_pose")
    check.until("navigate_to_pose is there", navigate.server_is_ready)
    feedback: list[Any] = []

    def send(ahead_m: float) -> Any:
        goal = NavigateToPose.Goal(pose=pose(check, ahead_m))
        handle = check.result("goal is answered", navigate.send_goal_async(goal, feedback.append))
        assert handle.accepted
        return handle

    reached = check.result("navigate_to_pose ends", send(0.4).get_result_async())
    assert reached.status == GoalStatus.STATUS_SUCCEEDED, reached
    assert feedback[0].feedback.distance_remaining > 0.0
    going = send(-0.6)
    check.result("cancel is answered", going.cancel_goal_async())
    cancelled = check.result("cancelled goal ends", going.get_result_async())
    assert cancelled.status == GoalStatus.STATUS_CANCELED, cancelled
    first = send(-0.6)
    second = send(0.3)
    assert check.result("first ends", first.get_result_async()).status == GoalStatus.STATUS_ABORTED
    assert check.result("second ends", second.get_result_async()).status == GoalStatus.STATUS_SUCCEEDED

    plan = ActionClient(check.node, ComputePathToPose, "/compute_path_to_pose")
    handle = check.result("plan", plan.send_goal_async(ComputePathToPose.Goal(goal=pose(check, 0.5))))
    path = check.result("plan ends", handle.get_result_async()).result
    assert len(path.path.poses) > 2, path
    follow = ActionClient(check.node, FollowWaypoints, "/follow_waypoints")
    waypoints = FollowWaypoints.Goal(poses=[pose(check, 0.3), pose(check, 0.0)])
    handle = check.result("follow_waypoints", follow.send_goal_async(waypoints))
    followed = check.result("waypoints end", handle.get_result_async())
    assert (followed.status, len(followed.result.missed_waypoints)) == (GoalStatus.STATUS_SUCCEEDED, 0)


def main() -> None:
    """Run all checks."""
    rclpy.init()
    print(rclpy.get_rmw_implementation_identifier())
    check = Check()
    check_graph(check)
    assert check.first(LaserScan, "/scan", qos_profile_sensor_data).header.frame_id == "laser"
    assert check.first(OccupancyGrid, "/map", LATCHED).info.width > 0
    assert check.first(String, "/robot_description", LATCHED).data.startswith("<?xml")
    names = check.call(ListParameters, "/thumper/list_parameters").result.names
    assert "kp" in names
    assert check.call(GetParameters, "/thumper/get_parameters", names=["kp"]).values[0].double_value > 0.0
    check.call(ClearEntireCostmap, "/global_costmap/clear_entirely_global_costmap")
    assert check.call(Trigger, "/thumper/arm").success
    twist = Twist()
    twist.linear.x = 0.15
    check.drive(Twist, twist)
    stamped = TwistStamped()
    stamped.twist.linear.x = -0.15
    check.drive(TwistStamped, stamped)
    check_actions(check)
    assert check.call(Trigger, "/thumper/emergency_stop").success
    assert check.call(Trigger, "/thumper/clear_fault").success
    rclpy.shutdown()


if __name__ == "__main__":
    main()
