"""Richer motors, tried and compared by how well they predict what they were not fitted to."""

import math
from dataclasses import dataclass, replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper_tuning.identify.cross_validation import blocks_of, fit_percent
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.least_squares import weights
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.prediction import start_speed
from thumper_tuning.identify.segments import Segment
from thumper_tuning.logs.motor_log import BoolArray

STEPS_PER_TIME_CONSTANT = 8.0
SHORTEST_STEP_S = 2e-4


@kernel
def respond_two(
    change_s: FloatArray,
    drive: FloatArray,
    before: float,
    omega: float,
    query_s: FloatArray,
    gain: float,
    tau: float,
    forward: float,
    backward: float,
    delay: float,
    lag: float,
    play: float,
    share: float,
) -> tuple[FloatArray, FloatArray]:
    """Angle [rad] and speed [rad/s] of the motor at the query times; arguments as in `respond`, and
    three more.

    Parameters
    ----------
    lag : float
        Second time constant [s]: what pushes the motor follows the drive with it. 0 = none.
    play : float
        The motor turns this far [rad] before it takes its load along. 0 = none.
    share : float
        The motor's own part of the inertia, in (0, 1]; alone it has the time constant share x tau.
    """
    n = len(query_s)
    angles, speeds = np.zeros(n), np.zeros(n)
    t, i, u = query_s[0], 0, before
    while i < len(change_s) and change_s[i] + delay <= t:
        u = drive[i]
        i += 1
    push, angle, load = u, 0.0, omega
    gap = play if omega > 0.0 else 0.0 if omega < 0.0 else 0.5 * play  # where in the play the motor stands
    own = tau if play == 0.0 else share * tau
    largest = max(min(own, lag if lag > 0.0 else own) / STEPS_PER_TIME_CONSTANT, SHORTEST_STEP_S)
    speeds[0] = omega
    for j in range(1, n):
        while t < query_s[j]:
            until = query_s[j]
            if i < len(change_s) and change_s[i] + delay < until:
                until = max(change_s[i] + delay, t)
            h = min(until - t, largest)
            push = u + (push - u) * math.exp(-h / lag) if lag > 0.0 else u
            direction = math.copysign(1.0, omega) if omega != 0.0 else math.copysign(1.0, push)
            friction = forward if direction > 0.0 else backward
            wish = gain * (push - direction * friction)
            stands = omega == 0.0 and wish * direction <= 0.0
            touching = play == 0.0 or (gap >= play and omega >= load) or (gap <= 0.0 and omega <= load)
            pushing = play == 0.0 or (gap >= play and wish > omega) or (gap <= 0.0 and wish < omega)
            after = omega
            if touching and pushing:
                if play > 0.0 and omega != load:
                    omega = share * omega + (1.0 - share) * load  # they meet
                after = 0.0 if stands else wish + (omega - wish) * math.exp(-h / tau)
                if omega != 0.0 and after * omega < 0.0:
                    after = 0.0
                load = after
            else:
                after = 0.0 if stands else wish + (omega - wish) * math.exp(-h / own)
                if omega != 0.0 and after * omega < 0.0:
                    after = 0.0
                # The load rolls on with what friction it has of its own: as quickly as the whole would
                # settle.
                load *= math.exp(-h / (4.0 * tau))
                gap = min(max(gap + (0.5 * (omega + after) - load) * h, 0.0), play)
                if (gap >= play and after > load) or (gap <= 0.0 and after < load):
                    after = share * after + (1.0 - share) * load
                    load = after
            angle += 0.5 * (omega + after) * h
            omega = after
            t = until if h == until - t else t + h
            while i < len(change_s) and change_s[i] + delay <= t:
                u = drive[i]
                i += 1
        angles[j] = angle
        speeds[j] = omega
    return angles, speeds


@dataclass(frozen=True, slots=True, kw_only=True)
class RicherModel:
    """The base model with a second time constant, or with play before its load; unused values are 0 and 1."""

    kind: str  # "second order" or "play and mass"
    base: MotorModel
    second_time_constant_s: float = 0.0
    play_rad: float = 0.0
    motor_share: float = 1.0  # of the inertia
    fit_percent: float = 0.0  # on held-out windows


def compare_variants(stretches: list[Segment], fit: Fit) -> list[RicherModel]:
    """Fit both richer motors and cross-validate them with the same blocks as the plain one."""
    period_s = float(np.median(np.concatenate([s.windows_s for s in stretches])))
    tau_s = fit.model.time_constant_s
    second = RicherModel(
        kind="second order", base=fit.model, second_time_constant_s=max(0.2 * tau_s, 0.1 * period_s)
    )
    played = RicherModel(kind="play and mass", base=fit.model, play_rad=0.3, motor_share=0.3)
    return [_validated(stretches, fit, start) for start in (second, played)]


def _validated(stretches: list[Segment], fit: Fit, start: RicherModel) -> RicherModel:
    use = ~fit.is_glitch
    whole = _solve(stretches, fit, start, use)
    blocks = blocks_of(stretches)
    held_out = np.zeros(len(blocks))
    for block in np.unique(blocks):
        out = blocks == block
        held_out[out] = _residuals(stretches, _solve(stretches, fit, whole, use & ~out))[out]
    speed = np.concatenate([s.speed_rad_s for s in stretches])
    counted = use & (weights(stretches) > 0.0)
    return replace(whole, fit_percent=fit_percent(speed[counted], held_out[counted]))


def predict_richer(s: Segment, model: RicherModel) -> FloatArray:
    """Mean speeds over the windows of a stretch [rad/s]."""
    base = model.base
    angles, _ = respond_two(
        s.change_s,
        s.drive,
        s.before,
        start_speed(s, base, momentary=False),
        s.edge_s,
        base.gain,
        base.time_constant_s,
        base.friction_forward,
        base.friction_backward,
        base.delay_s,
        model.second_time_constant_s,
        model.play_rad,
        model.motor_share,
    )
    return np.diff(angles) / s.windows_s


def _residuals(stretches: list[Segment], model: RicherModel) -> FloatArray:
    return np.concatenate([s.speed_rad_s - predict_richer(s, model) for s in stretches])


def _solve(stretches: list[Segment], fit: Fit, start: RicherModel, use: BoolArray) -> RicherModel:
    from scipy.optimize import least_squares

    drive = float(np.percentile(np.abs(np.concatenate([s.drive for s in stretches])), 95))
    period_s = float(np.median(np.concatenate([s.windows_s for s in stretches])))
    weight = weights(stretches)[use] / fit.scale_rad_s
    has_lag = start.second_time_constant_s > 0.0

    def model_of(x: FloatArray) -> RicherModel:
        base = replace(
            start.base,
            gain=start.base.gain * float(np.exp(x[0])),
            time_constant_s=start.base.time_constant_s * float(np.exp(x[1])),
            friction_forward=float(x[2]) * drive,
            friction_backward=float(x[3]) * drive,
            delay_s=float(x[4]) * period_s,
        )
        if has_lag:
            return replace(
                start, base=base, second_time_constant_s=start.second_time_constant_s * float(np.exp(x[5]))
            )
        return replace(
            start, base=base, play_rad=start.play_rad * float(np.exp(x[5])), motor_share=float(x[6])
        )

    x0 = [0.0, 0.0, start.base.friction_forward / drive, start.base.friction_backward / drive]
    x0 += [start.base.delay_s / period_s, 0.0] + ([] if has_lag else [start.motor_share])
    low = [-2.0, -2.0, -1.5, -1.5, 0.0, -3.0] + ([] if has_lag else [0.02])
    high = [2.0, 2.0, 0.98, 0.98, 8.0, 3.0] + ([] if has_lag else [1.0])
    solution = least_squares(
        lambda x: _residuals(stretches, model_of(x))[use] * weight,
        np.clip(x0, np.array(low) + 1e-6, np.array(high) - 1e-6),
        bounds=(low, high),
        loss="soft_l1",
        x_scale=[0.1, 0.2, 0.05, 0.05, 0.2, 0.3, 0.2][: len(x0)],
        diff_step=1e-3,
        max_nfev=40,
    )
    return model_of(solution.x)
