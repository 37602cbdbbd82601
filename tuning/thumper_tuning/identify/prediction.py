"""Predict the speeds of a log from its drive; the measured speeds set only the initial speed."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import motor_parameters, simulate
from thumper_tuning.identify.segments import LogSegment

LEAST_WINDOW_S = 1e-4  # of a sensor; a shorter one is that of an instantaneous speed
MIN_SHARE = 0.1  # of the initial speed in the first window; with less it cannot be determined
HEAD_TIME_CONSTANTS = 3.0  # the windows after a start in motion that still show the initial speed
HEAD_SHARE = 0.15  # of a segment's windows at most: the others show whether the model predicts
FIRST_SHARE = 0.9  # of the information in the first window alone: with more, the others add nothing

Speed = TypeVar("Speed", float, FloatArray)  # of one motor, or of several
Motion = tuple[FloatArray, FloatArray]
Response = Callable[[FloatArray, float], Motion]
"""Angles [rad] and speeds [rad/s] at the times [s], from the speed [rad/s] at the first of them."""


def predict(segment: LogSegment, model: MotorModel) -> FloatArray:
    """Return the speeds [rad/s] of all windows, shape (n,).

    They are means over the windows, or over the sensor's window before their ends.
    """
    motor = motor_parameters(model)

    def response(time_s: FloatArray, omega: float) -> tuple[FloatArray, FloatArray]:
        return simulate(segment.drive_signal, time_s, omega, motor)

    return predict_by(response, segment, model)


def predict_by(response: Response, segment: LogSegment, model: MotorModel) -> FloatArray:
    """Return the speeds of all windows by a response whose slow part is `model`, shape (n,)."""
    omega = initial_speed(response, segment, model)
    speeds = observe(segment, response, omega)
    return np.clip(speeds, -segment.ceiling_rad_s, segment.ceiling_rad_s)


def observe(s: LogSegment, response: Callable[[FloatArray, Speed], Motion], omega: Speed) -> FloatArray:
    """Return what the log would hold of motors that respond so, from speed `omega`, shape (..., n)."""
    if s.sensor_window_s is None:
        return np.diff(response(s.edge_s, omega)[0]) / s.windows_s
    if s.sensor_window_s < LEAST_WINDOW_S:
        return response(s.edge_s, omega)[1][..., 1:]
    begins_s = s.edge_s[1:] - s.sensor_window_s
    times_s = np.concatenate((s.edge_s, np.maximum(begins_s, s.edge_s[0])))
    order = np.argsort(times_s, kind="stable")  # merges two sorted parts
    sorted_angles, _ = response(times_s[order], omega)
    angles = np.empty(sorted_angles.shape)
    angles[..., order] = sorted_angles
    n = len(s.edge_s)
    before = np.multiply.outer(omega, np.maximum(s.edge_s[0] - begins_s, 0.0))  # turned before the segment
    turned: FloatArray = angles[..., 1:n] - angles[..., n:] + before
    return turned / s.sensor_window_s


def initial_speed(response: Response, segment: LogSegment, model: MotorModel) -> float:
    """Return the speed at the first edge that explains the first windows best [rad/s].

    A guess from the first window is corrected by least squares over the windows in which the initial speed
    still shows: one noisy window alone would offset all of them.
    """
    if segment.at_rest:
        return 0.0
    guess = _from_first_window(segment, model)
    tau_s = model.time_constant_s
    head_s = HEAD_TIME_CONSTANTS * tau_s + (segment.sensor_window_s or 0.0)
    last = int(np.searchsorted(segment.edge_s, segment.edge_s[0] + head_s)) + 1
    last = min(last, int(HEAD_SHARE * len(segment.speed_rad_s)) + 1)
    head = replace(segment, edge_s=segment.edge_s[:last], speed_rad_s=segment.speed_rad_s[: last - 1])
    if guess == 0.0 or len(head.speed_rad_s) < 2:
        return guess
    shape = observe(head, lambda time_s, omega: _decay(time_s, omega, tau_s), 1.0)
    power = float(shape @ shape)
    if shape[0] ** 2 >= FIRST_SHARE * power:
        return guess
    residual = head.speed_rad_s - observe(head, response, guess)
    limit = 3.0 * float(np.median(np.abs(residual)))  # a glitch
    corrected = guess + float(shape @ np.clip(residual, -limit, limit)) / power
    return corrected if corrected * guess > 0.0 else 0.0


def _decay(time_s: FloatArray, omega: float, tau_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the angles and speeds of a motor without drive and friction."""
    speeds = omega * np.exp(-(time_s - time_s[0]) / tau_s)
    return tau_s * (omega - speeds), speeds


def _from_first_window(segment: LogSegment, model: MotorModel) -> float:
    """Return the speed at the first edge for which the model predicts the first window [rad/s]."""
    mean, window_s = float(segment.speed_rad_s[0]), float(segment.edge_s[1] - segment.edge_s[0])
    drive = float(segment.drive[0]) if model.delay_s < 0.5 * window_s else segment.initial_drive
    direction = math.copysign(1.0, mean)
    friction = model.friction_forward if direction > 0.0 else model.friction_backward
    final = 0.0 if mean == 0.0 else model.gain * (drive - direction * friction)
    sensor_s = window_s if segment.sensor_window_s is None else segment.sensor_window_s
    x = np.clip(sensor_s, LEAST_WINDOW_S, window_s) / model.time_constant_s
    # Of the initial speed in the first window.
    share = math.exp(x - window_s / model.time_constant_s) * -math.expm1(-x) / x
    initial = final + (mean - final) / share if share > MIN_SHARE else mean
    if initial * direction < 0.0:
        return 0.0
    speeds = np.abs(segment.speed_rad_s)
    if np.count_nonzero(speeds > abs(initial)) > 0.05 * len(speeds) + 1:
        return initial  # certainly below the percentile, which costs more
    largest = float(np.percentile(speeds, 95))
    return min(max(initial, -largest), largest)
