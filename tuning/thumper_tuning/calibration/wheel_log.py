"""Wheel counts and reference poses of a drive, as arrays and as CSV files."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.files import read_table_bytes, write_whole
from thumper.common.geometry import FloatArray
from thumper.odometry.pose_buffer import interpolate_poses

COUNT_COLUMNS = ("time_s", "left_counts", "right_counts")
POSE_COLUMNS = ("time_s", "x_m", "y_m", "theta_rad")
MAX_MB = 200.0
MIN_TICKS = 20
MIN_ROWS = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WheelLog:
    """Encoder counts at the board's ticks (n,), and reference poses on the same clock, shape (m, 4)."""

    time_s: FloatArray
    left_counts: FloatArray
    right_counts: FloatArray
    poses: FloatArray  # columns POSE_COLUMNS

    def ticks(self, start: int, stop: int) -> "WheelLog":
        """Return the log of the ticks `start` to `stop`, with all poses."""
        return WheelLog(
            time_s=self.time_s[start:stop],
            left_counts=self.left_counts[start:stop],
            right_counts=self.right_counts[start:stop],
            poses=self.poses,
        )

    def poses_at_ticks(self) -> FloatArray:
        """Return reference x [m], y [m] and unwrapped heading [rad] at the ticks, shape (n, 3)."""
        return interpolate_poses(self.time_s, self.poses[:, 0], self.poses[:, 1:])


def write_csv(path: Path, names: tuple[str, ...], rows: FloatArray) -> Path:
    """Write rows, shape (n, len(names))."""
    with write_whole(path) as stream:
        np.savetxt(stream, rows, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


def read_csv(path: Path, names: tuple[str, ...]) -> FloatArray:
    """Read the named columns, shape (n, len(names)).

    Raises
    ------
    ThumperError
        The file cannot be read, a column is missing, or its times do not increase.
    """
    try:
        content = read_table_bytes(path, MAX_MB)
        if not content.strip():
            raise ValueError("it is empty")  # numpy would also print a warning
        table: Any = np.genfromtxt(io.BytesIO(content), delimiter=",", names=True, dtype=np.float64)
    except (OSError, ValueError, IndexError) as error:  # IndexError: no line for the names
        raise ThumperError(f"{path}: cannot read the file: {error}", exit_code=EXIT_USAGE) from error
    missing = [name for name in names if name not in (table.dtype.names or ())]
    if missing:
        raise ThumperError(
            f"{path}: no column {missing[0]}; pass a CSV with the columns {', '.join(names)}",
            exit_code=EXIT_USAGE,
        )
    rows = np.column_stack([np.atleast_1d(table[name]) for name in names])
    if len(rows) < MIN_ROWS or not np.isfinite(rows).all() or (np.diff(rows[:, 0]) <= 0.0).any():
        raise ThumperError(
            f"{path}: needs at least {MIN_ROWS} rows, all numbers, with increasing time_s",
            exit_code=EXIT_USAGE,
        )
    return rows


def join_counts_and_poses(counts: FloatArray, poses: FloatArray) -> WheelLog:
    """Return the log of the ticks that the reference covers.

    Raises
    ------
    ThumperError
        There are fewer than 20 such ticks: the two are not on the same clock.
    """
    inside = (counts[:, 0] >= poses[0, 0]) & (counts[:, 0] <= poses[-1, 0])
    if inside.sum() < MIN_TICKS:
        raise ThumperError(
            f"the reference poses cover fewer than {MIN_TICKS} ticks of the drive; check that both use the "
            "same clock",
            exit_code=EXIT_CHECK_FAILED,
        )
    time_s, left, right = counts[inside].T
    return WheelLog(time_s=time_s, left_counts=left, right_counts=right, poses=poses)
