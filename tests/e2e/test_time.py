"""A starved or suspended computer, and clocks that jump: the robot stops rather than drives on old data."""

import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.e2e.service import FAR, Service
from tests.e2e.test_safety_chain import LINK_LIMIT_S, STAYS_S, Chain
from thumper.ros.codec import Message
from thumper.runtime.requests import GoTo

STARVED_S, CYCLE_HZ = 6.0, 10.0
OLDEST_S = 0.5  # data, when a wheel still turns: 0.35 s, and the cycle in which it is noticed


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chain]:
    chain = Chain(tmp_path_factory.mktemp("time"))
    yield chain
    chain.close()


@contextmanager
def starved(process: subprocess.Popen[bytes], share: float, period_s: float) -> Iterator[None]:
    """Let the process run for `share` of each period only."""
    over = threading.Event()

    def run() -> None:
        while not over.is_set():
            process.send_signal(signal.SIGSTOP)
            time.sleep((1.0 - share) * period_s)
            process.send_signal(signal.SIGCONT)
            time.sleep(share * period_s)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "period_s"), [(0.25, 0.1), pytest.param(0.05, 0.2, marks=pytest.mark.slow)]
)
def test_starved_robot_drives_on_recent_data_or_not_at_all(
    chain: Chain, share: float, period_s: float
) -> None:
    statuses = list[Message]()
    chain.client.subscribe("status", statuses.append)
    wheels = list[Message]()
    chain.client.subscribe("wheels", wheels.append)
    chain.drive()
    statuses.clear()
    wheels.clear()
    with starved(chain.robot, share, period_s):
        time.sleep(STARVED_S)
        is_driven, cycles = chain.driven, len(wheels)
    moving = [status for status in statuses if status.mode == "driving" and not status.reason]
    assert all(max(status.telemetry_age_s, status.scan_age_s) < OLDEST_S for status in moving)
    time.sleep(STAYS_S)
    if share < 0.1:
        assert not is_driven
    else:
        assert cycles >= 0.9 * CYCLE_HZ * STARVED_S  # it keeps its rate
    if not chain.driven:
        reason = chain.reason()
        words = ("overloaded", "stopped the motors", "newest scan", "Write timeout", "at the goal")
        assert any(word in reason for word in words), reason
    assert chain.contacts == 0
    chain.client.query("command", {"command": "cancel"})
    chain.drive_again()


def test_suspended_computer_does_not_drive_on(chain: Chain) -> None:
    chain.drive()
    cut_s = time.monotonic()
    chain.robot.send_signal(signal.SIGSTOP)
    assert chain.off_after_s(cut_s) <= LINK_LIMIT_S
    time.sleep(4.0)
    chain.robot.send_signal(signal.SIGCONT)
    time.sleep(STAYS_S)
    assert not chain.driven
    # It may have been suspended while it wrote a command.
    assert any(words in chain.reason() for words in ("stopped the motors", "Write timeout"))
    assert chain.contacts == 0
    chain.drive_again()


@pytest.mark.parametrize("jump_s", [pytest.param(-86_400.0, marks=pytest.mark.slow), 86_400.0])
def test_clock_of_the_computer_may_jump(
    service: Service, monkeypatch: pytest.MonkeyPatch, jump_s: float
) -> None:
    """As NTP sets it. Everything that moves the robot uses the monotonic clock."""
    service.put(GoTo(goals=(FAR,)))
    service.run_cycles(10)
    clock, clock_ns = time.time, time.time_ns
    monkeypatch.setattr(time, "time", lambda: clock() + jump_s)
    monkeypatch.setattr(time, "time_ns", lambda: clock_ns() + round(1e9 * jump_s))
    service.until(lambda: service.mode == "idle", max_cycles=400)
    assert service.ask("mission/state")["state"] == "reached"
