"""One scan laid on a known map: refined at a place, looked for everywhere, compared between two places."""

from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.slam.localization.amcl_kernels import MaskArray, beam_scores, beam_verdicts
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.scan_matching.gauss_newton import match

HYPOTHESES = 4  # places that look alike, followed at the same time after a search
ALIKE = 0.9  # a place that explains this share of what the best one does might be the right one
WALL_MARGIN_M = 0.3  # before its end a beam may pass what is not a wall of this map to the centimetre


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseHypothesis:
    """Where the scan was laid on the map."""

    pose: Pose2
    explained: float  # mean likelihood of the beams, 0...1
    log: float  # of the likelihood of all


class ScanLikelihood:
    """A scan's beams, origins and hits of shape (n, 2) in the robot's frame, and the map to lay them on."""

    def __init__(
        self, origins_m: FloatArray, hits_m: FloatArray, field: LikelihoodField, options: AmclOptions
    ) -> None:
        self._origins_m, self._hits_m, self._field, self._options = origins_m, hits_m, field, options

    def scored(self, poses: FloatArray, gain: float) -> tuple[FloatArray, FloatArray]:
        """Log likelihood times `gain`, and mean likelihood, of each pose; both of shape (poses,)."""
        options, walls = self._options, self._field
        logs, scores = np.empty(len(poses)), np.empty(len(poses))
        beam_scores(
            self._hits_m, walls.to_corner(poses), walls.distance_m, walls.grid.resolution_m, walls.reach_m,
            options.beam_std_m, options.random_share, gain, logs, scores,
        )  # fmt: skip
        return logs, scores

    def refined(self, near: FloatArray) -> PoseHypothesis:
        """The place that Gauss-Newton finds from a pose, shape (3,)."""
        walls, matching = self._field, self._options.matching
        start = walls.to_corner(near)
        found = match(
            self._hits_m, start, start, np.diag([100.0, 100.0, 400.0]),
            walls.distance_m, walls.grid.resolution_m, walls.reach_m,
            matching.beam_std_m, matching.outlier_m, matching.iterations,
        )  # fmt: skip
        pose = walls.from_corner(found)
        (log,), (explained,) = self.scored(pose[np.newaxis], 1.0)
        x_m, y_m, theta_rad = (float(part) for part in pose)
        placed = Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(theta_rad))
        return PoseHypothesis(pose=placed, explained=float(explained), log=float(log))

    def near(self, pose: Pose2) -> PoseHypothesis:
        """The place that Gauss-Newton finds from a pose."""
        return self.refined(np.array([pose.x_m, pose.y_m, pose.theta_rad]))

    def fit(self, pose: Pose2) -> float:
        """Share of the beams that speak for the pose less the share against it: -1...1.

        A beam that ends on a wall speaks for it, one through a wall against it, and one that ends where the
        map knows nothing does neither; but at least half of the beams are asked.
        """
        likelihoods, through, silent = self._verdicts(pose)
        beams = len(likelihoods)
        asked = max(1.0, 0.5 * beams, beams - float(silent.sum()))
        return float(likelihoods.sum() - through.sum()) / asked

    def everywhere(self) -> list[PoseHypothesis]:
        """The best place of the whole map, and those apart from it that explain nearly as much."""
        return [self.refined(pose) for pose in self._field.alike(self._hits_m, HYPOTHESES, ALIKE)]

    def better(self, one: PoseHypothesis, other: PoseHypothesis) -> float:
        """How much better one place explains the beams than another, as a logarithm.

        Where things have been moved, one may be ahead by chance: what speaks for it counts in full only where
        no beam speaks for the other.
        """
        share = self._options.random_share
        first, second = (
            np.log((1.0 - share) * np.where(through, 0.0, likelihoods) + share)
            for likelihoods, through, _ in (self._verdicts(one.pose), self._verdicts(other.pose))
        )
        ahead = float((first - second).sum())
        return ahead * abs(ahead) / max(1e-9, float(np.abs(first - second).sum()))

    def _verdicts(self, pose: Pose2) -> tuple[FloatArray, MaskArray, MaskArray]:
        """How well each beam ends on a wall, whether it goes through one, whether the map is silent on it."""
        walls, beams = self._field, len(self._hits_m)
        start = walls.to_corner(np.array([pose.x_m, pose.y_m, pose.theta_rad]))
        likelihoods, through, silent = np.empty(beams), np.empty(beams, np.bool_), np.empty(beams, np.bool_)
        beam_verdicts(
            self._origins_m, self._hits_m, start, walls.distance_m, walls.known, walls.grid.resolution_m,
            self._options.beam_std_m, WALL_MARGIN_M, likelihoods, through, silent,
        )  # fmt: skip
        return likelihoods, through, silent
