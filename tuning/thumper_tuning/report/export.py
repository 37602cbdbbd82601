"""Export identified motors and their loop as JSON, with a script that loads them into python-control."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thumper.common.files import write_text
from thumper_tuning.design.gains import Design
from thumper_tuning.identify.compare_models import era_models
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.identify.partial_motor import PartialMotor
from thumper_tuning.identify.result_json import partial_to_dict
from thumper_tuning.identify.systems import counted_second_order_system, second_order_system

if TYPE_CHECKING:
    import control

MODELS_FILE, LOADER_FILE = "models.json", "load_models.py"
LOADER = """import json, pathlib
import control
text = pathlib.Path(__file__).with_name("models.json").read_text()
systems = {name: control.tf(model["numerator"], model["denominator"], model["period_s"], name=name)
           for name, model in json.loads(text)["systems"].items()}
"""


def write_models(
    folder: Path,
    motors: Sequence[IdentifiedMotor],
    design: Design | None = None,
    partial: Sequence[PartialMotor] = (),
) -> Path:
    """Write models.json and load_models.py; return the path of the JSON file.

    Each system has the numerator and denominator in descending powers of s or z, and its period (0:
    continuous). A continuous system holds its delay as a Pade approximation. A partly determined motor has
    the system of its recorded level.
    """
    systems: dict[str, control.TransferFunction] = {}
    for part in (part for part in partial if part.static is None):
        systems[f"{part.name}_continuous"] = part.continuous()
        systems[f"{part.name}_counted"] = part.counted(part.period_s)
    for motor in motors:
        systems |= _systems(motor)
    if design is not None:
        loop = design.loop
        systems |= {"plant": loop.plant, "controller": loop.controller, "closed_loop": loop.closed_loop}
    content = {
        "systems": {name: _coefficients(system) for name, system in systems.items()},
        "motors": {
            **{part.name: partial_to_dict(part) for part in partial},
            **{motor.name: _motor(motor) for motor in motors},
        },
    }
    path = folder / MODELS_FILE
    write_text(path, json.dumps(content, indent=2) + "\n")
    write_text(folder / LOADER_FILE, LOADER)
    return path


def _systems(motor: IdentifiedMotor) -> "dict[str, control.TransferFunction]":
    """Return the models of a motor: first order, second order, and ERA if its rows are regular."""
    second = motor.second_order()
    found = {
        f"{motor.name}_continuous": motor.continuous(),
        f"{motor.name}_counted": motor.counted(motor.period_s),
        f"{motor.name}_second_order_continuous": second_order_system(
            second.base, second.second_time_constant_s
        ),
        f"{motor.name}_second_order": counted_second_order_system(
            second.base, second.second_time_constant_s, motor.period_s
        ),
    }
    for model in era_models(*motor.rows_of_richer_models()):
        if model.system is not None:
            found[f"{motor.name}_era_{len(model.system.A)}"] = _transfer_function(model.system)
    return found


def _motor(motor: IdentifiedMotor) -> dict[str, Any]:
    return {
        "drive_unit": motor.unit.value,
        **{
            f"friction_{direction}": found[0] if found is not None else None
            for direction, found in motor.friction_by_direction.items()
        },
        "delay_s": motor.model.delay_s,
    }


def _transfer_function(system: "control.LTI") -> "control.TransferFunction":
    """Return numerator and denominator from the matrices; `control.tf` would need slycot for this."""
    import control

    denominator = np.poly(system.A)
    numerator = np.poly(system.A - system.B @ system.C) + (system.D[0, 0] - 1.0) * denominator
    return control.tf(numerator.real, denominator.real, system.dt)


def _coefficients(system: "control.TransferFunction") -> dict[str, Any]:
    return {
        "numerator": [float(c) for c in np.real(system.num[0][0])],
        "denominator": [float(c) for c in np.real(system.den[0][0])],
        "period_s": float(system.dt or 0.0),
    }
