"""Estimate the wheels while the robot drives to goals: errors, and how many lie within the confidence.

Run: python benchmarks/drive_train.py [--seeds N] [--floor carpet]

Real firmware on the simulated chip, navigation to goals in the hall, presets nominal and hard. Each seed is
another robot: torque and friction of its motors differ by 3 and 5 % (standard deviations). The true values
are those of the simulator's motor equations. The estimates are those after 60 s: of both sides' mean, of each
side, and of each side if the left bridge gave 10 % less (the same drive, with its PWM reported as 1 / 0.9).
"""

import argparse
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from unittest.mock import patch
from urllib.parse import urlencode

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from thumper.board.options import BoardOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.odometry.drive_train import (
    REFERENCE_V,
    DriveTrainEstimate,
    DriveTrainEstimator,
    Estimate,
    WheelEstimate,
    WheelTick,
)
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.chip.robot_params import RobotParams

GOALS_M = ((2.0, 1.0), (-2.0, -1.0), (1.0, -1.5), (-3.0, 0.0), (2.0, 0.0))  # about 75 s, 60 are used
USED_TICKS = 600  # 60 s from the first tick on
WEAK = 0.9  # what the left bridge gives
COUNTS_PER_REV = 1200.0
START = Pose2(x_m=-3.0, theta_rad=0.3)
LIMITS = {"gain": 0.03, "time_constant_s": 0.10, "friction": 0.10}
Truth = dict[str, float]
MEAN, SIDES, UNEVEN = "mean", "each side", "each side, left 10 % weaker"


def robot_url(name: str, seed: int, preset: str, floor: str) -> str:
    """Return the address of a robot in the hall."""
    pose = {"x_m": START.x_m, "y_m": START.y_m, "yaw_deg": math.degrees(START.theta_rad)}
    options = {"world": "hall", "seed": seed, "preset": preset, **pose, **({"floor": floor} if floor else {})}
    return f"sim://{name}/board?{urlencode(options)}"


def some_robot(seed: int) -> RobotParams:
    """Return a robot whose motors differ from the usual by the seed, alike on both sides."""
    robot, rng = RobotParams.load(), np.random.default_rng(seed)
    motor = replace(
        robot.motor,
        torque_Nm_A=robot.motor.torque_Nm_A * (1.0 + 0.03 * rng.standard_normal()),
        coulomb_Nm=robot.motor.coulomb_Nm * (1.0 + 0.05 * rng.standard_normal()),
        spread_ratio=0.0,
        unit_spread_ratio=0.0,
    )
    return replace(robot, motor=motor)


def truth(robot: RobotParams) -> Truth:
    """Return the parameters of each side, by the simulator's equation of the motors (drive_train.hpp)."""
    motor, body = robot.motor, robot.body
    torque_Nm_A, emf = motor.torque_Nm_A, motor.back_emf_V_s_rad
    n = motor.motors_per_side
    damping = n * (torque_Nm_A * emf / motor.resistance_Ohm + motor.viscous_Nm_s_rad)
    torque_Nm_per_pwm = n * torque_Nm_A / motor.resistance_Ohm * REFERENCE_V / 255.0
    inertia = n * motor.inertia_kg_m2 + 0.5 * body.mass_kg * body.wheel_radius_m**2
    return {
        "gain": torque_Nm_per_pwm / damping,
        "time_constant_s": inertia / damping,
        "friction": n * motor.coulomb_Nm / torque_Nm_per_pwm,
    }


def driven(seed: int, preset: str, floor: str, params: RobotParams) -> list[WheelTick]:
    """Drive to the goals and return the ticks of the first 60 s, or none if it ended earlier."""
    name = f"drive{preset}{seed}"
    config = RobotConfig(
        board=BoardOptions(port=robot_url(name, seed, preset, floor)),
        lidar=LidarOptions(port=f"sim://{name}/lidar"),
    )
    ticks: list[WheelTick] = []
    with patch.object(RobotParams, "load", return_value=params), open_robot(config, START) as robot:
        monitor = robot.inputs.estimator.drive_train
        assert monitor is not None
        with patch.object(monitor, "add", side_effect=_both(ticks.append, monitor.add)):
            for x_m, y_m in GOALS_M:
                robot.run(drive_to_goal(Goal(x_m=x_m, y_m=y_m), "hall"))
        for line in monitor.warnings().values():
            print(f"  reported, {preset} seed {seed}: {line}")
    return ticks[:USED_TICKS] if len(ticks) >= USED_TICKS else []


def estimated(ticks: list[WheelTick], left: float = 1.0) -> DriveTrainEstimate:
    """Return the estimate after these ticks, for a left bridge that gives less."""
    estimator = DriveTrainEstimator(counts_per_rev=COUNTS_PER_REV, delay_s=0.5 / 122.0)
    for tick in ticks:
        estimator.add(tick._replace(left_pwm=round(tick.left_pwm / left)))
    return estimator.estimate()


def weaker(true: Truth, share: float) -> Truth:
    """Return the parameters of a side whose bridge gives this share."""
    return {**true, "gain": true["gain"] * share, "friction": true["friction"] / share}


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
        relative: dict[tuple[str, str], list[float]] = defaultdict(list)
        sigmas: dict[tuple[str, str], list[float]] = defaultdict(list)
        for seed in range(1, options.seeds + 1):
            params = some_robot(seed)
            ticks, true = driven(seed, preset, options.floor, params), truth(params)
            if not ticks:
                continue
            plain, uneven, weak = estimated(ticks), estimated(ticks, WEAK), weaker(true, WEAK)
            for what, found, its_truth in (
                (MEAN, plain.mean, true),
                (SIDES, plain.left, true),
                (SIDES, plain.right, true),
                (UNEVEN, uneven.left, weak),
                (UNEVEN, uneven.right, true),
            ):
                for name, share, deviations in errors(found, its_truth):
                    relative[what, name].append(share)
                    sigmas[what, name].append(deviations)
        for what, count in ((MEAN, options.seeds), (SIDES, 2 * options.seeds), (UNEVEN, 2 * options.seeds)):
            for name, limit in LIMITS.items():
                words = name.removesuffix("_s").replace("_", " ")
                within = np.abs(sigmas[what, name]) <= 2.0
                worst = 100.0 * max(map(abs, relative[what, name]), default=math.nan)
                figure(
                    f"{preset}: {words} after 60 s, {what}, worst error of {len(within)} of {count}",
                    f"{worst:.1f}", "%", aim=f"<= {100 * limit:.0f}",
                )  # fmt: skip
                what_within = f"{preset}: {words} after 60 s, {what}, within two standard deviations"
                figure(what_within, f"{within.sum()} of {len(within)}")


if __name__ == "__main__":
    main()
