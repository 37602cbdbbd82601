"""Dynamic obstacles: people are detected, flickering surfaces and lost echoes are not."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.dynamic_obstacles import DynamicObstacleOptions, DynamicObstacles
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.kinematic.world import KinematicWorld, box

VIEW = FieldOfView(base_from_laser=Pose2())
ANGLES_RAD = np.linspace(-2.09, 2.09, 683)
LEGS = np.array(((0.9, 0.25, 0.03), (0.9, -0.15, 0.03)))
FORWARD = Twist2(v_m_s=0.3)


def detector() -> DynamicObstacles:
    return DynamicObstacles(DynamicObstacleOptions(), SpeedLimits(), Footprint(), VIEW)


def scan(
    world: KinematicWorld, rng: np.random.Generator, *, lost: float = 0.0, pose: Pose2 | None = None
) -> FloatArray:
    pose = pose or Pose2()
    ranges_m = world.cast(pose, ANGLES_RAD, 4.0) + 0.01 * rng.standard_normal(ANGLES_RAD.size)
    echo = np.isfinite(ranges_m) & (rng.random(ANGLES_RAD.size) >= lost)
    ends_m = np.column_stack((np.cos(ANGLES_RAD), np.sin(ANGLES_RAD)))[echo] * ranges_m[echo, None]
    return pose.apply(ends_m)


def hall(circles_m: FloatArray) -> KinematicWorld:
    walls = KinematicWorld.from_boxes(box(0.0, 0.0, 7.0, 5.0))
    return KinematicWorld(segments_m=walls.segments_m, circles_m=circles_m)


@pytest.mark.parametrize("speed_m_s", [0.8, 1.2])
@pytest.mark.parametrize("width_m", [5.0, 30.0], ids=["room", "open hall"])
def test_a_crossing_person_is_detected(speed_m_s: float, width_m: float) -> None:
    """In the open hall no beam has an echo from behind the person."""
    rng, found, detected = np.random.default_rng(0), detector(), 0
    for cycle in range(15):
        person = np.array(((1.2, -0.8 + speed_m_s * 0.1 * cycle, 0.2),))
        walls = KinematicWorld.from_boxes(box(0.0, 0.0, width_m, width_m))
        world = KinematicWorld(segments_m=walls.segments_m, circles_m=person)
        found.update(0.1 * cycle, Pose2(), scan(world, rng))
        speeds = [math.hypot(*moving.velocity_m_s) for moving in found.moving]
        detected += any(abs(speed - speed_m_s) < 0.3 * speed_m_s for speed in speeds)
    assert detected >= 8
    assert found.have_moved_lately(1.5)
    assert not found.have_moved_lately(10.0)


def test_the_swinging_leg_of_a_person_who_comes_is_detected() -> None:
    """One leg rests, the other swings past it at 2.4 m/s: twice the speed of a person in a hurry."""
    rng, found = np.random.default_rng(5), detector()
    detected = []
    for cycle in range(6):
        legs_m = np.array(((1.6, -0.2, 0.06), (2.2 - 0.24 * max(0, cycle - 1), 0.1, 0.06)))
        found.update(0.1 * cycle, Pose2(), scan(hall(legs_m), rng))
        detected.append(bool(found.moving))
    assert detected[4:] == [True, True]


def test_after_missed_scans_a_far_object_is_another_one() -> None:
    rng, found = np.random.default_rng(6), detector()
    for time_s, y_m in ((0.0, -0.8), (0.1, -0.8), (0.8, 0.8)):
        found.update(time_s, Pose2(), scan(hall(np.array(((1.6, y_m, 0.06),))), rng))
    assert not found.moving


def test_a_flickering_leg_beside_another_does_not_move() -> None:
    rng = np.random.default_rng(1)
    for flicker in (0.1, 0.3, 0.5, 0.9):
        found = detector()
        for cycle in range(200):
            legs = LEGS if rng.random() < flicker else LEGS[:1]
            found.update(0.1 * cycle, Pose2(), scan(hall(legs), rng))
            assert found.stop_reason(FORWARD, FORWARD, Pose2(), found.moving) is None, (flicker, cycle)


def test_lost_echoes_are_no_movers() -> None:
    """20 % of the echoes are lost, in a room with thin legs, standing and driving."""
    rng, legs = np.random.default_rng(2), np.random.default_rng(3).uniform(-2.2, 2.2, (14, 2))
    legs = legs[np.hypot(*legs.T) > 0.6]
    world, found, moving = hall(np.column_stack((legs, np.full(len(legs), 0.03)))), detector(), 0
    for cycle in range(300):
        pose = Pose2(x_m=0.3 * math.sin(0.05 * cycle), theta_rad=0.4 * math.sin(0.08 * cycle))
        found.update(0.1 * cycle, pose, scan(world, rng, lost=0.2, pose=pose))
        moving += bool(found.moving)
    assert moving <= 3


def test_a_jump_of_the_map_is_no_motion() -> None:
    rng, found = np.random.default_rng(4), detector()
    for cycle in range(10):
        found.update(0.1 * cycle, Pose2(), scan(hall(LEGS), rng))
    found.move(Pose2(y_m=0.4))
    found.update(1.0, Pose2(y_m=0.4), Pose2(y_m=0.4).apply(scan(hall(LEGS), rng)))
    assert not found.moving


def test_what_the_oldest_scan_saw_rests_and_who_walks_does_not() -> None:
    rng, found = np.random.default_rng(7), detector()
    for cycle in range(10):
        circles_m = np.array(((1.6, -0.8 + 0.1 * cycle, 0.06), (1.7, 0.5, 0.06)))
        found.update(0.1 * cycle, Pose2(), scan(hall(circles_m), rng))
    places_m = np.array(((1.55, 0.1), (1.65, 0.5), (-0.5, 0.0)))  # who walks, the post, behind the lidar
    assert found.rested(places_m).tolist() == [False, True, True]
