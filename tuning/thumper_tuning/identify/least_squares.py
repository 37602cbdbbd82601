"""One least-squares problem: the model that fits the chosen windows, and its covariance."""

from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.covariance import sandwich, slopes
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.prediction import predict
from thumper_tuning.identify.segments import Segment
from thumper_tuning.logs.motor_log import BoolArray

DIFFERENCE_STEP = 1e-5


def residuals(stretches: list[Segment], model: MotorModel, *, momentary: bool) -> FloatArray:
    """Measured minus predicted speed of every window [rad/s], shape (n,)."""
    return np.concatenate([s.speed_rad_s - predict(s, model, momentary=momentary) for s in stretches])


def weights(stretches: list[Segment]) -> FloatArray:
    """Windows shorter than usual count coarser: they weigh less. Windows that set a start speed weigh
    nothing."""
    parts = []
    usual_s = float(np.median(np.concatenate([s.windows_s for s in stretches])))
    for s in stretches:
        part = np.minimum(s.windows_s / usual_s, 1.0)
        if not s.at_rest:
            part[0] = 0.0
        parts.append(part)
    return np.concatenate(parts)


def solve(
    stretches: list[Segment],
    start: MotorModel,
    use: BoolArray,
    scale: float,
    momentary: bool,
    *,
    free_delay: bool = True,
) -> tuple[MotorModel, Uncertainty]:
    """Fit the windows that `use` marks, from `start`; `scale`: the residual [rad/s] above which less
    is believed."""
    from scipy.optimize import least_squares

    period_s = float(np.median(np.concatenate([s.windows_s for s in stretches])))
    drive = float(np.percentile(np.abs(np.concatenate([s.drive for s in stretches])), 95))
    weight = weights(stretches)[use]

    def model_of(x: FloatArray) -> MotorModel:
        return replace(
            start,
            gain=start.gain * float(np.exp(x[0])),
            time_constant_s=start.time_constant_s * float(np.exp(x[1])),
            friction_forward=float(x[2]) * drive,
            friction_backward=float(x[3]) * drive,
            delay_s=float(x[4]) * period_s if free_delay else start.delay_s,
        )

    def misfit(x: FloatArray) -> FloatArray:
        return residuals(stretches, model_of(x), momentary=momentary)[use] * weight / scale

    x0 = [0.0, 0.0, start.friction_forward / drive, start.friction_backward / drive]
    low, high = [-2.0, -3.0, -1.5, -1.5], [2.0, 3.0, 0.98, 0.98]
    if free_delay:
        x0, low, high = [*x0, start.delay_s / period_s], [*low, 0.0], [*high, 8.0]
    solution = least_squares(
        misfit,
        np.clip(x0, np.array(low) + 1e-6, np.array(high) - 1e-6),
        bounds=(low, high),
        loss="soft_l1",
        x_scale=[0.1, 0.2, 0.05, 0.05, 0.2][: len(x0)],
        diff_step=DIFFERENCE_STEP,
        max_nfev=60,
    )
    model = model_of(solution.x)
    covariance = sandwich(slopes(misfit, solution.x, np.array(low), np.array(high)), misfit(solution.x))
    std = np.sqrt(np.diag(covariance))
    mean_friction = float(np.sqrt(max(covariance[2:4, 2:4].sum(), 0.0))) * 0.5
    return model, Uncertainty(
        gain=model.gain * float(std[0]),
        time_constant_s=model.time_constant_s * float(std[1]),
        friction=mean_friction * drive,
        delay_s=float(std[4]) * period_s if free_delay else 0.0,
        friction_forward=float(std[2]) * drive,
        friction_backward=float(std[3]) * drive,
    )
