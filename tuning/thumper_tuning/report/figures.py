"""The figures of the motors and of the drives in the tuning report, one function each."""

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.figure import Figure

from thumper_tuning.drive.verify import Verification
from thumper_tuning.identify.fit_warnings import WHITENESS_LIMIT, autocorrelation
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.identify.prediction import predict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDE, HALF = (10.0, 4.2), (5.6, 4.2)
BLUE, RED, GREEN, GREY = "#1f77b4", "#d62728", "#2ca02c", "#7f7f7f"
MEASURED, MODEL, REFERENCE = BLUE, RED, GREY
BEFORE, AFTER = BLUE, RED


def new_figure(size: tuple[float, float]) -> Figure:
    """Return a figure that no window manager knows: nothing needs to close it."""
    return Figure(figsize=size, layout="constrained")


def add_grid(*all_axes: "Axes", which: Literal["major", "both"] = "major") -> None:
    """Draw faint grid lines."""
    for axes in all_axes:
        axes.grid(alpha=0.3, which=which)


def tracking(before: Verification | None, after: Verification) -> Figure:
    """Draw set-point, speed and PWM of the left wheel, on the same axes for both sets of gains."""
    runs = [(name, run) for name, run in (("before", before), ("after", after)) if run is not None]
    figure = new_figure((10.0, 6.4))
    grid = np.asarray(figure.subplots(3, len(runs), sharex=True, sharey="row", squeeze=False))
    for (name, run), (speed, error, pwm) in zip(runs, grid.T, strict=True):
        rows = run.rows
        time_s = rows[:, 0] - rows[0, 0]
        speed.step(time_s, rows[:, 3], where="pre", color=REFERENCE, label="set-point")
        speed.plot(time_s, rows[:, 4], ".-", color=RED, ms=3, lw=0.8, label="measured")
        speed.set_title(
            f"{name}: kp {run.gains.kp:.3g}, ki {run.gains.ki:.3g}, std "
            + ", ".join(f"{t.std_rad_s:.3f} at {t.acceleration_rad_s2:g}" for t in run.tracking),
            fontsize=9,
        )
        error.plot(time_s, rows[:, 3] - rows[:, 4], ".-", color=BLUE, ms=3, lw=0.8)
        pwm.step(time_s, rows[:, 5], where="post", color=GREEN, lw=0.9)
        pwm.set_xlabel("time [s]")
        add_grid(speed, error, pwm)
    grid[0, 0].set_ylabel("left speed [rad/s]")
    grid[1, 0].set_ylabel("tracking error [rad/s]")
    grid[2, 0].set_ylabel("PWM")
    grid[0, 0].legend(loc="upper right", fontsize=8)
    return figure


def data_and_model(motor: IdentifiedMotor) -> Figure:
    """Draw the measured speed, the simulated model's speed, and the drive."""
    figure = new_figure((10.0, 5.4))
    speed, drive = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    start_s = motor.segments[0].edge_s[0]
    for k, s in enumerate(motor.segments):
        offset_s = min(start_s, s.edge_s[0])  # in a second run the clock may start again
        middle_s = 0.5 * (s.edge_s[1:] + s.edge_s[:-1]) - offset_s
        predicted = predict(s, motor.model, instantaneous=motor.fit.instantaneous)
        labels = ("measured", "model") if k == 0 else (None, None)
        speed.plot(middle_s, s.speed_rad_s, ".", color=MEASURED, ms=4, label=labels[0])
        speed.plot(middle_s, predicted, color=MODEL, lw=1, label=labels[1])
        drive.step(s.change_s - offset_s, s.drive, where="post", color=REFERENCE, lw=1)
    speed.set_ylabel("speed [rad/s]")
    drive.set_ylabel(f"drive [{motor.unit.value}]")
    drive.set_xlabel("time [s]")
    speed.legend(loc="upper right")
    speed.set_title(f"{motor.name}: validation fit {motor.validation.fit_percent:.1f} %")
    add_grid(speed, drive)
    return figure


def residuals(motor: IdentifiedMotor) -> Figure:
    """Draw the held-out residuals, and their autocorrelation with the 99 % band of white noise."""
    figure = new_figure(WIDE)
    over_time, correlation = figure.subplots(1, 2, width_ratios=(2, 1))
    residual = motor.validation.residual_rad_s[~motor.fit.is_glitch]
    over_time.plot(residual, ".", color=MEASURED, ms=3)
    over_time.set(xlabel="sample", ylabel="measured - predicted [rad/s]", title="held-out residuals")
    values = autocorrelation(residual)
    band = WHITENESS_LIMIT / math.sqrt(len(residual))
    correlation.axhspan(-band, band, color=REFERENCE, alpha=0.25, label="99 % of white noise")
    correlation.stem(np.arange(1, len(values) + 1), values, basefmt=" ")
    correlation.set(xlabel="lag [samples]", ylabel="autocorrelation", ylim=(-1, 1))
    correlation.legend()
    return figure


def static_map(motor: IdentifiedMotor) -> Figure:
    """Draw speed over drive with the model's steady state, including the dead band."""
    figure = new_figure(HALF)
    axes = figure.subplots()
    model = motor.model
    for s in motor.segments:
        axes.plot(s.drive_at_windows(), s.speed_rad_s, ".", color=MEASURED, ms=3)
    drives = np.concatenate([s.drive for s in motor.segments])
    u = np.linspace(min(drives.min(), 0.0), max(drives.max(), 0.0), 401)
    forward = np.maximum(model.gain * (u - model.friction_forward), 0.0) * (u > 0)
    backward = np.minimum(model.gain * (u + model.friction_backward), 0.0) * (u < 0)
    axes.plot(u, forward + backward, color=MODEL, label="model, steady state")
    axes.set(xlabel=f"drive [{motor.unit.value}]", ylabel="speed [rad/s]", title="static map")
    add_grid(axes)
    axes.legend()
    return figure
