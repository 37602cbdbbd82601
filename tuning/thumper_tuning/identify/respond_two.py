"""Two richer motors, integrated in small steps: a second pole in the drive, and a load behind play."""

import math

import numpy as np

from thumper.geometry import FloatArray
from thumper.kernel import kernel

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
