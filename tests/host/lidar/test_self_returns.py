"""Echoes inside the footprint are the robot's own; everything outside stays."""

import math

import numpy as np

from thumper.common.geometry import Pose2
from thumper.lidar.scan import Scan
from thumper.lidar.self_returns import SelfReturnFilter
from thumper.navigation.footprint import Footprint

FILTER = SelfReturnFilter(Pose2(x_m=0.12), Footprint().polygon_m())


def scan(ranges_m: list[float]) -> Scan:
    """Return a scan with beams to the right, ahead, and to the left."""
    return Scan(
        time_s=1.0, ranges_m=np.array(ranges_m), angle_min_rad=-math.pi / 2, angle_increment_rad=math.pi / 2
    )


def test_a_cable_beside_the_lidar_is_invalid() -> None:
    """0.09 m to the left is inside the outline of 0.15 m; 0.05 m ahead ends 4 cm before its front."""
    ranges_m = FILTER.filter(scan([2.0, 0.05, 0.09])).ranges_m
    assert ranges_m[0] == 2.0
    assert np.isnan(ranges_m[1:]).all()


def test_what_touches_the_outline_is_an_obstacle() -> None:
    """The margin covers the lidar's own error: an obstacle at the outline may seem 3 cm nearer."""
    touching = scan([0.15, 0.09, 0.121])
    assert FILTER.filter(touching) is touching


def test_silent_and_far_beams_stay() -> None:
    far = scan([math.inf, math.nan, 3.0])
    assert FILTER.filter(far) is far
