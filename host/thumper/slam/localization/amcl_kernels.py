"""What each particle makes of a scan, in a known map."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import FieldArray

MaskArray = NDArray[np.bool_]


@kernel
def beam_scores(
    points_m: FloatArray,
    poses: FloatArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    std_m: float,
    random_share: float,
    gain: float,
    logs: FloatArray,
    scores: FloatArray,
) -> None:
    """Fill `logs` with log likelihoods and `scores` with mean likelihoods 0...1, shape (particles,).

    `poses`, shape (particles, 3), are in metres from the map's corner; off the map a beam is random.
    """
    rows, cols = distance_m.shape
    for k in range(poses.shape[0]):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        log, total = 0.0, 0.0
        for i in range(points_m.shape[0]):
            col = math.floor((poses[k, 0] + cos * points_m[i, 0] - sin * points_m[i, 1]) / resolution_m)
            row = math.floor((poses[k, 1] + sin * points_m[i, 0] + cos * points_m[i, 1]) / resolution_m)
            likelihood = 0.0
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] < reach_m:
                likelihood = math.exp(-0.5 * (distance_m[row, col] / std_m) ** 2)
            log += math.log((1.0 - random_share) * likelihood + random_share)
            total += likelihood
        logs[k] = gain * log
        scores[k] = total / points_m.shape[0]


@kernel
def beam_verdicts(
    origins_m: FloatArray,
    ends_m: FloatArray,
    pose: FloatArray,
    distance_m: FieldArray,
    known: MaskArray,
    resolution_m: float,
    std_m: float,
    margin_m: float,
    likelihoods: FloatArray,
    through: MaskArray,
    silent: MaskArray,
) -> None:
    """Fill in, for beams whose ends are of shape (n, 2), what each says of a pose; all of shape (n,).

    `likelihoods`: 0...1, that it ends on a wall; `through`: it crosses a wall more than `margin_m` before its
    end; `silent`: it does not, and ends in a cell that is not known and so far from walls. `pose`, shape
    (3,), is in metres from the map's corner.
    """
    rows, cols = distance_m.shape
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(ends_m.shape[0]):
        along_x, along_y = ends_m[i, 0] - origins_m[i, 0], ends_m[i, 1] - origins_m[i, 1]
        length_m = math.hypot(along_x, along_y)
        through[i] = False
        for k in range(int((length_m - margin_m) / resolution_m)):
            part = k * resolution_m / length_m
            x_m, y_m = origins_m[i, 0] + part * along_x, origins_m[i, 1] + part * along_y
            col = math.floor((pose[0] + cos * x_m - sin * y_m) / resolution_m)
            row = math.floor((pose[1] + sin * x_m + cos * y_m) / resolution_m)
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] == 0.0:
                through[i] = True
                break
        col = math.floor((pose[0] + cos * ends_m[i, 0] - sin * ends_m[i, 1]) / resolution_m)
        row = math.floor((pose[1] + sin * ends_m[i, 0] + cos * ends_m[i, 1]) / resolution_m)
        inside = 0 <= row < rows and 0 <= col < cols
        near = inside and distance_m[row, col] <= margin_m
        likelihoods[i] = math.exp(-0.5 * (distance_m[row, col] / std_m) ** 2) if near else 0.0
        silent[i] = not (through[i] or near or (inside and known[row, col]))
