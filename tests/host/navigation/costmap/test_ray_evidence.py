"""Silence of the lidar: one scan without an echo neither clears a remembered point nor convicts a hit."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap import ray_evidence as ray_evidence_module
from thumper.navigation.costmap.obstacle_memory import BESIDE_M, ObstacleMemory, ObstacleMemoryOptions
from thumper.navigation.costmap.ray_evidence import Evidence, ScanRays
from thumper.navigation.footprint import Footprint

VIEW = FieldOfView(base_from_laser=Pose2())
POST = np.array(((0.33, 0.0),))


def ring(radius_m: float, *, silent_rad: float = 0.0) -> FloatArray:
    """Return the echoes of a round wall; beams within `silent_rad` of the heading have none."""
    angles_rad = np.linspace(-2.09, 2.09, 683)
    angles_rad = angles_rad[np.abs(angles_rad) >= silent_rad]
    return np.column_stack((radius_m * np.cos(angles_rad), radius_m * np.sin(angles_rad)))


def memory_of_the_post() -> ObstacleMemory:
    memory = ObstacleMemory(ObstacleMemoryOptions(), 0.8, VIEW, footprint=Footprint(), padded=Footprint())
    memory.update(0.0, Pose2(), POST)
    return memory


@pytest.mark.parametrize(
    ("hits_m", "evidence"),
    [
        (ring(2.0), Evidence.PASSED),
        (ring(2.0, silent_rad=0.06), Evidence.SILENT),
        (np.empty((0, 2)), Evidence.SILENT),
        (POST, Evidence.SEEN),
        (np.vstack((ring(2.0), 0.5 * POST)), Evidence.HIDDEN),
    ],
)
def test_evidence_of_one_scan(hits_m: FloatArray, evidence: Evidence) -> None:
    assert ScanRays(VIEW, Pose2(), hits_m).evidence(POST, 0.08).tolist() == [evidence]
    assert ScanRays(VIEW, Pose2(theta_rad=math.pi), hits_m).evidence(POST, 0.08)[0] == Evidence.OUT_OF_VIEW


def test_silent_scans_from_one_pose_do_not_clear_a_point_beside_the_robot() -> None:
    memory = memory_of_the_post()
    for cycle in range(1, 30):
        left = memory.update(0.1 * cycle, Pose2(), ring(2.0, silent_rad=0.06))
        assert left == pytest.approx(POST)


def test_silent_scans_from_one_pose_clear_a_point_further_away() -> None:
    """People who have walked through an open hall would otherwise leave obstacles behind."""
    memory, nothing = memory_of_the_post(), np.empty((0, 2))
    further = np.array(((Footprint().circumscribed_radius_m + BESIDE_M + 0.02, 0.0),))
    memory.update(0.0, Pose2(), further)
    for time_s in (0.1, 0.3, 0.51, 0.7, 0.9):
        assert memory.update(time_s, Pose2(), nothing) == pytest.approx(np.vstack((POST, further)))
    for time_s in (0.92, 1.5, 5.0):
        assert memory.update(time_s, Pose2(), nothing) == pytest.approx(POST)  # beside the robot


def test_silent_scans_from_several_poses_clear_an_open_hall() -> None:
    memory, nothing = memory_of_the_post(), np.empty((0, 2))
    assert len(memory.update(0.1, Pose2(y_m=0.01), nothing)) == 1
    assert len(memory.update(0.2, Pose2(y_m=0.08), nothing)) == 1
    assert len(memory.update(0.3, Pose2(y_m=0.15), nothing)) == 0


def test_one_passing_ray_clears() -> None:
    assert len(memory_of_the_post().update(0.1, Pose2(), ring(2.0))) == 0


def test_a_scan_is_judged_by_the_pose_at_which_it_was_taken() -> None:
    """The robot turns: the newest pose sees the post again, the scan was taken with the back to it."""
    memory = memory_of_the_post()
    away = Pose2(theta_rad=math.pi)
    assert len(memory.update(0.1, Pose2(), away.apply(ring(2.0)), away)) == 1
    assert len(memory.update(0.2, Pose2(), away.apply(ring(2.0)))) == 1  # silence where the post is
    assert len(memory.update(0.3, away, ring(2.0), Pose2())) == 0


def test_the_median_is_that_of_numpy() -> None:
    for n in (2, 3, 180, 181):
        gaps = np.random.default_rng(n).random(n)
        assert ray_evidence_module._median(gaps) == np.median(gaps)
