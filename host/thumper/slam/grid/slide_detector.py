"""Detect that the match slides along similar walls, though the scans themselves move as odometry says."""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.grid.view_change import shared_view

STRETCH_M = 1.0  # after which two scans are compared: doorways have moved by more than the view's tolerance
MAX_TURN_RAD = 0.4  # after more, the two scans show too little of the same
SLID_SHARE = 0.3  # of the way between match and odometry: no wheels err this much, unless they slip
BETTER_VIEW = 0.1  # shared by the two scans with odometry's motion: if the wheels slip, with the match's


class SlideDetector:
    """Compares, metre by metre, the scans with each other: with odometry's motion, and with the match's.

    Where a map holds walls twice, a match explains most beams at every doorway, and moves on to the next one.
    """

    def __init__(self, lost_beyond_m: float) -> None:
        """Report a pose that has slid further than this, and not back."""
        self._lost_beyond_m = lost_beyond_m
        self._slid_m: FloatArray = np.zeros(2)  # in the map
        self._hits_m: FloatArray = np.zeros((0, 2))  # at the start of the stretch
        self._moved, self._matched = Pose2(), Pose2()  # since then

    @property
    def lost(self) -> str:
        """Why the pose must not be trusted; empty if it may."""
        slid_m = float(np.hypot(*self._slid_m))
        if slid_m <= self._lost_beyond_m:
            return ""
        return f"the match has slid {slid_m:.1f} m along similar walls, against wheels and scans"

    def reset(self) -> None:
        """Start again at a pose that a loop closure or another estimator found."""
        self._slid_m = np.zeros(2)
        self._restart(np.zeros((0, 2)))

    def update(self, hits_m: FloatArray, moved: Pose2, matched: Pose2, heading_rad: float) -> None:
        """Add a scan with hits of shape (n, 2), its motion by odometry and by the match, and its heading."""
        self._moved, self._matched = self._moved @ moved, self._matched @ matched
        way_m = math.hypot(self._moved.x_m, self._moved.y_m)
        if not len(self._hits_m) or abs(self._moved.theta_rad) > MAX_TURN_RAD:
            self._restart(hits_m)
        elif way_m >= STRETCH_M:
            if self._moved.distance_m(self._matched) > SLID_SHARE * way_m and self._wheels_are_right(hits_m):
                slid = Pose2(theta_rad=heading_rad) @ self._moved.inverse() @ self._matched
                self._slid_m += (slid.x_m, slid.y_m)
            self._restart(hits_m)

    def _wheels_are_right(self, hits_m: FloatArray) -> bool:
        by_wheels, by_match = (shared_view(self._hits_m, hits_m, m) for m in (self._moved, self._matched))
        return by_wheels > by_match + BETTER_VIEW

    def _restart(self, hits_m: FloatArray) -> None:
        self._hits_m, self._moved, self._matched = hits_m, Pose2(), Pose2()
