"""Grey-box models with one more effect each, a second time constant or backlash, and their validation fit.

They show whether the first-order model leaves something unexplained. Both are simulated in small steps,
because backlash has no closed form.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper_tuning.identify.cross_validation import validate
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.least_squares import Scaling, minimize_soft_l1, weights
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import (
    DriveSignal,
    MotorParameters,
    apply_changes,
    motor_parameters,
    next_event_s,
)
from thumper_tuning.identify.prediction import predict_by
from thumper_tuning.identify.segments import LogSegment, median_window_s
from thumper_tuning.logs.motor_log import BoolArray

STEPS_PER_TIME_CONSTANT = 8.0
MIN_STEP_S = 2e-4
SECOND_SHARES = (0.05, 0.3)  # second time constants to start from, of the first
COASTING_RATIO = 4.0  # a load that is free in the backlash slows down with this many motor time constants


class ExtraParameters(NamedTuple):
    """What a richer model adds; 0, 0 and 1 add nothing."""

    lag_s: float  # second time constant, between drive and torque
    backlash_rad: float  # the motor turns this far before it moves its load
    motor_share: float  # of the inertia, in (0, 1]; alone, the motor has the time constant share x tau


@dataclass(frozen=True, slots=True, kw_only=True)
class RicherModel:
    """The first-order model with a second time constant, or with backlash before its load."""

    kind: str  # "second order" or "backlash"
    base: MotorModel
    second_time_constant_s: float = 0.0
    play_rad: float = 0.0
    motor_share: float = 1.0  # of the inertia
    fit_percent: float = 0.0  # on held-out windows

    @property
    def extra(self) -> ExtraParameters:
        """The added parameters as the kernel takes them."""
        return ExtraParameters(
            lag_s=self.second_time_constant_s, backlash_rad=self.play_rad, motor_share=self.motor_share
        )


def fit_richer_models(segments: list[LogSegment], fit: Fit, *, backlash: bool = True) -> list[RicherModel]:
    """Fit the richer models and cross-validate them with the same blocks as the first-order fit."""
    found = [fit_second_order(segments, fit)]
    if backlash:
        start = RicherModel(kind="backlash", base=fit.model, play_rad=0.3, motor_share=0.3)
        found.append(_solve(segments, fit, start, ~fit.is_glitch))
    return [_validated(segments, fit, model) for model in found]


def fit_second_order(segments: list[LogSegment], fit: Fit) -> RicherModel:
    """Fit the second-order model, from two second time constants; not validated."""
    tau_s, least_s = fit.model.time_constant_s, 0.1 * median_window_s(segments)
    found = []
    for share in SECOND_SHARES:
        lag_s = max(share * tau_s, least_s)
        # The lag delays the speed as a dead time or a longer time constant does: take it from both.
        base = replace(
            fit.model,
            time_constant_s=tau_s - min(max(lag_s - fit.model.delay_s, 0.0), 0.5 * tau_s),
            delay_s=max(fit.model.delay_s - lag_s, 0.0),
        )
        start = RicherModel(kind="second order", base=base, second_time_constant_s=lag_s)
        found.append(_solve(segments, fit, start, ~fit.is_glitch))
    return min(found, key=lambda model: _cost(segments, fit, model))


def predict_richer(s: LogSegment, model: RicherModel) -> FloatArray:
    """Return the speeds of all windows of a segment [rad/s], read as `predict` reads them."""
    motor, extra = motor_parameters(model.base), model.extra

    def response(time_s: FloatArray, omega: float) -> tuple[FloatArray, FloatArray]:
        return simulate_richer(s.drive_signal, time_s, omega, motor, extra)

    return predict_by(response, s, model.base)


def _residuals(segments: list[LogSegment], model: RicherModel) -> FloatArray:
    return np.concatenate([s.speed_rad_s - predict_richer(s, model) for s in segments])


def _cost(segments: list[LogSegment], fit: Fit, model: RicherModel) -> float:
    use = ~fit.is_glitch
    scaled = (_residuals(segments, model) * weights(segments))[use] / fit.scale_rad_s
    return float(np.sum(np.sqrt(1.0 + scaled**2)))


def _validated(segments: list[LogSegment], fit: Fit, found: RicherModel) -> RicherModel:
    use = ~fit.is_glitch
    validation = validate(
        segments, fit, lambda kept: _residuals(segments, _solve(segments, fit, found, use & kept))
    )
    return replace(found, fit_percent=validation.fit_percent)


def _solve(segments: list[LogSegment], fit: Fit, start: RicherModel, use: BoolArray) -> RicherModel:
    scaling = Scaling.from_segments(segments)
    weight = weights(segments)[use] / fit.scale_rad_s
    x0 = scaling.variables(start.base)
    low, high = [-2.0, -2.0, -1.5, -1.5, 0.0, -3.0], [2.0, 2.0, 0.98, 0.98, 8.0, 3.0]
    if start.second_time_constant_s > 0.0:
        x0, model_of = [*x0, 0.0], _second_order_from(start, scaling)
    else:
        x0, model_of = [*x0, 0.0, start.motor_share], _backlash_from(start, scaling)
        low, high = [*low, 0.02], [*high, 1.0]
    x = minimize_soft_l1(
        lambda x: _residuals(segments, model_of(x))[use] * weight,
        x0,
        (low, high),
        [0.1, 0.2, 0.05, 0.05, 0.2, 0.3, 0.2],
        diff_step=1e-3,
        max_nfev=40,
    )
    return model_of(x)


def _second_order_from(start: RicherModel, scaling: Scaling) -> Callable[[FloatArray], RicherModel]:
    """Return the function from the solver's variables to a second-order model."""
    return lambda x: replace(
        start,
        base=scaling.model(x, start.base),
        second_time_constant_s=start.second_time_constant_s * float(np.exp(x[5])),
    )


def _backlash_from(start: RicherModel, scaling: Scaling) -> Callable[[FloatArray], RicherModel]:
    """Return the function from the solver's variables to a backlash model."""
    return lambda x: replace(
        start,
        base=scaling.model(x, start.base),
        play_rad=start.play_rad * float(np.exp(x[5])),
        motor_share=float(x[6]),
    )


class _State(NamedTuple):
    """Motor and load at one time."""

    omega: float  # of the motor [rad/s]
    load: float  # speed of the load [rad/s]
    gap: float  # motor angle in the backlash, 0 ... backlash [rad]
    filtered_drive: float  # behind the second time constant [drive unit]


@kernel
def _step(
    state: _State, u: float, h: float, motor: MotorParameters, extra: ExtraParameters
) -> tuple[_State, float]:
    """Hold the drive `u` for `h` seconds; return the new state and the angle that the motor turned."""
    omega, load, gap, filtered = state.omega, state.load, state.gap, state.filtered_drive
    play, share = extra.backlash_rad, extra.motor_share
    acting = u  # mean over the step of what is behind the second time constant
    if extra.lag_s > 0.0:
        after_lag = u + (filtered - u) * math.exp(-h / extra.lag_s)
        acting = u + (filtered - after_lag) * extra.lag_s / h
        filtered = after_lag
    direction = math.copysign(1.0, omega) if omega != 0.0 else math.copysign(1.0, acting)
    friction = motor.friction_forward if direction > 0.0 else motor.friction_backward
    if friction < 0.0 and acting * direction <= 0.0:
        friction = 0.0  # as in `motor_response`
    final = motor.gain * (acting - direction * friction)
    stays_at_rest = omega == 0.0 and acting * direction <= motor.breakaway_ratio * max(friction, 0.0)
    moves_load = _moves_load(state, final, play)
    if moves_load and play > 0.0 and omega != load:
        omega = share * omega + (1.0 - share) * load  # inelastic impact
    tau = motor.tau_s if moves_load else share * motor.tau_s
    after = 0.0 if stays_at_rest else final + (omega - final) * math.exp(-h / tau)
    if omega != 0.0 and after * omega < 0.0:
        after = 0.0
    turned = 0.5 * (omega + after) * h
    if moves_load and after != 0.0:
        turned = final * h + tau * (omega - after)
    if moves_load:
        load = after
    else:
        load *= math.exp(-h / (COASTING_RATIO * motor.tau_s))
        gap = min(max(gap + (0.5 * (omega + after) - load) * h, 0.0), play)
        if (gap >= play and after > load) or (gap <= 0.0 and after < load):
            impact = share * after + (1.0 - share) * load
            turned, after, load = 0.5 * (omega + impact) * h, impact, impact
    return _State(after, load, gap, filtered), turned


@kernel
def _moves_load(state: _State, final: float, backlash: float) -> bool:
    """Return whether the motor is in contact with its load and pushes it; always without backlash."""
    if backlash == 0.0:
        return True
    at_front = state.gap >= backlash and state.omega >= state.load and final > state.omega
    at_back = state.gap <= 0.0 and state.omega <= state.load and final < state.omega
    return at_front or at_back


@kernel
def simulate_richer(
    signal: DriveSignal, query_s: FloatArray, omega: float, motor: MotorParameters, extra: ExtraParameters
) -> tuple[FloatArray, FloatArray]:
    """Return angle [rad] and speed [rad/s] of the motor at the query times; see `simulate`.

    Steps are an eighth of the motor's time constant, at least 0.2 ms. Within a step the drive acts with its
    exact mean behind the second time constant, so that one needs no shorter steps.
    """
    n = len(query_s)
    angles, speeds = np.zeros(n), np.zeros(n)
    t = query_s[0]
    i, u = apply_changes(signal, 0, signal.initial, t, motor.delay_s)
    play = extra.backlash_rad
    gap = play if omega > 0.0 else 0.0 if omega < 0.0 else 0.5 * play
    own_tau = motor.tau_s if play == 0.0 else extra.motor_share * motor.tau_s
    max_step = max(own_tau / STEPS_PER_TIME_CONSTANT, MIN_STEP_S)
    state, angle = _State(omega, omega, gap, u), 0.0
    speeds[0] = omega
    for j in range(1, n):
        while t < query_s[j]:
            until = next_event_s(signal, i, t, query_s[j], motor.delay_s)
            h = min(until - t, max_step)
            state, turned = _step(state, u, h, motor, extra)
            angle += turned
            t = until if h == until - t else t + h
            i, u = apply_changes(signal, i, u, t, motor.delay_s)
        angles[j] = angle
        speeds[j] = state.omega
    return angles, speeds
