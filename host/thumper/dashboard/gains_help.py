"""What kp and ki do: step response and Bode plot as a drawing, margins and rise time as text."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.dashboard.loop_response import STEP_S, LoopResponse, loop_response

GAINS = ("kp", "ki", "kv", "ka")
MORE = 1.2  # the factor whose effect the text shows
DRAWN = 4  # each fourth point
WIDTH, HEIGHT, LEFT, TOP, BOTTOM = 340, 92, 34, 17, 8  # of one plot
SPEEDS, LEVELS_dB, PHASES_deg = (0.0, 0.5, 1.0, 1.5), (-20, 0, 20, 40), (-270, -180, -90, 0)
NO_MODEL = (
    "kv and ka are the wheel's model. Without them, or with a field empty, the response is unknown. "
    "Tune wheels finds them."
)


def gains_help(values: Mapping[str, Any], in_use: Mapping[str, float]) -> tuple[str, str]:
    """Return an SVG and a text for the edited values; dashed in the drawing: the values that are in use."""
    edited = _response(values)
    if edited is None:
        return "", NO_MODEL
    return _drawing(edited, _response(in_use)), explanation(values, edited)


def explanation(values: Mapping[str, Any], now: LoopResponse) -> str:
    """Return margins and rise time, and what more kp or ki would change."""
    if not now.stable:
        return "Unstable: the speed would oscillate more and more. Reduce kp or ki."
    text = [f"Phase margin {_degrees(now)}, gain margin {_factor(now)}, rise time {_rise(now)}, "]
    text += [f"overshoot {now.overshoot_percent:.0f}\N{NO-BREAK SPACE}%."]
    for name in ("kp", "ki"):
        more = _response({**values, name: MORE * values[name]})
        if more is not None:
            overshoot = f"overshoot {more.overshoot_percent:.0f}\N{NO-BREAK SPACE}%"
            effect = f"phase margin {_degrees(more)}, rise time {_rise(more)}, {overshoot}"
            effect = effect if more.stable else "unstable"
            text.append(f" {100 * (MORE - 1):.0f} % more {name}: {effect}.")
    return "".join(text)


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


def _factor(response: LoopResponse) -> str:
    return f"{response.gain_margin:.1f}" if math.isfinite(response.gain_margin) else "unlimited"


def _rise(response: LoopResponse) -> str:
    return f"{response.rise_time_s:.1f} s" if math.isfinite(response.rise_time_s) else f"over {STEP_S:g} s"


def _drawing(edited: LoopResponse, in_use: LoopResponse | None) -> str:
    low_rad_s, high_rad_s = edited.frequencies_rad_s[[0, -1]]
    span = f"{low_rad_s:.1f} to {high_rad_s:.0f} rad/s"
    responses = (edited, in_use)
    step = f"Speed after a step of the set-point by PI alone, 0 to {STEP_S:g} s"
    gain, phase = f"Open-loop gain [dB], {span}", f"Open-loop phase [°], {span}"
    plots = [
        _plot(step, SPEEDS, 1.0, [_step_line(each) for each in responses]),
        _plot(gain, LEVELS_dB, 0.0, [_bode_line(each, "gain") for each in responses]),
        _plot(phase, PHASES_deg, -180.0, [_bode_line(each, "phase") for each in responses]),
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
    title: str, ticks: tuple[float, ...], marked: float, lines: list[tuple[FloatArray, FloatArray] | None]
) -> tuple[str, str]:
    """Return the title and the content of an SVG."""
    low, high = min(ticks), max(ticks)

    def y_of(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (high - min(max(value, low), high)) / (high - low)

    parts = [f"<text x='{LEFT}' y='11'>{title}</text>"]
    for tick in ticks:
        kind = "marked" if tick == marked else "tick"
        y = y_of(tick)
        parts.append(f"<line class='{kind}' x1='{LEFT}' x2='{WIDTH}' y1='{y:.1f}' y2='{y:.1f}'/>")
        parts.append(f"<text x='{LEFT - 4}' y='{y + 4.0:.1f}' text-anchor='end'>{tick:g}</text>")
    for kind, line in zip(("edited", "used"), lines, strict=True):
        if line is not None:
            points = " ".join(
                f"{LEFT + (WIDTH - LEFT) * x:.1f},{y_of(y):.1f}" for x, y in zip(*line, strict=True)
            )
            parts.append(f"<polyline class='{kind}' points='{points}'/>")
    return title, "".join(parts)
