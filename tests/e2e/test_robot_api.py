"""The `Robot` class, as a first script uses it, with the real firmware in simulation."""

import logging
import math
import re
import subprocess
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numba
import numpy as np
import pytest

from tests.e2e.robot_square import LIMIT_DEG, LIMIT_M, square
from tests.variants import some_of
from thumper import NotThereError, Robot, ThumperError, UsageError
from thumper.board.messages import State
from thumper.common.compile_progress import COMPILING
from thumper.common.geometry import Pose2
from thumper.maps.annotations import Annotations, SavedPlace, annotations_path, save_annotations
from thumper.maps.map_server_io import load_map
from thumper.robot import arguments
from thumper.runtime.requests import RobotCommand
from thumper_hil.bench import Bench, simulation


@pytest.fixture(scope="module")
def lab() -> Iterator[Robot]:
    with Robot("sim://") as robot:
        yield robot


def test_a_first_script(tmp_path: Path) -> None:
    with Robot("sim://") as robot:
        assert robot.pose.x_m == pytest.approx(0.0, abs=0.02)
        robot.drive(v_m_s=0.3, duration_s=1.5)
        assert robot.pose.x_m == pytest.approx(0.45, abs=0.12)
        assert robot.wheel_speeds.left_rad_s == robot.wheel_speeds.right_rad_s == 0.0
        assert robot.telemetry.state is State.DISARMED
        result = robot.goto(0.6, -0.5)
        assert result.reached, result.reason
        assert robot.telemetry.state is State.DISARMED
        assert math.hypot(robot.pose.x_m - 0.6, robot.pose.y_m + 0.5) < 0.12
        assert robot.battery_V > 7.0
        assert robot.scan.ranges_m.size == 682
        saved = load_map(robot.save_map(tmp_path / "lab"))
    assert (saved.cells >= 65).sum() > 100
    with Robot("sim://?world=lab&x_m=0.6&y_m=-0.4&yaw_deg=90", session=tmp_path / "lab.session") as robot:
        assert math.hypot(robot.pose.x_m - 0.6, robot.pose.y_m + 0.4) < 0.1
        assert (robot.map.cells >= 0).sum() >= (saved.cells >= 0).sum()


def test_a_line_says_that_kernels_are_compiled(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextmanager
    def compiled(*_: object, **__: object) -> Iterator[None]:
        numba.njit(lambda x: x + 1)(1)
        raise ThumperError("no board")
        yield

    monkeypatch.setattr("thumper.robot.robot.open_robot", compiled)
    with pytest.raises(ThumperError), Robot("sim://"):
        pass
    assert capsys.readouterr() == ("", f"{COMPILING}\n")


@pytest.mark.parametrize(
    ("board", "kind"), [("sim://?world=hal", UsageError), ("/dev/ttyNONE0", NotThereError)]
)
def test_an_error_of_a_call_has_a_kind_and_a_short_traceback(board: str, kind: type[ThumperError]) -> None:
    with pytest.raises(kind) as raised:
        Robot(board)
    lines = traceback.format_exception(raised.value)
    assert lines.count("Traceback (most recent call last):\n") == 1
    assert len(lines) == 4  # that heading, the script, the call, the message


def test_a_left_turn_is_positive() -> None:
    with Robot("sim://?world=hall") as robot:
        robot.drive(w_rad_s=0.8, duration_s=1.5)
        assert 0.6 < robot.pose.theta_rad < 1.8


@pytest.mark.parametrize(("world", "seed"), some_of([("hall", 14), ("lab", 8)]))
def test_a_square_of_forward_and_turn_is_closed(world: str, seed: int) -> None:
    off_m, off_deg = square(world, seed)
    assert off_m < LIMIT_M
    assert off_deg < LIMIT_DEG


@pytest.mark.parametrize(
    ("deg", "meant"),
    [(1.57, "For 90 "), (-math.pi, "For -180 "), (0.79, "For 45 "), (90, ""), (1, ""), (5.5, "")],
)
def test_degrees_that_look_like_radians_are_reported(deg: float, meant: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        assert arguments.angle_rad("turn", (), None, deg, "") == math.radians(deg)
        arguments.heading_rad("goto", (), None, deg)
    assert [warning.filename for warning in caught] == [__file__] * (2 if meant else 0)
    assert all(meant in str(warning.message) for warning in caught)


def test_neither_backs_into_what_it_saw_nor_over_what_it_never_saw(tmp_path: Path) -> None:
    """A leg ahead is behind the robot after half a turn. Behind and beside it at the start, others stand."""
    world = tmp_path / "legs.toml"
    legs = ((0.75, 0.0), (-0.36, 0.0), (-0.18, 0.21))
    world.write_text(
        'description = "legs"\n[[wall]]\nclosed = true\npoints_m = [[-3,-3],[3,-3],[3,3],[-3,3]]\n'
        + "".join(f"[[circle]]\nx_m = {x_m}\ny_m = {y_m}\nradius_m = 0.02\n" for x_m, y_m in legs)
    )
    with Robot(f"sim://api_legs/board?world={world}", lidar="sim://api_legs/lidar") as robot:
        back = robot.forward(-0.4)
        assert not back.reached
        assert "never seen" in back.reason
        assert back.reason.endswith("; turn and look there first, or pass unseen=True")
        turn = robot.turn(deg=-90)
        assert turn.reason.endswith("; call forward(0.4) first, or pass unseen=True")
        assert robot.forward(0.35).reached
        assert robot.turn(deg=180).reached
        seen = robot.forward(-0.6)
        assert seen.reason.startswith("stopped before an obstacle")
        assert simulation("api_legs").contacts == 0


def test_forward_stops_before_a_wall() -> None:
    with Robot("sim://api_wall/board?world=lab", lidar="sim://api_wall/lidar") as robot:
        result = robot.forward(8.0, v_m_s=0.4)
        assert not result.reached
        assert "stopped before an obstacle" in result.reason
        assert result.path_length_m > 1.0
        assert simulation("api_wall").contacts == 0
        assert robot.telemetry.state is State.DISARMED


def test_the_first_logged_pose_is_the_start() -> None:
    start = Pose2(x_m=3.0, y_m=-2.0, theta_rad=1.0)
    with Robot("sim://", start=start) as robot:
        robot.wait(0.5)
        distances_m = np.hypot(*(robot.log.poses[:, 1:3] - (start.x_m, start.y_m)).T)
    assert distances_m.max() < 0.05


def test_patrol_drives_all_rounds_and_logs_every_pose() -> None:
    with Robot("sim://") as robot:
        result = robot.patrol(
            [(0.4, 0.0), {"x_m": 0.4, "y_m": -0.4, "heading_deg": 90}], rounds=2, wait_s=3.0
        )
        assert result.reached, result.reason
        stationary = np.abs(robot.log.speeds[:, 1:7]).max(axis=1) < 0.01
        stops, starts = (np.flatnonzero(np.diff(stationary.astype(int)) == sign) for sign in (1, -1))
        waits_s = robot.log.speeds[starts[1:], 0] - robot.log.speeds[stops[:3], 0]
        assert len(starts) == 4
        assert (waits_s > 2.9).all()
        assert 1.0 < result.path_length_m < 3.0
        assert robot.pose.theta_rad == pytest.approx(1.57, abs=0.3)
        robot.drive(v_m_s=0.1, duration_s=1.0)
        poses, speeds = robot.log.poses, robot.log.speeds
    assert poses[-1, 0] - poses[0, 0] == pytest.approx(speeds[-1, 0] - speeds[0, 0], abs=0.5)


def test_explore_maps_what_was_hidden_and_comes_back(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "thumper.robot")
    with Robot("sim://?world=lab_box&x_m=2.05&y_m=0.64&yaw_deg=-147") as robot:
        before = (robot.map.cells >= 0).sum()
        result = robot.explore(minutes=3.0)
        assert result.reached, result.reason
        assert math.hypot(robot.pose.x_m, robot.pose.y_m) < 0.2
        assert (robot.map.cells >= 0).sum() > 1.1 * before
    assert result.reason.startswith("explored after")
    assert result.reason.endswith("; back at the start")
    assert capsys.readouterr().out == ""  # like `goto`
    lines = [record.getMessage() for record in caplog.records if record.name == "thumper.robot"]
    assert "exploring: frontier 1" in lines
    assert lines[-1].startswith("exploring: home: at the goal")


def test_a_saved_map_stays_as_it_is(tmp_path: Path, lab: Robot) -> None:
    path = lab.save_map(tmp_path / "lab")
    with Robot("sim://?x_m=0.3&y_m=0.1", map=path) as robot:
        assert math.hypot(robot.pose.x_m - 0.3, robot.pose.y_m - 0.1) < 0.1
        robot.forward(0.2)
        np.testing.assert_array_equal(robot.map.cells, load_map(path).cells)


def test_saved_places_are_goals_by_their_names(tmp_path: Path, lab: Robot) -> None:
    path = lab.save_map(tmp_path / "lab")
    places = (
        SavedPlace(name="kitchen", x_m=0.5, y_m=0.0, yaw_rad=math.pi / 2),
        SavedPlace(name="hall", x_m=0.2, y_m=0.0),
    )
    save_annotations(Annotations(places=places), annotations_path(path))
    with Robot("sim://", map=path) as robot:
        result = robot.goto("Kitchen")
        assert result.reached, result.reason
        assert robot.pose.distance_m(Pose2(x_m=0.5)) < 0.12
        assert robot.pose.heading_deg == pytest.approx(90.0, abs=15.0)
        assert robot.goto("kitchen", heading_deg=0).reached
        assert robot.pose.heading_deg == pytest.approx(0.0, abs=15.0)
        assert robot.patrol(["hall", (0.4, 0.0)]).reached
        with pytest.raises(ThumperError, match=r"goto: no place 'kitchn' .*; did you mean 'kitchen'\?"):
            robot.goto("kitchn")
        with pytest.raises(ThumperError, match=r"goto: no place 'garage' .* choose from: kitchen, hall"):
            robot.goto("garage")


def test_stop_ends_a_call_of_another_thread_and_no_later_one() -> None:
    with Robot("sim://?world=hall") as robot:
        robot.stop()  # nothing moves
        threading.Timer(0.2, robot.stop).start()
        result = robot.patrol([(0.4, 0.0), (0.0, 0.0)], rounds=1000, wait_s=10.0)
        assert (result.reached, result.interrupted) == (False, True)
        assert result.reason.endswith("cancelled")
        assert robot.telemetry.state is State.DISARMED
        robot._loop.request_queue.put(RobotCommand(name="cancel"))  # came just after the end of the call
        assert robot.goto(0.2, 0.0).reached


def test_a_wrong_attribute_names_the_right_one(lab: Robot) -> None:
    for name, right in (
        ("x_m", "pose.x_m"),
        ("battery", "battery_V"),
        ("ranges", "scan.ranges_m"),
        ("backward", r"forward\(-0.3\)"),
    ):
        with pytest.raises(AttributeError, match=f"^Robot has no '{name}'; use {right}$"):
            getattr(lab, name)


def test_a_plot_is_a_picture(tmp_path: Path, lab: Robot) -> None:
    figure = lab.plot()
    assert figure.png()[:4] == b"\x89PNG"
    figure.savefig(tmp_path / "map.png")
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()][-1] == "newest scan"


def test_the_robot_and_its_results_are_short_in_a_notebook(lab: Robot) -> None:
    assert re.fullmatch(
        r"<Robot sim://robot\d+ at \(-?0\.\d+ m, -?0\.\d+ m, -?\d+°\), 7\.\d V, disarmed>", repr(lab)
    )
    assert repr(Robot("sim://")).endswith("not open>")
    assert re.fullmatch(
        r"<Telemetry: DISARMED, left 0\.00 rad/s, right 0\.00 rad/s, 7\.\d V>", repr(lab.telemetry)
    )
    with Robot("sim://") as robot:
        assert re.fullmatch(
            r"<reached: turned \d+ degrees; path 0\.\d+ m, \d\.\d s>", repr(robot.turn(deg=20, unseen=True))
        )


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


def test_each_result_has_the_time_and_length_of_its_drive() -> None:
    with Robot("sim://?world=hall") as robot:
        first, second = robot.goto(0.8, 0.0), robot.goto(0.4, 0.0)
        for result, way_m in ((first, 0.8), (second, 0.4)):
            assert result.reached, result.reason
            assert way_m - 0.15 < result.path_length_m < way_m + 0.15
        poses = robot.log.poses
    assert poses[-1, 0] - poses[0, 0] > second.time_s


@pytest.mark.parametrize(
    ("call", "why"),
    [
        (lambda robot: robot.drive(v_m_s=math.nan, duration_s=1.0), "finite"),
        (lambda robot: robot.drive(v_m_s=9.0, duration_s=1.0), r"drive: v_m_s: choose -.*m/s \(\[service\]"),
        (lambda robot: robot.drive(v_m_s=0.1, duration_s=0.0), "drive: duration_s: choose more than 0"),
        (lambda robot: robot.goto(math.nan, 0.0), "goto: x_m: nan is not a finite number"),
        (lambda robot: robot.goto(0.5, 0.0, heading_rad=math.inf), "goto: heading_rad: inf is not a finite"),
        (lambda robot: robot.goto(0.5, 0.0, tolerance_m=0.0), r"0\.02\.\.\.1 m"),
        (
            lambda robot: robot.drive(v_m_s=cast("float", "a"), duration_s=1.0),
            "drive: v_m_s: 'a' is not a number",
        ),
        (
            lambda robot: robot.drive(duration_s=cast("float", None)),
            "drive: duration_s: None is not a number",
        ),
        (lambda robot: robot.goto(cast("float", "a"), 0.0), "goto: x_m: 'a' is not a number"),
        (lambda robot: robot.wait(cast("float", "a")), "wait: duration_s: 'a' is not a number"),
        (lambda robot: robot.save_map("x\0"), "save_map: path: .* is not a file path"),
        (lambda robot: robot.save_map(""), "save_map: path: '' is not a file path"),
        (lambda robot: robot.forward(cast("float", "1")), "forward: distance_m: '1' is not a number"),
        (lambda robot: robot.forward(0.0), "forward: distance_m: choose other than 0"),
        (lambda robot: robot.forward(1.0, v_m_s=3.0), "forward: v_m_s: choose more than 0 and up to"),
        (lambda robot: robot.forward(1.0, v_m_s=-0.1), "v_m_s: choose more than 0"),
        (lambda robot: robot.turn(5), r"turn: 5: degrees or radians\? Pass deg=5 or rad=5"),
        (lambda robot: robot.turn(rad=90), "turn: rad: 90 is more than a turn; pass deg=90"),
        (lambda robot: robot.goto(0.5, 0.0, heading_deg=400), "heading_deg: choose -360 to 360 degrees"),
        (lambda robot: robot.turn(), "turn: deg, rad: choose other than 0"),
        (lambda robot: robot.turn(rad=1.0, deg=90), "turn: rad, deg: pass only one"),
        (lambda robot: robot.goto(0.5, 0.0, 90), "Pass heading_deg=90 or heading_rad=90"),
        (lambda robot: robot.goto(0.5, 0.0, heading_rad=90), "pass heading_deg=90"),
        (lambda robot: robot.goto(0.5), "goto: y_m: is missing; pass x_m and y_m, or the name of a place"),
        (lambda robot: robot.goto(cast("Any", None)), "goto: the goal: None is no place; pass a saved name"),
        (lambda robot: robot.goto((0.5, 0.0, 90)), "goto: heading_rad: 90 is more than a turn"),
        (lambda robot: robot.goto("kitchen"), "goto: 'kitchen': this map has no saved places; pass the map="),
        (
            lambda robot: cast("Any", robot).goto(0.5, 0.0, heading=90),
            r"goto: got an unexpected keyword argument 'heading'; call goto\(x_m, y_m=None, \*, heading_rad=",
        ),
        (
            lambda robot: cast("Any", robot).drive(0.2),
            r"drive: too many positional .*; call drive\(\*",
        ),
        (lambda robot: robot.show(), "not a notebook"),
        (lambda robot: robot.goto(0.5, 0.0, heading_rad=1.0, heading_deg=90), "pass only one"),
        (lambda robot: robot.patrol([]), "patrol: places: pass at least one"),
        (lambda robot: robot.patrol(cast("Any", [1.0, 2.0])), "patrol: places: 1.0 is no place"),
        (lambda robot: robot.patrol([{"x_m": 0.5}]), "is no place"),
        (lambda robot: robot.patrol([{"x_m": 0.5, "y_m": 0.0, "yaw_deg": 9.0}]), "is no place"),
        (lambda robot: robot.patrol([(0.5, 0.0)], rounds=0), "patrol: rounds: choose 1 or more"),
        (lambda robot: robot.patrol([(0.5, 0.0, 90)]), "pass heading_deg=90"),
        (lambda robot: robot.patrol(cast("Any", [(0.5, 0.0, 1.0, 1.0)])), "is no place"),
        (lambda robot: robot.patrol([(0.5, 0.0)], wait_s=-1.0), r"patrol: wait_s: choose 0\.\.\.3600 s"),
        (lambda robot: robot.explore(minutes=-1.0), "explore: minutes: choose more than 0"),
        (lambda robot: robot.wait(0.0), "more than 0 and up to 600 s"),
        (lambda robot: robot.wait(-1.0), "wait: duration_s: choose more than 0"),
        (lambda robot: robot.wait(math.nan), "wait: duration_s: nan is not a finite"),
        (lambda robot: robot.wait(math.inf), "wait: duration_s: inf is not a finite"),
    ],
)
def test_invalid_numbers(call: Callable[[Robot], object], why: str, lab: Robot) -> None:
    with pytest.raises(ThumperError, match=why):
        call(lab)


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"port": "sim://"}, r"Robot: .* argument 'port'; call Robot\(board='', \*, lidar="),
        ({"board": None}, "Robot: board, lidar: pass names of ports"),
        ({"board": "/dev/ttyNONE9"}, "there is no such port; is it plugged in?"),
        ({"board": "sim://?world=hal"}, "did you mean 'hall'?"),
        ({"board": "sim://", "config": "x\0"}, "Robot: config: .* is not a file path"),
        ({"board": "sim://", "session": 3}, "Robot: session: 3 is not a file path"),
        ({"board": "sim://", "map": "a.yaml", "session": "a.session"}, "pass only one"),
        ({"board": "sim://", "start": (1, 2, 0)}, "Pose2"),
        ({"board": "sim://", "start": Pose2(x_m=1e300)}, "farther than 1000 m"),
        ({"board": "sim://", "lidar": "/dev/ttyACM9"}, "leave out /dev/ttyACM9"),
    ],
)
def test_invalid_arguments(arguments: dict[str, Any], why: str) -> None:
    with pytest.raises(ThumperError, match=why):
        Robot(**arguments)


def test_the_simulated_robot_has_the_configured_lidar(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[lidar]\nmodel = "ld19"\n')
    with Robot("sim://", config=config) as robot:
        assert robot.scan.range_max_m == 12.0


def test_a_dot_in_the_name_of_a_map_stays(tmp_path: Path, lab: Robot) -> None:
    assert lab.save_map(tmp_path / "map.v2") == tmp_path / "map.v2.yaml"
    assert lab.save_map(tmp_path / "other.yaml") == tmp_path / "other.yaml"
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{suffix}" for name in ("map.v2", "other") for suffix in ("yaml", "pgm", "session")
    }


@pytest.mark.slow
def test_a_pause_of_the_script_does_not_shorten_the_next_call(ports: tuple[Path, Path]) -> None:
    """On real ports, data arrives during the pause and waits."""
    with Robot(str(ports[0]), lidar=str(ports[1])) as robot:
        opened_s = robot.log.speeds[-1, 0]
        time.sleep(1.5)
        before_m = robot.pose.x_m
        assert robot.log.speeds[-1, 0] > opened_s + 1.0  # the call read what had waited
        time.sleep(1.5)
        robot.drive(v_m_s=0.2, duration_s=1.0)
        assert robot.pose.x_m == pytest.approx(before_m + 0.2, abs=0.06)
        driven_s = robot.log.speeds[-1, 0]
        time.sleep(0.8)
        robot.wait(0.6)
        assert robot.log.speeds[-1, 0] > driven_s + 1.3
        time.sleep(0.8)
        result = robot.goto(before_m, 0.0)
        assert result.reached, result.reason
        assert robot.telemetry.state is State.DISARMED


def test_a_closed_robot_explains_how_to_open_it() -> None:
    with pytest.raises(ThumperError, match="with Robot"):
        Robot("sim://").drive(v_m_s=0.1, duration_s=1.0)


def test_what_was_measured_stays_readable_after_the_end(tmp_path: Path) -> None:
    robot = Robot("sim://").open()
    with pytest.raises(ThumperError, match="open already"):
        robot.open()
    robot.forward(0.2)
    pose, rows = robot.pose, len(robot.log.speeds)
    robot.close()
    robot.close()
    assert robot.pose == pose
    assert len(robot.log.speeds) == rows
    assert robot.log.speeds[-1, robot.log.SPEED_COLUMNS.index("battery_V")] == pytest.approx(robot.battery_V)
    assert robot.save_map(tmp_path / "map").exists()
    assert "closed at (0.2" in repr(robot)
    with pytest.raises(ThumperError, match="not open"):
        robot.forward(0.2)


def test_python_ends_without_a_word_when_the_robot_was_left_open() -> None:
    script = "from thumper import Robot\nrobot = Robot('sim://').open()\nrobot.forward(0.1)"
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("lidar", "text"),
    [
        ("", None),
        ("upside_down = true", "lidar.upside_down = true"),
        ("yaw_deg = 180.0", "lidar.yaw_deg = 0"),
    ],
)
def test_a_wrongly_mounted_lidar_is_found_out(tmp_path: Path, lidar: str, text: str | None) -> None:
    """The lidar of the simulated robot is mounted upright and forward; the configuration says otherwise."""
    path = tmp_path / "robot.toml"
    path.write_text(f"[lidar]\n{lidar}\n")
    with Robot("sim://?world=lab", config=path) as robot:
        estimator = robot._loop.inputs.estimator
        for _ in range(8):
            robot.drive(v_m_s=0.25, w_rad_s=0.8, duration_s=3.0)
            robot.drive(v_m_s=-0.25, w_rad_s=-0.8, duration_s=3.0)
            if estimator.mount_check.done:
                break
        assert estimator.mount_check.done
        warning = estimator.warnings().get("MOUNT")
    assert warning is None if text is None else text in str(warning)
