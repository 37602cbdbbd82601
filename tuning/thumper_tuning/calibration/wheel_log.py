"""Wheel counts and reference poses of a drive, as arrays and as CSV files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray

COUNT_COLUMNS = ("time_s", "left_counts", "right_counts")
POSE_COLUMNS = ("time_s", "x_m", "y_m", "theta_rad")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WheelLog:
    """Encoder counts at the board's ticks (n,) and poses of a reference on the same clock, shape (m, 4)."""

    time_s: FloatArray
    left_counts: FloatArray
    right_counts: FloatArray
    poses: FloatArray  # columns POSE_COLUMNS

    def part(self, begin: int, end: int) -> "WheelLog":
        """Ticks `begin` to `end`; the poses stay."""
        return WheelLog(
            time_s=self.time_s[begin:end],
            left_counts=self.left_counts[begin:end],
            right_counts=self.right_counts[begin:end],
            poses=self.poses,
        )

    def poses_at_ticks(self) -> FloatArray:
        """Reference x [m], y [m], unwrapped heading [rad] at the ticks, shape (n, 3)."""
        known_s, x, y, theta = self.poses.T
        heading = np.unwrap(theta)
        return np.column_stack([np.interp(self.time_s, known_s, column) for column in (x, y, heading)])


def write_csv(path: Path, names: tuple[str, ...], rows: FloatArray) -> Path:
    """Write rows, shape (n, len(names))."""
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


def read_csv(path: Path, names: tuple[str, ...]) -> FloatArray:
    """Read the named columns, shape (n, len(names)).

    Raises
    ------
    ThumperError
        The file cannot be read, lacks a column, or its times do not rise.
    """
    try:
        table: Any = np.genfromtxt(path, delimiter=",", names=True, dtype=np.float64)
    except (OSError, ValueError) as error:
        raise ThumperError(f"{path}: cannot read it: {error}", exit_code=EXIT_USAGE) from error
    missing = [name for name in names if name not in (table.dtype.names or ())]
    if missing:
        raise ThumperError(
            f"{path}: no column {missing[0]}; a CSV with the columns {', '.join(names)} is needed",
            exit_code=EXIT_USAGE,
        )
    rows = np.column_stack([np.atleast_1d(table[name]) for name in names])
    if len(rows) < 3 or not np.isfinite(rows).all() or (np.diff(rows[:, 0]) <= 0.0).any():
        raise ThumperError(
            f"{path}: needs 3 rows or more, all numbers, time_s rising", exit_code=EXIT_CHECK_FAILED
        )
    return rows


def joined(counts: FloatArray, poses: FloatArray) -> WheelLog:
    """Ticks that the reference covers.

    Raises
    ------
    ThumperError
        Fewer than 20 of them: the two are not on one clock.
    """
    inside = (counts[:, 0] >= poses[0, 0]) & (counts[:, 0] <= poses[-1, 0])
    if inside.sum() < 20:
        raise ThumperError(
            "the reference poses cover less than 20 ticks of the drive; are both on the same clock?",
            exit_code=EXIT_CHECK_FAILED,
        )
    time_s, left, right = counts[inside].T
    return WheelLog(time_s=time_s, left_counts=left, right_counts=right, poses=poses)
