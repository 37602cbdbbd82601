"""Whether a scan that the map does not explain contradicts it, or only shows what it does not hold yet."""

import math

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import CountArray, FieldArray

MARGIN = 6  # cells: nearer to a wall than this a beam's end or its way says nothing against the map


@kernel
def contradicting_share(
    origins: FloatArray, ends: FloatArray, misses: CountArray, distance_m: FieldArray, resolution_m: float
) -> float:
    """Share of the hits that end where the map is free, or whose beam goes through a wall before.

    `origins` and `ends`, shape (n, 2), are in cells. Through the door into another room it is near zero; for
    a robot that was carried away it is not.
    """
    rows, cols = misses.shape
    against = 0
    for i in range(ends.shape[0]):
        row, col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
        inside = 0 <= row < rows and 0 <= col < cols
        if inside and misses[row, col] > 0 and distance_m[row, col] > MARGIN * resolution_m:
            against += 1
            continue
        dx, dy = ends[i, 0] - origins[i, 0], ends[i, 1] - origins[i, 1]
        length = math.hypot(dx, dy)
        for k in range(int(length) - MARGIN):
            row, col = (
                math.floor(origins[i, 1] + dy * k / length),
                math.floor(origins[i, 0] + dx * k / length),
            )
            if 0 <= row < rows and 0 <= col < cols and distance_m[row, col] == 0.0:
                against += 1
                break
    return float(against / max(1, ends.shape[0]))
