"""State feedback by `control.dlqr`: with all states, and as a PI for the board.

States: counted speed, the earlier drives that still act, and the summed error q[k] = q[k-1] - y[k]. The board
has no input for the earlier drives, so its PI leaves their gains out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.design.fast_sensitivity import UNIT_CIRCLE, max_sensitivity
from thumper_tuning.design.plant import Plant
from thumper_tuning.design.tuning_rules import PiGains

if TYPE_CHECKING:
    import control

SPEED_WEIGHT = 3.0  # relative to the summed error; then the PI is near MIGO's (docs/results/tuning.md)
BISECTIONS = 24
LOG10_DRIVE_WEIGHT = (-6.0, 8.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StateFeedback:
    """u = -K x. `gains` are those of speed, earlier drives and summed error."""

    A: FloatArray
    B: FloatArray
    gains: FloatArray

    def open_loop(self, period_s: float) -> "control.StateSpace":
        """Return the loop, opened at the drive, as a python-control system."""
        import control

        return control.ss(self.A, self.B, self.gains[None, :], 0.0, period_s)

    def max_sensitivity(self) -> float:
        """Return Ms on the grid of `fast_sensitivity`."""
        identity = np.eye(len(self.A))
        states = np.linalg.solve(UNIT_CIRCLE[:, None, None] * identity - self.A, self.B[None])
        return float(1.0 / np.min(np.abs(1.0 + (states[:, :, 0] @ self.gains))))

    @property
    def load_error(self) -> float:
        """Summed error after a load step of one PWM; of a PI it is 1 / ki."""
        return float((1.0 + self.gains[1:-1].sum()) / -self.gains[-1])


def dlqr(plant: Plant, sensitivity_limit: float) -> PiGains:
    """Return the board's PI from the LQR with the least weight on the drive whose Ms is within the limit."""

    def pi(feedback: StateFeedback) -> PiGains:
        return PiGains(kp=float(feedback.gains[0]), ki=-float(feedback.gains[-1]))

    weight = _least_weight(
        lambda log10: (
            max_sensitivity(plant, (found := pi(_lqr(plant, log10))).kp, found.ki) <= sensitivity_limit
        )
    )
    return pi(_lqr(plant, weight))


def full_state_feedback(plant: Plant, sensitivity_limit: float) -> StateFeedback:
    """Return the LQR with all states and weight on the summed error alone, against loads.

    The board cannot run it. It shows what the earlier drives are worth.
    """
    weight = _least_weight(lambda log10: _lqr(plant, log10, 0.0).max_sensitivity() <= sensitivity_limit)
    return _lqr(plant, weight, 0.0)


def _least_weight(holds: Callable[[float], bool]) -> float:
    low, high = LOG10_DRIVE_WEIGHT
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _lqr(plant: Plant, log10_drive_weight: float, speed_weight: float = SPEED_WEIGHT) -> StateFeedback:
    import control

    order = len(plant.numerator) + 1
    A, B = np.zeros((order, order)), np.zeros((order, 1))
    A[0, 0], A[0, 1:-1], B[0, 0] = plant.pole, plant.numerator[1:], plant.numerator[0]
    if order > 2:
        B[1, 0] = 1.0
    for k in range(2, order - 1):
        A[k, k - 1] = 1.0
    A[-1] = -A[0]
    A[-1, -1], B[-1, 0] = 1.0, -B[0, 0]
    Q = np.zeros((order, order))
    Q[0, 0], Q[-1, -1] = speed_weight / plant.dc_gain**2, 1.0 / plant.dc_gain**2
    K, _, _ = control.dlqr(A, B, Q, np.array([[10.0**log10_drive_weight]]))
    return StateFeedback(A=A, B=B, gains=np.asarray(K, dtype=float)[0])
