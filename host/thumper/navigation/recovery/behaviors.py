"""Recovery behaviours in the order of move_base, with a back-up and a wait where the robot cannot turn.

Conservative reset, rotate, aggressive reset, rotate, then back up, wait, and give up
(http://wiki.ros.org/move_base). In a place too tight to rotate, move_base's rotation does nothing. Here the
robot backs up instead, and waits if it cannot do that either. After each behaviour the controller gets
the full `patience_s` again.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt

from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.controllers.controller import Controller, ControlRequest
from thumper.navigation.controllers.rotate_in_place import poses_are_free, straight_poses
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed

SLOWEST_BACK_UP_M_S = 0.05
BACK_UP_FRACTIONS = (1.0, 0.5, 0.25)  # of the wanted distance, tried in turn
BACK_UP_CHECK_M = 0.15  # distance behind the robot that is checked in each cycle
AT_TARGET_M, AT_TARGET_RAD = 0.01, 0.1
MAX_RECOVERY_S = 10.0
# The resets forget remembered points further away than this; points within the robot's circle stay.
CONSERVATIVE_RESET_M, AGGRESSIVE_RESET_M = 0.5, 0.3

Behaviour = Literal["conservative_reset", "aggressive_reset", "rotate", "back_up", "wait"]
DEFAULT_BEHAVIOURS: tuple[Behaviour, ...] = (
    "conservative_reset",
    "rotate",
    "aggressive_reset",
    "rotate",
    "back_up",
    "wait",
)
NAMES: dict[Behaviour, str] = {
    "conservative_reset": f"forgetting obstacles beyond {CONSERVATIVE_RESET_M:g} m",
    "aggressive_reset": f"forgetting obstacles beyond {AGGRESSIVE_RESET_M:g} m",
    "rotate": "rotating in place",
    "back_up": "backing up",
    "wait": "waiting for the path to clear",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryOptions:
    """What the robot tries when it is stuck."""

    # Behaviours in the order in which they run before the goal is aborted: conservative_reset,
    # aggressive_reset, rotate, back_up, wait. The order restarts when the robot has come nearer to the goal;
    # empty aborts at once.
    behaviours: tuple[Behaviour, ...] = DEFAULT_BEHAVIOURS
    # Distance of the first back-up [m]; each further one is longer by as much.
    back_up_m: Annotated[float, Gt(0)] = 0.20
    # Highest backward speed [m/s].
    back_up_m_s: Annotated[float, Gt(0)] = 0.15
    # Angle of a recovery rotation [rad].
    turn_rad: Annotated[float, Gt(0)] = 1.6
    # Duration of a wait [s]: the obstacle may leave.
    wait_s: Annotated[float, Ge(0)] = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveRecovery:
    """The behaviour that is running."""

    behaviour: Behaviour
    started_s: float
    start: Pose2
    target_rad: float  # heading of a rotation
    back_up_m: float
    forget_radius_m: float | None  # None: this behaviour forgets nothing


class RecoveryBehaviors:
    """Runs one behaviour at a time: `start`, then `compute_command` each cycle until it returns None."""

    def __init__(
        self, options: RecoveryOptions, limits: SpeedLimits, footprint: Footprint, controller: Controller
    ) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._controller = controller
        self._active: ActiveRecovery | None = None
        self._aborted = self._has_rotated = False
        self._back_ups = 0
        self.attempts = 0

    def restart(self) -> None:
        """Restart the order: the robot has come nearer to the goal."""
        self._aborted = self._has_rotated = False
        self._back_ups = 0
        self.attempts = 0

    def abort(self) -> None:
        """Let every further `start` return False."""
        self._aborted = True

    @property
    def name(self) -> str:
        """The newest behaviour; empty before the first."""
        return "" if self._active is None else NAMES[self._active.behaviour]

    @property
    def forget_radius_m(self) -> float | None:
        """The distance beyond which the newest behaviour forgets remembered points; None: it forgets none."""
        return None if self._active is None else self._active.forget_radius_m

    def start(self, time_s: float, request: ControlRequest, *, only_rotate: bool = False) -> bool:
        """Start the next behaviour; return False if there is none left.

        With `only_rotate` that is a rotation, unless there was one already: nothing else helps.
        """
        left = self._options.behaviours[self.attempts :]
        if self._aborted or not left or (only_rotate and (self._has_rotated or "rotate" not in left)):
            return False
        wanted = "rotate" if only_rotate else left[0]
        self._has_rotated |= wanted == "rotate"
        behaviour, back_up_m = self._possible(wanted, request)
        self._active = ActiveRecovery(
            behaviour=behaviour,
            started_s=time_s,
            start=request.map_from_base,
            target_rad=request.map_from_base.theta_rad + self._options.turn_rad,
            back_up_m=back_up_m,
            forget_radius_m=self._forget_radius_m(behaviour),
        )
        self.attempts += 1
        return True

    def compute_command(self, time_s: float, request: ControlRequest) -> Twist2 | None:
        """Return the next twist, or None when the behaviour has ended."""
        active = self._active
        if active is None or time_s - active.started_s > MAX_RECOVERY_S:
            return None
        elapsed_s = time_s - active.started_s
        if active.forget_radius_m is not None:
            return Twist2() if elapsed_s == 0.0 else None  # forgetting takes one cycle
        if active.behaviour == "back_up":
            return self._back_up(active, request)
        if active.behaviour == "rotate":
            return self._rotate(active, request)
        return Twist2() if elapsed_s < self._options.wait_s else None

    def _possible(self, wanted: Behaviour, request: ControlRequest) -> tuple[Behaviour, float]:
        """Return the wanted behaviour, or its substitute if it is not free, and the back-up distance [m]."""
        order: tuple[Behaviour, ...] = (wanted,)
        if wanted in ("rotate", "back_up"):
            order = ("rotate", "back_up") if wanted == "rotate" else ("back_up", "rotate")
        for behaviour in order:
            if behaviour == "rotate":
                if self._controller.rotate(request, self._options.turn_rad).command is not None:
                    return behaviour, 0.0
            elif behaviour == "back_up":
                longest_m = self._options.back_up_m * (1 + self._back_ups)
                for fraction in BACK_UP_FRACTIONS:
                    if self._can_back_up(request, longest_m * fraction):
                        self._back_ups += 1
                        return behaviour, longest_m * fraction
            else:
                return behaviour, 0.0
        return "wait", 0.0

    def _forget_radius_m(self, behaviour: Behaviour) -> float | None:
        circle_m = self._footprint.circumscribed_radius_m
        if behaviour == "conservative_reset":
            return max(circle_m, CONSERVATIVE_RESET_M)
        return max(circle_m, AGGRESSIVE_RESET_M) if behaviour == "aggressive_reset" else None

    def _back_up(self, active: ActiveRecovery, request: ControlRequest) -> Twist2 | None:
        left_m = active.back_up_m - active.start.distance_m(request.map_from_base)
        if left_m <= AT_TARGET_M or not self._can_back_up(request, min(left_m, BACK_UP_CHECK_M)):
            return None
        change = self._limits.v_accel_m_s2 * request.period_s
        speed = min(
            self._options.back_up_m_s,
            stoppable_speed(left_m, self._limits.v_accel_m_s2, self._limits.latency_s),
        )
        wanted_m_s = -max(speed, SLOWEST_BACK_UP_M_S)
        return Twist2(v_m_s=step_toward(request.last_command.v_m_s, wanted_m_s, change))

    def _can_back_up(self, request: ControlRequest, distance_m: float) -> bool:
        """Return whether the space behind is known and free: the lidar does not see there."""
        start = request.map_from_base
        poses = straight_poses(start, -distance_m)
        return poses_are_free(request.costmap, self._footprint, poses, start, unknown_blocks=True)

    def _rotate(self, active: ActiveRecovery, request: ControlRequest) -> Twist2 | None:
        left_rad = math.remainder(active.target_rad - request.map_from_base.theta_rad, math.tau)
        if abs(left_rad) < AT_TARGET_RAD:
            return None
        return self._controller.rotate(request, left_rad).command
