"""`thumper tune design` without logs: gains for the wheels as a running robot estimates them."""

from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

from thumper.cli.options.bus import connect
from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.ros import services
from thumper_tuning.cli.gains_file import write_gains_file
from thumper_tuning.design.gains import Design, DesignOptions, design
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.report.text import design_lines

NEEDED = {
    "gain": "mean_gain_rad_s_per_pwm",
    "time constant": "mean_time_constant_s",
    "friction": "mean_friction_pwm",
}


def wheels_state(config: Path | None, bus: str, robot: str) -> services.WheelsState:
    """Ask a running robot for the estimate of its wheels; raises ThumperError if it does not answer."""
    with connect(config, bus, robot) as client:
        return services.WHEELS_STATE.call(client)


def estimated_model(values: Mapping[str, float]) -> tuple[MotorModel, Uncertainty]:
    """Return the mean wheel in PWM at 7.4 V.

    Raises
    ------
    ThumperError
        The robot has not yet determined all of it.
    """
    missing = [name for name, key in NEEDED.items() if key not in values]
    if missing:
        raise ThumperError(
            f"the robot has not determined the {_listed(missing)} of its wheels yet; drive for a minute "
            "at several speeds, with starts and stops, or run `thumper tune`",
            exit_code=EXIT_CHECK_FAILED,
        )
    gain, lag_s, friction = (values[key] for key in NEEDED.values())
    gain_std, lag_std_s, friction_std = (values[f"{key}_std"] for key in NEEDED.values())
    model = MotorModel(
        gain=gain, time_constant_s=lag_s, friction_forward=friction, friction_backward=friction
    )
    return model, Uncertainty(
        gain=gain_std,
        time_constant_s=lag_std_s,
        friction=friction_std,
        delay_s=0.0,
        friction_forward=friction_std,
        friction_backward=friction_std,
    )


def _listed(names: list[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def design_from_estimate(
    state: services.WheelsState, out: Path, options: DesignOptions, console: Console
) -> Design:
    """Design gains for the estimate, print them with how the wheels drifted, and write gains.json."""
    result = design(*estimated_model(state.values), options)
    for line in design_lines(result):
        console.print(line, markup=False)
    if state.drift:
        console.print(f"  note: {state.drift}", markup=False)
    path = write_gains_file(out / "gains.json", result)
    console.print(f"wrote {path}; set them on the dashboard, or stop it and run `thumper tune verify {path}`")
    return result
