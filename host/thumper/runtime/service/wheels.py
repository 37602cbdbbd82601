"""Describes the wheels as estimated while driving, and reads the board's model to compare them with."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace

from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper.odometry.drive_train import WheelEstimate
from thumper.odometry.drive_train_monitor import BoardWheelModel
from thumper.ros.services import WheelsState
from thumper.runtime.state_estimator import StateEstimator

QUANTITIES = (
    ("gain", "gain_rad_s_per_pwm", "gain", 1.0, "rad/s per PWM"),
    ("time_constant_s", "time_constant_s", "time constant", 1e3, "ms"),
    ("friction", "friction_pwm", "friction", 1.0, "PWM"),
)  # field, key, text, and the scale and unit of the text
NOT_YET = "not determined yet; drive at several speeds"


def describe(estimator: StateEstimator) -> WheelsState:
    """Return what the driving so far determines."""
    monitor = estimator.drive_train
    estimate = None if monitor is None else monitor.estimate
    if monitor is None or estimate is None:
        failure = "" if monitor is None else monitor.failure
        return WheelsState(text=NOT_YET, drift=failure, values={})
    values: dict[str, float] = {}
    for side in ("mean", "left", "right"):
        for field, key, *_ in QUANTITIES:
            found = getattr(getattr(estimate, side), field)
            if found is not None:
                values |= {f"{side}_{key}": found.value, f"{side}_{key}_std": found.std}
    return WheelsState(text=_text(estimate.mean), drift="; ".join(monitor.warnings().values()), values=values)


def read_feed_forward(board: Board) -> BoardWheelModel:
    """Read the board's model of a wheel; raises ThumperError if it does not answer."""
    return BoardWheelModel(
        **{field.name: board.get_parameter(field.name) for field in fields(BoardWheelModel)}
    )


def read_again(estimator: StateEstimator, board: Board) -> None:
    """Read the board's model after an experiment or a reconnection, which may have changed it."""
    if estimator.drive_train is not None:
        with suppress(ThumperError):  # the old model stays
            estimator.drive_train.feed_forward = read_feed_forward(board)


def take_parameters(estimator: StateEstimator, values: Mapping[str, float]) -> None:
    """Take over the board's model from parameters that were set."""
    monitor = estimator.drive_train
    if monitor is not None and monitor.feed_forward is not None:
        known = {field.name: values[field.name] for field in fields(BoardWheelModel) if field.name in values}
        monitor.feed_forward = replace(monitor.feed_forward, **known)


def _text(wheels: WheelEstimate) -> str:
    if wheels.gain is wheels.time_constant_s is wheels.friction is None:
        return NOT_YET
    parts = []
    for field, _, name, scale, unit in QUANTITIES:
        found = getattr(wheels, field)
        text = "not determined"
        if found is not None:
            text = f"{scale * found.value:.3g} +- {scale * found.std:.1g} {unit}"
        parts.append(f"{name} {text}")
    return ", ".join(parts)
