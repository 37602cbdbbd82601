"""Split a log into segments without gaps: the drive, and mean speeds over windows."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.motor_response import DriveSignal
from thumper_tuning.logs.motor_log import BoolArray, DriveUnit, MotorLog
from thumper_tuning.logs.units import quantization_step

IndexArray = NDArray[np.intp]

MIN_WINDOW_S = 0.01
COARSE_COUNTS = 4.0  # with fewer counts per window the fit would mostly see rounding ...
MAX_MERGED_WINDOW_S = 0.05  # ... but longer windows would hide the time constant
# Of a log with more rows of speeds than this, only every n-th gives the first guess: the others cost time.
MANY_ROWS, MAX_SPEED_PERIOD_S = 2000, 0.025
IRREGULAR = 0.05  # rows: this share of them differs by this share
AT_REST_QUANTA = 0.6
MIN_STILL_ROWS = 6
SLOW = 0.02  # of the usual speed: noise of a motor that has not started yet


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogSegment:
    """Part of a log without a gap.

    The drive is `drive[i]` from `change_s[i]` on. Window j is from `edge_s[j]` to `edge_s[j + 1]`.
    `speed_rad_s[j]` is the mean over the window, or in a log of speeds
    over the sensor's window before its end.
    """

    change_s: FloatArray  # (m,)
    drive: FloatArray  # (m,)
    initial_drive: float  # before the first row
    at_rest: bool  # the motor is at rest at the first edge
    edge_s: FloatArray  # (n + 1,)
    speed_rad_s: FloatArray  # (n,)
    quantum_rad_s: float  # one count per median window; 0: unknown
    # In a log of speeds: each is the mean over this time before its edge; 0: the speed at the edge. The fit
    # estimates it, from a row's interval on. None: the mean over the window, as of counts.
    sensor_window_s: float | None = None
    ceiling_rad_s: float = math.inf  # the logger clipped speeds beyond it

    @property
    def windows_s(self) -> FloatArray:
        """Length of each window, shape (n,)."""
        return np.diff(self.edge_s)

    @property
    def is_clipped(self) -> BoolArray:
        """Whether each window shows only that the speed is at least the ceiling, shape (n,)."""
        return np.asarray(np.abs(self.speed_rad_s) >= self.ceiling_rad_s * (1.0 - 1e-9))

    @property
    def drive_signal(self) -> DriveSignal:
        """The drive as the kernels take it."""
        return DriveSignal(change_s=self.change_s, drive=self.drive, initial=self.initial_drive)

    def drive_at_windows(self) -> FloatArray:
        """Return the drive at the start of each window, shape (n,)."""
        rows = np.searchsorted(self.change_s, self.edge_s[:-1] + 1e-9, side="right") - 1
        return self.drive[np.clip(rows, 0, None)]


def median_window_s(segments: list[LogSegment]) -> float:
    """Return the median window length of all segments."""
    return float(np.median(np.concatenate([s.windows_s for s in segments])))


def all_speeds(segments: list[LogSegment]) -> FloatArray:
    """Return the speeds of all windows of all segments, shape (n,)."""
    return np.concatenate([s.speed_rad_s for s in segments])


def is_regular(segments: list[LogSegment]) -> bool:
    """Return whether nearly all windows last the same."""
    windows_s = np.concatenate([s.windows_s for s in segments])
    return (
        float(np.mean(np.abs(windows_s - np.median(windows_s)) > IRREGULAR * np.median(windows_s)))
        < IRREGULAR
    )


def with_sensor_window(segments: list[LogSegment], window_s: float | None) -> list[LogSegment]:
    """Return the segments with another averaging time of their speeds; None: over their own windows."""
    return [replace(s, sensor_window_s=window_s) for s in segments]


def split_segments(log: MotorLog) -> list[LogSegment]:
    """Split a log into the segments that are long enough to fit."""
    parts = [rows for whole in log.segments for rows in _without_coasting(log, whole)]
    found = [_segment(log, rows) for rows in parts]
    return [segment for segment in found if segment is not None]


def _without_coasting(log: MotorLog, rows: slice) -> list[slice]:
    """Drop what follows PWM 0 until the motor stops.

    Many bridges open at PWM 0. The motor then coasts on friction alone, and the log shows nothing of the
    driven motor. A drive of 0 V is taken as applied, unless the log says that it opens the bridge.
    """
    if log.drive_unit is not DriveUnit.PWM and not log.opens_at_zero:
        return [rows]
    off = log.drive[rows] == 0.0
    moves = _moves(log, rows)
    parts, first, k = [], 0, 1
    while k < len(off):
        if not off[k] or off[k - 1]:
            k += 1
            continue
        driven = np.flatnonzero(~off[k:])
        end = k + int(driven[0]) if driven.size else len(off)
        parts.append(slice(rows.start + first, rows.start + k + 1))
        moving = np.flatnonzero(moves[k + 1 : end])
        first = k + 1 + int(moving[-1]) if moving.size else k
        if first == end - 1:  # the motor has not stopped
            first = end
        k = end
    return [*parts, slice(rows.start + first, rows.stop)] if first < len(off) else parts


def _moves(log: MotorLog, rows: slice) -> BoolArray:
    """Return whether the motor has turned since the previous row, shape (n,).

    A motor that coasts does not reverse. So noisy speeds show at PWM 0 by their sign that it has stopped.
    """
    if log.speed_rad_s is not None:
        speed = log.speed_rad_s[rows]
        reverses = np.concatenate(([False], speed[1:] * speed[:-1] < 0.0))
        off = log.drive[rows] == 0.0
        starts = np.maximum.accumulate(np.where(off, 0, np.arange(1, len(off) + 1)))  # of PWM 0
        stopped = np.cumsum(reverses)
        return np.asarray((speed != 0.0) & ~(off & (stopped > stopped[np.minimum(starts, len(off) - 1)])))
    assert log.position_rad is not None
    return np.abs(np.diff(log.position_rad[rows], prepend=np.nan)) > AT_REST_QUANTA * log.quantum_rad


def _segment(log: MotorLog, rows: slice) -> LogSegment | None:
    time_s, drive = log.time_s[rows], log.drive[rows]
    values = log.speed_rad_s if log.position_rad is None else log.position_rad
    assert values is not None
    known = np.flatnonzero(np.isfinite(values[rows]))
    if len(known) < 3:
        return None
    y = values[rows][known]
    if log.position_rad is not None:
        known, y = _merge_windows(time_s, known, y, log.quantum_rad)
        if len(known) < 3:
            return None
        speed = np.diff(y) / np.diff(time_s[known])
        edge_s = time_s[known]
        still = abs(speed[0]) * (edge_s[1] - edge_s[0]) <= AT_REST_QUANTA * log.quantum_rad
        at_rest = (still and drive[0] == 0.0) or _starts_slow(drive, speed)
    else:
        # The window of the first row began one period earlier: its speed is the state at the start.
        speed, edge_s = y[1:], time_s[known]
        at_rest = y[0] == 0.0 or _is_still(y[: int(np.argmax(drive[known] != 0.0))]) or _starts_slow(drive, y)
    return LogSegment(
        change_s=time_s,
        drive=drive,
        initial_drive=0.0 if at_rest else float(drive[0]),
        at_rest=bool(at_rest),
        edge_s=edge_s,
        speed_rad_s=speed,
        quantum_rad_s=_quantum(log, speed, np.diff(edge_s)),
        sensor_window_s=log.period_s if log.position_rad is None else None,
    )


def _is_still(speed: FloatArray) -> bool:
    """Return whether the speeds before the drive begins are noise around zero, from the first one on."""
    if len(speed) < MIN_STILL_ROWS:
        return False
    late = speed[len(speed) // 2 :]
    noise = float(np.std(late))
    return bool(abs(late.mean()) < noise and abs(speed[:2].mean()) < 2.0 * noise)


def _starts_slow(drive: FloatArray, speed: FloatArray) -> bool:
    """Return whether the drive is on from the first row, and the motor does not move there yet."""
    return bool(drive[0] != 0.0 and abs(speed[0]) <= SLOW * np.percentile(np.abs(speed), 90))


def thinned(segments: list[LogSegment]) -> list[LogSegment]:
    """Return a log of many fast rows of speeds with every n-th of them, for a first guess.

    Each speed still is the mean over the sensor's window, or over its own row's interval.
    """
    rows, period_s = len(all_speeds(segments)), median_window_s(segments)
    n = min(math.ceil(rows / MANY_ROWS), math.floor(MAX_SPEED_PERIOD_S / period_s + 0.01))
    if n <= 1 or segments[0].sensor_window_s is None:
        return segments
    return [
        replace(s, edge_s=s.edge_s[::n], speed_rad_s=s.speed_rad_s[n - 1 :: n])
        for s in segments
        if len(s.speed_rad_s) >= n
    ]


def _quantum(log: MotorLog, speed: FloatArray, windows_s: FloatArray) -> float:
    return log.quantum_rad / float(np.median(windows_s)) if log.quantum_rad else quantization_step(speed)


def _merge_windows(
    time_s: FloatArray, known: IndexArray, y: FloatArray, quantum_rad: float
) -> tuple[IndexArray, FloatArray]:
    """Skip positions until the windows are long enough; a position sums up all motion before it."""
    period_s = float(np.median(np.diff(time_s[known])))
    min_window_s = 2.0 * MIN_WINDOW_S if period_s < MIN_WINDOW_S else period_s
    travelled_rad = float(np.abs(np.diff(y)).sum())
    if quantum_rad > 0.0 and travelled_rad > 0.0:
        mean_rad_s = travelled_rad / float(time_s[known[-1]] - time_s[known[0]])
        min_window_s = max(min_window_s, min(COARSE_COUNTS * quantum_rad / mean_rad_s, MAX_MERGED_WINDOW_S))
    if period_s >= min_window_s:
        return known, y
    keep = [0]
    for j in range(1, len(known)):
        if time_s[known[j]] - time_s[known[keep[-1]]] >= min_window_s - 1e-9:
            keep.append(j)
    return known[keep], y[keep]
