"""One scan laid on a known map: refined at a place, looked for everywhere, compared between two places."""

from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray, Pose2, wrap_angle
from thumper.localization.amcl_kernels import beam_scores, share_through_walls
from thumper.localization.likelihood_field import LikelihoodField
from thumper.localization.options import AmclOptions
from thumper.mapping.scan_match import match

HYPOTHESES = 4  # places that look alike, followed at the same time after a search
ALIKE = 0.9  # a place that explains this share of what the best one does might be the right one
WALL_MARGIN_M = 0.3  # before its end a beam may pass what is not a wall of this map to the centimetre


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the scan was laid on the map."""

    pose: Pose2
    explained: float  # mean likelihood of the beams, 0...1
    log: float  # of the likelihood of all


class LaidScan:
    """The hits of one scan, shape (n, 2) in the robot's frame, and the map to lay them on."""

    def __init__(self, hits_m: FloatArray, field: LikelihoodField, options: AmclOptions) -> None:
        self._hits_m, self._field, self._options = hits_m, field, options

    def scored(self, poses: FloatArray, gain: float) -> tuple[FloatArray, FloatArray]:
        """Log likelihood times `gain`, and mean likelihood, of each pose; both of shape (poses,)."""
        options, walls = self._options, self._field
        logs, scores = np.empty(len(poses)), np.empty(len(poses))
        beam_scores(
            self._hits_m, walls.to_corner(poses), walls.distance_m, walls.grid.resolution_m, walls.reach_m,
            options.beam_std_m, options.random_share, gain, logs, scores,
        )  # fmt: skip
        return logs, scores

    def refined(self, near: FloatArray) -> Place:
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
        return Place(pose=placed, explained=float(explained), log=float(log))

    def near(self, pose: Pose2) -> Place:
        """The place that Gauss-Newton finds from a pose."""
        return self.refined(np.array([pose.x_m, pose.y_m, pose.theta_rad]))

    def through_walls(self, origins_m: FloatArray, pose: Pose2) -> float:
        """Share of beams, from origins of shape (n, 2), that go through a wall if the robot is at `pose`."""
        walls = self._field
        start = walls.to_corner(np.array([pose.x_m, pose.y_m, pose.theta_rad]))
        resolution_m = walls.grid.resolution_m
        return float(
            share_through_walls(origins_m, self._hits_m, start, walls.distance_m, resolution_m, WALL_MARGIN_M)
        )

    def everywhere(self) -> list[Place]:
        """The best place of the whole map, and those apart from it that explain nearly as much."""
        return [self.refined(pose) for pose in self._field.alike(self._hits_m, HYPOTHESES, ALIKE)]

    def better(self, one: Place, other: Place) -> float:
        """How much better one place explains the beams than another, as a logarithm.

        Where things have been moved, one may be ahead by chance: what speaks for it counts in full only where
        no beam speaks for the other.
        """
        share, std_m = self._options.random_share, self._options.beam_std_m
        first, second = (
            np.log((1.0 - share) * self._field.likelihoods(self._hits_m, place.pose, std_m) + share)
            for place in (one, other)
        )
        ahead = float((first - second).sum())
        return ahead * abs(ahead) / max(1e-9, float(np.abs(first - second).sum()))
