"""The local frame follows odometry at once, and the map as the robot moves."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.navigation.costmap.local_frame import MAX_ERROR_M, LocalFrame

POST = Pose2(x_m=-0.3, y_m=0.15)  # beside the tail at the start


class Drive:
    """A robot, its pose in the map, and a post that it remembers."""

    def __init__(self) -> None:
        self.frame, self.post = LocalFrame(), POST
        self.truth = self.odom_from_base = Pose2()
        self.step(Pose2())

    def step(self, moved: Pose2, odometry: Pose2 | None = None, error: Pose2 | None = None) -> None:
        """Move by `moved`; odometry measures `odometry`, the map's pose is off by `error` in base_link."""
        self.truth @= moved
        self.odom_from_base @= odometry or moved
        map_from_base = self.truth @ (error or Pose2())
        new_from_old = self.frame.update(map_from_base, map_from_base @ self.odom_from_base.inverse())
        self.post = new_from_old @ self.post
        self.believed = map_from_base.inverse() @ self.post

    def error_m(self) -> float:
        """Return how far off the post is, seen from the robot."""
        return self.believed.distance_m(self.truth.inverse() @ POST)


def test_pose_noise_moves_no_point_of_a_robot_at_rest() -> None:
    rng, drive = np.random.default_rng(1), Drive()
    for _ in range(50):
        x_m, y_m, theta_rad = rng.normal(0.0, (0.03, 0.03, 0.02))
        drive.step(Pose2(), error=Pose2(x_m=float(x_m), y_m=float(y_m), theta_rad=float(theta_rad)))
        assert drive.error_m() < 1e-9


def test_pose_noise_moves_points_of_a_driving_robot_by_little() -> None:
    rng, drive, errors_m = np.random.default_rng(1), Drive(), list[float]()
    for _ in range(40):
        x_m, y_m = rng.normal(0.0, 0.015, 2)
        drive.step(Pose2(x_m=0.03), error=Pose2(x_m=float(x_m), y_m=float(y_m)))
        errors_m.append(drive.error_m())
    assert float(np.mean(errors_m)) < 0.01


@pytest.mark.parametrize("somebody_stands_close", [1, 10])
def test_points_stay_when_somebody_stands_close_and_leaves(somebody_stands_close: int) -> None:
    drive = Drive()
    for _ in range(somebody_stands_close):
        drive.step(Pose2(), error=Pose2(x_m=0.10, y_m=-0.10, theta_rad=0.02))
    for _ in range(10):
        drive.step(Pose2(theta_rad=-0.06))
    assert drive.error_m() < 0.02


@pytest.mark.parametrize(
    ("moved", "odometry"),
    [
        (Pose2(x_m=0.036), Pose2(x_m=0.04)),
        (Pose2(theta_rad=0.09), Pose2(theta_rad=0.11)),
        (Pose2(), Pose2(x_m=0.04)),
        (Pose2(), Pose2(theta_rad=0.12)),
    ],
    ids=["slip", "slip in a turn", "wheels that spin", "wheels that spin in a turn"],
)
def test_points_stay_when_wheels_slip(moved: Pose2, odometry: Pose2) -> None:
    drive = Drive()
    for _ in range(60):
        drive.step(moved, odometry)
        limit_m = MAX_ERROR_M + 0.001 + 0.06 * math.hypot(drive.believed.x_m, drive.believed.y_m)
        assert drive.error_m() < limit_m
    for _ in range(100):  # with grip again
        drive.step(Pose2(x_m=0.03))
    assert drive.error_m() < 0.01
