"""A proven pose: kept while it fits as well as any other, given up once another place is clearly better."""

import itertools

import numpy as np
import pytest
from benchmarks.shared.rooms import ROOM, rectangle, room_scan

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.slam.localization.amcl import Amcl
from thumper_hil.world.world import World

GRID = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()
# Clutter around the robot's path that the map does not have: it hides more than half of the walls.
CLUTTER = [
    rectangle(x, y, x + 0.3, y + 0.3)
    for x, y in ((0.4, 1.0), (-0.6, 1.0), (0.4, -0.9), (-0.6, -0.9), (1.0, 0.2), (-1.2, 0.0))
]


def drive(
    robot: Amcl, poses: list[Pose2], odometry: Pose2, walls: FloatArray
) -> tuple[Pose2, list[float], int]:
    """Return odometry at the end, the error at each scan, and how many scans were lost."""
    errors, lost, rng = [], 0, np.random.default_rng(2)
    for before, pose in itertools.pairwise([poses[0], *poses]):
        odometry = odometry @ before.inverse() @ pose
        scan = room_scan(pose, noise_m=0.01, rng=rng, walls=walls)
        errors.append(robot.update(odometry, scan, Twist2()).map_from_base.distance_m(pose))
        lost += bool(robot.quality().lost)
    return odometry, errors, lost


def proven() -> tuple[Amcl, Pose2, Pose2]:
    """Return a robot that has driven back and forth in the room, its odometry and its true pose."""
    line = [Pose2(x_m=0.05 * k - 0.4, y_m=0.1) for k in range(30)]
    robot = Amcl(GRID, map_from_base=line[0])
    odometry, errors, lost = drive(robot, line, Pose2(), ROOM)
    assert (lost, robot._trust.proven) == (0, True)
    assert max(errors) < 0.05
    return robot, odometry, line[-1]


def test_proven_pose_is_kept_in_a_room_that_has_changed() -> None:
    robot, odometry, pose = proven()
    back = [pose @ Pose2(x_m=-0.03 * k, theta_rad=0.02 * k) for k in range(40)]
    _, errors, _ = drive(robot, back, odometry, np.concatenate((ROOM, *CLUTTER)))
    assert max(errors) < 0.15
    assert robot.relocalizations == 0


def test_carried_robot_gives_its_proven_pose_up() -> None:
    robot, odometry, _ = proven()
    elsewhere = Pose2(x_m=2.3, y_m=-0.9, theta_rad=2.5)
    path = [elsewhere @ Pose2(x_m=0.12 * min(k, 4)) for k in range(60)]  # a lost robot is not driven on
    _, errors, lost = drive(robot, path, odometry, ROOM)
    assert lost > 0
    assert robot.quality().lost == ""
    assert errors[-1] < 0.05


@pytest.mark.parametrize("to", [Pose2(x_m=2.0, y_m=0.0, theta_rad=-2.0), Pose2(x_m=-1.5, y_m=1.2)])
def test_robot_carried_at_rest_finds_itself_without_driving(to: Pose2) -> None:
    robot, odometry, _ = proven()
    scans = [room_scan(to, noise_m=0.01, rng=np.random.default_rng(k)) for k in range(20)]
    updates = [robot.update(odometry, scan, Twist2()) for scan in scans]
    assert updates[-1].map_from_base.distance_m(to) < 0.02
    assert robot.relocalizations == 1
    assert robot.quality().lost == ""


def test_robot_at_rest_keeps_its_pose_while_people_hide_the_walls() -> None:
    robot, odometry, pose = proven()
    walls, rng = np.concatenate((ROOM, *CLUTTER)), np.random.default_rng(3)
    for _ in range(60):
        robot.update(odometry, room_scan(pose, noise_m=0.01, rng=rng, walls=walls), Twist2())
    assert robot.relocalizations == 0
    assert robot.map_from_base.distance_m(pose) < 0.05
    assert robot.quality().lost == ""
