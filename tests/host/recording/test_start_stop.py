"""What the robot's status says of its recording."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.shared.live import until

from thumper.board.options import BoardOptions
from thumper.cli.status import recording_text
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.recording.start_stop import recording_control
from thumper.ros.codec import Message
from thumper.runtime.assembly import open_robot


def test_status_says_that_a_recording_waits_for_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Full from the start, then with room, then stopped."""
    free_bytes = [1e8]
    usage = SimpleNamespace(disk_usage=lambda _: SimpleNamespace(free=free_bytes[0]))
    monkeypatch.setattr("thumper.recording.disk_budget.shutil", usage)
    monkeypatch.setattr("thumper.recording.recorder.ROOM_PERIOD_S", 0.01)
    config = RobotConfig(
        board=BoardOptions(port="sim://room/board"), lidar=LidarOptions(port="sim://room/lidar")
    )
    newest: dict[str, Message] = {}
    with (
        open_robot(config, Pose2()) as robot,
        recording_control(robot, config, Pose2(), tmp_path, lambda _: None) as recording,
    ):
        robot.publisher.add_sink(lambda topic, _, message: newest.update({topic: message}))

        def status() -> str:
            robot.step()
            return recording_text(newest["status"]) if "status" in newest else ""

        until(lambda: status() == "off")
        recording.start()
        until(lambda: status() == "paused until the disk has room")
        assert newest["status"].recording  # so the page's button stops it
        free_bytes[0] = 1e12
        until(lambda: status() == "on")
        recording.stop()
        until(lambda: status() == "off")
