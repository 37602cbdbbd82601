"""Files as people write them: dialects, languages, chosen columns, guessed units, MATLAB and MCAP."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.wheel_plant import COUNT_RAD, Wheel, counted, steps_and_prbs
from scipy.io import savemat

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.recording.mcap_file import McapFile
from thumper.ros.codec import encode, message
from thumper_tuning.logs.column_names import SHOWN_UNITS, Quantity
from thumper_tuning.logs.columns import parse_header
from thumper_tuning.logs.guess_units import guess_time_unit
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.read import read_logs
from thumper_tuning.logs.roles import Choices, Role, motor_columns, parse_choices

ROWS = 500
TIME_S = np.arange(ROWS, dtype=float) * 0.1
PWM = steps_and_prbs(ROWS, 1)
COUNTS = counted(Wheel().drive(TIME_S, PWM, 1))
SPEED = np.concatenate(([0.0], np.diff(COUNTS) * COUNT_RAD / 0.1))


def write(path: Path, header: str, *columns: FloatArray, separator: str = ",") -> Path:
    rows = (separator.join(f"{value:.10g}" for value in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def assert_wheel(logs: list[MotorLog], drive_scale: float = 1.0, sign: float = 1.0) -> MotorLog:
    """Assert that the first log holds the wheel's time, drive, and speeds or positions; return it."""
    log = logs[0]
    assert drive_scale != 1.0 or log.drive_unit is DriveUnit.PWM
    assert log.starts_segment.sum() <= 2  # one counter is reset once
    values = log.speed_rad_s if log.position_rad is None else log.position_rad
    assert values is not None
    rows = np.flatnonzero(np.isfinite(values))
    np.testing.assert_allclose(np.diff(log.time_s[rows]), np.diff(TIME_S), atol=2e-3)
    np.testing.assert_allclose(log.drive[rows], sign * drive_scale * PWM, atol=0.02)
    if log.position_rad is None:
        np.testing.assert_allclose(values[rows], sign * SPEED, atol=2e-3)
    else:
        turned, no_reset = np.diff(values[rows]), ~log.starts_segment[rows][1:]
        np.testing.assert_allclose(turned[no_reset], sign * np.diff(COUNTS)[no_reset] * COUNT_RAD, atol=1e-3)
    return log


@pytest.mark.parametrize(
    ("header", "separator", "columns"),
    [
        ("Tiempo (s), PWM, Voltaje (V), Velocidad (rad/s)", ",", (TIME_S, PWM, PWM / 28.0, SPEED)),
        ("Zeit [ms];Stellgröße [%];Drehzahl [1/min]", ";", (1e3 * TIME_S, PWM / 2.55, SPEED * 9.5492966)),
        ("Timestamp,Target,MotorPWM,Encoder", ",", (1e3 * TIME_S, 0.1 * PWM, PWM, COUNTS)),
        ("millis()\tMotor Speed (RPM)\tPWM Value", "\t", (1e3 * TIME_S, SPEED * 9.5492966, PWM)),
        ("t u theta", " ", (TIME_S, PWM, COUNTS)),
        ("time | pwm | encoder count | temp (°C)", "|", (TIME_S, PWM, COUNTS, 0.0 * PWM)),
        ("time_s,current_speed_rad_s,pwm,position (furlong)", ",", (TIME_S, SPEED, PWM, COUNTS)),
        ("Zeit;PWM-Wert;Drehzahl", ";", (TIME_S, PWM, SPEED * 9.5492966)),
        ("Čas [ms];Hodnota PWM;Otáčky [ot/min]", ";", (1e3 * TIME_S, PWM, SPEED * 9.5492966)),
        ("Czas (s),PWM,Prędkość (rad/s)", ",", (TIME_S, PWM, SPEED)),
        ("Time (µs),PWM,Encoder Position (deg)", ",", (1e6 * TIME_S, PWM, COUNTS * 0.3)),
        ("ms,pwm,rad/s", ",", (1e3 * TIME_S, PWM, SPEED)),
        ("time_s,pwm,rad_s", ",", (TIME_S, PWM, SPEED)),
        ("time_s,pwm,dir,counts", ",", (TIME_S, np.abs(PWM), 1.0 * (PWM > 0.0), COUNTS)),
        ("time_s,pwm,direction,counts", ",", (TIME_S, np.abs(PWM), np.sign(PWM), COUNTS)),
    ],
)
def test_headers_are_understood(
    tmp_path: Path, header: str, separator: str, columns: tuple[FloatArray, ...]
) -> None:
    assert_wheel(read_logs(write(tmp_path / "log.csv", header, *columns, separator=separator)))


def test_the_preview_names_columns_units_and_what_is_not_used(tmp_path: Path) -> None:
    header = "Timestamp,Target,MotorPWM,Encoder,Temp"
    log = assert_wheel(
        read_logs(write(tmp_path / "log.csv", header, 1e3 * TIME_S, PWM, PWM, COUNTS, 0.0 * PWM))
    )
    text = "\n".join(log.columns)
    assert "time: column 'Timestamp' [s, every 100 ms]" in text
    assert "drive: column 'MotorPWM' [PWM of 255, -200 ... 200]" in text
    assert "not used: Temp" in text
    assert any("'Timestamp' names no unit: read as ms" in warning for warning in log.warnings)
    assert log.has_setpoint


def test_the_preview_names_the_unit_of_the_file(tmp_path: Path) -> None:
    for header, scale, unit in (
        ("speed_rpm", 30.0 / np.pi, "rpm, read as rad/s"),
        ("speed_deg_s", 180.0 / np.pi, "deg/s, read as rad/s"),
        ("speed_rad_s", 1.0, "rad/s"),
    ):
        path = write(tmp_path / "log.csv", f"time_s,pwm,{header}", TIME_S, PWM, scale * SPEED)
        assert f"output: column '{header}' [{unit}, -" in "\n".join(read_logs(path)[0].columns)


@pytest.mark.parametrize(
    ("period", "unit"),
    [(0.01, "s"), (0.1, "s"), (0.5, "s"), (5.0, "ms"), (20.0, "ms"), (100.0, "ms"), (5e3, "us"), (1e5, "us")],
)
def test_the_unit_of_the_time_follows_from_the_period(period: float, unit: str) -> None:
    assert guess_time_unit(period * np.arange(50.0) + 1234.0)[0] == unit


@pytest.mark.parametrize(
    ("header", "choices"),
    [
        ("a,b,c", ["time=a", "drive=b", "output=c"]),
        ("a,b,c", ["time=1", "drive=2:pwm", "output=3:counts"]),
        ("pwm,speed,counts", ["time=pwm:s", "drive=speed:pwm", "output=counts"]),
    ],
)
def test_columns_can_be_chosen(tmp_path: Path, header: str, choices: list[str]) -> None:
    path = write(tmp_path / "log.csv", header, TIME_S, PWM, COUNTS)
    assert_wheel(read_logs(path, choices=parse_choices(choices)))


def test_a_file_of_numbers_alone_needs_the_columns(tmp_path: Path) -> None:
    path = write(tmp_path / "log.txt", "0.1 60 0", TIME_S[1:] + 0.1, PWM[1:], SPEED[1:], separator=" ")
    with pytest.raises(ThumperError, match="--column output=HEADER:UNIT"):
        read_logs(path)
    assert_wheel(read_logs(path, choices=parse_choices(["time=1", "drive=2", "output=3:rad/s"])))


@pytest.mark.parametrize(
    ("choice", "message_"),
    [
        ("speed=a", "pass ROLE=HEADER"),
        ("drive", "pass ROLE=HEADER"),
        ("drive=z", r"no column 'z' \(columns: a, b, c\)"),
        ("drive=9", "no column '9'"),
        ("time=a:furlong", "unknown unit 'furlong'; pass --column time=a:UNIT with one of: s, ms, us"),
        ("output=c:blorp", "one of: counts, rad, deg, rev, rad/s, deg/s, rev/s, rpm, counts/s"),
    ],
)
def test_a_wrong_choice_is_named(tmp_path: Path, choice: str, message_: str) -> None:
    path = write(tmp_path / "log.csv", "a,b,c", TIME_S, PWM, COUNTS)
    with pytest.raises(ThumperError, match=message_):
        read_logs(path, choices={**parse_choices(["output=c"]), **parse_choices([choice])})


def test_the_units_of_an_error_are_known(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", "a,b,c", TIME_S, PWM, COUNTS)
    headers = {Role.TIME: "a", Role.DRIVE: "b", Role.OUTPUT: "c"}
    for role in headers:
        for unit in (unit for quantity in role.value for unit in SHOWN_UNITS.get(quantity, ())):
            choices: Choices = {
                other: (f"{name}:{unit}" if other is role else name,) for other, name in headers.items()
            }
            motor_columns(path, ("a", "b", "c"), choices)


@pytest.mark.parametrize(("header", "unit"), [("Drehzahl", "rpm"), ("vel", "rad/s")])
def test_a_speed_without_a_unit_is_named(tmp_path: Path, header: str, unit: str) -> None:
    (log,) = read_logs(write(tmp_path / "log.csv", f"time_s,pwm,{header}", TIME_S, PWM, SPEED))
    assert any(f"column '{header}' names no unit: read as {unit}" in warning for warning in log.warnings)


def test_an_unknown_unit_stops_only_a_column_that_is_needed(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", "time_s,pwm,speed (furlong)", TIME_S, PWM, SPEED)
    with pytest.raises(ThumperError, match=r"unknown unit 'furlong'.*--column"):
        read_logs(path)
    assert_wheel(read_logs(path, choices=parse_choices(["output=3:rad/s"])))


def test_a_drive_logged_after_its_interval_is_shifted(tmp_path: Path) -> None:
    """The loop sets the PWM, waits, measures and logs: the row holds the drive before it."""
    before = np.concatenate(([0.0], PWM[:-1]))
    log = assert_wheel(read_logs(write(tmp_path / "log.csv", "time_s,pwm,counts", TIME_S, before, COUNTS)))
    assert any("same row as the drive" in warning for warning in log.warnings)
    log = assert_wheel(read_logs(write(tmp_path / "log.csv", "time_s,pwm,counts", TIME_S, PWM, COUNTS)))
    assert not log.warnings


def test_matlab_files(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {"run": {"t": TIME_S, "u": PWM, "speed_rad_s": SPEED}, "Ts": 0.1, "name": "motor 3"})
    assert_wheel(read_logs(path))
    savemat(path, {"Time_ms": 1e3 * TIME_S[:, None], "voltage_V": PWM[:, None] / 10.0, "counts": COUNTS})
    assert_wheel(read_logs(path), 0.1)
    signals = [{"values": PWM, "label": "pwm"}, {"values": SPEED, "label": "speed_rad_s"}]
    savemat(path, {"out": {"time": TIME_S, "signals": signals, "blockName": "motor/Scope"}})
    assert_wheel(read_logs(path))
    savemat(path, {"pwm": {"Time": TIME_S, "Data": PWM}, "counts": {"Time": TIME_S, "Data": COUNTS}})
    assert_wheel(read_logs(path))
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(400))
    with pytest.raises(ThumperError, match=r"log\.mat"):
        read_logs(path)


def record_joints(path: Path, drive: FloatArray, topics: dict[str, str], joints: int = 1) -> Path:
    """Record a ROS 2 robot of equal wheels; the drive is their effort, or goes to topics of std_msgs."""
    file = McapFile(path, {})
    for k, time_s in enumerate(TIME_S):
        stamp_ns = round(1e9 * (time_s + 1.7e9))
        stamp = message("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        header = message("std_msgs/msg/Header", stamp=stamp, frame_id="")
        for topic, type_name in topics.items():
            value = round(drive[k]) if "Int" in type_name else drive[k]
            file.add(topic, type_name, stamp_ns, encode(message(type_name, data=value)))
        state = message(
            "sensor_msgs/msg/JointState",
            header=header,
            name=["wheel", "other"][:joints],
            position=np.full(joints, COUNTS[k] * COUNT_RAD),
            velocity=np.zeros(0),
            effort=np.zeros(0) if topics else np.full(joints, drive[k]),
        )
        file.add("/joint_states", state.__msgtype__, stamp_ns, encode(state))
    file.close()
    return path


FLOAT, INT = "std_msgs/msg/Float64", "std_msgs/msg/Int16"


@pytest.mark.parametrize(
    ("drive", "topics", "scale", "unit"),
    [
        (PWM / 28.0, {"/wheel/cmd": FLOAT}, 1.0 / 28.0, "volts"),
        (PWM / 28.0, {}, 1.0 / 28.0, "volts"),
        (PWM, {"/wheel/cmd": INT}, 1.0, "PWM of 255"),
        (PWM, {"/wheel_pwm": FLOAT, "/battery_voltage": FLOAT}, 1.0, "PWM of 255"),
        (PWM / 255.0, {"/wheel/cmd": FLOAT}, 1.0, "duty ratio"),
    ],
)
def test_joint_states_of_a_ros_2_robot(
    tmp_path: Path, drive: FloatArray, topics: dict[str, str], scale: float, unit: str
) -> None:
    log = assert_wheel(read_logs(record_joints(tmp_path / "log.mcap", drive, topics)), scale)
    assert any(f"taken as {unit}" in warning for warning in log.warnings)


def test_the_unit_of_a_command_can_be_chosen(tmp_path: Path) -> None:
    """A robot of 60 PWM at most looks like one of 60 V."""
    path = record_joints(tmp_path / "log.mcap", PWM / 4.0, {"/wheel/cmd": FLOAT})
    assert any("pass --column drive=command_V:UNIT" in warning for warning in read_logs(path)[0].warnings)
    assert_wheel(read_logs(path, choices=parse_choices(["drive=command_V:pwm"])), 0.25)


def test_a_truncated_recording_is_named(tmp_path: Path) -> None:
    path = record_joints(tmp_path / "log.mcap", PWM, {})
    whole = path.read_bytes()
    path.write_bytes(whole[:-300])  # within the index: all messages are left
    assert any("damaged file: log.mcap ends early" in warning for warning in read_logs(path)[0].warnings)
    path.write_bytes(whole[: len(whole) // 8])
    with pytest.raises(ThumperError, match=r"damaged file: log\.mcap ends early.*copy the file again"):
        read_logs(path)


def test_each_motor_has_the_note_of_its_own_joint(tmp_path: Path) -> None:
    path = record_joints(tmp_path / "log.mcap", PWM, {}, joints=2)
    for motor, log in zip(("m1", "m2"), read_logs(path), strict=True):
        assert [warning.split(" is joint")[0] for warning in log.warnings] == [motor]


def test_several_possible_commands_are_named(tmp_path: Path) -> None:
    path = record_joints(tmp_path / "log.mcap", PWM, {"/arm_cmd": FLOAT, "/gripper_cmd": FLOAT})
    with pytest.raises(ThumperError, match="which topic drives joint 'wheel': /arm_cmd, /gripper_cmd"):
        read_logs(path)


@pytest.mark.parametrize("name", ["m1_pwm,m1_counts,m2_pwm,m2_counts", "pwm1,counts1,pwm2,counts2"])
def test_numbered_motors(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / "log.csv", f"time_s,{name}", TIME_S, PWM, COUNTS, -PWM, -COUNTS)
    logs = read_logs(path)
    assert [log.name for log in logs] == ["m1", "m2"]
    assert_wheel(logs[1:], sign=-1.0)


def test_qualifiers_do_not_hide_a_quantity() -> None:
    for header, quantity in (
        ("Motor Current (mA)", Quantity.CURRENT),
        ("current_position", Quantity.COUNTS),
        ("measured wheel speed [rad/s]", Quantity.SPEED),
        ("Battery Voltage", Quantity.BATTERY),
        ("motorPWM", Quantity.PWM),
    ):
        column = parse_header(header, 0)
        assert column is not None
        assert column.quantity is quantity


def test_a_matlab_matrix_needs_only_the_roles(tmp_path: Path) -> None:
    choices = parse_choices(["time=1:s", "drive=2:pwm", "output=3:counts"])
    for name, matrix in (
        ("rows", np.column_stack((TIME_S, PWM, COUNTS))),
        ("columns", [TIME_S, PWM, COUNTS]),
    ):
        path = tmp_path / f"{name}.mat"
        savemat(path, {"data": matrix})
        assert_wheel(read_logs(path, choices=choices))


def test_iso_dates_with_and_without_a_time_of_day(tmp_path: Path) -> None:
    stamps = [datetime(2026, 3, 1, 12, 59, 50) + timedelta(seconds=float(t)) for t in TIME_S]
    for header, texts in (
        ("date,pwm,counts", [f"{s.isoformat(sep=' ', timespec='milliseconds')}" for s in stamps]),
        ("date,time,pwm,counts", [f"{s.date()},{s.time().isoformat('milliseconds')}" for s in stamps]),
    ):
        rows = [f"{text},{u:g},{n:g}" for text, u, n in zip(texts, PWM, COUNTS, strict=True)]
        path = tmp_path / "iso.csv"
        path.write_text("\n".join([header, *rows]))
        assert_wheel(read_logs(path))


def test_lines_of_a_serial_monitor(tmp_path: Path) -> None:
    """Pairs of the serial plotter, and the monitor's stamps where the lines have no time of their own."""
    path = tmp_path / "monitor.txt"
    rows = list(zip(TIME_S, PWM, SPEED, strict=True))
    path.write_text(
        "booting\n" + "\n".join(f"time:{1e3 * t:.0f} pwm:{u:g} speed:{w:.6g}" for t, u, w in rows)
    )
    assert_wheel(read_logs(path))
    clock = [(datetime(2026, 3, 1, 14, 23, 10) + timedelta(seconds=float(t))).time() for t in TIME_S]
    stamps = [time.isoformat("milliseconds") for time in clock]
    for header, texts in (
        (["14:23:09.900 -> pwm,rad_s"], [f"{u:g},{w:.6g}" for _, u, w in rows]),
        ([], [f"pwm:{u:g},rad_s:{w:.6g}" for _, u, w in rows]),
    ):
        lines = [f"{stamp} -> {text}" for stamp, text in zip(stamps, texts, strict=True)]
        path.write_text("\n".join([*header, *lines]))
        assert_wheel(read_logs(path))


def test_a_set_point_of_zero_is_no_closed_loop(tmp_path: Path) -> None:
    for target, closed in ((0.0 * PWM, False), (0.1 * PWM, True)):
        path = write(tmp_path / "log.csv", "time_s,Target,pwm,counts", TIME_S, target, PWM, COUNTS)
        assert read_logs(path)[0].has_setpoint is closed


@pytest.mark.parametrize(
    ("header", "values"),
    [
        ("theta (rad)", (COUNTS * COUNT_RAD) % (2.0 * np.pi)),
        ("position (rad)", (COUNTS * COUNT_RAD + np.pi) % (2.0 * np.pi) - np.pi),
        ("Angle (°)", (COUNTS * 0.3) % 360.0),
        ("counts", COUNTS % 1200.0),
    ],
)
def test_an_angle_that_wraps_each_turn_is_unwrapped(tmp_path: Path, header: str, values: FloatArray) -> None:
    path = write(tmp_path / "log.csv", f"time_s,pwm,{header}", TIME_S, PWM, values)
    (log,) = read_logs(path)
    assert "the angle wraps each turn: unwrapped" in log.warnings
    assert log.position_rad is not None
    offset_rad = log.position_rad - COUNTS * COUNT_RAD
    assert np.ptp(offset_rad) < 1e-6


def test_an_angle_that_wraps_too_fast_for_its_rows_is_rejected(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", "time_s,pwm,theta (rad)", TIME_S, PWM, (COUNTS * 0.1) % (2.0 * np.pi))
    with pytest.raises(ThumperError, match="nearly half a turn per row: log it faster"):
        read_logs(path)


@pytest.mark.parametrize(
    ("header", "output", "has_setpoint"),
    [
        ("t (s),ref (rad/s),u (PWM),y (rad/s)", SPEED, True),
        ("t,y_ref,u,y [counts]", COUNTS, True),
        ("t (s),r (rad/s),u (PWM),y (rad/s)", SPEED, True),
        ("time_s,error (rad/s),output (PWM),y (rad/s)", SPEED, False),
    ],
)
def test_the_letters_of_a_control_lecture_are_read(
    tmp_path: Path, header: str, output: FloatArray, has_setpoint: bool
) -> None:
    path = write(tmp_path / "log.csv", header, TIME_S, 0.0 * PWM + 3.0, PWM, output)
    (log,) = read_logs(path)
    assert log.has_setpoint == has_setpoint
    np.testing.assert_allclose(log.drive, PWM)
    if output is SPEED:
        assert log.speed_rad_s is not None
        np.testing.assert_allclose(log.speed_rad_s, SPEED, atol=1e-6)
    else:
        assert log.position_rad is not None
        np.testing.assert_allclose(log.position_rad, COUNTS * COUNT_RAD, atol=1e-6)


@pytest.mark.parametrize(
    ("header", "scale", "shown"),
    [("angle (rad)", 1.0, "rad"), ("theta_deg", 180.0 / np.pi, "deg, read as rad")],
)
def test_an_angle_is_shown_in_radians(tmp_path: Path, header: str, scale: float, shown: str) -> None:
    path = write(tmp_path / "log.csv", f"time,pwm,{header}", TIME_S, PWM, scale * COUNT_RAD * COUNTS)
    (log,) = read_logs(path)
    largest = COUNT_RAD * COUNTS.max()
    assert any(header in line and f"[{shown}, " in line and f"{largest:.4g}]" in line for line in log.columns)
