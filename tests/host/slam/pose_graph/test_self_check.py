"""A map that shows a place twice is reported."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.slam.pose_graph import submaps as submap_graph
from thumper.slam.pose_graph.self_check import find_contradiction
from thumper.slam.pose_graph.submaps import SubmapGraph


def there_and_back(
    drift_m: float, turn_rad: float = 0.0, length_m: float = 50.0, rounds: int = 1
) -> SubmapGraph:
    """Return the submaps of a corridor; the way back is drawn beside the way there, or across it."""
    along_m = np.arange(-5.0, length_m + 5.0, 0.05)
    walls_m = np.concatenate([np.column_stack((along_m, 0.0 * along_m + y_m)) for y_m in (-1.5, 1.5)])
    submaps, drawn = SubmapGraph(), Pose2()
    for x_m in (*np.arange(0.0, length_m, 0.25), *np.arange(length_m, 0.0, -0.25)) * rounds:
        if submaps.driven_m > length_m - 1.0:
            drawn = Pose2(y_m=drift_m) @ Pose2(theta_rad=turn_rad)
        ends_m = walls_m[np.abs(walls_m[:, 0] - x_m) < 4.0] - (x_m, 0.0)
        points = ScanPoints(
            origins_m=np.zeros_like(ends_m), ends_m=ends_m, kinds=np.full(len(ends_m), HIT, np.uint8)
        )
        submaps.add(drawn @ Pose2(x_m=float(x_m)), points)
    return submaps


def test_map_that_agrees_with_itself_is_not_reported() -> None:
    assert find_contradiction(there_and_back(0.0)) is None
    assert find_contradiction(there_and_back(0.1)) is None  # within the matcher's basin


def test_visits_whose_scans_were_dropped_are_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(submap_graph, "MAX_KEPT_SCANS", 300)
    assert find_contradiction(there_and_back(0.0, rounds=3)) is None


@pytest.mark.parametrize(("drift_m", "turn_rad"), [(1.2, 0.0), (2.5, 0.0), (0.0, 0.17)])
def test_corridor_that_is_drawn_twice_is_reported(drift_m: float, turn_rad: float) -> None:
    found = find_contradiction(there_and_back(drift_m, turn_rad))
    assert found
    assert found.length_m >= 10.0
    assert "contradicts itself" in found.text
    assert found.x_m < 25.0  # where the earlier visit is long ago
