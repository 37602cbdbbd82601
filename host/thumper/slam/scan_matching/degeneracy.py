"""Degeneracy of a scan: the direction that it constrains least, judged by the visible walls alone.

In a bare corridor the score hardly changes along the walls, but it is never constant: cells are square, and
the map ends where the robot has not looked yet. That noise must not move the pose (Zhang, Kaess, Singh, "On
degeneracy of optimization-based state estimation problems", ICRA 2016).
"""

import math

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel

BASELINE_M = 0.3  # a wall's direction is measured over this length: 1 cm of noise turns it by 3 degrees
# Far away, neighbouring beams end further apart than that. They still show one wall ...
MIN_INCIDENCE_SINE = 0.5  # ... if it is seen under this sine or more, so it is no gap between two walls ...
MAX_BEND_SINE = 0.5  # ... and if the next piece bends by less than this sine.
MIN_PIECES = 10  # consecutive pieces that make a wall; the end of a corridor is not enough among doorways
MAX_BEAM_SINE = 0.035  # of the angle between two beams with none missing in between


@kernel
def weakest_direction(points_m: FloatArray) -> tuple[float, float, float]:
    """Return the direction (x, y) that the walls constrain least, and the share that does, 0...0.5.

    `points_m`, shape (n, 2), are the hits in the order of the beams. A scan without walls gives a share of 0.
    """
    xx = xy = yy = 0.0
    far_x = far_y = 0.0  # direction of the far wall's last piece
    last, pieces, n = 0, 0, points_m.shape[0]
    for i in range(1, n):
        dx, dy = points_m[i, 0] - points_m[i - 1, 0], points_m[i, 1] - points_m[i - 1, 1]
        step = math.hypot(dx, dy)
        if step > BASELINE_M:  # far away, or another wall
            last = i
            dx, dy = dx / step, dy / step
            straight = abs(far_x * dy - far_y * dx) < MAX_BEND_SINE and far_x * dx + far_y * dy > 0.0
            facing = _is_facing_wall(points_m, i, step)
            pieces = pieces + 1 if facing and straight else 0
            far_x, far_y = (dx, dy) if facing else (0.0, 0.0)
            beams = 1.0 if pieces > MIN_PIECES else float(MIN_PIECES) if pieces == MIN_PIECES else 0.0
        else:
            pieces, far_x, far_y = 0, 0.0, 0.0
            dx, dy = points_m[i, 0] - points_m[last, 0], points_m[i, 1] - points_m[last, 1]
            squared = dx * dx + dy * dy
            if squared < BASELINE_M * BASELINE_M:
                continue
            beams = (i - last) / squared
            last = i
        xx += beams * dy * dy  # the normal is (-dy, dx)
        xy -= beams * dx * dy
        yy += beams * dx * dx
    middle, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    if middle <= 0.0:
        return 1.0, 0.0, 0.0
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    return math.cos(angle), math.sin(angle), (middle - half) / (2.0 * middle)


@kernel
def _is_facing_wall(points_m: FloatArray, i: int, step: float) -> bool:
    """Return whether point `i` and the one before, `step` apart, may lie on a wall not seen edge-on."""
    x, y = points_m[i, 0], points_m[i, 1]
    cross = abs(points_m[i - 1, 0] * y - points_m[i - 1, 1] * x)
    range_m = math.hypot(x, y)
    between = cross / max(1e-9, range_m * math.hypot(points_m[i - 1, 0], points_m[i - 1, 1]))
    return bool(between < MAX_BEAM_SINE and cross > MIN_INCIDENCE_SINE * step * range_m)
