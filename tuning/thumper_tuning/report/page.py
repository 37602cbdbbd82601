"""The tuning report: one HTML file with tables, warnings and figures, which opens offline."""

import base64
import html
import io
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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """body{font:15px/1.5 sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;padding:.25em .7em;text-align:right}
th:first-child,td:first-child{text-align:left}img{max-width:100%}li{margin:.2em 0}h2{margin-top:2em}"""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardResults:
    """What a tuning on a board adds to the report: verifications with the old and the new gains."""

    before: Verification
    after: Verification


def write_report(
    path: Path, motors: list[IdentifiedMotor], design: Design, board: BoardResults | None = None
) -> Path:
    """Write the page; `board` is None for a design from logs alone."""
    from thumper_tuning.report import figures, loop_figures

    old = board.before.gains if board else None
    parts = ["<h1>Wheel speed control: tuning report</h1>"]
    if board is not None:
        parts += [
            "<h2>On the robot</h2>",
            _tracking_table(board),
            _image(figures.tracking(board.before, board.after)),
        ]
    parts += ["<h2>Gains</h2>", _gains_table(design, old), _margins_table(design, old)]
    parts.append(_image(loop_figures.step(design, (old.kp, old.ki) if old else None)))
    parts += [
        _image(draw(design))
        for draw in (
            loop_figures.bode,
            loop_figures.nyquist,
            loop_figures.sensitivity,
            loop_figures.pole_zero,
            loop_figures.root_locus,
        )
    ]
    for motor in motors:
        parts += [f"<h2>Motor {html.escape(motor.name)}</h2>", _motor_table(motor)]
        parts += [f"<p>Note: {html.escape(warning)}.</p>" for warning in motor.warnings]
        parts += [
            _image(draw(motor)) for draw in (figures.data_and_model, figures.residuals, figures.static_map)
        ]
    parts.append(f"<p>{html.escape(NOT_IDENTIFIABLE)}.</p>")
    body = "\n".join(parts)
    write_text(
        path,
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Tuning report</title>'
        f"<style>{STYLE}</style><body>{body}</body></html>",
    )
    return path


def _image(figure: "Figure") -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<img alt="" src="data:image/png;base64,{data}">'


def _table(header: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _gains_table(design: Design, old: BoardGains | None) -> str:
    wire = design.gains.wire_values()
    return _table(
        ["parameter", "before", "after", "unit", "on the wire"],
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
    loops += [("after", design.margins), ("after, worst case of the plant family", design.worst_case)]
    rows = [
        [
            name,
            f"{margins.max_sensitivity:.2f}",
            f"{margins.gain_margin:.2f}",
            f"{margins.phase_margin_deg:.0f}",
            f"{margins.delay_margin_s:.3f}",
        ]
        for name, margins in loops
    ]
    return _table(["loop", "Ms", "gain margin", "phase margin [deg]", "delay margin [s]"], rows)


def _motor_table(motor: IdentifiedMotor) -> str:
    model, std, unit = motor.model, motor.uncertainty, motor.unit.value
    return _table(
        ["parameter", "value", "+- (1 sigma)", "unit"],
        [
            ["gain", f"{model.gain:.5g}", f"{std.gain:.2g}", f"rad/s per {unit}"],
            ["time constant", f"{model.time_constant_s:.4f}", f"{std.time_constant_s:.2g}", "s"],
            ["static friction, mean", f"{model.friction:.2f}", f"{std.friction:.2g}", unit],
            ["... forward", f"{model.friction_forward:.2f}", f"{std.friction_forward:.2g}", unit],
            ["... backward", f"{model.friction_backward:.2f}", f"{std.friction_backward:.2g}", unit],
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
