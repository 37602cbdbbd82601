"""Linear models of a log: impulse response, and ERA by python-control (`eigensys_realization`).

A linear model has no friction. It sees the drive without it: minus the friction of a fit where the motor
turns, zero where it rests. Without a fit, the mean of each direction is subtracted from drive and speed.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.segments import LogSegment, median_window_s
from thumper_tuning.logs.motor_log import BoolArray

if TYPE_CHECKING:
    import control

RESPONSE_S = 1.2
MIN_MARKOV, MAX_MARKOV = 8, 80
REGULAR = 0.2  # windows may differ by this share; a linear discrete model has one period
AT_REST = 0.03  # of the 95th percentile of the speed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearRecord:
    """All segments in one record of one period, each behind the drive that it starts with, shape (n,)."""

    drive: FloatArray
    speed: FloatArray
    known: BoolArray  # the speed is measured, not of the rows between the segments
    window: BoolArray  # the row is a window of the log; in the log's order
    period_s: float
    markov_count: int


def linear_record(segments: list[LogSegment], model: MotorModel | None) -> LinearRecord | None:
    """Return the record, or None if the rows are not regular."""
    period_s = round(median_window_s(segments), 9)  # python-control compares periods exactly
    windows_s = np.concatenate([s.windows_s for s in segments])
    if float(np.mean(np.abs(windows_s - period_s) > REGULAR * period_s)) > REGULAR:
        return None
    count = int(np.clip(RESPONSE_S / period_s, MIN_MARKOV, MAX_MARKOV))
    speeds = np.concatenate([s.speed_rad_s for s in segments])
    still = AT_REST * float(np.percentile(np.abs(speeds), 95))
    drives = np.concatenate([mean_drive(s) for s in segments])
    if model is None:
        for side in (speeds > still, speeds < -still):
            if side.any():
                drives[side] -= drives[side].mean()
                speeds[side] -= speeds[side].mean()
    else:
        forward, backward = (drives > 0.0) & (speeds > still), (drives < 0.0) & (speeds < -still)
        drives = drives - model.friction_forward * forward + model.friction_backward * backward
        drives[np.abs(speeds) <= still] = 0.0
    parts = _with_history(segments, drives, speeds, count)
    drive, speed, known, window = (np.concatenate(column) for column in zip(*parts, strict=True))
    return LinearRecord(
        drive=drive, speed=speed, known=known, window=window, period_s=period_s, markov_count=count
    )


def _with_history(
    segments: list[LogSegment], drives: FloatArray, speeds: FloatArray, count: int
) -> list[tuple[FloatArray, FloatArray, BoolArray, BoolArray]]:
    """Put `count` rows before each segment: the drive that holds its first speed, with unknown speeds."""
    moving = speeds != 0.0
    gain = float(drives[moving] @ speeds[moving] / max(float(drives[moving] @ drives[moving]), 1e-12))
    parts, first = [], 0
    for s in segments:
        last = first + len(s.speed_rad_s)
        u, y = drives[first:last], speeds[first:last]
        before = 0.0 if s.at_rest or gain <= 0.0 else y[0] / gain
        new = np.arange(count + len(y)) >= count
        parts.append(
            (np.concatenate((np.full(count, before), u)), np.concatenate((np.zeros(count), y)), new, new)
        )
        first = last
    return parts


def mean_drive(s: LogSegment) -> FloatArray:
    """Return the mean drive over each window, shape (n,)."""
    ends_s = np.append(s.change_s[1:], max(s.edge_s[-1], s.change_s[-1]) + 1.0)
    charge = np.concatenate(([0.0], np.cumsum(s.drive * (ends_s - s.change_s))))
    at_edges = np.interp(s.edge_s, np.append(s.change_s, ends_s[-1]), charge)
    result: FloatArray = np.diff(at_edges) / s.windows_s
    return result


def impulse_response(record: LinearRecord, use: BoolArray | None = None) -> FloatArray:
    """Return the Markov parameters [D CB CAB ...] of the windows that `use` marks.

    This is the least-squares problem of `control.markov`, which needs every row, without the unknown rows.
    """
    known = record.known.copy()
    if use is not None:
        known[record.window] &= use
    count = record.markov_count
    history = sliding_window_view(np.concatenate((np.zeros(count - 1), record.drive)), count)[:, ::-1]
    return np.asarray(np.linalg.lstsq(history[known], record.speed[known], rcond=None)[0], dtype=float)


def realize(markov: FloatArray, order: int, period_s: float) -> "control.StateSpace":
    """Return the ERA model of the impulse response."""
    import control

    rows = (len(markov) - 1) // 2  # of the Hankel matrix
    system, _ = control.eigensys_realization(markov, order, m=rows, n=rows)
    return control.ss(system.A, system.B, system.C, system.D, period_s, inputs=["drive"], outputs=["speed"])


def predict_linear(record: LinearRecord, system: "control.StateSpace") -> FloatArray:
    """Return the speeds of all windows by the linear system, shape (number of windows,)."""
    import control

    time_s = np.arange(len(record.drive)) * record.period_s
    response = control.forced_response(system, time_s, record.drive)
    speeds: FloatArray = np.asarray(response.outputs, dtype=float).ravel()[record.window]
    return speeds


def slow_time_constant_s(system: "control.StateSpace") -> float | None:
    """Return the time constant of the real pole with most of the gain, or None if there is none."""
    poles, modes = np.linalg.eig(system.A)
    share = (system.C @ modes)[0] * np.linalg.solve(modes, system.B)[:, 0] / (1.0 - poles)
    pole = poles[int(np.abs(share).argmax())]
    if abs(pole.imag) > 1e-9 or not 0.0 < pole.real < 1.0:
        return None
    return float(-system.dt / np.log(pole.real))
