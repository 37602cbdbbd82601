"""Each published message carries the time at which it is sent."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from thumper.board.options import BoardOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.ros.codec import Message
from thumper.ros.from_ros import map_change_of
from thumper.ros.to_ros import text
from thumper.runtime.assembly import open_robot
from thumper.runtime.loop import RobotLoop
from thumper.slam.localization.amcl import Amcl
from thumper.slam.mode_switch import SlamModeSwitch

PAUSE_S = 5.0


class Listener:
    """Keeps topic, time and message of all that is published."""

    def __init__(self) -> None:
        self.received: list[tuple[str, float, Message]] = []

    def __call__(self, topic: str, time_s: float, message: Message) -> None:
        self.received.append((topic, time_s, message))

    def times_s(self, topic: str) -> list[float]:
        return [time_s for name, time_s, _ in self.received if name == topic]


@pytest.fixture
def robot() -> Iterator[RobotLoop]:
    config = RobotConfig(
        board=BoardOptions(port="sim://stamps/board"), lidar=LidarOptions(port="sim://stamps/lidar")
    )
    with open_robot(config, Pose2()) as robot:
        yield robot


def let_time_pass(robot: RobotLoop) -> float:
    """Run control cycles for a while; return the robot's time."""
    until_s = robot.inputs.now_s() + PAUSE_S
    while robot.inputs.now_s() < until_s:
        robot.step()
    return robot.inputs.now_s()


def test_a_text_before_the_first_cycle_has_the_present_time(robot: RobotLoop) -> None:
    """With time 0, a recording that starts with it would start with the computer."""
    robot.inputs.board.poll(1.0)
    now_s = robot.inputs.now_s()
    assert now_s > 0.0
    listener = Listener()
    robot.publisher.add_sink(listener)
    robot.publisher.publish_text("session", text("{}"))
    assert listener.times_s("session") == [now_s]


def test_a_late_sink_receives_latched_messages_with_the_present_time(robot: RobotLoop) -> None:
    """With their old time, a recording that is started later would start hours too early."""
    early, late = Listener(), Listener()
    robot.publisher.add_sink(early)
    robot.publisher.publish_text("session", text("{}"))
    now_s = let_time_pass(robot)
    robot.publisher.add_sink(late)
    robot.step()
    first_s = min(time_s for _, time_s, _ in late.received)
    assert {topic for topic, _, _ in late.received} >= {"session", "tf_static"}
    assert first_s == pytest.approx(now_s, abs=0.2)
    (tf_static,) = (message for topic, _, message in late.received if topic == "tf_static")
    stamp = tf_static.transforms[0].header.stamp
    assert stamp.sec + 1e-9 * stamp.nanosec < now_s - PAUSE_S + 1.0  # its own stamp stays


def test_the_pose_has_the_covariance_of_the_mapper(robot: RobotLoop) -> None:
    """Zeros would make a filter that fuses the pose trust it without limit."""
    listener = Listener()
    robot.publisher.add_sink(listener)
    let_time_pass(robot)
    pose = next(message for topic, _, message in reversed(listener.received) if topic == "pose")
    covariance = pose.pose.covariance.reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))]
    np.testing.assert_array_equal(covariance, robot.mapper.quality().covariance)
    assert (np.diag(covariance) > 0.0).all()


def test_an_event_is_stamped_when_it_happens(robot: RobotLoop) -> None:
    listener = Listener()
    robot.publisher.add_sink(listener)
    robot.step()
    now_s = let_time_pass(robot)
    robot.inputs.board.poll(1.0)  # time passes without a cycle
    later_s = robot.inputs.now_s()
    robot.publisher.publish_event("something happened")
    (event_s,) = listener.times_s("events")[-1:]
    assert event_s == later_s > now_s
    _, _, message = listener.received[-1]
    assert message.stamp.sec + 1e-9 * message.stamp.nanosec == pytest.approx(later_s, abs=1e-6)


def test_a_lost_pose_is_in_the_status_and_in_the_events(
    robot: RobotLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_time_pass(robot)
    assert isinstance(robot.mapper, SlamModeSwitch)
    own_map = robot.mapper.grid()
    cells = np.zeros((60, 60), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    listener = Listener()
    robot.publisher.add_sink(listener)
    robot.mapper.localize_in(replace(own_map, cells=cells), None)  # of another room
    let_time_pass(robot)
    robot.mapper.localize_in(own_map, Pose2())
    let_time_pass(robot)
    lost = [message.pose_lost for topic, _, message in listener.received if topic == "status"]
    assert any(lost)
    assert lost[-1] == ""
    states = [message.localization for topic, _, message in listener.received if topic == "status"]
    assert list(dict.fromkeys(states)) == ["searching", "localized"]
    events = [message.msg for topic, _, message in listener.received if topic == "events"]
    assert events[0].startswith("pose lost: ")
    assert events[-1] == "pose found"
    monkeypatch.setattr(Amcl, "_lost", lambda _: "carried away")
    let_time_pass(robot)
    states = [message.localization for topic, _, message in listener.received if topic == "status"]
    assert states[-1] == "pose lost"


def test_a_pose_found_at_once_in_a_loaded_map_is_an_event(robot: RobotLoop) -> None:
    let_time_pass(robot)
    assert isinstance(robot.mapper, SlamModeSwitch)
    listener = Listener()
    robot.publisher.add_sink(listener)
    robot.mapper.localize_in(robot.mapper.grid(), None)
    let_time_pass(robot)
    assert [message.msg for topic, _, message in listener.received if topic == "events"] == ["pose found"]


def test_a_pose_that_the_scans_contradict_is_refused_in_words(robot: RobotLoop) -> None:
    let_time_pass(robot)
    assert isinstance(robot.mapper, SlamModeSwitch)
    listener = Listener()
    robot.publisher.add_sink(listener)
    robot.mapper.localize_in(robot.mapper.grid(), Pose2(x_m=1.5, theta_rad=2.0))
    let_time_pass(robot)
    events = [message.msg for topic, _, message in listener.received if topic == "events"]
    assert events.count("the scans contradict the pose that was set; they fit at (0.00, 0.00)") == 1


def test_map_changes_lead_from_each_map_to_the_next(robot: RobotLoop) -> None:
    listener = Listener()
    robot.publisher.add_sink(listener)
    let_time_pass(robot)
    robot.drive_manager.start(Goal(x_m=1.5, y_m=0.5), robot.inputs.telemetry)
    let_time_pass(robot)
    maps = [message for topic, _, message in listener.received if topic == "map"]
    changes = [message for topic, _, message in listener.received if topic == "map_changes"]
    assert [change.header for change in changes] == [new.header for new in maps]
    changed = 0
    for before, new, change in zip(maps, maps[1:], changes[1:], strict=False):
        if change.before != before.header.stamp:
            assert change.before.sec == 0
            continue
        box, part = map_change_of(change)
        cells = before.data.reshape(before.info.height, before.info.width).copy()
        cells[box.window] = part
        assert cells.reshape(-1).tolist() == new.data.tolist()
        changed += 0 < part.size < 0.5 * cells.size
    assert changed
