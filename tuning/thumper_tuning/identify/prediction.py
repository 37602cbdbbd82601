"""Predict the speeds of a log from its drive; the measured speeds set only the initial speed."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import motor_parameters, simulate
from thumper_tuning.identify.segments import LogSegment

MIN_SHARE = 0.1  # of the initial speed in the first window; with less it cannot be determined


def predict(segment: LogSegment, model: MotorModel, *, instantaneous: bool) -> FloatArray:
    """Return the speeds [rad/s] of all windows, shape (n,).

    They are means over the windows, or with `instantaneous` the speeds at their ends.
    """
    omega = initial_speed(segment, model, instantaneous=instantaneous)
    angles, speeds = simulate(segment.drive_signal, segment.edge_s, omega, motor_parameters(model))
    return speeds[1:] if instantaneous else np.diff(angles) / segment.windows_s


def initial_speed(segment: LogSegment, model: MotorModel, *, instantaneous: bool) -> float:
    """Return the speed at the first edge for which the model predicts the first window [rad/s]."""
    if segment.at_rest:
        return 0.0
    mean, window_s = float(segment.speed_rad_s[0]), float(segment.edge_s[1] - segment.edge_s[0])
    drive = float(segment.drive[0]) if model.delay_s < 0.5 * window_s else segment.initial_drive
    direction = math.copysign(1.0, mean)
    friction = model.friction_forward if direction > 0.0 else model.friction_backward
    final = 0.0 if mean == 0.0 else model.gain * (drive - direction * friction)
    x = window_s / model.time_constant_s
    share = math.exp(-x) if instantaneous else -math.expm1(-x) / x  # of the initial speed in the window
    largest = float(np.percentile(np.abs(segment.speed_rad_s), 95))
    initial = final + (mean - final) / share if share > MIN_SHARE else mean
    if initial * direction < 0.0:
        return 0.0
    return float(np.clip(initial, -largest, largest))
