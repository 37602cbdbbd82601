"""One HTML file that opens offline: tables, warnings and figures."""

import base64
import html
import io
from pathlib import Path
from typing import TYPE_CHECKING

from thumper_tuning.design.fixed_point import SPECS, BoardGains
from thumper_tuning.design.gains import Design
from thumper_tuning.design.loop_analysis import Plant, judge
from thumper_tuning.drive.verify import Verification
from thumper_tuning.identify.motor import Identified
from thumper_tuning.identify.result_json import NOT_IDENTIFIABLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """body{font:15px/1.5 sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;padding:.25em .7em;text-align:right}
th:first-child,td:first-child{text-align:left}img{max-width:100%}li{margin:.2em 0}h2{margin-top:2em}"""


def write_report(
    path: Path,
    motors: list[Identified],
    design: Design,
    old: BoardGains | None = None,
    before: Verification | None = None,
    after: Verification | None = None,
) -> Path:
    """Write the page; `old` and the verifications are there if a board was."""
    from thumper_tuning.report import figures

    parts = ["<h1>Wheel speed control: what was found and what it does</h1>"]
    if after is not None:
        from thumper_tuning.report.figures import tracking

        parts += ["<h2>On the robot</h2>", _tracking_table(before, after), _image(tracking(before, after))]
    parts += ["<h2>Gains</h2>", _gains_table(design, old), _loop_table(design, old)]
    parts.append(_image(figures.step(design, (old.kp, old.ki) if old else None)))
    parts += [
        _image(draw(design))
        for draw in (figures.bode, figures.nyquist, figures.sensitivity, figures.pole_zero)
    ]
    for motor in motors:
        parts += [f"<h2>Motor {html.escape(motor.name)}</h2>", _motor_table(motor)]
        parts += [f"<p>Note: {html.escape(note)}.</p>" for note in motor.warnings]
        parts += [
            _image(draw(motor)) for draw in (figures.data_and_model, figures.residuals, figures.static_map)
        ]
    parts.append(f"<p>{html.escape(NOT_IDENTIFIABLE)}.</p>")
    body = "\n".join(parts)
    path.write_text(
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Tuning report</title>'
        f"<style>{STYLE}</style><body>{body}</body></html>",
        encoding="utf-8",
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
    integers = design.gains.integers()
    return _table(
        ["parameter", "before", "after", "unit", "on the wire"],
        [
            [
                name,
                f"{getattr(old, name):.4g}" if old else "",
                f"{value:.4g}",
                SPECS[name].unit,
                str(integers[name]),
            ]
            for name, value in design.gains.items()
        ],
    )


def _loop_table(design: Design, old: BoardGains | None) -> str:
    rows = []
    plant = Plant.of(design.model, design.period_s)
    if old is not None:
        figures = judge(plant, old.kp, old.ki)
        rows.append(["before", f"{figures.sensitivity:.2f}", f"{figures.gain_margin:.2f}",
                     f"{figures.phase_margin_deg:.0f}", f"{figures.delay_margin_s:.3f}"])  # fmt: skip
    for name, loop in (("after", design.loop), ("after, worst of the family", design.worst)):
        rows.append([name, f"{loop.sensitivity:.2f}", f"{loop.gain_margin:.2f}",
                     f"{loop.phase_margin_deg:.0f}", f"{loop.delay_margin_s:.3f}"])  # fmt: skip
    return _table(["loop", "Ms", "gain margin", "phase margin [deg]", "delay margin [s]"], rows)


def _motor_table(motor: Identified) -> str:
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


def _tracking_table(before: Verification | None, after: Verification) -> str:
    rows = []
    for name, run in (("before", before), ("after", after)):
        for t in run.tracking if run else ():
            rows.append([name, f"{t.acceleration_rad_s2:g}", f"{t.mean_rad_s:+.3f}", f"{t.std_rad_s:.3f}",
                         f"{t.largest_rad_s:.2f}", f"{t.floor_rad_s:.2f}"])  # fmt: skip
    header = [
        "same-tick error",
        "ramp [rad/s^2]",
        "mean [rad/s]",
        "std [rad/s]",
        "largest",
        "floor without preview",
    ]
    return _table(header, rows)
