"""The nonlinear least-squares problem: fit the model to selected windows, with its covariance."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.covariance import correlated_lags, jacobian, sandwich_covariance
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.prediction import predict
from thumper_tuning.identify.segments import LogSegment, all_speeds, median_window_s
from thumper_tuning.logs.motor_log import BoolArray

DIFFERENCE_STEP = 1e-5
TOLERANCE = 1e-6  # of the loss: of 1000 windows, less than a twentieth of a standard deviation
TIME_CONSTANT_LIMITS_S = 0.001, 20.0
MAX_DELAY_S, MAX_DELAY_PERIODS = 0.6, 8.0  # or so many windows, if that is longer; of a sensor's window, too
LIMIT_MARGIN = 1e-3  # a variable this near to a limit ends there
BOUND_MARGIN = 1e-6  # the solver must start inside the bounds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitData:
    """What a fit is made to: the segments, whose sensor's window says how to read their speeds."""

    segments: list[LogSegment]

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
        return np.concatenate([s.speed_rad_s - predict(s, model) for s in self.segments])

    @property
    def sensor_window_s(self) -> float | None:
        """Averaging time of the logged speeds; None: of counts, over their own windows."""
        return self.segments[0].sensor_window_s

    def with_sensor_window(self, window_s: float | None) -> "FitData":
        """Return the same data with another averaging time."""
        return FitData(segments=[replace(s, sensor_window_s=window_s) for s in self.segments])


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
        """Return the model of the variables x."""
        return replace(
            start,
            gain=start.gain * float(np.exp(x[0])),
            time_constant_s=start.time_constant_s * float(np.exp(x[1])),
            friction_forward=float(x[2]) * self.drive,
            friction_backward=float(x[3]) * self.drive,
            delay_s=float(x[4]) * self.period_s,
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
        ftol=TOLERANCE,
        diff_step=diff_step,
        max_nfev=max_nfev,
    )
    result: FloatArray = solution.x
    return result


def longest_periods(period_s: float) -> float:
    """Return the longest delay, or sensor's window, that the fit looks for [windows]."""
    return max(MAX_DELAY_PERIODS, MAX_DELAY_S / period_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """The fitted model, and the averaging time of the logged speeds; None: of counts."""

    model: MotorModel
    sensor_window_s: float | None
    at_limit: str  # the parameter that ends at a limit of the search and is not determined, or empty
    uncertainty: Callable[[], Uncertainty]  # computes it: most callers need only the model


def solve(
    data: FitData, start: MotorModel, use: BoolArray, scale_rad_s: float, *, free_delay: bool = True
) -> Solution:
    """Fit the windows that `use` marks, from `start` and the sensor's window of `data`.

    Parameters
    ----------
    data : FitData
        The log. If it is of speeds, the sensor's window is fitted, too.
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
    has_window = data.sensor_window_s is not None
    x0 = np.array([*scaling.variables(start), (data.sensor_window_s or 0.0) / scaling.period_s])
    least, most = np.log(np.array(TIME_CONSTANT_LIMITS_S) / start.time_constant_s)
    low = np.array([-2.0, least, -1.5, -1.5, 0.0, 0.0])
    high = np.array(
        [2.0, most, 0.98, 0.98, longest_periods(scaling.period_s), longest_periods(scaling.period_s)]
    )
    free = np.array([True, True, True, True, free_delay, has_window])

    def all_of(x: FloatArray) -> FloatArray:
        found = x0.copy()
        found[free] = x
        return found

    def window_s(x: FloatArray) -> float | None:
        return float(all_of(x)[5]) * scaling.period_s if has_window else None

    def scaled_residuals(x: FloatArray) -> FloatArray:
        windowed = data.with_sensor_window(window_s(x)) if has_window else data
        return windowed.residuals(scaling.model(all_of(x), start))[use] * weight / scale_rad_s

    x = minimize_soft_l1(
        scaled_residuals,
        x0[free].tolist(),
        (low[free].tolist(), high[free].tolist()),
        np.array([0.1, 0.2, 0.05, 0.05, 0.2, 0.2])[free].tolist(),
        diff_step=DIFFERENCE_STEP,
        max_nfev=60,
    )
    model = scaling.model(all_of(x), start)

    def uncertainty() -> Uncertainty:
        covariance = np.zeros((len(x0), len(x0)))
        J = jacobian(scaled_residuals, x, low[free], high[free])
        covariance[np.ix_(free, free)] = sandwich_covariance(
            J, scaled_residuals(x), correlated_lags(scaling.period_s)
        )
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        friction_std = float(np.sqrt(max(covariance[2:4, 2:4].sum(), 0.0))) * 0.5  # of the mean of both
        return Uncertainty(
            gain=model.gain * float(std[0]),
            time_constant_s=model.time_constant_s * float(std[1]),
            friction=friction_std * scaling.drive,
            delay_s=float(std[4]) * scaling.period_s,
            friction_forward=float(std[2]) * scaling.drive,
            friction_backward=float(std[3]) * scaling.drive,
            sensor_window_s=float(std[5]) * scaling.period_s,
            delay_with_window_s2=float(covariance[4, 5]) * scaling.period_s**2,
        )

    return Solution(
        model=model,
        sensor_window_s=window_s(x),
        at_limit=_at_limit(all_of(x), low, high),
        uncertainty=uncertainty,
    )


def _at_limit(x: FloatArray, low: FloatArray, high: FloatArray) -> str:
    """Return the name of a parameter at a limit of the search, or an empty string.

    The lower limit of delay and sensor's window, zero, is a value like any other.
    """
    names = ("gain", "time constant", "forward friction", "backward friction", "delay", "sensor window")
    near_low, near_high = x - low < LIMIT_MARGIN, high - x < LIMIT_MARGIN
    near_low[4:] = False
    return next((name for name, near in zip(names, near_low | near_high, strict=True) if near), "")
