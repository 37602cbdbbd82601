"""The figures of the motors and of the drives in the tuning report, one function each."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.figure import Figure

from thumper.common.colours import BLUE, GREEN, GREY, RED
from thumper.common.geometry import FloatArray
from thumper_tuning.drive.verify import Verification
from thumper_tuning.identify.fit_warnings import WHITENESS_LIMIT, autocorrelation
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.identify.prediction import predict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL, TALL = (4.8, 3.6), (4.8, 4.6)  # at the width of a phone one point is one pixel
MEASURED, MODEL, REFERENCE = BLUE, RED, GREY
BEFORE, AFTER = BLUE, RED


def new_figure(size: tuple[float, float]) -> Figure:
    """Return a figure that no window manager knows: nothing needs to close it."""
    return Figure(figsize=size, layout="constrained")


def add_grid(*all_axes: "Axes", which: Literal["major", "both"] = "major") -> None:
    """Draw faint grid lines."""
    for axes in all_axes:
        axes.grid(alpha=0.3, which=which)


def tracking(name: str, run: Verification, others: Sequence[Verification]) -> Figure:
    """Draw set-point, speed, error and PWM of the left wheel, on axes that also hold the other runs."""
    figure = new_figure(TALL)
    axes = np.asarray(figure.subplots(3, 1, sharex=True))
    for panel, of in zip(axes, (_speed, _error, _pwm), strict=True):
        panel.set_ylim(_with_margin(np.concatenate([of(one.rows) for one in (run, *others)])))
    speed, error, pwm = axes
    time_s = run.rows[:, 0] - run.rows[0, 0]
    speed.step(time_s, run.rows[:, 3], where="pre", color=REFERENCE, label="set-point")
    speed.plot(time_s, _speed(run.rows), ".-", color=RED, ms=3, lw=0.8, label="measured")
    speed.set(ylabel="speed [rad/s]", title=f"{name}: kp {run.gains.kp:.3g}, ki {run.gains.ki:.3g}")
    speed.legend(loc="upper right")
    error.plot(time_s, _error(run.rows), ".-", color=BLUE, ms=3, lw=0.8)
    error.set(ylabel="error [rad/s]")
    pwm.step(time_s, _pwm(run.rows), where="post", color=GREEN, lw=0.9)
    pwm.set(xlabel="time [s]", ylabel="PWM")
    add_grid(*axes)
    return figure


def _speed(rows: FloatArray) -> FloatArray:
    return rows[:, 4]


def _error(rows: FloatArray) -> FloatArray:
    return rows[:, 3] - rows[:, 4]


def _pwm(rows: FloatArray) -> FloatArray:
    return rows[:, 5]


def _with_margin(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return low - 0.1 * (high - low), high + 0.1 * (high - low)


def data_and_model(motor: IdentifiedMotor) -> Figure:
    """Draw the measured speed, the simulated model's speed, and the drive."""
    figure = new_figure(PANEL)
    speed, drive = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    start_s = motor.segments[0].edge_s[0]
    for k, s in enumerate(motor.segments):
        offset_s = min(start_s, s.edge_s[0])  # in a second run the clock may start again
        middle_s = 0.5 * (s.edge_s[1:] + s.edge_s[:-1]) - offset_s
        predicted = predict(s, motor.model)
        labels = ("measured", "model") if k == 0 else (None, None)
        speed.plot(middle_s, s.speed_rad_s, ".", color=MEASURED, ms=4, label=labels[0])
        speed.plot(middle_s, predicted, color=MODEL, lw=1, label=labels[1])
        drive.step(s.change_s - offset_s, s.drive, where="post", color=REFERENCE, lw=1)
    speed.set_ylabel("speed [rad/s]")
    drive.set_ylabel(f"drive [{motor.unit.value}]")
    drive.set_xlabel("time [s]")
    speed.legend(loc="lower right")
    speed.set_title(f"{motor.name}: validation fit {motor.validation.fit_percent:.1f} %")
    add_grid(speed, drive)
    return figure


def residuals(motor: IdentifiedMotor) -> Figure:
    """Draw the held-out residuals."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    axes.plot(motor.validation.residual_rad_s[~motor.fit.is_glitch], ".", color=MEASURED, ms=3)
    axes.set(xlabel="sample", ylabel="measured - predicted [rad/s]", title="held-out residuals")
    add_grid(axes)
    return figure


def residual_correlation(motor: IdentifiedMotor) -> Figure:
    """Draw the autocorrelation of the held-out residuals with the 99 % band of white noise."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    residual = motor.validation.residual_rad_s[~motor.fit.is_glitch]
    values = autocorrelation(residual)
    band = WHITENESS_LIMIT / math.sqrt(len(residual))
    axes.axhspan(-band, band, color=REFERENCE, alpha=0.25, label="99 % of white noise")
    axes.stem(np.arange(1, len(values) + 1), values, basefmt=" ")
    axes.set(xlabel="lag [samples]", ylabel="autocorrelation", ylim=(-1, 1), title="are they white?")
    axes.legend()
    return figure


def static_map(motor: IdentifiedMotor) -> Figure:
    """Draw speed over drive with the model's steady state, including the dead band."""
    figure = new_figure(PANEL)
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
