"""Who caused a contact with a walking person: the robot that drove on, or the person who walked in.

It is the robot's if its outline moved towards the leg, and faster than the leg moved towards the robot. Both
speeds are along the line from the point of the outline that is touched to the leg: a leg that comes from the
side is the person's, even if it also walks ahead.
"""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.bench.collision import CLEAR_M
from thumper_hil.world.segment_raycast import polygon_clearance_m

STATIONARY_M_S = 0.06
"""Below this speed the robot's outline does not approach anybody."""

FURTHEST_STEP_M = 0.1
"""No leg moves further between two checks."""

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
            before = self._before_of(leg)
            touched = before in self._touching
            clearance_m = polygon_clearance_m(outline_m, NO_SEGMENTS, leg[None, :])
            if clearance_m <= (CLEAR_M if touched else 0.0):
                touching.add(index)
                if not touched:
                    walked_m = np.zeros(2) if before is None else leg[:2] - self._legs_before_m[before, :2]
                    self._judge(pose, leg[:2], walked_m, elapsed_s)
        self._touching, self._before, self._legs_before_m = touching, pose, legs_m

    def _before_of(self, leg: FloatArray) -> int | None:
        """Return the index that a leg, shape (3,), had one step before: a person who turns swaps the two."""
        away_m = np.hypot(*(self._legs_before_m[:, :2] - leg[:2]).T)
        return int(np.argmin(away_m)) if away_m.min(initial=np.inf) < FURTHEST_STEP_M else None

    def _judge(self, pose: Pose2, leg_m: FloatArray, walked_m: FloatArray, elapsed_s: float) -> None:
        before = self._before or pose
        # The point of the body at the leg, carried back to where it was one step before.
        moved_m = leg_m - before.apply(pose.inverse().apply(leg_m[None, :]))[0]
        away_m = leg_m - _nearest_m(pose.apply(self._footprint_m), leg_m)
        outward = away_m / max(float(np.hypot(*away_m)), 1e-9)
        robot_m_s = float(moved_m @ outward) / elapsed_s
        person_m_s = -float(walked_m @ outward) / elapsed_s
        if robot_m_s > max(STATIONARY_M_S, person_m_s):
            self.by_robot += 1
        else:
            self.by_people += 1


def _nearest_m(outline_m: FloatArray, point_m: FloatArray) -> FloatArray:
    """Return the point of a closed outline, shape (k, 2), that is nearest to a point, shape (2,)."""
    edges_m = np.roll(outline_m, -1, axis=0) - outline_m
    along = np.einsum("ij,ij->i", point_m - outline_m, edges_m) / np.einsum("ij,ij->i", edges_m, edges_m)
    nearest_m = outline_m + np.clip(along, 0.0, 1.0)[:, None] * edges_m
    return np.asarray(nearest_m[np.argmin(np.hypot(*(nearest_m - point_m).T))])
