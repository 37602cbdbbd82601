"""Along which direction a scan fixes nothing, told by the walls that it sees and not by the map.

In a bare corridor the score hardly changes along the walls, but it never stays the same: cells are square,
and the map ends where the robot has not looked yet. Such noise must not move the pose (Zhang, Kaess, Singh,
"On degeneracy of optimization-based state estimation problems", ICRA 2016).
"""

import math

from thumper.geometry import FloatArray
from thumper.kernel import kernel

BASELINE_M = 0.3  # a wall's direction is taken over this much of it: 1 cm of noise turns it by 3 degrees


@kernel
def open_direction(points_m: FloatArray) -> tuple[float, float, float]:
    """Unit vector (x, y) that the walls fix least, and the share of the wall that fixes it, 0...0.5.

    `points_m`, shape (n, 2), are the hits in the order of the beams. A scan without walls gives a share of 0.
    """
    xx = xy = yy = 0.0
    last, n = 0, points_m.shape[0]
    for i in range(1, n):
        step = math.hypot(points_m[i, 0] - points_m[i - 1, 0], points_m[i, 1] - points_m[i - 1, 1])
        if step > BASELINE_M:  # another wall, or so far away that the beams do not tell
            last = i
            continue
        dx, dy = points_m[i, 0] - points_m[last, 0], points_m[i, 1] - points_m[last, 1]
        squared = dx * dx + dy * dy
        if squared < BASELINE_M * BASELINE_M:
            continue
        beams = (i - last) / squared
        xx += beams * dy * dy  # the normal is (-dy, dx)
        xy -= beams * dx * dy
        yy += beams * dx * dx
        last = i
    middle, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    if middle <= 0.0:
        return 1.0, 0.0, 0.0
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    return math.cos(angle), math.sin(angle), (middle - half) / (2.0 * middle)
