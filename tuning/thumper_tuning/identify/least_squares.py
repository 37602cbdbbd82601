"""The nonlinear least-squares problem: fit the model to selected windows, with its covariance."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.covariance import jacobian, sandwich_covariance
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.prediction import predict
from thumper_tuning.identify.segments import LogSegment, all_speeds, median_window_s
from thumper_tuning.logs.motor_log import BoolArray

DIFFERENCE_STEP = 1e-5
BOUND_MARGIN = 1e-6  # the solver must start inside the bounds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitData:
    """What a fit is made to: the segments, and how their speeds are to be read."""

    segments: list[LogSegment]
    instantaneous: bool  # the log holds instantaneous speeds, not means over the windows

    @property
    def speed_rad_s(self) -> FloatArray:
        """Speeds of all windows, shape (n,)."""
        return all_speeds(self.segments)

    @property
    def period_s(self) -> float:
        """Median window."""
        return median_window_s(self.segments)

    def residuals(self, model: MotorModel) -> FloatArray:
        """Return measured minus predicted speed of every window [rad/s], shape (n,)."""
        return np.concatenate(
            [s.speed_rad_s - predict(s, model, instantaneous=self.instantaneous) for s in self.segments]
        )


def weights(segments: list[LogSegment]) -> FloatArray:
    """Return the weight of every window, shape (n,).

    Windows shorter than the median weigh less, because one count is a larger speed there. A window that sets
    an initial speed weighs nothing.
    """
    parts = []
    median_s = median_window_s(segments)
    for s in segments:
        part = np.minimum(s.windows_s / median_s, 1.0)
        if not s.at_rest:
            part[0] = 0.0
        parts.append(part)
    return np.concatenate(parts)


def are_shown(segments: list[LogSegment]) -> BoolArray:
    """Return which windows show how well a model predicts: they count, and are not clipped; shape (n,)."""
    clipped = np.concatenate([s.is_clipped for s in segments])
    return np.asarray((weights(segments) > 0.0) & ~clipped)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """Units of the solver's variables: drive and time, so that all variables are near 1."""

    drive: float  # 95th percentile of the drive
    period_s: float

    @classmethod
    def from_segments(cls, segments: list[LogSegment]) -> "Scaling":
        """Return the scaling for a log."""
        drive = np.percentile(np.abs(np.concatenate([s.drive for s in segments])), 95)
        return cls(drive=float(drive), period_s=median_window_s(segments))

    def variables(self, model: MotorModel) -> list[float]:
        """Return the solver's variables of `model`: ln gain, ln tau, frictions, delay.

        The logarithms are relative to the model.
        """
        return [
            0.0,
            0.0,
            model.friction_forward / self.drive,
            model.friction_backward / self.drive,
            model.delay_s / self.period_s,
        ]

    def model(self, x: FloatArray, start: MotorModel) -> MotorModel:
        """Return the model of the variables x; the delay of `start` if x has only four."""
        return replace(
            start,
            gain=start.gain * float(np.exp(x[0])),
            time_constant_s=start.time_constant_s * float(np.exp(x[1])),
            friction_forward=float(x[2]) * self.drive,
            friction_backward=float(x[3]) * self.drive,
            delay_s=float(x[4]) * self.period_s if len(x) > 4 else start.delay_s,
        )


def minimize_soft_l1(
    function: Callable[[FloatArray], FloatArray],
    x0: list[float],
    bounds: tuple[list[float], list[float]],
    x_scale: list[float],
    *,
    diff_step: float,
    max_nfev: int,
) -> FloatArray:
    """Return the x that minimizes the soft-L1 loss of the residual function within the bounds."""
    from scipy.optimize import least_squares

    low, high = bounds
    solution = least_squares(
        function,
        np.clip(x0, np.array(low) + BOUND_MARGIN, np.array(high) - BOUND_MARGIN),
        bounds=(low, high),
        loss="soft_l1",
        x_scale=x_scale[: len(x0)],
        diff_step=diff_step,
        max_nfev=max_nfev,
    )
    result: FloatArray = solution.x
    return result


def solve(
    data: FitData, start: MotorModel, use: BoolArray, scale_rad_s: float, *, free_delay: bool = True
) -> tuple[MotorModel, Uncertainty]:
    """Fit the windows that `use` marks, from `start`.

    Parameters
    ----------
    data : FitData
        The log.
    start : MotorModel
        Initial guess.
    use : ndarray of bool, shape (n,)
        The windows to fit.
    scale_rad_s : float
        Residual above which the soft-L1 loss turns from quadratic to linear.
    free_delay : bool
        Fit the delay; else keep that of `start`.
    """
    scaling = Scaling.from_segments(data.segments)
    weight = weights(data.segments)[use]

    def scaled_residuals(x: FloatArray) -> FloatArray:
        return data.residuals(scaling.model(x, start))[use] * weight / scale_rad_s

    low, high = [-2.0, -3.0, -1.5, -1.5, 0.0], [2.0, 3.0, 0.98, 0.98, 8.0]
    count = 5 if free_delay else 4
    low, high = low[:count], high[:count]
    x = minimize_soft_l1(
        scaled_residuals,
        scaling.variables(start)[:count],
        (low, high),
        [0.1, 0.2, 0.05, 0.05, 0.2],
        diff_step=DIFFERENCE_STEP,
        max_nfev=60,
    )
    model = scaling.model(x, start)
    J = jacobian(scaled_residuals, x, np.array(low), np.array(high))
    covariance = sandwich_covariance(J, scaled_residuals(x))
    std = np.sqrt(np.diag(covariance))
    friction_std = float(np.sqrt(max(covariance[2:4, 2:4].sum(), 0.0))) * 0.5  # of the mean of both
    return model, Uncertainty(
        gain=model.gain * float(std[0]),
        time_constant_s=model.time_constant_s * float(std[1]),
        friction=friction_std * scaling.drive,
        delay_s=float(std[4]) * scaling.period_s if free_delay else 0.0,
        friction_forward=float(std[2]) * scaling.drive,
        friction_backward=float(std[3]) * scaling.drive,
    )
