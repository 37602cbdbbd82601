"""Likelihood of a scan at many poses of a known map, and the evidence of each beam at one pose."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import DistanceField

# This close before its end, a beam may pass a cell that is a wall in the map: neither is exact.
WALL_MARGIN_M = 0.3

MaskArray = NDArray[np.bool_]


class BeamModel(NamedTuple):
    """The likelihood field model of a beam (Thrun, Burgard, Fox, "Probabilistic Robotics", table 6.3)."""

    std_m: float  # z_hit's width
    random_share: float  # z_rand: share of beams that people and moved objects reflect
    gain: float  # share of a beam's evidence that counts: neighbouring beams repeat it


class BeamEvidence(NamedTuple):
    """What each beam of a scan says about one pose, arrays of shape (n,)."""

    likelihoods: FloatArray  # that it ends on a wall, 0...1
    through_wall: MaskArray  # it crosses a wall more than `WALL_MARGIN_M` before its end
    unknown: MaskArray  # it crosses none, and ends in unknown space away from walls


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


@kernel
def beam_evidence(
    origins_m: FloatArray,
    ends_m: FloatArray,
    pose: FloatArray,
    field: DistanceField,
    known: MaskArray,
    std_m: float,
) -> BeamEvidence:
    """Return the evidence of beams with ends of shape (n, 2) at a pose, shape (3,), from the map's corner."""
    distance_m, resolution_m = field.distance_m, field.resolution_m
    rows, cols = distance_m.shape
    n = ends_m.shape[0]
    likelihoods = np.empty(n)
    through_wall, unknown = np.empty(n, np.bool_), np.empty(n, np.bool_)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(n):
        along_x, along_y = ends_m[i, 0] - origins_m[i, 0], ends_m[i, 1] - origins_m[i, 1]
        length_m = math.hypot(along_x, along_y)
        through_wall[i] = False
        for k in range(int((length_m - WALL_MARGIN_M) / resolution_m)):
            part = k * resolution_m / length_m
            x_m, y_m = origins_m[i, 0] + part * along_x, origins_m[i, 1] + part * along_y
            col = math.floor((pose[0] + cos * x_m - sin * y_m) / resolution_m)
            row = math.floor((pose[1] + sin * x_m + cos * y_m) / resolution_m)
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] == 0.0:
                through_wall[i] = True
                break
        col = math.floor((pose[0] + cos * ends_m[i, 0] - sin * ends_m[i, 1]) / resolution_m)
        row = math.floor((pose[1] + sin * ends_m[i, 0] + cos * ends_m[i, 1]) / resolution_m)
        inside = 0 <= row < rows and 0 <= col < cols
        near = inside and distance_m[row, col] <= WALL_MARGIN_M
        likelihoods[i] = math.exp(-0.5 * (distance_m[row, col] / std_m) ** 2) if near else 0.0
        unknown[i] = not (through_wall[i] or near or (inside and known[row, col]))
    return BeamEvidence(likelihoods, through_wall, unknown)
