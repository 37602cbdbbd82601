"""Estimate the wheels while the robot drives to goals: errors, and how many lie within the confidence.

Run: python benchmarks/drive_train.py [--seeds N] [--floor carpet]

Real firmware on the simulated chip, navigation to goals in the hall, presets nominal and hard. Each seed is
another robot. Its true parameters are those of the experiment of `thumper tune` on the same robot and floor.
The estimates are those after 60 s: of both sides' mean, and of each side.
"""

import argparse
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch
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
from thumper.odometry.drive_train import (
    DriveTrainEstimate,
    DriveTrainEstimator,
    Estimate,
    WheelEstimate,
    WheelTick,
)
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_tuning.design.gains import nominal_model
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import record
from thumper_tuning.identify.motor import identify
from thumper_tuning.logs.read import DEFAULT_COUNTS_PER_REV, read_logs

GOALS_M = ((2.0, 1.0), (-2.0, -1.0), (1.0, -1.5), (-3.0, 0.0), (2.0, 0.0))  # about 75 s, 60 are used
USED_TICKS = 600  # 60 s from the first tick on
START = Pose2(x_m=-3.0, theta_rad=0.3)
LIMITS = {"gain": 0.03, "time_constant_s": 0.10, "friction": 0.10}
Truth = dict[str, float]


def robot_url(name: str, seed: int, preset: str, floor: str) -> str:
    """Return the address of a robot in the hall."""
    pose = {"x_m": START.x_m, "y_m": START.y_m, "yaw_deg": math.degrees(START.theta_rad)}
    options = {"world": "hall", "seed": seed, "preset": preset, **pose, **({"floor": floor} if floor else {})}
    return f"sim://{name}/board?{urlencode(options)}"


def truth(seed: int, preset: str, floor: str) -> dict[str, Truth]:
    """Identify the robot with the experiment of `thumper tune`: the mean, and each side."""
    with TemporaryDirectory() as folder:
        board = Board.open(robot_url(f"truth{preset}{seed}", seed, preset, floor), baud=500_000)
        try:
            log = record(board, ExcitationOptions(), Path(folder) / "log.csv", lambda *_: None)
        finally:
            board.close()
        motors = {motor.name: motor for motor in (identify([wheel]) for wheel in read_logs(log))}
    models = {"mean": list(motors.values()), **{side: [motor] for side, motor in motors.items()}}
    found = {}
    for side, chosen in models.items():
        model, _ = nominal_model(chosen)
        lag_s = model.time_constant_s + max(model.delay_s - 0.5 / 122.0, 0.0)
        found[side] = {"gain": model.gain, "time_constant_s": lag_s, "friction": model.friction}
    return found


def estimated(seed: int, preset: str, floor: str) -> DriveTrainEstimate | None:
    """Drive to the goals and return the estimate after 60 s."""
    name = f"drive{preset}{seed}"
    config = RobotConfig(
        board=BoardOptions(port=robot_url(name, seed, preset, floor)),
        lidar=LidarOptions(port=f"sim://{name}/lidar"),
    )
    with open_robot(config, START) as robot:
        monitor = robot.inputs.estimator.drive_train
        assert monitor is not None
        ticks: list[WheelTick] = []
        with patch.object(monitor, "add", side_effect=_both(ticks.append, monitor.add)):
            for x_m, y_m in GOALS_M:
                robot.run(drive_to_goal(Goal(x_m=x_m, y_m=y_m), "hall"))
        for line in monitor.warnings().values():
            print(f"  reported, {preset} seed {seed}: {line}")
    estimator = DriveTrainEstimator(counts_per_rev=DEFAULT_COUNTS_PER_REV, delay_s=0.5 / 122.0)
    for tick in ticks[:USED_TICKS]:
        estimator.add(tick)
    return estimator.estimate() if len(ticks) >= USED_TICKS else None


def _both(
    first: Callable[[WheelTick], None], second: Callable[[WheelTick], None]
) -> Callable[[WheelTick], None]:
    def add(tick: WheelTick) -> None:
        first(tick)
        second(tick)

    return add


def errors(found: WheelEstimate, true: Truth) -> Iterator[tuple[str, float, float]]:
    """Return name, relative error, and error in standard deviations of each quantity that is determined."""
    for field in fields(found):
        value: Estimate | None = getattr(found, field.name)
        if value is not None:
            error = value.value - true[field.name]
            yield field.name, error / true[field.name], error / value.std


def main() -> None:
    """Print the worst errors and the coverage by preset: of the mean, and of single sides."""
    parser = argparse.ArgumentParser(description="wheels estimated while driving")
    parser.add_argument("--seeds", type=int, default=5, help="robots per preset")
    parser.add_argument("--floor", default="", help="the simulated floor; empty: that of the preset")
    options = parser.parse_args()
    for preset in ("nominal", "hard"):
        relative: dict[tuple[bool, str], list[float]] = defaultdict(list)
        sigmas: dict[tuple[bool, str], list[float]] = defaultdict(list)
        for seed in range(1, options.seeds + 1):
            found = estimated(seed, preset, options.floor)
            true = truth(seed, preset, options.floor) if found else {}
            for side, truth_of_side in true.items():
                for name, share, deviations in errors(getattr(found, side), truth_of_side):
                    relative[side == "mean", name].append(share)
                    sigmas[side == "mean", name].append(deviations)
        for is_mean, what, count in ((True, "mean", options.seeds), (False, "each side", 2 * options.seeds)):
            for name, limit in LIMITS.items():
                within = np.abs(sigmas[is_mean, name]) <= 2.0
                worst = 100.0 * max(map(abs, relative[is_mean, name]), default=math.nan)
                figure(
                    f"{preset}: {name} after 60 s, {what}, worst error of {len(within)} of {count}",
                    f"{worst:.1f}", "%", aim=f"{100 * limit:.0f}",
                )  # fmt: skip
                figure(f"  within two standard deviations: {within.sum()} of {len(within)}", "")


if __name__ == "__main__":
    main()
