"""The thesis's experiments and the calibration, on synthetic drives and on the simulated robot."""

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

from tests.variants import some_of
from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.config.robot import load_config
from thumper.odometry.wheel_odometry import advance
from thumper_tuning.calibration.course import CourseOptions, course
from thumper_tuning.calibration.odometry_fit import fit_geometry, odometry_drift
from thumper_tuning.calibration.speed_tracking import quantization_std_rad_s, run_speed_experiment
from thumper_tuning.calibration.wheel_log import (
    COUNT_COLUMNS,
    POSE_COLUMNS,
    WheelLog,
    join_counts_and_poses,
    write_csv,
)
from thumper_tuning.calibration.wheel_truth import WheelGeometry, compare_wheel_speeds
from thumper_tuning.cli import app as tune_app
from thumper_tuning.cli.calibration import calibrate as calibrate_app
from thumper_tuning.cli.calibration import experiment as experiment_app
from thumper_tuning.drive.verify import VerifyOptions

TRUE = WheelGeometry(left_radius_m=0.0617, right_radius_m=0.0625, track_m=0.38, counts_per_rev=1200.0)
RUNNER = CliRunner()


def _driven(geometry: WheelGeometry) -> tuple[FloatArray, FloatArray]:
    """Return counts at 10 Hz and poses at 100 Hz of a slip-free robot on the course, then in reverse."""
    pose, left, right, time_s = Pose2(), 0.0, 0.0, 0.0
    counts, poses = [(0.0, 0.0, 0.0)], [(0.0, 0.0, 0.0, 0.0)]
    twists = [leg.twist for leg in course(CourseOptions()) for _ in range(round(100 * leg.duration_s))]
    speeds = [(t.v_m_s, t.w_rad_s) for t in twists] + [(-0.2, 0.3)] * 200
    for k, (v, w) in enumerate(speeds, start=1):
        pose = advance(pose, 0.01 * v, 0.01 * w)
        left += 0.01 * (v - 0.5 * w * geometry.track_m) / geometry.left_radius_m
        right += 0.01 * (v + 0.5 * w * geometry.track_m) / geometry.right_radius_m
        time_s = 0.01 * k
        poses.append((time_s, pose.x_m, pose.y_m, pose.theta_rad))
        if k % 10 == 0:
            scale = geometry.counts_per_rev / math.tau
            counts.append((time_s, math.floor(left * scale), math.floor(right * scale)))
    return np.array(counts), np.array(poses)


@pytest.fixture(scope="module")
def driven() -> WheelLog:
    return join_counts_and_poses(*_driven(TRUE))


def test_the_reference_wheel_speeds_equal_the_encoders(driven: WheelLog) -> None:
    """Signs and sides of 8.1 to 8.5: only counting and the filter at the corners remain."""
    error = compare_wheel_speeds(driven, TRUE).error_rad_s
    assert np.all(np.abs(error.mean(axis=0)) < 0.01)
    assert np.all(error.std(axis=0) < 0.15)


def test_backward_is_negative(driven: WheelLog) -> None:
    reverse = compare_wheel_speeds(driven, TRUE).reference_rad_s[-15:-2]
    assert np.all(reverse[:, 0] < -3.0)
    assert reverse[:, 0].mean() == pytest.approx((-0.2 - 0.15 * 0.38) / 0.0617, rel=0.03)


def test_the_geometric_track_gives_an_error_in_turns(driven: WheelLog) -> None:
    narrow = WheelGeometry(left_radius_m=0.0617, right_radius_m=0.0625, track_m=0.245, counts_per_rev=1200.0)
    assert np.all(compare_wheel_speeds(driven, narrow).error_rad_s.std(axis=0) > 0.4)


def test_calibration_finds_both_radii_and_the_track(driven: WheelLog) -> None:
    found = fit_geometry(driven, 1200.0)
    assert found.geometry.left_radius_m == pytest.approx(TRUE.left_radius_m, rel=0.003)
    assert found.geometry.right_radius_m == pytest.approx(TRUE.right_radius_m, rel=0.003)
    assert found.geometry.track_m == pytest.approx(TRUE.track_m, rel=0.003)
    assert odometry_drift(driven, found.geometry).end_position_m < 0.03


def test_a_drive_without_turns_is_rejected() -> None:
    time_s = np.arange(0.0, 10.0, 0.1)
    counts = np.column_stack((time_s, 600.0 * time_s, 600.0 * time_s))
    poses = np.column_stack((time_s, 0.19 * time_s, 0.0 * time_s, 0.0 * time_s))
    with pytest.raises(ThumperError, match="too little"):
        fit_geometry(join_counts_and_poses(counts, poses), 1200.0)


def test_different_clocks_are_rejected(driven: WheelLog) -> None:
    counts, poses = _driven(TRUE)
    poses[:, 0] += 1e6
    with pytest.raises(ThumperError, match="same clock"):
        join_counts_and_poses(counts, poses)


def test_files_instead_of_a_robot(tmp_path: Path) -> None:
    counts, poses = _driven(TRUE)
    log = write_csv(tmp_path / "wheels.csv", COUNT_COLUMNS, counts)
    truth = write_csv(tmp_path / "vicon.csv", POSE_COLUMNS, poses)
    done = RUNNER.invoke(
        experiment_app,
        ["odometry", "--log", str(log), "--truth", str(truth), "--out", str(tmp_path)],
    )
    assert done.exit_code == 0, done.output
    assert "+0.796" in done.output
    assert "-0.427" in done.output
    assert (tmp_path / "odometry.png").read_bytes().startswith(b"\x89PNG")
    alone = RUNNER.invoke(experiment_app, ["odometry", "--truth", str(truth), "--out", str(tmp_path)])
    assert isinstance(alone.exception, ThumperError)
    assert "--truth belongs to --log" in str(alone.exception)


@pytest.mark.parametrize("by_lidar", some_of([False, True]))
def test_calibrating_the_simulated_robot_reduces_its_error(tmp_path: Path, by_lidar: bool) -> None:
    name = f"calibrate_{by_lidar}"
    lidar = ["--lidar", f"sim://{name}/lidar"] if by_lidar else []
    done = RUNNER.invoke(
        calibrate_app,
        [
            "odometry",
            "--board",
            f"sim://{name}/board?world=lab&seed=5",
            "--out",
            str(tmp_path),
            "--yes",
            *lidar,
        ],
    )
    assert done.exit_code == 0, done.output
    row = re.search(r"heading after 5 s, rms, deg\D+([\d.]+)\D+([\d.]+)", done.output)
    assert row is not None
    assert float(row.group(2)) < 0.6 * float(row.group(1))
    values = tomllib.loads((tmp_path / "odometry.toml").read_text())["drive"]
    # 0.3675 m plus 4 % per rad/s; robots differ by 2 %.
    assert values["track_m"] == pytest.approx(0.381, abs=0.011)
    assert load_config(tmp_path / "odometry.toml").drive.track_m == values["track_m"]


@pytest.mark.parametrize(
    ("app", "command"), [(experiment_app, "speed"), (experiment_app, "odometry"), (tune_app, "record")]
)
def test_nothing_drives_before_the_floor_is_confirmed(tmp_path: Path, app: typer.Typer, command: str) -> None:
    board = f"sim://asks_{command}/board?world=hall"
    done = RUNNER.invoke(app, [command, "--board", board, "--out", str(tmp_path)], input="n\n")
    assert isinstance(done.exception, ThumperError)
    assert str(done.exception) == "not confirmed; nothing was driven"
    assert "drive by itself: it needs" in done.output
    assert not list(tmp_path.iterdir())


def test_a_log_without_a_reference_names_the_missing_option(tmp_path: Path) -> None:
    done = RUNNER.invoke(experiment_app, ["odometry", "--log", "x.csv", "--out", str(tmp_path)])
    assert isinstance(done.exception, ThumperError)
    assert "--truth" in str(done.exception)


def test_the_speed_experiment_is_better_than_the_thesis(tmp_path: Path) -> None:
    board = Board.open("sim://experiment_speed/board?world=hall&x_m=-4", baud=500_000)
    try:
        with (tmp_path / "printed.txt").open("w") as text:
            results = run_speed_experiment(
                board, VerifyOptions(hold_s=4.0), tmp_path, Console(file=text, width=120), yes=True
            )
    finally:
        board.close()
    assert [result.tracking.acceleration_rad_s2 for result in results] == [4.0, 8.0]
    for result in results:
        assert abs(result.tracking.mean_rad_s) < 0.03
        assert result.quantization_std_rad_s < result.tracking.std_rad_s < 0.13
        assert 0.0 < result.share < 0.4
    assert "thesis" in (tmp_path / "printed.txt").read_text()
    assert (tmp_path / "speed.png").read_bytes().startswith(b"\x89PNG")


def test_the_quantization_std_is_that_of_counting() -> None:
    counts = np.cumsum(np.random.default_rng(1).uniform(15.0, 16.0, 20_000))
    error = np.diff(np.floor(counts)) - np.diff(counts)
    assert quantization_std_rad_s(1200, 10) == pytest.approx(error.std() * math.tau / 120.0, rel=0.02)
