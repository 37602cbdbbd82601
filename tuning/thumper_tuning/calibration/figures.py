"""Figures of the experiments, as figures 8.1 to 8.7 of the thesis."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from thumper.common.colours import BLUE, GREY, RED
from thumper.maps.plot import save_figure
from thumper_tuning.calibration.wheel_log import WheelLog
from thumper_tuning.calibration.wheel_truth import WheelComparison
from thumper_tuning.drive.verify import Verification

REFERENCE, MEASURED, ERROR = GREY, BLUE, RED


def _plot_error(axes: Any, time_s: Any, error: Any, color: str, name: str = "") -> None:
    label = f"{name}mean {error.mean():+.3f}, std {np.std(error):.3f}"
    axes.plot(time_s, error, color=color, lw=0.8, label=label)


def draw_odometry(runs: dict[str, WheelComparison], log: WheelLog, path: Path) -> Path:
    """Draw the path (8.1), and per wheel speeds (8.2, 8.4) and errors (8.3, 8.5), one column per geometry."""
    figure = Figure(figsize=(6.0 * len(runs), 11.0), layout="constrained")
    grid = figure.subplots(5, len(runs), squeeze=False)
    for column, (name, run) in zip(grid.T, runs.items(), strict=True):
        time_s = run.time_s - run.time_s[0]
        column[0].plot(log.poses[:, 1], log.poses[:, 2], color=REFERENCE, lw=1)
        column[0].set_aspect("equal")
        column[0].set(xlabel="x [m]", ylabel="y [m]", title=name)
        for side, wheel in enumerate(("left", "right")):
            speed, error = column[1 + 2 * side : 3 + 2 * side]
            speed.plot(time_s, run.reference_rad_s[:, side], color=REFERENCE, lw=1, label="reference")
            speed.plot(time_s, run.encoder_rad_s[:, side], color=MEASURED, lw=1, label="encoder")
            _plot_error(error, time_s, run.error_rad_s[:, side], ERROR)
            speed.set_ylabel(f"{wheel} [rad/s]")
            error.set_ylabel(f"{wheel} error [rad/s]")
            for axes in (speed, error):
                axes.legend(loc="upper right", fontsize=8)
    for axes in grid.ravel():
        axes.grid(alpha=0.3)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    save_figure(figure, path, 110)
    return path


def draw_speed(run: Verification, path: Path) -> Path:
    """Draw set-point and speed (8.6) and their difference (8.7) of both wheels."""
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    speed, error = figure.subplots(2, 1, sharex=True)
    time_s = run.rows[:, 0] - run.rows[0, 0]
    speed.step(time_s, run.rows[:, 3], where="pre", color=REFERENCE, label="set-point")
    for name, column, color in (("left", 3, MEASURED), ("right", 6, ERROR)):
        speed.plot(time_s, run.rows[:, column + 1], color=color, lw=0.9, label=f"{name}, measured")
        _plot_error(error, time_s, run.rows[:, column] - run.rows[:, column + 1], color, f"{name}: ")
    speed.set_ylabel("wheel speed [rad/s]")
    error.set(xlabel="time [s]", ylabel="set-point - measured [rad/s]")
    for axes in (speed, error):
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right", fontsize=8)
    save_figure(figure, path, 110)
    return path
