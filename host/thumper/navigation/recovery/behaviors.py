"""What the robot does when it is stuck: move_base's ladder, with back-up and wait for where it cannot turn.

Conservative reset, rotate, aggressive reset, rotate, then back up, wait, and give up
(http://wiki.ros.org/move_base). There a rotation in a place too tight for it does nothing; here the robot
backs up instead, and where that is not free either it waits. After each step the controller has its full
patience.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import Twist2
from thumper.navigation.controllers.controller import Controller, ControlRequest
from thumper.navigation.controllers.rotate_in_place import is_open, straight_poses
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed

SLOWEST_BACK_M_S = 0.05
BACK_UP_PARTS = np.array((1.0, 0.5, 0.25))  # of the wanted way back, tried in turn

Behaviour = Literal["conservative_reset", "aggressive_reset", "rotate", "back_up", "wait"]
LADDER: tuple[Behaviour, ...] = (
    "conservative_reset",
    "rotate",
    "aggressive_reset",
    "rotate",
    "back_up",
    "wait",
)
NAMES: dict[Behaviour, str] = {
    "conservative_reset": "conservative reset",
    "aggressive_reset": "aggressive reset",
    "rotate": "turning to look round",
    "back_up": "backing up",
    "wait": "waiting for the way to clear",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryOptions:
    """How the robot frees itself."""

    # What is tried, in this order, before the goal is given up: conservative_reset, aggressive_reset, rotate,
    # back_up, wait. It begins afresh when the robot has come nearer to the goal; empty gives up at once.
    behaviours: tuple[Behaviour, ...] = LADDER
    # The conservative reset forgets remembered points further away than this [m] ...
    conservative_m: Annotated[float, Gt(0)] = 0.5
    # ... and the aggressive one further than this [m]; within the robot's own circle nothing is forgotten.
    aggressive_m: Annotated[float, Gt(0)] = 0.3
    # Way back in the first back-up [m]; every further one is longer by as much.
    back_up_m: Annotated[float, Gt(0)] = 0.20
    # Fastest backward speed [m/s].
    back_up_m_s: Annotated[float, Gt(0)] = 0.15
    # Turn of a recovery turn, to see more [rad].
    turn_rad: Annotated[float, Gt(0)] = 1.6
    # Wait when nothing else is free: what is in the way may leave [s].
    wait_s: Annotated[float, Ge(0)] = 2.0
    # Longest time of one recovery [s].
    limit_s: Annotated[float, Gt(0)] = 10.0


class RecoveryBehaviors:
    """One recovery at a time: `start`, then `step` each cycle until it returns None."""

    def __init__(
        self, options: RecoveryOptions, limits: SpeedLimits, footprint: Footprint, controller: Controller
    ) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._controller = controller
        self.reset()
        self.name, self.why = "", ""  # what is done, and that with its cause
        self.forget_radius_m: float | None = None  # what this recovery forgets of the remembered points

    def start(self, time_s: float, request: ControlRequest, *, only_look: bool = False) -> bool:
        """Take the next step of the ladder; False when there is none left.

        With `only_look` that is a turn to look round, unless there was one already: nothing else helps.
        """
        left = self._options.behaviours[self.attempts :]
        if self._hopeless or not left or (only_look and (self._has_looked or "rotate" not in left)):
            return False
        wanted = "rotate" if only_look else left[0]
        self._has_looked |= wanted == "rotate"
        self._behaviour = self._possible(wanted, request)
        self.name = NAMES[self._behaviour]
        self.attempts += 1
        circle_m = self._footprint.circumscribed_radius_m
        resets: dict[str, float] = {
            "conservative_reset": self._options.conservative_m,
            "aggressive_reset": self._options.aggressive_m,
        }
        reset_m = resets.get(self._behaviour)
        self.forget_radius_m = None if reset_m is None else max(circle_m, reset_m)
        self._begun_s = time_s
        self._from = request.map_from_base
        self._target_rad = request.map_from_base.theta_rad + self._options.turn_rad
        return True

    def _possible(self, wanted: Behaviour, request: ControlRequest) -> Behaviour:
        """The wanted behaviour, or what takes its place where it is not free."""
        order: list[Behaviour] = [wanted]
        if wanted in ("rotate", "back_up"):
            order = ["rotate", "back_up"] if wanted == "rotate" else ["back_up", "rotate"]
        for behaviour in order:
            if behaviour == "rotate":
                if self._controller.turn(request, self._options.turn_rad).command is not None:
                    return behaviour
            elif behaviour == "back_up":
                longest_m = self._options.back_up_m * (1 + self._backed_up)
                ways_m = [float(m) for m in longest_m * BACK_UP_PARTS if self._can_back_up(request, float(m))]
                if ways_m:
                    self._way_m = ways_m[0]
                    self._backed_up += 1
                    return behaviour
            else:
                return behaviour
        return "wait"

    def give_up(self) -> None:
        """Let every further `start` refuse."""
        self._hopeless = True

    def reset(self) -> None:
        """Begin the ladder afresh: a new goal, or new ground won."""
        self.attempts, self._hopeless, self._backed_up = 0, False, 0
        self._has_looked = False

    def step(self, time_s: float, request: ControlRequest) -> Twist2 | None:
        """Return the next twist, or None when the recovery is over."""
        elapsed_s = time_s - self._begun_s
        if elapsed_s > self._options.limit_s:
            return None
        if self.forget_radius_m is not None:
            return Twist2() if elapsed_s == 0.0 else None  # forgetting takes one cycle
        if self._behaviour == "back_up":
            return self._back_up(request)
        if self._behaviour == "rotate":
            return self._turn(request)
        return Twist2() if elapsed_s < self._options.wait_s else None

    def _back_up(self, request: ControlRequest) -> Twist2 | None:
        left_m = self._way_m - self._from.distance_m(request.map_from_base)
        if left_m <= 0.01 or not self._can_back_up(request, min(left_m, 0.15)):
            return None
        change = self._limits.v_accel_m_s2 * request.period_s
        speed = min(
            self._options.back_up_m_s,
            stoppable_speed(left_m, self._limits.v_accel_m_s2, self._limits.latency_s),
        )
        return Twist2(v_m_s=step_toward(request.last_command.v_m_s, -max(speed, SLOWEST_BACK_M_S), change))

    def _can_back_up(self, request: ControlRequest, distance_m: float) -> bool:
        """Whether the ground behind is known and free: the lidar does not see there."""
        poses = straight_poses(request.map_from_base, -distance_m)
        start = request.map_from_base
        return is_open(request.costmap, self._footprint, poses, start, unknown_blocks=True)

    def _turn(self, request: ControlRequest) -> Twist2 | None:
        left_rad = math.remainder(self._target_rad - request.map_from_base.theta_rad, math.tau)
        if abs(left_rad) < 0.1:
            return None
        return self._controller.turn(request, left_rad).command
