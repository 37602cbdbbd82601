"""Nav2's actions on a simulated robot, driven by a client that writes CDR itself (no typestore of ours)."""

import itertools
import math
import struct
import threading
import time
import uuid
from typing import Any

import pytest
import zenoh
from benchmarks.shared.live import until
from zenoh_ros2_sdk import ZenohSession

from tests.host.ros2.conftest import Live
from thumper.ros.from_ros import pose_of

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
HEADER = b"\0\1\0\0"


class Cdr:
    """Little-endian CDR, written field by field."""

    def __init__(self) -> None:
        self.raw = b""

    def add(self, kind: str, *values: Any) -> "Cdr":
        size = struct.calcsize(kind)
        for value in values:
            self.raw += bytes(-len(self.raw) % size) + struct.pack(f"<{kind}", value)
        return self

    def text(self, content: str) -> "Cdr":
        raw = content.encode() + b"\0"
        self.add("I", len(raw))
        self.raw += raw
        return self

    def pose(self, x_m: float, y_m: float, yaw_rad: float = 0.0, frame: str = "map") -> "Cdr":
        """Add a PoseStamped."""
        self.add("i", 0).add("I", 0).text(frame)
        return self.add("d", x_m, y_m, 0.0, 0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


class Client:
    """A client of one action, which finds the keys of its parts in the graph."""

    def __init__(self, action: str) -> None:
        self.session = ZenohSession.get_instance().session
        self.action = action
        self.sequences = itertools.count(1)
        self.feedback: list[bytes] = []
        key = self.key("MP", "feedback")
        self._subscriber = self.session.declare_subscriber(
            key, lambda sample: self.feedback.append(sample.payload.to_bytes())
        )

    def key(self, kind: str, part: str) -> str:
        wanted = f"@ros2_lv/9/*/*/*/{kind}/%/%live/thumper/%live%{self.action}%_action%{part}/*/*/*"

        def found() -> list[str]:
            replies = self.session.liveliness().get(wanted, timeout=2.0)
            return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

        (token,) = until(found, 20.0)
        type_name, type_hash = token.split("/")[10:12]
        return f"9/live/{self.action}/_action/{part}/{type_name}/{type_hash}"

    def call(self, part: str, raw: bytes, timeout_s: float = 20.0) -> bytes:
        sequence = next(self.sequences)
        attachment = struct.pack("<qqB16s", sequence, time.time_ns(), 16, b"client of action")
        replies = self.session.get(
            self.key("SS", part),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            payload=HEADER + raw,
            attachment=attachment,
            timeout=timeout_s,
        )
        (reply,) = list(replies)
        assert reply.ok is not None, reply.err.payload.to_string()
        assert reply.ok.attachment.to_bytes()[:8] == struct.pack("<q", sequence)
        return bytes(reply.ok.payload.to_bytes()[4:])

    def send(self, goal: Cdr) -> bytes:
        """Send a goal, whose CDR begins behind a uuid (16 bytes keep the alignment); return its id."""
        goal_id = uuid.uuid4().bytes
        assert self.call("send_goal", goal_id + goal.raw)[0] == 1  # accepted
        return goal_id

    def result(self, goal_id: bytes, timeout_s: float = 90.0) -> tuple[int, bytes]:
        """Wait for the result; return the status and all behind it."""
        raw = self.call("get_result", goal_id, timeout_s)
        return raw[0], raw

    def cancel(self, goal_id: bytes) -> int:
        return self.call("cancel_goal", goal_id + struct.pack("<iI", 0, 0))[0]


def navigation_goal(x_m: float, y_m: float, **more: Any) -> Cdr:
    return Cdr().pose(x_m, y_m, **more).text("")


def text_at(raw: bytes, offset: int) -> str:
    (length,) = struct.unpack_from("<I", raw, offset)
    return raw[offset + 4 : offset + 3 + length].decode()


@pytest.fixture
def navigate(live: Live) -> Client:
    return Client("navigate_to_pose")


def test_goal_succeeds_with_feedback(navigate: Client) -> None:
    goal_id = navigate.send(navigation_goal(1.0, 0.05, yaw_rad=math.pi))
    status, raw = navigate.result(goal_id)
    assert (status, struct.unpack_from("<H", raw, 2)[0]) == (SUCCEEDED, 0)
    assert navigate.feedback
    assert {message[4:20] for message in navigate.feedback} == {goal_id}
    distances_m = [struct.unpack_from("<f", message, len(message) - 4)[0] for message in navigate.feedback]
    assert distances_m[-1] < distances_m[0]
    assert distances_m[-1] < 0.3


def test_cancelled_goal_stops_the_robot(live: Live, navigate: Client) -> None:
    goal_id = navigate.send(navigation_goal(0.0, 0.05))
    until(lambda: live.status.mode == "driving", 30.0)
    assert navigate.cancel(goal_id) == 0
    status, _ = navigate.result(goal_id)
    assert status == CANCELED
    until(lambda: live.status.mode == "idle", 30.0)
    assert pose_of(live.poses[-1].pose.pose).x_m > 0.3  # on the way
    assert navigate.cancel(goal_id) == 3  # terminated
    assert navigate.cancel(uuid.uuid4().bytes) == 2  # unknown


def test_next_goal_aborts_the_one_before(live: Live, navigate: Client) -> None:
    first = navigate.send(navigation_goal(0.0, 0.05))
    until(lambda: live.status.mode == "driving", 30.0)
    results: list[int] = []
    waiting = threading.Thread(target=lambda: results.append(navigate.result(first)[0]))
    waiting.start()
    second = navigate.send(navigation_goal(1.2, 0.05))
    waiting.join(30.0)
    assert results == [ABORTED]
    assert navigate.result(second)[0] == SUCCEEDED


def test_refused_goal_is_aborted_with_the_reason(navigate: Client) -> None:
    status, raw = navigate.result(navigate.send(navigation_goal(0.0, 0.0, frame="moon")))
    assert status == ABORTED
    assert "frame 'moon' is not supported" in text_at(raw, 4)


def test_waypoints_are_driven_in_turn(live: Live) -> None:
    client = Client("follow_waypoints")
    poses = Cdr().add("I", 0, 0, 2).pose(1.5, 0.08, math.pi).pose(1.2, 0.05, math.pi)
    status, raw = client.result(client.send(poses))
    assert (status, struct.unpack_from("<I", raw, 4)[0]) == (SUCCEEDED, 0)  # none missed
    reached = [struct.unpack_from("<I", message, 20)[0] for message in client.feedback]
    assert (reached[0], reached[-1]) == (0, 1)


def test_path_is_computed_without_driving(live: Live) -> None:
    client = Client("compute_path_to_pose")
    until(lambda: live.status.mode == "idle", 30.0)
    goal = Cdr().pose(0.6, 0.05).pose(1.5, 0.08).text("").add("?", True)
    status, raw = client.result(client.send(goal))
    assert status == SUCCEEDED, raw
    frame = text_at(raw, 12)  # status, pad; stamp; frame
    assert frame == "map"
    (count,) = struct.unpack_from("<I", raw, 20)
    assert count >= 2
    assert live.status.mode == "idle"
    status, raw = client.result(
        client.send(Cdr().pose(0.6, 0.05).pose(1.5, 0.08).text("none").add("?", True))
    )
    assert status == ABORTED
    assert b"unknown planner 'none'" in raw
    far = Cdr().pose(1e9, 0.05).pose(1.5, 0.08).text("carrot").add("?", True)
    status, raw = client.result(client.send(far))
    assert status == ABORTED
    assert b"the goal (1e+09, 0.05) is farther than" in raw
