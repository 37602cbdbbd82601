"""A replay gives the same map bit for bit; exports are readable by other programs."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.recorded_run import EPOCH_NS, MESSAGES, RUN, cycles

from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.goal import Goal
from thumper.offline.open_log import open_log
from thumper.recording.export import export_csv, last_map
from thumper.recording.mcap_file import McapFile
from thumper.recording.reader import Recording, find_recordings
from thumper.recording.recorder import Recorder
from thumper.recording.replay import replay
from thumper.recording.start_stop import recording_control
from thumper.ros.codec import encode
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.slam.factory import MappingOptions

START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)
GOAL = Goal(x_m=-0.49, y_m=0.02)
SMALL = OccupancyGrid(
    cells=np.array([[0, 100, -1]], dtype=np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0
)
Live = tuple[Path, RobotConfig, OccupancyGrid, FloatArray]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Live:
    """A simulated mission: recording, configuration, map and logged poses."""
    folder = tmp_path_factory.mktemp("live")
    board = f"sim://recorded/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = RobotConfig(
        name="recorded", board=BoardOptions(port=board), lidar=LidarOptions(port="sim://recorded/lidar")
    )
    reports: list[str] = []
    with (
        open_robot(config, START) as robot,
        recording_control(robot, config, START, folder, reports.append) as control,
    ):
        control.start()
        assert robot.run(drive_to_goal(GOAL)).reached
        recorder = control.close()
        assert recorder is not None
        assert (recorder.failure, recorder.dropped, reports) == ("", 0, [])
        return recorder.files[0], config, robot.mapper.grid(), robot.log.poses


def test_map_equals_the_live_map_bit_for_bit(live: Live) -> None:
    path, config, grid, _ = live
    out = replay(Recording((path,)))
    again = out.mapper.grid()
    np.testing.assert_array_equal(again.cells, grid.cells)
    assert (again.origin_x_m, again.origin_y_m, again.resolution_m) == (
        grid.origin_x_m,
        grid.origin_y_m,
        grid.resolution_m,
    )
    assert out.maps_recorded > 5
    assert out.maps_identical == out.maps_recorded
    assert out.unreadable == 0
    session = Recording((path,)).run_metadata()
    assert session is not None
    assert session.config == config
    assert session.simulated


def test_poses_equal_the_live_poses_bit_for_bit(live: Live) -> None:
    path, _, _, poses = live
    again = {row[0]: tuple(row[1:]) for row in replay(Recording((path,))).path.tolist()}
    assert len(poses) > 50
    for time_s, x_m, y_m, theta_rad in poses.tolist():
        assert again[round(time_s * 1e9) / 1e9] == (x_m, y_m, theta_rad)


def test_other_options_give_another_map(live: Live) -> None:
    other = RobotConfig(mapping=MappingOptions(resolution_m=0.1))
    out = replay(Recording((live[0],)), other)
    assert out.maps_recorded == 0  # nothing to compare with
    assert out.mapper.grid().resolution_m == 0.1


def test_truncated_recording_is_replayed_to_its_end(live: Live, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    content = live[0].read_bytes()
    torn.write_bytes(content[: len(content) // 2])
    recording = Recording((torn,))
    out = replay(recording)
    assert 10 < out.scans < replay(Recording((live[0],))).scans
    assert "ends early" in recording.notes[0]


def test_map_log_reads_a_recording(live: Live) -> None:
    log = open_log(live[0])
    assert log.format_name == "MCAP"
    assert log.base_from_laser.x_m == pytest.approx(0.12)
    assert len(log.records) > 70
    driven_m = log.records[0].odom_from_base.distance_m(log.records[-1].odom_from_base)
    assert driven_m == pytest.approx(2.2, abs=0.15)
    assert log.notes == ()


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recorder = Recorder(tmp_path_factory.mktemp("made_up"), RUN)
    for topic, now_s, message in cycles(30):
        recorder(topic, now_s, message)
    recorder("plan", 9.0, MESSAGES.path(9.0, np.empty((0, 2))))
    recorder.close()
    return recorder.files[0]


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_csv_export(made_up: Path, tmp_path: Path) -> None:
    files = export_csv(Recording((made_up,)), tmp_path)
    assert {path.name for path in files} >= {"wheels.csv", "scan.csv", "pose.csv", "plan.csv", "tf.csv"}
    wheels = rows(tmp_path / "wheels.csv")
    assert len(wheels) == 30
    assert list(wheels[0])[:4] == ["log_time_s", "header.stamp", "header.frame_id", "time_us"]
    assert [int(row["left_count"]) for row in wheels] == list(range(0, 300, 10))
    assert wheels[1]["log_time_s"] == "1750000005.223456789"
    scan = rows(tmp_path / "scan.csv")[4]
    assert scan["ranges.3"] == "inf"
    assert scan["ranges.7"] == "nan"
    assert len([name for name in scan if name.startswith("ranges.")]) == 682
    assert float(rows(tmp_path / "pose.csv")[7]["pose.pose.position.x"]) == pytest.approx(0.07)
    plan = rows(tmp_path / "plan.csv")
    assert [row["index"] for row in plan] == ["0", "1"] * 3
    assert float(plan[1]["pose.orientation.yaw"]) == pytest.approx(math.atan2(0.5, 1.0))
    assert {row["child_frame_id"] for row in rows(tmp_path / "tf.csv")} == {"odom", "base_link"}


def test_last_map_and_path(made_up: Path) -> None:
    grid, path_m = last_map(Recording((made_up,)))
    assert grid.cells.shape == (40, 30)
    assert (grid.resolution_m, grid.origin_x_m) == (0.05, -1.0)
    assert path_m[-1].tolist() == pytest.approx([0.29, 0.0])


def test_last_map_ignores_poses_of_another_type(
    tmp_path: Path,
) -> None:
    path = tmp_path / "other.mcap"
    file = McapFile(path, {})
    goal, turned = MESSAGES.goal(0.0, Pose2(x_m=1.0)), MESSAGES.grid(0.0, SMALL)
    turned.info.origin.orientation.z, turned.info.origin.orientation.w = 1.0, 0.0
    for topic, message in (("pose", goal), ("map", MESSAGES.grid(0.0, SMALL)), ("map", turned)):
        file.add(topic, message.__msgtype__, 0, encode(message))
    file.close()
    grid, path_m = last_map(Recording((path,)))
    assert grid.cells.tolist() == SMALL.cells.tolist()
    assert path_m.shape == (0, 2)


def test_several_files_form_one_recording(made_up: Path, tmp_path: Path) -> None:
    (tmp_path / "a_001.mcap").write_bytes(made_up.read_bytes())
    (tmp_path / "a_000.mcap").write_bytes(made_up.read_bytes())
    paths = find_recordings([tmp_path])
    assert [path.name for path in paths] == ["a_000.mcap", "a_001.mcap"]
    assert sum(1 for _ in Recording(paths).messages()) == 2 * sum(1 for _ in Recording((made_up,)).messages())
    assert next(Recording(paths).messages()).log_ns == EPOCH_NS + 5_000_000_000


def test_files_of_two_runs_are_refused(made_up: Path, live: Live) -> None:
    with pytest.raises(ThumperError, match=r"of 2 runs; pass those of one run, such as .*\.mcap"):
        Recording((made_up, live[0]))


def test_a_folder_of_two_runs_stands_for_the_newest(made_up: Path, live: Live, tmp_path: Path) -> None:
    """By when it was started: its messages have simulated times, and a file may be renamed and copied."""
    runs = {path: int(Recording((path,)).metadata["run"]) for path in (made_up, live[0])}
    oldest, newest = sorted(runs, key=runs.__getitem__)
    (tmp_path / "a.mcap").write_bytes(newest.read_bytes())
    (tmp_path / "b.mcap").write_bytes(oldest.read_bytes())
    reports: list[str] = []
    assert find_recordings([tmp_path], reports.append) == (tmp_path / "a.mcap",)
    assert reports == [f"{tmp_path}/ has recordings of 2 runs; this is the newest: a.mcap"]


def test_other_files_are_refused_as_recordings(tmp_path: Path) -> None:
    text = tmp_path / "a.mcap"
    text.write_text("hello")
    for path, reason in ((text, "not an MCAP"), (tmp_path / "none.mcap", "cannot be read")):
        with pytest.raises(ThumperError, match=reason):
            Recording((path,))
    with pytest.raises(ThumperError, match="no recording"):
        Recording(find_recordings([]))


def test_unfinished_recording_is_refused_with_the_fix(tmp_path: Path) -> None:
    (tmp_path / "a.mcap.part").touch()
    with pytest.raises(ThumperError, match=r"a\.mcap\.part is unfinished.*`thumper recover ") as caught:
        find_recordings([tmp_path])
    assert caught.value.exit_code == 2
    (tmp_path / "b.mcap").touch()
    assert find_recordings([tmp_path]) == (tmp_path / "b.mcap",)
