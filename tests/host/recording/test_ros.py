"""Other robots' programs and ours: ROS's own tools read what we record, we map what others recorded."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.recorded_run import RUN, cycles
from mcap_ros2.writer import Writer

from thumper.common.errors import ThumperError
from thumper.offline.open_log import open_log
from thumper.recording.recorder import Recorder
from thumper.ros.codec import definition

ROSBAG = shutil.which("rosbag")  # ROS 1's own, which Debian packages: independent of all our libraries
CANONICAL = {
    "sensor_msgs/LaserScan": "90c7ef2dc6895d81024acba2ac42f369",
    "nav_msgs/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
    "nav_msgs/OccupancyGrid": "3381f2d731d4076ec5c71b0759edbe4e",
    "nav_msgs/Path": "6227e2b7e9cce15051f669a5e197bbf7",
    "tf2_msgs/TFMessage": "94810edda583a504dfda3829e70d7eec",
    "geometry_msgs/TwistStamped": "98d34b0043a2093cf9d9345ab6eef12e",
}
READ_SCANS = """
import sys, rosbag
bag = rosbag.Bag(sys.argv[1])
for topic, message, stamp in bag.read_messages(["/scan"]):
    print(message.header.stamp.to_nsec(), message.ranges[100], len(message.ranges))
for topic, message, stamp in bag.read_messages(["/wheels"]):
    print(message.left_count, end=" ")
"""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording as a ROS 1 bag."""
    folder = tmp_path_factory.mktemp("bag")
    recorder = Recorder(folder, RUN)
    for topic, now_s, message in cycles(20):
        recorder(topic, now_s, message)
    recorder.close()
    convert = Path(sys.executable).with_name("rosbags-convert")
    command: list[str | Path] = [convert, "--src", recorder.files[0], "--dst", folder / "run.bag"]
    subprocess.run(
        [*command, "--src-typestore", "empty", "--dst-typestore", "ros1_noetic"], check=True, timeout=60
    )
    return folder / "run.bag"


@pytest.mark.skipif(ROSBAG is None, reason="ROS 1's rosbag is not installed (apt install python3-rosbag)")
def test_ros_itself_knows_every_topic_and_type(bag: Path) -> None:
    assert ROSBAG is not None
    output = subprocess.run(
        [ROSBAG, "info", str(bag)], capture_output=True, text=True, check=True, timeout=60
    ).stdout
    types = dict(
        line.split()[-2:] for line in output.splitlines() if line.rstrip().endswith("]") and "/" in line
    )
    for name, digest in CANONICAL.items():
        assert types[name] == f"[{digest}]"
    assert "/wheels" in output
    assert "thumper_msgs/Status" in output


@pytest.mark.skipif(ROSBAG is None, reason="ROS 1's rosbag is not installed (apt install python3-rosbag)")
def test_ros_itself_reads_the_values(bag: Path) -> None:
    command = ["/usr/bin/python3", "-c", READ_SCANS, str(bag)]
    lines = subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=60
    ).stdout.splitlines()
    sent = [message for topic, _, message in cycles(20) if topic == "scan"]
    assert len(lines) == len(sent) + 1
    for line, message in zip(lines, sent, strict=False):
        stamp, range_m, beams = line.split()
        assert int(stamp) == message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        assert float(range_m) == pytest.approx(float(message.ranges[100]), rel=1e-6)
        assert beams == "682"
    assert [int(count) for count in lines[-1].split()] == list(range(0, 200, 10))


def foreign(
    path: Path,
    *,
    odometry: bool,
    scans: bool = True,
    driven: range = range(40),
    set_back_at: int = 40,
    astray_at: int = 40,
) -> None:
    """A recording as another ROS 2 robot would make it: its names, its order, its ideas of "nothing seen".

    It says where it is at the steps `driven`, at `astray_at` beyond any place; at the step `set_back_at` its
    clock is set back by an hour.
    """
    with path.open("wb") as stream:
        writer = Writer(stream)
        schemas = {
            kind: writer.register_msgdef(kind, definition(kind))
            for kind in ("sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage")
        }

        def say(topic: str, kind: str, time_ns: int, message: dict[str, Any]) -> None:
            writer.write_message(topic, schemas[kind], message, log_time=time_ns, publish_time=time_ns)

        def header(time_ns: int, frame: str) -> dict[str, Any]:
            if time_ns >= start + 100_000_000 * set_back_at:
                time_ns -= 3600 * 1_000_000_000
            stamp = {"sec": time_ns // 1_000_000_000, "nanosec": time_ns % 1_000_000_000}
            return {"stamp": stamp, "frame_id": frame}

        def transform(time_ns: int, parent: str, child: str, x: float, yaw: float = 0.0) -> dict[str, Any]:
            rotation = {"x": 0.0, "y": 0.0, "z": float(np.sin(yaw / 2)), "w": float(np.cos(yaw / 2))}
            pose = {"translation": {"x": x, "y": 0.0, "z": 0.2}, "rotation": rotation}
            return {"header": header(time_ns, parent), "child_frame_id": child, "transform": pose}

        start = 1_700_000_000_000_000_000
        fixed = [
            transform(start, "base_footprint", "mast", 0.25),
            transform(start, "mast", "front_laser", 0.05, 0.5),
        ]
        say("/tf_static", "tf2_msgs/msg/TFMessage", start, {"transforms": fixed})
        message: dict[str, Any]
        for k in range(40):
            now, x_m = start + 100_000_000 * k, 1e300 if k == astray_at else 0.1 * k
            if k not in driven:
                pass
            elif odometry:
                at: dict[str, Any] = {
                    "position": {"x": x_m, "y": 0.0, "z": 0.0},
                    "orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
                }
                still = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
                message = {
                    "header": header(now, "odom"),
                    "child_frame_id": "base_footprint",
                    "pose": {"pose": at, "covariance": [0.0] * 36},
                    "twist": {"twist": still, "covariance": [0.0] * 36},
                }
                say("/robot/odom", "nav_msgs/msg/Odometry", now, message)
            else:
                moving = [transform(now, "odom", "base_footprint", x_m)]
                say("/tf", "tf2_msgs/msg/TFMessage", now, {"transforms": moving})
            if scans:
                message = {
                    "header": header(now + 50_000_000, "front_laser"),
                    "angle_min": -1.0,
                    "angle_max": 1.0,
                    "angle_increment": 0.5,
                    "time_increment": 0.001,
                    "scan_time": 0.1,
                    "range_min": 0.1,
                    "range_max": 8.0,
                    "ranges": [0.0, 2.0, float("inf"), 8.5, 3.0],
                    "intensities": [],
                }
                say("/robot/scan", "sensor_msgs/msg/LaserScan", now + 60_000_000, message)
        writer.finish()


@pytest.mark.parametrize("odometry", [True, False], ids=["Odometry", "transforms alone"])
def test_a_foreign_recording_is_a_log_like_any_other(tmp_path: Path, odometry: bool) -> None:
    path = tmp_path / "theirs.mcap"
    foreign(path, odometry=odometry)
    log = open_log(path)
    assert log.notes == ()
    assert log.base_from_laser.x_m == pytest.approx(0.3)
    assert log.base_from_laser.theta_rad == pytest.approx(0.5)
    assert len(log.records) == 40
    record = log.records[10]
    assert record.time_s == pytest.approx(1.0)
    assert record.odom_from_base.x_m == pytest.approx(1.05)  # half-way between two readings
    assert record.twist.v_m_s == pytest.approx(1.0)
    np.testing.assert_array_equal(record.scan.ranges_m, [np.nan, 2.0, np.inf, np.nan, 3.0])


@pytest.mark.parametrize("odometry", [True, False], ids=["Odometry", "transforms alone"])
def test_a_reading_of_no_place_is_left_out_and_noted(tmp_path: Path, odometry: bool) -> None:
    foreign(tmp_path / "theirs.mcap", odometry=odometry, astray_at=10)
    log = open_log(tmp_path / "theirs.mcap")
    assert log.notes == ("1 broken messages dropped",)
    assert [record.odom_from_base.x_m for record in log.records[:20]] == pytest.approx(
        [0.1 * k + 0.05 for k in range(20)]
    )


def test_a_clock_that_was_set_back_does_not_mix_two_hours(tmp_path: Path) -> None:
    foreign(tmp_path / "theirs.mcap", odometry=True, set_back_at=20)
    log = open_log(tmp_path / "theirs.mcap")
    assert any("clock was set" in note for note in log.notes)
    way_m = [record.odom_from_base.x_m for record in log.records]
    assert way_m == pytest.approx([0.1 * k + 0.06 for k in range(39)] + [3.9])  # by the times of recording


def test_scans_without_odometry_are_kept_and_counted(tmp_path: Path) -> None:
    foreign(tmp_path / "theirs.mcap", odometry=True, driven=range(25))
    log = open_log(tmp_path / "theirs.mcap")
    assert len(log.records) == 40
    assert log.notes == (
        "13 of 40 scans without odometry for their time: the nearest one is used",
    )  # the others are within 0.25 s
    foreign(tmp_path / "theirs.mcap", odometry=True, driven=range(0))
    log = open_log(tmp_path / "theirs.mcap")
    assert (len(log.records), log.has_odometry) == (40, False)
    assert any("no odometry" in note for note in log.notes)


def test_a_recording_without_scans_is_told(tmp_path: Path) -> None:
    foreign(tmp_path / "theirs.mcap", odometry=True, scans=False)
    with pytest.raises(ThumperError, match="no LaserScan"):
        open_log(tmp_path / "theirs.mcap")
