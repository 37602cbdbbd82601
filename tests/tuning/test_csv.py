"""Logs of any origin: names, units, separators, counter wraps; and rejected logs with their messages."""

import json
import math
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import COUNT_RAD, Wheel, counted

from tests.tuning.test_headers import COUNTS, PWM, ROWS, SPEED, TIME_S, assert_wheel
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper_tuning.cli.fit import fit_files
from thumper_tuning.logs.column_names import Quantity
from thumper_tuning.logs.columns import parse_header
from thumper_tuning.logs.encoder_counts import unwrap
from thumper_tuning.logs.read import read_logs

WHEEL = Wheel()
NAMES = "time_s,pwm,counts"
DATA_FAIL = {  # of a file that is read
    "no excitation",
    "does not move",
    "it is clipped or limited",
    "sign of the speed",
    "explains only",
}

Fit = Callable[..., dict[str, object]]


def write(path: Path, header: str, *columns: FloatArray, separator: str = ",", before: str = "") -> Path:
    """Write columns below a header; a semicolon brings decimal commas."""
    rows = (
        separator.join("" if math.isnan(x) else f"{x:.14g}" for x in row)
        for row in zip(*columns, strict=True)
    )
    text = before + header.replace(",", separator) + "\n" + "\n".join(rows) + "\n"
    path.write_text(text.replace(".", ",") if separator == ";" else text)
    return path


@pytest.fixture
def fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Fit:
    """Write columns to a file, fit it, and return the printed JSON."""

    def run(header: str, *columns: FloatArray) -> dict[str, object]:
        fit_files([write(tmp_path / "log.csv", header, *columns)], counts_per_rev=1200.0, as_json=True)
        printed: dict[str, object] = json.loads(capsys.readouterr().out)
        return printed

    return run


def assert_good(result: dict[str, object], unit: str = "pwm", scale: float = 1.0) -> None:
    assert result[f"gain_rad_s_per_{unit}"] == pytest.approx(WHEEL.gain / scale, rel=0.02)
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.05)
    assert result[f"static_friction_{unit}"] == pytest.approx(WHEEL.friction * scale, abs=2.0 * scale)
    for key in (f"gain_rad_s_per_{unit}", "time_constant_s", f"static_friction_{unit}", "delay_s"):
        assert isinstance(result[f"{key}_std"], float)
    assert float(str(result["fit_percent"])) > 93.0
    assert isinstance(result["warnings"], list)


def test_the_documented_columns(fit: Fit) -> None:
    assert_good(fit(NAMES, TIME_S, PWM, COUNTS))


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("time_s,pwm,speed_rad_s", (TIME_S, PWM, SPEED)),
        ("time_ms,pwm,speed_rpm", (1e3 * TIME_S, PWM, SPEED * 30.0 / math.pi)),
        ("Timestamp (us),Left PWM,Left Encoder Counts", (1e6 * TIME_S, PWM, COUNTS)),
        ("t,u,Speed (steps/s)", (TIME_S, PWM, SPEED / COUNT_RAD)),
        ("time_s,duty,counts", (TIME_S, PWM / 255.0, COUNTS)),
        ("time_s,pwm,counts,note", (TIME_S, PWM, COUNTS, PWM)),
        ("time_s,pwm,counts", (TIME_S + 1.7e9, PWM, COUNTS % 65536)),
        ("time_s,pwm,counts", (TIME_S, PWM, (COUNTS + 32768) % 65536 - 32768)),
        ("time_s,pwm,counts", (TIME_S, PWM, (COUNTS + 2**32 - 3000) % 2**32)),
        ("time_s,pwm,counts", (TIME_S, PWM, np.concatenate(([0.0], np.diff(COUNTS))))),
        ("time_s,pwm,counts", (TIME_S, PWM, np.where(TIME_S > 25.0, COUNTS - COUNTS[250], COUNTS))),
    ],
)
def test_other_names_units_and_counters(tmp_path: Path, header: str, columns: tuple[FloatArray, ...]) -> None:
    logs = read_logs(write(tmp_path / "log.csv", header, *columns))
    assert len(logs) == 1
    assert_wheel(logs)


def test_drive_in_volts(fit: Fit) -> None:
    assert_good(fit("time_s,voltage_V,counts", TIME_S, PWM * 7.4 / 255.0, COUNTS), "V", 7.4 / 255.0)


def test_semicolons_decimal_commas_and_a_preamble(tmp_path: Path) -> None:
    before = "recorded by a friend\n\n# robot 7\n"
    path = write(tmp_path / "log.csv", NAMES, TIME_S, PWM, COUNTS, separator=";", before=before)
    assert_wheel(read_logs(path))


def test_missing_cells_and_rows(fit: Fit) -> None:
    rng = np.random.default_rng(0)
    pwm, counts = PWM.copy(), COUNTS.copy()
    pwm[rng.choice(ROWS, 10, replace=False)] = np.nan
    counts[rng.choice(ROWS, 20, replace=False)] = np.nan
    keep = rng.random(ROWS) > 0.05
    result = fit(NAMES, TIME_S[keep], pwm[keep], counts[keep])
    assert_good(result)
    assert "gaps" in str(result["warnings"])


@pytest.mark.parametrize("ceiling_rad_s", [7.0, 5.5])
def test_clipped_speeds_are_fitted_where_they_are_not_clipped(fit: Fit, ceiling_rad_s: float) -> None:
    speed = SPEED.clip(-ceiling_rad_s, ceiling_rad_s)
    result = fit("time_s,pwm,speed_rad_s", TIME_S, PWM, speed)
    assert_good(result)
    warnings = str(result["warnings"])
    assert "the speed is saturated" in warnings
    assert f"stay at {ceiling_rad_s:g} rad/s" in warnings


@pytest.mark.slow
def test_fast_rows_with_clipped_speeds(fit: Fit) -> None:
    time_s, pwm = 0.05 * np.arange(800.0), np.repeat(PWM[:400], 2)
    counts = counted(WHEEL.drive(time_s, pwm, 4))
    speed = np.diff(counts, prepend=counts[0]) * COUNT_RAD / 0.05
    result = fit("time_s,pwm,speed_rad_s", time_s, pwm, speed.clip(-6.0, 6.0))
    assert result["gain_rad_s_per_pwm"] == pytest.approx(WHEEL.gain, rel=0.03)
    assert result["time_constant_s"] == pytest.approx(WHEEL.tau_s, rel=0.08)
    assert "saturated" in str(result["warnings"])


@pytest.mark.slow
def test_clipped_speeds_may_be_coarse(fit: Fit) -> None:
    """One count is 3 % of the ceiling; the drives there differ by more than that."""
    time_s = 0.02 * np.arange(750.0)
    pwm = np.repeat(
        (0.0, 60.0, 0.0, 110.0, 0.0, -60.0, 0.0, -160.0, 0.0, 255.0, 0.0, -255.0, 0.0, 110.0, 0.0), 50
    )
    counts = counted(WHEEL.drive(time_s, pwm, 4))
    speed = np.diff(counts, prepend=counts[0]) * COUNT_RAD / 0.02
    result = fit("time_s,pwm,speed_rad_s", time_s, pwm, speed.clip(-8.0, 8.0))
    assert result["gain_rad_s_per_pwm"] == pytest.approx(WHEEL.gain, rel=0.03)
    assert result["static_friction_pwm"] == pytest.approx(WHEEL.friction, abs=2.0)
    assert "saturated" in str(result["warnings"])


@pytest.mark.slow
def test_speeds_of_one_count_are_named_as_too_coarse(fit: Fit) -> None:
    """48 counts per revolution over 10 ms, logged each 5 ms: one count is 13 rad/s."""
    time_s = 0.005 * np.arange(3000.0)
    pwm = np.repeat(np.tile((0.0, 90.0, 0.0, -140.0, 0.0, 200.0), 5), 100)
    counts = np.floor(WHEEL.drive(time_s, pwm, 4) * 48.0 / math.tau)
    speed = (counts - np.concatenate(([0.0, 0.0], counts[:-2]))) * math.tau / 48.0 / 0.01
    with pytest.raises(ThumperError, match=r"too coarse.*the values 0, 13\.1 rad/s.*log the counts"):
        fit("time_s,pwm,speed_rad_s", time_s, pwm, speed)


@pytest.mark.slow
def test_a_kind_of_stretch_that_does_not_move_is_not_scored(fit: Fit) -> None:
    """1.5 s of rest are no steps that the model fails to predict."""
    time_s = 0.02 * np.arange(1000.0)
    pwm = np.where(time_s < 1.5, 0.0, np.round(180.0 * np.cos(2.0 * (time_s - 1.5))))
    speed = np.diff(counted(WHEEL.drive(time_s, pwm, 4)), prepend=0.0) * COUNT_RAD / 0.02
    result = fit("time_s,pwm,speed_rad_s", time_s, pwm, speed)
    assert set(result["fit_percent_by_kind"]) == {"ramps"}  # type: ignore[call-overload]
    assert "held-out steps" not in str(result["warnings"])


@pytest.mark.slow
def test_speeds_that_repeat_are_named(fit: Fit) -> None:
    """A motor controller sends a speed each 20 ms; the log has a row each 5 ms."""
    time_s = 0.005 * np.arange(1500.0)
    pwm = np.repeat((0.0, 90.0, 0.0, -140.0, 0.0, 200.0, 0.0, -60.0, 120.0, 180.0), 150)
    angle = WHEEL.drive(time_s, pwm, 4)
    speed = np.repeat(np.diff(angle[::4], prepend=0.0) / 0.02, 4)
    result = fit("time_s,pwm,speed_rad_s", time_s, pwm, speed)
    assert "each speed repeats for 20 ms" in str(result["warnings"])


def test_a_reversed_encoder_gives_a_warning(fit: Fit) -> None:
    result = fit(NAMES, TIME_S, PWM, -COUNTS)
    assert_good(result)
    assert "other way round" in str(result["warnings"])


def test_two_wheels_in_one_file(fit: Fit) -> None:
    result = fit(
        "time_s,left_pwm,left_counts,right_pwm,right_counts", TIME_S, PWM, COUNTS, PWM, np.floor(0.9 * COUNTS)
    )
    left, right = result["left"], result["right"]
    assert isinstance(left, dict)
    assert isinstance(right, dict)
    assert_good(left)
    assert right["gain_rad_s_per_pwm"] == pytest.approx(0.9 * WHEEL.gain, rel=0.02)


@pytest.mark.parametrize(
    ("header", "columns", "message"),
    [
        (NAMES, (TIME_S, 0.0 * PWM, 0.0 * COUNTS), "no excitation"),
        (NAMES, (TIME_S, PWM, 0.0 * COUNTS), "does not move"),
        ("time_s,pwm,speed_rad_s", (TIME_S, PWM, 4.0 * np.tanh(SPEED / 3.0)), "it is clipped or limited"),
        (NAMES, (TIME_S[:12], PWM[:12], COUNTS[:12]), "too few"),
        (NAMES, (1e3 * TIME_S, PWM, COUNTS), "time_ms"),
        (NAMES, (TIME_S, PWM / 255.0, COUNTS), "--column drive=pwm:duty"),
        ("time_s,voltage_V,counts", (TIME_S, PWM, COUNTS), "pwm"),
        ("time_s,pwm,speed_rad_s", (TIME_S, PWM, SPEED * 30.0 / math.pi), "speed_rpm"),
        ("time_s,pwm,speed_rad_s", (TIME_S, PWM, np.abs(SPEED)), "sign of the speed"),
        (NAMES, (TIME_S, np.random.default_rng(3).permutation(PWM), COUNTS), "explains only"),
        ("time_s,counts", (TIME_S, COUNTS), "no column pwm"),
        ("a,b,c", (TIME_S, PWM, COUNTS), "no column holds counts"),
    ],
)
def test_an_unusable_log_is_rejected_in_one_line(
    fit: Fit, header: str, columns: tuple[FloatArray, ...], message: str
) -> None:
    with pytest.raises(ThumperError, match=message) as rejected:
        fit(header, *columns)
    assert rejected.value.exit_code == (4 if message in DATA_FAIL else 2)
    assert "\n" not in str(rejected.value)


@pytest.mark.parametrize(
    ("header", "quantity", "scale"),
    [
        ("Time [ms]", Quantity.TIME, 1e-3),
        ("voltage_mV", Quantity.VOLTAGE, 1e-3),
        ("left_speed_rad_s", Quantity.SPEED, 1.0),
        ("omega (deg/s)", Quantity.SPEED, math.pi / 180.0),
        ("encoderTicks", Quantity.COUNTS, 1.0),
        ("PWM (%)", Quantity.PWM, 2.55),
    ],
)
def test_headers(header: str, quantity: Quantity, scale: float) -> None:
    column = parse_header(header, 0)
    assert column is not None
    assert column.quantity is quantity
    assert column.scale == pytest.approx(scale)


def test_a_set_point_is_not_a_measurement() -> None:
    for header in ("left_setpoint_rad_s", "Target", "desired velocity", "Sollwert"):
        column = parse_header(header, 0)
        assert column is not None
        assert column.quantity is Quantity.SETPOINT
    assert parse_header("speed error", 0) is None


@pytest.mark.parametrize("bits", [16, 32])
def test_unwrap_is_exact(bits: int) -> None:
    true = np.cumsum(np.random.default_rng(0).integers(-900, 2000, 3000)).astype(float) * 2.0 ** (bits - 16)
    unwrapped, found = unwrap(true % 2.0**bits)
    assert found == bits
    assert np.diff(unwrapped) == pytest.approx(np.diff(true))


def test_units_in_a_row_below_the_header(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    header = "Zeit,Sollwert,Stellgröße,Drehzahl\n[s],[1/min],[%],[1/min]"
    speed_rpm = SPEED * 30.0 / math.pi
    write(path, header, TIME_S, 0.0 * PWM, PWM / 2.55, speed_rpm, separator=";")
    assert_wheel(read_logs(path))
    header = "time,pwm,speed\n(ms),,(deg/s)"
    assert_wheel(read_logs(write(path, header, 1e3 * TIME_S, PWM, np.degrees(SPEED))))


def test_infinite_counts_are_missing(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [
        f"{t:g},{u:g},{'inf' if k in (100, 101) else c:}"
        for k, (t, u, c) in enumerate(zip(TIME_S, PWM, COUNTS, strict=True))
    ]
    path.write_text("\n".join((NAMES, *rows)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (log,) = read_logs(path)
    assert log.position_rad is not None
    assert np.flatnonzero(np.isnan(log.position_rad)).tolist() == [100, 101]


def test_a_ten_bit_pwm_is_not_at_the_limit_of_eight_bits(fit: Fit) -> None:
    notes = str(fit(NAMES, TIME_S, 4.0 * PWM, COUNTS)["warnings"])
    assert "beyond 255" in notes
    assert "at its limit" not in notes


def _sysid(path: Path, **changes: object) -> Path:
    rows = np.column_stack((TIME_S, PWM / 34.0, COUNTS, SPEED)).tolist()
    content = {"test": "Simple", "units": "Rotations", "unitsPerRotation": 1.0, "slow-forward": rows}
    path.write_text(json.dumps(content | changes))
    return path


def test_units_per_rotation_of_a_sysid_recording(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    for value in (0.0, -1.0):
        with pytest.raises(ThumperError, match="unitsPerRotation is"):
            read_logs(_sysid(path, units="Meters", unitsPerRotation=value))
    (log,) = read_logs(_sysid(path, units="Radians", unitsPerRotation=0))
    assert log.position_rad is not None
    with pytest.raises(ThumperError, match=r"log\.json: column 'time' does not increase"):
        read_logs(_sysid(path, **{"slow-forward": [[0.0, 1.0, 2.0, 3.0]] * 30}))
    np.testing.assert_array_equal(log.position_rad, COUNTS)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"a": 1}', r"recording \(no key 'units'\)"),
        ("[1, 2]", "recording; pass"),
        ("{", r"recording \(Expecting"),
    ],
)
def test_other_json_is_no_sysid_recording(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "log.json"
    path.write_text(text)
    with pytest.raises(ThumperError, match=why):
        read_logs(path)


@pytest.mark.parametrize("test", ["Elevator", "Arm"])
def test_gravity_of_a_sysid_recording_gives_a_warning(tmp_path: Path, test: str) -> None:
    (log,) = read_logs(_sysid(tmp_path / "log.json", test=test))
    assert f"{test}: the model has no gravity" in str(log.warnings)
    assert not read_logs(_sysid(tmp_path / "log.json"))[0].warnings
