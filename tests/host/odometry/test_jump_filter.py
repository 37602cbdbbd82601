"""Jumps of the odometry are removed and counted; real motion passes unchanged."""

import math
from collections.abc import Iterable

import pytest

from thumper.common.geometry import Pose2
from thumper.odometry.jump_filter import JumpFilter


def run(track: Iterable[tuple[float, float]]) -> tuple[JumpFilter, list[float]]:
    """Return the filter after a track of (time, x), and its output x."""
    jump_filter = JumpFilter()
    return jump_filter, [jump_filter.filter(time_s, Pose2(x_m=x_m)).x_m for time_s, x_m in track]


def test_the_pose_continues_after_a_jump() -> None:
    jump_filter, x_m = run([(0.0, 5.0), (0.1, 5.1), (0.2, 5.2), (0.3, 0.0), (0.4, 0.1), (0.5, 9.0)])
    assert x_m == pytest.approx([5.0, 5.1, 5.2, 5.2, 5.3, 5.3])
    assert jump_filter.summary_lines() == [
        "the odometry jumped 2 times, by up to 8.9 m: read as no motion; "
        "did the board or its program restart?"
    ]


@pytest.mark.parametrize(
    "track",
    [
        [(0.1 * k, 0.2 * k) for k in range(40)],
        [(0.1 * k, 0.05 * k) for k in range(20)] + [(60.0, 12.0), (60.1, 12.05)],  # the lidar was off
        [(0.0, 0.0), (0.1, 0.1), (0.1, 0.2), (0.05, 0.9), (math.nan, 1.0)],  # bad stamps, as in real logs
        [(7.0, 1.5 * k) for k in range(20)],  # one scan in fifty, all with the same stamp
        [(7.0, 0.1 * k) for k in range(5)] + [(7.0, 1.5 * k) for k in range(1, 20)],  # and slow at first
    ],
)
def test_fast_sparse_or_badly_stamped_motion_is_no_jump(track: list[tuple[float, float]]) -> None:
    jump_filter, x_m = run(track)
    assert x_m == [x for _, x in track]
    assert jump_filter.summary_lines() == []
