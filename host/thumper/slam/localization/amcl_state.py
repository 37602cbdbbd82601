"""The state of `Amcl` besides its particles: the estimate, what is due next, and what the user gave."""

from collections import deque
from dataclasses import dataclass

from thumper.common.geometry import Pose2
from thumper.slam.localization.alternative_poses import are_close
from thumper.slam.scan_matching.pose_trust import PoseTrust

CHALLENGED_RETRY_SCANS = 3  # the same, while several places compete
RETRY_SCANS = 10  # a lost robot is stationary: it searches again at this interval
NEAR_GIVEN_M, NEAR_GIVEN_RAD = 1.0, 0.5  # a match this close to a given pose is what the user meant
# The right map explains more than this share of that many weighed scans; a wrong map about 0.6.
DOUBT_SCANS, DOUBT_BELOW = 20, 0.7


@dataclass(slots=True)
class PoseEstimate:
    """The estimate at the newest weighed scan."""

    pose: Pose2
    odom_from_base: Pose2 | None = None  # odometry there; None if no scan was weighed since a restart
    explained: float = 0.0  # mean likelihood of the beams, 0...1

    def motion(self, odom_from_base: Pose2) -> Pose2:
        """Return the motion since then; none if no scan was weighed yet."""
        return Pose2() if self.odom_from_base is None else self.odom_from_base.inverse() @ odom_from_base


@dataclass(slots=True)
class Schedule:
    """When the next scan is weighed, and whether the whole map is searched for it."""

    search: bool  # search the whole map at the next opportunity
    wait_scans: int = 0  # before the next search
    unexplained: int = 0  # consecutive weighed scans below `lost_below`
    carried_scans: int = 0  # consecutive scans at rest that the map does not explain
    skipped: int = 0  # scans since the newest weighed one

    def next_scan(self, trust: PoseTrust) -> None:
        """Count a scan. A stationary robot at a place in doubt searches again: people may have left."""
        self.wait_scans = max(0, self.wait_scans - 1)
        self.skipped += 1
        if self.skipped >= RETRY_SCANS and trust.doubt and not trust.confirmed:
            self.search = True

    def retry_due(self, *, challenged: bool) -> bool:
        """Return whether a robot at rest weighs a scan again: the last one did not fit, or places compete."""
        if challenged:
            return self.skipped >= CHALLENGED_RETRY_SCANS
        return self.unexplained > 0 and self.skipped >= RETRY_SCANS


@dataclass(slots=True)
class GivenPose:
    """The pose given by the user."""

    unverified: Pose2 | None = None  # not yet compared with the rest of the map
    last: Pose2 | None = None

    def set(self, pose: Pose2) -> None:
        """Take a new pose. If the user gives the same pose twice, it is not verified again."""
        given_twice = self.last is not None and are_close(pose, self.last, NEAR_GIVEN_M, NEAR_GIVEN_RAD)
        self.unverified, self.last = None if given_twice else pose, pose

    def pop_unverified(self) -> Pose2 | None:
        """Return the pose to verify, once."""
        pose, self.unverified = self.unverified, None
        return pose


class MapDoubt:
    """Whether the map may be the wrong one, or out of date."""

    def __init__(self) -> None:
        self._explained: deque[float] = deque(maxlen=DOUBT_SCANS)  # of the newest weighed scans

    def add(self, explained: float) -> None:
        """Add a weighed scan."""
        self._explained.append(explained)

    @property
    def text(self) -> str:
        """Why the map is doubted; empty while it fits."""
        share = sum(self._explained) / DOUBT_SCANS
        if len(self._explained) < DOUBT_SCANS or share >= DOUBT_BELOW:
            return ""
        return (
            f"the map explains only {100.0 * share:.0f} % of the scans: is it the right one, and up to date?"
        )
