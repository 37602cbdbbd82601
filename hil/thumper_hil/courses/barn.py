"""Worlds of the BARN challenge, random worlds of the same kind, and the course through one.

Perille et al., "Benchmarking Metric Ground Navigation" (2020): 30 x 30 cells of one post's diameter, filled
by a cellular automaton. The robot starts south of the field and its goal is north of it; success means within
1 m of the goal without a contact. All worlds can be scaled.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve, distance_transform_edt, label

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.goal import Goal
from thumper_hil.courses.course import Course

POST_RADIUS_M = 0.075
CELL_M = 2.0 * POST_RADIUS_M
FIELD_CELLS = 30
FIELD_CORNER_M = (-4.5, 5.0)
LIMIT_S = 100.0
NARROWEST_RADIUS_M = (
    0.375  # the radius of the widest disc that passes is at least this in all recorded worlds
)


def recorded_world(folder: Path, index: int, scale: float) -> FloatArray:
    """Return the posts of a published world, scaled, shape (n, 3)."""
    centres: FloatArray = np.loadtxt(folder / f"world_{index:03d}_cylinders.csv", delimiter=",", skiprows=1)
    return _posts(centres[:, :2], scale)


def random_world(seed: int, scale: float) -> FloatArray:
    """Return the posts of a random world of the same kind, shape (n, 3).

    It has random cells, smoothed, with a passage as wide as theirs. The walls to the left, to the right and
    behind are those of the published worlds.
    """
    rng = np.random.default_rng(seed)
    while True:
        filled = rng.random((FIELD_CELLS, FIELD_CELLS)) < rng.choice((0.15, 0.20, 0.25, 0.30))
        for _ in range(int(rng.integers(2, 5))):
            around = convolve(filled.astype(np.int64), np.ones((3, 3), np.int64), mode="constant") - filled
            filled = np.where(filled, around >= 2, around >= 5)
        if 0.03 < filled.mean() < 0.30 and _is_passable(filled):
            rows, cols = np.nonzero(filled)
            inner = np.column_stack((cols, rows)) * CELL_M + FIELD_CORNER_M + 0.5 * CELL_M
            return _posts(np.vstack((inner, _walls())), scale)


def _posts(centres_m: FloatArray, scale: float) -> FloatArray:
    return np.column_stack((centres_m, np.full(len(centres_m), POST_RADIUS_M))) * scale


def _walls() -> FloatArray:
    """Return the post centres of the walls beside and behind the field, shape (n, 2)."""
    x_m, y_m = np.array(FIELD_CORNER_M)
    width_m = FIELD_CELLS * CELL_M
    along = np.arange(0.0, y_m + width_m, CELL_M)
    across = np.arange(x_m - CELL_M, x_m + width_m + CELL_M, CELL_M)
    sides = [np.column_stack((np.full(along.size, x), along)) for x in (across[0], across[-1])]
    return np.vstack((*sides, np.column_stack((across, np.zeros(across.size)))))


def _is_passable(filled: NDArray[np.bool_]) -> bool:
    """Return True if a disc of `NARROWEST_RADIUS_M` can pass from the south edge to the north edge."""
    fine = np.kron(np.pad(filled, ((8, 8), (0, 0))), np.ones((6, 6), np.bool_))
    fine = np.pad(fine, ((0, 0), (6, 6)), constant_values=True)
    free = distance_transform_edt(~fine) * (CELL_M / 6.0) >= NARROWEST_RADIUS_M
    parts, _ = label(free, np.ones((3, 3)))
    return bool(np.intersect1d(parts[0][parts[0] > 0], parts[-1][parts[-1] > 0]).size)


def barn_course(circles_m: FloatArray, scale: float) -> Course:
    """Return the course through a field of posts, shape (n, 3), that are already scaled."""
    posts = (
        f"[[circle]]\nx_m = {x}\ny_m = {y}\nradius_m = {radius}\n" for x, y, radius in circles_m.tolist()
    )
    return Course(
        world_toml="".join(posts),
        start=Pose2(x_m=-2.25 * scale, y_m=3.0 * scale, theta_rad=0.5 * math.pi),
        goal=Goal(x_m=-2.25 * scale, y_m=13.0 * scale),
        limit_s=LIMIT_S,
        arrival_m=scale,
    )
