"""What kp and ki do: step response and Bode plot as a drawing, margins and rise time as a table."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.dashboard.loop_response import PERIOD_S, STEP_S, LoopResponse, loop_response

GAINS = ("kp", "ki", "kv", "ka")
EFFECTS = {
    "kp": "PWM per speed error. More: faster, less overshoot at first, then rough and unstable.",
    "ki": "PWM per speed error, summed up. Removes the error under load. More: sooner, more overshoot.",
    "ks": "PWM against static friction. Too little: the wheels start late. Too much: they start with a jerk.",
    "kv": "PWM per speed. Right if the integral part in Wheels stays near 0 at a constant speed.",
    "ka": "PWM per acceleration. Right if the speed neither lags the ramp nor leads it.",
}
HIGHEST_MS = 2.0  # a loop with a higher one is close to instability
MORE = 1.2  # the factor whose effect the table shows
COLUMNS = ("", "phase margin", "gain margin", "Ms", "rise time", "over\N{SOFT HYPHEN}shoot")
DRAWN = 4  # each fourth point
WIDTH, HEIGHT, LEFT, TOP, BOTTOM = 340, 104, 34, 17, 20  # of one plot
SPEEDS, LEVELS_dB, PHASES_deg = (0.0, 0.5, 1.0, 1.5), (-20, 0, 20, 40), (-270, -180, -90, 0)
TIMES_s, FREQUENCIES_rad_s = (0.0, 1.0, 2.0, 3.0), (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
NO_MODEL = (
    "kv and ka are the wheel's model. Without them, or with a field empty, the response is unknown. "
    "Tune wheels finds them."
)


def gains_help(values: Mapping[str, Any], in_use: Mapping[str, float]) -> tuple[str, str, str]:
    """Return an SVG, a table and a warning for the edited values; the drawing has those in use dashed."""
    edited = _response(values)
    if edited is None:
        return "", "", NO_MODEL
    table = _table(values, edited) if edited.stable else ""
    return _drawing(edited, _response(in_use)), table, gains_warning(values)


def gains_warning(values: Mapping[str, Any]) -> str:
    """Return why these values are dangerous; empty if they are not, or without a model."""
    response = _response(values)
    if response is None or (response.stable and response.sensitivity_peak <= HIGHEST_MS):
        return ""
    if not response.stable:
        return "Unstable: the speed would oscillate more and more. Reduce kp or ki."
    return f"Close to unstable: Ms is {response.sensitivity_peak:.2f}, above {HIGHEST_MS:g}. Reduce kp or ki."


def _table(values: Mapping[str, Any], now: LoopResponse) -> str:
    """Return margins and rise time now, and with more kp or ki."""
    rows = {"now": now}
    for name in ("kp", "ki"):
        more = _response({**values, name: MORE * values[name]})
        if more is not None:
            rows[f"{name} +{100 * (MORE - 1):.0f}\N{NO-BREAK SPACE}%"] = more
    head = "".join(f"<th>{column}</th>" for column in COLUMNS)
    body = "".join(f"<tr><th>{name}</th>{_cells(response)}</tr>" for name, response in rows.items())
    note = f"Ms is the peak of the sensitivity; aim: {HIGHEST_MS:g} or less."
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table><small>{note}</small>"


def _cells(response: LoopResponse) -> str:
    if not response.stable:
        return f"<td colspan='{len(COLUMNS) - 1}'>unstable</td>"
    figures = (
        _degrees(response),
        _decibels(response),
        f"{response.sensitivity_peak:.2f}",
        _rise(response),
        f"{response.overshoot_percent:.0f}\N{NO-BREAK SPACE}%",
    )
    return "".join(f"<td>{figure}</td>" for figure in figures)


def _response(values: Mapping[str, Any]) -> LoopResponse | None:
    """Return the response; None without a model, or while a field is empty."""
    numbers = {name: values.get(name) for name in GAINS}
    kp, ki, kv, ka = (
        float(value) if isinstance(value, int | float) and math.isfinite(value) else -1.0
        for value in numbers.values()
    )
    if min(kv, ka) <= 0.0 or min(kp, ki) < 0.0 or kp + ki == 0.0:
        return None
    return loop_response(kp=kp, ki=ki, kv=kv, ka=ka)


def _degrees(response: LoopResponse) -> str:
    return f"{response.phase_margin_deg:.0f}°" if math.isfinite(response.phase_margin_deg) else "unlimited"


def _decibels(response: LoopResponse) -> str:
    margin_dB = 20.0 * math.log10(response.gain_margin)
    return f"{margin_dB:.1f}\N{NO-BREAK SPACE}dB" if math.isfinite(margin_dB) else "unlimited"


def _rise(response: LoopResponse) -> str:
    if not math.isfinite(response.rise_time_s):
        return f"over {STEP_S:g} s"
    return f"{response.rise_time_s:.1f} s" if response.rise_time_s else f"under {PERIOD_S:g} s"  # in one tick


def _drawing(edited: LoopResponse, in_use: LoopResponse | None) -> str:
    responses = (edited, in_use)
    low, high = np.log(edited.frequencies_rad_s[[0, -1]])
    times = [(time_s / STEP_S, f"{time_s:g} s") for time_s in TIMES_s]
    rates = [((math.log(rate) - low) / (high - low), f"{rate:g}") for rate in FREQUENCIES_rad_s]
    step = "Speed after a step of the set-point, by PI alone"
    plots = [
        _plot(step, times, SPEEDS, 1.0, [_step_line(each) for each in responses]),
        _plot(
            "Open-loop gain [dB] by frequency [rad/s]",
            rates,
            LEVELS_dB,
            0.0,
            [_bode_line(each, "gain") for each in responses],
        ),
        _plot(
            "Open-loop phase [°] by frequency [rad/s]",
            rates,
            PHASES_deg,
            -180.0,
            [_bode_line(each, "phase") for each in responses],
        ),
    ]
    size = f"viewBox='0 0 {WIDTH} {HEIGHT}' role='img'"
    return "".join(f"<svg {size} aria-label='{title}'>{content}</svg>" for title, content in plots)


def _step_line(response: LoopResponse | None) -> tuple[FloatArray, FloatArray] | None:
    if response is None:
        return None
    # The counted speed holds for a tick.
    return np.repeat(response.times_s / STEP_S, 2)[1:], np.repeat(response.step, 2)[:-1]


def _bode_line(response: LoopResponse | None, what: str) -> tuple[FloatArray, FloatArray] | None:
    if response is None:
        return None
    places = np.linspace(0.0, 1.0, len(response.gain))
    values = 20.0 * np.log10(response.gain) if what == "gain" else response.phase_deg
    return places[::DRAWN], values[::DRAWN]


def _plot(
    title: str,
    places: list[tuple[float, str]],
    ticks: tuple[float, ...],
    marked: float,
    lines: list[tuple[FloatArray, FloatArray] | None],
) -> tuple[str, str]:
    """Return the title and the content of an SVG; `places` are the labels along the x axis, from 0 to 1."""
    low, high = min(ticks), max(ticks)

    def y_of(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (high - min(max(value, low), high)) / (high - low)

    parts = [f"<text x='{LEFT}' y='11'>{title}</text>"]
    for tick in ticks:
        kind = "marked" if tick == marked else "tick"
        y = y_of(tick)
        parts.append(f"<line class='{kind}' x1='{LEFT}' x2='{WIDTH}' y1='{y:.1f}' y2='{y:.1f}'/>")
        parts.append(f"<text x='{LEFT - 4}' y='{y + 4.0:.1f}' text-anchor='end'>{tick:g}</text>")
    for place, label in places:
        x, anchor = LEFT + (WIDTH - LEFT) * place, "middle" if place < 0.95 else "end"
        parts.append(f"<line class='tick' x1='{x:.1f}' x2='{x:.1f}' y1='{TOP}' y2='{HEIGHT - BOTTOM}'/>")
        parts.append(f"<text x='{x:.1f}' y='{HEIGHT - 7}' text-anchor='{anchor}'>{label}</text>")
    for kind, line in zip(("edited", "used"), lines, strict=True):
        if line is not None:
            points = " ".join(
                f"{LEFT + (WIDTH - LEFT) * x:.1f},{y_of(y):.1f}" for x, y in zip(*line, strict=True)
            )
            parts.append(f"<polyline class='{kind}' points='{points}'/>")
    return title, "".join(parts)
