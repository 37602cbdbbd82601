"""Alternatives to a given pose, tracked in the background until scans decide for or against them."""

import math

from thumper.common.geometry import Pose2
from thumper.slam.localization.scan_likelihood import BEAM_GAIN, PoseHypothesis, ScanLikelihood

PRIOR_RATIO = 20.0  # prior odds of a pose given by the user against any other
DROP_BELOW = -3.0  # log odds: twenty to one against an alternative
ADOPT_ABOVE = 9.0  # log odds at which an alternative replaces the given pose
MAX_STEP = 1.0  # that one scan may add in favour: the next scan sees nearly the same
# Share explained. Only a pose that leaves nothing unexplained may contradict the user: objects get moved.
FULLY_EXPLAINED = 0.95
SAME_M, SAME_RAD = 0.5, 0.35  # poses this close are the same hypothesis


class AlternativePoses:
    """Alternative poses, each with its log odds against the current estimate."""

    def __init__(self, alternatives: list[tuple[PoseHypothesis, float]] | None = None) -> None:
        """Start with hypotheses and their log odds."""
        self._alternatives = [(hypothesis.pose, odds) for hypothesis, odds in alternatives or []]

    def update(self, scan: ScanLikelihood, moved: Pose2, current: PoseHypothesis) -> PoseHypothesis | None:
        """Weigh a scan after the robot `moved`; return an alternative that replaces the estimate."""
        kept: list[tuple[Pose2, float]] = []
        for pose, odds_before in self._alternatives:
            hypothesis = scan.refine_pose(pose @ moved)
            step = max(-MAX_STEP, min(MAX_STEP, BEAM_GAIN * scan.log_ratio(hypothesis, current)))
            counts = step < 0.0 or hypothesis.explained > FULLY_EXPLAINED
            odds = odds_before + (step if counts else 0.0)
            if odds > ADOPT_ABOVE:
                self._alternatives = []
                return hypothesis
            if odds > DROP_BELOW and not are_close(hypothesis.pose, current.pose, SAME_M, SAME_RAD):
                kept.append((hypothesis.pose, odds))
        self._alternatives = kept
        return None


def are_close(pose: Pose2, other: Pose2, max_m: float, max_rad: float) -> bool:
    """Return whether two poses are within this distance and angle of each other."""
    turn_rad = math.remainder(pose.theta_rad - other.theta_rad, math.tau)
    return pose.distance_m(other) < max_m and abs(turn_rad) < max_rad
