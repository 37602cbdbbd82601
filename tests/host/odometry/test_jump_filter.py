"""Odometry that leaps is bridged and counted; whatever a robot can do is passed on as it is."""

import math
from collections.abc import Iterable

import pytest

from thumper.common.geometry import Pose2
from thumper.odometry.jump_filter import JumpFilter


def passed(ways: Iterable[tuple[float, float]]) -> tuple[JumpFilter, list[float]]:
    """The bridge after (time, x), and the x that it gave."""
    bridge = JumpFilter()
    return bridge, [bridge.filter(time_s, Pose2(x_m=x_m)).x_m for time_s, x_m in ways]


def test_what_follows_a_leap_goes_on_from_where_the_robot_was() -> None:
    bridge, x_m = passed([(0.0, 5.0), (0.1, 5.1), (0.2, 5.2), (0.3, 0.0), (0.4, 0.1), (0.5, 9.0)])
    assert x_m == pytest.approx([5.0, 5.1, 5.2, 5.2, 5.3, 5.3])
    assert bridge.summary_lines() == [
        "2 times the odometry leapt, by up to 8.9 m: taken as no motion; did its board or program begin anew?"
    ]


@pytest.mark.parametrize(
    "ways",
    [
        [(0.1 * k, 0.2 * k) for k in range(40)],
        [(0.1 * k, 0.05 * k) for k in range(20)] + [(60.0, 12.0), (60.1, 12.05)],  # the lidar was off
        [(0.0, 0.0), (0.1, 0.1), (0.1, 0.2), (0.05, 0.9), (math.nan, 1.0)],  # a clock as logs have them
        [(7.0, 1.5 * k) for k in range(20)],  # one scan in fifty, all with one stamp
    ],
)
def test_a_fast_a_sparse_and_a_badly_stamped_drive_do_not_leap(ways: list[tuple[float, float]]) -> None:
    bridge, x_m = passed(ways)
    assert x_m == [x for _, x in ways]
    assert bridge.summary_lines() == []
