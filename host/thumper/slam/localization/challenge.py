"""A proven pose that no longer fits: other places of the map must explain several looks clearly better."""

from dataclasses import dataclass

from thumper.common.geometry import Pose2
from thumper.slam.localization.alternative_poses import SAME_M, SAME_RAD, are_close
from thumper.slam.localization.map_search import MapSearch
from thumper.slam.localization.scan_likelihood import PoseHypothesis, ScanLikelihood
from thumper.slam.scan_matching.pose_trust import PoseTrust

MARGIN = 0.1  # of the fit: in a room that has changed, a similar place may be ahead by this much
CLEARLY_BETTER = 1.0  # sum of the leads beyond the margin that replaces a proven pose ...
MIN_LOOKS = 3  # ... after at least this many scans
PAUSE_LOOKS = 10  # weighed scans from the end of a challenge to the next search of the whole map


@dataclass(slots=True)
class Challenger:
    """Another place, tracked beside the proven one."""

    pose: Pose2
    trust: PoseTrust
    lead: float = 0.0  # sum of the differences in fit, less the margin
    looks: int = 0


class Challenge:
    """The places that compete with a proven pose.

    Furniture that was moved makes a right pose fit badly, and a wrong one among similar rows fit well for a
    while. So the pose that has been proven over metres is tracked on, and every look counts.
    """

    def __init__(self) -> None:
        self._challengers: list[Challenger] = []
        self._pause = 0
        self._search = MapSearch()

    @property
    def doubt(self) -> str:
        """Why the robot must not drive on; empty if no other place is ahead."""
        ahead = max((each.lead for each in self._challengers), default=0.0)
        return "another place explains the scans better than the tracked one" if ahead > 0.0 else ""

    @property
    def is_open(self) -> bool:
        """Whether other places are tracked."""
        return bool(self._challengers)

    def reset(self) -> None:
        """Forget all other places."""
        self._challengers, self._pause = [], 0
        self._search.stop()

    def continue_search(self, scan: ScanLikelihood, odom_from_base: Pose2, own: Pose2, moved: Pose2) -> None:
        """Do a slice of the search for other places, if one is under way.

        `own` is the tracked pose at this scan, `moved` the motion since the scan that was weighed last.
        """
        if self._search.is_running:
            self._open(self._search.advance(scan, odom_from_base), scan, own, moved)

    def update(
        self,
        scan: ScanLikelihood,
        odom_from_base: Pose2,
        moved: Pose2,
        own: PoseHypothesis,
        *,
        fits_badly: bool,
    ) -> tuple[PoseHypothesis, PoseTrust] | None:
        """Weigh a scan after the robot `moved`; return a place that replaces the proven pose `own`."""
        own_fit = scan.fit(own.pose)
        if self._challengers:
            return self._compare(scan, moved, own, own_fit)
        self._pause = max(0, self._pause - 1)
        if fits_badly and self._pause == 0 and not self._search.is_running:
            self._pause = PAUSE_LOOKS
            self._open(self._search.advance(scan, odom_from_base), scan, own.pose, Pose2())
        return None

    def _open(
        self, found: list[PoseHypothesis] | None, scan: ScanLikelihood, own: Pose2, moved: Pose2
    ) -> None:
        """Track the places found; their poses are those at the scan that was weighed last."""
        own_fit = scan.fit(own)
        for other in found or []:
            if not are_close(other.pose, own, SAME_M, SAME_RAD):
                challenger = Challenger(other.pose @ moved.inverse(), PoseTrust(trusted=False))
                fit = scan.fit(other.pose)
                self._look(challenger, fit - own_fit, fit, 0.0, 0.0)
                self._challengers.append(challenger)

    def _compare(
        self, scan: ScanLikelihood, moved: Pose2, own: PoseHypothesis, own_fit: float
    ) -> tuple[PoseHypothesis, PoseTrust] | None:
        kept: list[Challenger] = []
        for each in self._challengers:
            expected = each.pose @ moved
            found = scan.refine_pose(expected)
            each.pose = found.pose
            fit, distance_m = scan.fit(found.pose), Pose2().distance_m(moved)
            self._look(each, fit - own_fit, fit, distance_m, found.pose.distance_m(expected))
            if each.lead >= CLEARLY_BETTER and each.looks >= MIN_LOOKS and not each.trust.doubt:
                self._challengers = []
                return found, each.trust
            behind = each.lead <= 0.0 and each.looks >= MIN_LOOKS
            if not behind and not are_close(found.pose, own.pose, SAME_M, SAME_RAD):
                kept.append(each)
        self._challengers = kept
        return None

    @staticmethod
    def _look(challenger: Challenger, ahead: float, fit: float, distance_m: float, push_m: float) -> None:
        challenger.lead += ahead - MARGIN
        challenger.looks += 1
        challenger.trust.update(fit, 1.0, distance_m, push_m)
