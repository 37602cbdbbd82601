"""Requests that queued while the process hung are rejected."""

import pytest

from thumper.navigation.goal import Goal
from thumper.runtime.requests import EmergencyStop, GoTo, Query, Request, RobotCommand
from thumper.runtime.service.stall_guard import STALE_PERIOD_S, STALL_S, StallGuard, starts_motion


def test_requests_right_after_a_stall_are_stale() -> None:
    guard = StallGuard()
    assert not guard.is_stale(100.0)
    assert not guard.is_stale(100.1)
    woken_s = 100.1 + STALL_S + 0.1
    assert guard.is_stale(woken_s)
    assert guard.is_stale(woken_s + 0.9 * STALE_PERIOD_S)
    assert not guard.is_stale(woken_s + 1.1 * STALE_PERIOD_S)


@pytest.mark.parametrize(
    ("request_", "going"),
    [
        (GoTo(goals=(Goal(x_m=1.0, y_m=0.0),)), True),
        (RobotCommand(name="arm"), True),
        (RobotCommand(name="disarm"), False),
        (EmergencyStop(), False),
        (Query(name="mission/send", content={}, reply=print), True),
        (Query(name="command", content={"command": "arm"}, reply=print), True),
        (Query(name="command", content={"command": "cancel"}, reply=print), False),
        (Query(name="parameters/get", content={}, reply=print), False),
    ],
)
def test_requests_that_start_motion(request_: Request, going: bool) -> None:
    assert starts_motion(request_) is going


def test_limits_of_a_stall() -> None:
    guard = StallGuard()
    assert not guard.is_stale(0.5)  # the clock may have started a moment ago
    assert not guard.is_stale(2.5)  # 2 s are no stall
    assert guard.is_stale(4.6)
    assert not guard.is_stale(5.6)
    assert (STALL_S, STALE_PERIOD_S) == (2.0, 1.0)
