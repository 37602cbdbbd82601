"""A stretch of a log without a gap, as the fit sees it: what was driven, and mean speeds over windows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import BoolArray, DriveUnit, MotorLog
from thumper_tuning.logs.units import smallest_step

IndexArray = NDArray[np.intp]

SHORTEST_WINDOW_S = 0.01
COARSE_COUNTS = 4.0  # with fewer counts in a window the fit would be one of rounding ...
LONGEST_THINNED_S = 0.05  # ... but longer windows would hide the time constant
AT_REST_QUANTA = 0.6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Segment:
    """The drive is `drive[i]` from `change_s[i]`; window j ends at `edge_s[j + 1]` and begins at `edge_s[j]`.

    `speed_rad_s[j]` is the mean over the window, or, for a log of momentary speeds, the speed at its end.
    """

    change_s: FloatArray  # (m,)
    drive: FloatArray  # (m,)
    before: float  # drive ahead of the stretch
    at_rest: bool  # the motor stands at the first edge
    edge_s: FloatArray  # (n + 1,)
    speed_rad_s: FloatArray  # (n,)
    quantum_rad_s: float  # what one count is in a usual window; 0 = not known
    continues: bool  # the log goes on over a gap: what was driven before is not known

    @property
    def windows_s(self) -> FloatArray:
        """Length of each window, shape (n,)."""
        return np.diff(self.edge_s)


def cut(log: MotorLog) -> list[Segment]:
    """The stretches of a log that are long enough to say something."""
    parts = [rows for whole in log.stretches for rows in _without_coasting(log, whole)]
    found = [_stretch(log, rows, k > 0) for k, rows in enumerate(parts)]
    return [stretch for stretch in found if stretch is not None]


def _without_coasting(log: MotorLog, rows: slice) -> list[slice]:
    """Leave out what follows PWM 0 until the motor stands: many bridges open then, and it rolls on friction
    alone, which says nothing of the driven motor. A drive in volts is one that really is applied at 0."""
    if log.drive_unit is not DriveUnit.PWM:
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
        if first == end - 1:  # it has not come to rest
            first = end
        k = end
    return [*parts, slice(rows.start + first, rows.stop)] if first < len(off) else parts


def _moves(log: MotorLog, rows: slice) -> BoolArray:
    """Whether the motor has turned since the row before, shape (n,)."""
    if log.speed_rad_s is not None:
        return np.asarray(log.speed_rad_s[rows] != 0.0)
    assert log.position_rad is not None
    return np.abs(np.diff(log.position_rad[rows], prepend=np.nan)) > AT_REST_QUANTA * log.quantum_rad


def _stretch(log: MotorLog, rows: slice, continues: bool) -> Segment | None:
    time_s, drive = log.time_s[rows], log.drive[rows]
    values = log.speed_rad_s if log.position_rad is None else log.position_rad
    assert values is not None
    known = np.flatnonzero(np.isfinite(values[rows]))
    if len(known) < 3:
        return None
    y = values[rows][known]
    if log.position_rad is not None:
        known, y = _thin(time_s, known, y, log.quantum_rad)
        if len(known) < 3:
            return None
        speed = np.diff(y) / np.diff(time_s[known])
        edge_s = time_s[known]
        rests = (
            abs(speed[0]) * (edge_s[1] - edge_s[0]) <= AT_REST_QUANTA * log.quantum_rad and drive[0] == 0.0
        )
    else:
        # The first row's own window began one period earlier: it tells the state at the start.
        speed, edge_s = y[1:], time_s[known]
        rests = y[0] == 0.0
    return Segment(
        change_s=time_s,
        drive=drive,
        before=0.0 if rests else float(drive[0]),
        at_rest=bool(rests),
        edge_s=edge_s,
        speed_rad_s=speed,
        quantum_rad_s=_quantum(log, speed, np.diff(edge_s)),
        continues=continues,
    )


def _quantum(log: MotorLog, speed: FloatArray, windows_s: FloatArray) -> float:
    return log.quantum_rad / float(np.median(windows_s)) if log.quantum_rad else smallest_step(speed)


def _thin(
    time_s: FloatArray, known: IndexArray, y: FloatArray, quantum_rad: float
) -> tuple[IndexArray, FloatArray]:
    """Leave out positions until the windows are long enough: nothing is lost, a position sums up what was."""
    period_s = float(np.median(np.diff(time_s[known])))
    shortest_s = 2.0 * SHORTEST_WINDOW_S if period_s < SHORTEST_WINDOW_S else period_s
    travelled_rad = float(np.abs(np.diff(y)).sum())
    if quantum_rad > 0.0 and travelled_rad > 0.0:
        mean_rad_s = travelled_rad / float(time_s[known[-1]] - time_s[known[0]])
        shortest_s = max(shortest_s, min(COARSE_COUNTS * quantum_rad / mean_rad_s, LONGEST_THINNED_S))
    if period_s >= shortest_s:
        return known, y
    keep = [0]
    for j in range(1, len(known)):
        if time_s[known[j]] - time_s[known[keep[-1]]] >= shortest_s - 1e-9:
            keep.append(j)
    return known[keep], y[keep]
