"""The case of docs/explanation/localization.md: one scan, three places, one of them trusted."""

import math

import numpy as np
import pytest
from benchmarks.shared.rooms import rectangle, room_scan

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.resumable import run_to_end
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.localization.amcl import SEARCH_GAIN, Amcl
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.scan_likelihood import BEAM_GAIN, ScanLikelihood
from thumper_hil.world.world import World

EMPTY = rectangle(-3.0, -2.0, 3.0, 2.0)
WITH_BOX = np.concatenate((EMPTY, rectangle(1.2, -2.0, 2.0, -1.5)))
PERSON = rectangle(-0.1, 0.9, 0.2, 1.2)  # not in the map
A = Pose2(x_m=-1.0, y_m=-0.4)  # the robot
B = Pose2(x_m=1.0, y_m=0.4, theta_rad=math.pi)  # A turned by 180 degrees about the middle of the room
C = Pose2(x_m=0.0, y_m=-0.4)


def map_and_scan(walls: FloatArray) -> tuple[OccupancyGrid, Scan]:
    grid = World(segments_m=walls, circles_m=np.zeros((0, 3))).to_grid()
    return grid, room_scan(A, walls=np.concatenate((walls, PERSON)))


def test_each_place_has_the_figures_of_the_page() -> None:
    grid, scan = map_and_scan(WITH_BOX)
    likelihood = ScanLikelihood.of(scan, Twist2(), Pose2(), LikelihoodField(grid), AmclOptions())
    assert likelihood.beams == 60
    places = [likelihood.refine_pose(place) for place in (A, B, C)]
    shares = [(p.explained, likelihood.through_walls(p.pose), likelihood.fit(p.pose)) for p in places]
    assert np.round(shares, 2).tolist() == [[0.95, 0.0, 0.95], [0.92, 0.07, 0.85], [0.55, 0.2, 0.35]]
    assert [round(p.log, 2) for p in places] == [-6.91, -11.29, -61.01]
    odds = math.exp((SEARCH_GAIN + BEAM_GAIN) * (places[0].log - places[1].log))
    assert round(odds, 1) == 17.3
    assert round(odds / (odds + 1.0), 2) == 0.95
    assert len(run_to_end(likelihood.search_map())) == 2  # A and B


@pytest.mark.parametrize(
    ("walls", "doubt"),
    [(WITH_BOX, ""), (EMPTY, "several places look alike: 49 % of the weight is at the best one")],
)
def test_the_scan_decides_only_if_the_map_has_a_difference(walls: FloatArray, doubt: str) -> None:
    grid, scan = map_and_scan(walls)
    localizer = Amcl(grid)
    localizer.update(Pose2(), scan, Twist2())
    assert localizer.quality().lost == doubt
