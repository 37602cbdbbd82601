"""Checks of the sensors beside board and lidar: that they answer, and how they stream."""

from collections.abc import Iterator
from typing import Any

from thumper.camera.detector import open_detector
from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.common.errors import ThumperError
from thumper.common.sensor import Sensor
from thumper.config.robot import RobotConfig
from thumper.doctor.check import Check, worst_of
from thumper.doctor.verdicts import CABLE, RATE_FAIL_SHARE, RATE_WARN_SHARE
from thumper.gps.fix import Fix, FixStatus
from thumper.runtime.sensor_table import KINDS

TIMEOUT_S = 2.0
SHOWN_LABELS = 5
NO_FIX = "put the antenna under open sky, away from walls, and wait a minute"


def check_sensors(config: RobotConfig, *, seconds: float) -> Iterator[Check]:
    """Check each sensor that the configuration enables."""
    for kind in KINDS:
        if not kind.is_wanted(config):
            continue
        try:
            sensor = kind.open(config)
        except ThumperError as error:
            yield Check(verdict="fail", what=kind.name, fix=str(error))
            continue
        try:
            yield _judge(kind.name, sensor, kind.rate_Hz, seconds)
        except ThumperError as error:
            yield Check(verdict="fail", what=kind.name, fix=str(error))
        finally:
            sensor.close()
    if config.camera.enabled and config.camera.detector:
        yield _check_detector(config.camera)


def _check_detector(camera: CameraOptions) -> Check:
    """Load the object detector, which `thumper run` would refuse at its start."""
    try:
        labels = open_detector(camera).labels
    except ThumperError as error:
        return Check(verdict="fail", what="detector", fix=str(error))
    more = ", ..." if len(labels) > SHOWN_LABELS else ""
    shown = ", ".join(labels[:SHOWN_LABELS])
    return Check(verdict="pass", what=f"detector: finds {len(labels)} kinds of object: {shown}{more}")


def _judge(name: str, sensor: Sensor[Any], expected_Hz: float | None, seconds: float) -> Check:
    """Read the sensor for some time; judge its rate and the damaged frames."""
    sample = sensor.wait_for_sample(TIMEOUT_S)
    counters = sensor.counters
    start_s, samples, damaged = sensor.now_s(), counters.samples, counters.bad_replies
    while sensor.now_s() < start_s + seconds:
        sample = sensor.wait_for_sample(TIMEOUT_S)
    rate_Hz = (counters.samples - samples) / (sensor.now_s() - start_s)
    damaged = counters.bad_replies - damaged
    if isinstance(sample, Fix):
        return judge_fix(sample, rate_Hz, damaged)
    if isinstance(sample, CameraFrame):
        return _judge_frame(sample, rate_Hz, damaged)
    error = abs(rate_Hz / expected_Hz - 1.0) if expected_Hz else 0.0
    return Check(
        verdict=worst_of(error > RATE_WARN_SHARE or damaged > 0, error > RATE_FAIL_SHARE),
        what=f"{name}: {rate_Hz:.1f} Hz of {expected_Hz:g} Hz, {damaged} damaged",
        fix="" if error <= RATE_WARN_SHARE and not damaged else CABLE,
    )


def _judge_frame(frame: CameraFrame, rate_Hz: float, damaged: int) -> Check:
    """Judge the newest frame of a camera; in dim light it exposes for longer, at a lower rate."""
    try:
        rows, columns = frame.grey().shape
    except ValueError as error:
        return Check(verdict="fail", what=f"camera: {error}", fix=CABLE)
    return Check(
        verdict=worst_of(damaged > 0, fail=False),
        what=f"camera: {rate_Hz:.1f} Hz, {columns} x {rows} pixels, {damaged} damaged",
        fix=CABLE if damaged else "",
    )


def judge_fix(fix: Fix, rate_Hz: float, damaged: int) -> Check:
    """Judge the newest fix of a GPS receiver; its rate is what the receiver is set to."""
    has_fix = fix.status is not FixStatus.NONE
    return Check(
        verdict=worst_of(not has_fix or damaged > 0, fail=False),
        what=f"gps: {rate_Hz:.1f} Hz, {fix.text}, {damaged} damaged",
        fix="" if has_fix and not damaged else CABLE if damaged else NO_FIX,
    )
