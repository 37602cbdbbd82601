"""The motor's answer to a piecewise constant drive, in closed form between its events."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel

Floats = FloatArray


@kernel
def _advance(
    omega: float,
    u: float,
    left: float,
    gain: float,
    tau: float,
    forward: float,
    backward: float,
    ratio: float,
) -> tuple[float, float]:
    """Let `left` seconds pass at a held drive; return the angle turned and the new speed."""
    turned = 0.0
    while left > 0.0:
        if omega == 0.0:
            if u > 0.0 and u > ratio * forward:
                direction = 1.0
            elif u < 0.0 and -u > ratio * backward:
                direction = -1.0
            else:
                return turned, 0.0
        else:
            direction = 1.0 if omega > 0.0 else -1.0
        friction = forward if direction > 0.0 else backward
        if friction < 0.0 and u * direction <= 0.0:
            friction = 0.0  # the offset of a bent voltage map: it follows the drive, it does not push alone
        final = gain * (u - direction * friction)
        if omega == 0.0 and final * direction <= 0.0:
            return turned, 0.0
        if final * direction < 0.0:  # it will stop
            stop = tau * math.log1p(-omega / final)
            if stop < left:
                turned += final * stop + tau * omega
                omega = 0.0
                left -= stop
                continue
        decay = math.exp(-left / tau)
        after = final + (omega - final) * decay
        turned += final * left + tau * (omega - after)
        return turned, after
    return turned, omega


@kernel
def respond(
    change_s: Floats,
    drive: Floats,
    before: float,
    omega: float,
    query_s: Floats,
    gain: float,
    tau: float,
    forward: float,
    backward: float,
    ratio: float,
    delay: float,
) -> tuple[Floats, Floats]:
    """Angle [rad] and speed [rad/s] at the query times.

    Parameters
    ----------
    change_s, drive : ndarray, shape (m,)
        The drive is `drive[i]` from `change_s[i]` [s] on, felt `delay` later; `before` [drive unit]
        ahead of that.
    omega : float
        Speed at `query_s[0]` [rad/s]; the angle starts at zero there.
    query_s : ndarray, shape (n,)
        Rising times [s].
    gain, tau, forward, backward, ratio, delay : float
        The fields of `MotorModel`, in its order of meaning.
    """
    n = len(query_s)
    angles = np.zeros(n)
    speeds = np.zeros(n)
    t = query_s[0]
    i = 0
    u = before
    while i < len(change_s) and change_s[i] + delay <= t:
        u = drive[i]
        i += 1
    angle = 0.0
    speeds[0] = omega
    for j in range(1, n):
        while t < query_s[j]:
            until = query_s[j]
            if i < len(change_s) and change_s[i] + delay < until:
                until = max(change_s[i] + delay, t)
            turned, omega = _advance(omega, u, until - t, gain, tau, forward, backward, ratio)
            angle += turned
            t = until
            while i < len(change_s) and change_s[i] + delay <= t:
                u = drive[i]
                i += 1
        angles[j] = angle
        speeds[j] = omega
    return angles, speeds
