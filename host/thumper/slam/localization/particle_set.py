"""Weighted particles: move, weigh, cluster and resample them."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.localization.kld_sampling import kld_resample
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.scan_likelihood import PoseHypothesis

CLUSTER_M, CLUSTER_RAD = 0.5, 0.5  # particles this close to the best one make its cluster
RESAMPLE_BELOW = 0.5  # effective share of the particles
MIN_NOISE_M, MIN_NOISE_RAD = 0.005, 0.002  # of a step, however short
AROUND_STD_M, AROUND_STD_RAD = 0.1, 0.05  # of particles drawn around a hypothesis


@dataclass(slots=True)
class ParticleSet:
    """Particles and their weights."""

    poses: FloatArray  # x, y, theta, shape (n, 3)
    weights: FloatArray  # sum 1, shape (n,)

    @classmethod
    def uniform(cls, poses: FloatArray) -> "ParticleSet":
        """Return particles of equal weight."""
        return cls(poses, np.full(len(poses), 1.0 / len(poses)))

    @classmethod
    def weighted(cls, poses: FloatArray, weights: FloatArray) -> "ParticleSet":
        """Return particles with normalised weights."""
        return cls(poses, weights / weights.sum())

    @classmethod
    def gaussian(
        cls, mean: Pose2, std_m: float, std_rad: float, count: int, rng: np.random.Generator
    ) -> "ParticleSet":
        """Draw particles around a pose."""
        offsets = rng.standard_normal((count, 3)) * (std_m, std_m, std_rad)
        return cls.uniform(offsets + np.array([mean.x_m, mean.y_m, mean.theta_rad]))

    @classmethod
    def around(
        cls, hypotheses: list[PoseHypothesis], odds: FloatArray, count: int, rng: np.random.Generator
    ) -> "ParticleSet":
        """Draw equally many particles around each hypothesis, weighted by odds."""
        return cls.weighted(*draw_around(hypotheses, odds, count, rng))

    def move(self, moved: Pose2, options: AmclOptions, rng: np.random.Generator) -> None:
        """Move every particle by odometry and a draw of its noise."""
        distance_m, turn_rad = math.hypot(moved.x_m, moved.y_m), abs(moved.theta_rad)
        noise = rng.standard_normal((len(self.poses), 3)) * (
            options.noise_per_m * distance_m + MIN_NOISE_M,
            options.noise_per_m * distance_m + MIN_NOISE_M,
            options.noise_per_m * distance_m + options.noise_per_rad * turn_rad + MIN_NOISE_RAD,
        )
        x_m, y_m = moved.x_m + noise[:, 0], moved.y_m + noise[:, 1]
        cos, sin = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        self.poses[:, 0] += cos * x_m - sin * y_m
        self.poses[:, 1] += sin * x_m + cos * y_m
        self.poses[:, 2] += moved.theta_rad + noise[:, 2]

    def weigh(self, logs: FloatArray) -> None:
        """Multiply the weights by likelihoods, given as logarithms, shape (n,)."""
        weights = self.weights * np.exp(logs - logs.max())
        self.weights = weights / weights.sum()

    def best_cluster(self) -> tuple[FloatArray, float]:
        """Return the mean pose of the cluster around the best particle, shape (3,), and its weight."""
        best = self.poses[int(np.argmax(self.weights))]
        near = np.hypot(*(self.poses[:, :2] - best[:2]).T) < CLUSTER_M
        near &= np.abs(_wrapped(self.poses[:, 2] - best[2])) < CLUSTER_RAD
        weight = float(self.weights[near].sum())
        share = self.weights[near] / weight
        mean = np.append(share @ self.poses[near, :2], best[2])
        mean[2] += float(share @ _wrapped(self.poses[near, 2] - best[2]))
        return mean, weight

    def resample(self, options: AmclOptions, rng: np.random.Generator) -> None:
        """Resample to the number that KLD sampling asks for, if too few particles carry the weight."""
        effective = 1.0 / float(np.sum(self.weights**2))
        if effective < RESAMPLE_BELOW * len(self.weights):
            self.poses = kld_resample(self.poses, self.weights, options, rng)
            self.weights = np.full(len(self.poses), 1.0 / len(self.poses))

    def covariance_about(self, pose: Pose2) -> FloatArray:
        """Return the second moment about a pose, shape (3, 3)."""
        offsets = self.poses - np.array([pose.x_m, pose.y_m, pose.theta_rad])
        offsets[:, 2] = _wrapped(offsets[:, 2])
        return np.asarray((offsets * self.weights[:, np.newaxis]).T @ offsets)


def draw_around(
    hypotheses: list[PoseHypothesis], odds: FloatArray, count: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Draw equally many particles around each hypothesis; return poses, (count, 3), and weights by odds."""
    rows = np.array([(h.pose.x_m, h.pose.y_m, h.pose.theta_rad) for h in hypotheses])
    which = np.arange(count) % len(hypotheses)
    noise = rng.standard_normal((count, 3)) * (AROUND_STD_M, AROUND_STD_M, AROUND_STD_RAD)
    return rows[which] + noise, odds[which]


def _wrapped(angles_rad: FloatArray) -> FloatArray:
    return np.remainder(angles_rad + math.pi, math.tau) - math.pi
