"""Predict the speeds of a log from its drive; the measured speeds set only the initial speed."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import (
    DriveSignal,
    MotorParameters,
    motor_parameters,
    simulate,
)
from thumper_tuning.identify.segments import LogSegment

MIN_SHARE = 0.1  # of the initial speed in the first window; with less it cannot be determined


def predict(segment: LogSegment, model: MotorModel, *, instantaneous: bool) -> FloatArray:
    """Return the speeds [rad/s] of all windows, shape (n,).

    They are means over the windows, or with `instantaneous` over the sensor's window before their ends.
    """
    omega = initial_speed(segment, model, instantaneous=instantaneous)
    motor = motor_parameters(model)
    speeds = observe(segment, segment.drive_signal, omega, motor, instantaneous=instantaneous)
    return np.clip(speeds, -segment.ceiling_rad_s, segment.ceiling_rad_s)


def observe(
    s: LogSegment, signal: DriveSignal, omega: float, motor: MotorParameters, *, instantaneous: bool
) -> FloatArray:
    """Return what the log would hold of a motor that this drive moves, from speed `omega`, shape (n,)."""
    if not instantaneous or s.sensor_window_s == 0.0:
        angles, speeds = simulate(signal, s.edge_s, omega, motor)
        return speeds[1:] if instantaneous else np.diff(angles) / s.windows_s
    begins_s = s.edge_s[1:] - s.sensor_window_s
    times_s, at = np.unique(
        np.concatenate((s.edge_s, np.maximum(begins_s, s.edge_s[0]))), return_inverse=True
    )
    angles, _ = simulate(signal, times_s, omega, motor)
    n = len(s.edge_s)
    before = omega * np.maximum(s.edge_s[0] - begins_s, 0.0)  # turned before the segment
    turned: FloatArray = angles[at[1:n]] - angles[at[n:]] + before
    return turned / s.sensor_window_s


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
