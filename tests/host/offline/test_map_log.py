"""`map_log`: what it writes after a log that ends at an unknown place."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.rooms import ROOM, rectangle, room_scan

from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2
from thumper.offline.map_log import map_log
from thumper.slam.factory import MappingOptions
from thumper.slam.pose_graph.graph_mapper import GraphMapper
from thumper.slam.saved_state import load_session

OTHER = rectangle(-3.0, -0.7, 3.0, 0.9)


def line(pose: Pose2, odometry: Pose2, walls: FloatArray) -> str:
    """Return a FLASER line of 181 beams over 180 degrees."""
    scan = room_scan(pose, walls=walls)
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(scan.ranges_m.size)
    ranges = np.interp(np.radians(np.arange(-90.0, 91.0)), angles, scan.ranges_m)
    at = f"{odometry.x_m} {odometry.y_m} {odometry.theta_rad}"
    return f"FLASER 181 {' '.join(f'{r:.3f}' for r in ranges)} {at} {at} 0 host 0"


@pytest.mark.parametrize("torn", ["", "the map contradicts itself along 30 m of the drive"])
def test_map_that_contradicts_itself_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, torn: str
) -> None:
    monkeypatch.setattr(GraphMapper, "contradiction", lambda _: torn)
    log = tmp_path / "drive.log"
    poses = [Pose2(x_m=0.05 * k - 0.8, theta_rad=0.02 * k) for k in range(20)]
    log.write_text("\n".join(line(pose, pose, ROOM) for pose in poses))
    notes = map_log(log, tmp_path / "out").notes
    assert [note for note in notes if "contradicts" in note] == ([torn] if torn else [])


@pytest.mark.parametrize("carried", some_of([True, False]))
def test_session_of_a_log_that_ends_lost_has_no_pose(tmp_path: Path, carried: bool) -> None:
    poses = [Pose2(x_m=0.05 * k - 0.8, theta_rad=0.02 * k) for k in range(40)]
    lines = [line(pose, pose, ROOM) for pose in poses]
    if carried:
        lines += [line(Pose2(), poses[-1], OTHER)] * 15
    log = tmp_path / "drive.log"
    log.write_text("\n".join(lines))
    summary = map_log(log, tmp_path / "out", options=MappingOptions(method="scan_match"))
    session = load_session(tmp_path / "out" / "map.session", 0.05)
    assert (session.map_from_base is None) == carried
    assert any("lost" in note for note in summary.notes) == carried
