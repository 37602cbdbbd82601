"""What waited while the process hung is not done late."""

import pytest

from thumper.navigation.goal import Goal
from thumper.runtime.requests import EmergencyStop, GoTo, Query, Request, RobotCommand
from thumper.runtime.service.stall_guard import HUNG_S, LATE_S, StallGuard, sets_going


def test_only_what_comes_right_after_a_hang_is_late() -> None:
    waking = StallGuard()
    assert not waking.is_late(100.0)
    assert not waking.is_late(100.1)
    woken_s = 100.1 + HUNG_S + 0.1
    assert waking.is_late(woken_s)
    assert waking.is_late(woken_s + 0.9 * LATE_S)
    assert not waking.is_late(woken_s + 1.1 * LATE_S)


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
    assert sets_going(request_) is going
