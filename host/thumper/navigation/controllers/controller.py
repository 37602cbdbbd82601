"""The interface of the controllers: pose, speed, path and costmap in, the next twist or a reason out."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.navigation.costmap.costmap import Costmap


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlRequest:
    """The inputs of a controller in one cycle."""

    map_from_base: Pose2
    twist: Twist2  # measured
    last_command: Twist2
    path_m: FloatArray  # shape (n, 2), in map, from near the robot to the goal
    costmap: Costmap
    v_limit_m_s: float  # highest forward speed allowed now (near the goal, in a slow zone)
    period_s: float  # time until the next command
    # The costmap for planning poses: unseen ground beside the robot is unknown in it, not an obstacle.
    pose_costmap: Costmap | None = None
    fine_costmap: Callable[[], Costmap] | None = None  # the same in finer cells
    move_ahead_m: float = 0.0  # to drive straight ahead until the tail's ground has been seen; 0: it has


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlResult:
    """The next twist, or None and why every twist was rejected."""

    command: Twist2 | None
    rotating: bool = False  # rotating in place toward the path
    trajectory: FloatArray = field(default_factory=lambda: np.empty((0, 3)))  # (m, 3) x, y, theta in map
    reason: str = ""


class Controller(Protocol):
    """Follows a path without touching anything."""

    def compute_command(self, request: ControlRequest) -> ControlResult:
        """Return the next twist along the path."""
        ...

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place by `angle_rad`, counter-clockwise positive."""
        ...

    def reset(self) -> None:
        """Forget the past (a new goal, a recovery)."""
        ...
