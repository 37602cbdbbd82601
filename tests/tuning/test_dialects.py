"""Files of other programs and countries: numbers, separators, comments, stamps, and what only looks alike."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import COUNT_RAD

from tests.tuning.test_headers import COUNTS, PWM, ROWS, SPEED, TIME_S, assert_wheel
from thumper.common.errors import ThumperError
from thumper_tuning.logs.motor_log import MotorLog
from thumper_tuning.logs.numbers import read_columns, to_number
from thumper_tuning.logs.read import read_logs
from thumper_tuning.logs.roles import parse_choices

EPOCH_NS = 1_700_000_000 * 10**9

Row = Callable[[float, float, float, float], str]
"""The text of a row, of time [s], PWM, counts and speed [rad/s]."""


def assert_read(path: Path, text: str | bytes, **choices: str) -> MotorLog:
    """Assert that the file holds the wheel's time, PWM, and counts or speeds."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    picked = parse_choices([f"{role}={header}" for role, header in choices.items()])
    logs = read_logs(path, choices=picked)
    assert len(logs) == 1
    return assert_wheel(logs)


def table(header: str, row: Row) -> str:
    lines = [row(*values) for values in zip(TIME_S, PWM, COUNTS, SPEED, strict=True)]
    return "\n".join([header, *lines]) + "\n"


def german(value: float, digits: int) -> str:
    return f"{value:,.{digits}f}".translate(str.maketrans(",.", ".,"))


RPM = 30.0 / math.pi


def french(text: str) -> str:
    return text.replace(",", "\u00a0").replace(".", ",")


def clock(time_s: float) -> str:
    return f"{int(time_s + 40.0) // 60:02d}:{(time_s + 40.0) % 60.0:06.3f}"


@pytest.mark.parametrize(
    ("header", "row"),
    [
        (
            "Zeit (ms);PWM;Drehzahl (1/min)",
            lambda t, u, n, w: f"{german(1e3 * t, 1)};{u:g};{german(RPM * w, 3)}",
        ),
        ("Zeit (ms);PWM;Impulse", lambda t, u, n, w: f"{german(1e3 * t, 0)};{u:g};{german(n, 0)}"),
        (
            "Time (ms),PWM,Speed (deg/s)",
            lambda t, u, n, w: f'"{1e3 * t:,.1f}",{u:g},"{math.degrees(w):,.2f}"',
        ),
        ("Time (ms),PWM,Counts", lambda t, u, n, w: f'"{1e3 * t:,.0f}",{u:g},"{n:,.0f}"'),
        (
            "Temps (ms);Rapport cyclique (%);Vitesse (tr/min)",
            lambda t, u, n, w: f"{1e3 * t:,.1f};{u / 2.55:.3f};{RPM * w:.3f}".replace(",", "\u00a0").replace(
                ".", ","
            ),
        ),
        (
            "Zeit (ms);PWM;Drehzahl",
            lambda t, u, n, w: f"{1e3 * t:,.1f};{u:g};{RPM * w:.3f}".replace(",", "'"),
        ),
        ("time (s),pwm,ω (rad/s)", lambda t, u, n, w: f"{t:.1f},{u:g},{w:.5f}".replace("-", "\u2212")),
        ("time,pwm,speed", lambda t, u, n, w: f"{1e3 * t:.0f} ms,{u:g},{w:.5f} rad/s"),
    ],
)
def test_numbers_of_other_countries(tmp_path: Path, header: str, row: Row) -> None:
    assert_read(tmp_path / "log.csv", table(header, row))


def test_three_digits_are_thousands_only_if_the_column_says_so() -> None:
    for cells, separator, numbers in (
        (["1.234", "0.500"], ";", [1.234, 0.5]),
        (["100", "1.000"], ";", [100.0, 1000.0]),
        (["1.234"], ";", [1.234]),
        (["1,234"], ";", [1.234]),
        (["1,234"], ",", [1234.0]),
        (["1.234.567"], ";", [1234567.0]),
        (["1,5", "2,25", "1.234"], ";", [1.5, 2.25, 1234.0]),
    ):
        assert read_columns([cells], separator)[0][0] == pytest.approx(numbers)
    assert read_columns([["1.234"], ["0,5"]], ";")[0][0] == [1234.0]
    assert math.isnan(to_number("0x1F"))


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("unix_time,pwm,counts", lambda t, u, n, w: f"{1.7e9 + t:.6f},{u:g},{n:g}"),
        ("Unix Time,PWM,Encoder", lambda t, u, n, w: f"{1.7e12 + 1e3 * t:.0f},{u:g},{n:g}"),
        ("epoch,pwm,counts", lambda t, u, n, w: f"{1.7e15 + 1e6 * t:.0f},{u:g},{n:g}"),
        ("%time,field.pwm,field.encoder", lambda t, u, n, w: f"{EPOCH_NS + round(1e9 * t)},{u:g},{n:g}"),
        (
            "%time,field.header.seq,field.header.frame_id,field.name0,field.position0,field.effort0",
            lambda t, u, n, w: f"{EPOCH_NS + round(1e9 * t)},3,,wheel,{n * COUNT_RAD:.6f},{u:g}",
        ),
        ("Date/Time,PWM,RPM", lambda t, u, n, w: f"3/1/2026 2:{clock(t)} PM,{u:g},{RPM * w:.4f}"),
        ("Datum;PWM;Drehzahl", lambda t, u, n, w: f"01.03.2026 14:{clock(t)};{u:g};{RPM * w:.4f}"),
        (",pwm,velocity", lambda t, u, n, w: f"2026-03-01 14:{clock(t)},{u:g},{w:.5f}"),
    ],
)  # fmt: skip
def test_times_since_an_epoch_and_dates(tmp_path: Path, header: str, row: Row) -> None:
    assert_read(tmp_path / "log.csv", table(header, row))


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("Time ms\tPWM\tspeed", lambda t, u, n, w: f"{1e3 * t:.0f}\t{u:g}\t{w:.5f}"),
        ('"Time (s)"\t"Motor PWM"\t"Wheel Speed (rad/s)"', lambda t, u, n, w: f"{t:.1f}\t{u:g}\t{w:.5f}"),
        ("Time (s)    Motor PWM    Speed (rad/s)", lambda t, u, n, w: f"{t:8.1f} {u:8g} {w:8.5f}"),
        ("# wheel 3\n# date, 2026-03-01\n# t u theta_dot", lambda t, u, n, w: f"{t:.1f} {u:g} {w:.5f}"),
        ("sep=;\nt/s;Tastgrad/%;n/(1/min)", lambda t, u, n, w: f"{t:.1f};{u / 2.55:.3f};{RPM * w:.3f}"),
        ("X_Value\tPWM\tSpeed (rad/s)\tComment", lambda t, u, n, w: f"{t:.1f}\t{u:g}\t{w:.5f}"),
        ("tiempo_s,Salida PWM,posicion_grados", lambda t, u, n, w: f"{t:.1f},{u:g},{0.3 * n:.2f}"),
        ("t_sec,duty_cycle,omega_rad_per_s", lambda t, u, n, w: f"{t:.1f},{u / 255.0:.6f},{w:.5f}"),
        ("Time;Soll-Drehzahl;Ist-Drehzahl;Stellwert", lambda t, u, n, w: f"{t:.1f};1;{RPM * w:.3f};{u:g}"),
        ("", lambda t, u, n, w: f'{{"t": {t:.1f}, "pwm": {u:g}, "rpm": {RPM * w:.4f}}}'),
        ("", lambda t, u, n, w: f"Time = {1e3 * t:.0f} ms, PWM = {u:g}, Wheel speed = {RPM * w:.3f} rpm"),
        ("boot", lambda t, u, n, w: f">pwm:{1e3 * t:.0f}:{u:g}\n>w:{1e3 * t:.0f}:{w:.5f}§rad/s"),
        ("", lambda t, u, n, w: f">t_ms:{1e3 * t:.0f}\n>pwm:{u:g}|g\n>w:{w:.5f}§rad/s|g"),
    ],
)  # fmt: skip
def test_separators_comments_and_plotters(tmp_path: Path, header: str, row: Row) -> None:
    assert_read(tmp_path / "log.txt", table(header, row))


def test_8_bit_codes_and_text_without_a_byte_order_mark(tmp_path: Path) -> None:
    text = table(
        "čas (s);střída (%);úhlová rychlost (rad/s)", lambda t, u, n, w: f"{t:.1f};{u / 2.55:.4f};{w:.5f}"
    )
    assert_read(tmp_path / "log.csv", text.replace(".", ",").encode("cp1250"))
    text = table(
        "Zeit (s);Stellgröße (%);Drehzahl (U/min)", lambda t, u, n, w: f"{t:.1f};{u / 2.55:.4f};{RPM * w:.5f}"
    )
    assert_read(tmp_path / "log.csv", text.encode("cp1252"))
    assert_read(tmp_path / "log.csv", text.encode("utf-16-le"))


@pytest.mark.parametrize("lead_s", [-0.03, 0.002])
def test_drive_and_output_in_different_rows(tmp_path: Path, lead_s: float) -> None:
    """As PlotJuggler exports two topics: the drive holds, and changes at its own time."""
    rows = [(t, f"{t:.4f},{u:g},") for t, u in zip(TIME_S, PWM, strict=True)]
    rows += [
        (t + lead_s, f"{t + lead_s:.4f},,{n * COUNT_RAD:.6f}") for t, n in zip(TIME_S, COUNTS, strict=True)
    ]
    text = "\n".join(
        ["__time,/cmd_pwm/data,/joint_states/wheel/position", *(text for _, text in sorted(rows))]
    )
    path = tmp_path / "log.csv"
    path.write_text(text)
    (log,) = read_logs(path)
    changes_s = log.time_s[1:][np.diff(log.drive) != 0.0]
    np.testing.assert_allclose(changes_s % 0.1, np.round(changes_s % 0.1 / 0.1) * 0.1, atol=1e-6)
    assert log.position_rad is not None
    assert np.isfinite(log.position_rad).sum() >= ROWS - 1
    assert log.period_s == pytest.approx(0.1, abs=1e-6)
    assert log.starts_segment.sum() == 1
    assert any("names no unit: read as rad" in warning for warning in log.warnings)
    assert any("different rows" in warning for warning in log.warnings)


def test_the_names_of_a_pid_library(tmp_path: Path) -> None:
    """`input` is the measurement and `output` the drive, as in Arduino's PID examples."""
    text = table("millis,setpoint,input,output", lambda t, u, n, w: f"{1e3 * t:.0f},5,{RPM * w:.4f},{u:g}")
    path = tmp_path / "log.csv"
    assert assert_read(path, text, output="input:rpm").has_setpoint
    with pytest.raises(ThumperError, match="--column output=input:UNIT"):
        read_logs(path)
    assert_read(path, text.replace("input", "Input (rpm)"))


@pytest.mark.parametrize("header", ["Time,Setpoint,Measured,Output", "millis,Setpoint,Input,Output"])
def test_a_chosen_output_that_follows_the_drive_is_a_speed(tmp_path: Path, header: str) -> None:
    """Without a unit it was read as rad and summed up as counts per row: a gain 24 times too small."""
    text = table(header, lambda t, u, n, w: f"{1e3 * t:.0f},5,{w:.5f},{u:g}")
    path, name = tmp_path / "log.csv", header.split(",")[2]
    log = assert_read(path, text, output=name)
    assert log.speed_rad_s is not None
    assert any(f"'{name}' names no unit: read as rad/s, because" in warning for warning in log.warnings)
    with pytest.raises(ThumperError, match=f"--column output={name}:UNIT"):
        read_logs(path)
    with pytest.raises(ThumperError, match=r"like a speed, not like a position; pass its unit"):
        assert_read(path, text, output=f"{name}:rad")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            table("time_s,pwm,speed", lambda t, u, n, w: f"{t:.1f},{u:g},{w:.4f}".replace(".", ",")),
            "semicolons",
        ),
        ("PK\x03\x04 workbook", "a workbook; save the sheet as CSV"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(content)
    with pytest.raises(ThumperError, match=message):
        read_logs(path)
