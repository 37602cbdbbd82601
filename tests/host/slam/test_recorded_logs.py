"""Recorded drives end to end. Thresholds are two-sided: a result too good means a faulty metric."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thumper.common.geometry import FloatArray
from thumper.maps.map_server_io import load_map
from thumper.maps.occupancy_grid import OCCUPIED
from thumper.offline.map_log import map_log, map_records
from thumper.offline.metrics import load_relations, relation_errors, squareness
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog
from thumper.slam.factory import MappingOptions

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[4] / "shared" / "data")) / "slam"
MINES, INTEL = DATA / "mines-exp1.dat.gz", DATA / "intel-lab.clf.gz"
RELATIONS = DATA / "intel-lab.relations-by-scan.gz"

pytestmark = pytest.mark.skipif(
    not (MINES.exists() and INTEL.exists()),
    reason=f"no recorded logs in {DATA}; set THUMPER_DATA to their folder",
)


def odometry_of(log: RobotLog) -> FloatArray:
    return np.array(
        [(r.odom_from_base.x_m, r.odom_from_base.y_m, r.odom_from_base.theta_rad) for r in log.records]
    )


def test_mines_map_is_square() -> None:
    """75 s of a URG-04LX at up to 1.3 m/s, around two loops."""
    log = open_log(MINES)
    mapped = map_records(log, MappingOptions())
    scores = np.array([update.match_score for update in mapped.updates[1:]])
    assert 0.92 < scores.mean() < 0.985
    assert scores.min() > 0.45
    assert 0.71 < squareness(log, mapped.poses) < 0.80
    assert squareness(log, odometry_of(log)) < 0.66  # so the metric separates them
    assert 40.0 < np.hypot(*np.diff(mapped.poses[:, :2], axis=0).T).sum() < 50.0
    assert 3500 < np.count_nonzero(mapped.grid.cells == OCCUPIED) < 6500  # a blurred map has more


def test_intel_relations_hold_in_the_first_part() -> None:
    """Raw odometry loses whole turns. The reference's own noise is about 1 cm."""
    log = open_log(INTEL)
    part = replace(log, records=log.records[:2500])
    relations = load_relations(RELATIONS)
    relations = relations[(relations[:, 0] < 2500) & (relations[:, 1] < 2500)]
    assert len(relations) > 300
    errors = relation_errors(map_records(part, MappingOptions()).poses, relations)
    assert 0.008 < errors.translation_m.mean() < 0.028
    assert 0.05 < np.degrees(errors.rotation_rad).mean() < 0.40
    assert errors.translation_m.max() < 0.30
    assert relation_errors(odometry_of(part), relations).translation_m.mean() > 0.2


@pytest.mark.parametrize(
    ("name", "every"), [("mines-exp1.dat.gz", 3), ("mines-exp1.dat.gz", 10), ("mines-exp2.dat.gz", 6)]
)
def test_a_drive_with_few_scans_is_not_taken_for_a_kidnapped_robot(name: str, every: int) -> None:
    """With a scan every 0.6 s, a door or a corner shows another room at once."""
    log = open_log(DATA / name)
    mapped = map_records(replace(log, records=log.records[::every]), MappingOptions(method="scan_match"))
    assert mapped.lost == 0


def test_map_log_writes_files_that_agree(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    summary = map_log(MINES, tmp_path / "out", lambda done, total: seen.append((done, total)))
    assert (summary.format_name, summary.scans) == ("MINES", 756)
    assert seen[-1] == (756, 756)
    assert [path.name for path in summary.files] == [
        "map.pgm",
        "map.yaml",
        "map.session",
        "map.png",
        "trajectory.csv",
    ]
    assert all(path.stat().st_size > 1000 for path in summary.files if path.suffix != ".yaml")
    with (tmp_path / "out" / "trajectory.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 756
    assert list(rows[0]) == ["timestamp_s", "x_m", "y_m", "theta_rad"]
    assert float(rows[0]["timestamp_s"]) == pytest.approx(212.387282)
    grid = load_map(tmp_path / "out" / "map.yaml")
    driven = [grid.cells[grid.cell_of(float(row["x_m"]), float(row["y_m"]))] for row in rows]
    assert np.mean(np.array(driven) == 0) > 0.9  # the robot drove where the map is free
