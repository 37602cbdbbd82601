"""`thumper run` with a simulated robot and `thumper ros`, each in its process, driven by a ROS client."""

import math

from benchmarks.shared.live import until
from zenoh_ros2_sdk import ROS2Publisher

from tests.host.bus.test_bus import M
from tests.host.ros2.conftest import Live, is_done
from thumper.common.geometry import Pose2, Twist2
from thumper.ros.from_ros import pose_of


def test_goal_pose_drives_the_robot_there(live: Live) -> None:
    goal = M.goal(0.0, Pose2(x_m=1.2, y_m=0.05, theta_rad=math.pi))
    publisher = ROS2Publisher("/live/goal_pose", "geometry_msgs/msg/PoseStamped", domain_id=9)
    until(lambda: live.poses, 30.0)
    publisher.publish(header=goal.header, pose=goal.pose)

    def is_there() -> bool:
        pose = pose_of(live.poses[-1].pose.pose)
        return math.hypot(pose.x_m - 1.2, pose.y_m - 0.05) < 0.12

    until(is_there, 60.0)


def test_cmd_vel_turns_the_armed_robot_and_its_end_stops_it(live: Live) -> None:
    publisher = ROS2Publisher("/live/cmd_vel", "geometry_msgs/msg/TwistStamped", domain_id=9)
    turn = M.twist(0.0, Twist2(w_rad_s=0.8))
    until(lambda: is_done(live, "arm"), 30.0)

    def turns() -> bool:
        publisher.publish(header=turn.header, twist=turn.twist)
        return bool(live.odometry[-1].twist.twist.angular.z > 0.4)

    until(turns, 30.0)
    until(lambda: abs(live.odometry[-1].twist.twist.angular.z) < 0.02, 30.0)  # silent: 0.3 s, then zero
    live.bus.query("command", {"command": "disarm"})
