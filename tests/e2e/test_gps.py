"""Outdoors with GPS: the start in a saved map, a goal on Earth, the datum of a new map."""

import json
import math
import re
import signal
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port
from typer.testing import CliRunner

from tests.e2e.conftest import THUMPER
from tests.e2e.service import Service
from thumper.cli.app import build_app
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig, with_ports
from thumper.gps.earth_reference import MapDatum
from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane
from thumper.gps.options import GpsOptions
from thumper.imu.options import ImuOptions
from thumper.maps.map_server_io import load_datum, load_map, save_map
from thumper.maps.occupancy_grid import UNKNOWN
from thumper.navigation.goal import Goal
from thumper.ros.codec import Message
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.requests import RobotCommand
from thumper_hil.bench import simulation
from thumper_hil.sensors.gnss_receiver import DATUM
from thumper_hil.world.world import World

YARD_DATUM = MapDatum(*DATUM, 0.0)
IN_THE_EAST_SHED = "world=yard&x_m=8.0&y_m=0.2&yaw_deg=-70"
GOAL_M = (7.5, -7.0)  # on open ground: the lidar reaches no wall


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    path = tmp_path / "yard.yaml"
    save_map(World.load("yard").to_grid(), path, YARD_DATUM)
    return path


def test_a_robot_finds_its_start_among_equal_sheds_and_a_goal_on_earth(yard: Path, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("[gps]\nenabled = true\n")
    goal = LocalPlane(DATUM).to_earth(EastNorth(*GOAL_M))
    board = f"sim://shed/board?{IN_THE_EAST_SHED}&gps=rtk&gps_Hz=5"
    command = ["run", "--board", board, "--lidar", "sim://shed/lidar", "--map", str(yard), "--config"]
    command += [str(tmp_path / "robot.toml"), "--out", str(tmp_path / "out")]
    command += ["--goal-gps", repr(goal.latitude_deg), repr(goal.longitude_deg)]
    done = CliRunner().invoke(build_app(), command)
    assert done.exit_code == 0, done.output
    at = simulation("shed").truth()[-1, 1:3]
    assert math.dist(at, GOAL_M) < 0.3
    assert simulation("shed").contacts == 0
    assert load_datum(tmp_path / "out" / "map.yaml") == pytest.approx(YARD_DATUM, abs=1e-9)


@pytest.mark.slow
def test_a_place_far_from_the_fix_is_not_taken_for_the_start(tmp_path: Path) -> None:
    """Of two equal sheds the map has only the other one."""
    grid = World.load("yard").to_grid()
    cells = grid.cells.copy()
    cells[:, : cells.shape[1] // 2] = UNKNOWN
    (tmp_path / "robot.toml").write_text("[gps]\nenabled = true\n")
    save_map(replace(grid, cells=cells), tmp_path / "east.yaml", YARD_DATUM)
    board = "sim://west/board?world=yard&x_m=-8.0&y_m=0.2&yaw_deg=-70&gps=rtk&gps_Hz=5"
    command = ["run", "--board", board, "--lidar", "sim://west/lidar", "--map", str(tmp_path / "east.yaml")]
    command += ["--config", str(tmp_path / "robot.toml"), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(build_app(), [*command, "--goal", "7.5", "-4"])
    assert done.exit_code == 1, done.output
    lost = r"the GPS is at \(-[78]\.\d+, 0\.\d+\) in the map, and no place within 2 m of it fits the scan"
    assert re.search(lost, str(done.exception))
    assert simulation("west").truth()[-1, 1:3] == pytest.approx((-8.0, 0.2), abs=0.01)


def test_a_start_far_from_the_fix_is_reported(yard: Path) -> None:
    config = RobotConfig(gps=GpsOptions(enabled=True))
    board = f"sim://wrong/board?{IN_THE_EAST_SHED}&gps=rtk"
    config = with_ports(config, board=board, lidar="sim://wrong/lidar")
    other_shed = Pose2(x_m=-8.0, y_m=0.2, theta_rad=math.radians(-70.0))
    with open_robot(config, other_shed, load_map(yard), datum=YARD_DATUM) as robot:
        while robot.inputs.now_s() < 25.0:
            robot.step()
            assert "GPS" not in robot.inputs.estimator.warnings() or robot.inputs.now_s() > 10.0
        assert re.search(
            r"the GPS is at \([78]\.\d+, 0\.\d+\) in the map, 16\.\d m from the robot's pose",
            robot.inputs.estimator.warnings()["GPS"],
        )


@pytest.mark.slow
def test_a_run_too_short_for_the_place_on_earth_says_so(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("[gps]\nenabled = true\n")
    board = f"sim://short/board?{IN_THE_EAST_SHED}&gps=rtk"
    command = ["run", "--board", board, "--lidar", "sim://short/lidar", "--goal", "0.3", "0"]
    command += ["--config", str(tmp_path / "robot.toml"), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(build_app(), command)
    assert done.exit_code == 0, done.output
    assert "the place of the map on Earth is unknown" in done.output
    assert load_datum(tmp_path / "out" / "map.yaml") is None


def test_a_run_without_a_receiver_says_nothing_of_it(tmp_path: Path) -> None:
    command = ["run", "--board", "sim://none/board?world=lab", "--lidar", "sim://none/lidar"]
    done = CliRunner().invoke(build_app(), [*command, "--goal", "0.3", "0", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "Earth" not in done.output


@pytest.mark.parametrize("start", [Pose2(), None])
def test_waiting_for_the_receiver_costs_no_scan(start: Pose2 | None) -> None:
    config = RobotConfig(gps=GpsOptions(enabled=True))
    config = with_ports(config, board="sim://wait/board", lidar="sim://wait/lidar")
    with open_robot(config, start, World.load("lab").to_grid(), datum=YARD_DATUM) as loop:
        for _ in range(5):
            loop.step()
        assert loop.inputs.estimator.scan_checker.counts == {}
        assert len(loop.inputs.samples) == 1  # nothing old waits in the ports


def test_without_a_datum_a_goal_on_earth_is_refused(tmp_path: Path) -> None:
    save_map(World.load("yard").to_grid(), tmp_path / "plain.yaml")
    command = ["run", "--map", str(tmp_path / "plain.yaml"), "--goal-gps", "48.0", "11.0"]
    done = CliRunner().invoke(build_app(), command)
    assert isinstance(done.exception, ThumperError)
    assert done.exception.exit_code == 2
    assert "--goal-gps needs a --map whose YAML has a datum" in str(done.exception)


@pytest.mark.parametrize("command", [["goto", "--gps"], ["run", "--goal-gps"]])
def test_a_place_that_is_not_on_earth_is_a_usage_error(command: list[str]) -> None:
    done = CliRunner().invoke(build_app(), [*command, "95.0", "11.0"])
    assert isinstance(done.exception, ThumperError)
    assert done.exception.exit_code == 2
    assert "latitude is -90...90 degrees" in str(done.exception)


def test_a_running_robot_without_a_receiver_drives_to_a_place_on_earth(tmp_path: Path) -> None:
    save_map(World.load("lab").to_grid(), tmp_path / "other.yaml", MapDatum(-33.0, 151.0, 0.0))
    config = RobotConfig(recording=RecordingOptions(folder=str(tmp_path)))
    config = with_ports(config, board="sim://blind/board?world=lab", lidar="sim://blind/lidar")
    with open_robot(
        config, Pose2(), World.load("lab").to_grid(), datum=MapDatum(*DATUM, math.pi / 2)
    ) as robot:
        service = Service(robot, simulation("blind"))
        robot.wait_for_map()
        at_m = LocalPlane(DATUM).to_earth(EastNorth(0.0, 0.5))._asdict()  # half a metre north: along x
        service.ask("mission/send", {**at_m, "tolerance_m": 0.05})
        service.until(lambda: service.ask("mission/state")["state"] == "reached", max_cycles=100)
        assert math.dist(service.bench.truth()[-1, 1:3], (0.5, 0.0)) < 0.1
        service.put(RobotCommand(name="cancel"))
        service.until(lambda: service.mode == "idle")
        assert service.ask("library/load", {"name": "other"})["ok"]
        assert "km from the map's origin" in service.ask("mission/send", at_m)["error"]


@pytest.mark.slow
def test_goto_sends_a_running_robot_to_a_place_on_earth(
    thumper: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    save_map(World.load("lab").to_grid(), tmp_path / "lab.yaml", MapDatum(*DATUM, math.pi / 2))
    address = f"127.0.0.1:{free_port()}"
    board = "sim://earth/board?world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"
    command = [str(THUMPER), "run", "--board", board, "--lidar", "sim://earth/lidar", "--bus", address]
    command += ["--map", str(tmp_path / "lab.yaml"), "--out", str(tmp_path / "out"), "--speed", "2"]
    process = subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert "is running on" in process.stdout.readline()
        goal = LocalPlane(DATUM).to_earth(EastNorth(-0.08, 1.23))  # the map's x axis points north
        done = thumper("goto", "--bus", address, "--gps", *map(repr, goal))
        assert done.returncode == 0, done.stderr
        assert "at the goal (1.23, 0.08)" in done.stdout
        watched = thumper("watch", "pose", "--count", "1", "--json", "--bus", address)
        at = json.loads(watched.stdout)["pose"]["pose"]["position"]
        assert math.dist((at["x"], at["y"]), (1.23, 0.08)) < 0.15
        shown = thumper("status", "--bus", address).stdout
        assert "\nearth    the map's origin is at 48.262500 11.668000, its x axis 90 degrees from" in shown
        watch = [*END_WITH_PARENT, str(THUMPER), "watch", "gps_odom", "--bus", address]
        with subprocess.Popen(watch, stderr=subprocess.PIPE, text=True) as watching:
            assert watching.stderr is not None
            assert "no messages on gps_odom yet: it has no GPS ([gps] enab" in watching.stderr.readline()
            watching.send_signal(signal.SIGINT)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)
    assert process.returncode == 0


def test_a_new_map_knows_its_place_on_earth(tmp_path: Path) -> None:
    start = Pose2(x_m=8.0, y_m=0.2, theta_rad=math.radians(-70.0))  # of the map, in the world
    config = with_ports(
        RobotConfig(gps=GpsOptions(enabled=True)),
        board=f"sim://survey/board?{IN_THE_EAST_SHED}&gps=rtk&gps_Hz=5",
        lidar="sim://survey/lidar",
    )
    published_m: list[tuple[float, ...]] = []

    def keep(topic: str, _time_s: float, message: Message) -> None:
        if topic == "gps_odom":
            at = message.pose.pose.position
            seen = robot.inputs.estimator.state()
            assert seen is not None
            antenna = seen.map_from_base @ config.gps.base_from_antenna
            published_m.append((at.x - antenna.x_m, at.y - antenna.y_m, message.pose.covariance[0]))

    with open_robot(config, None) as robot:
        robot.publisher.add_sink(keep)
        while simulation("survey").time_s < 13.0:  # until the ambiguities are resolved
            robot.step()
        assert not published_m  # the map's direction on Earth is not known before the robot moves
        assert robot.run(drive_to_goal(Goal(x_m=2.5, y_m=0.0))).reached
        datum = robot.inputs.estimator.map_datum()
    assert len(published_m) > 5
    for dx_m, dy_m, variance_m2 in published_m[-5:]:
        assert math.hypot(dx_m, dy_m) < 0.2
        assert 0.0 < variance_m2 < 0.05**2
    assert datum is not None
    origin = LocalPlane(DATUM).to_earth(EastNorth(start.x_m, start.y_m))
    assert math.hypot(*LocalPlane(origin).to_plane(LatLon(*datum[:2]))) < 0.15
    assert datum.yaw_rad == pytest.approx(start.theta_rad, abs=0.1)


@pytest.mark.slow
def test_on_open_ground_the_map_and_goals_find_their_place_on_earth() -> None:
    """The lidar reaches nothing from the start: neither goals behind it nor the datum need a wall there."""
    config = with_ports(
        RobotConfig(gps=GpsOptions(enabled=True), imu=ImuOptions(enabled=True)),
        board="sim://open/board?world=yard&gps=rtk&gps_Hz=5&seed=3",
        lidar="sim://open/lidar",
    )
    target_m = (0.0, 4.0)
    with open_robot(config, None) as robot:
        while simulation("open").time_s < 13.0:  # until the ambiguities are resolved
            robot.step()
        for goal in (Goal(x_m=-2.0, y_m=0.5), Goal(x_m=2.0, y_m=1.5)):
            assert robot.run(drive_to_goal(goal)).reached
        datum = robot.inputs.estimator.map_datum()
        assert datum is not None
        assert datum.yaw_rad == pytest.approx(0.0, abs=0.06)
        x_m, y_m = datum.to_map(LocalPlane(DATUM).to_earth(EastNorth(*target_m)))
        assert robot.run(drive_to_goal(Goal(x_m=x_m, y_m=y_m, tolerance_m=0.05))).reached
    assert math.dist(simulation("open").truth()[-1, 1:3], target_m) < 0.2
