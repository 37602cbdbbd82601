"""Estimate the wheels while the robot drives to goals: errors, and how many lie within the confidence.

Run: python benchmarks/drive_train.py [--seeds N]

Real firmware on the simulated chip, navigation to goals in the hall, presets nominal and hard. Each seed is
another robot. Its true parameters are those of the experiment of `thumper tune` on the same robot.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlencode

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from thumper.board.board import Board
from thumper.board.options import BoardOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.odometry.drive_train import Estimate, WheelEstimate
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_tuning.design.gains import nominal_model
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import record
from thumper_tuning.identify.motor import identify
from thumper_tuning.logs.read import read_logs

GOALS_M = ((2.0, 1.0), (-2.0, -1.0), (1.0, -1.5), (-3.0, 0.0), (2.0, 0.0))  # about 75 s
START = Pose2(x_m=-3.0, theta_rad=0.3)
LIMITS = {"gain": 0.03, "time_constant_s": 0.10, "friction": 0.10}
Truth = dict[str, float]


def robot_url(name: str, seed: int, preset: str) -> str:
    """Return the address of a robot in the hall."""
    pose = {"x_m": START.x_m, "y_m": START.y_m, "yaw_deg": math.degrees(START.theta_rad)}
    return f"sim://{name}/board?{urlencode({'world': 'hall', 'seed': seed, 'preset': preset, **pose})}"


def truth(seed: int, preset: str) -> Truth:
    """Identify the robot with the experiment of `thumper tune`."""
    with TemporaryDirectory() as folder:
        board = Board.open(robot_url(f"truth{preset}{seed}", seed, preset), baud=500_000)
        try:
            log = record(board, ExcitationOptions(), Path(folder) / "log.csv", lambda *_: None)
        finally:
            board.close()
        model, _ = nominal_model([identify([wheel]) for wheel in read_logs(log)])
    lag_s = model.time_constant_s + max(model.delay_s - 0.5 / 122.0, 0.0)
    return {"gain": model.gain, "time_constant_s": lag_s, "friction": model.friction}


def estimated(seed: int, preset: str) -> WheelEstimate | None:
    """Drive to the goals and return the estimate at the end."""
    name = f"drive{preset}{seed}"
    config = RobotConfig(
        board=BoardOptions(port=robot_url(name, seed, preset)), lidar=LidarOptions(port=f"sim://{name}/lidar")
    )
    with open_robot(config, START) as robot:
        for x_m, y_m in GOALS_M:
            robot.run(drive_to_goal(Goal(x_m=x_m, y_m=y_m), "hall"))
        monitor = robot.inputs.estimator.drive_train
        assert monitor is not None
        for line in monitor.drift_lines():
            print(f"  false drift, {preset} seed {seed}: {line}")
        return None if monitor.estimate is None else monitor.estimate.mean


def errors(found: WheelEstimate, true: Truth) -> Iterator[tuple[str, float, float]]:
    """Return name, relative error, and error in standard deviations of each quantity that is determined."""
    for field in fields(found):
        value: Estimate | None = getattr(found, field.name)
        if value is not None:
            error = value.value - true[field.name]
            yield field.name, error / true[field.name], error / value.std


def main() -> None:
    """Print the worst errors and the coverage by preset."""
    parser = argparse.ArgumentParser(description="wheels estimated while driving")
    parser.add_argument("--seeds", type=int, default=5, help="robots per preset")
    seeds = parser.parse_args().seeds
    for preset in ("nominal", "hard"):
        relative: dict[str, list[float]] = {name: [] for name in LIMITS}
        sigmas: dict[str, list[float]] = {name: [] for name in LIMITS}
        for seed in range(1, seeds + 1):
            found = estimated(seed, preset)
            for name, share, deviations in errors(found, truth(seed, preset)) if found else ():
                relative[name].append(share)
                sigmas[name].append(deviations)
        for name, limit in LIMITS.items():
            within = np.abs(sigmas[name]) <= 2.0
            worst = 100.0 * max(map(abs, relative[name]), default=math.nan)
            figure(
                f"{preset}: {name} while driving, worst error of {len(within)} of {seeds}",
                f"{worst:.1f}", "%", aim=f"{100 * limit:.0f}",
            )  # fmt: skip
            figure(f"  within two standard deviations: {within.sum()} of {len(within)}", "")


if __name__ == "__main__":
    main()
