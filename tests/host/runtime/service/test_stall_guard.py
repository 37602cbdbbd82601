"""What waited while the process hung is not done late."""

import pytest

from thumper.navigation.goal import Goal
from thumper.runtime.requests import EmergencyStop, GoTo, Query, Request, RobotCommand
from thumper.runtime.service.stall_guard import STALE_PERIOD_S, STALL_S, StallGuard, starts_motion


def test_only_what_comes_right_after_a_hang_is_stale() -> None:
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
def test_what_sets_the_robot_going(request_: Request, going: bool) -> None:
    assert starts_motion(request_) is going
