"""The tuning report: one HTML file with tables, warnings and figures, which opens offline."""

import base64
import html
import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from thumper.common.files import write_text
from thumper_tuning.design.fixed_point import PARAMETER_SPECS, BoardGains
from thumper_tuning.design.gains import Design
from thumper_tuning.design.loops import LoopMargins, SpeedLoop
from thumper_tuning.drive.verify import Verification
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.identify.result_json import NOT_IDENTIFIABLE
from thumper_tuning.logs.motor_log import DriveUnit
from thumper_tuning.report.text import tracking_change

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """body{font:14px/1.4 sans-serif;max-width:1400px;margin:1em auto;padding:0 1em;color:#222}
h1{font-size:1.4em;margin:.4em 0}h2{font-size:1.15em;margin:1em 0 .4em}li{margin:.2em 0}
.verdict{background:#f0f4f8;border-left:4px solid #1f6feb;padding:.6em 1em;margin:.6em 0}
.verdict p{margin:.2em 0}
.tables{display:flex;flex-wrap:wrap;align-items:start;gap:0 1.5em;overflow-x:auto}
table{border-collapse:collapse;margin:.5em 0;font-size:.9em}
td,th{border:1px solid #ccc;padding:.15em .5em;text-align:right}
th:first-child,td:first-child{text-align:left}
.figures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,320px),1fr));gap:.5em}
.figures img{width:100%;height:auto}
@media(max-width:600px){table{font-size:.8em}td,th{padding:.15em .3em}}
@media print{@page{margin:1cm}body{font-size:8pt;margin:0;padding:0}h2{break-after:avoid}
.figures{grid-template-columns:repeat(2,1fr);gap:.2em;margin:0 8mm}.figures img,table{break-inside:avoid}}"""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardResults:
    """What a tuning on a board adds to the report: verifications with the old and the new gains."""

    before: Verification
    after: Verification
    better: bool  # the new gains are worth saving


def write_report(
    path: Path, motors: list[IdentifiedMotor], design: Design, board: BoardResults | None = None
) -> Path:
    """Write the page; `board` is None for a design from logs alone."""
    from thumper_tuning.report import figures

    old = board.before.gains if board else None
    parts = ["<h1>Wheel speed control: tuning report</h1>", verdict(motors, design, board)]
    if board is not None:
        both = (board.before, board.after)
        parts += ["<h2>On the robot, before and after</h2>", _tables(_tracking_table(board))]
        parts.append(
            _grid(
                _image(figures.tracking(name, run, both), f"set-point, speed, error and PWM {name}")
                for name, run in zip(("before", "after"), both, strict=True)
            )
        )
    parts += ["<h2>Gains and loop</h2>", _tables(_gains_table(design, old), _margins_table(design, old))]
    parts.append(_grid(_loop_images(design, (old.kp, old.ki) if old else None)))
    for motor in motors:
        parts += [f"<h2>Motor {html.escape(motor.name)}</h2>"]
        parts += [_tables(_motor_table(motor), _models_table(motor))]
        parts += [f"<p>Note: {html.escape(warning)}.</p>" for warning in motor.warnings]
        parts.append(
            _grid(
                _image(draw(motor), shows)
                for draw, shows in (
                    (figures.data_and_model, "drive, measured and predicted speed"),
                    (figures.static_map, "steady speed over drive"),
                    (figures.residuals, "measured minus predicted speed"),
                    (figures.residual_correlation, "autocorrelation of the residuals"),
                )
            )
        )
    parts.append(f"<p>{html.escape(NOT_IDENTIFIABLE)}.</p>")
    body = "\n".join(parts)
    write_text(
        path,
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Tuning report</title>'
        f'<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{STYLE}</style><body>{body}</body></html>",
    )
    return path


def verdict(motors: list[IdentifiedMotor], design: Design, board: BoardResults | None) -> str:
    """Return three lines: what was found, what changes, and what it gains."""
    found = "; ".join(
        f"{m.name}: time constant {1e3 * m.model.time_constant_s:.0f} ms, static friction "
        f"{m.model.friction:.3g} {_unit_text(m)}, "
        f"predicts held-out speeds to {m.validation.fit_percent:.1f} %"
        for m in motors
    )
    new, margins = design.gains, design.margins
    if board is None:
        change = f"kp {new.kp:.3g}, ki {new.ki:.3g}, ks {new.ks:.3g}, kv {new.kv:.3g}, ka {new.ka:.3g}"
        gain = (
            f"PI alone settles in {design.step_info.settling_time_s:.2g} s with "
            f"{design.step_info.overshoot_percent:.0f} % overshoot; Ms {margins.max_sensitivity:.2f}, "
            f"{design.worst_case.max_sensitivity:.2f} in the worst case of battery and load"
        )
    else:
        old = board.before.gains
        change = ", ".join(
            f"{name} {getattr(old, name):.3g} → {value:.3g}"
            for name, value in new.items()
            if abs(value - getattr(old, name)) > 0.005 * abs(value)
        )
        if not change:
            change = "nothing: the board already has these gains"
        elif not board.better:
            change = f"none is worth it: the new gains ({change}) are no better than the old ones"
        before = SpeedLoop.of_board(design.plant, old.kp, old.ki).margins()
        errors = "; ".join(
            tracking_change(b, a) for b, a in zip(board.before.tracking, board.after.tracking, strict=True)
        )
        gain = f"{errors}; Ms {before.max_sensitivity:.2f} → {margins.max_sensitivity:.2f}"
    lines = (("Found", found), ("Changes", change), ("Effect", gain))
    text = "".join(f"<p><b>{name}:</b> {html.escape(line)}.</p>" for name, line in lines)
    return f'<div class="verdict">{text}</div>'


def _loop_images(design: Design, before: tuple[float, float] | None) -> Iterator[str]:
    from thumper_tuning.report import loop_figures

    yield _image(loop_figures.setpoint_step(design, before), "response to a step of the set-point")
    yield _image(loop_figures.load_step(design, before), "response to a step of the load")
    for draw in (
        loop_figures.bode,
        loop_figures.nyquist,
        loop_figures.sensitivity,
        loop_figures.pole_zero,
        loop_figures.root_locus,
    ):
        yield _image(draw(design), f"{draw.__name__.replace('_', ' ')} plot")


def _grid(images: Iterable[str]) -> str:
    return f'<div class="figures">{"".join(images)}</div>'


def _tables(*tables: str) -> str:
    return f'<div class="tables">{"".join(tables)}</div>'


def _unit_text(motor: IdentifiedMotor) -> str:
    return "PWM" if motor.unit is DriveUnit.PWM else motor.unit.value


def _image(figure: "Figure", shows: str) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<img alt="{shows}" src="data:image/png;base64,{data}">'


def _models_table(motor: IdentifiedMotor) -> str:
    rows = [
        [
            model.kind,
            "unstable" if model.fit_percent is None else f"{model.fit_percent:.1f}",
            " + ".join(
                f"{1e3 * tau_s:.1f}"
                for tau_s in (model.time_constant_s, model.second_time_constant_s)
                if tau_s is not None
            )
            or "-",
        ]
        for model in motor.compare()
    ]
    rows += [
        [f"first order, {kind}", f"{percent:.1f}", ""] for kind, percent in motor.fit_percent_by_kind.items()
    ]
    return _table(["model", "validation fit [%]", "time constant [ms]"], rows)


def _table(header: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _gains_table(design: Design, old: BoardGains | None) -> str:
    wire = design.gains.wire_values()
    return _table(
        ["parameter", "before", "after", "unit", "stored as"],
        [
            [
                name,
                f"{getattr(old, name):.4g}" if old else "",
                f"{value:.4g}",
                PARAMETER_SPECS[name].unit,
                str(wire[name]),
            ]
            for name, value in design.gains.items()
        ],
    )


def _margins_table(design: Design, old: BoardGains | None) -> str:
    loops: list[tuple[str, LoopMargins]] = []
    if old is not None:
        loops.append(("before", SpeedLoop.of_board(design.plant, old.kp, old.ki).margins()))
    loops += [("after", design.margins), ("after, worst case of battery and load", design.worst_case)]
    rows = [
        [
            name,
            f"{margins.max_sensitivity:.2f}",
            f"{margins.gain_margin_dB:.1f}",
            f"{margins.phase_margin_deg:.0f}",
            f"{margins.delay_margin_s:.3f}",
        ]
        for name, margins in loops
    ]
    return _table(["loop", "Ms", "gain margin [dB]", "phase margin [deg]", "delay margin [s]"], rows)


def _motor_table(motor: IdentifiedMotor) -> str:
    model, std, unit = motor.model, motor.uncertainty, motor.unit.value
    return _table(
        ["parameter", "value", "+- (1 sigma)", "unit"],
        [
            ["gain", f"{model.gain:.5g}", f"{std.gain:.2g}", f"rad/s per {unit}"],
            ["time constant", f"{model.time_constant_s:.4f}", f"{std.time_constant_s:.2g}", "s"],
            ["static friction, mean", f"{model.friction:z.2f}", f"{std.friction:.2g}", unit],
            *[
                [f"... {direction}", f"{found[0]:z.2f}", f"{found[1]:.2g}", unit]
                if found is not None
                else [f"... {direction}", "not determined", "", ""]
                for direction, found in motor.friction_by_direction.items()
            ],
            ["delay", f"{model.delay_s:.4f}", f"{std.delay_s:.2g}", "s"],
        ],
    )


def _tracking_table(board: BoardResults) -> str:
    rows = [
        [
            name,
            f"{t.acceleration_rad_s2:g}",
            f"{t.mean_rad_s:+.3f}",
            f"{t.std_rad_s:.3f}",
            f"{t.max_rad_s:.2f}",
            f"{t.no_preview_std_rad_s:.2f}",
        ]
        for name, run in (("before", board.before), ("after", board.after))
        for t in run.tracking
    ]
    header = [
        "tracking error, same tick",
        "ramp [rad/s^2]",
        "mean [rad/s]",
        "std [rad/s]",
        "maximum [rad/s]",
        "limit without preview [rad/s]",
    ]
    return _table(header, rows)
