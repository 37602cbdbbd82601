"""The likelihood of one scan in a known map: at a pose, anywhere, and of two poses compared."""

from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.common.resumable import Search
from thumper.lidar.deskew import HIT, scan_points
from thumper.lidar.scan import Scan
from thumper.slam.localization.amcl_kernels import BeamModel, scan_likelihoods
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.scan_matching.beam_evidence import BeamEvidence, KnownCells, beam_evidence
from thumper.slam.scan_matching.gauss_newton import MatchWeights, PosePrior, match

MAX_BEAMS = 60  # hits are thinned to about this many
MAX_HYPOTHESES = 4  # similar poses tracked at the same time after a search
SIMILAR_RATIO = 0.9  # a pose that explains this share of what the best one does may be the right one
RANDOM_SHARE = 0.1  # share of beams that people and moved objects reflect
BEAM_GAIN = 0.15  # share of a beam's evidence that counts: neighbouring beams repeat it
MATCH_WEIGHTS = MatchWeights(beam_std_m=0.05)
MATCH_INFORMATION = np.diag([100.0, 100.0, 400.0])  # pulls a match towards its start


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseHypothesis:
    """A matched pose."""

    pose: Pose2
    explained: float  # mean likelihood of the beams, 0...1
    log: float  # log likelihood of all beams


class ScanLikelihood:
    """A scan's beams, origins and hits of shape (n, 2) in the base frame, in a known map."""

    def __init__(
        self, origins_m: FloatArray, hits_m: FloatArray, field: LikelihoodField, options: AmclOptions
    ) -> None:
        self._origins_m, self._hits_m, self._map, self._options = origins_m, hits_m, field, options

    @classmethod
    def of(
        cls,
        scan: Scan,
        twist: Twist2,
        base_from_laser: Pose2,
        field: LikelihoodField,
        options: AmclOptions,
    ) -> "ScanLikelihood":
        """Return the de-skewed scan, thinned to about `MAX_BEAMS` hits."""
        points = scan_points(scan, twist, base_from_laser, options.usable_range_m)
        hits_m, origins_m = points.hits_m, points.origins_m[points.kinds == HIT]
        thinned = slice(None, None, max(1, len(hits_m) // MAX_BEAMS))
        hits_m, origins_m = np.ascontiguousarray(hits_m[thinned]), np.ascontiguousarray(origins_m[thinned])
        return cls(origins_m, hits_m, field, options)

    @property
    def beams(self) -> int:
        """Number of hits."""
        return len(self._hits_m)

    def likelihoods(self, poses: FloatArray, gain: float) -> tuple[FloatArray, FloatArray]:
        """Return log likelihood times `gain`, and mean likelihood, of each pose; both of shape (poses,)."""
        model = BeamModel(self._options.beam_std_m, RANDOM_SHARE, gain)
        return scan_likelihoods(self._hits_m, self._map.to_corner(poses), self._map.field, model)

    def refine(self, near: FloatArray) -> PoseHypothesis:
        """Return the hypothesis that Gauss-Newton finds from a pose, shape (3,)."""
        start = self._map.to_corner(near)
        prior = PosePrior(start, MATCH_INFORMATION)
        pose = self._map.from_corner(match(self._hits_m, start, prior, self._map.field, MATCH_WEIGHTS))
        (log,), (explained,) = self.likelihoods(pose[np.newaxis], 1.0)
        x_m, y_m, theta_rad = (float(part) for part in pose)
        matched = Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(theta_rad))
        return PoseHypothesis(pose=matched, explained=float(explained), log=float(log))

    def refine_pose(self, pose: Pose2) -> PoseHypothesis:
        """Return the hypothesis that Gauss-Newton finds from a pose."""
        return self.refine(np.array([pose.x_m, pose.y_m, pose.theta_rad]))

    def fit(self, pose: Pose2) -> float:
        """Return the share of beams that support the pose minus the share against it, -1...1."""
        return self._evidence(pose).fit

    def contradicting_share(self, pose: Pose2) -> float:
        """Return the share of beams that end in free space or pass through a wall, 0...1."""
        return self._evidence(pose).contradicting_share

    def through_walls(self, pose: Pose2) -> float:
        """Return the share of beams that pass through a wall, 0...1."""
        evidence = self._evidence(pose)
        return evidence.explained - evidence.fit

    def search_map(self) -> Search[FloatArray]:
        """Return the best pose of the whole map, and separate ones that explain nearly as much, (n, 3)."""
        return self._map.search_poses(self._hits_m, MAX_HYPOTHESES, SIMILAR_RATIO)

    def log_ratio(self, first: PoseHypothesis, second: PoseHypothesis) -> float:
        """Return how much better the first pose explains the beams, as a log likelihood ratio.

        Where objects have moved, one pose may be ahead by chance. So the evidence counts in full only if no
        beam supports the other pose.
        """
        log_first, log_second = self._beam_logs(first.pose), self._beam_logs(second.pose)
        ahead = float((log_first - log_second).sum())
        return ahead * abs(ahead) / max(1e-9, float(np.abs(log_first - log_second).sum()))

    def _beam_logs(self, pose: Pose2) -> FloatArray:
        supports = self._evidence(pose).supports
        return np.asarray(np.log((1.0 - RANDOM_SHARE) * supports + RANDOM_SHARE))

    def _evidence(self, pose: Pose2) -> BeamEvidence:
        start = self._map.to_corner(np.array([pose.x_m, pose.y_m, pose.theta_rad]))
        return beam_evidence(
            self._origins_m,
            self._hits_m,
            start,
            self._map.field,
            KnownCells(self._map.known),
            self._options.beam_std_m,
        )
