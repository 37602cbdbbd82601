"""The figures of the speed loop in the tuning report, by python-control's plots."""

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import control
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thumper_tuning.design.fast_sensitivity import is_stable
from thumper_tuning.design.gains import Design
from thumper_tuning.design.loops import SpeedLoop
from thumper_tuning.design.plant import Plant
from thumper_tuning.design.plant_family import plant_family
from thumper_tuning.report.figures import (
    AFTER,
    BEFORE,
    MEASURED,
    MODEL,
    PANEL,
    REFERENCE,
    add_grid,
    new_figure,
)

STEP_DURATION_S = 2.5
LOAD_STEP_PWM = 10.0


@contextmanager
def _quiet() -> Iterator[None]:
    """Hide python-control's warnings about axes that exist and frequencies at the Nyquist frequency."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _family(design: Design) -> list[SpeedLoop]:
    plants = [Plant.from_model(m, design.period_s) for m in plant_family(design.model, design.uncertainty)]
    gains = design.gains
    return [SpeedLoop.of_board(p, gains.kp, gains.ki) for p in plants if is_stable(p, gains.kp, gains.ki)]


def setpoint_step(design: Design, before: tuple[float, float] | None) -> Figure:
    """Draw the responses to a unit step of the set-point, PI alone: before, after, plant family."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    ticks = round(STEP_DURATION_S / design.period_s)
    for k, loop in enumerate(_family(design)):
        label = "battery ±15 %, inertia x0.36 ... x2" if k == 0 else "_"  # one entry of the legend for all
        _plot(loop.step_response(ticks), axes, color=REFERENCE, alpha=0.25, lw=0.8, label=label)
    _draw_responses(axes, design, before, ticks, load_pwm=0.0)
    axes.set(title="unit step of the set-point, PI alone")
    return figure


def load_step(design: Design, before: tuple[float, float] | None) -> Figure:
    """Draw the responses to a step of the load, PI alone: before and after."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    _draw_responses(axes, design, before, round(STEP_DURATION_S / design.period_s), load_pwm=LOAD_STEP_PWM)
    axes.set(title=f"load step of {LOAD_STEP_PWM:g} PWM")
    return figure


def _draw_responses(
    axes: Axes, design: Design, before: tuple[float, float] | None, ticks: int, *, load_pwm: float
) -> None:
    loops = [("after", AFTER, design.loop)]
    if before is not None:
        loops.insert(0, ("before", BEFORE, SpeedLoop.of_board(design.plant, *before)))
    for label, color, loop in loops:
        _plot(loop.step_response(ticks, load_pwm=load_pwm), axes, color=color, marker="o", ms=3, label=label)
    axes.set(xlabel="time [s]", ylabel="speed [rad/s]")
    add_grid(axes)
    axes.legend()


def _plot(response: control.TimeResponseData, axes: Axes, **style: object) -> None:
    response.plot(ax=np.array([[axes]]), plot_inputs=False, title="", legend_loc=False, **style)


def bode(design: Design) -> Figure:
    """Draw the Bode plot of the open loop with its margins."""
    figure = new_figure(PANEL)
    axes = figure.subplots(2, 1, sharex=True)
    with _quiet():
        omega = design.loop.frequencies()[20:]
        control.bode_plot(
            design.loop.open_loop, omega, ax=axes, display_margins=True, color=MODEL, title="", grid=True
        )
    margins = design.margins
    axes[0].set_title(
        f"Bode of L: gain margin {margins.gain_margin_dB:.1f} dB, "
        f"phase margin {margins.phase_margin_deg:.0f}°"
    )
    return figure


def nyquist(design: Design) -> Figure:
    """Draw the Nyquist plot with the disk |1 + L| < 1 / Ms, which the loop does not enter."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    with _quiet():
        control.nyquist_plot(
            design.loop.open_loop,
            design.loop.frequencies(),
            ax=axes,
            color=MODEL,
            ms_circles=[round(design.margins.max_sensitivity, 2)],
            unit_circle=True,
            title="",
            max_curve_magnitude=6.0,
        )
    axes.set(xlim=(-2.2, 1.2), ylim=(-1.9, 1.1), aspect="equal")
    axes.set_title(f"Nyquist of L: Ms = {design.margins.max_sensitivity:.2f}")
    return figure


def sensitivity(design: Design) -> Figure:
    """Draw |S| and |T| of the nominal loop, and |S| of the plant family."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    omega = design.loop.frequencies()
    loops: list[tuple[control.TransferFunction, str, str | None]] = [
        (loop.sensitivity, REFERENCE, None) for loop in _family(design)
    ]
    loops += [(design.loop.sensitivity, MODEL, "|S|"), (design.loop.closed_loop, MEASURED, "|T|")]
    for system, color, label in loops:
        magnitude, _, _ = control.frequency_response(system, omega)
        alpha, width = (0.25, 0.8) if label is None else (1.0, 1.5)
        axes.loglog(omega, magnitude, color=color, alpha=alpha, lw=width, label=label)
    nominal, worst = design.margins.max_sensitivity, design.worst_case.max_sensitivity
    axes.set(xlabel="frequency [rad/s]", ylabel="magnitude", ylim=(1e-2, 4.0))
    axes.set_title(f"sensitivity: Ms {nominal:.2f}, worst case {worst:.2f}")
    add_grid(axes, which="both")
    axes.legend()
    return figure


def pole_zero(design: Design) -> Figure:
    """Draw poles and zeros of the plant and of the closed loop in the z plane."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    _unit_circle(axes)
    with _quiet():
        for system, color, label in (
            (design.loop.plant, MEASURED, "plant"),
            (design.loop.closed_loop, MODEL, "closed loop"),
        ):
            control.pole_zero_plot(system, ax=axes, color=color, label=label, title="", grid=False)
    _natural, damping = design.loop.damping()
    axes.set(aspect="equal", xlim=(-1.25, 1.25), ylim=(-1.25, 1.25))
    axes.set_title(f"poles and zeros, T = {design.period_s:g} s: damping ≥ {damping.min():.2f}")
    add_grid(axes)
    axes.legend(loc="upper right")
    return figure


def root_locus(design: Design) -> Figure:
    """Draw the closed-loop poles for all loop gains, and those of the design (squares)."""
    figure = new_figure(PANEL)
    axes = figure.subplots()
    _unit_circle(axes)
    with _quiet():
        control.root_locus_plot(
            design.loop.open_loop, ax=axes, grid=False, initial_gain=1.0, color=MODEL, title=""
        )
    axes.set(aspect="equal", xlim=(-1.9, 1.3), ylim=(-1.25, 1.25))
    axes.set_title("root locus over the loop gain; squares: the design")
    add_grid(axes)
    return figure


def _unit_circle(axes: Axes) -> None:
    angle = np.linspace(0.0, math.tau, 200)
    axes.plot(np.cos(angle), np.sin(angle), color=REFERENCE, lw=0.8)
