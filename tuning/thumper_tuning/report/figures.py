"""The figures of a tuning report, one function each; every one returns a matplotlib figure."""

import math

import numpy as np
from matplotlib.figure import Figure

from thumper.common.geometry import FloatArray
from thumper_tuning.design.gains import Design
from thumper_tuning.design.loop_analysis import (
    FREQUENCIES,
    Plant,
    closed_loop_poles,
    judge,
    open_loop,
    step_response,
)
from thumper_tuning.design.plant_family import family
from thumper_tuning.drive.verify import Verification
from thumper_tuning.identify.fit_warnings import WHITENESS_LIMIT, autocorrelation
from thumper_tuning.identify.motor import Identified
from thumper_tuning.identify.prediction import predict


def tracking(before: Verification | None, after: Verification) -> Figure:
    """Set-point, speed and PWM of the left wheel; same axes for both sets of gains."""
    runs = [(name, run) for name, run in (("before", before), ("after", after)) if run is not None]
    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    grid = np.asarray(figure.subplots(3, len(runs), sharex=True, sharey="row", squeeze=False))
    for (name, run), (speed, error, pwm) in zip(runs, grid.T, strict=True):
        rows = run.rows
        time_s = rows[:, 0] - rows[0, 0]
        speed.step(time_s, rows[:, 3], where="pre", color="#7f7f7f", label="set-point")
        speed.plot(time_s, rows[:, 4], ".-", color="#d62728", ms=3, lw=0.8, label="counted")
        speed.set_title(
            f"{name}: kp {run.gains.kp:.3g}, ki {run.gains.ki:.3g}, std "
            + ", ".join(f"{t.std_rad_s:.3f} at {t.acceleration_rad_s2:g}" for t in run.tracking),
            fontsize=9,
        )
        error.plot(time_s, rows[:, 3] - rows[:, 4], ".-", color="#1f77b4", ms=3, lw=0.8)
        pwm.step(time_s, rows[:, 5], where="post", color="#2ca02c", lw=0.9)
        pwm.set_xlabel("time [s]")
        for axes in (speed, error, pwm):
            axes.grid(alpha=0.3)
    grid[0, 0].set_ylabel("left speed [rad/s]")
    grid[1, 0].set_ylabel("set-point - speed [rad/s]")
    grid[2, 0].set_ylabel("PWM")
    grid[0, 0].legend(loc="upper right", fontsize=8)
    return figure


WIDE = (10.0, 4.2)
HALF = (5.6, 4.2)
MEASURED, MODEL, OTHER = "#1f77b4", "#d62728", "#7f7f7f"


def data_and_model(motor: Identified) -> Figure:
    """Counted speed, the model's free-running prediction, and the drive."""
    figure = Figure(figsize=(10.0, 5.4), layout="constrained")
    speed, drive = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for k, s in enumerate(motor.stretches):
        start_s = motor.stretches[0].edge_s[0] if s.edge_s[0] > motor.stretches[0].edge_s[0] else s.edge_s[0]
        middle_s = 0.5 * (s.edge_s[1:] + s.edge_s[:-1]) - start_s
        labels = ("counted", "model") if k == 0 else (None, None)
        speed.plot(middle_s, s.speed_rad_s, ".", color=MEASURED, ms=4, label=labels[0])
        speed.plot(
            middle_s,
            predict(s, motor.model, momentary=motor.fit.momentary),
            color=MODEL,
            lw=1,
            label=labels[1],
        )
        drive.step(s.change_s - start_s, s.drive, where="post", color=OTHER, lw=1)
    speed.set_ylabel("speed [rad/s]")
    drive.set_ylabel(f"drive [{motor.unit.value}]")
    drive.set_xlabel("time [s]")
    speed.legend(loc="upper right")
    speed.set_title(f"{motor.name}: held-out speeds predicted to {motor.validation.fit_percent:.1f} %")
    for axes in (speed, drive):
        axes.grid(alpha=0.3)
    return figure


def residuals(motor: Identified) -> Figure:
    """Held-out residuals over time, and their autocorrelation with the 99 % band of white noise."""
    figure = Figure(figsize=WIDE, layout="constrained")
    over_time, correlation = figure.subplots(1, 2, width_ratios=(2, 1))
    good = motor.validation.residual_rad_s[~motor.fit.is_glitch]
    over_time.plot(good, ".", color=MEASURED, ms=3)
    over_time.set(xlabel="sample", ylabel="counted - predicted [rad/s]", title="residuals, held out")
    values = autocorrelation(good)
    band = WHITENESS_LIMIT / math.sqrt(len(good))
    correlation.axhspan(-band, band, color=OTHER, alpha=0.25, label="99 % of white noise")
    correlation.stem(np.arange(1, len(values) + 1), values, basefmt=" ")
    correlation.set(xlabel="lag [samples]", ylabel="autocorrelation", ylim=(-1, 1))
    correlation.legend()
    return figure


def static_map(motor: Identified) -> Figure:
    """Drive against speed, with the dead band: where the wheel settles."""
    figure = Figure(figsize=HALF, layout="constrained")
    axes = figure.subplots()
    model = motor.model
    for s in motor.stretches:
        at = np.clip(np.searchsorted(s.change_s, s.edge_s[:-1] + 1e-9, side="right") - 1, 0, None)
        axes.plot(s.drive[at], s.speed_rad_s, ".", color=MEASURED, ms=3)
    largest = max(float(np.abs(s.drive).max()) for s in motor.stretches)
    u = np.linspace(-largest, largest, 401)
    forward = np.maximum(model.gain * (u - model.friction_forward), 0.0) * (u > 0)
    backward = np.minimum(model.gain * (u + model.friction_backward), 0.0) * (u < 0)
    axes.plot(u, forward + backward, color=MODEL, label="steady state of the model")
    axes.set(xlabel=f"drive [{motor.unit.value}]", ylabel="speed [rad/s]", title="static map")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


def step(design: Design, before: tuple[float, float] | None) -> Figure:
    """A unit step of the set-point and of the load, PI alone: before, after, and the family of plants."""
    figure = Figure(figsize=WIDE, layout="constrained")
    setpoint, load = figure.subplots(1, 2)
    ticks = round(2.5 / design.period_s)
    time_s = np.arange(ticks + 1) * design.period_s
    new = (design.gains.kp, design.gains.ki)
    for k, member in enumerate(family(design.model, design.uncertainty)):
        plant = Plant.of(member, design.period_s)
        label = "battery +-15 %, inertia x0.36 ... x2" if k == 0 else None
        setpoint.plot(time_s, step_response(plant, *new, ticks), color=OTHER, alpha=0.25, lw=0.8, label=label)
    plant = Plant.of(design.model, design.period_s)
    for gains, colour, label in ((before, MEASURED, "before"), (new, MODEL, "after")):
        if gains is None:
            continue
        setpoint.plot(time_s, step_response(plant, *gains, ticks), "o-", color=colour, ms=3, label=label)
        load.plot(
            time_s, step_response(plant, *gains, ticks, load=10.0), "o-", color=colour, ms=3, label=label
        )
    setpoint.set(xlabel="time [s]", ylabel="speed", title="unit step of the set-point, PI alone")
    load.set(xlabel="time [s]", ylabel="speed [rad/s]", title="load step of 10 PWM")
    for axes in (setpoint, load):
        axes.grid(alpha=0.3)
        axes.legend()
    return figure


def bode(design: Design) -> Figure:
    """The open loop with its margins."""
    figure = Figure(figsize=WIDE, layout="constrained")
    magnitude, phase = figure.subplots(1, 2)
    L = open_loop(Plant.of(design.model, design.period_s), design.gains.kp, design.gains.ki)
    rad_s = FREQUENCIES / design.period_s
    magnitude.loglog(rad_s, np.abs(L), color=MODEL)
    magnitude.axhline(1.0, color=OTHER, lw=0.8)
    magnitude.set(
        xlabel="frequency [rad/s]", ylabel="|L|", title=f"gain margin {design.loop.gain_margin:.2f}"
    )
    phase.semilogx(rad_s, np.degrees(np.unwrap(np.angle(L))), color=MODEL)
    phase.axhline(-180.0, color=OTHER, lw=0.8)
    phase.set(xlabel="frequency [rad/s]", ylabel="phase of L [deg]")
    phase.set_title(f"phase margin {design.loop.phase_margin_deg:.0f} deg")
    for axes in (magnitude, phase):
        axes.grid(alpha=0.3, which="both")
    return figure


def nyquist(design: Design) -> Figure:
    """The open loop and the circle that it must not enter: |1 + L| < 1 / Ms."""
    figure = Figure(figsize=HALF, layout="constrained")
    axes = figure.subplots()
    L = open_loop(Plant.of(design.model, design.period_s), design.gains.kp, design.gains.ki)
    turn: FloatArray = np.linspace(0.0, math.tau, 200)
    radius = 1.0 / design.loop.sensitivity
    axes.plot(L.real, L.imag, color=MODEL)
    axes.plot(-1.0 + radius * np.cos(turn), radius * np.sin(turn), "--", color=OTHER)
    axes.plot(-1.0, 0.0, "+", color="black")
    axes.set(xlim=(-2.2, 1.2), ylim=(-2.2, 0.8), xlabel="Re L", ylabel="Im L", aspect="equal")
    axes.set_title(f"Nyquist: Ms = {design.loop.sensitivity:.2f}")
    axes.grid(alpha=0.3)
    return figure


def sensitivity(design: Design) -> Figure:
    """|S| and |T| of the nominal loop, and |S| of the family."""
    figure = Figure(figsize=HALF, layout="constrained")
    axes = figure.subplots()
    rad_s = FREQUENCIES / design.period_s
    gains = (design.gains.kp, design.gains.ki)
    for member in family(design.model, design.uncertainty):
        plant = Plant.of(member, design.period_s)
        if judge(plant, *gains).stable:
            axes.loglog(rad_s, 1.0 / np.abs(1.0 + open_loop(plant, *gains)), color=OTHER, alpha=0.25, lw=0.8)
    L = open_loop(Plant.of(design.model, design.period_s), *gains)
    axes.loglog(rad_s, 1.0 / np.abs(1.0 + L), color=MODEL, label="|S|")
    axes.loglog(rad_s, np.abs(L / (1.0 + L)), color=MEASURED, label="|T|")
    axes.set(xlabel="frequency [rad/s]", ylim=(1e-2, 4.0))
    axes.set_title(f"sensitivity: Ms {design.loop.sensitivity:.2f}, worst {design.worst.sensitivity:.2f}")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    return figure


def pole_zero(design: Design) -> Figure:
    """Poles and zeros of the plant, and poles of the closed loop, in the z plane."""
    figure = Figure(figsize=HALF, layout="constrained")
    axes = figure.subplots()
    plant = Plant.of(design.model, design.period_s)
    closed = closed_loop_poles(plant, design.gains.kp, design.gains.ki)
    zeros = np.roots(plant.taps)
    turn: FloatArray = np.linspace(0.0, math.tau, 200)
    axes.plot(np.cos(turn), np.sin(turn), color=OTHER, lw=0.8)
    axes.plot([plant.pole, 0.0], [0.0, 0.0], "x", color=MEASURED, label="plant's poles")
    axes.plot(zeros.real, zeros.imag, "o", mfc="none", color=MEASURED, label="plant's zeros")
    axes.plot(closed.real, closed.imag, "x", color=MODEL, label="closed loop's poles")
    axes.set(
        aspect="equal", xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), title=f"z plane, T = {design.period_s:g} s"
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right", fontsize=8)
    return figure
