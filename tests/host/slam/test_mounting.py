"""Recorded drives with the lidar or the odometry turned into something else, and as they are."""

import math
import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.offline.map_log import LogReading, map_log
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import LogRecord, RobotLog, corrected
from thumper.slam.factory import MappingOptions
from thumper.slam.mounting import MountCheck, MountFinding, describe

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[4] / "shared" / "data")) / "slam"
LOGS = ("mines-exp1.dat.gz", "mines-exp2.dat.gz", "intel-lab.clf.gz")

pytestmark = pytest.mark.skipif(
    not all((DATA / name).exists() for name in LOGS),
    reason=f"no recorded logs in {DATA}; set THUMPER_DATA to their folder",
)


@cache
def recorded(name: str) -> RobotLog:
    return open_log(DATA / name)


def as_is(record: LogRecord) -> LogRecord:
    return record


def upside_down(record: LogRecord) -> LogRecord:
    return replace(record, scan=record.scan.upside_down())


def turned(record: LogRecord) -> LogRecord:
    scan = record.scan
    return replace(record, scan=replace(scan, angle_min_rad=scan.angle_min_rad + math.pi))


def mirrored(record: LogRecord) -> LogRecord:
    pose = record.odom_from_base
    return replace(record, odom_from_base=Pose2(x_m=pose.x_m, y_m=-pose.y_m, theta_rad=-pose.theta_rad))


def clockwise(record: LogRecord) -> LogRecord:
    pose = record.odom_from_base
    return replace(record, odom_from_base=replace(pose, theta_rad=-pose.theta_rad))


def in_degrees(record: LogRecord) -> LogRecord:
    pose = record.odom_from_base
    return replace(record, odom_from_base=replace(pose, theta_rad=math.degrees(pose.theta_rad)))


def in_millimetres(record: LogRecord) -> LogRecord:
    pose = record.odom_from_base
    return replace(record, odom_from_base=replace(pose, x_m=1e3 * pose.x_m, y_m=1e3 * pose.y_m))


CASES: dict[str, tuple[Callable[[LogRecord], LogRecord], MountFinding | None]] = {
    "as it is": (as_is, None),
    "upside down": (upside_down, MountFinding.UPSIDE_DOWN),
    "turned": (turned, MountFinding.TURNED),
    "both": (lambda record: turned(upside_down(record)), MountFinding.UPSIDE_DOWN_TURNED),
    "mirrored": (mirrored, MountFinding.UPSIDE_DOWN),  # the mirror image of a drive is a drive
    "clockwise": (clockwise, MountFinding.MIRRORED_HEADING),
    "in millimetres": (in_millimetres, MountFinding.MILLIMETRES),
    "in degrees": (in_degrees, MountFinding.DEGREES),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", LOGS)
def test_the_mounting_is_found_out(name: str, case: str) -> None:
    log, (change, expected) = recorded(name), CASES[case]
    check = MountCheck(log.base_from_laser)
    changed = [change(record) for record in log.records[:700]]
    assert check.run((record.odom_from_base, record.scan) for record in changed) is expected
    assert check.done
    if expected is not None:
        fixed = corrected(replace(log, records=tuple(changed)), expected)
        again = MountCheck(fixed.base_from_laser)
        assert again.run((record.odom_from_base, record.scan) for record in fixed.records) is None
        assert again.done


@pytest.mark.parametrize("start", range(0, 7000, 700))
def test_no_part_of_a_long_drive_gives_a_false_alarm(start: int) -> None:
    log = recorded("intel-lab.clf.gz")
    part = log.records[start : start + 700]
    assert MountCheck(log.base_from_laser).run((r.odom_from_base, r.scan) for r in part) is None


def test_the_text_has_the_lines_for_the_robots_file() -> None:
    assert "lidar.upside_down = true" in describe(MountFinding.UPSIDE_DOWN, Pose2())
    assert "lidar.yaw_deg = -90" in describe(MountFinding.TURNED, Pose2(theta_rad=math.radians(90.0)))


def test_map_log_refuses_a_mirrored_log_until_told_how_to_read_it(tmp_path: Path) -> None:
    """A CARMEN log whose heading grows clockwise; corrected, it gives the map of the original."""
    records = recorded("intel-lab.clf.gz").records[1000:1600]
    path = tmp_path / "clockwise.log"
    with path.open("w") as stream:
        for record in records:
            ranges = " ".join(f"{r:.2f}" for r in record.scan.ranges_m)
            pose = record.odom_from_base
            row = f"{pose.x_m:.3f} {pose.y_m:.3f} {-pose.theta_rad:.5f}"
            stream.write(f"FLASER 180 {ranges} {row} {row} {record.time_s} host {record.time_s}\n")
    options = MappingOptions(method="scan_match")
    with pytest.raises(ThumperError, match=r"heading is mirrored.*--mount mirrored-heading"):
        map_log(path, tmp_path / "refused", options=options)
    assert not (tmp_path / "refused" / "map.pgm").exists()
    reading = LogReading(mounting=MountFinding.MIRRORED_HEADING)
    summary = map_log(path, tmp_path / "mapped", options=options, reading=reading)
    assert summary.mean_score > 0.9
    assert not any("disagreed" in note for note in summary.notes)
