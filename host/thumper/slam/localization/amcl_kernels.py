"""Likelihood of a scan at many poses of a known map."""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import DistanceField


class BeamModel(NamedTuple):
    """The likelihood field model of a beam (Thrun, Burgard, Fox, "Probabilistic Robotics", table 6.3)."""

    std_m: float  # z_hit's width
    random_share: float  # z_rand: share of beams that people and moved objects reflect
    gain: float  # share of a beam's evidence that counts: neighbouring beams repeat it


@kernel
def scan_likelihoods(
    points_m: FloatArray, poses: FloatArray, field: DistanceField, model: BeamModel
) -> tuple[FloatArray, FloatArray]:
    """Return the log likelihood of the scan, and the mean likelihood 0...1, at each pose; shape (poses,).

    `poses`, shape (poses, 3), are in metres from the map's corner. Outside the map a beam is random.
    """
    distance_m, resolution_m = field.distance_m, field.resolution_m
    rows, cols = distance_m.shape
    logs, scores = np.empty(poses.shape[0]), np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        log, total = 0.0, 0.0
        for i in range(points_m.shape[0]):
            col = math.floor((poses[k, 0] + cos * points_m[i, 0] - sin * points_m[i, 1]) / resolution_m)
            row = math.floor((poses[k, 1] + sin * points_m[i, 0] + cos * points_m[i, 1]) / resolution_m)
            likelihood = 0.0
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] < field.max_distance_m:
                likelihood = math.exp(-0.5 * (distance_m[row, col] / model.std_m) ** 2)
            log += math.log((1.0 - model.random_share) * likelihood + model.random_share)
            total += likelihood
        logs[k] = model.gain * log
        scores[k] = total / points_m.shape[0]
    return logs, scores
