"""`thumper tune fit`: identify motors from logs, and print the results."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from thumper_tuning.identify.excitation_checks import UndeterminedError
from thumper_tuning.identify.motor import IdentifiedMotor, identify
from thumper_tuning.identify.motor_constants import physical_constants
from thumper_tuning.identify.partial import identify_partly
from thumper_tuning.identify.partial_motor import PartialMotor
from thumper_tuning.identify.result_json import NOT_IDENTIFIABLE, motor_to_dict, partial_to_dict
from thumper_tuning.logs.motor_log import MotorLog
from thumper_tuning.logs.read import read_runs
from thumper_tuning.logs.roles import Choices
from thumper_tuning.report.export import write_models
from thumper_tuning.report.text import motor_lines, partial_lines


def fit_files(
    files: list[Path],
    *,
    counts_per_rev: float,
    as_json: bool,
    choices: Choices | None = None,
    variants: bool = False,
    resistance_Ohm: float | None = None,
    export: Path | None = None,
) -> None:
    """Identify and print every motor in the files. Several files are runs of the same motors.

    A log that determines only a part of the model prints this part, and what to record next.

    Raises
    ------
    ThumperError
        A file cannot be read, or the logs determine nothing.
    """
    runs = read_runs(files, counts_per_rev, choices)
    results: dict[str, Any] = {}
    lines: list[str] = []
    whole: list[IdentifiedMotor] = []
    parts: list[PartialMotor] = []
    for logs in runs:
        try:
            motor = identify(logs)
        except UndeterminedError as reason:
            part = identify_partly(logs, reason)
            parts.append(part)
            results[part.name] = partial_to_dict(part)
            lines += partial_lines(part)
            continue
        whole.append(motor)
        results[motor.name] = _result(motor, logs, variants=variants, resistance_Ohm=resistance_Ohm)
        lines += [*motor_lines(motor), *_extra_lines(results[motor.name])]
    if export is not None:
        path = write_models(export, whole, partial=parts)
        lines.append(f"wrote {path}")
    if as_json:
        print(json.dumps(results if len(results) > 1 else next(iter(results.values())), indent=2))
        return
    print(*lines, sep="\n")
    if whole:
        print(NOT_IDENTIFIABLE)


def _extra_lines(result: dict[str, Any]) -> list[str]:
    lines = [_variant_line(model) for model in result.get("variants", ())]
    for name, value in result.get("physical", {}).items():
        lines.append(f"  {name:22} {value:.4g}" if isinstance(value, float) else f"  {name}: {value}")
    return lines


def _result(
    motor: IdentifiedMotor, logs: list[MotorLog], *, variants: bool, resistance_Ohm: float | None
) -> dict[str, Any]:
    result = motor_to_dict(motor)
    if variants:
        result["variants"] = [
            {"kind": m.kind, "fit_percent": m.fit_percent, "time_constant_s": m.time_constant_s}
            for m in motor.compare(backlash=True)
        ]
    physical = physical_constants(motor, logs, resistance_Ohm)
    if physical is not None:
        result["physical"] = dataclasses.asdict(physical)
    return result


def _variant_line(model: dict[str, Any]) -> str:
    tau_s = model["time_constant_s"]
    tau = f", time constant {tau_s:.4f} s" if tau_s is not None else ""
    percent = model["fit_percent"]
    fit = "is unstable" if percent is None else f"predicts held-out speeds to {percent:.1f} %"
    return f"  {model['kind']:22} {fit}{tau}"


def identify_files(
    files: list[Path], counts_per_rev: float, choices: Choices | None = None
) -> list[IdentifiedMotor]:
    """Identify every motor in the files and print its parameters."""
    motors = [identify(logs) for logs in read_runs(files, counts_per_rev, choices)]
    for motor in motors:
        print(*motor_lines(motor), sep="\n")
    return motors
