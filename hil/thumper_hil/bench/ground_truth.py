"""The robot's true poses and wheel speeds, for tests and figures."""

import numpy as np

from thumper.common.geometry import FloatArray

TRUTH_COLUMNS = ("time_s", "x_m", "y_m", "theta_rad", "left_rad_s", "right_rad_s")
MAX_ROWS = 720_000  # two hours at 100 Hz, 35 MB: limits memory when a robot runs for days


class GroundTruth:
    """A ring of rows `TRUTH_COLUMNS`. The operating system gives memory to a row when it is first written."""

    def __init__(self, max_rows: int = MAX_ROWS) -> None:
        self._ring = np.empty((max_rows, len(TRUTH_COLUMNS)))
        self._added = 0

    def add(self, row: tuple[float, ...]) -> None:
        """Add a row; the oldest one goes when the ring is full."""
        self._ring[self._added % len(self._ring)] = row
        self._added += 1

    def rows(self) -> FloatArray:
        """Return a copy of the rows, oldest first, shape (n, 6)."""
        if self._added <= len(self._ring):
            return self._ring[: self._added].copy()
        return np.roll(self._ring, -self._added, axis=0)

    def clear(self) -> None:
        """Discard all rows."""
        self._added = 0
