"""Which poses a robot can reach among walls, by exhaustive search over x, y and heading.

A judge of what is possible. It shares no code with the planners: exact walls instead of cells, and every
motion that it uses (straight ahead, straight back, a turn on the spot) can be driven as it is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper_hil.kinematic.world import KinematicWorld

HEADINGS = 72
BIN_M = 0.02
STEP_M = 0.03  # longer than a bin's diagonal, so that each step leaves its bin
MOVES = ((STEP_M, 0), (-STEP_M, 0), (0.0, 1), (0.0, -1))


@kernel
def outline_is_free(
    segments_m: FloatArray, polygon_m: FloatArray, x_m: float, y_m: float, theta_rad: float
) -> bool:
    """Return whether no wall, shape (n, 4), meets a convex polygon, shape (k, 2), at a pose.

    A wall misses it if it lies beyond one of its edges, or all of the polygon lies on one side of the wall's
    line (separating axes).
    """
    cos, sin = math.cos(theta_rad), math.sin(theta_rad)
    count = polygon_m.shape[0]
    for i in range(segments_m.shape[0]):
        ax, ay = segments_m[i, 0] - x_m, segments_m[i, 1] - y_m
        bx, by = segments_m[i, 2] - x_m, segments_m[i, 3] - y_m
        ax, ay, bx, by = cos * ax + sin * ay, cos * ay - sin * ax, cos * bx + sin * by, cos * by - sin * bx
        least, most = np.inf, -np.inf
        separated = False
        for k in range(count):
            px, py = polygon_m[k]
            qx, qy = polygon_m[(k + 1) % count]
            nx, ny = qy - py, px - qx
            separated |= nx * (ax - px) + ny * (ay - py) > 0.0 and nx * (bx - px) + ny * (by - py) > 0.0
            side = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
            least, most = min(least, side), max(most, side)
        if not (separated or least > 0.0 or most < 0.0):
            return False
    return True


@kernel
def flood(segments_m: FloatArray, polygon_m: FloatArray, start: FloatArray, box_m: FloatArray) -> FloatArray:
    """Return poses (x, y, theta) that can be reached from one, shape (n, 3): the first found in each bin.

    `box_m` is x, y, width, height of the area that is searched.
    """
    cols, rows = math.ceil(box_m[2] / BIN_M), math.ceil(box_m[3] / BIN_M)
    reached = np.zeros((rows, cols, HEADINGS), np.bool_)
    poses = np.empty((rows * cols * HEADINGS + 1, 3))
    poses[0] = start
    found, done = 1, 0
    turn = 2.0 * math.pi / HEADINGS
    while done < found:
        x, y, theta = poses[done]
        done += 1
        for length, change in MOVES:
            nx, ny = x + length * math.cos(theta), y + length * math.sin(theta)
            heading = theta + change * turn
            col, row = math.floor((nx - box_m[0]) / BIN_M), math.floor((ny - box_m[1]) / BIN_M)
            slot = round((heading - start[2]) / turn) % HEADINGS
            if not (0 <= row < rows and 0 <= col < cols) or reached[row, col, slot]:
                continue
            if outline_is_free(segments_m, polygon_m, nx, ny, heading):
                reached[row, col, slot] = True
                poses[found] = (nx, ny, heading)
                found += 1
    return poses[:found]


def reachable_poses(
    world: KinematicWorld, footprint: Footprint, start: Pose2, box_m: tuple[float, float, float, float]
) -> FloatArray:
    """Return the poses that the footprint can reach without touching a wall, shape (n, 3)."""
    start_pose = np.array((start.x_m, start.y_m, start.theta_rad))
    if not outline_is_free(world.segments_m, footprint.polygon_m(), *start_pose):
        return np.empty((0, 3))
    return flood(world.segments_m, footprint.polygon_m(), start_pose, np.array(box_m))


def at_goal(poses: FloatArray, goal: Goal) -> NDArray[np.bool_]:
    """Return which poses, shape (n, 3), are within the tolerances of a goal."""
    near: NDArray[np.bool_] = np.hypot(poses[:, 0] - goal.x_m, poses[:, 1] - goal.y_m) <= goal.tolerance_m
    if goal.theta_rad is None:
        return near
    errors_rad = np.abs(np.angle(np.exp(1j * (poses[:, 2] - goal.theta_rad))))
    near &= errors_rad <= goal.heading_tolerance_rad
    return near
