"""A search of the whole map for the pose of one scan, which goes on while newer scans come."""

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import SlicedSearch
from thumper.slam.localization.scan_likelihood import PoseHypothesis, ScanLikelihood
from thumper.slam.pose_arrays import to_pose


class MapSearch:
    """At most one search; each scan does one slice. A small map takes one slice, one of 100 m x 100 m 50."""

    def __init__(self) -> None:
        self._search = SlicedSearch[FloatArray]()
        self._odom_from_base = Pose2()  # at the scan that is searched for

    @property
    def is_running(self) -> bool:
        """Whether a search is under way."""
        return self._search.is_running

    def stop(self) -> None:
        """Drop the search under way."""
        self._search.stop()

    def advance(self, scan: ScanLikelihood, odom_from_base: Pose2) -> list[PoseHypothesis] | None:
        """Continue the search, or start one for this scan; at its end return the poses, best first.

        The poses are those at this scan: moved by odometry since the start, and matched.
        """
        if not self._search.is_running:
            self._search.start(scan.search_map())
            self._odom_from_base = odom_from_base
        found = self._search.advance()
        if found is None:
            return None
        return [scan.refine_pose(to_pose(pose) @ self.moved(odom_from_base)) for pose in found]

    def moved(self, odom_from_base: Pose2) -> Pose2:
        """Return the motion since the scan for which the newest search was started."""
        return self._odom_from_base.inverse() @ odom_from_base
