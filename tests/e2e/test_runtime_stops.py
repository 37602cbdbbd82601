"""Whatever ends a drive, the wheels stop, the board is disarmed and the reason is reported.

The real loop drives the simulated robot; in the middle of the drive something fails.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from thumper.board.framing import encode_frame
from thumper.board.messages import Command, CommandRequest, Fault, State
from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.display import NoDisplay
from thumper.runtime.drive.drive_manager import DriveMode
from thumper.runtime.drive.legs import Leg
from thumper.runtime.drive.tasks import Task, drive_to_goal
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.loop import RobotLoop
from thumper_hil.bench import Bench, simulation

START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)
HALFWAY, GOAL = Goal(x_m=1.3, y_m=0.05), Goal(x_m=-0.49, y_m=0.02)
BEFORE_GOAL = Goal(x_m=-0.2, y_m=0.02)
MISHAP_S = 2.5  # by then the robot drives at full speed

Mishap = Callable[[RobotLoop, Bench], None]


@contextmanager
def robot_in_the_lab() -> Iterator[tuple[RobotLoop, Bench]]:
    board = f"sim://stops/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = RobotConfig(board=BoardOptions(port=board), lidar=LidarOptions(port="sim://stops/lidar"))
    with open_robot(config, START) as robot:
        yield robot, simulation("stops")


def drive(robot: RobotLoop, bench: Bench, mishap: Mishap) -> DriveResult:
    happened = False

    def watch(progress: DriveProgress) -> None:
        nonlocal happened
        if progress.time_s >= MISHAP_S and not happened:
            happened = True
            assert bench.truth()[-1, 4] > 3.0  # the wheels turn
            mishap(robot, bench)

    return robot.run(drive_to_goal(GOAL), NoDisplay(on_progress=watch))


def interrupt(_robot: RobotLoop, _bench: Bench) -> None:
    raise KeyboardInterrupt


def break_the_mapper(robot: RobotLoop, _bench: Bench) -> None:
    def broken(*_: object, **__: object) -> None:
        raise IndexError("no such cell")

    robot.mapper.update = broken  # type: ignore[method-assign, assignment]


def silence_the_lidar(robot: RobotLoop, _bench: Bench) -> None:
    robot.inputs.lidar.poll = list  # type: ignore[method-assign]


def restart_the_board(_robot: RobotLoop, bench: Bench) -> None:
    bench.chip.reset()


def stop_by_another_host(_robot: RobotLoop, bench: Bench) -> None:
    bench.chip.send(encode_frame(CommandRequest.ID, 200, CommandRequest(command=Command.E_STOP).pack()))


MISHAPS = [
    (interrupt, "interrupted"),
    (break_the_mapper, "internal error: IndexError: no such cell"),
    (silence_the_lidar, "lidar stopped sending scans"),
    (restart_the_board, "the board has restarted"),
    (stop_by_another_host, "emergency stop"),
]


@pytest.mark.parametrize(("mishap", "words"), MISHAPS, ids=[mishap.__name__ for mishap, _ in MISHAPS])
def test_the_wheels_stop_and_the_reason_is_reported(mishap: Mishap, words: str) -> None:
    with robot_in_the_lab() as (robot, bench):
        result = drive(robot, bench, mishap)
        bench.advance(bench.time_s + 0.1)  # the motors are off; the wheels roll out
        truth = bench.truth()
        wheels_rad_s = np.abs(truth[-1, 4:])
    assert not result.reached
    assert words in result.reason
    assert wheels_rad_s.max() < 0.05
    assert result.interrupted == (mishap is interrupt)
    assert bench.contacts == 0
    assert truth[-1, 1] > 0.0  # it did not reach the goal


@pytest.mark.parametrize("call", ["set_wheel_speeds", "command"])
def test_a_second_ctrl_c_does_not_skip_disarming(call: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second Ctrl-C comes in the ramp, or in the command that disarms."""
    with robot_in_the_lab() as (robot, bench):
        board = robot.inputs.board
        send = getattr(board, call)
        impatient = True

        def interrupted(*arguments: object) -> None:
            nonlocal impatient
            if impatient and (call == "set_wheel_speeds" or arguments == (Command.DISARM,)):
                impatient = False
                raise KeyboardInterrupt
            send(*arguments)

        def interrupt_twice(robot: RobotLoop, bench: Bench) -> None:
            monkeypatch.setattr(board, call, interrupted)
            interrupt(robot, bench)

        result = drive(robot, bench, interrupt_twice)
        assert not impatient
        assert result.interrupted
        assert "did not confirm" not in result.reason
        assert board.poll(0.5)[-1].telemetry.state is State.DISARMED


def test_ctrl_c_right_after_arming_disarms(monkeypatch: pytest.MonkeyPatch) -> None:
    """The drive has started, its control loop has not: the motors must not stay armed."""
    with robot_in_the_lab() as (robot, _):
        start = robot.drive_manager.start

        def start_and_interrupt(goal: Goal, *args: Any, **options: Any) -> None:
            start(goal, *args, **options)
            raise KeyboardInterrupt

        monkeypatch.setattr(robot.drive_manager, "start", start_and_interrupt)
        with pytest.raises(KeyboardInterrupt):
            robot.run(drive_to_goal(GOAL))
        robot.step()
        assert robot.inputs.telemetry is not None
        assert robot.inputs.telemetry.state is State.DISARMED


@pytest.mark.parametrize("moment", ["deciding", "stopping", "starting"])
def test_ctrl_c_between_two_drives_keeps_the_result(moment: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the command that drives would lose the map of the first drive."""
    with robot_in_the_lab() as (robot, _):
        manager, board = robot.drive_manager, robot.inputs.board
        start, disarm = manager.start, board.command

        def interrupt_the_stop(command: Command) -> None:
            monkeypatch.setattr(board, "command", disarm)
            if command is Command.DISARM:
                raise KeyboardInterrupt
            disarm(command)

        def interrupt_the_start(*arguments: Any, **options: Any) -> None:
            start(*arguments, **options)
            raise KeyboardInterrupt

        def task() -> Task:
            yield Leg(goal=HALFWAY)
            if moment == "deciding":
                raise KeyboardInterrupt
            if moment == "starting":
                monkeypatch.setattr(manager, "start", interrupt_the_start)
            return (yield Leg(goal=GOAL))

        def watch(progress: DriveProgress) -> None:
            if moment == "stopping" and progress.time_s > 0.5:
                monkeypatch.setattr(board, "command", interrupt_the_stop)

        result = robot.run(task(), NoDisplay(on_progress=watch))
        assert (result.reached, result.interrupted, result.reason) == (False, True, "interrupted")
        assert result.path_length_m > 0.2
        robot.step()
        assert robot.inputs.telemetry is not None
        assert robot.inputs.telemetry.state is State.DISARMED


def test_stopping_distance_without_scans() -> None:
    """0.4 m/s for three lidar revolutions, plus the braking distance: less than 0.4 m."""
    seen_x_m = math.nan

    def note_and_silence(robot: RobotLoop, bench: Bench) -> None:
        nonlocal seen_x_m
        seen_x_m = float(bench.truth()[-1, 1])
        silence_the_lidar(robot, bench)

    with robot_in_the_lab() as (robot, bench):
        drive(robot, bench, note_and_silence)
        assert 0.05 < seen_x_m - bench.truth()[-1, 1] < 0.4


def test_an_emergency_stop_is_cleared_only_on_request() -> None:
    with robot_in_the_lab() as (robot, bench):
        drive(robot, bench, stop_by_another_host)
        with pytest.raises(ThumperError, match=r"emergency stop.*clear the fault") as refused:
            robot.run(drive_to_goal(GOAL))
        assert refused.value.option == "--clear-fault"
        assert robot.run(drive_to_goal(GOAL, clear_fault=True)).reached
    assert bench.contacts == 0


def test_lost_frames_while_stopping_are_not_a_lost_link() -> None:
    def interrupt_and_disturb(robot: RobotLoop, bench: Bench) -> None:
        bench.fault("line.noise", 0.02)
        interrupt(robot, bench)

    with robot_in_the_lab() as (robot, bench):
        drive(robot, bench, interrupt_and_disturb)
        bench.fault("line.noise", 0.0)
        telemetry = robot.inputs.board.poll(0.5)[-1].telemetry
    assert (telemetry.state, telemetry.fault) == (State.DISARMED, Fault.NONE)


def test_an_emergency_stop_between_two_drives_blocks_the_second() -> None:
    """The first drive ended with a lost link, which alone would be cleared without a request."""
    with robot_in_the_lab() as (robot, bench):
        result = drive(robot, bench, lambda _, bench: bench.fault("host.hang", 1.0))
        assert "no command for 300 ms" in result.reason
        stop_by_another_host(robot, bench)
        bench.advance(bench.time_s + 10.0)
        with pytest.raises(ThumperError, match=r"emergency stop.*clear the fault"):
            robot.run(drive_to_goal(GOAL))
        assert robot.run(drive_to_goal(GOAL, clear_fault=True)).reached


def test_a_restart_of_the_board_keeps_pose_and_map() -> None:
    """The counts restart at zero; the pose must not jump by the distance driven before."""
    with robot_in_the_lab() as (robot, bench):
        result = drive(robot, bench, restart_the_board)
        x_m, y_m = bench.truth()[-1, 1:3]
    assert math.hypot(result.pose.x_m - x_m, result.pose.y_m - y_m) < 0.3
    assert result.path_length_m < 1.2


def after_full_speed(robot: RobotLoop) -> Callable[[], bool]:
    """Return a function that is true once the wheels have driven at full speed for a while."""
    cycles = 0

    def is_fast() -> bool:
        nonlocal cycles
        state = robot.inputs.estimator.state()
        cycles += state is not None and state.twist.v_m_s > 0.3
        return cycles > 5

    return is_fast


def test_two_goals_without_a_stop_between_them() -> None:
    def task() -> Task:
        yield Leg(goal=GOAL, until=after_full_speed(robot))
        return (yield Leg(goal=BEFORE_GOAL))

    with robot_in_the_lab() as (robot, bench):
        assert robot.run(task()).reached
        wheels_rad_s = bench.truth()[:, 4]
        fast = np.flatnonzero(wheels_rad_s > 3.0)
        assert wheels_rad_s[fast[0] : fast[-1]].min() > 1.0
        robot.step()
        assert robot.inputs.telemetry is not None
        assert robot.inputs.telemetry.state is State.DISARMED


def test_refused_second_goal_stops_the_wheels() -> None:
    refused = Goal(x_m=400.0, y_m=0.0)

    def task() -> Task:
        yield Leg(goal=GOAL, until=after_full_speed(robot))
        return (yield Leg(goal=refused))

    with robot_in_the_lab() as (robot, bench):
        with pytest.raises(ThumperError, match="400"):
            robot.run(task())
        assert abs(bench.truth()[-1, 4]) < 0.1
        robot.step()
        assert robot.inputs.telemetry is not None
        assert robot.inputs.telemetry.state is State.DISARMED
        assert robot.drive_manager.mode is DriveMode.IDLE


def test_robot_that_stays_in_one_place_gives_the_goal_up() -> None:
    def task() -> Task:
        return (yield Leg(goal=Goal(x_m=START.x_m - 0.4, y_m=START.y_m, tolerance_m=0.01), patience_s=1.0))

    with robot_in_the_lab() as (robot, _):
        result = robot.run(task())
    assert not result.reached
    assert result.navigation_failed
    assert result.reason.startswith("stayed in one place for 1 s")
