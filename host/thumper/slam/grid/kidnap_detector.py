"""Detect while mapping that the robot was carried away, before its scans spoil the map."""

import math
from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.slam.grid.view_change import shared_view
from thumper.slam.scan_matching.beam_evidence import BeamEvidence
from thumper.slam.scan_matching.pose_trust import PoseTrust

RECENT = 5  # scans before, at a right pose
MIN_DROP = 0.3  # of the fit, from those scans to the next
SUSPECT_BELOW, SUSPECT_CONTRADICTING = 0.6, 0.1  # fit, and share of contradicting beams, of a suspect scan
MIN_USUAL_FIT = 0.5  # against which the fit of a doubtful pose is measured: at a wrong place it is often 0.6
JUMP_M = 0.3  # between the match and odometry's prediction: further than the matcher's usual correction
# The same for the heading; wheels alone may err by half of a turn.
JUMP_RAD, WHEELS_TURN_SHARE = 0.15, 0.5
# From one scan to the next. After more motion, as in a log with a scan for each metre, a right pose may show
# another room at once.
MAX_STEP_M, MAX_STEP_RAD = 0.3, 0.3
# Share of two scans in a row that is the same unless the robot was carried between them: with the motion by
# odometry, and with that by the match, which itself seeks what is the same.
SAME_VIEW, SAME_MATCHED_VIEW = 0.4, 0.6
# Where places look alike, another one shows the same view. So many bad scans in a row, at different poses,
# are a doubt for all that: this share of their beams more than usual contradicts the map.
CONTRADICTED_SCANS, CONTRADICTED = 3, 0.3
LOST_AFTER = 3  # scans: people and a bump spoil one or two


class KidnapDetector:
    """Judges each matched scan by its fit, as localization does.

    A robot drives out of the mapped area beam by beam: those that end in unknown space do not count. A robot
    that was carried away sees another view from one moment to the next. It contradicts the map, no motion
    explains it, and the next scans show it again. Where each scan shows another view, as among people or on
    rough ground, the sensor is at fault, not the pose. From the first such scan on nothing may be inserted,
    until the scans support a pose as well as one that a global search found.
    """

    def __init__(self, step_m: float, step_rad: float) -> None:
        """Weigh a scan again after this much odometry: before that it shows the same as the last."""
        self._step_m, self._step_rad = step_m, step_rad
        self._fits: deque[float] = deque(maxlen=RECENT)
        self._contradictions: deque[float] = deque(maxlen=RECENT)  # the same scans' contradicting shares
        self._hits_m: FloatArray = np.zeros((0, 2))  # of the scan before
        self._trust: PoseTrust | None = None  # of the pose since a suspect scan
        self._usual_fit = 1.0  # of the scans before it
        self._doubtful = 0  # scans since then
        self._contradicted = 0  # scans in a row that contradict the map
        self._moved_m = self._turned_rad = self._pushed_m = 0.0  # since the last scan that was weighed

    @property
    def doubtful(self) -> bool:
        """Whether the newest scan must not be inserted."""
        return self._trust is not None or self._contradicted > 0

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
        self._contradictions.clear()
        self._end_doubt()

    def update(self, evidence: BeamEvidence, hits_m: FloatArray, moved: Pose2, matched: Pose2) -> None:
        """Judge a scan with hits of shape (n, 2), after the robot has `moved` by odometry.

        `matched` is the same motion by the match.
        """
        # A map under construction contains people who have moved on, and beams pass where they stood.
        fit, moved_m = 0.5 * (evidence.explained + evidence.fit), math.hypot(moved.x_m, moved.y_m)
        pushed_m, before_m, self._hits_m = matched.distance_m(moved), self._hits_m, hits_m
        self._moved_m += moved_m
        self._turned_rad += abs(moved.theta_rad)
        self._pushed_m += pushed_m

        def same_view() -> bool:
            return (
                shared_view(before_m, hits_m, moved) >= SAME_VIEW
                or shared_view(before_m, hits_m, matched) >= SAME_MATCHED_VIEW
            )

        is_near = moved_m <= MAX_STEP_M and abs(moved.theta_rad) <= MAX_STEP_RAD
        if self._trust is not None and not self.lost and not (is_near and same_view()):
            self._end_doubt()
        if self._trust is not None:
            self._doubtful += 1
            if self._has_moved or not self._trust.weighed:
                self._trust.update(min(1.0, fit / self._usual_fit), 1.0, self._moved_m, self._pushed_m)
                self._restart_step()
                if not self._trust.doubt:
                    self.reset()
            return
        contradicting, jumped = evidence.contradicting_share, pushed_m > JUMP_M + moved_m
        # A scan of the floor, which a robot that rocks sees far ahead, turns the match.
        turned_rad = abs(wrap_angle(matched.theta_rad - moved.theta_rad))
        jumped |= turned_rad > JUMP_RAD + WHEELS_TURN_SHARE * abs(moved.theta_rad)
        # Among trees many beams contradict the map at a right pose, too.
        unusual = contradicting > CONTRADICTED + self._usual_contradicting()
        if not is_near or not unusual or fit >= SUSPECT_BELOW:
            self._contradicted = 0
        elif not self._contradicted or self._has_moved:
            self._contradicted += 1
            self._restart_step()
        suspect = is_near and (jumped or self._is_suspect(fit, contradicting)) and not same_view()
        if suspect or self._contradicted >= CONTRADICTED_SCANS:
            # The next scan decides first: one that is bad by itself must not count.
            self._trust, self._doubtful = PoseTrust(trusted=False), 1
            # Among trees or people a right pose fits no better than before.
            if self._fits:
                self._usual_fit = max(MIN_USUAL_FIT, sum(self._fits) / len(self._fits))
            self._restart_step()
        elif not self._contradicted:
            self._fits.append(fit)
            self._contradictions.append(contradicting)

    def _end_doubt(self) -> None:
        self._trust, self._doubtful, self._usual_fit = None, 0, 1.0
        self._contradicted = 0

    @property
    def _has_moved(self) -> bool:
        return self._moved_m >= self._step_m or self._turned_rad >= self._step_rad

    def _restart_step(self) -> None:
        self._moved_m = self._turned_rad = self._pushed_m = 0.0

    def _usual_contradicting(self) -> float:
        return sum(self._contradictions) / max(1, len(self._contradictions))

    def _is_suspect(self, fit: float, contradicting: float) -> bool:
        """Return whether the scan falls far behind the scans before."""
        if len(self._fits) < RECENT:
            return False
        dropped = fit < sum(self._fits) / RECENT - MIN_DROP
        return dropped and fit < SUSPECT_BELOW and contradicting > SUSPECT_CONTRADICTING
