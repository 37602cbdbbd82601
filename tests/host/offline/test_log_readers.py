"""Log readers: formats, quirks of real logs, and broken files."""

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from tests.host.recording.test_ros import foreign
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.offline.map_log import map_log, map_records
from thumper.offline.open_log import open_log
from thumper.slam.factory import MappingOptions

FLASER = "FLASER 4 1.00 81.83 2.50 0.0 1.1 2.0 0.5 1.0 2.0 0.5 976052890.5 nohost {stamp}"
ROBOTLASER = (
    "ROBOTLASER1 0 -0.5 1.0 0.5 50.0 0.01 0 3 1.5 50.0 2.5 0 "
    "0.3 0.0 0.0 0.1 0.0 0.0 0.0 0.0 0.2 0.2 1000000.0 7.25 nohost 7.5"
)


def mines_line(time_us: int, left: int, right: int, ranges_mm: list[int]) -> str:
    robot_state = "0 0 0 170.1 " + "1 " * 16
    return f"{time_us} 14710 {left} {right} {robot_state} {' '.join(map(str, ranges_mm))} 0"


def write(path: Path, text: str) -> Path:
    path.write_bytes(gzip.compress(text.encode(), mtime=0) if path.suffix == ".gz" else text.encode())
    return path


@pytest.mark.parametrize("name", ["a.clf", "a.log.gz"])
def test_flaser(tmp_path: Path, name: str) -> None:
    text = "# comment\nPARAM x 1\n" + "".join(FLASER.format(stamp=s) + "\n" for s in (1.0, 2.0))
    log = open_log(write(tmp_path / name, text))
    assert (log.format_name, len(log.records)) == ("CARMEN", 2)
    record = log.records[0]
    assert record.time_s == 976052890.5
    assert (record.odom_from_base.x_m, record.odom_from_base.theta_rad) == (1.0, 0.5)
    # The laser is 0.1 m along odom x from the robot, whose heading is 0.5 rad.
    assert log.base_from_laser.x_m == pytest.approx(0.1 * math.cos(0.5))
    assert log.base_from_laser.y_m == pytest.approx(-0.1 * math.sin(0.5))
    # "No return" (81.83) and zero are invalid; +inf would mark free space.
    np.testing.assert_array_equal(record.scan.ranges_m, [1.0, np.nan, 2.5, np.nan])
    assert record.scan.angles_rad() == pytest.approx([-math.pi / 2, -math.pi / 4, 0.0, math.pi / 4])


def test_robotlaser(tmp_path: Path) -> None:
    record = open_log(write(tmp_path / "a.log", ROBOTLASER + "\n")).records[0]
    assert record.time_s == 7.25
    assert record.odom_from_base.x_m == 0.1
    np.testing.assert_array_equal(record.scan.ranges_m, [1.5, np.nan, 2.5])
    assert record.scan.angles_rad() == pytest.approx([-0.5, 0.0, 0.5])


def test_mines(tmp_path: Path) -> None:
    ranges_mm = [0, 1, 15, 19, 20, 5562] + [1000] * 676
    text = mines_line(212_000_000, 29_221, 25_178, ranges_mm) + "\n"
    text += mines_line(212_100_000, 29_321, 25_278, ranges_mm) + "\n"
    log = open_log(write(tmp_path / "a.dat.gz", text))
    first, second = log.records
    assert log.base_from_laser.x_m == 0.145
    assert first.odom_from_base.x_m == 0.0  # neither the counts nor the clock start at 0
    distance_m = 100 * 0.077 * math.tau / 2000
    assert second.twist.v_m_s == pytest.approx(10.0 * distance_m)
    assert second.odom_from_base.x_m == pytest.approx(
        distance_m - 0.0986 * 10.0 * distance_m
    )  # at the time of beam 0
    np.testing.assert_array_equal(first.scan.ranges_m[:6], [np.nan, np.nan, np.nan, np.nan, 0.02, 5.562])
    assert first.scan.ranges_m.size == 682  # the trailing 0 is not a beam
    assert first.scan.angles_rad()[[0, -1]] == pytest.approx(
        [-119.707, 119.707] * np.array(math.pi / 180), abs=1e-4
    )


@pytest.mark.parametrize(
    ("name", "data", "word"),
    [
        ("a.log", FLASER.format(stamp=1.0)[:40].encode(), "line 1"),
        ("a.log", FLASER.format(stamp=1.0).replace("2.50", "2.x5").encode(), "2.x5"),
        ("a.log", (ROBOTLASER[:60]).encode(), "ROBOTLASER1"),
        ("a.dat", mines_line(1, 2, 3, [0] * 682)[:-300].encode(), "682|706"),
        ("a.txt", b"hello\nworld\n", "unknown log format"),
        ("a.txt", b"", "the file is empty"),
        ("a.txt", b"1 2 3 4\n5 6 7 8\n", "has 4 numbers, and a MINES log has 706 per line"),
        ("a.dat", (500 * b"7 " + b"\n") * 3, "500 numbers a line, but a MINES log has 706"),
        ("a.bag", b"#ROSBAG V2.0\n\0\0", "a ROS 1 bag: convert"),
        ("a.db3", b"SQLite format 3\0\0", "a ROS 2 bag in SQLite"),
        ("a.pgm", b"P5\n3 3\n255\n\0\0", "a map .*not a drive"),
        ("a.bin", bytes(range(256)), "not a text log"),
        ("a.gz", gzip.compress(b"FLASER" * 1000, mtime=0)[:40], "cut off"),
        ("a.gz", b"\x1f\x8b\x08\0garbage-garbage", "cut off or damaged"),
    ],
)
def test_a_broken_file_gives_a_one_line_error(tmp_path: Path, name: str, data: bytes, word: str) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(ThumperError, match=word) as error:
        open_log(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match="cannot be read"):
        open_log(tmp_path / "gone.log")


def flaser_line(
    ranges_m: list[float], odom: tuple[float, float, float], laser: str = "", stamp: float = 1.0
) -> str:
    pose = "{:.3f} {:.3f} {:.4f}".format(*odom)
    ranges = " ".join(f"{r:.2f}" for r in ranges_m)
    return f"FLASER {len(ranges_m)} {ranges} {laser or pose} {pose} {stamp:.6f} host {stamp:.6f}\n"


@pytest.mark.parametrize(
    ("beams", "first_deg", "step_deg"),
    [
        (180, -90, 1.0),
        (181, -90, 1.0),
        (360, -90, 0.5),
        (361, -90, 0.5),
        (541, -135, 0.5),
        (1081, -135, 0.25),
    ],
)
def test_the_field_of_view_follows_from_the_number_of_beams(
    tmp_path: Path, beams: int, first_deg: float, step_deg: float
) -> None:
    log = open_log(write(tmp_path / "a.log", flaser_line([2.0] * beams, (0, 0, 0))))
    scan = log.records[0].scan
    assert np.degrees([scan.angle_min_rad, scan.angle_increment_rad]) == pytest.approx([first_deg, step_deg])


@pytest.mark.parametrize(("limit_m", "usable_m"), [(4.09, 4.0), (8.19, 8.0), (29.99, 29.0), (81.83, 70.0)])
def test_the_code_for_no_return_is_detected(tmp_path: Path, limit_m: float, usable_m: float) -> None:
    """A spike at the largest reading is the sensor's code, for any range."""
    rng = np.random.default_rng(1)
    lines = [
        flaser_line([limit_m] * 40 + list(rng.uniform(0.5, usable_m, 140)), (0.1 * k, 0, 0))
        for k in range(20)
    ]
    for record in open_log(write(tmp_path / "a.log", "".join(lines))).records:
        assert np.isnan(record.scan.ranges_m[:40]).all()
        assert np.isfinite(record.scan.ranges_m[40:]).all()


def test_broken_lines_and_rear_lasers_are_noted(tmp_path: Path) -> None:
    good = [flaser_line([2.0] * 180, (0.1 * k, 0, 0)) for k in range(30)]
    rear = good[0].replace("FLASER", "RLASER")
    text = (
        "# handmade\nPARAM robot_frontlaser_offset 0.3\nSYNC x\n" + rear + "".join(good) + good[0][:50] + "\n"
    )
    log = open_log(write(tmp_path / "a.log", text))
    assert len(log.records) == 30
    assert any("1 broken lines" in note for note in log.notes)
    assert any("1 RLASER" in note for note in log.notes)


def test_a_rear_laser_points_backwards(tmp_path: Path) -> None:
    line = flaser_line([2.0] * 181, (1.0, 0.0, 0.0), laser="0.800 0.000 3.1416")
    log = open_log(write(tmp_path / "a.log", line.replace("FLASER", "RLASER")))
    assert log.base_from_laser.x_m == pytest.approx(-0.2)
    assert abs(log.base_from_laser.theta_rad) == pytest.approx(math.pi, abs=1e-4)


def test_corrected_laser_poses_are_not_the_mounting(tmp_path: Path) -> None:
    lines = "".join(
        flaser_line([2.0] * 180, (0.1 * k, 0, 0), laser=f"{0.1 * k:.3f} {0.02 * k:.3f} 0.0")
        for k in range(30)
    )
    log = open_log(write(tmp_path / "a.log", "PARAM robot_frontlaser_offset 0.25\n" + lines))
    assert log.base_from_laser.x_m == 0.25
    assert any("mounting" in note for note in log.notes)


def test_odometry_comes_from_odom_lines_if_laser_lines_have_none(tmp_path: Path) -> None:
    text = "".join(
        f"ODOM {0.1 * k:.2f} 0 0 0.1 0 0 {k} host {k}\n" + flaser_line([2.0] * 180, (0, 0, 0))
        for k in range(5)
    )
    log = open_log(write(tmp_path / "a.log", text))
    assert [record.odom_from_base.x_m for record in log.records] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def beams_line(n: int) -> str:
    return f"FLASER {n} " + "2.0 " * n + "0 0 0 0 0 0 1.0 nohost 1.0\n"


@pytest.mark.parametrize(
    ("n", "params", "given_deg", "first_deg", "step_deg", "noted"),
    [
        (181, "", None, -90.0, 1.0, False),
        (361, "", None, -90.0, 0.5, False),
        (360, "", None, -90.0, 0.5, True),  # as in Freiburg's building 079; 360 degrees are as likely
        (360, "PARAM laser_front_laser_fov 360.0\n", None, -180.0, 1.0, False),
        (360, "PARAM laser_front_laser_fov 360.0\n", 180.0, -90.0, 0.5, False),
        (361, "PARAM laser_front_laser_fov 3.14159\n", None, -90.0, 0.5, False),  # MIT's CSAIL: radians
        (360, "PARAM laser_front_laser_resolution 0.5\n", None, -90.0, 0.5, False),
        (360, "PARAM laser_front_laser_resolution 1.0\n", None, -180.0, 1.0, False),
        (720, "", 360.0, -180.0, 0.5, False),
        (541, "", None, -135.0, 0.5, False),
    ],
)
def test_the_field_of_view_is_read_given_or_noted_as_a_guess(
    tmp_path: Path,
    n: int,
    params: str,
    given_deg: float | None,
    first_deg: float,
    step_deg: float,
    noted: bool,
) -> None:
    path = write(tmp_path / "a.log", params + beams_line(n))
    log = open_log(path, math.radians(given_deg) if given_deg else None)
    scan = log.records[0].scan
    assert math.degrees(scan.angle_min_rad) == pytest.approx(first_deg, abs=1e-3)
    assert math.degrees(scan.angle_increment_rad) == pytest.approx(step_deg, abs=1e-5)
    assert any("--fov" in note for note in log.notes) == noted


def test_a_log_without_a_usable_beam_is_refused(tmp_path: Path) -> None:
    line = "FLASER 3 nan nan 0 0 0 0 {x} 0 0 1.0 nohost 1.0\n"
    path = write(tmp_path / "blind.log", "".join(line.format(x=x) for x in range(5)))
    with pytest.raises(ThumperError, match="nothing to map"):
        map_log(path, tmp_path / "out", options=MappingOptions())
    assert not list((tmp_path / "out").iterdir())


RAWLASER = (
    "RAWLASER1 0 -0.5 1.0 0.5 50.0 0.01 0 3 1.5 50.0 2.5 2 7 8 {stamp} nohost {stamp}\n"
    "SYNC {stamp}\nODOM {x} 0 0 0.1 0 0 {later} nohost {later}\n"
)


def test_raw_lines_interpolate_the_odom_lines(tmp_path: Path) -> None:
    text = "PARAM robot_frontlaser_offset 0.2\nODOM 0 0 0 0.1 0 0 0.0 nohost 0.0\n"
    text += "".join(RAWLASER.format(stamp=k + 0.25, later=k + 1.0, x=k + 1.0) for k in range(3))
    log = open_log(write(tmp_path / "raw.log", text))
    assert log.base_from_laser == Pose2(x_m=0.2)
    assert [record.time_s for record in log.records] == [0.25, 1.25, 2.25]
    assert [record.odom_from_base.x_m for record in log.records] == pytest.approx([0.25, 1.25, 2.25])
    np.testing.assert_array_equal(log.records[0].scan.ranges_m, [1.5, np.nan, 2.5])
    assert log.records[0].scan.angles_rad() == pytest.approx([-0.5, 0.0, 0.5])


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b"# recorded by H\xe4hnel\n", b"# by H\xc3\xa4hnel\n"])
def test_other_line_ends_byte_order_marks_and_encodings(tmp_path: Path, mark: bytes) -> None:
    text = (FLASER.format(stamp=1.0) + "\n" + FLASER.format(stamp=2.0) + "\n").replace("\n", "\r\n")
    (tmp_path / "a.log").write_bytes(mark + text.encode())
    log = open_log(tmp_path / "a.log")
    assert (len(log.records), log.records[0].time_s) == (2, 976052890.5)


def test_a_truncated_compressed_log_is_used_up_to_its_end(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    lines = [flaser_line(list(rng.uniform(1.0, 8.0, 180)), (0.1 * k, 0, 0)) for k in range(200)]
    packed = gzip.compress("".join(lines).encode(), mtime=0)
    (tmp_path / "cut.clf.gz").write_bytes(packed[: len(packed) // 2])
    log = open_log(tmp_path / "cut.clf.gz")
    assert 60 < len(log.records) < 140
    assert any("cut off" in note for note in log.notes)


def test_a_broken_mines_line_is_dropped_and_noted(tmp_path: Path) -> None:
    lines = [mines_line(100_000 * k, 10 * k, 10 * k, [1000] * 682) + "\n" for k in range(20)]
    lines[7] = lines[7].replace("1000", "10x0", 1)
    log = open_log(write(tmp_path / "a.dat", "".join(lines)))
    assert len(log.records) == 19
    assert log.notes[0].startswith("1 broken lines dropped, the first: line 8")


def test_a_log_without_odometry_is_mapped_by_its_scans(tmp_path: Path) -> None:
    """A drive through a square room at 1 m/s, without wheel counts."""
    angles = np.radians(np.arange(-90.0, 90.0))
    lines = []
    for k in range(60):
        x_m = (
            1.0 + 0.002 * min(k, 30) ** 2 + 0.05 * max(k - 30, 0)
        )  # accelerates, then moves at constant speed
        cos, sin = np.cos(angles), np.sin(angles)
        with np.errstate(divide="ignore"):
            ranges = np.minimum((8.0 - x_m) / np.maximum(cos, 1e-9), 2.0 / np.abs(sin))
        lines.append(flaser_line(list(ranges), (0, 0, 0), stamp=0.1 * k))
    log = open_log(write(tmp_path / "a.log", "".join(lines)))
    assert not log.has_odometry
    assert any("no odometry" in note for note in log.notes)
    mapped = map_records(log, MappingOptions())
    true_m = 0.002 * 900 + 0.05 * 29
    assert mapped.poses[-1, 0] == pytest.approx(true_m, abs=0.03)
    assert np.abs(mapped.poses[:, 1]).max() < 0.05  # a cell


def test_a_jump_of_the_odometry_is_bridged_and_noted(tmp_path: Path) -> None:
    """Its program restarted at scan 30, with the pose back at the origin."""
    ranges_m = list(np.random.default_rng(1).uniform(2.0, 3.0, 180))
    lines = [flaser_line(ranges_m, (40.0 * (k < 30) + 0.001 * k, 0, 0), stamp=0.1 * k) for k in range(60)]
    mapped = map_records(open_log(write(tmp_path / "a.log", "".join(lines))), MappingOptions())
    assert mapped.lines == (
        "the odometry jumped once, by up to 40.0 m: read as no motion; did the board or its program restart?",
    )
    assert np.abs(mapped.poses[:, :2] - mapped.poses[0, :2]).max() < 0.1


@pytest.mark.parametrize("wild", [0, 1, 30])
def test_an_impossible_odometry_pose_is_a_broken_line(tmp_path: Path, wild: int) -> None:
    ranges_m = list(np.random.default_rng(1).uniform(2.0, 3.0, 180))
    x_m = [1e300 if k == wild else 5.0 + 0.001 * k for k in range(60)]
    lines = [flaser_line(ranges_m, (x, 0, 0), stamp=0.1 * k) for k, x in enumerate(x_m)]
    log = open_log(write(tmp_path / "a.log", "".join(lines)))
    assert log.notes == (
        f"1 broken lines dropped, the first: line {wild + 1}: broken FLASER (a pose 1e+300 m away)",
    )
    mapped = map_records(log, MappingOptions())
    assert mapped.lines == ()
    assert np.abs(mapped.poses[:, :2] - mapped.poses[0, :2]).max() < 0.1


def test_a_lost_pose_is_reported_with_its_scan(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    here, there = list(rng.uniform(2.0, 3.0, 180)), list(rng.uniform(5.0, 6.0, 180))
    lines = [flaser_line(here if k < 30 else there, (0.001 * k, 0, 0), stamp=0.1 * k) for k in range(60)]
    summary = map_records(open_log(write(tmp_path / "a.log", "".join(lines))), MappingOptions()).lines
    assert len(summary) == 1
    assert summary[0].startswith("the pose was lost at 28 of 60 scans, first at scan 33: ")


@pytest.mark.parametrize("what", ["ROBOTLASER1", "MINES", "MCAP"])
def test_a_field_of_view_for_a_log_that_contains_it_is_refused(tmp_path: Path, what: str) -> None:
    path = tmp_path / "a.log"
    if what == "MCAP":
        foreign(path, odometry=True)
    else:
        line = ROBOTLASER if what == "ROBOTLASER1" else mines_line(0, 0, 0, [1000] * 682)
        write(path, line + "\n")
    with pytest.raises(ThumperError, match=f"an? {what}.* leave out --fov"):
        open_log(path, math.radians(240))


def test_a_directory_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match="is a directory; pass a log file"):
        open_log(tmp_path)


@pytest.mark.parametrize(("keep", "word"), [(1.0, ""), (0.9, "cut off")])
def test_a_compressed_recording_is_read(tmp_path: Path, keep: float, word: str) -> None:
    foreign(tmp_path / "plain.mcap", odometry=True)
    packed = gzip.compress((tmp_path / "plain.mcap").read_bytes(), mtime=0)
    path = tmp_path / "packed.mcap.gz"
    path.write_bytes(packed[: round(keep * len(packed))])
    log = open_log(path)
    assert (log.format_name, len(log.records)) == ("MCAP", 40)
    assert any(word in note for note in log.notes) == bool(word)
    assert not any(str(tmp_path) in note for note in log.notes)


def test_an_error_names_the_compressed_recording(tmp_path: Path) -> None:
    foreign(tmp_path / "plain.mcap", odometry=True, scans=False)
    path = tmp_path / "packed.mcap.gz"
    path.write_bytes(gzip.compress((tmp_path / "plain.mcap").read_bytes(), mtime=0))
    with pytest.raises(ThumperError, match="no LaserScan") as error:
        open_log(path)
    assert str(error.value).startswith(str(path))
