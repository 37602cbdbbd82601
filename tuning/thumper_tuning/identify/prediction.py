"""What a model says that a log should show: the measured speeds are used for nothing but the start of
a stretch."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor_response import respond
from thumper_tuning.identify.segments import Segment


def predict(stretch: Segment, model: MotorModel, *, momentary: bool) -> FloatArray:
    """Speeds [rad/s] as the stretch's windows count them, shape (n,); `momentary`: at the windows' ends."""
    angles, speeds = respond(
        stretch.change_s,
        stretch.drive,
        stretch.before,
        start_speed(stretch, model, momentary=momentary),
        stretch.edge_s,
        model.gain,
        model.time_constant_s,
        model.friction_forward,
        model.friction_backward,
        model.breakaway_ratio,
        model.delay_s,
    )
    return speeds[1:] if momentary else np.diff(angles) / stretch.windows_s


def start_speed(stretch: Segment, model: MotorModel, *, momentary: bool) -> float:
    """The speed at the first edge for which the model meets the first window [rad/s]."""
    if stretch.at_rest:
        return 0.0
    mean, window_s = float(stretch.speed_rad_s[0]), float(stretch.edge_s[1] - stretch.edge_s[0])
    drive = float(stretch.drive[0]) if model.delay_s < 0.5 * window_s else stretch.before
    direction = math.copysign(1.0, mean)
    friction = model.friction_forward if direction > 0.0 else model.friction_backward
    final = model.gain * (drive - direction * friction)
    if mean == 0.0 or final * direction < 0.0:
        final = 0.0 if mean == 0.0 else final
    x = window_s / model.time_constant_s
    share = (
        math.exp(-x) if momentary else -math.expm1(-x) / x
    )  # of the start speed that is left in the window
    largest = float(np.percentile(np.abs(stretch.speed_rad_s), 95))
    # With little of it left it cannot be told from the window, nor does it matter then.
    start = final + (mean - final) / share if share > 0.1 else mean
    if start * direction < 0.0:
        return 0.0
    return float(np.clip(start, -largest, largest))
