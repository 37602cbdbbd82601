"""Where a lidar's beams meet the floor, level or on ramps.

A beam that points down by an angle `a` from the height `h` ends on a level floor after h / tan(a): 3.8 m at
0.2 m and 3 degrees.
"""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2

NO_RAMPS: FloatArray = np.zeros((0, 6))
PARALLEL = 1e-9  # a beam that nears the floor by less per metre never meets it


def floor_range_m(rays: FloatArray, down: FloatArray, height_m: float, ramps_m: FloatArray) -> FloatArray:
    """Return where each ray meets the floor, shape (n,) [m]; +inf if it never does.

    `rays`, shape (n, 3), have x, y and angle in the map. Each begins `height_m` above the floor, and falls by
    `down`, shape (n,), per metre. `ramps_m` is as in `thumper_hil.world.ramps`; the floor along a ray rises
    as under the axles.
    """
    if not len(ramps_m):
        return np.where(down > PARALLEL, height_m / np.maximum(down, PARALLEL), np.inf)
    enters_m, leaves_m, slopes = _spans(rays, ramps_m)
    # The height of the ray above the floor is linear between the ends of the ramps.
    at_m = np.sort(np.vstack((np.zeros((1, len(rays))), enters_m, leaves_m)), axis=0)
    on_ramps_m = np.clip(at_m[:, None] - enters_m, 0.0, leaves_m - enters_m)
    heights_m = height_m - down * at_m - np.sum(slopes * on_ramps_m, axis=1)
    steps_m = np.diff(at_m, axis=0)
    nears = np.where(steps_m > PARALLEL, -np.diff(heights_m, axis=0), 0.0) / np.maximum(steps_m, PARALLEL)
    nears = np.vstack((nears, down))
    meets_m = at_m + heights_m / np.maximum(nears, PARALLEL)
    ends_m = np.vstack((at_m[1:], np.full(len(rays), np.inf)))
    found = (nears > PARALLEL) & (heights_m >= 0.0) & (meets_m <= ends_m)
    return np.asarray(np.where(found, meets_m, np.inf).min(axis=0))


def slope_toward(points_m: FloatArray, angles_rad: FloatArray, ramps_m: FloatArray) -> FloatArray:
    """Return by how much the floor at points, shape (n, 2), rises per metre in a direction each."""
    slopes = np.zeros(len(points_m))
    for x_m, y_m, length_m, width_m, yaw_deg, rise_m in ramps_m:
        middle = Pose2(x_m=x_m, y_m=y_m, theta_rad=np.radians(yaw_deg))
        off_m = np.abs(middle.inverse().apply(points_m))
        on_it = (off_m[:, 0] <= 0.5 * length_m) & (off_m[:, 1] <= 0.5 * width_m)
        slopes += on_it * np.cos(angles_rad - middle.theta_rad) * rise_m / length_m
    return slopes


def _spans(rays: FloatArray, ramps_m: FloatArray) -> FloatArray:
    """Return where each ray enters and leaves each ramp [m], and how it rises there, shape (3, ramps, n)."""
    spans = np.zeros((3, len(ramps_m), len(rays)))
    for span, (x_m, y_m, length_m, width_m, yaw_deg, rise_m) in zip(
        spans.swapaxes(0, 1), ramps_m, strict=True
    ):
        middle = Pose2(x_m=x_m, y_m=y_m, theta_rad=np.radians(yaw_deg))
        starts_m, angles_rad = middle.inverse().apply(rays[:, :2]), rays[:, 2] - middle.theta_rad
        along = np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
        along[along == 0.0] = PARALLEL**2
        half_m = 0.5 * np.array((length_m, width_m))
        sides_m = np.sort(((-half_m - starts_m) / along, (half_m - starts_m) / along), axis=0)
        enters_m = np.maximum(sides_m[0].max(axis=1), 0.0)
        span[:] = enters_m, np.maximum(sides_m[1].min(axis=1), enters_m), along[:, 0] * rise_m / length_m
    return spans
