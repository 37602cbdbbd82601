"""A flood may crowd out what it likes, but not the emergency stop."""

from thumper.runtime.drive.heartbeats import MOST_SOURCES, HeartbeatMonitor
from thumper.runtime.requests import EmergencyStop, Heartbeat, RobotCommand
from thumper.runtime.service.request_queue import MOST_WAITING, RequestQueue


def test_requests_come_out_in_their_order() -> None:
    inbox = RequestQueue()
    inbox.put(RobotCommand(name="arm"))
    inbox.put(RobotCommand(name="disarm"))
    assert [request for _, request in inbox.take()] == [RobotCommand(name="arm"), RobotCommand(name="disarm")]
    assert inbox.take() == []


def test_a_flood_loses_its_oldest_part_and_never_the_stop() -> None:
    inbox = RequestQueue()
    inbox.put(EmergencyStop())
    for n in range(MOST_WAITING + 10):
        inbox.put(Heartbeat(source=str(n)))
    taken = [request for _, request in inbox.take()]
    assert taken[0] == EmergencyStop()
    assert taken[1] == Heartbeat(source="10")
    assert len(taken) == MOST_WAITING + 1


def test_a_source_is_lost_only_after_it_was_there() -> None:
    supervision = HeartbeatMonitor(0.3)
    assert not supervision.is_lost("page", 100.0)
    supervision.beat("page", 1.0)
    assert not supervision.is_lost("page", 1.29)
    assert supervision.is_lost("page", 1.31)
    assert not supervision.is_lost("other", 2.0)


def test_too_many_sources_push_out_the_one_silent_longest() -> None:
    supervision = HeartbeatMonitor(0.3)
    for n in range(MOST_SOURCES + 1):
        supervision.beat(str(n), float(n))
    assert not supervision.is_lost("0", 1e9)  # forgotten
    assert supervision.is_lost("1", 1e9)


def test_the_source_that_is_watched_is_not_pushed_out() -> None:
    supervision = HeartbeatMonitor(0.3)
    supervision.beat("page", 0.0)
    assert not supervision.is_lost("page", 0.1)
    for n in range(2 * MOST_SOURCES):
        supervision.beat(str(n), 1.0)
    assert supervision.is_lost("page", 1.0)
