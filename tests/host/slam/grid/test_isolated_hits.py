"""Hits without a neighbour: which they are, and what they do to a drive along a corridor."""

import itertools
import math

import numpy as np
import pytest
from benchmarks.shared.corridors import corridor_loop, round_trip

from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.deskew import HIT, INVALID, MISS, ScanPoints
from thumper.lidar.scan import Scan
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.isolated_hits import ISOLATED_M, without_isolated_hits

NEAR_M, FAR_M = 0.9 * ISOLATED_M, 1.1 * ISOLATED_M


@pytest.mark.parametrize(
    ("steps_m", "kept"),
    [
        ((NEAR_M, NEAR_M), [HIT, HIT, HIT]),
        ((NEAR_M, FAR_M), [HIT, HIT, INVALID]),
        ((FAR_M, NEAR_M), [INVALID, HIT, HIT]),
        ((FAR_M, FAR_M), [INVALID, INVALID, INVALID]),
        ((), [INVALID]),
    ],
)
def test_only_hits_without_a_neighbour_are_left_out(steps_m: tuple[float, ...], kept: list[int]) -> None:
    along_m = np.cumsum((1.0, *steps_m))
    rows = [row for x_m in along_m for row in ((x_m, 0.0), (x_m, 50.0))]  # beams without an echo in between
    points = ScanPoints(
        origins_m=np.zeros((len(rows), 2)),
        ends_m=np.array(rows),
        kinds=np.array([HIT, MISS] * len(along_m), np.uint8),
    )
    assert without_isolated_hits(points).kinds.tolist() == [kind for hit in kept for kind in (hit, MISS)]


@pytest.mark.parametrize("seed", [1, 2])
def test_wall_far_ahead_does_not_hold_the_robot_back(seed: int) -> None:
    """With all hits of every scan in the map it would be 0.33 and 0.42 m short."""
    rng, angles = np.random.default_rng(seed), np.radians(np.arange(-90.0, 91.0))
    world, poses = corridor_loop(60.0, 20.0, rng), round_trip(60.0, 20.0, 0.0, step_m=0.1)[:120]
    mapper, odometry = GridMapper(map_from_base=poses[0]), Pose2()
    for before, pose in itertools.pairwise([poses[0], *poses]):
        odometry = odometry @ Pose2(x_m=1.03 * before.distance_m(pose))
        ranges_m = world.cast(pose.x_m, pose.y_m, angles) + 0.01 * rng.standard_normal(angles.size)
        scan = Scan(
            time_s=0.0,
            ranges_m=ranges_m,
            angle_min_rad=-0.5 * math.pi,
            angle_increment_rad=math.radians(1.0),
            range_max_m=80.0,
        )
        found = mapper.update(odometry, scan, Twist2()).map_from_base
    assert found.x_m == pytest.approx(poses[-1].x_m, abs=0.2)
