"""Obstacle memory: points that the lidar cannot see now, their age and their position error."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.obstacle_memory import (
    ERROR_FRACTION,
    MAX_ERROR_M,
    ObstacleMemory,
    ObstacleMemoryOptions,
)
from thumper.navigation.footprint import Footprint

RADIUS_M = Footprint().circumscribed_radius_m


def memory_of_a_thumper() -> ObstacleMemory:
    view, body = FieldOfView(base_from_laser=Pose2()), Footprint()
    return ObstacleMemory(ObstacleMemoryOptions(), 0.8, view, footprint=body, padded=body)


def ring(radius_m: float) -> FloatArray:
    angles_rad = np.linspace(-2.0, 2.0, 400)
    return np.column_stack((radius_m * np.cos(angles_rad), radius_m * np.sin(angles_rad)))


def test_memory_keeps_hidden_points_and_clears_those_that_a_ray_passes() -> None:
    memory = memory_of_a_thumper()
    post = np.array(((0.6, 0.0),))
    assert len(memory.update(0.0, Pose2(), post)) == 0  # in view: nothing to add
    assert memory.update(0.1, Pose2(theta_rad=math.pi), np.empty((0, 2))) == pytest.approx(post)  # behind
    assert memory.update(0.2, Pose2(), np.array(((0.3, 0.0),))) == pytest.approx(post)  # hidden by another
    assert len(memory.update(0.3, Pose2(), ring(2.0))) == 0  # rays pass it
    memory.update(1.0, Pose2(), post)
    assert len(memory.update(30.0, Pose2(theta_rad=math.pi), np.empty((0, 2)))) == 0  # too long ago
    memory.update(31.0, Pose2(), np.vstack((post, ((0.25, 0.2),))))
    memory.forget_beyond(Pose2(), 0.4)
    left = memory.update(31.1, Pose2(theta_rad=math.pi), np.empty((0, 2)))
    assert left == pytest.approx(np.array(((0.25, 0.2),)))


def test_a_recheck_forgets_what_rays_pass_but_no_post_that_it_sees_and_remembers_nothing_new() -> None:
    memory = memory_of_a_thumper()
    post, ghost, new = np.array(((0.6, 0.0),)), np.array(((0.5, 0.4),)), np.array(((0.5, -0.4),))
    memory.update(0.0, Pose2(), np.vstack((post, ghost)))
    for time_s in (10.0, 20.0, 30.0):  # a point that is seen does not age
        left = memory.recheck(time_s, Pose2(), np.vstack((post, new, ring(2.0))), Pose2())
        assert left == pytest.approx(post)
    assert memory.update(40.0, Pose2(theta_rad=math.pi), np.empty((0, 2))) == pytest.approx(post)


def test_points_beside_the_footprint_do_not_age() -> None:
    """A robot stationary for half a minute beside a post would otherwise forget it and swing into it."""
    memory, turned = memory_of_a_thumper(), Pose2(theta_rad=3.0)
    post, further = np.array(((RADIUS_M + 0.05, 0.0),)), np.array(((RADIUS_M + 0.30, 0.1),))
    memory.update(0.0, Pose2(), np.vstack((post, further)))
    assert memory.update(600.0, turned, np.empty((0, 2))) == pytest.approx(post)
    assert len(memory.update(600.1, Pose2(), ring(2.0))) == 0  # until rays pass it


def test_what_the_robot_stands_on_is_gone() -> None:
    """Somebody stepped over the robot, or it was lifted over a post: no ray clears what is below it."""
    memory, turned = memory_of_a_thumper(), Pose2(theta_rad=3.0)
    beside, below = np.array(((-0.18, 0.0),)), np.array(((-0.15, 0.0),))
    memory.update(0.0, Pose2(x_m=-0.6), np.vstack((beside, below)))
    left = memory.update(0.1, Pose2(), np.empty((0, 2)), new_m=np.empty((0, 2)))
    assert left == pytest.approx(beside)
    assert len(memory.update(0.2, turned, np.empty((0, 2)))) == 1


def test_reset_forgets_only_what_the_lidar_can_observe_again() -> None:
    """After a reset the robot backs up, so it must remember a post behind it."""
    memory = memory_of_a_thumper()
    ahead, behind = np.array(((0.4, 0.0),)), np.array(((-0.4, 0.0),))
    memory.update(0.0, Pose2(), np.vstack((ahead, behind)))
    memory.forget_beyond(Pose2(), 0.3)
    hiding = np.array(((0.2, 0.0),))
    assert memory.update(0.1, Pose2(), hiding) == pytest.approx(behind)


def test_position_error_grows_with_the_distance_driven() -> None:
    """The pose drifts by driving and turning; pose noise at standstill adds nothing."""
    memory = memory_of_a_thumper()
    post, nothing, turned = np.array(((-0.14, 0.3),)), np.empty((0, 2)), Pose2(theta_rad=-0.2)
    memory.update(0.0, Pose2(), post)
    assert memory.position_error_m.size == 0  # in view
    memory.update(0.1, turned, nothing)
    assert memory.position_error_m == pytest.approx([ERROR_FRACTION * 0.2 * RADIUS_M])
    for i in range(100):
        memory.update(0.2, Pose2(x_m=0.003 * (i % 2), theta_rad=-0.2), nothing)
    assert memory.position_error_m == pytest.approx([ERROR_FRACTION * 0.2 * RADIUS_M])
    for i in range(10):
        memory.update(0.3, Pose2(x_m=0.3 * (i % 2), theta_rad=-0.2), nothing)
    assert memory.position_error_m == pytest.approx([MAX_ERROR_M])
    memory.update(0.4, Pose2(), post)
    memory.update(0.5, turned, nothing)
    assert memory.position_error_m == pytest.approx([ERROR_FRACTION * 0.2 * RADIUS_M])  # seen between
