"""`thumper tune fit`: identify motors from logs, and print the results."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from thumper_tuning.identify.motor import IdentifiedMotor, identify
from thumper_tuning.identify.motor_constants import physical_constants
from thumper_tuning.identify.result_json import NOT_IDENTIFIABLE, motor_to_dict
from thumper_tuning.logs.motor_log import MotorLog
from thumper_tuning.logs.read import read_runs
from thumper_tuning.report.export import write_models
from thumper_tuning.report.text import motor_lines


def fit_files(
    files: list[Path],
    *,
    counts_per_rev: float,
    one_direction: bool,
    as_json: bool,
    variants: bool = False,
    resistance_Ohm: float | None = None,
    export: Path | None = None,
) -> list[IdentifiedMotor]:
    """Identify and print every motor in the files. Several files are runs of the same motors.

    Raises
    ------
    ThumperError
        A file cannot be read, or the logs do not determine the model.
    """
    runs = read_runs(files, counts_per_rev)
    motors = [identify(logs, one_direction=one_direction) for logs in runs]
    results = {
        motor.name: _result(motor, logs, variants=variants, resistance_Ohm=resistance_Ohm)
        for motor, logs in zip(motors, runs, strict=True)
    }
    if export is not None:
        write_models(export, motors)
    if as_json:
        print(json.dumps(results if len(motors) > 1 else next(iter(results.values())), indent=2))
        return motors
    for motor in motors:
        print(*motor_lines(motor), sep="\n")
        for model in results[motor.name].get("variants", ()):
            print(_variant_line(model))
        for name, value in results[motor.name].get("physical", {}).items():
            print(f"  {name:22} {value:.4g}" if isinstance(value, float) else f"  {name}: {value}")
    print(NOT_IDENTIFIABLE)
    return motors


def _result(
    motor: IdentifiedMotor, logs: list[MotorLog], *, variants: bool, resistance_Ohm: float | None
) -> dict[str, Any]:
    result = motor_to_dict(motor)
    if variants:
        result["variants"] = [
            {"kind": m.kind, "fit_percent": m.fit_percent, "time_constant_s": m.time_constant_s}
            for m in motor.compare(richer=True)
        ]
    physical = physical_constants(motor, logs, resistance_Ohm)
    if physical is not None:
        result["physical"] = dataclasses.asdict(physical)
    return result


def _variant_line(model: dict[str, Any]) -> str:
    tau_s = model["time_constant_s"]
    tau = f", time constant {tau_s:.4f} s" if tau_s is not None else ""
    return f"  {model['kind']:22} predicts held-out speeds to {model['fit_percent']:.1f} %{tau}"


def identify_files(
    files: list[Path], counts_per_rev: float, *, one_direction: bool = False
) -> list[IdentifiedMotor]:
    """Identify every motor in the files and print its parameters."""
    motors = [identify(logs, one_direction=one_direction) for logs in read_runs(files, counts_per_rev)]
    for motor in motors:
        print(*motor_lines(motor), sep="\n")
    return motors
