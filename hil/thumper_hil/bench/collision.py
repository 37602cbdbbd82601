"""Handle collisions of the robot with the world: the body is blocked, the wheels keep turning."""

import numpy as np

from thumper.common.geometry import Pose2, wrap_angle
from thumper_hil.chip.chip import Chip
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.world.world import World

FOOTPRINT_M = RobotParams.load().outline.corners_m()
"""Footprint of the robot around `base_link`, shape (4, 2): 420 x 300 mm."""

FOOTPRINT_RADIUS_M = float(np.hypot(FOOTPRINT_M[:, 0], FOOTPRINT_M[:, 1]).max())

CLEAR_M, CLEAR_RAD = 0.01, 0.05
"""The robot must back off this far before another touch counts as a new contact."""


class ContactDetector:
    """Keep the body out of obstacles. Call `check` every few milliseconds of simulated time."""

    def __init__(self, chip: Chip, world: World) -> None:
        self.count = 0  # contacts; a continuous touch is one contact
        self._chip = chip
        self._world = world
        self._free = chip.truth().map_from_base
        self._measured_at = self._free
        self._clearance_m = world.clearance_m(self._free, FOOTPRINT_M)
        self._touched_at: Pose2 | None = None

    def check(self, pose: Pose2, elapsed_s: float) -> Pose2:
        """Return the body's pose after an interval in which free motion would lead to `pose`."""
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

    def set_world(self, world: World) -> None:
        """Use a changed world from now on."""
        self._world = world
        self._clearance_m = 0.0

    def _touches(self, pose: Pose2) -> bool:
        """Return True on contact; measure again only after the robot may have used up its clearance."""
        turned_rad = abs(wrap_angle(pose.theta_rad - self._measured_at.theta_rad))
        if pose.distance_m(self._measured_at) + FOOTPRINT_RADIUS_M * turned_rad >= self._clearance_m:
            self._measured_at = pose
            self._clearance_m = self._world.clearance_m(pose, FOOTPRINT_M)
        return self._clearance_m <= 0.0


def _is_clear(pose: Pose2, touched_at: Pose2) -> bool:
    turned_rad = abs(wrap_angle(pose.theta_rad - touched_at.theta_rad))
    return pose.distance_m(touched_at) > CLEAR_M or turned_rad > CLEAR_RAD
