"""What happens when the hull meets the world: the body is held, the wheels are not."""

import numpy as np

from thumper.common.geometry import Pose2, wrap_angle
from thumper_hil.chip.chip import Chip
from thumper_hil.world.world import World

HULL_M = np.array([[0.21, 0.1225], [-0.21, 0.1225], [-0.21, -0.1225], [0.21, -0.1225]])
"""Outline of the robot round `base_link`, shape (4, 2): 420 x 245 mm."""

HULL_RADIUS_M = float(np.hypot(HULL_M[:, 0], HULL_M[:, 1]).max())

CLEAR_M, CLEAR_RAD = 0.01, 0.05
"""The robot must back off this far before another touch is a new contact."""


class ContactWatch:
    """Keeps the body out of obstacles. Call `check` every few milliseconds of simulated time."""

    def __init__(self, chip: Chip, world: World) -> None:
        self.count = 0  # touches so far; staying in touch is one
        self._chip = chip
        self._world = world
        self._free = chip.truth().map_from_base
        self._measured_at = self._free
        self._clearance_m = world.clearance_m(self._free, HULL_M)
        self._touched_at: Pose2 | None = None

    def check(self, pose: Pose2, elapsed_s: float) -> Pose2:
        """Return where the body really is at the end of an interval that free motion ends at `pose`."""
        if pose == self._free:
            return pose
        if self._touches(pose):
            moved = self._free.inverse() @ pose
            self._chip.hold(moved.x_m / elapsed_s, moved.theta_rad / elapsed_s)
            self._chip.place(self._free)
            if self._touched_at is None:
                self.count += 1
                self._touched_at = self._free
            return self._free
        self._free = pose
        if self._touched_at is not None and _is_clear(pose, self._touched_at):
            self._touched_at = None
            self._chip.release()
        return pose

    def look_again(self, world: World) -> None:
        """Take the world as it is now: something has moved in it."""
        self._world = world
        self._clearance_m = 0.0

    def _touches(self, pose: Pose2) -> bool:
        """Whether the hull meets anything; measured anew only when it may have used up its clearance."""
        turned_rad = abs(wrap_angle(pose.theta_rad - self._measured_at.theta_rad))
        if pose.distance_m(self._measured_at) + HULL_RADIUS_M * turned_rad >= self._clearance_m:
            self._measured_at = pose
            self._clearance_m = self._world.clearance_m(pose, HULL_M)
        return self._clearance_m <= 0.0


def _is_clear(pose: Pose2, touched_at: Pose2) -> bool:
    turned_rad = abs(wrap_angle(pose.theta_rad - touched_at.theta_rad))
    return pose.distance_m(touched_at) > CLEAR_M or turned_rad > CLEAR_RAD
