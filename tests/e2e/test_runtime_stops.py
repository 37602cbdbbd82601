"""Whatever ends a drive, the wheels stand at the end, the board is disarmed and the user reads why.

The real loop drives the simulated robot; in mid-drive something goes wrong.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.loop import RobotLoop
from thumper_hil.bench import Bench, simulation

START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)
GOAL = Goal(x_m=-0.49, y_m=0.02)
MISHAP_S = 2.5  # by then it drives at full speed

Mishap = Callable[[RobotLoop, Bench], None]


@contextmanager
def robot_in_the_lab() -> Iterator[tuple[RobotLoop, Bench]]:
    board = f"sim://stops/board?world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg=180"
    config = RobotConfig(board=BoardOptions(port=board), lidar=LidarOptions(port="sim://stops/lidar"))
    with open_robot(config, START) as robot:
        yield robot, simulation("stops")


def drive(robot: RobotLoop, bench: Bench, mishap: Mishap) -> DriveResult:
    happened = False

    def watch(beat: DriveProgress) -> None:
        nonlocal happened
        if beat.time_s >= MISHAP_S and not happened:
            happened = True
            assert bench.truth()[-1, 4] > 3.0  # the wheels turn
            mishap(robot, bench)

    return robot.drive_to(GOAL, watch)


def interrupt(_robot: RobotLoop, _bench: Bench) -> None:
    raise KeyboardInterrupt


def break_the_mapper(robot: RobotLoop, _bench: Bench) -> None:
    def broken(*_: object) -> None:
        raise IndexError("no such cell")

    robot.mapper.update = broken  # type: ignore[method-assign, assignment]


def silence_the_lidar(robot: RobotLoop, _bench: Bench) -> None:
    robot.inputs.lidar.poll = list  # type: ignore[method-assign]


def restart_the_board(_robot: RobotLoop, bench: Bench) -> None:
    bench.chip.reset()


def stop_by_another_hand(_robot: RobotLoop, bench: Bench) -> None:
    bench.chip.send(encode_frame(CommandRequest.ID, 200, CommandRequest(command=Command.E_STOP).pack()))


MISHAPS = [
    (interrupt, "interrupted"),
    (break_the_mapper, "internal error: IndexError: no such cell"),
    (silence_the_lidar, "lidar stopped sending scans"),
    (restart_the_board, "the board has restarted"),
    (stop_by_another_hand, "emergency stop"),
]


@pytest.mark.parametrize(("mishap", "words"), MISHAPS, ids=[mishap.__name__ for mishap, _ in MISHAPS])
def test_the_wheels_stand_and_the_user_reads_why(mishap: Mishap, words: str) -> None:
    with robot_in_the_lab() as (robot, bench):
        result = drive(robot, bench, mishap)
        truth = bench.truth()
        wheels_rad_s = np.abs(truth[-1, 4:])
    assert not result.reached
    assert words in result.reason
    assert wheels_rad_s.max() < 0.05
    assert result.interrupted == (mishap is interrupt)
    assert bench.contacts == 0
    assert truth[-1, 1] > 0.0  # it did not go on to the goal


@pytest.mark.parametrize("call", ["set_wheel_speeds", "command"])
def test_another_ctrl_c_while_it_stops_does_not_skip_disarming(
    call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The user is impatient: Ctrl-C again in the ramp, or in the very command that disarms."""
    with robot_in_the_lab() as (robot, bench):
        board = robot.inputs.board
        said = getattr(board, call)
        impatient = True

        def interrupted(*words: object) -> None:
            nonlocal impatient
            if impatient and (call == "set_wheel_speeds" or words == (Command.DISARM,)):
                impatient = False
                raise KeyboardInterrupt
            said(*words)

        def interrupt_twice(robot: RobotLoop, bench: Bench) -> None:
            monkeypatch.setattr(board, call, interrupted)
            interrupt(robot, bench)

        result = drive(robot, bench, interrupt_twice)
        assert not impatient
        assert result.interrupted
        assert "did not confirm" not in result.reason
        assert board.poll(0.5)[-1].telemetry.state is State.DISARMED


def test_without_eyes_it_goes_no_further_than_it_must() -> None:
    """0.4 m/s for the three turns that it waits, and the way to a stop: 0.4 m and not the whole second."""
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
        drive(robot, bench, stop_by_another_hand)
        with pytest.raises(ThumperError, match=r"emergency stop.*clear the fault") as refused:
            robot.drive_to(GOAL, lambda _: None)
        assert refused.value.option == "--clear-fault"
        assert robot.drive_to(GOAL, lambda _: None, clear_fault=True).reached
    assert bench.contacts == 0


def test_frames_lost_on_the_way_to_a_stand_are_no_lost_link() -> None:
    def interrupt_and_disturb(robot: RobotLoop, bench: Bench) -> None:
        bench.fault("line.noise", 0.02)
        interrupt(robot, bench)

    with robot_in_the_lab() as (robot, bench):
        drive(robot, bench, interrupt_and_disturb)
        bench.fault("line.noise", 0.0)
        telemetry = robot.inputs.board.poll(0.5)[-1].telemetry
    assert (telemetry.state, telemetry.fault) == (State.DISARMED, Fault.NONE)


def test_a_stop_pressed_between_two_drives_is_heard_before_the_second() -> None:
    """The link was lost in the first: that fault alone would be cleared unasked."""
    with robot_in_the_lab() as (robot, bench):
        result = drive(robot, bench, lambda _, bench: bench.fault("host.hang", 1.0))
        assert "no command for 300 ms" in result.reason
        stop_by_another_hand(robot, bench)
        bench.advance(bench.time_s + 10.0)
        with pytest.raises(ThumperError, match=r"emergency stop.*clear the fault"):
            robot.drive_to(GOAL, lambda _: None)
        assert robot.drive_to(GOAL, lambda _: None, clear_fault=True).reached


def test_after_a_restart_the_map_is_as_it_was() -> None:
    """The counts begin again at zero; the pose must not jump by what was driven before."""
    with robot_in_the_lab() as (robot, bench):
        result = drive(robot, bench, restart_the_board)
        x_m, y_m = bench.truth()[-1, 1:3]
    assert math.hypot(result.map_from_base.x_m - x_m, result.map_from_base.y_m - y_m) < 0.3
    assert result.path_length_m < 1.2
