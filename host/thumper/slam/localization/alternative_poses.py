"""Places that look like the one a person has named: followed quietly, until scans speak for or against."""

import math

from thumper.common.geometry import Pose2
from thumper.slam.localization.scan_likelihood import PoseHypothesis, ScanLikelihood

TRUST = 20.0  # how much likelier than any other is the place that a person names, before the first look
DROPPED = -3.0  # evidence, as the logarithm of a chance: twenty to one against a rival
TAKEN = 9.0  # enough for it to be believed, in spite of what the person says
MOST = 1.0  # that one scan may add: the next one sees much the same
WHOLE = 0.95  # share explained: only a place that leaves nothing open may contradict, for things get moved
SAME_M, SAME_RAD = 0.5, 0.35  # so near they are one place


class AlternativePoses:
    """The other places, each with the evidence for it and against the one that is believed."""

    def __init__(self, rivals: list[tuple[PoseHypothesis, float]], gain: float) -> None:
        """Begin with places and their evidence; `gain` is the share of a scan's evidence that counts."""
        self._rivals, self._gain = [(place.pose, evidence) for place, evidence in rivals], gain

    def look(self, scan: ScanLikelihood, moved: Pose2, believed: PoseHypothesis) -> PoseHypothesis | None:
        """Weigh a scan taken after the robot has moved; returns a rival that is to be believed now."""
        kept: list[tuple[Pose2, float]] = []
        for pose, before in self._rivals:
            place = scan.near(pose @ moved)
            more = max(-MOST, min(MOST, self._gain * scan.better(place, believed)))
            evidence = before + (more if more < 0.0 or place.explained > WHOLE else 0.0)
            if evidence > TAKEN:
                self._rivals = []
                return place
            if evidence > DROPPED and not is_near(place.pose, believed.pose, SAME_M, SAME_RAD):
                kept.append((place.pose, evidence))
        self._rivals = kept
        return None


def is_near(pose: Pose2, other: Pose2, most_m: float, most_rad: float) -> bool:
    """Whether two poses are that near."""
    turn_rad = math.remainder(pose.theta_rad - other.theta_rad, math.tau)
    return pose.distance_m(other) < most_m and abs(turn_rad) < most_rad
