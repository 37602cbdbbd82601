"""Export identified motors and their loop as JSON, with a script that loads them into python-control."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thumper.common.files import write_text
from thumper_tuning.design.gains import Design
from thumper_tuning.identify.motor import IdentifiedMotor

if TYPE_CHECKING:
    import control

MODELS_FILE, LOADER_FILE = "models.json", "load_models.py"
LOADER = """import json, pathlib
import control
text = pathlib.Path(__file__).with_name("models.json").read_text()
systems = {name: control.tf(model["numerator"], model["denominator"], model["period_s"], name=name)
           for name, model in json.loads(text)["systems"].items()}
"""


def write_models(folder: Path, motors: list[IdentifiedMotor], design: Design | None = None) -> Path:
    """Write models.json and load_models.py; return the path of the JSON file.

    Each system has the numerator and denominator in descending powers of s or z, and its period (0:
    continuous). A continuous system holds its delay as a Pade approximation.
    """
    systems: dict[str, Any] = {}
    for motor in motors:
        systems[f"{motor.name}_continuous"] = _coefficients(motor.continuous())
        systems[f"{motor.name}_counted"] = _coefficients(motor.counted(motor.period_s))
        for model in motor.compare():
            if model.kind.startswith("ERA") and model.system is not None:
                name = f"{motor.name}_era_{len(model.system.A)}"
                systems[name] = _coefficients(_transfer_function(model.system))
    if design is not None:
        loop = design.loop
        systems["plant"] = _coefficients(loop.plant)
        systems["controller"] = _coefficients(loop.controller)
        systems["closed_loop"] = _coefficients(loop.closed_loop)
    content = {
        "systems": systems,
        "motors": {
            motor.name: {
                "drive_unit": motor.unit.value,
                "friction_forward": motor.model.friction_forward,
                "friction_backward": motor.model.friction_backward,
                "delay_s": motor.model.delay_s,
            }
            for motor in motors
        },
    }
    path = folder / MODELS_FILE
    write_text(path, json.dumps(content, indent=2) + "\n")
    write_text(folder / LOADER_FILE, LOADER)
    return path


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
