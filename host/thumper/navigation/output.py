"""What one cycle of navigation decides."""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from thumper.geometry import FloatArray, Twist2


class NavigationState(Enum):
    """What the navigator is doing. FAILED and REACHED are final until the next goal."""

    IDLE = "idle"
    NAVIGATING = "navigating"
    ROTATING = "rotating"
    RECOVERING = "recovering"
    REACHED = "reached"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavigationOutput:
    """What one cycle decided."""

    command: Twist2 = field(default_factory=Twist2)
    state: NavigationState = NavigationState.IDLE
    reason: str = ""  # in words: why it stands, recovers or failed; empty when all is well
    plan: FloatArray = field(default_factory=lambda: np.empty((0, 2)))  # (n, 2) [m] in map, from the robot on
    local_plan: FloatArray = field(default_factory=lambda: np.empty((0, 3)))  # (m, 3) x, y, theta in map
