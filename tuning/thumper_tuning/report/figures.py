"""The figures of the tuning report, one function each. Every function returns a matplotlib figure."""

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.figure import Figure

from thumper.common.geometry import FloatArray
from thumper_tuning.design.gains import Design
from thumper_tuning.design.loop_analysis import (
    FREQUENCIES,
    ComplexArray,
    Plant,
    closed_loop_poles,
    is_stable,
    loop_response,
    step_response,
)
from thumper_tuning.design.plant_family import plant_family
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
STEP_DURATION_S = 2.5
LOAD_STEP_PWM = 10.0


def _figure(size: tuple[float, float]) -> Figure:
    return Figure(figsize=size, layout="constrained")


def _grid(*all_axes: "Axes", which: Literal["major", "both"] = "major") -> None:
    for axes in all_axes:
        axes.grid(alpha=0.3, which=which)


def _loop(design: Design) -> ComplexArray:
    plant = Plant.from_model(design.model, design.period_s)
    return loop_response(plant, design.gains.kp, design.gains.ki)


def _unit_circle() -> tuple[FloatArray, FloatArray]:
    angle = np.linspace(0.0, math.tau, 200)
    return np.cos(angle), np.sin(angle)


def tracking(before: Verification | None, after: Verification) -> Figure:
    """Draw set-point, speed and PWM of the left wheel, on the same axes for both sets of gains."""
    runs = [(name, run) for name, run in (("before", before), ("after", after)) if run is not None]
    figure = _figure((10.0, 6.4))
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
        _grid(speed, error, pwm)
    grid[0, 0].set_ylabel("left speed [rad/s]")
    grid[1, 0].set_ylabel("tracking error [rad/s]")
    grid[2, 0].set_ylabel("PWM")
    grid[0, 0].legend(loc="upper right", fontsize=8)
    return figure


def data_and_model(motor: IdentifiedMotor) -> Figure:
    """Draw the measured speed, the simulated model's speed, and the drive."""
    figure = _figure((10.0, 5.4))
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
    _grid(speed, drive)
    return figure


def residuals(motor: IdentifiedMotor) -> Figure:
    """Draw the held-out residuals, and their autocorrelation with the 99 % band of white noise."""
    figure = _figure(WIDE)
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
    figure = _figure(HALF)
    axes = figure.subplots()
    model = motor.model
    for s in motor.segments:
        axes.plot(s.drive_at_windows(), s.speed_rad_s, ".", color=MEASURED, ms=3)
    largest = max(float(np.abs(s.drive).max()) for s in motor.segments)
    u = np.linspace(-largest, largest, 401)
    forward = np.maximum(model.gain * (u - model.friction_forward), 0.0) * (u > 0)
    backward = np.minimum(model.gain * (u + model.friction_backward), 0.0) * (u < 0)
    axes.plot(u, forward + backward, color=MODEL, label="model, steady state")
    axes.set(xlabel=f"drive [{motor.unit.value}]", ylabel="speed [rad/s]", title="static map")
    _grid(axes)
    axes.legend()
    return figure


def step(design: Design, before: tuple[float, float] | None) -> Figure:
    """Draw the responses to a set-point step and to a load step, PI alone: before, after, plant family."""
    figure = _figure(WIDE)
    setpoint, load = figure.subplots(1, 2)
    ticks = round(STEP_DURATION_S / design.period_s)
    time_s = np.arange(ticks + 1) * design.period_s
    after = (design.gains.kp, design.gains.ki)
    for k, member in enumerate(plant_family(design.model, design.uncertainty)):
        y = step_response(Plant.from_model(member, design.period_s), *after, ticks)
        label = "battery +-15 %, inertia x0.36 ... x2" if k == 0 else None
        setpoint.plot(time_s, y, color=REFERENCE, alpha=0.25, lw=0.8, label=label)
    plant = Plant.from_model(design.model, design.period_s)
    for gains, color, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        if gains is None:
            continue
        for axes, load_pwm in ((setpoint, 0.0), (load, LOAD_STEP_PWM)):
            y = step_response(plant, *gains, ticks, load=load_pwm)
            axes.plot(time_s, y, "o-", color=color, ms=3, label=label)
    setpoint.set(xlabel="time [s]", ylabel="speed [rad/s]", title="unit step of the set-point, PI alone")
    load.set(xlabel="time [s]", ylabel="speed [rad/s]", title=f"load step of {LOAD_STEP_PWM:g} PWM")
    _grid(setpoint, load)
    setpoint.legend()
    load.legend()
    return figure


def bode(design: Design) -> Figure:
    """Draw the Bode plot of the open loop with its margins."""
    figure = _figure(WIDE)
    magnitude, phase = figure.subplots(1, 2)
    L = _loop(design)
    rad_s = FREQUENCIES / design.period_s
    magnitude.loglog(rad_s, np.abs(L), color=MODEL)
    magnitude.axhline(1.0, color=REFERENCE, lw=0.8)
    magnitude.set(
        xlabel="frequency [rad/s]", ylabel="|L|", title=f"gain margin {design.margins.gain_margin:.2f}"
    )
    phase.semilogx(rad_s, np.degrees(np.unwrap(np.angle(L))), color=MODEL)
    phase.axhline(-180.0, color=REFERENCE, lw=0.8)
    phase.set(xlabel="frequency [rad/s]", ylabel="phase of L [deg]")
    phase.set_title(f"phase margin {design.margins.phase_margin_deg:.0f} deg")
    _grid(magnitude, phase, which="both")
    return figure


def nyquist(design: Design) -> Figure:
    """Draw the Nyquist plot with the disk |1 + L| < 1 / Ms, which the loop does not enter."""
    figure = _figure(HALF)
    axes = figure.subplots()
    L = _loop(design)
    cos, sin = _unit_circle()
    radius = 1.0 / design.margins.max_sensitivity
    axes.plot(L.real, L.imag, color=MODEL)
    axes.plot(-1.0 + radius * cos, radius * sin, "--", color=REFERENCE)
    axes.plot(-1.0, 0.0, "+", color="black")
    axes.set(xlim=(-2.2, 1.2), ylim=(-2.2, 0.8), xlabel="Re L", ylabel="Im L", aspect="equal")
    axes.set_title(f"Nyquist: Ms = {design.margins.max_sensitivity:.2f}")
    _grid(axes)
    return figure


def sensitivity(design: Design) -> Figure:
    """Draw |S| and |T| of the nominal loop, and |S| of the plant family."""
    figure = _figure(HALF)
    axes = figure.subplots()
    rad_s = FREQUENCIES / design.period_s
    gains = (design.gains.kp, design.gains.ki)
    for member in plant_family(design.model, design.uncertainty):
        plant = Plant.from_model(member, design.period_s)
        if is_stable(plant, *gains):
            S = 1.0 / np.abs(1.0 + loop_response(plant, *gains))
            axes.loglog(rad_s, S, color=REFERENCE, alpha=0.25, lw=0.8)
    L = _loop(design)
    axes.loglog(rad_s, 1.0 / np.abs(1.0 + L), color=MODEL, label="|S|")
    axes.loglog(rad_s, np.abs(L / (1.0 + L)), color=MEASURED, label="|T|")
    axes.set(xlabel="frequency [rad/s]", ylim=(1e-2, 4.0))
    nominal, worst = design.margins.max_sensitivity, design.worst_case.max_sensitivity
    axes.set_title(f"sensitivity: Ms {nominal:.2f}, worst case {worst:.2f}")
    _grid(axes, which="both")
    axes.legend()
    return figure


def pole_zero(design: Design) -> Figure:
    """Draw poles and zeros of the plant and poles of the closed loop in the z plane."""
    figure = _figure(HALF)
    axes = figure.subplots()
    plant = Plant.from_model(design.model, design.period_s)
    closed = closed_loop_poles(plant, design.gains.kp, design.gains.ki)
    zeros = np.roots(plant.numerator)
    axes.plot(*_unit_circle(), color=REFERENCE, lw=0.8)
    axes.plot([plant.pole, 0.0], [0.0, 0.0], "x", color=MEASURED, label="plant poles")
    axes.plot(zeros.real, zeros.imag, "o", mfc="none", color=MEASURED, label="plant zeros")
    axes.plot(closed.real, closed.imag, "x", color=MODEL, label="closed-loop poles")
    axes.set(
        aspect="equal", xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), title=f"z plane, T = {design.period_s:g} s"
    )
    _grid(axes)
    axes.legend(loc="upper right", fontsize=8)
    return figure
