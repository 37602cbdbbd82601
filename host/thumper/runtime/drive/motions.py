"""Simple motions by the pose in the map: straight ahead, and a turn in place. Pure.

The counterparts of `drive_on_heading` and `spin` in Nav2's behavior server. A motion that has stopped beside
its end moves again, so that the errors of several motions do not add up.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from thumper.common.geometry import Pose2, Twist2, wrap_angle
from thumper.navigation.controllers.rotate_in_place import SLOWEST_TURN_RAD_S
from thumper.navigation.costmap.local_model import ObstaclePoints
from thumper.navigation.navigator import USUAL_PERIOD_S
from thumper.navigation.safety.collision_monitor import CollisionMonitor, with_cure
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed
from thumper.runtime.drive.data_age import waits_for_scan
from thumper.runtime.state_estimator import RobotState

SLOWEST_M_S = 0.04
HEADING_GAIN = 2.5  # turn rate per heading error [1/s]
CROSS_TRACK_GAIN = 6.0  # turn rate per speed and distance from the line [1/m^2]
TOLERANCE_M, TOLERANCE_RAD = 0.01, 0.01
STILL_M_S, STILL_RAD_S = 0.01, 0.03
STILL_CYCLES = 3  # until the newest scan shows where the robot stopped
MAX_CORRECTIONS = 3
BLOCKED_CYCLES = 10
PATIENCE_S, PATIENCE_FACTOR = 5.0, 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionEnd:
    """How a motion ended."""

    done: bool
    reason: str


Motion = Callable[[RobotState], Twist2 | MotionEnd]  # the next command, once per control cycle


class Axis:
    """Brings one coordinate, in m or rad, to its end: accelerate, brake, wait until still, correct."""

    def __init__(
        self, *, speed: float, accel: float, slowest: float, latency_s: float, still: float, tolerance: float
    ) -> None:
        self._top_speed, self._accel, self._slowest = speed, accel, slowest
        self._latency_s, self._still, self._tolerance = latency_s, still, tolerance
        self._speed = 0.0
        self._corrections = self._still_cycles = 0
        self._braking = False

    def next_speed(self, remaining: float, measured: float) -> float | None:
        """Return the signed speed; None at the end."""
        if self._braking:
            self._still_cycles = self._still_cycles + 1 if abs(measured) < self._still else 0
            if self._still_cycles < STILL_CYCLES:
                return 0.0
            self._corrections += 1
            if abs(remaining) <= self._tolerance or self._corrections > MAX_CORRECTIONS:
                return None
            self._braking, self._still_cycles, self._speed = False, 0, 0.0
        elif abs(remaining) <= abs(measured) * self._latency_s or remaining * self._speed < 0.0:
            self._braking = True
            return 0.0
        speed = stoppable_speed(abs(remaining), self._accel, self._latency_s)
        speed = math.copysign(min(max(speed, self._slowest), self._top_speed), remaining)
        slowest = math.copysign(self._slowest, remaining)
        self._speed = step_toward(self._speed or slowest, speed, self._accel * USUAL_PERIOD_S)
        return self._speed


def drive_on_heading(distance_m: float, limits: SpeedLimits, start: Pose2) -> Motion:
    """Return the motion along the heading of `start` for `distance_m`, backward if negative.

    The robot returns to that line if it is beside it (Kanayama et al. 1990, eq. 8).
    """
    axis = Axis(
        speed=limits.v_max_m_s,
        accel=limits.v_accel_m_s2,
        slowest=SLOWEST_M_S,
        latency_s=limits.latency_s,
        still=STILL_M_S,
        tolerance=TOLERANCE_M,
    )

    def next_command(state: RobotState) -> Twist2 | MotionEnd:
        offset = start.inverse() @ state.map_from_base
        v_m_s = axis.next_speed(distance_m - offset.x_m, state.twist.v_m_s)
        if v_m_s is None:
            back = " back" if distance_m < 0.0 else ""
            return MotionEnd(done=True, reason=f"drove {abs(offset.x_m):.2f} m{back}")
        w_rad_s = 0.0
        if v_m_s:
            w_rad_s = -HEADING_GAIN * offset.theta_rad - CROSS_TRACK_GAIN * v_m_s * offset.y_m
        return Twist2(v_m_s=v_m_s, w_rad_s=min(max(w_rad_s, -limits.w_max_rad_s), limits.w_max_rad_s))

    return _limited(next_command, abs(distance_m) / limits.v_max_m_s)


def spin(angle_rad: float, limits: SpeedLimits, heading_rad: float) -> Motion:
    """Return the turn in place by `angle_rad` from a heading in the map; it may exceed a full turn."""
    axis = Axis(
        speed=limits.w_max_rad_s,
        accel=limits.w_accel_rad_s2,
        slowest=SLOWEST_TURN_RAD_S,
        latency_s=limits.latency_s,
        still=STILL_RAD_S,
        tolerance=TOLERANCE_RAD,
    )
    last_rad, turned_rad = heading_rad, 0.0

    def next_command(state: RobotState) -> Twist2 | MotionEnd:
        nonlocal last_rad, turned_rad
        turned_rad += wrap_angle(state.map_from_base.theta_rad - last_rad)
        last_rad = state.map_from_base.theta_rad
        w_rad_s = axis.next_speed(angle_rad - turned_rad, state.twist.w_rad_s)
        if w_rad_s is None:
            return MotionEnd(done=True, reason=f"turned {math.degrees(turned_rad):.0f} degrees")
        return Twist2(w_rad_s=w_rad_s)

    return _limited(next_command, abs(angle_rad) / limits.w_max_rad_s)


def of_newest_scan(state: RobotState) -> ObstaclePoints:
    """Return the hits of the newest scan, in the map."""
    return ObstaclePoints.of_hits(state.hits_in_map_m)


def before_obstacles(
    motion: Motion,
    monitor: CollisionMonitor,
    obstacles: Callable[[RobotState], ObstaclePoints] = of_newest_scan,
    *,
    cure: str = "",
) -> Motion:
    """Return the motion, stopped before it touches one of the obstacles, in the map, or without a scan.

    It goes on if a false return or a person is gone in the next scans; otherwise it ends. `cure` says what to
    do about unseen ground.
    """
    blocked_cycles = 0

    def next_command(state: RobotState) -> Twist2 | MotionEnd:
        nonlocal blocked_cycles
        if not (problem := waits_for_scan(state)):
            command = motion(state)
            if isinstance(command, MotionEnd):
                return command
            points_m, error_m, seen = obstacles(state).in_base(state.map_from_base)
            stop = monitor.stop_reason(command, state.twist, points_m, error_m, USUAL_PERIOD_S, seen=seen)
            if stop is None:
                blocked_cycles = 0
                return command
            problem = stop
        blocked_cycles += 1
        if blocked_cycles <= BLOCKED_CYCLES:
            return Twist2()
        return MotionEnd(done=False, reason=with_cure(problem, cure))

    return next_command


def _limited(motion: Motion, expected_s: float) -> Motion:
    """Return the motion, ended when it takes much longer than expected: the wheels slip."""
    started_s: float | None = None

    def next_command(state: RobotState) -> Twist2 | MotionEnd:
        nonlocal started_s
        started_s = state.time_s if started_s is None else started_s
        elapsed_s = state.time_s - started_s
        if elapsed_s > PATIENCE_S + PATIENCE_FACTOR * expected_s:
            return MotionEnd(done=False, reason=f"not done after {elapsed_s:.0f} s; do the wheels slip?")
        return motion(state)

    return next_command
