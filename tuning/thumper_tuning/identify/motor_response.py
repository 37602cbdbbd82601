"""Simulate the motor for a piecewise constant drive, in closed form between events."""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper_tuning.identify.model import MotorModel


class DriveSignal(NamedTuple):
    """A piecewise constant drive: `drive[i]` from `change_s[i]` [s] on, `initial` before the first change."""

    change_s: FloatArray  # (m,)
    drive: FloatArray  # (m,) [drive unit]
    initial: float  # [drive unit]


class MotorParameters(NamedTuple):
    """The fields of `MotorModel` as the kernels take them."""

    gain: float
    tau_s: float
    friction_forward: float
    friction_backward: float
    breakaway_ratio: float
    delay_s: float


def motor_parameters(model: MotorModel) -> MotorParameters:
    """Convert a model for the kernels."""
    return MotorParameters(
        gain=model.gain,
        tau_s=model.time_constant_s,
        friction_forward=model.friction_forward,
        friction_backward=model.friction_backward,
        breakaway_ratio=model.breakaway_ratio,
        delay_s=model.delay_s,
    )


@kernel
def _advance(omega: float, u: float, duration_s: float, motor: MotorParameters) -> tuple[float, float]:
    """Hold the drive `u` for `duration_s`; return the angle turned and the new speed."""
    turned = 0.0
    left = duration_s
    while left > 0.0:
        if omega == 0.0:
            if u > 0.0 and u > motor.breakaway_ratio * motor.friction_forward:
                direction = 1.0
            elif u < 0.0 and -u > motor.breakaway_ratio * motor.friction_backward:
                direction = -1.0
            else:
                return turned, 0.0
        else:
            direction = 1.0 if omega > 0.0 else -1.0
        friction = motor.friction_forward if direction > 0.0 else motor.friction_backward
        if friction < 0.0 and u * direction <= 0.0:
            friction = 0.0  # the offset of a nonlinear voltage map acts only with the drive
        final = motor.gain * (u - direction * friction)
        if omega == 0.0 and final * direction <= 0.0:
            return turned, 0.0
        if final * direction < 0.0:  # the motor is going to stop
            stop = motor.tau_s * math.log1p(-omega / final)
            if stop < left:
                turned += final * stop + motor.tau_s * omega
                omega = 0.0
                left -= stop
                continue
        decay = math.exp(-left / motor.tau_s)
        after = final + (omega - final) * decay
        turned += final * left + motor.tau_s * (omega - after)
        return turned, after
    return turned, omega


@kernel
def apply_changes(
    signal: DriveSignal, next_change: int, u: float, t_s: float, delay_s: float
) -> tuple[int, float]:
    """Apply the changes of the drive up to `t_s`; return the index of the next change and the drive."""
    while next_change < len(signal.change_s) and signal.change_s[next_change] + delay_s <= t_s:
        u = signal.drive[next_change]
        next_change += 1
    return next_change, u


@kernel
def next_event_s(signal: DriveSignal, next_change: int, t_s: float, query_s: float, delay_s: float) -> float:
    """Return the time of the next change of the drive, at least `t_s` and at most `query_s`."""
    if next_change < len(signal.change_s):
        change_s: float = signal.change_s[next_change] + delay_s
        if change_s < query_s:
            return max(change_s, t_s)
    return query_s


@kernel
def simulate(
    signal: DriveSignal, query_s: FloatArray, omega: float, motor: MotorParameters
) -> tuple[FloatArray, FloatArray]:
    """Return angle [rad] and speed [rad/s] at the query times.

    Parameters
    ----------
    signal : DriveSignal
        The drive; the motor responds to it `motor.delay_s` later.
    query_s : ndarray, shape (n,)
        Increasing times [s].
    omega : float
        Speed at `query_s[0]` [rad/s]. The angle there is zero.
    motor : MotorParameters
        The model.
    """
    n = len(query_s)
    angles = np.zeros(n)
    speeds = np.zeros(n)
    t = query_s[0]
    i, u = apply_changes(signal, 0, signal.initial, t, motor.delay_s)
    angle = 0.0
    speeds[0] = omega
    for j in range(1, n):
        while t < query_s[j]:
            until = next_event_s(signal, i, t, query_s[j], motor.delay_s)
            turned, omega = _advance(omega, u, until - t, motor)
            angle += turned
            t = until
            i, u = apply_changes(signal, i, u, t, motor.delay_s)
        angles[j] = angle
        speeds[j] = omega
    return angles, speeds


@kernel
def one_pole(
    change_s: FloatArray, inputs: FloatArray, query_s: FloatArray, initial: FloatArray, tau_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return angles and speeds of motors without friction, of gain 1, at the query times.

    Parameters
    ----------
    change_s : ndarray, shape (m,)
        Times at which the inputs change [s].
    inputs : ndarray, shape (k, m)
        The input of each motor from `change_s` on.
    query_s : ndarray, shape (n,)
        Increasing times [s].
    initial : ndarray, shape (k,)
        Speeds at `query_s[0]`, and the inputs before the first change.
    tau_s : float
        Time constant [s].

    Returns
    -------
    angles, speeds : ndarray, shape (k, n)
    """
    count, n = len(inputs), len(query_s)
    angles, speeds = np.zeros((count, n)), np.zeros((count, n))
    u, omega, angle = initial.copy(), initial.copy(), np.zeros(count)
    t_s, i = query_s[0], 0
    for j in range(n):
        while True:
            while i < len(change_s) and change_s[i] <= t_s:
                u[:] = inputs[:, i]
                i += 1
            if t_s >= query_s[j]:
                break
            until_s = min(change_s[i], query_s[j]) if i < len(change_s) else query_s[j]
            decay = math.exp(-(until_s - t_s) / tau_s)
            for k in range(count):
                after = u[k] + (omega[k] - u[k]) * decay
                angle[k] += u[k] * (until_s - t_s) + tau_s * (omega[k] - after)
                omega[k] = after
            t_s = until_s
        angles[:, j], speeds[:, j] = angle, omega
    return angles, speeds
