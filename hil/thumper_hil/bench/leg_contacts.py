"""Who caused a contact with a walking person: the robot that drove on, or the person who walked in.

It is the robot's if its outline moved towards the leg, and faster than the leg moved towards the robot.
"""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.world.segment_raycast import polygon_clearance_m

STATIONARY_M_S = 0.06
"""Below this speed the robot's outline does not approach anybody."""

NO_SEGMENTS = np.zeros((0, 4))


class LegContacts:
    """Counts touches of the robot's outline with legs. Legs pass on; they never hold the robot."""

    def __init__(self, footprint_m: FloatArray) -> None:
        self.by_robot = 0
        self.by_people = 0
        self._footprint_m = footprint_m
        self._touching: set[int] = set()
        self._before: Pose2 | None = None
        self._legs_before_m = np.zeros((0, 3))

    def check(self, pose: Pose2, legs_m: FloatArray, elapsed_s: float) -> None:
        """Count the legs, shape (n, 3), that touch the outline at `pose` and did not before."""
        outline_m = pose.apply(self._footprint_m)
        touching = set()
        for index, leg in enumerate(legs_m):
            if np.hypot(leg[0] - pose.x_m, leg[1] - pose.y_m) > 1.0:
                continue
            if polygon_clearance_m(outline_m, NO_SEGMENTS, leg[None, :]) <= 0.0:
                touching.add(index)
                if index not in self._touching:
                    known = index < len(self._legs_before_m)
                    walked_m = leg[:2] - self._legs_before_m[index, :2] if known else np.zeros(2)
                    self._judge(pose, leg[:2], walked_m, elapsed_s)
        self._touching, self._before, self._legs_before_m = touching, pose, legs_m

    def _judge(self, pose: Pose2, leg_m: FloatArray, walked_m: FloatArray, elapsed_s: float) -> None:
        before = self._before or pose
        # The point of the body at the leg, carried back to where it was one step before.
        moved_m = leg_m - before.apply(pose.inverse().apply(leg_m[None, :]))[0]
        centre_m = np.array([pose.x_m, pose.y_m])
        outward = (leg_m - centre_m) / max(float(np.hypot(*(leg_m - centre_m))), 1e-9)
        robot_m_s = float(moved_m @ outward) / elapsed_s
        person_m_s = -float(walked_m @ outward) / elapsed_s
        if robot_m_s > max(STATIONARY_M_S, person_m_s):
            self.by_robot += 1
        else:
            self.by_people += 1
