"""Ramps: gravity along the heading, the pitch of the lidar, a drive through a door; and wrong ones."""

import math
from pathlib import Path

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.kinematics import WheelSpeeds
from thumper.config.robot import RobotConfig
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench import simulation
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.hardware import BASE_FROM_LASER
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.demo.missions import TOLERANCE_M
from thumper_hil.effects.pitch import SPRINGS
from thumper_hil.world.ramps import climb_rad
from thumper_hil.world.world import World

HALL = "[[wall]]\nclosed = true\npoints_m = [[-8, -3], [8, -3], [8, 3], [-8, 3]]\n"
RAMP = "[[ramp]]\nx_m = {x}\ny_m = 0\nlength_m = {length}\nwidth_m = 4\nrise_m = {rise}\n"


def hall(folder: Path, slope: float, length_m: float = 12.0) -> Path:
    """Write a hall whose floor rises along x; return the path."""
    path = folder / f"hall{slope:g}.toml"
    ramp = RAMP.format(x=0.0, length=length_m, rise=length_m * slope) if slope else ""
    path.write_text(HALL + ramp)
    return path


def currents_A(world: Path, yaw_deg: float) -> float:
    """Return the mean current of a side in a steady drive at 4 rad/s."""
    name = f"{world.stem}{yaw_deg:g}"
    board = Board.open(f"sim://{name}/board?world={world}&yaw_deg={yaw_deg}", baud=500_000)
    board.command(Command.ARM)
    samples = []
    for step in range(200):
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=4.0, right_rad_s=4.0))
        board.poll(0.02)
        if step > 100:
            samples.append(simulation(name).chip.truth().current_A)
    board.close()
    return float(np.mean(samples))


def test_the_motors_lift_the_weight(tmp_path: Path) -> None:
    params, slope = RobotParams.load(), 0.06
    force_N = params.body.mass_kg * 9.81 * math.sin(math.atan(slope))
    more_A = 0.5 * force_N * params.body.wheel_radius_m / params.motor.torque_Nm_A
    flat_A = currents_A(hall(tmp_path, 0.0), 0.0)
    sloped = hall(tmp_path, slope)
    assert flat_A == pytest.approx(1.33, abs=0.05)
    assert currents_A(sloped, 0.0) - flat_A == pytest.approx(more_A, rel=0.1)
    assert currents_A(sloped, 180.0) - flat_A == pytest.approx(-more_A, rel=0.1)
    assert currents_A(sloped, 90.0) == pytest.approx(flat_A, abs=0.1)


@pytest.mark.parametrize("seed", range(1, 6))
def test_with_its_motors_off_it_rolls_back_where_friction_lets_it(tmp_path: Path, seed: int) -> None:
    for slope, rolls in ((0.15, False), (0.17, True)):
        bench = Bench(BenchOptions(world=str(hall(tmp_path, slope)), seed=seed))
        bench.advance(2.0)
        x_m = bench.truth()[-1, 1]
        assert x_m < -0.05 if rolls else x_m == 0.0


def test_it_rolls_back_against_a_box_and_leans_on_it(tmp_path: Path) -> None:
    world = hall(tmp_path, 0.25)
    with world.open("a") as file:
        file.write("[[box]]\nx_m = -1.2\ny_m = 0\nlength_m = 0.2\nwidth_m = 1\n")
    bench = Bench(BenchOptions(world=str(world)))
    bench.advance(4.0)
    x_m, left_rad_s, right_rad_s = bench.truth()[-1, [1, 4, 5]]
    assert x_m == pytest.approx(-1.1 + 0.21, abs=0.02)
    assert left_rad_s == right_rad_s == 0.0
    assert bench.contacts == 1


def test_the_slope_changes_smoothly_over_the_wheel_base() -> None:
    ramp = np.array([[1.0, 0.0, 1.0, 0.8, 0.0, 0.06]])
    x_m = np.linspace(0.0, 2.0, 401)
    up_rad = np.array([climb_rad(Pose2(x_m=x), ramp) for x in x_m])
    assert up_rad[[0, -1]].tolist() == [0.0, 0.0]
    assert up_rad.max() == pytest.approx(math.atan(0.06))
    assert climb_rad(Pose2(x_m=0.5), ramp) == pytest.approx(math.atan(0.03))
    assert climb_rad(Pose2(x_m=1.5), ramp) == pytest.approx(math.atan(0.03))
    assert np.abs(np.diff(up_rad)).max() < 0.06 * 0.005 / 0.28 * 1.01
    down = Pose2(x_m=1.0, theta_rad=math.pi)
    assert climb_rad(down, ramp) == pytest.approx(-math.atan(0.06))
    assert climb_rad(Pose2(x_m=1.0, theta_rad=0.5 * math.pi), ramp) == pytest.approx(0.0, abs=1e-12)
    assert climb_rad(Pose2(x_m=1.0, y_m=0.5), ramp) == 0.0
    turned = np.array([[0.0, 1.0, 1.0, 0.8, 90.0, 0.06]])
    north = Pose2(y_m=1.0, theta_rad=0.5 * math.pi)
    assert climb_rad(north, turned) == pytest.approx(math.atan(0.06))


@pytest.mark.parametrize("uphill", [True, False])
def test_the_lidar_pitches_with_the_floor(tmp_path: Path, uphill: bool) -> None:
    yaw_deg, name = (0.0, "up") if uphill else (180.0, "down")
    port = f"sim://{name}/lidar?world={hall(tmp_path, 0.06, length_m=4.0)}&lidar=ld19&yaw_deg={yaw_deg}"
    lidar = open_lidar(LidarOptions(port=port, model="ld19"))
    lidar.wait_for_sample(1.0)
    scan = lidar.wait_for_sample(1.0)
    lidar.close()
    turned_rad = np.abs(np.remainder(scan.angles_rad() + math.pi, math.tau) - math.pi)
    ahead_m = np.median(scan.ranges_m[turned_rad < 0.03])
    behind_m = np.median(scan.ranges_m[turned_rad > math.pi - 0.03])
    floor_m = 2.0 + SPRINGS.lidar_height_m / 0.06  # along the ramp, then down to the level floor behind it
    floor_m += BASE_FROM_LASER.x_m if uphill else -BASE_FROM_LASER.x_m
    assert (behind_m if uphill else ahead_m) == pytest.approx(floor_m, rel=0.02)
    assert (ahead_m if uphill else behind_m) > 7.5  # the wall
    beside_m = np.median(scan.ranges_m[np.abs(turned_rad - 0.5 * math.pi) < 0.03])
    assert beside_m == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("preset", [pytest.param("nominal", marks=pytest.mark.slow), "hard"])
def test_the_robot_drives_up_a_door_ramp_and_down_again(preset: str) -> None:
    name = f"ramp_{preset}"
    config = RobotConfig(
        board=BoardOptions(port=f"sim://{name}/board?world=ramp&preset={preset}"),
        lidar=LidarOptions(port=f"sim://{name}/lidar"),
    )
    climbs_rad, currents_A = [], []
    with open_robot(config, Pose2()) as robot:
        bench = simulation(name)

        def look() -> None:
            truth = bench.chip.truth()
            climbs_rad.append(climb_rad(truth.map_from_base, bench.world.ramps_m))
            currents_A.append(np.mean(truth.current_A))

        robot.after_cycle.append(look)
        for goal in (Goal(x_m=3.6, y_m=0.3), Goal(x_m=0.3, y_m=-0.3)):
            result = robot.run(drive_to_goal(goal))
            assert result.reached, result.reason
            x_m, y_m = bench.truth()[-1, 1:3]
            assert math.hypot(x_m - goal.x_m, y_m - goal.y_m) < TOLERANCE_M
    assert bench.contacts == 0
    climbs, currents = np.array(climbs_rad), np.array(currents_A)
    assert currents[climbs > 0.05].mean() > currents[climbs < -0.05].mean() + 0.5


@pytest.mark.parametrize(
    ("rise", "message"),
    [
        ("", r"ramp\[0\]\.rise_m: missing; give a number"),
        ("rise_m = 0", r"ramp\[0\]\.rise_m = 0\.0: must be above 0"),
        ("rise_m = 0.5", r"ramp\[0\]\.rise_m = 0\.5: must be at most 0\.3 of length_m, here 0\.3 m"),
        ("rise_m = 0.1\nheight_m = 1", r"unknown key ramp\[0\]\.height_m; choose from length_m"),
    ],
)
def test_a_wrong_ramp_is_refused_in_one_line(tmp_path: Path, rise: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(f"{HALL}[[ramp]]\nx_m = 0\ny_m = 0\nlength_m = 1\nwidth_m = 1\n{rise}\n")
    with pytest.raises(ThumperError, match=message) as error:
        World.load(path)
    assert "\n" not in str(error.value)


def test_a_world_keeps_the_ramps_of_its_base(tmp_path: Path) -> None:
    hall(tmp_path, 0.05)
    path = tmp_path / "more.toml"
    path.write_text('base = "hall0.05"\n' + RAMP.format(x=7.0, length=1.0, rise=0.06))
    assert World.load(path).ramps_m == pytest.approx(np.array([[0, 0, 12, 4, 0, 0.6], [7, 0, 1, 4, 0, 0.06]]))
