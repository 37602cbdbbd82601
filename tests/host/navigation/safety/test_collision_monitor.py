"""The collision monitor alone: points against motions with a closed form."""

import math

import numpy as np
import pytest
from pydantic import TypeAdapter

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import (
    CREEP_FRACTION,
    DEEPER_M,
    STEP_S,
    UNSEEN,
    CollisionMonitor,
    CollisionMonitorOptions,
    deepening_point,
    steps_to_contact,
    with_cure,
)
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp, stoppable_speed

LIMITS = SpeedLimits()
MONITOR = CollisionMonitor(CollisionMonitorOptions(), LIMITS, Footprint())
FRONT_M, SIDE_M, MARGIN_M = 0.21, 0.15, 0.02


def at(x_m: float, y_m: float) -> FloatArray:
    return np.array(((x_m, y_m),))


def stop_reason(command: Twist2, twist: Twist2, hits_m: FloatArray) -> str | None:
    return MONITOR.stop_reason(command, twist, hits_m, np.zeros(len(hits_m)), 0.1)


@pytest.mark.parametrize("v_m_s", [0.1, 0.25, 0.4])
def test_stops_exactly_if_the_stopping_distance_reaches_the_point(v_m_s: float) -> None:
    """Distance: latency and one period at full speed, then v^2 / 2a."""
    stopping_m = v_m_s * (LIMITS.latency_s + 0.1) + v_m_s**2 / (2.0 * LIMITS.v_accel_m_s2)
    edge_m = FRONT_M + MARGIN_M + stopping_m
    moving = Twist2(v_m_s=v_m_s)
    assert stop_reason(moving, moving, at(edge_m - 0.02, 0.0))
    assert not stop_reason(moving, moving, at(edge_m + 0.02, 0.0))
    assert not stop_reason(moving, moving, at(FRONT_M + MARGIN_M + 0.01, SIDE_M + MARGIN_M + 0.005))


def test_reason_names_the_place_of_the_obstacle() -> None:
    ahead = stop_reason(Twist2(v_m_s=0.4), Twist2(), at(0.30, 0.05))
    assert ahead == "stopped before an obstacle 0.30 m ahead of the robot's centre, 0.05 m to its left"
    behind = stop_reason(Twist2(v_m_s=-0.4), Twist2(), at(-0.30, -0.05))
    assert behind == "stopped before an obstacle 0.30 m behind the robot's centre, 0.05 m to its right"


def test_rotation_sweeps_the_corners() -> None:
    turning = Twist2(w_rad_s=1.0)
    corner_m = math.hypot(FRONT_M, SIDE_M)
    beside = at(0.0, corner_m - 0.01)
    fast = Twist2(w_rad_s=0.9)
    poses_needed_rad = math.pi / 2 - math.atan2(SIDE_M, FRONT_M)  # until the front left corner is abeam
    assert not stop_reason(turning, Twist2(), at(0.0, corner_m + 0.05))
    ahead_of_corner = corner_m * np.array(((math.cos(0.9), math.sin(0.9)),))
    assert poses_needed_rad > 0.9
    assert stop_reason(turning, turning, ahead_of_corner)
    assert not stop_reason(Twist2(w_rad_s=-0.3), Twist2(), ahead_of_corner)
    assert stop_reason(fast, fast, beside) is None  # stops before it gets that far round


def test_position_error_adds_to_the_margin() -> None:
    """Beside the rear, where a right turn swings the corner out: 3.5 cm are enough, or not."""
    turning, beside = Twist2(w_rad_s=-0.2), at(-0.19, SIDE_M + 0.035)
    assert not MONITOR.stop_reason(turning, Twist2(), beside, np.zeros(1), 0.1)
    assert MONITOR.stop_reason(turning, Twist2(), beside, np.array((0.02,)), 0.1)


def test_creeping_ends_after_a_quarter_of_the_margin() -> None:
    """Many cycles, each from standstill; a point with an error of 2 cm stays 3.5 cm away."""
    for error_m in (0.0, 0.02):
        gap_m = MARGIN_M + error_m - 0.001
        for _ in range(100):
            point, error = at(FRONT_M + gap_m, 0.0), np.array((error_m,))
            if not MONITOR.stop_reason(Twist2(v_m_s=0.01), Twist2(), point, error, 0.1):
                gap_m -= 0.002
        assert gap_m == pytest.approx(error_m + 0.75 * MARGIN_M, abs=0.004)


def test_touching_robot_may_leave_but_not_press_on() -> None:
    touching = at(FRONT_M + 0.01, 0.0)
    assert not stop_reason(Twist2(v_m_s=-0.1), Twist2(), touching)
    assert not stop_reason(Twist2(), Twist2(), touching)
    assert stop_reason(Twist2(v_m_s=0.1), Twist2(), touching)


def test_no_hits_no_stop() -> None:
    assert stop_reason(Twist2(v_m_s=0.4), Twist2(v_m_s=0.4), np.empty((0, 2))) is None


@pytest.mark.parametrize("distance", [0.0, 0.05, 0.4, 3.0])
def test_stoppable_speed_solves_its_equation(distance: float) -> None:
    v = stoppable_speed(distance, 0.4, 0.2)
    assert v * 0.2 + v**2 / (2 * 0.4) == pytest.approx(distance)


def test_bend_that_straightens_early_is_checked() -> None:
    """In a fast left bend: a post that only a straight exit from the bend would reach."""
    bend = Twist2(v_m_s=0.45, w_rad_s=0.9)
    driven_s = LIMITS.latency_s + 0.1
    turned_rad = bend.w_rad_s * driven_s
    radius_m = bend.v_m_s / bend.w_rad_s
    begin_m = radius_m * np.array((math.sin(turned_rad), 1.0 - math.cos(turned_rad)))
    ahead = np.array((math.cos(turned_rad), math.sin(turned_rad)))
    right = np.array((ahead[1], -ahead[0]))
    post_m = begin_m + (FRONT_M + 0.15) * ahead + 0.9 * SIDE_M * right
    assert stop_reason(bend, bend, post_m[None, :])


def test_creeping_never_adds_up_to_a_contact() -> None:
    """Each cycle drives the motion that the monitor allows; the point is 20 mm ahead at first."""
    gap_m = 0.02
    for _ in range(500):
        moved_m = 0.0
        for step_m in (0.003, 0.001, 0.0003, 0.0001):
            slow = Twist2(v_m_s=step_m / (LIMITS.latency_s + 0.1))
            if not stop_reason(slow, Twist2(), at(FRONT_M + gap_m, 0.0)):
                moved_m = step_m
                break
        gap_m -= moved_m
    assert gap_m > 0.012


def test_noise_at_standstill_never_adds_up_to_a_contact() -> None:
    """Backs up whenever that is allowed, toward a post 20 mm behind, with a noisy measured twist."""
    rng, gap_m, slow = np.random.default_rng(0), 0.02, Twist2(v_m_s=-0.02)
    for _ in range(500):
        measured = Twist2(v_m_s=0.01 * rng.standard_normal(), w_rad_s=0.02 * rng.standard_normal())
        if not stop_reason(slow, measured, at(-FRONT_M - gap_m, 0.0)):
            gap_m -= 0.1 * abs(slow.v_m_s)
    assert gap_m > 0.007


@pytest.mark.parametrize(("gap_m", "part"), [(0.10, 0.4), (0.24, 0.6), (0.36, 0.9), (0.6, 1.0)])
def test_slow_zone_scales_both_speeds_by_the_time_to_contact(gap_m: float, part: float) -> None:
    slow = MONITOR.slow_down(Twist2(v_m_s=0.4), at(FRONT_M + gap_m, 0.0))
    assert slow.v_m_s == pytest.approx(part * 0.4, abs=0.06 * 0.4)
    bent = MONITOR.slow_down(Twist2(v_m_s=0.4, w_rad_s=0.2), at(FRONT_M + gap_m, 0.0))
    assert bent.w_rad_s == pytest.approx(0.5 * bent.v_m_s)


ROBOT = ((-FRONT_M, -SIDE_M), (FRONT_M, SIDE_M))  # least and greatest x and y
ASYMMETRIC = ((-0.25, -0.12), (0.17, 0.2))


def depths_m(
    points_m: FloatArray,
    pose: FloatArray,
    margins_m: FloatArray,
    corners: tuple[tuple[float, float], tuple[float, float]] = ROBOT,
    shift_m: float = 0.0,
) -> FloatArray:
    """Return how deep each point is in the rectangle of a robot at `pose`, shape (n,); negative outside.

    The robot may be further to either side by `shift_m`.
    """
    x_m, y_m = Pose2(x_m=pose[0], y_m=pose[1], theta_rad=pose[2]).inverse().apply(points_m).T
    (rear_m, right_m), (front_m, left_m) = corners
    inside_m: FloatArray = np.min(
        [x_m - rear_m, front_m - x_m, y_m - right_m + shift_m, left_m - y_m + shift_m], axis=0
    )
    return margins_m + inside_m


def asymmetric() -> FloatArray:
    """Return the half planes of a robot whose base_link is not in the middle."""
    (rear_m, right_m), (front_m, left_m) = ASYMMETRIC
    corners = ((rear_m, right_m), (front_m, right_m), (front_m, left_m), (rear_m, left_m))
    return Footprint(vertices_m=corners).half_planes()


@pytest.mark.parametrize("seed", range(6))
def test_first_contact_is_that_of_the_rectangle(seed: int) -> None:
    """Random points and motions, compared with the rectangle's own depth."""
    rng = np.random.default_rng(seed)
    half_planes, count = asymmetric(), np.zeros(2, int)
    for _ in range(40):
        points_m = rng.uniform(-0.6, 0.6, (int(rng.integers(1, 4)), 2))
        poses = np.cumsum(rng.uniform(-0.1, 0.1, (8, 3)) * (1.0, 1.0, 4.0), axis=0)
        inside = [bool((depths_m(points_m, pose, np.zeros(1), ASYMMETRIC) > 0.0).any()) for pose in poses]
        expected = inside.index(True) if any(inside) else len(poses)
        assert steps_to_contact(points_m, half_planes, poses) == expected
        count[int(any(inside))] += 1
    assert count.min() > 3  # both cases occurred


@pytest.mark.parametrize("seed", range(6))
def test_deepening_point_is_the_first_that_the_motion_brings_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half_planes, creep_m, found = asymmetric(), 0.01, set[int]()
    for _ in range(60):
        count = int(rng.integers(1, 4))
        points_m = rng.uniform(-0.3, 0.3, (count, 2)) * (1.0, 0.7)
        margins_m = rng.uniform(0.0, 0.05, count)
        poses = np.cumsum(rng.uniform(-0.003, 0.003, (6, 3)) * (1.0, 1.0, 8.0), axis=0)
        shifts_m = rng.uniform(0.0, 0.004, 6)
        before_m = depths_m(points_m, np.zeros(3), margins_m, ASYMMETRIC)
        slack_m = np.clip(creep_m - before_m, 1e-9, DEEPER_M)
        allowed_m = np.maximum(0.0, before_m + slack_m)
        after_m = np.max(
            [
                depths_m(points_m, pose, margins_m, ASYMMETRIC, shift_m)
                for pose, shift_m in zip(poses, shifts_m, strict=True)
            ],
            axis=0,
        )
        deeper = np.flatnonzero(after_m > allowed_m)
        expected = int(deeper[0]) if deeper.size else -1
        assert deepening_point(points_m, margins_m, creep_m, half_planes, poses, shifts_m) == expected
        found.add(expected)
    assert {-1, 0, 1} <= found
    assert (DEEPER_M, CREEP_FRACTION) == (0.003, 0.25)


def test_reach_of_the_check_includes_the_largest_error() -> None:
    """A point that only its own position error brings near, beside one without an error."""
    moving = Twist2(v_m_s=0.4)
    points_m, error_m = np.array(((-1.0, 1.0), (0.62, 0.0))), np.array((0.0, 0.12))
    assert MONITOR.stop_reason(moving, moving, points_m, error_m, 0.1)
    assert not MONITOR.stop_reason(moving, moving, points_m, np.zeros(2), 0.1)


def test_slow_zone_follows_the_bend() -> None:
    """A post beside the straight path that a left bend reaches, and one that it avoids."""
    bend = Twist2(v_m_s=0.4, w_rad_s=1.0)
    assert MONITOR.slow_down(bend, at(0.42, 0.25)).v_m_s < 0.39
    assert MONITOR.slow_down(bend, at(0.58, -0.12)) == bend
    assert MONITOR.slow_down(Twist2(v_m_s=0.4), at(0.58, -0.12)).v_m_s < 0.39
    assert MONITOR.slow_down(Twist2(w_rad_s=1.0), at(0.0, 0.2)) == Twist2(w_rad_s=1.0)  # turning in place


def reference_poses(
    command: Twist2, twist: Twist2, limits: SpeedLimits, period_s: float, *, turns_on: bool
) -> FloatArray:
    """Return the poses of a stopping robot step by step, from the wheels: shape (n, 3)."""
    ramp, poses, pose = WheelRamp.from_drive(limits), list[tuple[float, float, float]](), (0.0, 0.0, 0.0)
    turn_m_s = ramp.half_track_m * command.w_rad_s
    slowest_s = max(
        abs(command.v_m_s) / limits.v_accel_m_s2,
        abs(command.w_rad_s) / limits.w_accel_rad_s2,
        (abs(command.v_m_s) + abs(turn_m_s)) / ramp.decel_m_s2,
    )
    steps = math.ceil((limits.latency_s + period_s + slowest_s) / STEP_S - 1e-9)
    for k in range(steps):
        time_s = (k + 0.5) * STEP_S
        fading_s = time_s - limits.latency_s - period_s
        v, w = (twist if time_s <= limits.latency_s else command).v_m_s, twist.w_rad_s
        if time_s > limits.latency_s:
            w = command.w_rad_s
        if fading_s > 0.0:
            sides = [
                math.copysign(max(0.0, abs(rim) - ramp.decel_m_s2 * fading_s), rim)
                for rim in (command.v_m_s - turn_m_s, command.v_m_s + turn_m_s)
            ]
            v = _slower(command.v_m_s, limits.v_accel_m_s2 * fading_s, 0.5 * (sides[0] + sides[1]))
            w_ramp = 0.5 * (sides[1] - sides[0]) / ramp.half_track_m
            w = _slower(command.w_rad_s, limits.w_accel_rad_s2 * fading_s, w_ramp) if turns_on else 0.0
        heading = pose[2] + 0.5 * w * STEP_S
        pose = (
            pose[0] + v * math.cos(heading) * STEP_S,
            pose[1] + v * math.sin(heading) * STEP_S,
            pose[2] + w * STEP_S,
        )
        poses.append(pose)
    return np.array(poses)


def _slower(speed: float, lost: float, ramp: float) -> float:
    """Return the speed after it has faded by `lost`, or that of the wheels' ramp if it is more."""
    sign = math.copysign(1.0, speed)
    return sign * max(0.0, abs(speed) - lost, sign * ramp)


@pytest.mark.parametrize("turns_on", [True, False])
@pytest.mark.parametrize(
    ("v_m_s", "w_rad_s"), [(0.4, 0.0), (-0.2, 0.0), (0.0, 1.1), (0.3, -0.9), (0.1, 1.2), (-0.2, 0.7)]
)
@pytest.mark.parametrize(
    "limits",
    [LIMITS, SpeedLimits(v_accel_m_s2=0.2), SpeedLimits(w_accel_rad_s2=0.4), SpeedLimits(latency_s=0.31)],
)
def test_stopping_motion_is_that_of_the_limits(
    limits: SpeedLimits, v_m_s: float, w_rad_s: float, *, turns_on: bool
) -> None:
    command, twist = Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s), Twist2(v_m_s=0.25, w_rad_s=0.4)
    monitor = CollisionMonitor(CollisionMonitorOptions(), limits, Footprint())
    poses = monitor._stopping_poses(command, twist, 0.13, turns_on=turns_on)
    expected = reference_poses(command, twist, limits, 0.13, turns_on=turns_on)
    assert poses == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("centre_m", [-0.05, 0.05])
def test_an_allowed_turn_touches_nothing_about_a_centre_that_is_off(centre_m: float) -> None:
    """Random turns and points: the base turns about a point 5 cm ahead of its middle, or behind it."""
    rng, allowed = np.random.default_rng(4), 0
    for _ in range(400):
        turn = Twist2(v_m_s=rng.uniform(-0.3, 0.3), w_rad_s=rng.uniform(-1.2, 1.2))
        point_m = rng.uniform(-0.4, 0.4, (1, 2))
        if depths_m(point_m, np.zeros(3), np.zeros(1)) > -MARGIN_M or stop_reason(turn, turn, point_m):
            continue
        allowed += 1
        poses = reference_poses(turn, turn, LIMITS, 0.1, turns_on=True)
        turns_rad = np.diff(poses[:, 2], prepend=0.0)
        headings_rad = poses[:, 2] - 0.5 * turns_rad
        left = np.column_stack((-np.sin(headings_rad), np.cos(headings_rad)))
        poses[:, :2] -= np.cumsum(centre_m * turns_rad[:, None] * left, axis=0)
        deepest_m = max(float(depths_m(point_m, pose, np.zeros(1))[0]) for pose in poses)
        assert deepest_m < -0.8 * MARGIN_M, (turn, point_m)
    assert allowed > 100


@pytest.mark.parametrize("slow_s", [0.8, 1.3])
def test_slow_zone_against_the_rectangle_along_the_arc(slow_s: float) -> None:
    """Random commands and points; the part of the speed is the time to the first contact."""
    rng, slowed = np.random.default_rng(3), 0
    monitor = CollisionMonitor(CollisionMonitorOptions(slow_s=slow_s, slow_part=0.3), LIMITS, Footprint())
    for _ in range(150):
        command = Twist2(v_m_s=rng.uniform(-0.4, 0.4), w_rad_s=rng.uniform(-2.5, 2.5))
        points_m = rng.uniform(-0.6, 0.6, (2, 2))
        pose, free, steps = [0.0, 0.0, 0.0], 0, math.ceil(slow_s / STEP_S - 1e-9) - 1
        for free in range(steps + 1):
            if free == steps:
                break
            heading = pose[2] + 0.5 * command.w_rad_s * STEP_S
            pose[0] += command.v_m_s * STEP_S * math.cos(heading)
            pose[1] += command.v_m_s * STEP_S * math.sin(heading)
            pose[2] += command.w_rad_s * STEP_S
            if (depths_m(points_m, np.array(pose), np.zeros(1)) > 0.0).any():
                break
        part = 1.0 if free == steps else max(0.3, free * STEP_S / slow_s)
        slowed += part < 1.0
        assert monitor.slow_down(command, points_m).v_m_s == pytest.approx(part * command.v_m_s)
        assert monitor.slow_down(command, points_m).w_rad_s == pytest.approx(part * command.w_rad_s)
    assert 20 < slowed < 130


@pytest.mark.parametrize(
    ("command", "twist", "starts"),
    [
        (Twist2(v_m_s=0.1), Twist2(v_m_s=0.1), {(0.1, 0.0, True)}),
        (Twist2(v_m_s=0.1), Twist2(v_m_s=0.03), {(0.03, 0.0, True)}),
        (Twist2(v_m_s=0.1), Twist2(v_m_s=0.029), {(0.029, 0.0, True), (0.0, 0.0, True)}),
        (Twist2(v_m_s=0.1), Twist2(w_rad_s=0.06), {(0.0, 0.06, True)}),
        (Twist2(v_m_s=0.1), Twist2(w_rad_s=0.059), {(0.0, 0.059, True), (0.0, 0.0, True)}),
        (Twist2(w_rad_s=0.2), Twist2(v_m_s=-0.1), {(-0.1, 0.0, True), (-0.1, 0.0, False)}),
    ],
)
def test_motions_that_are_checked(
    command: Twist2, twist: Twist2, starts: set[tuple[float, float, bool]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the measured twist, from standstill if that is noise, and a bend that straightens at once."""
    checked = set[tuple[float, float, bool]]()
    poses = MONITOR._stopping_poses

    def noted(command: Twist2, start: Twist2, period_s: float, *, turns_on: bool) -> FloatArray:
        checked.add((start.v_m_s, start.w_rad_s, turns_on))
        return poses(command, start, period_s, turns_on=turns_on)

    monkeypatch.setattr(MONITOR, "_stopping_poses", noted)
    assert not stop_reason(command, twist, at(5.0, 5.0))
    assert checked == starts


def test_reason_tells_obstacles_from_ground_never_seen() -> None:
    moving, far, near = Twist2(v_m_s=0.4), (5.0, 5.0), (0.4, 0.0)
    for points, seen, words in (
        ((far, near), 1, "ground that the lidar has never seen"),
        ((near, far), 1, "an obstacle"),
        ((far, near), 2, "an obstacle"),
        ((far, near), None, "an obstacle"),
    ):
        reason = MONITOR.stop_reason(moving, moving, np.array(points), np.zeros(2), 0.1, seen=seen)
        assert reason is not None
        assert f"before {words} 0.40 m" in reason


@pytest.mark.parametrize(
    ("option", "good", "wrong"),
    [("margin_m", 0.0, -0.01), ("slow_s", 0.0, -0.1), ("slow_part", 1.0, 1.1), ("slow_part", 0.01, 0.0)],
)
def test_options_have_limits(option: str, good: float, wrong: float) -> None:
    options = TypeAdapter(CollisionMonitorOptions)
    options.validate_python({option: good})
    with pytest.raises(ValueError, match=option):
        options.validate_python({option: wrong})


def test_a_cure_follows_the_reason_of_unseen_ground_alone() -> None:
    assert with_cure(UNSEEN, "drive ahead") == f"{UNSEEN}; drive ahead"
    assert with_cure(UNSEEN, "") == UNSEEN
    assert with_cure("an obstacle", "drive ahead") == "an obstacle"
