"""What each particle makes of a scan, in a known map."""

import math

from thumper.geometry import FloatArray
from thumper.kernel import kernel
from thumper.mapping.distance_field import FieldArray


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
