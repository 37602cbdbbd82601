"""Whether a scan that the map does not explain contradicts it, or only shows an area not mapped yet."""

import math

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import CountArray, DistanceField

MARGIN_CELLS = 6  # closer to a wall than this, neither a beam's end nor its path contradicts the map


@kernel
def contradicting_share(
    origins: FloatArray, ends: FloatArray, misses: CountArray, field: DistanceField
) -> float:
    """Return the share of hits that end in free space, or whose beam first passes through a wall.

    `origins` and `ends`, shape (n, 2), are in cells. The share is near zero for a look through the door into
    a new room, and large for a kidnapped robot.
    """
    distance_m = field.distance_m
    rows, cols = misses.shape
    against = 0
    for i in range(ends.shape[0]):
        row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
        inside = 0 <= row < rows and 0 <= col < cols
        if inside and misses[row, col] > 0 and distance_m[row, col] > MARGIN_CELLS * field.resolution_m:
            against += 1
            continue
        dx, dy = ends[i, 0] - origins[i, 0], ends[i, 1] - origins[i, 1]
        length = math.hypot(dx, dy)
        for k in range(int(length) - MARGIN_CELLS):
            row, col = (
                math.floor(origins[i, 1] + dy * k / length),
                math.floor(origins[i, 0] + dx * k / length),
            )
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] == 0.0:
                against += 1
                break
    return float(against / max(1, ends.shape[0]))
