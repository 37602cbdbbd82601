"""Detect while mapping that the robot was carried away, before its scans spoil the map."""

import math
from collections import deque

from thumper.common.geometry import Pose2
from thumper.slam.scan_matching.beam_evidence import BeamEvidence
from thumper.slam.scan_matching.pose_trust import PoseTrust

RECENT = 5  # scans before, at a right pose
MIN_DROP = 0.3  # of the fit, from those scans to the next
SUSPECT_BELOW, SUSPECT_CONTRADICTING = 0.5, 0.1  # fit, and share of contradicting beams, of a suspect scan
JUMP_M = 0.3  # between the match and odometry's prediction: further than the matcher's usual correction
# From one scan to the next. After more motion, as in a log with a scan for each metre, a right pose may show
# another room at once.
MAX_STEP_M, MAX_STEP_RAD = 0.3, 0.3
LOST_AFTER = 3  # scans: people and a bump spoil one or two


class KidnapDetector:
    """Judges each matched scan by its fit, as localization does.

    A robot drives out of the mapped area beam by beam: those that end in unknown space do not count. A robot
    that was carried away sees a scan that contradicts the map from one moment to the next. From then on
    nothing may be inserted, until the scans support a pose as well as one that a global search found.
    """

    def __init__(self, step_m: float, step_rad: float) -> None:
        """Weigh a scan again after this much odometry: before that it shows the same as the last."""
        self._step_m, self._step_rad = step_m, step_rad
        self._fits: deque[float] = deque(maxlen=RECENT)
        self._trust: PoseTrust | None = None  # of the pose since a suspect scan
        self._doubtful = 0  # scans since then
        self._moved_m = self._turned_rad = self._pushed_m = 0.0  # since the last scan that was weighed

    @property
    def doubtful(self) -> bool:
        """Whether the newest scan must not be inserted."""
        return self._trust is not None

    @property
    def suspect(self) -> bool:
        """Whether the newest scan is the first of a doubt: its match must not move the pose either."""
        return self._doubtful == 1

    @property
    def lost(self) -> str:
        """Why the pose must not be trusted; empty if it may."""
        if self._trust is None or self._doubtful < LOST_AFTER:
            return ""
        return "the scans contradict the map: the robot was carried away, or the room has changed"

    def reset(self) -> None:
        """Start again at a pose that another estimator found."""
        self._fits.clear()
        self._trust, self._doubtful = None, 0

    def update(self, evidence: BeamEvidence, moved: Pose2, pushed_m: float) -> None:
        """Judge a scan that was matched `pushed_m` from odometry's prediction, after odometry `moved`."""
        # A map under construction contains people who have moved on, and beams pass where they stood.
        fit, moved_m = 0.5 * (evidence.explained + evidence.fit), math.hypot(moved.x_m, moved.y_m)
        self._moved_m += moved_m
        self._turned_rad += abs(moved.theta_rad)
        self._pushed_m += pushed_m
        is_near = moved_m <= MAX_STEP_M and abs(moved.theta_rad) <= MAX_STEP_RAD
        if self._trust is not None and not is_near and not self.lost:
            self.reset()
        if self._trust is not None:
            self._doubtful += 1
            if self._is_step(self._trust):
                self._trust.update(fit, 1.0, self._moved_m, self._pushed_m)
                self._restart_step()
                if not self._trust.doubt:
                    self.reset()
        elif is_near and self._is_suspect(fit, evidence.contradicting_share, moved_m, pushed_m):
            # The next scan decides first: one that is bad by itself must not count.
            self._trust, self._doubtful = PoseTrust(trusted=False), 1
            self._restart_step()
        else:
            self._fits.append(fit)

    def _is_step(self, trust: PoseTrust) -> bool:
        moved = self._moved_m >= self._step_m or self._turned_rad >= self._step_rad
        return moved or not trust.weighed

    def _restart_step(self) -> None:
        self._moved_m = self._turned_rad = self._pushed_m = 0.0

    def _is_suspect(self, fit: float, contradicting: float, moved_m: float, pushed_m: float) -> bool:
        """Return whether the scan falls far behind the scans before."""
        if len(self._fits) < RECENT:
            return False
        dropped = fit < sum(self._fits) / RECENT - MIN_DROP
        suspect = fit < SUSPECT_BELOW and contradicting > SUSPECT_CONTRADICTING
        return (dropped and suspect) or pushed_m > JUMP_M + moved_m
