"""A task under way: its legs, and its result however it ends."""

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import Leg
from thumper.runtime.drive.running_task import RunningTask
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_result import DriveResult

A, B = Leg(goal=Goal(x_m=1.0, y_m=0.0)), Leg(goal=Goal(x_m=2.0, y_m=0.0))
REACHED = DriveResult(
    reached=True, interrupted=False, reason="there", time_s=10.0, path_length_m=1.0, pose=Pose2()
)


def two_legs() -> Task:
    yield A
    return (yield B)


def one_leg_then_a_defect() -> Task:
    yield A
    raise IndexError("no frontier")


def one_leg_then_ctrl_c() -> Task:
    yield A
    raise KeyboardInterrupt


def test_legs_and_result() -> None:
    task = RunningTask(two_legs())
    assert task.leg is A
    task.leg_ended(REACHED)
    assert (task.leg, task.is_over) == (B, False)
    task.leg_ended(REACHED)
    assert task.is_over
    assert task.result() == REACHED


def test_an_unhandled_refusal_is_raised_with_the_result() -> None:
    task = RunningTask(two_legs())
    task.leg_refused(ThumperError("a latched fault"))
    assert (task.is_over, task.has_result) == (True, False)
    with pytest.raises(ThumperError, match="latched"):
        task.result()


def test_a_task_that_ends_between_two_legs_keeps_those_before() -> None:
    task = RunningTask(two_legs())
    task.leg_ended(REACHED)
    task.end("interrupted", interrupted=True)
    result = task.result()
    assert (task.leg, task.is_over) == (None, True)
    assert (result.reached, result.interrupted, result.reason) == (False, True, "interrupted")
    assert result.path_length_m == REACHED.path_length_m


def test_a_task_that_ends_before_its_first_leg_has_no_result() -> None:
    task = RunningTask(two_legs())
    task.end("the board is silent")
    assert not task.has_result
    with pytest.raises(ThumperError, match="silent"):
        task.result()


def test_a_defect_of_the_task_ends_it_with_the_legs_before() -> None:
    task = RunningTask(one_leg_then_a_defect())
    task.leg_ended(REACHED)
    assert "internal error: IndexError: no frontier" in task.result().reason
    assert task.result().path_length_m == REACHED.path_length_m


def test_ctrl_c_while_the_task_decides_leaves_no_leg() -> None:
    task = RunningTask(one_leg_then_ctrl_c())
    with pytest.raises(KeyboardInterrupt):
        task.leg_ended(REACHED)
    assert (task.leg, task.is_over) == (None, False)
    task.end("interrupted", interrupted=True)
    assert task.result().interrupted
