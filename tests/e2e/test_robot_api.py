"""The robot as an object: what the first lines of a student do, on the real firmware in simulation."""

import math
from pathlib import Path

import pytest

from thumper import Robot, ThumperError
from thumper.mapping.map_io import load_map
from thumper_hil.bench import Bench, simulation


def test_ten_lines_of_a_student(tmp_path: Path) -> None:
    with Robot("sim://") as robot:
        assert robot.pose.x_m == pytest.approx(0.0, abs=0.02)
        robot.drive(v_m_s=0.3, duration_s=1.5)
        assert robot.pose.x_m == pytest.approx(0.45, abs=0.12)
        assert robot.wheel_speeds.left_rad_s == robot.wheel_speeds.right_rad_s == 0.0
        result = robot.goto(0.6, -0.5)
        assert result.reached, result.reason
        assert math.hypot(robot.pose.x_m - 0.6, robot.pose.y_m + 0.5) < 0.12
        assert robot.battery_V > 7.0
        assert robot.scan.ranges_m.size == 682
        saved = load_map(robot.save_map(tmp_path / "lab"))
    assert (saved.cells >= 65).sum() > 100
    with Robot("sim://?world=lab&x_m=0.6&y_m=-0.4&yaw_deg=90", session=tmp_path / "lab.session") as robot:
        assert math.hypot(robot.pose.x_m - 0.6, robot.pose.y_m + 0.4) < 0.1
        assert (robot.map.cells >= 0).sum() >= (saved.cells >= 0).sum()


def test_a_turn_to_the_left_is_positive() -> None:
    with Robot("sim://?world=hall") as robot:
        robot.drive(w_rad_s=0.8, duration_s=1.5)
        assert 0.6 < robot.pose.theta_rad < 1.8


def test_motors_are_off_after_an_error_in_the_script() -> None:
    benches: list[Bench] = []

    def script() -> None:
        with Robot("sim://api_error/board?world=hall", lidar="sim://api_error/lidar") as robot:
            benches.append(simulation("api_error"))
            robot.drive(v_m_s=0.3, duration_s=0.5)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        script()
    left_rad_s, right_rad_s = benches[0].truth()[-1, 4:6]
    assert left_rad_s == pytest.approx(0.0, abs=0.2)
    assert right_rad_s == pytest.approx(0.0, abs=0.2)


def test_a_goal_out_of_reach_is_refused_before_anything_moves() -> None:
    with Robot("sim://") as robot, pytest.raises(ThumperError, match="50 m"):
        robot.goto(60.0, 0.0)


def test_numbers_that_cannot_be() -> None:
    with Robot("sim://") as robot:
        with pytest.raises(ThumperError, match="finite"):
            robot.drive(v_m_s=math.nan)
        with pytest.raises(ThumperError, match="too fast"):
            robot.drive(v_m_s=9.0)
        with pytest.raises(ThumperError, match="finite"):
            robot.goto(math.nan, 0.0)


def test_a_robot_that_is_not_open_says_how_to_open_it() -> None:
    with pytest.raises(ThumperError, match="with Robot"):
        Robot("sim://").drive(v_m_s=0.1)
