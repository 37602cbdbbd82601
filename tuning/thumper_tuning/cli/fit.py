"""`thumper tune fit`: logs in, parameters out."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from thumper_tuning.identify.motor import Identified, identify
from thumper_tuning.identify.motor_constants import physical_constants
from thumper_tuning.identify.result_json import NOT_IDENTIFIABLE, as_dict
from thumper_tuning.identify.richer_models import compare_variants
from thumper_tuning.logs.motor_log import MotorLog
from thumper_tuning.logs.read import read_logs
from thumper_tuning.logs.units import refusal


def fit_files(
    files: list[Path],
    *,
    counts_per_rev: float,
    one_direction: bool,
    as_json: bool,
    variants: bool = False,
    resistance_Ohm: float | None = None,
) -> list[Identified]:
    """Identify every motor that the files hold and print it; with several files each is a run.

    Raises
    ------
    ThumperError
        A file cannot be read, or the data cannot support an answer.
    """
    runs = runs_of(files, counts_per_rev)
    motors = [identify(logs, one_direction=one_direction) for logs in runs]
    results: dict[str, dict[str, Any]] = {}
    for motor, logs in zip(motors, runs, strict=True):
        results[motor.name] = as_dict(motor)
        if variants:
            results[motor.name]["variants"] = [
                dataclasses.asdict(richer) for richer in compare_variants(list(motor.stretches), motor.fit)
            ]
        physical = physical_constants(motor, logs, resistance_Ohm)
        if physical is not None:
            results[motor.name]["physical"] = dataclasses.asdict(physical)
    if as_json:
        print(json.dumps(results if len(motors) > 1 else next(iter(results.values())), indent=2))
        return motors
    for motor in motors:
        show(motor)
        for richer in results[motor.name].get("variants", ()):
            print(f"  {richer['kind']}: predicts held-out speeds to {richer['fit_percent']:.1f} %")
        for name, value in results[motor.name].get("physical", {}).items():
            print(f"  {name:22} {value:.4g}" if isinstance(value, float) else f"  {name}: {value}")
    print(NOT_IDENTIFIABLE)
    return motors


def runs_of(files: list[Path], counts_per_rev: float) -> list[list[MotorLog]]:
    """The logs of each motor over all files."""
    per_file = [read_logs(file, counts_per_rev=counts_per_rev) for file in files]
    if len({len(logs) for logs in per_file}) > 1:
        raise refusal("the files do not hold the same motors; fit them one by one")
    return [list(logs) for logs in zip(*per_file, strict=True)]


def show(motor: Identified) -> None:
    """Print what is known of a motor."""
    model, std, unit = motor.model, motor.uncertainty, motor.unit.name if motor.unit.value == "pwm" else "V"
    print(f"{motor.name}: predicts held-out speeds to {motor.validation.fit_percent:.1f} %")
    print(f"  gain             {model.gain:9.5f} +- {std.gain:.5f} rad/s per {unit}")
    print(f"  time constant    {model.time_constant_s:9.4f} +- {std.time_constant_s:.4f} s")
    print(
        f"  static friction  {model.friction:9.2f} +- {std.friction:.2f} {unit} "
        f"(forward {model.friction_forward:.2f}, backward {model.friction_backward:.2f})"
    )
    print(f"  delay            {model.delay_s:9.4f} +- {std.delay_s:.4f} s")
    for warning in motor.warnings:
        print(f"  note: {warning}")
