"""The queue is bounded, but never loses an emergency stop; heartbeats of many sources."""

import pytest

from thumper.common.geometry import Twist2
from thumper.runtime.drive.heartbeats import MAX_SOURCES, HeartbeatMonitor
from thumper.runtime.requests import (
    EmergencyStop,
    Heartbeat,
    Request,
    RobotCommand,
    TeleopSource,
    Velocity,
)
from thumper.runtime.service.request_queue import MAX_PENDING, RequestQueue


def test_requests_stay_in_order() -> None:
    queue = RequestQueue()
    queue.put(RobotCommand(name="arm"))
    queue.put(RobotCommand(name="disarm"))
    assert [request for _, request in queue.take_all()] == [
        RobotCommand(name="arm"),
        RobotCommand(name="disarm"),
    ]
    assert queue.take_all() == []


def test_a_flood_never_displaces_the_emergency_stop() -> None:
    queue = RequestQueue()
    queue.put(EmergencyStop())
    for n in range(MAX_PENDING + 10):
        queue.put(Heartbeat(source=str(n)))
    taken = [request for _, request in queue.take_all()]
    assert taken[0] == EmergencyStop()
    assert taken[1] == Heartbeat(source="10")
    assert len(taken) == MAX_PENDING + 1


@pytest.mark.parametrize(
    ("request_", "is_urgent"),
    [
        (EmergencyStop(), True),
        (RobotCommand(name="disarm"), True),
        (Velocity(channel=TeleopSource.VELOCITY, twist=Twist2(w_rad_s=0.1)), True),
        (Velocity(channel=TeleopSource.VELOCITY, twist=Twist2()), False),
        (Heartbeat(), False),
    ],
)
def test_what_stops_or_moves_the_robot_is_urgent(request_: Request, is_urgent: bool) -> None:
    queue = RequestQueue()
    assert not queue.is_urgent
    queue.put(Heartbeat())
    queue.put(request_)
    assert queue.is_urgent is is_urgent
    queue.take_all()
    assert not queue.is_urgent


def test_a_source_is_lost_only_after_a_heartbeat() -> None:
    heartbeats = HeartbeatMonitor(0.3)
    assert not heartbeats.is_lost("page", 100.0)
    heartbeats.record("page", 1.0)
    assert not heartbeats.is_lost("page", 1.29)
    assert heartbeats.is_lost("page", 1.31)
    assert not heartbeats.is_lost("other", 2.0)


def test_the_longest_silent_source_is_forgotten() -> None:
    heartbeats = HeartbeatMonitor(0.3)
    for n in range(MAX_SOURCES + 1):
        heartbeats.record(str(n), float(n))
    assert not heartbeats.is_lost("0", 1e9)  # forgotten
    assert heartbeats.is_lost("1", 1e9)


def test_the_monitored_source_is_not_forgotten() -> None:
    heartbeats = HeartbeatMonitor(0.3)
    heartbeats.record("page", 0.0)
    assert not heartbeats.is_lost("page", 0.1)
    for n in range(2 * MAX_SOURCES):
        heartbeats.record(str(n), 1.0)
    assert heartbeats.is_lost("page", 1.0)


def test_limits_are_those_of_the_safety_case() -> None:
    heartbeats = HeartbeatMonitor()
    heartbeats.record("page", 0.0)
    assert not heartbeats.is_lost("page", 0.3)
    assert heartbeats.is_lost("page", 0.301)
    assert (MAX_SOURCES, MAX_PENDING) == (64, 256)
