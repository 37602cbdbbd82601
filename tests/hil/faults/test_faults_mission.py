"""A fault during a mission: the wheels stop in time, nothing is hit, and the cause is reported."""

import math
import re
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest

from tests.variants import some_of
from thumper.board.options import BoardOptions
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.drive_result import DriveResult
from thumper_hil.bench import Bench, simulation
from thumper_hil.demo.missions import STRAIGHT

FAULT_S = 2.5  # the robot is at full speed then
STATIONARY_RAD_S = 0.3


def drive_with(fault: str, folder: Path) -> tuple[DriveResult, Bench]:
    """Drive the straight mission with this fault, and one second longer."""
    scenario = folder / "faults.toml"
    scenario.write_text(f"faults = [{{ at_s = {FAULT_S}, {fault} }}]\n")
    options = {
        "world": STRAIGHT.world,
        "x_m": STRAIGHT.start.x_m,
        "y_m": STRAIGHT.start.y_m,
        "yaw_deg": math.degrees(STRAIGHT.start.theta_rad),
        "scenario": scenario,
    }
    config = RobotConfig(
        board=BoardOptions(port=f"sim://mission-fault/board?{urlencode(options)}"),
        lidar=LidarOptions(port="sim://mission-fault/lidar"),
    )
    with open_robot(config, STRAIGHT.start) as robot:
        bench = simulation("mission-fault")
        result = robot.run(drive_to_goal(Goal(x_m=STRAIGHT.goal_x_m, y_m=STRAIGHT.goal_y_m)))
    bench.advance(bench.time_s + 1.0)
    return result, bench


@pytest.mark.parametrize(
    ("fault", "words", "stops_within_s"),
    some_of(
        [
            ('encoder.left.b = "cut"', "left wheels do not turn", 1.1),
            ("encoder.left.glitches = 50_000", "an encoder signal is disturbed", 0.8),
            # The tyres hold the robot straight and drag the dead side along, until it would have to turn.
            ('motor.left = "dead"', "left wheels do not turn", 9.0),
            ('wheels.right = "blocked"', "a motor draws too much current; is something jammed", 0.8),
            ("host.hang = 1.0", "the board went silent|no command for 300 ms", 0.7),
            ('firmware = "reset"', "the board has restarted; check its supply and cable", 0.5),
            ('lidar = "unplugged"', "lidar .*check its cable", 1.6),
            ('board = "unplugged"', "port .* failed .*cable loose", 0.7),
            ('encoder.left.channels = "swapped"', "left encoder counts backwards; swap its two wires", 1.1),
            ('encoder.right.a = "stuck"', "right wheels do not turn", 1.1),
            ('motor.left = "swapped"', "left encoder counts backwards; .* or the motor's", 1.0),
            ('motor.right = "shorted"', "a motor draws too much current", 1.0),
            ("battery.charge = 0.01", "the battery is empty; charge it", 4.0),
            ("line.loss = 1.0", "the board went silent; its firmware stops the motors", 0.7),
            ('firmware = "hang"', "the board went silent|restarted", 1.0),
            ('firmware = "loop"', "restarted", 1.0),
        ],
        fast=8,
    ),
)
def test_robot_stops_in_time_and_reports_the_cause(
    tmp_path: Path, fault: str, words: str, stops_within_s: float
) -> None:
    result, bench = drive_with(fault, tmp_path)
    truth = bench.truth()
    before = truth[(truth[:, 0] > FAULT_S - 0.2) & (truth[:, 0] < FAULT_S), 4:6]
    assert before.min() > 1.0  # it was driving
    assert not result.reached
    assert re.search(words, result.reason), result.reason
    moving_s = truth[np.abs(truth[:, 4:6]).max(axis=1) > STATIONARY_RAD_S, 0]
    assert moving_s[-1] - FAULT_S < stops_within_s
    assert bench.contacts == 0


def test_encoder_glitches_do_not_affect_the_mission(tmp_path: Path) -> None:
    """1000 pulses per second, 1 to 10 us long: the decoder cancels each, and the robot reaches its goal."""
    result, bench = drive_with("encoder.left.glitches = 1000", tmp_path)
    assert result.reached
    x_m, y_m = bench.truth()[-1, 1:3]
    assert math.hypot(x_m - STRAIGHT.goal_x_m, y_m - STRAIGHT.goal_y_m) < 0.1
    assert bench.contacts == 0


def test_robot_reaches_the_goal_despite_slip(tmp_path: Path) -> None:
    """A third of the travel is lost on both sides, as on gravel: scan matching corrects the odometry."""
    result, bench = drive_with("slip.left = 0.33, slip.right = 0.33", tmp_path)
    assert result.reached
    x_m, y_m = bench.truth()[-1, 1:3]
    assert math.hypot(x_m - STRAIGHT.goal_x_m, y_m - STRAIGHT.goal_y_m) < 0.2
    assert bench.contacts == 0
